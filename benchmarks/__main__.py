"""Run benches by name: `python -m benchmarks [NAME...]`; the short ones without a name, all of them with `all`.

Each bench is a module with main() that writes out/bench/NAME.json. `--list` prints the names, `--claims` the table below.
A failed bench does not stop the others. `all` then writes the tables of the lab book and out/bench/bench_all.json.
"""

from __future__ import annotations

import importlib
import sys
import time
import traceback
from dataclasses import dataclass
from typing import Any, Final


@dataclass(frozen=True, slots=True)
class Bench:
    """A bench: its module in this folder, the claim that it backs, and its minutes on two quiet cores."""

    module: str
    claim: str
    minutes: float
    is_short: bool = False  # part of `make bench` without a name
    in_all: bool = True


BENCHES: Final = {
    "demo": Bench("views.demo", "README: time and memory of `make demo`", 0.5, is_short=True),
    "view": Bench("views.view", "README: a `fast` view, its labels, OpenGL", 1, is_short=True),
    "startup": Bench("startup", "docs/install.md: import, help, first view", 1.5, is_short=True),
    "selection": Bench("selection", "docs/selection.md: the paper's scale", 0.5, is_short=True),
    "homes": Bench("homes.homes", "README, docs/homes.md: planning, cameras; label shares of dressed homes", 5.5),
    "house_cost": Bench("homes.house_cost", "CPU and memory of a home and of a further view", 2.5),
    "look": Bench("views.look", "docs/cameras.md: cut items, added lamps, noise behind glass", 9, in_all=False),
    "variety": Bench("homes.variety", "docs/dress/catalogue.md: models in dressed homes", 4),
    "joints": Bench("homes.joints", "docs/howto/simulators.md: doors and drawers, also in MuJoCo", 3),
    "light": Bench("light.light_cost", "docs/light_costs.md: error and CPU by samples, presets, size", 4.5),
    "cycles": Bench("renderers.cycles", "docs/compare.md: CPU to equal error against Cycles", 10),
    "film": Bench("film", "docs/motion.md: errors of flow and disparity, noise of films", 2.5),
    "tone": Bench("study.picture_tone", "docs/lab/study.md: tones beside photographs", 3),
    "study": Bench("study.study_figures", "docs/data.md, docs/study.md: reading, weights that ship", 1),
    "sets": Bench("sets", "docs/howto/questions.md: questions, blind answers; `pf.stream`", 6),
    "farm": Bench("farm.farm_cost", "docs/farm/inside.md: the farm's own cost", 4),
    "hot_paths": Bench("hot_paths", "instructions of ten hot paths, one CSV row a commit", 4),
    "bytes": Bench("stored_bytes", "stored bytes of two commits are equal", 4, in_all=False),
    "house": Bench("house", "the state of the code", 30, in_all=False),
    "cases": Bench("cases", "files that were read wrongly once, all formats, hostile inputs", 20, in_all=False),
    "hostile": Bench("hostile", "docs/lab/views.md: hostile inputs", 12, in_all=False),
    "inputs": Bench("inputs", "reading and repair of every format", 15, in_all=False),
    "python": Bench("python_api", "docs/compare.md: lines of the peers' examples and ours", 1),
    "docs": Bench("docs_figures", "how the docs read; stale figures", 1, in_all=False),
    "release": Bench("release", "docs/lab/views.md: wheels, sdists, an empty environment of each Python", 10, in_all=False),
    "anywhere": Bench("anywhere", "docs/install.md: pip alone on a bare machine", 6, in_all=False),
    "gpu": Bench("light.gpu", "docs/light_costs.md: on a GPU", 5, in_all=False),
    "lab_tables": Bench("lab_tables", "writes the tables of the lab book from the reports", 0, in_all=False),
}  # fmt: skip


def main(names: list[str]) -> int:
    """Run the named benches; 1 if any failed, 2 for an unknown name."""
    if names == ["--list"]:
        print(*BENCHES, sep="\n")
        return 0
    if names == ["--claims"]:
        print(*(f"{n:<12}{b.minutes:>5g} min  {b.claim}" for n, b in BENCHES.items()), sep="\n")
        return 0
    if names == ["all"]:
        return run_all()
    unknown = [name for name in names if name not in BENCHES]
    if unknown:
        print(f"no bench {unknown[0]!r}; of {', '.join(BENCHES)}", file=sys.stderr)
        return 2
    _minutes, failed = run(names or [name for name, bench in BENCHES.items() if bench.is_short])
    return 1 if failed else 0


def run(names: list[str]) -> tuple[dict[str, float], list[str]]:
    """(minutes of each bench, names of those that failed)."""
    minutes: dict[str, float] = {}
    failed = []
    for name in names:
        print(f"== {name}", flush=True)
        started = time.monotonic()
        try:
            importlib.import_module(f"benchmarks.{BENCHES[name].module}").main()
        except Exception:  # noqa: BLE001  the other benches still run
            traceback.print_exc()
            failed.append(name)
        minutes[name] = round((time.monotonic() - started) / 60, 1)
        print(f"== {name}: {minutes[name]} minutes\n", flush=True)
    if failed:
        print(f"failed: {', '.join(failed)}", file=sys.stderr)
    return minutes, failed


def run_all() -> int:
    """Run every bench of the lab book, write its tables and out/bench/bench_all.json."""
    from benchmarks import lab_tables
    from benchmarks.figures import write_report

    minutes, failed = run([name for name, bench in BENCHES.items() if bench.in_all])
    figures: dict[str, Any] = {
        "bench_all.minutes": round(sum(minutes.values()), 1),
        "bench_all.failed": failed,
        **{f"bench_all.{name}": value for name, value in minutes.items()},
    }
    units = dict.fromkeys(figures, "minutes") | {"bench_all.failed": "names of benches"}
    write_report("bench_all", figures, units)
    lab_tables.main()
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
