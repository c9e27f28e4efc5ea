"""Reading and repair of a realistic house of every format: `make bench NAME=inputs` -> out/bench/inputs.json.

tests/inputs writes the houses of about 300,000 triangles; each is measured in a new process (`python -m benchmarks.inputs TITLE`).
Then hostile files of the same formats are run.
"""

from __future__ import annotations

import json
import subprocess
import sys
from typing import Any, Final

from benchmarks.figures import write_report

UNITS: Final = {
    "inputs.formats": "formats whose realistic house is read and becomes closed rooms",
    "inputs.leaks": "rays that reach the sky through a wall, over all of them",
    "inputs.walls_lost": "walls of which repair took more than a tenth",
    "inputs.openings_kept": "share of told doors and windows that are openings, of the worst format",
    "inputs.class_agreement": "share of the names of the class tables that are read as their class",
    "inputs.roundtrip": "1 = homes written as usd, habitat and gltf are read back equal",
    "inputs.seconds": "s to read and repair the slowest house of about 300,000 triangles",
    "inputs.hostile_cases": "hostile files of these formats",
    "inputs.hostile": "of them ended otherwise than in one line, a note, 20 s and 2 GB",
}


def main() -> None:
    """Measure every format and write the report."""
    from benchmarks import hostile
    from tests.inputs.sound_files import sound_files

    rows = {title: _measured(title) for title in sound_files()}
    good = [row for row in rows.values() if "error" not in row]
    kept_shares = [r["openings"] / r["told"] for r in good if r["told"]]
    cases, failed = hostile.counted(("input/",))
    figures = {
        "inputs.formats": sum(r["closed_rooms"] > 0 for r in good),
        "inputs.leaks": sum(r["leaks"] for r in good),
        "inputs.walls_lost": sum(r["walls_lost"] for r in good),
        "inputs.openings_kept": round(min(kept_shares, default=0.0), 3),
        "inputs.class_agreement": class_agreement(),
        "inputs.roundtrip": roundtrip(),
        "inputs.seconds": max((r["seconds"] for r in good), default=0.0),
        "inputs.hostile_cases": cases,
        "inputs.hostile": failed,
    }
    write_report("inputs", figures, UNITS)


def _measured(title: str) -> dict[str, Any]:
    command = [sys.executable, "-m", "benchmarks.inputs.measured_format", title]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    lines = done.stdout.splitlines()
    error = (done.stderr.strip().splitlines() or ["no answer"])[-1]
    row: dict[str, Any] = json.loads(lines[-1]) if done.returncode == 0 else {"error": error}
    print(
        f"{title:<24}", row.get("error") or " ".join(f"{k} {v}" for k, v in row.items()), flush=True
    )
    return row


def class_agreement() -> float:
    """Share of the names of given_classes.csv that give an item of that name their class.

    Each name becomes an item with only a box, as in plans, scans and scenes without models. Names of structure and of
    items that are not drawn are skipped.
    """
    import csv
    from importlib.resources import files

    from pbrs_farm.core.classes import NYU40_NAMES
    from pbrs_farm.read.common.given_classes import box_only_item

    text = files("pbrs_farm.read.common").joinpath("given_classes.csv").read_text("utf-8")
    right = []
    for row in csv.DictReader(text.splitlines()):
        item = box_only_item("1", row["source"], row["name"], (0, 0.5, 0), (1, 1, 1), 0.0)
        if item is not None and row["nyu40"] in NYU40_NAMES:
            right.append(NYU40_NAMES[item.nyu40] == row["nyu40"])
    return round(sum(right) / len(right), 4)


def roundtrip() -> int:
    """1 where the tests of the ways out pass: homes read back equal."""
    tests = [
        "tests/export/test_home_gltf.py",
        "tests/export/test_home_habitat.py",
        "tests/export/test_home_usd.py",
    ]
    command = [sys.executable, "-m", "pytest", "-q", *tests]
    return int(subprocess.run(command, capture_output=True, check=False).returncode == 0)
