"""Rays against one triangle mesh through Mitsuba: which face each ray hits first.

Effects: holds a Mitsuba scene; the first call compiles (or loads from Dr.Jit's cache) its kernel.
One mesh per scene, so that the kernel is the same for every house and the primitive's number is
the face's number.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final, Protocol

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.camera import Camera
from pbrs_farm.transport.variant import mitsuba

_RAYS_PER_LAUNCH: Final = 1 << 22
_COUNTS_PER_LAUNCH: Final = 1 << 24
_TILE: Final = 4


class RayTracer(Protocol):
    """What a variant offers over one mesh; distances are in lengths of each ray's direction."""

    def faces_of_camera(self, camera: Camera) -> NDArray[np.int32]:
        """(H, W) face seen through each pixel's centre, -1 = nothing."""
        ...

    def first_hit(
        self,
        origins: NDArray[np.float32],
        directions: NDArray[np.float32],
        max_distance: NDArray[np.float32],
    ) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
        """(N,) distance (inf = nothing) and (N,) face (-1 = nothing)."""
        ...

    def counts(
        self, cameras: Sequence[Camera], face_label: NDArray[np.uint32], n_labels: int
    ) -> NDArray[np.uint32]:
        """(n_cameras, n_labels) pixels of each label; label 0 also counts what hits nothing."""
        ...


def scene_from_mesh(mi: Any, positions: NDArray[np.float32], faces: NDArray[np.int32]) -> Any:
    """A Mitsuba scene of one mesh; Embree's watertight intersection is on."""
    mesh = mi.Mesh("house", len(positions), len(faces))
    parameters = mi.traverse(mesh)
    parameters["vertex_positions"] = np.ascontiguousarray(positions, np.float32).ravel()
    parameters["faces"] = np.ascontiguousarray(faces, np.uint32).ravel()
    parameters.update()
    return mi.load_dict({"type": "scene", "embree_use_robust_intersections": True, "house": mesh})


