"""CPU seconds of a `fast` view of a home, bare and dressed, from the same camera; prints JSON.

`python -m benchmarks.dress.light_cost NAME SEED`. Each is rendered twice; the second counts, which
compiles nothing.
"""

from __future__ import annotations

import json
import sys
import time

from pbrs_farm.core.house import House
from pbrs_farm.core.recipe import Recipe, recipe_from_name
from pbrs_farm.prepare.finished_house import repaired_house
from pbrs_farm.prepare.source import resolve, variants
from pbrs_farm.run import plan
from pbrs_farm.run.house_cache import CachedHouse, decoded_textures
from pbrs_farm.run.steps import camera_seed
from pbrs_farm.store import MemoryStore


def cost(name: str, seed: int) -> dict[str, float]:
    """CPU seconds bare and dressed, of the dressed home's best view."""
    from pbrs_farm.raycast.caster import Caster
    from pbrs_farm.sample.house_sampler import sample_cameras

    recipe = recipe_from_name("fast")
    bare, _ = repaired_house(resolve(name), recipe)
    dressed, _ = repaired_house(variants(resolve(name), [seed])[0], recipe)
    caster = Caster.of_house(dressed)
    views = sample_cameras(
        dressed, recipe.cameras, camera_seed(dressed.id, recipe), caster.item_counts,
        caster.depth_pictures,
    ).views  # fmt: skip
    (best,) = plan.spread([(v.id, v.room_id, v.score) for v in views], 1)
    view = next(v for v in views if v.id == best)
    seconds = {
        what: _seconds(house, recipe, bare.id, view)
        for what, house in (("bare", bare), ("dressed", dressed))
    }
    return seconds | {"ratio": round(seconds["dressed"] / seconds["bare"], 3)}


def _seconds(house: House, recipe: Recipe, sky_id: str, view: object) -> float:
    from pbrs_farm.core.camera import View
    from pbrs_farm.transport.light_scene import LightScene

    assert isinstance(view, View)
    sky = CachedHouse(MemoryStore(), recipe, sky_id, "").sky
    scene = LightScene.load(house, decoded_textures(house)[0], recipe, sky)
    camera = view.camera.with_size(recipe.image.width_px, recipe.image.height_px)
    spent = 0.0
    for _time in range(2):
        started = time.process_time()
        scene.render(camera, view.room_id, recipe.light, 1)
        spent = time.process_time() - started
    return round(spent, 2)


if __name__ == "__main__":
    print(json.dumps(cost(sys.argv[1], int(sys.argv[2]))))
