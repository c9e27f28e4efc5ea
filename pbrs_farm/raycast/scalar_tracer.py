"""The ray tracer of the scalar variant, for machines without LLVM: a million rays a second; holds a scene."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F32, I32
from pbrs_farm.core.camera import Camera
from pbrs_farm.raycast.tracer import (
    counted_labels,
    faces_as_picture,
    pictures_by_rays,
    rays_of_pixels,
    scene_from_mesh,
)
from pbrs_farm.raycast.variant import mitsuba


class ScalarTracer:
    """RayTracer of scalar_rgb, 20 times slower; the same answers as JitTracer but for ties."""

    def __init__(self, variant: str, positions: F32, faces: I32) -> None:
        self._variant = variant
        self._scene = scene_from_mesh(mitsuba(variant), positions, faces)

    def faces_of_camera(self, camera: Camera) -> I32:
        origins, flat, blind = rays_of_pixels(camera)
        reach = np.broadcast_to(np.float32(np.inf), len(flat))
        _t, face = self.first_hit(origins, flat, reach)
        return faces_as_picture(face, camera, blind)

    def first_hit(self, origins: F32, directions: F32, max_distance: F32) -> tuple[F32, I32]:
        mi = mitsuba(self._variant)
        intersect = self._scene.ray_intersect_preliminary
        distance = np.full(len(origins), np.inf, np.float32)
        face = np.full(len(origins), -1, np.int32)
        # Intersect ray by ray and compare the distance with the ray's reach afterwards.
        for index, (o, d) in enumerate(zip(origins.tolist(), directions.tolist(), strict=True)):
            hit = intersect(mi.Ray3f(mi.Point3f(o), mi.Vector3f(d)))
            if hit.is_valid() and hit.t <= max_distance[index]:
                distance[index], face[index] = hit.t, hit.prim_index
        return distance, face

    def counts(
        self, cameras: Sequence[Camera], face_label: NDArray[np.uint32], n_labels: int
    ) -> NDArray[np.uint32]:
        counts = np.zeros((len(cameras), n_labels), np.uint32)
        for row, camera in enumerate(cameras):
            counts[row] = counted_labels(self.faces_of_camera(camera), face_label, n_labels)
        return counts

    def pictures(self, cameras: Sequence[Camera]) -> tuple[F32, I32]:
        return pictures_by_rays(self, cameras)