class JitTracer:
    """RayTracer of the llvm and cuda variants: many rays a launch, memory bounded by the batch."""

    def __init__(
        self, variant: str, positions: NDArray[np.float32], faces: NDArray[np.int32]
    ) -> None:
        self._variant = variant
        self._scene = scene_from_mesh(mitsuba(variant), positions, faces)

    def faces_of_camera(self, camera: Camera) -> NDArray[np.int32]:
        """(H, W) face seen through each pixel's centre, -1 = nothing."""
        origin, directions = camera.rays()
        flat = directions.reshape(-1, 3)
        origins = np.broadcast_to(origin, flat.shape)
        _t, face = self._trace(origins, flat, None, coherent=True)
        return face.reshape(directions.shape[:2])

    def first_hit(
        self,
        origins: NDArray[np.float32],
        directions: NDArray[np.float32],
        max_distance: NDArray[np.float32],
    ) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
        """(N,) distance (inf = nothing) and (N,) face (-1 = nothing)."""
        distance = np.full(len(origins), np.inf, np.float32)
        face = np.full(len(origins), -1, np.int32)
        for start in range(0, len(origins), _RAYS_PER_LAUNCH):
            part = slice(start, start + _RAYS_PER_LAUNCH)
            distance[part], face[part] = self._trace(
                origins[part], directions[part], max_distance[part], coherent=False
            )
        return distance, face

    def counts(
        self, cameras: Sequence[Camera], face_label: NDArray[np.uint32], n_labels: int
    ) -> NDArray[np.uint32]:
        """(n_cameras, n_labels) pixels of each label; label 0 also counts what hits nothing."""
        counts = np.zeros((len(cameras), n_labels), np.uint32)
        for size, members in _by_size(cameras).items():
            most = min(_RAYS_PER_LAUNCH // (size[0] * size[1]), _COUNTS_PER_LAUNCH // n_labels)
            for start in range(0, len(members), max(most, 1)):
                part = members[start : start + max(most, 1)]
                counts[part] = self._count([cameras[i] for i in part], face_label, n_labels)
        return counts

    def _trace(
        self,
        origins: NDArray[np.float32],
        directions: NDArray[np.float32],
        max_distance: NDArray[np.float32] | None,
        *,
        coherent: bool,
    ) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
        import drjit as dr

        mi = mitsuba(self._variant)
        ray = mi.Ray3f(
            mi.Point3f(np.ascontiguousarray(origins.T)),
            mi.Vector3f(np.ascontiguousarray(directions.T)),
        )
        if max_distance is not None:
            ray.maxt = mi.Float(max_distance)
        hit = self._scene.ray_intersect_preliminary(ray, coherent)
        valid = hit.is_valid()
        t = dr.select(valid, hit.t, dr.inf)
        face = dr.select(valid, mi.Int32(hit.prim_index), -1)
        dr.eval(t, face)
        return t.numpy(), face.numpy()

    def _count(
        self, cameras: Sequence[Camera], face_label: NDArray[np.uint32], n_labels: int
    ) -> NDArray[np.uint32]:
        import drjit as dr

        mi = mitsuba(self._variant)
        width, height = cameras[0].intrinsics.width_px, cameras[0].intrinsics.height_px
        n_tiles = -(-width // _TILE) * -(-height // _TILE)

        # Number the lanes camera by camera and tile by tile: neighbours in a packet stay together.
        lane = dr.arange(mi.UInt32, len(cameras) * n_tiles * _TILE * _TILE)
        pixel, tile = lane % (_TILE * _TILE), lane // (_TILE * _TILE)
        tiles, columns = dr.opaque(mi.UInt32, n_tiles), dr.opaque(mi.UInt32, -(-width // _TILE))
        which, tile = tile // tiles, tile % tiles
        x = (tile % columns) * _TILE + pixel % _TILE
        y = (tile // columns) * _TILE + pixel // _TILE
        inside = (x < dr.opaque(mi.UInt32, width)) & (y < dr.opaque(mi.UInt32, height))

        # Turn each pixel's centre into a ray whose direction has unit length along the axis.
        table = mi.Float(np.concatenate([_ray_row(c) for c in cameras]))
        row = [dr.gather(mi.Float, table, which * 12 + k) for k in range(12)]
        u, v = mi.Float(x) + 0.5, mi.Float(y) + 0.5
        ray = mi.Ray3f(
            mi.Point3f(*row[9:12]),
            mi.Vector3f(*(row[k] + u * row[3 + k] + v * row[6 + k] for k in range(3))),
        )

        hit = self._scene.ray_intersect_preliminary(ray, True, inside)
        valid = inside & hit.is_valid()
        label = dr.gather(mi.UInt32, mi.UInt32(face_label), hit.prim_index, valid)
        counts = dr.zeros(mi.UInt32, len(cameras) * n_labels)
        index = which * dr.opaque(mi.UInt32, n_labels) + dr.select(valid, label, 0)
        dr.scatter_add(counts, 1, index, inside)
        return np.asarray(counts.numpy().reshape(len(cameras), n_labels))


def _ray_row(camera: Camera) -> NDArray[np.float32]:
    """(12,) d0, du, dv, eye: the direction at pixel coordinates (u, v) is d0 + u du + v dv."""
    i, rotation = camera.intrinsics, camera.world_from_camera[:3, :3]
    d0 = rotation @ np.array([-i.cx / i.fx, i.cy / i.fy, -1.0])
    return np.concatenate([d0, rotation[:, 0] / i.fx, -rotation[:, 1] / i.fy, camera.eye]).astype(
        np.float32
    )


def _by_size(cameras: Sequence[Camera]) -> dict[tuple[int, int], list[int]]:
    sizes: dict[tuple[int, int], list[int]] = {}
    for index, camera in enumerate(cameras):
        i = camera.intrinsics
        sizes.setdefault((i.width_px, i.height_px), []).append(index)
    return sizes
