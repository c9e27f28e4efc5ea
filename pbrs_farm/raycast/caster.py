"""The ray caster over a house's triangles: hit records, item buffers, item counts, first hits.

Effects: holds a Mitsuba scene. Mitsuba finds the face that a ray hits; the rest of a hit record is
computed in double precision from that face's float32 vertices, the same bits in every variant.
"""

from __future__ import annotations

import contextlib
import copy
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F32, I32, Bools, HitRecord, ItemBuffer
from pbrs_farm.core.camera import Camera
from pbrs_farm.core.cutouts import CutOut, CutOuts, cut_outs_by_material, faces_with_holes
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.house import Geometry, House, geometry_from_house
from pbrs_farm.core.mesh import faces_with_area, triangle_corners
from pbrs_farm.raycast.cutout_tracer import CutOutTracer
from pbrs_farm.raycast.hit_records import hit_record_from_faces
from pbrs_farm.raycast.nearest_tracer import NearestTracer, PartTracer
from pbrs_farm.raycast.scalar_tracer import ScalarTracer
from pbrs_farm.raycast.tracer import JitTracer, RayTracer
from pbrs_farm.raycast.variant import choose_variant

_FACES_PER_CHUNK: Final = 1 << 18  # bounds the memory of the area test
_MIN_AREA_M2: Final = 0.5e-12  # a smaller triangle is a line in float32


class Caster:
    """The ray caster of one Geometry, panes included; face numbers are Geometry's.

    variant: a Mitsuba variant; the best that works here when None. No ray hits a degenerate
    triangle or one with a vertex that is not finite; without faces no ray hits anything. Where
    alpha leaves a hole in a surface a ray goes on behind it.
    """

    def __init__(
        self, geometry: Geometry, *, cut_outs: CutOuts | None = None, variant: str | None = None
    ) -> None:
        """cut_outs: the holes that pictures cut into surfaces; `of_house` finds them."""
        self.geometry = geometry  # world frame, metres
        self.cut_outs: CutOuts = cut_outs or {}
        self.variant = choose_variant() if variant is None else variant
        # Ids run from 1: the largest is the number of items.
        self.n_items = int(geometry.face_item.max()) if len(geometry.face_item) else 0
        self._begin(_hittable(geometry))

    def _begin(self, hittable: Bools, still: _StillFaces | None = None) -> None:
        self._hittable, self._still = hittable, still
        self.tracer = self._tracer_of(hittable)
        self._without: tuple[bytes, RayTracer | None] = (b"", None)  # skipped faces, their tracer

    @classmethod
    def of_house(cls, house: House, geometry: Geometry | None = None) -> Caster:
        """The caster of a house, with the holes of its surfaces; geometry: of the house, if known."""
        return cls(geometry or geometry_from_house(house), cut_outs=cut_outs_of_house(house))

    @cached_property
    def _tracers_of_still(self) -> dict[bytes, RayTracer | None]:
        """Of the faces that casters of other times share, by which faces they are."""
        return {}

    def at(self, geometry: Geometry, moving: Bools) -> Caster:
        """A caster of the same faces at another time; static faces are traced as one shared mesh.

        geometry: like this caster's own, except that vertices of the moving faces (F,) are moved rigidly. Hits
        equal those of a caster of that geometry, except for ties.
        """
        caster = copy.copy(self)
        caster.geometry = geometry
        caster._begin(self._hittable, _StillFaces(~moving, self._tracers_of_still))
        return caster

    def hit_record(self, camera: Camera, *, skip_faces: Bools | None = None) -> HitRecord:
        """The first hit through each pixel's centre (rule 8), behind skip_faces (F,), if given."""
        tracer = self.tracer if skip_faces is None else self._tracer_without(skip_faces)
        return hit_record_from_faces(self.geometry, camera, _faces_of_surface(tracer, camera))

    def item_buffer(self, camera: Camera) -> ItemBuffer:
        """(H, W) uint32 instance id of the first hit at each pixel's centre, glass too; 0 = nothing."""
        face = _faces_of_surface(self.tracer, camera)
        if not len(self.geometry.face_item):
            return np.zeros(face.shape, np.uint32)
        # Read the item of each face; a ray that misses sees item 0.
        return np.where(face >= 0, self.geometry.face_item[face], np.uint32(0))

    def item_counts(self, cameras: Sequence[Camera]) -> NDArray[np.uint32]:
        """(n_cameras, n_items + 1) pixels of items, 0 = misses, in bounded memory; edges may differ."""
        if self.tracer is None or not cameras:
            counts = np.zeros((len(cameras), self.n_items + 1), np.uint32)
            for row, camera in enumerate(cameras):
                # Without a face every ray misses.
                counts[row, 0] = camera.intrinsics.width_px * camera.intrinsics.height_px
            return counts
        return self.tracer.counts(cameras, self.geometry.face_item, self.n_items + 1)

    def depth_pictures(self, cameras: Sequence[Camera]) -> F32:
        """(N, H, W) depth_z in metres of small cameras of one size, 0 = nothing; one launch of rays."""
        return self.item_pictures(cameras)[0]

    def item_pictures(self, cameras: Sequence[Camera]) -> tuple[F32, ItemBuffer]:
        """Depth as of depth_pictures, and (N, H, W) uint32 instance id of the same hit; 0 = nothing."""
        if not cameras:
            return np.zeros((0, 0, 0), np.float32), np.zeros((0, 0, 0), np.uint32)
        if self.tracer is None:
            i = cameras[0].intrinsics
            shape = len(cameras), i.height_px, i.width_px
            return np.zeros(shape, np.float32), np.zeros(shape, np.uint32)
        # Directions are as long as makes the distance along a ray the depth.
        t, face = self.tracer.pictures(cameras)
        is_hit = face >= 0
        depth = np.where(is_hit, t, np.float32(0))
        return depth, np.where(is_hit, self.geometry.face_item[face], np.uint32(0))

    def first_hit(
        self,
        origins: NDArray[np.floating],
        directions: NDArray[np.floating],
        max_distance: float | NDArray[np.floating] = np.inf,
    ) -> tuple[F32, I32]:
        """(N,) float32 distance, inf = nothing, and (N,) int32 face, -1 = nothing.

        origins, directions: (N, 3); distances are in lengths of each direction: metres when it
        is a unit vector. A ray that starts on a surface may hit it at 0: start a little off it.
        """
        n = len(origins)
        if self.tracer is None or n == 0:
            return np.full(n, np.inf, np.float32), np.full(n, -1, np.int32)
        # Trace in float32, as Mitsuba's single-precision variants do.
        rays = np.asarray(origins, np.float32), np.asarray(directions, np.float32)
        reach = np.broadcast_to(np.asarray(max_distance, np.float32), (n,))
        return self.tracer.first_hit(*rays, reach)

    def _tracer_without(self, skip_faces: Bools) -> RayTracer | None:
        if skip_faces.shape != (len(self.geometry.faces),):
            raise ValueError(
                f"skip_faces: expected ({len(self.geometry.faces)},), got {skip_faces.shape}"
            )
        # Keep the last tracer: the views of a house skip the same faces.
        key = np.packbits(skip_faces).tobytes()
        if self._without[0] != key:
            keep = self._hittable & ~skip_faces
            self._without = (key, self._tracer_of(keep))
        return self._without[1]

    def _tracer_of(self, keep: Bools) -> RayTracer | None:
        """The tracer of the faces to keep (F,), None if there are none."""
        build = partial(_tracer, self.variant, self.geometry)
        if self._still is not None:
            build = partial(_tracer_of_both, self.variant, self.geometry, self._still)
        if (keep & faces_with_holes(self.geometry, self.cut_outs)).any():
            return CutOutTracer(self.geometry, self.cut_outs, keep, build)
        return build(keep)


