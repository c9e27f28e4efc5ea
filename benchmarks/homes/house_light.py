"""The views that a `preview` run chooses in a home, three at most: which of them are dark.

`python -m benchmarks.homes.house_light NAME` renders them small in this process and prints JSON;
benchmarks/homes/houses.py runs it for each example home.
"""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from typing import Any

from pbrs_farm.core.recipe import recipe_from_name
from pbrs_farm.prepare.source import resolve
from pbrs_farm.run import plan
from pbrs_farm.run.house_cache import HouseCache
from pbrs_farm.run.step_cache import Work
from pbrs_farm.run.steps import run_step
from pbrs_farm.store import MemoryStore

N_VIEWS = 3  # of a home
SMALL = {"image.width_px": "32", "image.height_px": "24", "light.spp": "4", "light.pilot_spp": "0"}


def light_of_views(name: str) -> dict[str, Any]:
    """views: how many were rendered; dark: a line for each dark one; left_out: of rooms."""
    recipe, source = recipe_from_name("preview", SMALL), resolve(name)
    work = Work(MemoryStore(), recipe, source.house_id, HouseCache(), source=source)
    want = plan.wanted(["mlt_il_ol"], [], N_VIEWS)
    facts = {s: run_step(s, work).marker.facts for s in plan.house_steps(want, source.house_id)}
    # Choose as a run does.
    rows = [(str(v), str(room), float(score)) for v, room, score in facts["cameras"]["views"]]
    left_out: list[str] = []
    if plan.leaves_out_dark_rooms(recipe, want, source.house_id):
        lux = facts["illuminance"]["floor_lux"]
        rows, left_out = plan.lit_views(rows, lux, recipe.selection.min_room_lx)
    views = plan.spread(rows, want.n_views)
    dark = []
    for view in views:
        said = run_step("light", replace(work, view_id=view)).marker.facts
        if said.get("dark"):
            dark.append(f"{view}: {'; '.join(said['dark'])}")
    return {"views": len(views), "dark": dark, "left_out": left_out}


if __name__ == "__main__":
    print(json.dumps(light_of_views(sys.argv[1])))
