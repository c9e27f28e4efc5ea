"""Dressing, measured: time, contacts, what views show, bits, leaks, light, failures -> out/bench/dress.json.

`python -m benchmarks.dress.dress [PART...]`: homes (nine homes, three seeds each), light, failures, outside;
all of them if none is named. A part's rows stay in out/bench/dress/, and the report is made of
those there are, so that parts can be measured one at a time.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.dress.changed import share_changed
from benchmarks.figures import write_report
from benchmarks.views.view_content import share_distance
from pbrs_farm.assets import furniture_package, homes_package
from pbrs_farm.core.classes import NYU13_NAMES

FOLDER = Path("out/bench/dress")
SEEDS = (1, 2, 3)
N_PAIRS = 200

Rows = list[dict[str, Any]]


def main(parts: list[str] | None = None) -> None:
    """Measure the named parts, or all, and write out/bench/dress.json."""
    homes_package.fetch()
    furniture_package.fetch()
    FOLDER.mkdir(parents=True, exist_ok=True)
    names = [home.name for home in homes_package.example_homes()]
    for part in parts or list(_PARTS):
        rows = _PARTS[part](names)
        (FOLDER / f"{part}.json").write_text(json.dumps(rows, indent=1) + "\n")
    figures: dict[str, Any] = {}
    for part, figure in _FIGURES.items():
        if (FOLDER / f"{part}.json").exists():
            figures |= figure(json.loads((FOLDER / f"{part}.json").read_text()))
    write_report("dress", {f"dress.{k}": v for k, v in figures.items()}, UNITS)


def _row(module: str, *words: str) -> dict[str, Any]:
    command = [sys.executable, "-m", f"benchmarks.dress.{module}", *words]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(f"{' '.join(words)}: {done.stderr.strip().splitlines()[-1:]}")
    row: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return row


def _homes(names: list[str]) -> Rows:
    rows = []
    print(
        f"{'home':<34}{'seed':>5}{'s':>7}{'new':>6}{'deep':>6}{'float':>6}{'doors':>6}{'views':>6}"
    )
    for name in names:
        for seed in SEEDS:
            row = _row("dressed_home", name, str(seed))
            # The first seed is dressed again by another process.
            if seed == SEEDS[0]:
                row["bits_again"] = _row("dressed_home", name, str(seed), "bits")["bits"]
            rows.append(row)
            bad = [len(row[k]) for k in ("penetrations", "floating", "doors_blocked")]
            print(
                f"{name:<34}{seed:>5}{row['seconds']:>7.1f}{row['new']:>6}"
                f"{bad[0]:>6}{bad[1]:>6}{bad[2]:>6}{row['views']:>6}",
                flush=True,
            )
            for fault in row["penetrations"] + row["floating"] + row["doors_blocked"]:
                print("   ", *fault, flush=True)
    return rows


def _light(names: list[str]) -> Rows:
    rows = []
    for name in names:
        rows.append({"home": name, **_row("light_cost", name, str(SEEDS[0]))})
        print(rows[-1], flush=True)
    return rows


def _failures(names: list[str]) -> Rows:
    rows = []
    per_home = -(-N_PAIRS // len(names))
    for name in names:
        rows.append({"home": name, **_row("failures", name, "1", str(per_home))})
        print(rows[-1], flush=True)
    return rows


def _outside(names: list[str]) -> Rows:
    rows = []
    for name in (*names, "made:1", "made:2", "made:3"):
        rows.append({"home": name, **_row("outside_share", name)})
        print(rows[-1], flush=True)
    return rows


def _figures_of_outside(rows: Rows) -> dict[str, Any]:
    left, met = (sum(row[k] for row in rows) for k in ("left", "met"))
    return {
        "outside.share": round(met / left, 3),
        "outside.triangles": max(row["triangles"] for row in rows),
        "outside.seconds": max(row["seconds"] for row in rows),
    }


def _figures_of_homes(rows: Rows) -> dict[str, Any]:
    shares = np.array([s for row in rows for s in row["shares"]])
    column = {name: k for k, name in enumerate(NYU13_NAMES)}
    changed = _pairs_of_seeds(rows)
    again = [row for row in rows if "bits_again" in row]
    return {
        "seconds": max(row["seconds"] for row in rows),
        "catalogue_s": max(row["catalogue_s"] for row in rows),
        "penetrations": sum(len(row["penetrations"]) for row in rows),
        "floating": sum(len(row["floating"]) for row in rows),
        "doors_blocked": sum(len(row["doors_blocked"]) for row in rows),
        "gates_broken": sum(gate[2] for row in rows for gate in row["gates"].values()),
        "views": len(shares),
        "objects_per_view": float(np.median([n for row in rows for n in row["objects"]])),
        "classes_per_view": float(np.median([n for row in rows for n in row["classes"]])),
        "pictures_share": round(float(shares[:, column["picture"]].mean()), 4),
        "books_share": round(float(shares[:, column["books"]].mean()), 4),
        "wall_share": round(float(shares[:, column["wall"]].mean()), 3),
        "changed": round(min(count for count, _area in changed), 3),
        "changed_area": round(min(area for _count, area in changed), 3),
        "share_distance": round(share_distance(shares), 3),
        "same_bits": int(all(row["bits"] == row["bits_again"] for row in again)),
        "leaks": max(row["leaks"] for row in rows),
        "mb": max(row["mb"] for row in rows),
        "triangles": max(row["triangles"] for row in rows),
    }


def _pairs_of_seeds(rows: Rows) -> list[tuple[float, float]]:
    """Of any two seeds of a home: the share of its surfaces, and of their area, that differ."""
    found = []
    for name in dict.fromkeys(row["home"] for row in rows):
        of_home = [row for row in rows if row["home"] == name]
        found += [share_changed(a, b) for a, b in combinations(of_home, 2)]
    return found


def _figures_of_light(rows: Rows) -> dict[str, Any]:
    bare, dressed = (sum(row[k] for row in rows) for k in ("bare", "dressed"))
    return {
        "light_cost": round(dressed / bare, 2),
        "light_cost_worst": max(row["ratio"] for row in rows),
    }


def _figures_of_failures(rows: Rows) -> dict[str, Any]:
    return {
        "failures": sum(len(row["failed"]) for row in rows),
        "pairs": sum(row["n"] for row in rows),
    }


_PARTS: dict[str, Callable[[list[str]], Rows]] = {
    "homes": _homes, "light": _light, "failures": _failures, "outside": _outside,
}  # fmt: skip
_FIGURES: dict[str, Callable[[Rows], dict[str, Any]]] = {
    "homes": _figures_of_homes, "light": _figures_of_light, "failures": _figures_of_failures,
    "outside": _figures_of_outside,
}  # fmt: skip

UNITS = {
    "dress.seconds": "CPU-s on one core, of the worst home and seed, all parts and gates",
    "dress.catalogue_s": "s, reading the catalogue's listing, once a process",
    "dress.penetrations": "pairs of things that share more than 1 cm, by Embree",
    "dress.floating": "things that touch nothing within 2 mm, by Embree",
    "dress.doors_blocked": "things in a door's swing or within 0.8 m of it, by Embree",
    "dress.gates_broken": "what the stage's own gates still count",
    "dress.views": "views of nine homes by three seeds, `fast` cameras",
    "dress.objects_per_view": "things of 0.05 % of the picture and more, median",
    "dress.classes_per_view": "NYU13 classes, median",
    "dress.pictures_share": "of the pixels, mean over views",
    "dress.books_share": "of the pixels, mean over views",
    "dress.wall_share": "of the pixels, mean over views",
    "dress.changed": "share of the home's surfaces that two seeds make visibly differently, least of any two",
    "dress.changed_area": "the same by area",
    "dress.share_distance": "L1 distance of NYU13 pixel shares to NYUv2's",
    "dress.same_bits": "1 = the same seed gave the same bundle in two processes, nine homes",
    "dress.leaks": "rays that reach the sky, of the worst home",
    "dress.mb": "MB of the largest house.glb",
    "dress.triangles": "of the largest home",
    "dress.light_cost": "CPU of a fast view dressed over bare, nine homes together",
    "dress.light_cost_worst": "the same of the worst home",
    "dress.failures": "homes that could not be dressed, or break a gate",
    "dress.pairs": "pairs of home and seed that were tried",
    "dress.outside.share": "of rays through windows, those that meet something outside: nine homes, three made ones",
    "dress.outside.triangles": "of what lies before the windows, most",
    "dress.outside.seconds": "CPU-s that this takes of a house, worst",
}

if __name__ == "__main__":
    main(sys.argv[1:])
