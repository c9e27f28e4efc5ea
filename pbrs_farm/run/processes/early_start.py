"""Render processes that start before the run is known: they load their libraries meanwhile.

Effects: starts processes. Whoever started one ends it with end_untaken() where no run takes it; it
ends with this one at the latest, as all render processes do.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Final

from pbrs_farm.run.processes.child_process import ChildProcess

FINISHING_HANDLER: Final = "pbrs_farm.run.run_task:make_finishing_handler"
"""Factory of the handler that makes houses and finishes views."""

# Target -> a process that nobody has taken, and the folder of its log.
STARTED: Final[dict[str, tuple[ChildProcess, tempfile.TemporaryDirectory[str]]]] = {}


def start_early(target: str) -> None:
    """Start a process of `target` for the next child_of, once per target; call `end_untaken` at the end."""
    folder = tempfile.TemporaryDirectory(prefix="pbrs-farm-")
    STARTED[target] = (ChildProcess(target, Path(folder.name) / "early.log"), folder)


def end_untaken() -> None:
    """End the processes that nobody has taken; they are gone afterwards."""
    while STARTED:
        child, folder = STARTED.popitem()[1]
        child.kill()
        folder.cleanup()


def child_of(target: str, log: Path) -> ChildProcess:
    """The live process started early for a target, or a new one; log: its log file from now on."""
    if target not in STARTED:
        return ChildProcess(target, log)
    child, folder = STARTED.pop(target)
    is_alive = child.exit_code() is None
    if is_alive:
        child.move_log(log)
    folder.cleanup()
    return child if is_alive else ChildProcess(target, log)
