"""Our commands in processes whose modules of pbrs_farm lack POSIX names (site/sitecustomize.py)."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Final

REPO: Final = Path(__file__).parents[2]
SITE: Final = Path(__file__).parent / "site"


def python_without_posix(
    words: Sequence[str | Path], lacks: str = "posix"
) -> subprocess.CompletedProcess[str]:
    """Run Python, and its child processes, without POSIX; its output is captured.

    lacks: "posix" as on Windows, "proc" as on macOS, which has POSIX and no /proc.
    """
    path = os.pathsep.join(map(str, [SITE, REPO, *filter(None, sys.path)]))
    environment = {**os.environ, "PYTHONPATH": path, "PBRS_TEST_LACKS": lacks}
    command = [sys.executable, *map(str, words)]
    return subprocess.run(command, env=environment, capture_output=True, text=True, check=False)


def pbrs_farm(*words: str | Path) -> subprocess.CompletedProcess[str]:
    """Run a pbrs-farm command there."""
    return python_without_posix(["-m", "pbrs_farm.cli", *words])
