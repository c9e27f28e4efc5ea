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
    """The file that the main loop of a worker or coordinator of that name touches."""
    return scratch / f"pbrs-{worker}.alive"


def touch(path: Path) -> None:
    """Set the file's time, made if missing, to now, for liveness probes. Raises OSError."""
    path.touch()
    os.utime(path)


def main() -> int:
    """0 if the process named by PBRS_FARM_SCRATCH and _WORKER touched its file within STALE_S, else 1 and a line."""
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
