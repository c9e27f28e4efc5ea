"""Run a verb in a child process, so that a library that dies costs one line; reads its notes."""

from __future__ import annotations

import contextlib
import json
import os
import pkgutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final

from pbrs_farm.crash_notes import send_notes_to
from pbrs_farm.operating_system import PATH_FROM_PARENT, die_with_parent, ending, has_crashed

_BOOT: Final = PATH_FROM_PARENT + (
    "from pbrs_farm.run.processes.verb_process import main; "
    "sys.exit(main(sys.argv[2], sys.argv[3], sys.argv[4:]))"
)

_TAIL_BYTES: Final = 65536  # of the notes, in which the last one is whole


def run_watched(target: str, words: Sequence[str], say: Callable[[str], None]) -> int:
    """The exit code of `module:function` in a child; if killed 1, after one line about the file and step."""
    # A file, because not every system passes descriptors on. The child unlinks it immediately.
    handle, notes = _new_file()
    command = [sys.executable, "-P", "-c", _BOOT, json.dumps(sys.path), notes, target]
    # The terminal sends Ctrl-C to both: the child decides. A handler of ours ends with its exec.
    before = signal.signal(signal.SIGINT, lambda _number, _frame: None)
    with os.fdopen(handle, "rb") as file:
        try:
            code = subprocess.Popen([*command, *words]).wait()
            file.seek(max(0, file.seek(0, os.SEEK_END) - _TAIL_BYTES))
            notices = file.read() if has_crashed(code) else b""
        finally:
            signal.signal(signal.SIGINT, before)
    if notes:
        Path(notes).unlink(missing_ok=True)
    if not has_crashed(code):
        return code
    lines = notices.decode("utf-8", "replace").splitlines()
    say(f"{lines[-1] if lines else ' '.join(words[:2])}: {ending(code)}")
    return 1


def _new_file() -> tuple[int, str]:
    """A new file, opened, and its name; nothing and "" where there is no room for one."""
    try:
        return tempfile.mkstemp(prefix="pbrs-farm-")
    except OSError:
        return os.open(os.devnull, os.O_RDONLY), ""


def main(notes: str, target: str, words: Sequence[str]) -> int:
    """The child: run the function that target names; its notices are added to a file, "" for none."""
    die_with_parent()
    if notes:
        send_notes_to(os.open(notes, os.O_WRONLY | os.O_APPEND))
        # Whoever is killed then leaves nothing behind; Windows keeps the name of an open file.
        with contextlib.suppress(OSError):
            Path(notes).unlink()
    return int(pkgutil.resolve_name(target)(words))
