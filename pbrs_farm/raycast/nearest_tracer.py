"""Ray tracers of subsets of a mesh, and of static and moving faces apart; holds the tracers."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F32, I32, Bools
from pbrs_farm.core.camera import Camera
from pbrs_farm.core.house import Geometry
from pbrs_farm.raycast.tracer import RayTracer, counted_labels, pictures_by_rays, rays_of_pixels

Build = Callable[[F32, I32], RayTracer]  # positions (V, 3) and faces (F, 3) of a mesh -> its tracer


class PartTracer:
    """RayTracer of some faces of a geometry as a separate mesh; face indices are those of the geometry."""

    def __init__(self, geometry: Geometry, keep: Bools, build: Build) -> None:
        """keep: (F,) bool, at least one."""
        self._numbers = np.flatnonzero(keep).astype(np.int32)
        used, faces = np.unique(geometry.faces[self._numbers], return_inverse=True)
        positions = geometry.positions[used]
        positions = np.where(np.isfinite(positions), positions, np.float32(0))
        self._tracer = build(positions, faces.reshape(-1, 3).astype(np.int32))

    def faces_of_camera(self, camera: Camera) -> I32:
        return self._named(self._tracer.faces_of_camera(camera))

    def first_hit(self, origins: F32, directions: F32, max_distance: F32) -> tuple[F32, I32]:
        t, face = self._tracer.first_hit(origins, directions, max_distance)
        return t, self._named(face)

    def counts(
        self, cameras: Sequence[Camera], face_label: NDArray[np.uint32], n_labels: int
    ) -> NDArray[np.uint32]:
        return self._tracer.counts(cameras, face_label[self._numbers], n_labels)

    def pictures(self, cameras: Sequence[Camera]) -> tuple[F32, I32]:
        t, face = self._tracer.pictures(cameras)
        return t, self._named(face)

    def _named(self, face: I32) -> I32:
        return np.where(face >= 0, self._numbers[face], np.int32(-1))


class NearestTracer:
    """The RayTracer of two meshes, the larger first: the nearer of their first hits."""

    def __init__(self, first: RayTracer, second: RayTracer) -> None:
        self.first, self.second = first, second

    def faces_of_camera(self, camera: Camera) -> I32:
        face, second_face = (t.faces_of_camera(camera) for t in (self.first, self.second))
        nearest = np.where(face >= 0, face, second_face)
        both_hit = np.flatnonzero((face >= 0) & (second_face >= 0))
        if len(both_hit):
            origins, directions, _blind = rays_of_pixels(camera)
            reach = np.full(len(both_hit), np.inf, np.float32)
            _t, nearest.ravel()[both_hit] = self.first_hit(
                origins[both_hit], directions[both_hit], reach
            )
        return nearest

    def first_hit(self, origins: F32, directions: F32, max_distance: F32) -> tuple[F32, I32]:
        t, face = self.first.first_hit(origins, directions, max_distance)
        other_t, second_face = self.second.first_hit(origins, directions, max_distance)
        is_nearer = other_t < t
        return np.where(is_nearer, other_t, t), np.where(is_nearer, second_face, face)

    def counts(
        self, cameras: Sequence[Camera], face_label: NDArray[np.uint32], n_labels: int
    ) -> NDArray[np.uint32]:
        pictures = (self.faces_of_camera(camera) for camera in cameras)
        rows = [counted_labels(face, face_label, n_labels) for face in pictures]
        return np.array(rows, np.uint32).reshape(len(cameras), n_labels)

    def pictures(self, cameras: Sequence[Camera]) -> tuple[F32, I32]:
        return pictures_by_rays(self, cameras)
