"""A ray tracer whose rays go on behind the holes that alpha cuts into surfaces.

Effects: holds the tracers that it asks. Rays that meet no surface with holes cost nothing: they are
traced once, by the kernel of houses without holes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F32, F64, I32, I64, Bools
from pbrs_farm.core.camera import Camera
from pbrs_farm.core.cutouts import CutOuts, faces_with_holes, pierced_holes
from pbrs_farm.core.house import Geometry
from pbrs_farm.raycast.tracer import (
    RayTracer,
    counted_labels,
    have_pin_holes,
    pictures_by_rays,
    pin_hole_rays,
    rays_of_pixels,
)

_MOST_SHEETS: Final = (
    64  # maximum sheets with holes that a ray passes; after them only solid faces count
)
_STEP: Final = 4e-6  # behind a hole, of the largest coordinate plus 1 m: some 30 float32 steps
_RAYS_AT_ONCE: Final = 1 << 20  # bounds the memory of counting

Build = Callable[[Bools], RayTracer | None]  # faces to keep (F,) -> their tracer


class CutOutTracer:
    """RayTracer of a mesh with holes: behind one, solid faces from the ray's origin, others by sheet."""

    def __init__(self, geometry: Geometry, cut_outs: CutOuts, keep: Bools, build: Build) -> None:
        """keep: (F,) bool, faces that rays may hit; build: makes the tracer of some of them."""
        self._geometry, self._cut_outs = geometry, cut_outs
        self._keep, self._build = keep, build
        self._may_have_holes = faces_with_holes(geometry, cut_outs)
        self._all = build(keep)

    @cached_property
    def _solid(self) -> RayTracer | None:
        return self._build(self._keep & ~self._may_have_holes)

    @cached_property
    def _sheets(self) -> RayTracer | None:
        return self._build(self._keep & self._may_have_holes)

    def faces_of_camera(self, camera: Camera) -> I32:
        if self._all is None:
            return np.full((camera.intrinsics.height_px, camera.intrinsics.width_px), -1, np.int32)
        face = self._all.faces_of_camera(camera)
        pixels = self._unsure(face.ravel())
        if len(pixels):
            origins, directions, _blind = rays_of_pixels(camera)
            reach = np.full(len(pixels), np.inf, np.float32)
            hits = self._past_holes(
                origins[pixels], directions[pixels], reach, face.ravel()[pixels]
            )
            face = face.copy()
            face.ravel()[pixels] = hits[1]
        return face

    def first_hit(self, origins: F32, directions: F32, max_distance: F32) -> tuple[F32, I32]:
        t, face = _hits(self._all, origins, directions, max_distance)
        rays = self._unsure(face)
        if len(rays):
            t, face = t.copy(), face.copy()
            hits = self._past_holes(origins[rays], directions[rays], max_distance[rays], face[rays])
            # Keep the tracer's own distance for hits that are not holes.
            t[rays] = np.where(hits[1] == face[rays], t[rays], hits[0])
            face[rays] = hits[1]
        return t, face

    def counts(
        self, cameras: Sequence[Camera], face_label: NDArray[np.uint32], n_labels: int
    ) -> NDArray[np.uint32]:
        if self._all is None:
            return np.zeros((len(cameras), n_labels), np.uint32)
        # Count faces with holes apart; trace only pictures that show any again.
        labels = np.where(self._may_have_holes, np.uint32(n_labels), face_label)
        counts = self._all.counts(cameras, labels, n_labels + 1)
        shows_holes = np.flatnonzero(counts[:, n_labels])
        for part in _batches(cameras, shows_holes):
            _t, faces = self.pictures([cameras[k] for k in part])
            for k, face in zip(part, faces, strict=True):
                counts[k, :n_labels] = counted_labels(face, face_label, n_labels)
        return np.ascontiguousarray(counts[:, :n_labels])

    def pictures(self, cameras: Sequence[Camera]) -> tuple[F32, I32]:
        if self._all is None or not have_pin_holes(cameras):
            return pictures_by_rays(self, cameras)
        t, face = self._all.pictures(cameras)
        shape, t, face = face.shape, t.ravel(), face.ravel()
        pixels = self._unsure(face)
        if len(pixels):
            which, pixel = np.divmod(pixels, shape[1] * shape[2])
            rays = pin_hole_rays(cameras, which, pixel)
            reach = np.full(len(pixels), np.inf, np.float32)
            t[pixels], face[pixels] = self._past_holes(*rays, reach, face[pixels])
        return t.reshape(shape), face.reshape(shape)

    def _unsure(self, face: I32) -> I64:
        return np.flatnonzero((face >= 0) & self._may_have_holes[face])

    def _past_holes(self, origins: F32, directions: F32, reach: F32, face: I32) -> tuple[F32, I32]:
        """(N,) distance and face of the first hits that are not holes; face: the first hits."""
        o, d = origins.astype(np.float64), directions.astype(np.float64)
        t, hole = pierced_holes(self._geometry, self._cut_outs, face, o, d)
        found_t, number = t.astype(np.float32), face.copy()
        rays = np.flatnonzero(hole)
        if not len(rays):
            return found_t, number
        found_t[rays], number[rays] = _hits(
            self._solid, origins[rays], directions[rays], reach[rays]
        )

        # Go through the sheets before it, those rays alone whose last one had a hole.
        ray_t = t[rays]
        for _ in range(_MOST_SHEETS):
            begin = ray_t + self._step(o[rays] + ray_t[:, None] * d[rays], d[rays])
            remaining = np.minimum(found_t[rays], reach[rays]) - begin
            before = remaining > 0
            rays, begin, remaining = rays[before], begin[before], remaining[before]
            if not len(rays):
                break
            starts = (o[rays] + begin[:, None] * d[rays]).astype(np.float32)
            more, sheet = _hits(
                self._sheets, starts, directions[rays], remaining.astype(np.float32)
            )
            is_hit = sheet >= 0
            rays, sheet, begin = rays[is_hit], sheet[is_hit], begin[is_hit] + more[is_hit]
            exact, hole = pierced_holes(self._geometry, self._cut_outs, sheet, o[rays], d[rays])
            solid = ~hole
            found_t[rays[solid]], number[rays[solid]] = exact[solid], sheet[solid]
            rays, ray_t = rays[hole], begin[hole]
        return found_t, number

    def _step(self, points: F64, directions: F64) -> F64:
        """(N,) in lengths of the directions, by which a ray goes on behind a hole."""
        return np.asarray(_STEP * (1 + np.abs(points).max(1)) / np.linalg.norm(directions, axis=1))


def _hits(tracer: RayTracer | None, origins: F32, directions: F32, reach: F32) -> tuple[F32, I32]:
    if tracer is None or not len(origins):
        return np.full(len(origins), np.inf, np.float32), np.full(len(origins), -1, np.int32)
    return tracer.first_hit(origins, directions, reach)


def _batches(cameras: Sequence[Camera], chosen: I64) -> Iterator[list[int]]:
    """The chosen cameras in batches of one size that bound the rays of a launch."""
    batch: list[int] = []
    size = (0, 0)
    for k in chosen.tolist():
        i = cameras[k].intrinsics
        is_full = (len(batch) + 1) * i.width_px * i.height_px > _RAYS_AT_ONCE
        if batch and (is_full or size != (i.width_px, i.height_px)):
            yield batch
            batch = []
        batch.append(k)
        size = i.width_px, i.height_px
    if batch:
        yield batch
