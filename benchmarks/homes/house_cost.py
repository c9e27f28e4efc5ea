"""CPU and memory of a home and of a further view: `make bench NAME=house_cost` -> out/bench/house_cost.json.

Every home is run twice by `preview` at 160x120 in all modes, with one view and with N_VIEWS: the first run is the cost of the
home, the difference that of a further view. CPU is of all processes. `python -m benchmarks.homes.house_cost --against FOLDER
[HOME...]` measures another checkout beside this one, each home in both one after another: machines differ too much for
absolute times.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

from benchmarks.figures import write_report

HOMES: Final = ("Studio", *(f"made:{seed}" for seed in range(5, 15)))
IN_ALL: Final = HOMES[:3]
N_VIEWS: Final = 9  # the difference of two runs is judged by all its views
TREE: Final = Path(__file__).parents[2]
UNITS: Final = {
    "house_cost.homes": "homes",
    "house_cost.cpu_s": "CPU-s of a run with one view, mean of the homes",
    "house_cost.view_cpu_s": "CPU-s of a further view, mean of the homes",
    "house_cost.peak_mb": "MB of the largest process of any run",
    "house_cost.ratio": "CPU of a run with one view over that of the other checkout",
    "house_cost.view_ratio": "CPU of a further view over that of the other checkout",
}


def main(homes: Sequence[str] = IN_ALL, against: str = "") -> None:
    """Measure and write out/bench/house_cost.json."""
    trees = [Path(against).resolve(), TREE] if against else [TREE]
    sums = {tree: Counter[str]() for tree in trees}
    peak_mb = 0.0
    for home in homes:
        for tree in trees:
            row = cost(tree, home)
            sums[tree].update(home=row["cpu_s"], view=row["view_cpu_s"])
            peak_mb = max(peak_mb, row["peak_mb"] if tree == TREE else 0.0)
            print(f"{home:<12}{tree.name:<12}", *(f"{k} {v}" for k, v in row.items()), flush=True)
    figures: dict[str, Any] = {
        "house_cost.homes": len(homes),
        "house_cost.cpu_s": round(sums[TREE]["home"] / len(homes), 2),
        "house_cost.view_cpu_s": round(sums[TREE]["view"] / len(homes), 2),
        "house_cost.peak_mb": peak_mb,
    }
    if against:
        figures["house_cost.ratio"] = round(sums[TREE]["home"] / sums[trees[0]]["home"], 3)
        figures["house_cost.view_ratio"] = round(sums[TREE]["view"] / sums[trees[0]]["view"], 3)
    write_report("house_cost", figures, UNITS)


def cost(tree: Path, home: str) -> dict[str, Any]:
    """CPU seconds of a home with one view and of a further view, and MB of the largest process."""
    cpu_s, peak_mb, steps = _run(tree, home, 1)
    many_cpu_s, many_peak_mb, _steps = _run(tree, home, N_VIEWS)
    return {
        "cpu_s": round(cpu_s, 2),
        "view_cpu_s": round((many_cpu_s - cpu_s) / (N_VIEWS - 1), 2),
        "peak_mb": max(peak_mb, many_peak_mb),
        "wall_s": steps,
    }


def _run(tree: Path, home: str, n_views: int) -> tuple[float, float, dict[str, float]]:
    """(CPU seconds, MB of the largest process, seconds of each step) of a run into an empty folder."""
    before = _children_cpu_s()
    with tempfile.TemporaryDirectory() as out:
        words = ["run", home, "--dress", "1", "--recipe", "preview", "--size", "160x120"]
        words += ["--views", str(n_views), "--out", out, "--json"]
        done = subprocess.run(
            [sys.executable, "-m", "pbrs_farm.cli", *words], capture_output=True, text=True,
            env=os.environ | {"PYTHONPATH": str(tree)}, cwd=tree, check=False,
        )  # fmt: skip
    if done.returncode:
        raise RuntimeError(f"{tree}: {home}: {done.stderr.strip().splitlines()[-1:]}")
    events = [json.loads(line) for line in done.stdout.splitlines() if line.startswith("{")]
    summary = next(event for event in events if event["event"] == "summary")
    steps: dict[str, float] = {}
    for event in events:
        if event["event"] == "done":
            steps[event["step"]] = steps.get(event["step"], 0.0) + event["seconds"]
    seconds = {step: round(value, 1) for step, value in steps.items()}
    return _children_cpu_s() - before, summary["peak_mb"], seconds


def _children_cpu_s() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("homes", nargs="*", default=HOMES)
    parser.add_argument("--against", default="", metavar="FOLDER", help="another checkout")
    arguments = parser.parse_args()
    main(arguments.homes, arguments.against)
