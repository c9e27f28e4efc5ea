"""Time of `import pbrs_farm`, of `--help` and of a first view: `make bench NAME=startup` -> out/bench/startup.json.

Effects: starts processes with a temporary kernel cache. The cache is cold if Dr.Jit has compiled nothing on the machine before.
"""

from __future__ import annotations

import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

from benchmarks.figures import write_report

UNITS: Final = {
    "startup.import_ms": "CPU ms of `import pbrs_farm`, median of 15, the interpreter's start apart (at most 15)",
    "startup.help_ms": "CPU ms of `pbrs-farm --help`, median of 15, the interpreter's start among it (at most 150)",
    "startup.first_view_s": "s of `pbrs-farm run builtin --recipe preview --views 1`, every mode, kernels compiled before",
    "startup.first_view_cpu_s": "CPU s of that",
    "startup.first_view_cold_s": "s of the same with an empty kernel cache",
    "startup.first_view_cold_cpu_s": "CPU s of that",
}
_IMPORT: Final = (
    "import time; t = time.process_time(); import pbrs_farm; print(1e3 * (time.process_time() - t))"
)
_RUN: Final = ("run", "builtin", "--recipe", "preview", "--views", "1", "--out")


def main() -> None:
    """Measure and write out/bench/startup.json."""
    write_report("startup", startup_figures([sys.executable]), UNITS)


def startup_figures(python: Sequence[str]) -> dict[str, Any]:
    """The figures of an environment. python: the words that start its interpreter."""
    program = [*python, "-m", "pbrs_farm.cli"]
    with tempfile.TemporaryDirectory() as name:
        home = Path(name)
        imports = [float(_said([*python, "-c", _IMPORT], home)) for _ in range(15)]
        helps = [1e3 * _costs([*program, "--help"], home)[1] for _ in range(15)]
        # Modules are compiled and files are in memory before anything counts: once apart, then cold, then warm.
        _costs([*program, *_RUN, str(home / "apart")], home / "apart-home")
        cold = _costs([*program, *_RUN, str(home / "cold")], home)
        warm = _costs([*program, *_RUN, str(home / "warm")], home)
    return {
        "startup.import_ms": round(statistics.median(imports), 1),
        "startup.help_ms": round(statistics.median(helps)),
        "startup.first_view_s": round(warm[0], 1),
        "startup.first_view_cpu_s": round(warm[1], 1),
        "startup.first_view_cold_s": round(cold[0], 1),
        "startup.first_view_cold_cpu_s": round(cold[1], 1),
    }


def _costs(words: Sequence[str], home: Path) -> tuple[float, float]:
    """(seconds, CPU seconds) of a command that must end well, its kernel cache below a home folder."""
    before, began = cpu_s(), time.monotonic()
    _said(words, home)
    return time.monotonic() - began, cpu_s() - before


def _said(words: Sequence[str], home: Path) -> str:
    home.mkdir(exist_ok=True)
    environment = {**os.environ, "HOME": str(home)}
    return subprocess.run(words, env=environment, check=True, capture_output=True, text=True).stdout


def cpu_s() -> float:
    """CPU seconds of all processes that this one started and that have ended."""
    spent = resource.getrusage(resource.RUSAGE_CHILDREN)
    return spent.ru_utime + spent.ru_stime


if __name__ == "__main__":
    main()
