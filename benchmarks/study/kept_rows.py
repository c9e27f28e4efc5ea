"""Parts of a bench that are kept as they are done, so that one which is cut off goes on.

Effects: out/study/bench/<code>/, a file a part; <code> follows from the study's sources, so that
changed code is measured anew.
"""

from __future__ import annotations

import hashlib
import json
import resource
import time
from collections.abc import Callable
from pathlib import Path

from benchmarks.study.rendered import FOLDER

BENCH = FOLDER / "bench"
_SOURCES = ("pbrs_farm/study", "benchmarks/study")

Figures = dict[str, float]


def folder_of_code() -> Path:
    """Where rows of the present code are kept."""
    sha = hashlib.sha256()
    for path in sorted(p for source in _SOURCES for p in Path(source).rglob("*.py")):
        sha.update(f"{path}\n".encode() + path.read_bytes())
    return BENCH / sha.hexdigest()[:12]


def kept(folder: Path, name: str, measure: Callable[[], Figures]) -> tuple[Figures, float]:
    """The figures of a part and its CPU-seconds: measured now, or as they were kept."""
    path = folder / f"{name}.json"
    if path.exists():
        row = json.loads(path.read_text())
        print(f"{name}: kept from before, {row['cpu_s']:.0f} CPU-s", flush=True)
        return row["figures"], row["cpu_s"]
    started, wall = _cpu_s(), time.monotonic()
    figures = measure()
    row = {"figures": figures, "cpu_s": round(_cpu_s() - started, 1)}
    wall_s = time.monotonic() - wall
    print(f"{name}: {row['cpu_s']:.0f} CPU-s, {wall_s:.0f} s", *_words(figures), flush=True)
    # A part that measured nothing (a package is missing) is tried again.
    if figures:
        folder.mkdir(parents=True, exist_ok=True)
        beside = path.with_suffix(".part")
        beside.write_text(json.dumps(row, indent=1) + "\n")
        beside.replace(path)
    return figures, row["cpu_s"]


def _words(figures: Figures) -> list[str]:
    return [f"{name.removeprefix('study.')} {value:.4g}" for name, value in figures.items()]


def _cpu_s() -> float:
    """Seconds of processor of this process and of its children that ended."""
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time() + children.ru_utime + children.ru_stime
