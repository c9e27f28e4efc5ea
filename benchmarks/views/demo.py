"""`make demo` itself: seconds of the run, set-up apart, and its memory."""

from __future__ import annotations

import compileall
import json
import shutil
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Final

import pbrs_farm
from benchmarks.figures import write_report
from pbrs_farm.operating_system import tree_mb

OUT: Final = Path("out/bench/demo")
VIEWS: Final = 6  # as the Makefile's demo
_LOOK_EVERY_S: Final = 0.2


def main() -> None:
    """Run the demo into an empty folder and write out/bench/demo.json."""
    shutil.rmtree(OUT, ignore_errors=True)
    # A second run finds our modules compiled, also where this shell forbids Python to store them.
    compileall.compile_dir(Path(pbrs_farm.__file__).parent, quiet=2)
    command = [
        sys.executable, "-m", "pbrs_farm.cli", "demo",
        "--views", str(VIEWS), "--out", str(OUT), "--json",
    ]  # fmt: skip
    started = time.monotonic()
    demo = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    memory_mb: list[float] = []
    watch = threading.Thread(target=_watch, args=(demo, memory_mb))
    watch.start()
    output, errors = demo.communicate()
    seconds = time.monotonic() - started
    watch.join()
    if demo.returncode:
        raise RuntimeError(f"the demo failed: {errors}")
    rows = [json.loads(line) for line in output.splitlines() if line.startswith("{")]
    summary = next(r for r in rows if r["event"] == "summary")
    if summary["failures"]:
        raise RuntimeError(f"the demo failed: {summary['failures']}")
    _print_steps(rows)
    figures = {
        "demo.seconds": round(seconds, 1),
        "demo.peak_mb": summary["peak_mb"],
        "demo.all_mb": round(max(memory_mb)),
        "demo.views": summary["views"],
    }
    units = {
        "demo.seconds": "s",
        "demo.peak_mb": "MB of the largest process",
        "demo.all_mb": "MB of all processes together, pages they share counted for each",
        "demo.views": "views",
    }
    write_report("demo", figures, units)


def _watch(demo: subprocess.Popen[str], memory_mb: list[float]) -> None:
    """Add what the demo's processes hold, again and again until it ends."""
    while demo.poll() is None:
        memory_mb.append(tree_mb(demo.pid))
        time.sleep(_LOOK_EVERY_S)


def _print_steps(rows: list[dict[str, object]]) -> None:
    by_step: dict[str, list[float]] = {}
    for row in rows:
        if row["event"] == "done":
            by_step.setdefault(str(row["step"]), []).append(float(str(row["seconds"])))
    print(f"{'step':<12}{'n':>4}{'seconds':>10}{'median':>9}")
    for step, times in by_step.items():
        print(f"{step:<12}{len(times):>4}{sum(times):>10.1f}{sorted(times)[len(times) // 2]:>9.2f}")


if __name__ == "__main__":
    main()
