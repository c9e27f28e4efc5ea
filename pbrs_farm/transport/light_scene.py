"""The way into light transport: a house loaded once for all its views and light groups.

Effects: holds Mitsuba scenes and device buffers of the process's variant.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Collection
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import chain
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F32, F64
from pbrs_farm.core.camera import Camera
from pbrs_farm.core.errors import BadHouse, MachineFailed, RenderFailed
from pbrs_farm.core.house import House, Material
from pbrs_farm.core.lighting import Group
from pbrs_farm.core.recipe import LightFields, Recipe
from pbrs_farm.geometry.moving import MovingHouse
from pbrs_farm.raycast.variant import choose_variant, mitsuba
from pbrs_farm.transport.diffuse_images import add_diffuse_images
from pbrs_farm.transport.lamp_layers import MAX_SUMS, add_lamp_layers
from pbrs_farm.transport.light_result import LightResult, blacken, join_results, result_from_sums
from pbrs_farm.transport.render_checkpoint import NoCheckpoint, RenderCheckpoint
from pbrs_farm.transport.scene_tables.portals import panes_of_house, portals_of_house
from pbrs_farm.transport.scene_tables.scene_tables import SceneTables, moved_rows, tables_from_house
from pbrs_farm.transport.scene_tables.sky import Sky
from pbrs_farm.transport.scene_tables.texture_atlas import map_key
from pbrs_farm.transport.surface_noise import NoiseAnchors, StreamWalk, SurfaceStreams

if TYPE_CHECKING:
    from pbrs_farm.transport.kernels.emitters import Emitters, EmitterWeights
    from pbrs_farm.transport.sample_passes import SampledView
    from pbrs_farm.transport.view_emitters import ViewEmitters

Pictures = dict[str, NDArray[np.uint8]]

_FLOOR_POINTS: Final = 256  # a room, for its mean illuminance


def _moved(
    moving: MovingHouse, tables: SceneTables, time_s: float | None
) -> tuple[F32, NDArray[np.uint32], F32]:
    """Arguments of DeviceScene.move: vertices at a time, the moving faces, their rows."""
    geometry = moving.geometry if time_s is None else moving.at(time_s)[1]
    faces = np.flatnonzero(moving.moving_faces[tables.kept])
    return geometry.positions, faces.astype(np.uint32), moved_rows(geometry, tables, faces)


@dataclass(frozen=True, slots=True, eq=False)
class Pilot:
    """A view whose pilot says how often each emitter is worth sampling."""

    camera: Camera
    seed: int  # of that view's light
    time_s: float | None = None  # of that view, in a home with motions


def _materials_of(house: House) -> list[Material]:
    """The materials that some item shows."""
    shown = {s.material for item in house.items for s in item.surfaces}
    return [house.materials[k] for k in sorted(shown)]


class LightScene:
    """The scene of one house under one sky.

    tables: geometry, materials and area emitters as arrays, with notes on what had to be changed
    or left out. device_scene: the same on the device; None for scalar variants.
    """

    def __init__(
        self,
        tables: SceneTables,
        sky: Sky,
        portals: F64,
        variant: str,
        outside: tuple[House, SceneTables] | None = None,
        panes: SceneTables | None = None,
        moving: tuple[MovingHouse, MovingHouse | None] | None = None,
    ) -> None:
        self.tables = tables
        self.sky = sky
        self.variant = variant
        self.notes = tables.notes
        mitsuba(variant)
        self.device_scene: Any = None
        if not variant.startswith("scalar"):
            from pbrs_farm.transport.kernels.device_scene import DeviceScene, Panes

            self.device_scene = DeviceScene(tables, one_scene=variant.startswith("cuda"))
            # OptiX takes one scene in a kernel: there panes mirror nothing.
            if panes is not None and variant.startswith("llvm"):
                self.device_scene.panes = Panes(panes)
            # The device has the texels, most of the tables' bytes.
            self.tables = replace(tables, texels=np.zeros(1, np.uint32))
        self._portals = portals
        self._moving = moving  # the home and its panes; None where nothing moves
        self._panes = panes
        self._time_s: float | None = None  # that the device has
        # Rigs are rendered frame by frame, one eye after the other.
        self._walks = defaultdict[str, StreamWalk](StreamWalk)
        # OptiX takes one scene in a kernel: there windows show the sky alone.
        self._outside = outside if variant.startswith("llvm") else None

    @staticmethod
    def load(
        house: House,
        textures: Pictures | Callable[[Collection[str | None]], Pictures],
        recipe: Recipe,
        sky: Sky,
        *,
        variant: str | None = None,
    ) -> LightScene:
        """The scene of a repaired house; its window panes only mirror what rays from the camera show.

        textures: id -> (H, W, 3 or 4) uint8 sRGB, row 0 at the top, or a function that decodes some, so
        that nobody holds them longer than needed. Raises BadHouse when there is no surface and MachineFailed
        when Mitsuba does not work here.
        """
        name = choose_variant() if variant is None else variant
        mitsuba(name)
        inside = house.with_items(i for i in house.items if not i.is_outside)

        def tables_of(some: House, names: Collection[str | None]) -> SceneTables:
            pictures = textures(names) if callable(textures) else textures
            pictures = {k: picture for k, picture in pictures.items() if k in names}
            tables = tables_from_house(some, pictures, recipe)
            if name.startswith("scalar"):
                return tables
            from pbrs_farm.transport.kernels.device_scene import with_device_texels

            del pictures
            return with_device_texels(tables)

        maps = ((m.texture_id, *map_key(m)[:2]) for m in _materials_of(inside))
        tables = tables_of(inside, set(chain.from_iterable(maps)))
        outside = None
        if len(inside.items) < len(house.items):
            beyond = house.with_items(i for i in house.items if i.is_outside)
            outside = beyond, tables_of(beyond, {m.texture_id for m in _materials_of(beyond)})
        glass = None if recipe.materials.preset == "released" else panes_of_house(inside)
        panes = None if glass is None else tables_of(glass, ())
        moving = None
        if inside.motions:
            panes_then = None if glass is None else MovingHouse.of(glass, with_panes=False)
            moving = MovingHouse.of(inside, with_panes=False), panes_then
        return LightScene(tables, sky, portals_of_house(house), name, outside, panes, moving)

    def move_to(self, time_s: float | None) -> None:
        """Put what moves where it is at a time, in seconds; None: at rest. Nothing where it is there.

        Raises MachineFailed for a scalar variant and BadHouse for a lamp that moves: the light of
        either is made for one place.
        """
        if self._moving is None or time_s == self._time_s:
            return
        home, panes = self._moving
        self._check_moving(home.house)
        positions, faces, rows = _moved(home, self.tables, time_s)
        self.device_scene.move(positions, faces, rows)
        if panes is not None and self._panes is not None and self.device_scene.panes is not None:
            self.device_scene.panes.move(*_moved(panes, self._panes, time_s))
        self._time_s = time_s

    def _check_moving(self, house: House) -> None:
        if self.variant.startswith("scalar"):
            text = f"moving items need LLVM or CUDA, this is {self.variant}"
            raise MachineFailed(text, hint="sudo apt-get install -y libllvm19")
        moving = {motion.item for motion in house.motions}
        for item in house.items:
            if item.lights and item.id in moving:
                text = "is a moving lamp: its light would not follow"
                raise BadHouse(house.source.file, item.id, text, hint="make it static")

    @property
    def n_lamps(self) -> int:
        """The number of area emitters."""
        return len(self.tables.lamps)

    def render(
        self,
        camera: Camera,
        room_id: str,
        fields: LightFields,
        seed: int,
        checkpoint: RenderCheckpoint | None = None,
        *,
        pilot: Pilot | None = None,
        anchors: NoiseAnchors | None = None,
        splits_diffuse: bool = False,
        shutter_s: float = 0.0,
    ) -> LightResult:
        """Render the radiance of both light groups in a camera's view, by the integrator of fields.

        `path`: fields.spp samples per pixel, in passes until fields.noise is reached, if given, or as many as
        fit into fields.time_budget_s. `metropolis`: direct light by fields.direct_spp samples, the rest by
        mutations, fewer if they reach fields.noise earlier. With fields.groups "lamps" `path` also sums the
        light of each lamp separately. Deterministic to the bit on one machine (Metropolis to 1e-5, since it
        splats in parallel), except with a time budget.

        room_id: names the view in errors.
        checkpoint: stores progress, and resumes an earlier render with equal arguments; the picture is the same
        with or without.
        pilot: of another view, whose emitter weights are reused; None = its own.
        anchors: frames of a film up to this view, from which its surfaces have their random numbers, so that
        noise is fixed to them; None: by pixel.
        splits_diffuse: also return the diffuse light of first surfaces (diffuse_images.py); `path` only.
        shutter_s: exposure time of a camera with blur; moving items are blurred around the scene's time.

        Pixels without a ray are black. Raises MachineFailed for a lens, blur or split on a scalar variant,
        RenderFailed for blur or split by Metropolis.
        """
        # Emitters and their weights are those of the pilot's view; it is kept for the next one.
        view_pilot = pilot or Pilot(camera, seed, self._time_s)
        saved = checkpoint or NoCheckpoint()
        move = self._mover(camera, shutter_s)
        now_s = self._time_s
        try:
            result = self._render(
                camera, room_id, fields, seed, saved, view_pilot, anchors, splits_diffuse, move
            )
        finally:
            self.move_to(now_s)
        return result if camera.blind is None else blacken(result, camera.blind)

    def _render(
        self,
        camera: Camera,
        room_id: str,
        fields: LightFields,
        seed: int,
        checkpoint: RenderCheckpoint,
        pilot: Pilot,
        anchors: NoiseAnchors | None,
        splits_diffuse: bool,
        move: Callable[[float], None] | None,
    ) -> LightResult:
        if splits_diffuse:
            self._check_split(fields, room_id, seed)
        if self.variant.startswith("scalar"):
            return self._render_scalar(camera, fields, seed)
        mitsuba(self.variant)
        from pbrs_farm.transport.kernels.camera_rays import scatters_first
        from pbrs_farm.transport.sample_passes import SampledView, path_sums

        emitters, weights = self._emitters_of_pilot(pilot, fields)
        streams = self._streams(anchors) if anchors else None
        view = SampledView(
            self.device_scene, emitters, camera, fields, seed, streams, splits_diffuse, move
        )
        facts: dict[str, Any] = {"seed": seed, "lamp_weights": self._weights_by_name(weights)}
        if fields.integrator == "metropolis":
            if camera.blur is not None:
                text = "depth of field and motion blur need `path`"
                raise RenderFailed(text, view=room_id, mode="light", seed=seed)
            return self._render_metropolis(view, room_id, checkpoint, facts)
        facts |= {"integrator": "path", "guided": weights.is_guided}
        scatters = None
        if splits_diffuse:
            scatters = scatters_first(self.device_scene, replace(camera, blur=None))
        if fields.groups == "two":
            sums, spp = path_sums(view, checkpoint)
            result = result_from_sums(sums, camera, spp, facts)
        else:
            # Sum each lamp separately too, and split indoor light into layers.
            n_lamps = self._n_lamps_that_fit(camera, room_id, seed)
            sums, spp = path_sums(view, checkpoint, n_lamps=n_lamps)
            result = result_from_sums(sums, camera, spp, facts)
            result = add_lamp_layers(result, sums.lamps, spp, self.tables.lamps)
        return result if scatters is None else add_diffuse_images(result, sums, spp, scatters)

    def _mover(self, camera: Camera, shutter_s: float) -> Callable[[float], None] | None:
        """Moves items to a share of the shutter's time; None if nothing moves."""
        middle_s = self._time_s
        if camera.blur is None or shutter_s <= 0 or self._moving is None or middle_s is None:
            return None
        begin_s = middle_s - 0.5 * shutter_s
        if not self._moving[0].moves_between(begin_s, begin_s + shutter_s):
            return None
        return lambda share: self.move_to(begin_s + share * shutter_s)

    def _emitters_of_pilot(
        self, pilot: Pilot, fields: LightFields
    ) -> tuple[Emitters, EmitterWeights]:
        """The emitters weighted by a pilot, which is measured at its own time."""
        now_s, setting = self._time_s, (pilot.camera, fields, pilot.seed, pilot.time_s)
        if not self._view_emitters.is_built:
            self.move_to(None)
            self._view_emitters.build(pilot.camera.eye)
        if not self._view_emitters.knows(*setting):
            self.move_to(pilot.time_s)
        emitters = self._view_emitters.of_pilot(*setting)
        self.move_to(now_s)
        return emitters

    def _check_split(self, fields: LightFields, room_id: str, seed: int) -> None:
        """Raise where diffuse light cannot be split off."""
        if self.variant.startswith("scalar"):
            text = f"shading needs LLVM or CUDA, this is {self.variant}"
            raise MachineFailed(text, hint="sudo apt-get install -y libllvm19")
        if fields.integrator == "metropolis":
            text, hint = "shading and residual need `path`", "--set light.integrator=path"
            raise RenderFailed(text, view=room_id, mode="light", seed=seed, hint=hint)

    def _streams(self, anchors: NoiseAnchors) -> SurfaceStreams:
        """The streams of the pixels' random numbers, by what their centres show."""
        from pbrs_farm.transport.kernels.camera_rays import first_points

        def points(camera: Camera, time_s: float | None) -> F32:
            self.move_to(time_s)
            return first_points(self.device_scene, camera)

        now_s = self._time_s
        streams = self._walks[anchors.eye].streams(anchors, points)
        self.move_to(now_s)
        return streams

    def _weights_by_name(self, weights: EmitterWeights) -> dict[str, float]:
        names = [lamp.name for lamp in self.tables.lamps]
        return {n: float(w) for n, w in zip(names, weights.lamps, strict=True)}

    def _n_lamps_that_fit(self, camera: Camera, room_id: str, seed: int) -> int:
        """The number of lamps; RenderFailed when the kernel cannot count a sum for each of them."""
        i = camera.intrinsics
        if i.width_px * i.height_px * self.n_lamps * 3 >= MAX_SUMS:
            text = f"{i.width_px}x{i.height_px} pixels are too many for {self.n_lamps} lamps each"
            hint = "a smaller picture, or --groups two"
            raise RenderFailed(text, view=room_id, mode="light", seed=seed, hint=hint)
        return self.n_lamps

    def _render_metropolis(
        self, view: SampledView, room_id: str, checkpoint: RenderCheckpoint, facts: dict[str, Any]
    ) -> LightResult:
        """Direct light by `path` with two segments, the rest by Metropolis, group by group."""
        from pbrs_farm.transport.metropolis.metropolis_view import render_groups

        fields = view.fields
        direct, estimates = render_groups(view, checkpoint)
        halves = {group: e.halves for group, e in estimates.items()}
        self._check_lit(direct, halves, room_id, view.seed)
        for group, e in estimates.items():
            numbers = {"mean_luminance": e.mean_luminance, "acceptance": round(e.acceptance, 4)}
            facts[group.value] = numbers | {"mutations": e.n_mutations}
        facts |= {"integrator": "pssmlt-camera", "large_step": fields.large_step}
        facts |= {"tail_pixels": fields.tail_pixels, "direct_spp": fields.direct_spp}
        n_bad = direct.n_nonfinite + sum(e.n_bad for e in estimates.values())
        base = direct if fields.direct_spp > 0 else None
        return join_results(base, direct, halves, n_bad, facts)

    def floor_lux(self, house: House, *, seed: int = 0) -> dict[str, dict[str, float]]:
        """Room id -> mean lx of its floor by "outdoor" and "indoor" light, furniture in place; {} if scalar."""
        if self.variant.startswith("scalar"):
            return {}
        mitsuba(self.variant)
        self.move_to(None)
        from pbrs_farm.transport.illuminance import floor_points, illuminance_lx

        lux: dict[str, dict[str, float]] = {}
        for room in house.rooms:
            points = floor_points(room, _FLOOR_POINTS, seed)
            emitters = self._view_emitters.at_place(points.mean(0))
            outdoor, indoor = illuminance_lx(self.device_scene, emitters, points, seed)
            lux[room.id] = {"outdoor": round(outdoor, 2), "indoor": round(indoor, 2)}
        return lux

    def _check_lit(
        self, direct: LightResult, halves: dict[Group, tuple[Any, Any]], room_id: str, seed: int
    ) -> None:
        """Raise RenderFailed when the view is black, and say which emitters there are."""
        images = [
            direct.outdoor,
            direct.indoor,
            *(half for pair in halves.values() for half in pair),
        ]
        if any(image.any() for image in images):
            return
        n = self.n_lamps
        sky = "a sky" if self.sky.dome.any() or self.sky.sun_irradiance.any() else "no sky"
        text = f"{sky} and {n} lamp{'s' * (n != 1)} in the house, none reaches this view"
        raise RenderFailed(
            f"no light found in room {room_id}: {text}", view=room_id, mode="light", seed=seed
        )

    def emitters(
        self, camera: Camera, fields: LightFields, seed: int
    ) -> tuple[Emitters, EmitterWeights]:
        """The emitters with the sampling weights of a camera's view, until the next call; not for scalar variants."""
        return self._view_emitters.measure(camera, fields, seed)

    @cached_property
    def _view_emitters(self) -> ViewEmitters:
        """Built for the first view. Not for scalar variants."""
        from pbrs_farm.transport.view_emitters import ViewEmitters

        return ViewEmitters(self.device_scene, self.tables, self.sky, self._portals, self._outside)

    def _render_scalar(self, camera: Camera, fields: LightFields, seed: int) -> LightResult:
        """Both groups by Mitsuba's own plugins: scalar variants have no arrays for our kernels."""
        from pbrs_farm.transport.scalar_scene import ScalarScene

        if not camera.intrinsics.lens.is_pinhole or camera.blur is not None:
            text = (
                f"lenses, depth of field and motion blur need LLVM or CUDA, this is {self.variant}"
            )
            raise MachineFailed(text, hint="sudo apt-get install -y libllvm19")
        if fields.groups == "lamps":
            text = f"light by lamp needs LLVM or CUDA, this is {self.variant}"
            hint = "sudo apt-get install -y libllvm19, or --groups two"
            raise MachineFailed(text, hint=hint)
        # Render two half buffers of each group, with separate seeds, for the noise estimate.
        scene = ScalarScene(self.tables, self.sky, self.variant)
        half = fields.model_copy(update={"spp": max(fields.spp // 2, 1)})
        halves = {
            g: tuple(scene.render(camera, g, half, seed + 2 * k + j) for j in range(2))
            for k, g in enumerate(Group)
        }
        # Give the denoiser a white albedo and no normals: Mitsuba renders radiance alone here.
        black = np.zeros((camera.intrinsics.height_px, camera.intrinsics.width_px, 3), np.float32)
        guides = LightResult(black, black, np.ones_like(black), black, {}, 0, 0, {})
        facts = {"integrator": "mitsuba path", "seed": seed}
        return join_results(None, guides, halves, 0, facts, spp=2 * half.spp)
