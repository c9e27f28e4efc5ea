"""Ray tracers over one triangle mesh, by Mitsuba: the face that each ray hits first.

Effects: holds a Mitsuba scene; the first call compiles (or loads from Dr.Jit's cache) its kernel.
A scene has one mesh, so that one kernel serves every house and a primitive's number is its face's.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any, Final, Protocol

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F32, I32, Mask
from pbrs_farm.core.camera import Camera
from pbrs_farm.raycast.host_memory import with_slack
from pbrs_farm.raycast.mitsuba_mesh import mitsuba_mesh
from pbrs_farm.raycast.variant import mitsuba

MESH_NAME: Final = "house"  # of the one mesh of each scene
RAYS_PER_LAUNCH: Final = 1 << 22  # both bound the memory of one kernel launch
_COUNTS_PER_LAUNCH: Final = 1 << 24  # cameras x labels
_TILE: Final = 4  # px, edge of the tiles in which a packet of rays walks the picture
_D0, _DU, _DV, _EYE, _RAY_FLOATS = 0, 3, 6, 9, 12  # columns of _ray_table


class RayTracer(Protocol):
    """Rays against one mesh in a Mitsuba variant; distances are in lengths of the direction."""

    def faces_of_camera(self, camera: Camera) -> I32:
        """(H, W) face hit through each pixel's centre, -1 = nothing, also without a ray."""
        ...

    def first_hit(self, origins: F32, directions: F32, max_distance: F32) -> tuple[F32, I32]:
        """(N,) distance in lengths of the direction (inf = nothing), (N,) face (-1), of rays (N, 3)."""
        ...

    def counts(
        self, cameras: Sequence[Camera], face_label: NDArray[np.uint32], n_labels: int
    ) -> NDArray[np.uint32]:
        """(n_cameras, n_labels) pixels of labels (F,), 0 = misses too, for thousands of cameras."""
        ...

    def pictures(self, cameras: Sequence[Camera]) -> tuple[F32, I32]:
        """(N, H, W) distance and face, as of first_hit, of small cameras of one size, for ranking."""
        ...


def rays_of_pixels(camera: Camera) -> tuple[F32, F32, Mask | None]:
    """(N, 3) origins and directions of all pixels; (H, W) those without a ray, which get the axis."""
    origin, directions = camera.rays()
    blind = camera.blind
    if blind is not None:
        directions = np.where(blind[..., None], camera.towards.astype(np.float32), directions)
    flat = directions.reshape(-1, 3)
    return np.broadcast_to(origin, flat.shape), flat, blind


def pictures_by_rays(tracer: RayTracer, cameras: Sequence[Camera]) -> tuple[F32, I32]:
    """RayTracer.pictures by first_hit, through any lens; blind pixels see nothing."""
    rays = [rays_of_pixels(camera) for camera in cameras]
    origins, directions = (np.concatenate([r[i] for r in rays]) for i in (0, 1))
    i = cameras[0].intrinsics
    shape = len(cameras), i.height_px, i.width_px
    t, face = tracer.first_hit(origins, directions, np.full(len(origins), np.inf, np.float32))
    t, face = t.reshape(shape), face.reshape(shape)
    for k, (_origins, _directions, blind) in enumerate(rays):
        if blind is not None:
            t[k, blind], face[k, blind] = np.inf, -1
    return t, face


def pin_hole_rays(
    cameras: Sequence[Camera], which: NDArray[np.intp], pixels: NDArray[np.intp]
) -> tuple[F32, F32]:
    """(N, 3) origins and directions of some pixels, by number in the picture, of the cameras which (N,)."""
    table = _ray_table(cameras).reshape(-1, 4, 3)[which]
    v, u = np.divmod(pixels, cameras[0].intrinsics.width_px)
    d = table[:, 0] + (u[:, None] + 0.5) * table[:, 1] + (v[:, None] + 0.5) * table[:, 2]
    return table[:, 3], d.astype(np.float32)


def have_pin_holes(cameras: Sequence[Camera]) -> bool:
    """True if no camera has another lens."""
    return all(camera.intrinsics.lens.is_pinhole for camera in cameras)


def faces_as_picture(face: I32, camera: Camera, blind: Mask | None) -> I32:
    """(H, W) of the faces (N,) hit by rays_of_pixels, -1 for blind pixels (None: there are none)."""
    picture = face.reshape(camera.intrinsics.height_px, camera.intrinsics.width_px)
    return picture if blind is None else np.where(blind, np.int32(-1), picture)