def cut_outs_of_house(house: House) -> dict[int, CutOut]:
    """The holes of a house's materials; decodes, if it can, those pictures that may cut any."""
    from pbrs_farm.images import decode_texture

    cutting = {m.texture_id or "" for m in house.materials if m.alpha_cutout}
    pictures = {}
    for key in sorted(cutting & house.textures.keys()):
        texture = house.textures[key]
        with contextlib.suppress(BadInput):
            pictures[key] = decode_texture(texture.data, texture.name, texture.media_type)
    return cut_outs_by_material(house, pictures)


@dataclass(frozen=True, slots=True, eq=False)
class _StillFaces:
    """Static faces of a geometry, with a cache of their tracers."""

    faces: Bools  # (F,)
    tracers: dict[bytes, RayTracer | None]  # by the faces kept of them


def _tracer_of_both(
    variant: str, geometry: Geometry, still: _StillFaces, keep: Bools
) -> RayTracer | None:
    """The tracer of faces to keep; static ones may share a cached tracer."""
    standing, moving = keep & still.faces, keep & ~still.faces
    key = np.packbits(standing).tobytes()
    if key not in still.tracers:
        still.tracers[key] = _tracer(variant, geometry, standing)
    parts: list[RayTracer | None] = [still.tracers[key]]
    if moving.any():
        build = ScalarTracer if variant.startswith("scalar") else JitTracer
        parts.append(PartTracer(geometry, moving, partial(build, variant)))
    tracers = [tracer for tracer in parts if tracer is not None]
    return NearestTracer(*tracers) if len(tracers) == 2 else next(iter(tracers), None)


def _tracer(variant: str, geometry: Geometry, keep: Bools) -> RayTracer | None:
    if not keep.any():
        return None
    # Collapse a face that must not be hit to a point, so that all others keep their number.
    faces = np.where(keep[:, None], geometry.faces, geometry.faces[np.argmax(keep), :1])
    # Move non-finite positions to the origin: Embree rejects such bounds.
    positions = np.where(np.isfinite(geometry.positions), geometry.positions, np.float32(0))
    build = ScalarTracer if variant.startswith("scalar") else JitTracer
    return build(variant, positions, faces)


def _hittable(geometry: Geometry) -> Bools:
    """(F,) bool: finite vertices and an area."""
    keep = np.zeros(len(geometry.faces), np.bool_)
    for start in range(0, len(keep), _FACES_PER_CHUNK):
        part = slice(start, start + _FACES_PER_CHUNK)
        corners = triangle_corners(geometry.positions, geometry.faces[part])
        keep[part] = faces_with_area(corners, _MIN_AREA_M2)
    return keep


def _faces_of_surface(tracer: RayTracer | None, camera: Camera) -> I32:
    if tracer is None:
        return np.full((camera.intrinsics.height_px, camera.intrinsics.width_px), -1, np.int32)
    return tracer.faces_of_camera(camera)
