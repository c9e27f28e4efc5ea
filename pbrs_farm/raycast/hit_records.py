"""Hit records: from the face each pixel's ray hits to depth, normals and uv; pure numpy, no effects."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F32, F64, I32, HitRecord, SurfacePoints
from pbrs_farm.core.camera import Camera
from pbrs_farm.core.house import Geometry
from pbrs_farm.core.mesh import area_vectors, triangle_corners


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
    planes = _planes_of_faces(geometry, f, origin)

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
            _image(_interpolate(weights, geometry.uvs, corner), pixels, shape, np.float32),
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


def _planes_of_faces(geometry: Geometry, faces: NDArray[np.intp], origin: F64) -> _Planes:
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
    clipped = np.nan_to_num(weights[beside], nan=1.0, posinf=1.0, neginf=0.0).clip(0.0, 1.0)
    clipped /= clipped.sum(1, keepdims=True)
    weights[beside] = clipped
    k = local[beside]
    point = (
        clipped[:, :1] * planes.a[k] + clipped[:, 1:2] * planes.b[k] + clipped[:, 2:] * planes.c[k]
    )
    way = point - planes.origin
    t[beside] = np.linalg.norm(way, axis=1) if axis is None else way @ axis
    return t, weights


def _shading_normal(geometry: Geometry, corner: I32, weights: F64, geo_normal: F64) -> F64:
    """(N, 3) interpolated vertex normals on the geometric normal's side; that normal where flat."""
    # Interpolate and normalise; opposite vertex normals may cancel out.
    shading = _interpolate(weights, geometry.normals, corner)
    length = np.sqrt(_dot(shading, shading))
    smooth = length > 1e-6
    shading /= np.where(smooth, length, 1.0)[:, None]
    # Fall back to the geometric normal, then turn all to its side.
    shading[~smooth] = geo_normal[~smooth]
    shading[_dot(shading, geo_normal) < 0] *= -1
    return shading


def _interpolate(weights: F64, values: F32, corner: I32) -> F64:
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
