"""Homes made by seed, measured -> out/bench/made.json.

`python -m benchmarks.homes.made [PART...] [N]`: plans (1,000 seeds: plan + furnish), houses (50 read
and repaired), views (24 dressed), untouched (views of 40 seeds that nobody looks at: 60001 and on);
all of them if none is named, N seeds instead of so many. A part's rows stay in out/bench/made/, and
seeds that are there already are not measured again.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections import Counter
from collections.abc import Callable, Iterable
from contextlib import suppress
from pathlib import Path
from typing import Any, Final, TextIO

import numpy as np

from benchmarks.figures import write_report
from benchmarks.homes.made_plan import MEDIANS
from benchmarks.views.view_content import share_distance
from pbrs_farm.assets import furniture_package, homes_package

FOLDER = Path("out/bench/made")
N_SEEDS: Final = {"plans": 1000, "houses": 50, "views": 24, "untouched": 40}
_FIRST_SEED: Final = {"untouched": 60001}
_CHUNK = 50  # seeds a process
_AGAIN = 20  # homes made again by another process

Rows = list[dict[str, Any]]


def main(words: list[str] | None = None) -> None:
    """Measure the named parts, or all, and write out/bench/made.json."""
    homes_package.fetch()
    furniture_package.fetch()
    FOLDER.mkdir(parents=True, exist_ok=True)
    numbers = [int(w) for w in words or () if w.isdigit()]
    for part in [w for w in words or () if not w.isdigit()] or list(N_SEEDS):
        _measure(part, numbers[0] if numbers else N_SEEDS[part])
    figures: dict[str, Any] = {}
    for part, figure in _FIGURES.items():
        rows = _rows(FOLDER / f"{part}.jsonl")
        if rows:
            again = {r["seed"]: r.get("bits") for r in _rows(FOLDER / f"{part}-again.jsonl")}
            figures |= figure(rows, again)
    write_report("made", {f"made.{k}": v for k, v in figures.items()}, UNITS)


def _measure(part: str, n: int) -> None:
    """Add the rows of n seeds that are not there; a few are made again by another process."""
    first = _FIRST_SEED.get(part, 1)
    _fill(FOLDER / f"{part}.jsonl", part, range(first, first + n))
    if part == "plans":
        _fill(FOLDER / f"{part}-again.jsonl", part, range(1, min(n, _AGAIN) + 1))


def _fill(path: Path, part: str, seeds: Iterable[int]) -> None:
    there = {row["seed"] for row in _rows(path)}
    missing = [s for s in seeds if s not in there]
    chunks = [missing[k : k + _CHUNK] for k in range(0, len(missing), _CHUNK)]
    n_jobs = int(os.environ.get("PBRS_BENCH_JOBS", "1"))
    _end_last_row(path)
    for k in range(0, len(chunks), n_jobs):
        # Each process adds a row as soon as it is measured: a bench that is killed loses none.
        with path.open("a") as file:
            running = [_started(part, chunk, file) for chunk in chunks[k : k + n_jobs]]
        for process in running:
            _, error = process.communicate()
            if process.returncode:
                raise RuntimeError(error.strip().splitlines()[-1:])
        print(f"{part}: {min((k + n_jobs) * _CHUNK, len(missing))} of {len(missing)}", flush=True)


def _started(part: str, seeds: list[int], rows: TextIO) -> subprocess.Popen[str]:
    words = [part, *(str(seed) for seed in seeds)]
    command = [sys.executable, "-m", "benchmarks.homes.made_home", *words]
    return subprocess.Popen(command, stdout=rows, stderr=subprocess.PIPE, text=True)


def _end_last_row(path: Path) -> None:
    """Begin a new line where a process was killed in the middle of one."""
    text = path.read_text() if path.exists() else ""
    if text and not text.endswith("\n"):
        path.write_text(text + "\n")


def _rows(path: Path) -> Rows:
    """The rows of a file, each seed once; a line that was cut off counts for nothing."""
    found: dict[int, dict[str, Any]] = {}
    for line in path.read_text().splitlines() if path.exists() else ():
        with suppress(json.JSONDecodeError):
            row = json.loads(line)
            found[row["seed"]] = row
    return [found[seed] for seed in sorted(found)]


def _of_plans(rows: Rows, again: dict[int, str]) -> dict[str, Any]:
    fine = [r for r in rows if "failed" not in r]
    for row in rows:
        for fault in row.get("faults", [row.get("failed")]):
            print(f"   made:{row['seed']}", fault)
    seconds = np.array([r["seconds"] for r in fine])
    areas = [(kind, area) for r in fine for kind, area in r["areas"]]
    errors = {
        kind.value: float(np.median([a for k, a in areas if k == kind.value]) / median - 1)
        for kind, median in MEDIANS.items()
    }
    print("   area errors", {kind: round(error, 3) for kind, error in errors.items()})
    return {
        "seeds": len(rows),
        "failures": len(rows) - len(fine),
        "seconds": round(float(np.percentile(seconds, 99)), 2),
        "seconds_median": round(float(np.median(seconds)), 2),
        "same_bits": int(all(r["bits"] == again.get(r["seed"], r["bits"]) for r in fine)),
        "gates_broken": sum(len(r["faults"]) for r in fine),
        "aspect_p95": round(float(np.percentile([a for r in fine for a in r["aspects"]], 95)), 2),
        "area_error": round(max(abs(e) for e in errors.values()), 3),
        "pieces_per_m2": round(float(np.median([r["pieces_per_m2"] for r in fine])), 3),
        "walkable": round(float(np.median([r["walkable"] for r in fine])), 3),
        **_families(fine),
        "distinct": round(_distinct([r["walls"] for r in fine]), 4),
    }


def _families(rows: Rows) -> dict[str, Any]:
    """How common the families of plans are, and what they were made for."""
    rows = [r for r in rows if "family" in r]
    if not rows:
        return {}
    shares = {k: n / len(rows) for k, n in Counter(r["family"] for r in rows).items()}
    print("   families", {k: round(v, 3) for k, v in sorted(shares.items())})
    print("   outlines", Counter(r["outline"] for r in rows))
    return {
        "families": sum(share >= 0.05 for share in shares.values()),
        "rarest_family": round(min(shares.values()), 3),
        "not_rectangular": round(float(np.mean([r["outline"] != "rectangle" for r in rows])), 3),
        "rooms_through_rooms": round(float(np.mean([r["through"] for r in rows])), 3),
    }


def _distinct(plans: list[list[list[float]]]) -> float:
    """The share of plans that differ from every other one, mirrored or not, by more than a wall."""
    sets = [{tuple(wall) for wall in walls} for walls in plans]
    by_wall: dict[tuple[float, ...], list[int]] = {}
    for number, walls in enumerate(sets):
        for wall in walls:
            by_wall.setdefault(wall, []).append(number)
    n_alike = 0
    for number, walls in enumerate(sets):
        shared = np.zeros(len(sets), int)
        for wall in walls:
            shared[by_wall[wall]] += 1
        most = [max(len(walls), len(other)) for other in sets]
        near = (np.array(most) - shared) <= 1
        near[number] = False
        n_alike += bool(near.any())
    return 1 - n_alike / len(sets)


def _of_houses(rows: Rows, _again: dict[int, str]) -> dict[str, Any]:
    fine = [r for r in rows if "failed" not in r]
    bad = ("penetrations", "floating", "doors_blocked")
    for row in rows:
        for fault in [row["failed"]] if "failed" in row else [f for k in bad for f in row[k]]:
            print(f"   made:{row['seed']}", fault)
    return {
        "repaired": len(rows),
        "not_repaired": len(rows) - len(fine),
        "leaks": sum(r["leaks"] for r in fine),
        "notes": sum(len(r["notes"]) for r in fine),
        **{key: sum(len(r[key]) for r in fine) for key in bad},
    }


def _of_views(rows: Rows, _again: dict[int, str]) -> dict[str, Any]:
    fine = [r for r in rows if r.get("views")]
    return {
        "dressed": len(rows),
        "not_dressed": sum("failed" in r for r in rows),
        "views": sum(r["views"] for r in fine),
        "objects_per_view": float(np.median([n for r in fine for n in r["objects"]])),
        "classes_per_view": float(np.median([n for r in fine for n in r["classes"]])),
        "share_distance": round(
            share_distance(np.array([s for r in fine for s in r["shares"]])), 3
        ),
    }


def _of_untouched(rows: Rows, again: dict[int, str]) -> dict[str, Any]:
    figures = _of_views(rows, again)
    return {f"{key}_untouched": figures[key] for key in ("views", "share_distance")}


_FIGURES: Final[dict[str, Callable[[Rows, dict[int, str]], dict[str, Any]]]] = {
    "plans": _of_plans, "houses": _of_houses, "views": _of_views,
    "untouched": _of_untouched,
}  # fmt: skip

UNITS = {
    "made.seeds": "seeds, planned and furnished",
    "made.failures": "of them, without a home",
    "made.seconds": "CPU-s, 99th percentile, plan + furnish",
    "made.seconds_median": "CPU-s, plan + furnish",
    "made.same_bits": "1 = 20 homes made again by another process are equal",
    "made.gates_broken": "rules broken: reached, daylight, must-haves, doors, overlaps, ways",
    "made.aspect_p95": "long by short side of rooms but halls, 95th percentile",
    "made.area_error": "of the median area of a type of room, from people's, the worst of five types",
    "made.pieces_per_m2": "pieces on the floor a m2, median of homes",
    "made.walkable": "share of the floor that a way 0.6 m wide reaches, median of homes",
    "made.families": "families of plans that 5 % of seeds or more have",
    "made.rarest_family": "share of seeds of the rarest family",
    "made.not_rectangular": "share of homes whose outline is an L, a U or the like",
    "made.rooms_through_rooms": "share of homes with a bedroom that one enters from no hall",
    "made.distinct": "share of plans that differ from every other by more than one wall",
    "made.repaired": "homes read and repaired",
    "made.not_repaired": "of them, refused",
    "made.leaks": "rays that leak, over all of them",
    "made.notes": "notes of the reader",
    "made.penetrations": "pairs of meshes that share more than 1 cm, seats under tables apart",
    "made.floating": "pieces that touch nothing within 2 mm",
    "made.doors_blocked": "pieces within 0.8 m of a door, by rays",
    "made.dressed": "homes dressed",
    "made.not_dressed": "of them, refused",
    "made.views": "views of them",
    "made.objects_per_view": "objects of 0.05 % of the pixels or more, median of views",
    "made.classes_per_view": "NYU13 classes, median of views",
    "made.share_distance": "sum of differences of NYU13 pixel shares from NYUv2's",
    "made.views_untouched": "views of homes by seeds that nobody looks at",
    "made.share_distance_untouched": "the same sum over them",
}

if __name__ == "__main__":
    main(sys.argv[1:])
