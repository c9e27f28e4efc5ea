"""Dress pairs of (home, seed) without rendering: those that fail or leave a gate broken; prints JSON.

`python -m benchmarks.dress.failures NAME FIRST LAST`.
"""

from __future__ import annotations

import json
import sys
import time

from benchmarks.dress.dressed_home import house_as_a_run_has_it
from pbrs_farm.core.recipe import recipe_from_name
from pbrs_farm.dress.dressing import dress
from pbrs_farm.prepare.dress_catalogue import catalogue_of


def failures(name: str, seeds: range) -> dict[str, object]:
    """Of one home: how many seeds, those that fail with why, and the longest time."""
    recipe = recipe_from_name("fast")
    source = house_as_a_run_has_it(name)
    catalogue = catalogue_of(recipe.dress)
    failed, longest = [], 0.0
    for seed in seeds:
        started = time.process_time()
        try:
            _house, report = dress(source, catalogue, recipe.dress, seed)
            broken = [g.name for g in report.gates if g.n_left]
        except Exception as error:  # noqa: BLE001  each is a failure that is counted
            broken = [f"{type(error).__name__}: {error}"]
        if broken:
            failed.append([name, seed, "; ".join(broken)])
        longest = max(longest, time.process_time() - started)
    return {"n": len(seeds), "failed": failed, "longest_s": round(longest, 2)}


if __name__ == "__main__":
    print(json.dumps(failures(sys.argv[1], range(int(sys.argv[2]), int(sys.argv[3]) + 1))))
