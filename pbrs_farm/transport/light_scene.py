"""LightScene: a house loaded once for all its views and light groups.

Effects: holds Mitsuba scenes and device buffers of the process's variant.
"""

from __future__ import annotations

import time
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.camera import Camera
from pbrs_farm.core.errors import MachineFailed, RenderFailed
from pbrs_farm.core.house import House
from pbrs_farm.core.lighting import Group
from pbrs_farm.core.recipe import LightFields, Recipe
from pbrs_farm.raycast.variant import choose_variant, mitsuba
from pbrs_farm.transport.lamp_layers import MAX_SUMS, with_lamp_layers
from pbrs_farm.transport.light_result import LightResult, joined_result, result_from_sums
from pbrs_farm.transport.scene_tables.scene_tables import (
    SceneTables,
    bounding_spheres,
    tables_from_house,
)
from pbrs_farm.transport.scene_tables.sky import Sky
from pbrs_farm.transport.time_budget import TimeBudget

_SAMPLES_PER_LAUNCH: Final = 1 << 26


class LightScene:
    """The light of one house under one sky.

    tables: geometry, materials and lamps as numbers. notes: what had to be changed or left out.
    device_scene: the same on the device; None for scalar variants.
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
        self.device_scene: Any = None
        self._emitters: Any = None
        if not variant.startswith("scalar"):
            from pbrs_farm.transport.kernels.device_scene import DeviceScene

            self.device_scene = DeviceScene(tables)

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
        from pbrs_farm.transport.scene_tables.portals import portals_of_house

        tables = tables_from_house(house, textures, recipe)
        return LightScene(tables, sky, portals_of_house(house), name)

    @property
    def n_lamps(self) -> int:
        """Light sources."""
        return len(self.tables.lamps)

    def render(self, camera: Camera, room_id: str, fields: LightFields, seed: int) -> LightResult:
        """Both light groups as a camera sees them, by the integrator that fields name.

        `path`: fields.spp samples per pixel, again and again until fields.noise is reached when
        it is given, or as many as fit into fields.time_budget_s. `metropolis`: direct light by
        fields.direct_spp samples, the rest by mutations. With fields.groups "lamps" `path` sums the
        light of each lamp by itself, too. room_id names the view in errors. Equal
        arguments give equal bits on one machine (Metropolis: equal to 1e-5, it splats in
        parallel); with a time budget similar pictures.
        """
        if self.variant.startswith("scalar"):
            return self._render_scalar(camera, fields, seed)
        mitsuba(self.variant)
        emitters, weights = self.emitters(camera, fields, seed)
        facts: dict[str, Any] = {"seed": seed, "lamp_weights": weights}
        if fields.integrator == "metropolis":
            return self._render_metropolis(camera, room_id, fields, seed, emitters, facts)
        facts["integrator"] = "path"
        if fields.groups == "two":
            sums, spp = self._path_sums(camera, fields, seed, emitters)
            return result_from_sums(sums, camera, spp, facts)
        n_lamps = self._n_lamps_that_fit(camera, room_id, seed)
        sums, spp = self._path_sums(camera, fields, seed, emitters, n_lamps=n_lamps)
        result = result_from_sums(sums, camera, spp, facts)
        return with_lamp_layers(result, sums.lamps, spp, self.tables.lamps)

    def _n_lamps_that_fit(self, camera: Camera, room_id: str, seed: int) -> int:
        """The number of lamps; RenderFailed when a sum of each is more than the kernel can count."""
        i = camera.intrinsics
        if i.width_px * i.height_px * self.n_lamps * 3 >= MAX_SUMS:
            raise RenderFailed(
                f"{i.width_px}x{i.height_px} pixels are too many for {self.n_lamps} lamps each",
                view=room_id,
                mode="light",
                seed=seed,
                hint="a smaller picture, or --groups two",
            )
        return self.n_lamps

    def _path_sums(
        self,
        camera: Camera,
        fields: LightFields,
        seed: int,
        emitters: Any,
        *,
        max_depth: int | None = None,
        n_lamps: int = 0,
    ) -> tuple[Any, int]:
        """(sums, samples per pixel) in passes of fields.spp until fields.noise is reached.

        With a time budget: in launches as long as what is left of it, and no fewer than one.
        n_lamps: 0, or the number of all lamps, to sum the light of each by itself.
        """
        from pbrs_farm.transport.path_tracer import Lanes, trace

        i = camera.intrinsics
        per_launch = max(_SAMPLES_PER_LAUNCH // (i.width_px * i.height_px), 1)
        watch = TimeBudget(fields.time_budget_s)
        is_open = watch.runs or fields.noise > 0
        goal = max(fields.spp, fields.max_spp) if is_open else fields.spp
        if fields.noise > 0:
            per_launch = min(per_launch, fields.spp)
        total: Any = None
        spp = 0
        while spp < goal and (n := watch.fitting(min(per_launch, goal - spp))) > 0:
            lanes = Lanes(i.width_px, i.height_px, spp, n, seed, n_lamps=n_lamps)
            sums = trace(self.device_scene, emitters, camera, lanes, fields, max_depth=max_depth)
            watch.did(n)
            total = sums if total is None else total + sums
            spp += n
            if fields.noise > 0 and spp >= fields.spp:
                noise = result_from_sums(total, camera, spp, {}).noise["sum"]
                if noise <= fields.noise:
                    break
        return total, spp

    def _render_metropolis(
        self,
        camera: Camera,
        room_id: str,
        fields: LightFields,
        seed: int,
        emitters: Any,
        facts: dict[str, Any],
    ) -> LightResult:
        """Direct light by `path` with two segments, the rest by Metropolis, group by group."""
        from pbrs_farm.transport.metropolis.integrator import metropolis

        began = time.monotonic()
        is_separate = fields.direct_spp > 0
        plain = fields.model_copy(update={"spp": max(fields.direct_spp, 1), "time_budget_s": 0.0})
        sums, spp = self._path_sums(
            camera, plain, seed, emitters, max_depth=2 if is_separate else 1
        )
        direct = result_from_sums(sums, camera, spp, {})
        halves: dict[Group, tuple[Any, Any]] = {}
        n_bad = direct.n_nonfinite
        budget = max(fields.time_budget_s - (time.monotonic() - began), 0.0)
        for k, group in enumerate(Group):
            deadline = time.monotonic() + budget / 2 if fields.time_budget_s > 0 else None
            rest = metropolis(
                self.device_scene,
                emitters,
                camera,
                group,
                fields,
                seed + k,
                min_segments=3 if is_separate else 1,
                deadline=deadline,
            )
            halves[group] = rest.halves
            n_bad += rest.n_bad
            facts[group.value] = {
                "mean_luminance": rest.mean_luminance,
                "acceptance": round(rest.acceptance, 4),
                "mutations": rest.n_mutations,
            }
        if not self._is_lit(direct, halves):
            raise RenderFailed(
                f"no light found in room {room_id}: {self._what_emits()}",
                view=room_id,
                mode="light",
                seed=seed,
            )
        facts |= {
            "integrator": "pssmlt-camera",
            "large_step": fields.large_step,
            "tail_pixels": fields.tail_pixels,
        }
        return joined_result(direct if is_separate else None, direct, halves, n_bad, facts, fields)

    def floor_lux(self, house: House, *, seed: int = 0) -> dict[str, dict[str, float]]:
        """Room id -> mean illuminance of its floor in lx by "outdoor" and "indoor" light.

        256 points 5 cm above the floor, 32 paths each, furniture and all. {} for scalar variants.
        """
        if self.variant.startswith("scalar"):
            return {}
        mitsuba(self.variant)
        from pbrs_farm.transport.guiding.pilot import weights_by_distance
        from pbrs_farm.transport.illuminance import floor_points, illuminance_lx
        from pbrs_farm.transport.scene_tables.portals import nearest_portals

        balls = bounding_spheres(self.tables)
        lux: dict[str, dict[str, float]] = {}
        for room in house.rooms:
            points = floor_points(room, 256, seed)
            portals = nearest_portals(self._portals, points.mean(0))
            weights = weights_by_distance(balls, points.mean(0), len(portals))
            emitters = self._emitters_of_view(portals, weights)
            outdoor, indoor = illuminance_lx(self.device_scene, emitters, points, seed)
            lux[room.id] = {"outdoor": round(outdoor, 2), "indoor": round(indoor, 2)}
        return lux

    def _is_lit(self, direct: LightResult, halves: dict[Group, tuple[Any, Any]]) -> bool:
        if direct.outdoor.any() or direct.indoor.any():
            return True
        return any(half.any() for pair in halves.values() for half in pair)

    def _what_emits(self) -> str:
        n = self.n_lamps
        sky = "a sky" if self.sky.dome.any() or self.sky.sun_irradiance.any() else "no sky"
        return f"{sky} and {n} lamp{'s' * (n != 1)} in the house, none reaches this view"

    def _render_scalar(self, camera: Camera, fields: LightFields, seed: int) -> LightResult:
        """By Mitsuba's own plugins: scalar variants have no arrays for our kernels."""
        from pbrs_farm.transport.validation.mitsuba_reference import ReferenceScene

        if fields.groups == "lamps":
            raise MachineFailed(
                f"light by lamp needs LLVM or CUDA, this is {self.variant}",
                hint="sudo apt-get install -y libllvm19, or --groups two",
            )
        scene = ReferenceScene(self.tables, self.sky, self.variant)
        half = fields.model_copy(update={"spp": max(fields.spp // 2, 1)})
        halves = {
            g: tuple(scene.render(camera, g, half, seed + 2 * k + j) for j in range(2))
            for k, g in enumerate(Group)
        }
        i = camera.intrinsics
        plain = np.zeros((i.height_px, i.width_px, 3), np.float32)
        guides = LightResult(plain, plain, np.ones_like(plain), plain, {}, 0, 0, {})
        facts = {"integrator": "mitsuba path", "seed": seed}
        return joined_result(
            None, guides, halves, 0, facts, half.model_copy(update={"spp": 2 * half.spp})
        )

    def emitters(
        self, camera: Camera, fields: LightFields, seed: int
    ) -> tuple[Any, dict[str, float]]:
        """Emitters with the weights of this view, and the lamps' weights by name."""
        from pbrs_farm.transport.guiding.pilot import pilot_weights, uniform_weights
        from pbrs_farm.transport.scene_tables.portals import nearest_portals

        portals = nearest_portals(self._portals, camera.eye)
        weights = uniform_weights(self.n_lamps, len(portals))
        emitters = self._emitters_of_view(portals, weights)
        if fields.pilot_spp > 0:
            weights = pilot_weights(
                self.device_scene,
                emitters,
                camera,
                self.n_lamps,
                len(portals),
                fields,
                seed ^ 0x5EED,
            )
            emitters.set_weights(weights)
        names = [lamp.name for lamp in self.tables.lamps]
        return emitters, {n: float(w) for n, w in zip(names, weights.lamps, strict=True)}

    def _emitters_of_view(self, portals: NDArray[np.float64], weights: Any) -> Any:
        """The emitters, their tables built once, with the portals and weights of a view."""
        from pbrs_farm.transport.kernels.emitters import Emitters

        if self._emitters is None:
            from pbrs_farm.transport.guiding.lampshade_exitance import guiding_targets, pdfs_by_face

            self._emitters = Emitters(self.tables, self.sky, portals, weights)
            targets = guiding_targets(self.device_scene, self._emitters, self.tables, 0)
            self.device_scene.set_guiding_targets(*pdfs_by_face(targets))
            self._emitters.set_targets(targets)
        else:
            self._emitters.set_view(portals, weights)
        return self._emitters
