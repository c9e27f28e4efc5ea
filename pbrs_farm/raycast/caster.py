"""The ray caster over a house's triangles: hit records, item buffers, item counts, first hits.

Effects: holds a Mitsuba scene. Mitsuba finds the face that a ray hits; the rest of a hit record is
computed in double precision from that face's float32 vertices, the same bits in every variant.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F32, F64, I32, Bools, HitRecord, ItemBuffer, SurfacePoints
from pbrs_farm.core.camera import Camera
from pbrs_farm.core.house import Geometry
from pbrs_farm.core.mesh import area_vectors, faces_with_area, triangle_corners
from pbrs_farm.raycast.tracer import JitTracer, RayTracer, ScalarTracer
from pbrs_farm.raycast.variant import choose_variant

# Hit records: from the face each pixel's ray hits to depth, normals and uv; numpy.


def hit_record_from_faces(geometry: Geometry, camera: Camera, face: I32) -> HitRecord:
    """The record of the camera's unjittered rays. face: (H, W) int32, -1 = nothing.

    depth_z is as camera.depths_of has it: along the axis, or the distance of a lens without planar
    depth. The hit is where the ray meets the face's plane, computed in float64 and clamped to the
    triangle (at grazing angles the plane's hit may lie beside it). Geometric normals are the
    faces' own, turned towards the camera; shading normals lie on their side. Faces have an area.
    """
    # Set up each distinct face's plane once; most pixels share a face.
    origin, directions = camera.exact_rays()
    pixels = np.flatnonzero(face.ravel() >= 0)
    d = directions.reshape(-1, 3).take(pixels, axis=0)
    f, local = _distinct(face.ravel()[pixels], len(geometry.faces))
    planes = _planes(geometry, f, origin)

    # Intersect every ray with its plane and turn the normal towards the camera.
    is_planar = camera.intrinsics.lens.depth_is_planar
    axis = -camera.world_from_camera[:3, 2] if is_planar else None
    normal = planes.normal.take(local, axis=0)
    along = _dot(normal, d)
    t, weights = _intersect(planes, local, d, along, axis)
    normal[along > 0] *= -1

    # Interpolate only for layers that ask for it.
    def interpolated() -> SurfacePoints:
        corner = geometry.faces[f][local]
        shading = _shading_normal(geometry, corner, weights, normal)
        return SurfacePoints(
            _image(planes.origin + t[:, None] * d, pixels, shape, np.float32),
            _image(shading, pixels, shape, np.float32),
            _image(_mixed(weights, geometry.uvs, corner), pixels, shape, np.float32),
        )

    # Write the pixels that hit something into images of zeros.
    shape = face.shape
    return HitRecord(
        face=np.ascontiguousarray(face, np.int32),
        item=_image(geometry.face_item[f][local], pixels, shape, np.uint32),
        depth_z=_image(t, pixels, shape, np.float32),
        geo_normal_world=_image(normal, pixels, shape, np.float32),
        interpolate=interpolated,
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Planes:
    """The planes of K triangles, as rays from one origin need them; float64."""

    origin: F64  # (3,) of all rays
    a: F64  # (K, 3) corners
    b: F64
    c: F64
    normal: F64  # (K, 3) unit
    grad_b: F64  # (K, 3) gradient of the barycentric coordinate of b
    grad_c: F64  # (K, 3) and of c


def _planes(geometry: Geometry, faces: NDArray[np.intp], origin: F64) -> _Planes:
    corners = triangle_corners(geometry.positions, geometry.faces[faces])
    a, b, c = np.moveaxis(corners, 1, 0)
    # Divide by |n|^2: the gradient of b is 1 at b and 0 along the edge a c.
    n = area_vectors(corners)
    squared = _dot(n, n)[:, None]
    grad_b, grad_c = np.cross(c - a, n) / squared, np.cross(n, b - a) / squared
    return _Planes(origin, a, b, c, n / np.sqrt(squared), grad_b, grad_c)


def _intersect(
    planes: _Planes, local: NDArray[np.intp], d: F64, along: F64, axis: F64 | None
) -> tuple[F64, F64]:
    """(N,) t along d (N, 3) to plane local[n], and (N, 3) weights of a, b, c, all >= 0.

    along: (N,) d along the planes' normals. axis: that d has unit length along; None: d has unit length.
    """
    # Solve the plane's equation for t and evaluate the barycentric coordinates there.
    from_a = planes.origin - planes.a
    with np.errstate(divide="ignore", invalid="ignore"):
        t = -_dot(from_a, planes.normal)[local] / along
        w_b = _dot(from_a, planes.grad_b)[local] + t * _dot(planes.grad_b.take(local, axis=0), d)
        w_c = _dot(from_a, planes.grad_c)[local] + t * _dot(planes.grad_c.take(local, axis=0), d)
    weights = np.stack([1 - w_b - w_c, w_b, w_c]).T

    # Clamp to the triangle what falls beside it; a ray within the plane takes its middle.
    beside = np.flatnonzero(~((weights.T >= 0).all(0) & np.isfinite(t)))
    held = np.nan_to_num(weights[beside], nan=1.0, posinf=1.0, neginf=0.0).clip(0.0, 1.0)
    held /= held.sum(1, keepdims=True)
    weights[beside] = held
    k = local[beside]
    point = held[:, :1] * planes.a[k] + held[:, 1:2] * planes.b[k] + held[:, 2:] * planes.c[k]
    way = point - planes.origin
    t[beside] = np.linalg.norm(way, axis=1) if axis is None else way @ axis
    return t, weights


def _shading_normal(geometry: Geometry, corner: I32, weights: F64, geo_normal: F64) -> F64:
    """(N, 3) interpolated vertex normals on the geometric normal's side; that normal where flat."""
    # Interpolate and normalise; opposite vertex normals may cancel out.
    shading = _mixed(weights, geometry.normals, corner)
    length = np.sqrt(_dot(shading, shading))
    smooth = length > 1e-6
    shading /= np.where(smooth, length, 1.0)[:, None]
    # Fall back to the geometric normal, then turn all to its side.
    shading[~smooth] = geo_normal[~smooth]
    shading[_dot(shading, geo_normal) < 0] *= -1
    return shading


def _mixed(weights: F64, values: F32, corner: I32) -> F64:
    """(N, C) values (V, C) at the corners (N, 3), weighted."""
    mixed = weights[:, :1] * values[corner[:, 0]]
    for k in (1, 2):
        mixed += weights[:, k : k + 1] * values[corner[:, k]]
    return np.asarray(mixed)


def _distinct(face: I32, n_faces: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """The distinct faces, ascending, and each pixel's index into them."""
    is_hit = np.zeros(n_faces, np.bool_)
    is_hit[face] = True
    index = np.cumsum(is_hit) - 1
    return np.flatnonzero(is_hit), index[face]


def _dot(x: F64, y: F64) -> F64:
    return np.asarray(np.einsum("ij,ij->i", x, y))


def _image(
    values: NDArray[Any], pixels: NDArray[np.intp], shape: tuple[int, ...], dtype: type[np.generic]
) -> NDArray[Any]:
    """Image of shape + values' own axes, values at the pixels and 0 elsewhere."""
    image = np.zeros((int(np.prod(shape)), *values.shape[1:]), dtype)
    image[pixels] = values
    return image.reshape(*shape, *values.shape[1:])


# The ray caster over a house's triangles.


_FACES_PER_CHUNK: Final = 1 << 18  # bounds the memory of the area test
_MIN_AREA_M2: Final = 0.5e-12  # below it float32 cannot tell a triangle from a line


class Caster:
    """The ray caster of one Geometry, panes included; face numbers are Geometry's.

    variant: a Mitsuba variant; the best that works here when None. No ray hits a degenerate
    triangle or one with a vertex that is not finite; without faces no ray hits anything.
    """

    def __init__(self, geometry: Geometry, *, variant: str | None = None) -> None:
        self.geometry = geometry  # world frame, metres
        self.variant = choose_variant() if variant is None else variant
        # Ids run from 1: the largest is the number of items.
        self.n_items = int(geometry.face_item.max()) if len(geometry.face_item) else 0
        self._tracer = _tracer(self.variant, geometry, _hittable(geometry))
        self._without: tuple[bytes, RayTracer | None] = (b"", None)  # skipped faces, their tracer

    def hit_record(self, camera: Camera, *, skip_faces: Bools | None = None) -> HitRecord:
        """The first hit of the ray through each pixel's centre (rule 8).

        skip_faces: (F,) bool, faces to ignore; with the transparent ones ignored this is the hit
        behind glass. Raises ValueError if it is not one entry per face.
        """
        tracer = self._tracer if skip_faces is None else self._tracer_without(skip_faces)
        return hit_record_from_faces(self.geometry, camera, _faces(tracer, camera))

    def item_buffer(self, camera: Camera) -> ItemBuffer:
        """(H, W) uint32 instance id at each pixel's centre, 0 = nothing."""
        face = _faces(self._tracer, camera)
        if not len(self.geometry.face_item):
            return np.zeros(face.shape, np.uint32)
        # Read the item of each face; a ray that misses sees item 0.
        return np.where(face >= 0, self.geometry.face_item[face], np.uint32(0))

    def item_counts(self, cameras: Sequence[Camera]) -> NDArray[np.uint32]:
        """(n_cameras, n_items + 1) pixels each item covers; column 0 counts rays that miss.

        n_items is the largest instance id of the geometry. Cameras may differ in size. The
        result aside, memory does not grow with the number of cameras. At edges single pixels may
        differ from item_buffer (see JitTracer).
        """
        if self._tracer is None or not cameras:
            counts = np.zeros((len(cameras), self.n_items + 1), np.uint32)
            for row, camera in enumerate(cameras):
                # Without a face every ray misses.
                counts[row, 0] = camera.intrinsics.width_px * camera.intrinsics.height_px
            return counts
        return self._tracer.counts(cameras, self.geometry.face_item, self.n_items + 1)

    def depth_pictures(self, cameras: Sequence[Camera]) -> F32:
        """(N, H, W) depth_z in metres at the pixels' centres, 0 = nothing.

        cameras: N of one size. For small pictures: all rays are made at once.
        """
        if not cameras:
            return np.zeros((0, 0, 0), np.float32)
        rays = [camera.rays() for camera in cameras]
        directions = np.stack([d for _origin, d in rays])
        origins = np.broadcast_to(np.stack([o for o, _d in rays])[:, None, None], directions.shape)
        # Directions are as long as makes the distance along a ray the depth.
        t, _face = self.first_hit(origins.reshape(-1, 3), directions.reshape(-1, 3))
        depth = np.where(np.isfinite(t), t, np.float32(0)).reshape(directions.shape[:3])
        return np.where(directions.any(-1), depth, np.float32(0))

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
        if self._tracer is None or n == 0:
            return np.full(n, np.inf, np.float32), np.full(n, -1, np.int32)
        # Trace in float32, as Mitsuba's single-precision variants do.
        rays = np.asarray(origins, np.float32), np.asarray(directions, np.float32)
        reach = np.broadcast_to(np.asarray(max_distance, np.float32), (n,))
        return self._tracer.first_hit(*rays, reach)

    def _tracer_without(self, skip_faces: Bools) -> RayTracer | None:
        if skip_faces.shape != (len(self.geometry.faces),):
            raise ValueError(
                f"skip_faces: expected ({len(self.geometry.faces)},), got {skip_faces.shape}"
            )
        # Keep the last tracer: the views of a house skip the same faces.
        key = np.packbits(skip_faces).tobytes()
        if self._without[0] != key:
            keep = _hittable(self.geometry) & ~skip_faces
            self._without = (key, _tracer(self.variant, self.geometry, keep))
        return self._without[1]


def _tracer(variant: str, geometry: Geometry, keep: Bools) -> RayTracer | None:
    if not keep.any():
        return None
    # Collapse a face that must not be hit to a point, so that all others keep their number.
    faces = np.where(keep[:, None], geometry.faces, geometry.faces[np.argmax(keep), :1])
    # Put what is not finite at the origin: Embree refuses such bounds.
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


def _faces(tracer: RayTracer | None, camera: Camera) -> I32:
    if tracer is None:
        return np.full((camera.intrinsics.height_px, camera.intrinsics.width_px), -1, np.int32)
    return tracer.faces_of_camera(camera)