def counted_labels(face: I32, face_label: NDArray[np.uint32], n_labels: int) -> NDArray[np.int64]:
    """(n_labels,) pixels of each label; label 0 takes the rays that miss. face: any shape, -1 = miss."""
    label = np.where(face >= 0, face_label[face], np.uint32(0))
    return np.bincount(label.ravel(), minlength=n_labels)


def scene_from_mesh(mi: Any, positions: F32, faces: I32, *, watertight: bool = True) -> Any:
    """A Mitsuba scene of one mesh. watertight: no ray slips through an edge two faces share.

    positions: (V, 3) float32; faces: (F, 3) int32, at least one. mi: the module of the variant.
    watertight costs some speed and matters to Embree alone: leave it on for labels.
    """
    mesh = mitsuba_mesh(mi, MESH_NAME, positions, faces)
    return mi.load_dict(
        {"type": "scene", "embree_use_robust_intersections": watertight, MESH_NAME: mesh}
    )


class JitTracer:
    """The RayTracer of the llvm and cuda variants: many rays a launch, in bounded memory.

    Labels and first hits use Embree's watertight test. Counts, which only rank cameras, use its
    faster one: 9 of a million pixels differed, a quarter more rays a second.
    """

    def __init__(self, variant: str, positions: F32, faces: I32) -> None:
        self._variant = variant
        self._mesh = (positions, faces)

    @cached_property
    def _watertight(self) -> Any:
        return scene_from_mesh(mitsuba(self._variant), *self._mesh)

    @cached_property
    def _fast(self) -> Any:
        return scene_from_mesh(mitsuba(self._variant), *self._mesh, watertight=False)

    def faces_of_camera(self, camera: Camera) -> I32:
        origins, flat, blind = rays_of_pixels(camera)
        _t, face = self._trace(origins, flat, None, coherent=True)
        return faces_as_picture(face, camera, blind)

    def first_hit(self, origins: F32, directions: F32, max_distance: F32) -> tuple[F32, I32]:
        distance = np.full(len(origins), np.inf, np.float32)
        face = np.full(len(origins), -1, np.int32)
        for start in range(0, len(origins), RAYS_PER_LAUNCH):
            part = slice(start, start + RAYS_PER_LAUNCH)
            distance[part], face[part] = self._trace(
                origins[part], directions[part], max_distance[part], coherent=False
            )
        return distance, face

    def counts(
        self, cameras: Sequence[Camera], face_label: NDArray[np.uint32], n_labels: int
    ) -> NDArray[np.uint32]:
        # Launch as many cameras of one size together as memory allows.
        counts = np.zeros((len(cameras), n_labels), np.uint32)
        for (width, height, is_pinhole), members in _by_size(cameras).items():
            if not is_pinhole:
                for k in members:
                    face = self.faces_of_camera(cameras[k])
                    counts[k] = counted_labels(face, face_label, n_labels)
                continue
            n_pixels = width * height
            most = max(1, min(RAYS_PER_LAUNCH // n_pixels, _COUNTS_PER_LAUNCH // n_labels))
            for start in range(0, len(members), most):
                part = members[start : start + most]
                counts[part] = self._count([cameras[i] for i in part], face_label, n_labels)
        return counts

    def pictures(self, cameras: Sequence[Camera]) -> tuple[F32, I32]:
        if not have_pin_holes(cameras):
            return pictures_by_rays(self, cameras)
        i = cameras[0].intrinsics
        most = max(1, RAYS_PER_LAUNCH // (i.width_px * i.height_px))
        parts = [self._pictures(cameras[k : k + most]) for k in range(0, len(cameras), most)]
        return np.concatenate([t for t, _face in parts]), np.concatenate([f for _t, f in parts])

    def _pictures(self, cameras: Sequence[Camera]) -> tuple[F32, I32]:
        import drjit as dr

        mi = mitsuba(self._variant)
        _which, inside, ray = _rays_by_tile(mi, cameras)
        hit = self._fast.ray_intersect_preliminary(ray, True, inside)
        valid = inside & hit.is_valid()
        t = dr.select(valid, hit.t, dr.inf)
        face = dr.select(valid, mi.Int32(hit.prim_index), -1)
        dr.eval(t, face)
        # Put the tiles in their places, and cut off what they reach beyond the picture.
        i = cameras[0].intrinsics
        rows, columns = -(-i.height_px // _TILE), -(-i.width_px // _TILE)
        whole = len(cameras), rows * _TILE, columns * _TILE
        tiled = (a.numpy().reshape(-1, rows, columns, _TILE, _TILE) for a in (t, face))
        t, face = (a.swapaxes(2, 3).reshape(whole)[:, : i.height_px, : i.width_px] for a in tiled)
        return t, face

    def _trace(
        self, origins: F32, directions: F32, max_distance: F32 | None, *, coherent: bool
    ) -> tuple[F32, I32]:
        import drjit as dr

        # Hand rays over component by component, as Dr.Jit stores vectors.
        mi = mitsuba(self._variant)
        ray = mi.Ray3f(
            mi.Point3f(*map(with_slack, origins.T)), mi.Vector3f(*map(with_slack, directions.T))
        )
        if max_distance is not None:
            ray.maxt = mi.Float(with_slack(max_distance))
        hit = self._watertight.ray_intersect_preliminary(ray, coherent)
        # Read distance and face back together: one kernel.
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
        which, inside, ray = _rays_by_tile(mi, cameras)
        # Add one to the label of the face each ray hits, label 0 where it hits nothing.
        hit = self._fast.ray_intersect_preliminary(ray, True, inside)
        valid = inside & hit.is_valid()
        label = dr.gather(mi.UInt32, mi.UInt32(face_label), hit.prim_index, valid)
        counts = dr.zeros(mi.UInt32, len(cameras) * n_labels)
        index = which * dr.opaque(mi.UInt32, n_labels) + dr.select(valid, label, 0)
        dr.scatter_add(counts, 1, index, inside)
        return np.asarray(counts.numpy().reshape(len(cameras), n_labels))


def _rays_by_tile(mi: Any, cameras: Sequence[Camera]) -> tuple[Any, Any, Any]:
    """On the device: the camera of each lane, whether its pixel is in the picture, and its ray."""
    import drjit as dr

    width, height = cameras[0].intrinsics.width_px, cameras[0].intrinsics.height_px
    n_tiles = -(-width // _TILE) * -(-height // _TILE)
    # Number the lanes camera by camera, tile by tile: the rays of a packet stay neighbours.
    lane = dr.arange(mi.UInt32, len(cameras) * n_tiles * _TILE * _TILE)
    pixel, tile = lane % (_TILE * _TILE), lane // (_TILE * _TILE)
    # Pass sizes as opaque values: they are no part of the kernel, which stays the same.
    tiles, columns = dr.opaque(mi.UInt32, n_tiles), dr.opaque(mi.UInt32, -(-width // _TILE))
    which, tile = tile // tiles, tile % tiles
    x = (tile % columns) * _TILE + pixel % _TILE
    y = (tile // columns) * _TILE + pixel // _TILE
    inside = (x < dr.opaque(mi.UInt32, width)) & (y < dr.opaque(mi.UInt32, height))
    # Turn each pixel's centre into a ray whose direction has unit length along the axis.
    table = mi.Float(_ray_table(cameras).ravel())
    row = [dr.gather(mi.Float, table, which * _RAY_FLOATS + k) for k in range(_RAY_FLOATS)]
    u, v = mi.Float(x) + 0.5, mi.Float(y) + 0.5
    towards = (row[_D0 + k] + u * row[_DU + k] + v * row[_DV + k] for k in range(3))
    return which, inside, mi.Ray3f(mi.Point3f(*row[_EYE:]), mi.Vector3f(*towards))


def _ray_table(cameras: Sequence[Camera]) -> F32:
    """(n, 12) of cameras of one size: d0, du, dv, eye; the direction at (u, v) is d0 + u du + v dv."""
    # Derive the three vectors from the intrinsics, then turn them into the world.
    poses = np.stack([camera.world_from_camera for camera in cameras])
    lenses = [camera.intrinsics for camera in cameras]
    fx, fy, cx, cy = np.array([(i.fx, i.fy, i.cx, i.cy) for i in lenses], np.float64).T
    axes = np.zeros((len(cameras), 3, 3))
    axes[:, 0] = np.stack([-cx / fx, cy / fy, np.full(len(cameras), -1.0)], 1)
    axes[:, 1, 0], axes[:, 2, 1] = 1 / fx, -1 / fy
    table = np.empty((len(cameras), 4, 3), np.float32)
    table[:, :3] = np.einsum("nij,nkj->nki", poses[:, :3, :3], axes)
    table[:, 3] = poses[:, :3, 3]
    return table.reshape(-1, _RAY_FLOATS)


def _by_size(cameras: Sequence[Camera]) -> dict[tuple[int, int, bool], list[int]]:
    """Numbers of the cameras by width, height and whether they have a pin-hole."""
    groups: dict[tuple[int, int, bool], list[int]] = {}
    for index, camera in enumerate(cameras):
        i = camera.intrinsics
        key = i.width_px, i.height_px, i.lens.is_pinhole
        groups.setdefault(key, []).append(index)
    return groups
