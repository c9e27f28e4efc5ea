"""Light of stored views traced again, small, by new random numbers, for `verify --light`; holds scenes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Final

from pbrs_farm.core import keys
from pbrs_farm.core.arrays import F32
from pbrs_farm.core.recipe import recipe_from_json
from pbrs_farm.raycast.variant import choose_variant
from pbrs_farm.regular_files import read_given
from pbrs_farm.run.house_cache import HouseCache
from pbrs_farm.run.view_setup import ViewSetup
from pbrs_farm.store.folder import FolderStore

_SPP: Final = 64


class LightAgain:
    """Traces light of a root's views by `path`, house after house, with the recipe's lamps and sky."""

    def __init__(self, root: Path) -> None:
        """Raises BadInput or BadRecipe for a root without a readable recipe.json."""
        file = root / "recipe.json"
        self._recipe = recipe_from_json(read_given(file), str(file))
        self._store, self._cache = FolderStore(root), HouseCache()

    @cached_property
    def variant(self) -> str:
        """Mitsuba's variant on this machine."""
        return choose_variant()

    def light(
        self, house_id: str, view_id: str, width_px: int, height_px: int
    ) -> Mapping[str, F32]:
        """The radiance (H, W, 3) of both light groups at another size; BadInput, or RenderFailed if dark."""
        house = self._cache.get(self._store, self._recipe, house_id, "")
        views = house.views("")
        setup = ViewSetup(house, house.view(view_id, ""), views)
        camera = replace(setup.camera.with_size(width_px, height_px), blur=setup.blur)
        fields = self._recipe.light.model_copy(
            update={
                "integrator": "path", "spp": _SPP, "noise": 0.0, "time_budget_s": 0.0,
                "filter": "box", "groups": "two",
            }
        )  # fmt: skip
        seed = keys.seed(house_id, view_id, "light again")
        result = house.light_scene_at(setup.view.time_s).render(
            camera, setup.view.room_id, fields, seed, shutter_s=self._recipe.blur.shutter_s
        )
        return {"outdoor": result.outdoor, "indoor": result.indoor}
