"""A home before and after it is dressed, from cameras chosen on the dressed home; effects: Mitsuba scenes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

from pbrs_farm.core import keys
from pbrs_farm.core.arrays import Srgb8Image
from pbrs_farm.core.camera import View
from pbrs_farm.core.house import House
from pbrs_farm.core.lighting import Mode
from pbrs_farm.core.recipe import Recipe
from pbrs_farm.run import plan
from pbrs_farm.run.house_cache import CachedHouse, decoded_textures
from pbrs_farm.run.steps import camera_seed
from pbrs_farm.store import MemoryStore

if TYPE_CHECKING:
    from pbrs_farm.transport.scene_tables.sky import Sky


@dataclass(frozen=True, slots=True, eq=False)
class ViewPair:
    """Two pictures of one view, (H, W, 3) sRGB each."""

    view: View
    before: Srgb8Image
    after: Srgb8Image


def pairs(bare: House, dressed: House, recipe: Recipe, n_views: int) -> Iterator[ViewPair]:
    """At most n_views best views of the dressed home, one a room first, and of the bare one, both repaired."""
    from pbrs_farm.raycast.caster import Caster
    from pbrs_farm.sample.house_sampler import sample_cameras

    caster = Caster.of_house(dressed)
    views = sample_cameras(
        dressed,
        recipe.judged_cameras,
        camera_seed(dressed.id, recipe),
        caster.item_counts,
        caster.item_pictures,
    ).views
    rows = [(v.id, v.room_id, v.score) for v in views]
    chosen = set(plan.spread(rows, n_views))
    # Take one sky for both houses, so that only the dressing differs.
    sky = CachedHouse(MemoryStore(), recipe, bare.id, "").sky
    scenes = [_LoadedHouse(house, recipe, sky) for house in (bare, dressed)]
    for view in views:
        if view.id in chosen:
            before, after = (scene.picture(view) for scene in scenes)
            yield ViewPair(view, before, after)


class _LoadedHouse:
    """A house in memory with its light scene, and the pictures of it."""

    def __init__(self, house: House, recipe: Recipe, sky: Sky) -> None:
        from pbrs_farm.transport.light_scene import LightScene

        self._recipe = recipe
        self._scene = LightScene.load(house, decoded_textures(house)[0], recipe, sky)

    def picture(self, view: View) -> Srgb8Image:
        """The view by lamps and daylight, as the recipe's size, light and tone have it."""
        from pbrs_farm.transport.develop.mode_pictures import LinearAovs, develop

        recipe = self._recipe
        camera = view.camera.with_size(recipe.image.width_px, recipe.image.height_px)
        seed = keys.seed(view.id, "before-after", recipe.seed)
        light = self._scene.render(camera, view.room_id, recipe.light, seed)
        aovs = LinearAovs(light.outdoor, light.indoor, light.albedo, light.normal)
        images = develop(aovs, recipe.tone, denoise=recipe.light.denoise)
        return images[Mode.MLT_IL_OL.value].rgb_srgb8
