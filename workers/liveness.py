"""The liveness probe: `python -m workers.liveness`; exits with 1 if the process's main loop is stuck.

Effects: reads the age of one file. Imports little, since it runs every half minute.
"""

from __future__ import annotations

import os
import platform
import sys
import tempfile
import time
from pathlib import Path
from typing import Final

STALE_S: Final = 120.0  # main loops touch the file every few seconds


def alive_file(scratch: Path, worker: str) -> Path:
    """The file a worker's or coordinator's main loop touches.

    worker: its name (PBRS_FARM_WORKER, else the host's). Nothing is created: `touch` does that.
    """
    return scratch / f"pbrs-{worker}.alive"


def touch(path: Path) -> None:
    """Set the file's time to now; it appears if need be.

    For liveness probes: whoever reads the file looks at its age alone. Raises OSError where the
    folder cannot be written.
    """
    path.touch()
    os.utime(path)


def main() -> int:
    """0 while the process on this machine is alive; 1 and a line when not.

    For a container's probe, so it imports nothing of the farm and needs neither Redis nor the
    store. The environment names folder and worker (PBRS_FARM_SCRATCH, PBRS_FARM_WORKER); a process
    whose file was not touched for STALE_S seconds counts as dead.
    """
    scratch = Path(os.environ.get("PBRS_FARM_SCRATCH") or tempfile.gettempdir())
    path = alive_file(scratch, os.environ.get("PBRS_FARM_WORKER") or platform.node())
    try:
        age_s = time.time() - path.stat().st_mtime
    except FileNotFoundError:
        # Without a file nobody has ever been seen alive.
        age_s = float("inf")
    if age_s < STALE_S:
        return 0
    sys.stderr.write(f"{path}: no sign of life for {age_s:.0f} s\n")
    return 1


if __name__ == "__main__":
    sys.exit(main())
