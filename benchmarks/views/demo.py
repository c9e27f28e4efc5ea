"""`make demo` itself: seconds of the run, set-up apart, and its peak memory."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import time
from pathlib import Path

from benchmarks.figures import write_report

OUT = Path("out/bench/demo")


def main() -> None:
    """Run the demo into an empty folder and write out/bench/demo.json."""
    shutil.rmtree(OUT, ignore_errors=True)
    command = [
        sys.executable,
        "-m",
        "pbrs_farm.cli",
        "demo",
        "--views",
        "10",
        "--out",
        str(OUT),
        "--json",
    ]
    started = time.monotonic()
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    seconds = time.monotonic() - started
    rows = [json.loads(line) for line in done.stdout.splitlines() if line.startswith("{")]
    summary = next(r for r in rows if r["event"] == "summary")
    if summary["failures"]:
        raise RuntimeError(f"the demo failed: {summary['failures']}")
    by_step: dict[str, list[float]] = {}
    for row in rows:
        if row["event"] == "done":
            by_step.setdefault(row["step"], []).append(row["seconds"])
    print(f"{'step':<12}{'n':>4}{'seconds':>10}{'median':>9}")
    for step, times in by_step.items():
        print(f"{step:<12}{len(times):>4}{sum(times):>10.1f}{sorted(times)[len(times) // 2]:>9.2f}")
    figures = {
        "demo.seconds": round(seconds, 1),
        "demo.peak_mb": summary["peak_mb"],
        "demo.views": summary["views"],
    }
    write_report(
        "demo",
        figures,
        {"demo.seconds": "s", "demo.peak_mb": "MB of the largest process", "demo.views": "views"},
    )


if __name__ == "__main__":
    main()
