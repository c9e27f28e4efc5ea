"""LightScene: a house loaded once for all its views and light groups.

Effects: holds Mitsuba scenes and device buffers of the process's variant.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.camera import Camera
from pbrs_farm.errors import RenderFailed
from pbrs_farm.house import House
from pbrs_farm.recipe import LightFields, Recipe
from pbrs_farm.transport.result import LightResult, relative_noise
from pbrs_farm.transport.sky import Sky
from pbrs_farm.transport.tables import SceneTables, tables_from_house
from pbrs_farm.transport.variant import choose_variant, mitsuba

_SAMPLES_PER_LAUNCH: Final = 1 << 26


class LightScene:
    """The light of one house under one sky.

    tables: geometry, materials and lamps as numbers. notes: what had to be changed or left out.
    """

    def __init__(
        self, tables: SceneTables, sky: Sky, portals: NDArray[np.float64], variant: str
    ) -> None:
        self.tables = tables
        self.sky = sky
        self.variant = variant
        self.notes = tables.notes
        self._portals = portals
        mitsuba(variant)
        from pbrs_farm.transport.surface import Stage

        self._stage = Stage(tables)

    @staticmethod
    def load(
        house: House,
        textures: dict[str, NDArray[np.uint8]],
        recipe: Recipe,
        sky: Sky,
        *,
        variant: str | None = None,
    ) -> LightScene:
        """The scene of a repaired house; window panes carry no light and are left out.

        textures: id -> (H, W, 3 or 4) uint8 sRGB, row 0 at the top. Raises BadHouse when there
        is nothing to see and MachineFailed when Mitsuba does not work here.
        """
        name = choose_variant() if variant is None else variant
        mitsuba(name)
        from pbrs_farm.transport.pilot import portals_of_house

        tables = tables_from_house(house, textures, recipe)
        return LightScene(tables, sky, portals_of_house(house), name)

    @property
    def n_lamps(self) -> int:
        """Light sources."""
        return len(self.tables.lamps)

    def render(self, camera: Camera, room_id: str, fields: LightFields, seed: int) -> LightResult:
        """Both light groups as a camera sees them, with fields.spp samples per pixel.

        room_id names the view in errors. Equal arguments give equal bits on one machine.
        """
        mitsuba(self.variant)
        from pbrs_farm.transport.path import Lanes, Sums, trace

        i = camera.intrinsics
        emitters, weights = self._emitters(camera, fields, seed)
        n_pixels = i.width_px * i.height_px
        per_launch = max(_SAMPLES_PER_LAUNCH // n_pixels, 1)
        total: Sums | None = None
        for first in range(0, fields.spp, per_launch):
            n = min(per_launch, fields.spp - first)
            lanes = Lanes(i.width_px, i.height_px, first, n, seed)
            sums = trace(self._stage, emitters, camera, lanes, fields)
            total = sums if total is None else total + sums
        if total is None:
            raise RenderFailed("no samples", view=room_id, mode="light", seed=seed)
        facts: dict[str, Any] = {"integrator": "path", "seed": seed, "lamp_weights": weights}
        return _result(total, camera, fields.spp, facts)

    def _emitters(
        self, camera: Camera, fields: LightFields, seed: int
    ) -> tuple[Any, dict[str, float]]:
        """Emitters with the weights of this view, and the lamps' weights by name."""
        from pbrs_farm.transport.emitters import Emitters
        from pbrs_farm.transport.pilot import nearest_portals, pilot_weights, uniform_weights

        portals = nearest_portals(self._portals, camera)
        weights = uniform_weights(self.n_lamps, len(portals))
        emitters = Emitters(self.tables, self.sky, portals, weights)
        if fields.pilot_spp > 0:
            weights = pilot_weights(
                self._stage, emitters, camera, self.n_lamps, len(portals), fields, seed ^ 0x5EED
            )
            emitters.with_weights(weights)
        names = [lamp.name for lamp in self.tables.lamps]
        return emitters, {n: float(w) for n, w in zip(names, weights.lamps, strict=True)}


def _result(sums: Any, camera: Camera, spp: int, facts: dict[str, Any]) -> LightResult:
    shape = (camera.intrinsics.height_px, camera.intrinsics.width_px, 3)
    n_even = max(-(-spp // 2), 1)
    n_odd = max(spp - n_even, 1)

    def picture(values: NDArray[np.float32], n: int) -> NDArray[np.float32]:
        return np.ascontiguousarray((values / np.float32(n)).reshape(shape))

    outdoor, indoor = picture(sums.outdoor, spp), picture(sums.indoor, spp)
    even = picture(sums.outdoor_even, n_even), picture(sums.indoor_even, n_even)
    odd = (
        picture(sums.outdoor - sums.outdoor_even, n_odd),
        picture(sums.indoor - sums.indoor_even, n_odd),
    )
    noise = {
        "outdoor": relative_noise(even[0], odd[0]),
        "indoor": relative_noise(even[1], odd[1]),
        "sum": relative_noise(even[0] + even[1], odd[0] + odd[1]),
    }
    normal = picture(sums.normal, spp)
    length = np.linalg.norm(normal, axis=-1, keepdims=True)
    normal = np.where(length > 0, normal / np.maximum(length, 1e-6), 0).astype(np.float32)
    albedo = np.clip(picture(sums.albedo, spp), 0, 1)
    return LightResult(outdoor, indoor, albedo, normal, noise, spp, sums.n_bad, facts)
