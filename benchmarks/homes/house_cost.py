"""CPU of a dressed home before its first picture, by step: `make bench NAME=house_cost`.

`python -m benchmarks.homes.house_cost --against FOLDER [HOME...]` measures another checkout beside
this one, each home in both one after another, and says whether they made the same.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, Final
from unittest import mock

HOMES: Final = (
    *(f"made:{seed}" for seed in range(1, 11)), "Studio", "3BedroomApartment", "4BedroomHouse",
)  # fmt: skip
STEPS: Final = ("house", "cameras", "illuminance")
TREE: Final = Path(__file__).parents[2]


def main(homes: tuple[str, ...] = HOMES, against: str = "") -> None:
    """Measure each home in a process of its own and write out/bench/house_cost.json."""
    from benchmarks.figures import write_report

    trees = [Path(against).resolve(), TREE] if against else [TREE]
    total = dict.fromkeys(trees, 0.0)
    n_same_house, kept_views, n_views, scores = 0, 0, 0, dict.fromkeys(trees, 0.0)
    for home in homes:
        rows = [_in_a_process(tree, home) for tree in trees]
        for tree, row in zip(trees, rows, strict=True):
            total[tree] += sum(row["cpu_s"][step] for step in STEPS)
            scores[tree] += sum(row["scores"])
            parts = ", ".join(f"{name} {s:.2f}" for name, s in row["cpu_s"].items())
            print(f"{home:<20} {tree.name}: CPU s {parts}; {len(row['views'])} views", flush=True)
        n_same_house += rows[0]["house"] == rows[-1]["house"]
        n_views += len(rows[0]["views"])
        kept_views += len(set(rows[0]["views"]) & set(rows[-1]["views"]))
    figures: dict[str, Any] = {"house_cost.cpu_s": round(total[TREE] / len(homes), 2)}
    if against:
        old = trees[0]
        figures |= {
            "house_cost.ratio": round(total[TREE] / total[old], 3),
            "house_cost.same_houses": round(n_same_house / len(homes), 3),
            "house_cost.same_views": round(kept_views / max(n_views, 1), 3),
            "house_cost.score_ratio": round(scores[TREE] / scores[old], 4),
        }
    units = {
        "house_cost.cpu_s": "s of CPU a home: house, cameras and illuminance",
        "house_cost.ratio": "of the other checkout's CPU",
        "house_cost.same_houses": "share of homes with the same house.glb",
        "house_cost.same_views": "share of the other checkout's cameras that are chosen here, too",
        "house_cost.score_ratio": "sum of the scores of all views, of the other checkout's",
    }
    write_report("house_cost", figures, {name: units[name] for name in figures})


def _in_a_process(tree: Path, home: str) -> dict[str, Any]:
    done = subprocess.run(
        [sys.executable, __file__, "--one", home], capture_output=True, text=True, check=False,
        env=os.environ | {"PYTHONPATH": str(tree)}, cwd=tree,
    )  # fmt: skip
    if done.returncode:
        raise RuntimeError(f"{tree}: {home}: {done.stderr.strip().splitlines()[-1:]}")
    row: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return row


def _cost(home: str) -> dict[str, Any]:
    """CPU seconds of the steps and of the passes of `house`; what they made, as digests."""
    from pbrs_farm.core import keys
    from pbrs_farm.core.recipe import recipe_from_name
    from pbrs_farm.formats.cameras_json import views_from_json
    from pbrs_farm.prepare import finished_house
    from pbrs_farm.prepare.passes import PASSES
    from pbrs_farm.prepare.source import resolve, variants
    from pbrs_farm.run.house_cache import HouseCache
    from pbrs_farm.run.step_cache import Work
    from pbrs_farm.run.steps import run_step
    from pbrs_farm.store import MemoryStore

    cpu_s: dict[str, float] = {}

    def timed(name: str, do: Callable[..., Any]) -> Callable[..., Any]:
        def run(*arguments: Any) -> Any:
            began = time.process_time()
            try:
                return do(*arguments)
            finally:
                cpu_s[name] = round(cpu_s.get(name, 0.0) + time.process_time() - began, 3)

        return run

    passes = tuple(replace(one, run=timed(f"house {one.name}", one.run)) for one in PASSES)
    (source,) = variants(resolve(home), [1])
    store, house_id = MemoryStore(), source.house_id
    work = Work(store, recipe_from_name("preview"), house_id, HouseCache(), source=source)
    with mock.patch.object(finished_house, "PASSES", passes):
        for step in STEPS:
            timed(step, run_step)(step, work)
    glb, cameras = (
        store.get(keys.house_key(house_id, name)) for name in ("house.glb", "cameras.json")
    )
    views = views_from_json(cameras, home).values()
    return {
        "cpu_s": cpu_s,
        "house": hashlib.sha256(glb).hexdigest(),
        "views": [f"{v.id} {v.camera.world_from_camera.round(4).tolist()}" for v in views],
        "scores": [v.score for v in views],
    }


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("homes", nargs="*", default=HOMES)
    parser.add_argument("--against", default="", metavar="FOLDER")
    parser.add_argument("--one", default="", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.one:
        print(json.dumps(_cost(given.one)))
    else:
        main(tuple(given.homes), given.against)
