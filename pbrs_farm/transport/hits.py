"""From the face each pixel's ray hits to a full hit record; pure numpy, no effects."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.arrays import HitRecord
from pbrs_farm.camera import Camera
from pbrs_farm.house import Geometry


def hit_record_from_faces(geometry: Geometry, camera: Camera, face: NDArray[np.int32]) -> HitRecord:
    """The record of face (H, W), int32, -1 = nothing, seen by the camera's unjittered rays.

    The hit is where the ray meets the face's plane, computed in float64 and held to the triangle
    (at grazing angles the plane's hit may lie beside it). Geometric normals are the faces' own.
    """
    seen = np.flatnonzero(face.ravel() >= 0)
    f = face.ravel()[seen]
    origin, directions = camera.rays()
    o, d = origin.astype(np.float64), directions.reshape(-1, 3)[seen].astype(np.float64)

    corner = geometry.faces[f]
    a, b, c = (geometry.positions[corner[:, k]].astype(np.float64) for k in range(3))
    normal = np.cross(b - a, c - a)
    weights = _weights(a, b, c, normal, _plane_point(o, d, a, normal))
    point = np.einsum("nk,knj->nj", weights, np.stack([a, b, c]))
    towards_back = camera.world_from_camera[:3, 2]
    depth_z = (o - point) @ towards_back

    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    away = np.einsum("nj,nj->n", normal, d) > 0
    normal[away] *= -1
    shading = _shading_normal(geometry, corner, weights, normal)
    uv = np.einsum("nk,nkj->nj", weights, geometry.uvs[corner].astype(np.float64))

    shape = face.shape
    return HitRecord(
        face=np.ascontiguousarray(face, np.int32),
        item=_scattered(geometry.face_item[f], seen, shape, np.uint32),
        depth_z=_scattered(depth_z, seen, shape, np.float32),
        position_world=_scattered(o + depth_z[:, None] * d, seen, shape, np.float32),
        geo_normal_world=_scattered(normal, seen, shape, np.float32),
        shading_normal_world=_scattered(shading, seen, shape, np.float32),
        uv=_scattered(uv, seen, shape, np.float32),
    )


def _plane_point(
    o: NDArray[np.float64], d: NDArray[np.float64], a: NDArray[np.float64], n: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(N, 3) where o + t d meets the plane through a with normal n; a itself where they are parallel."""
    along = np.einsum("nj,nj->n", d, n)
    with np.errstate(divide="ignore", invalid="ignore"):
        t = np.einsum("nj,nj->n", a - o, n) / along
    t = np.where(np.isfinite(t), t, np.einsum("nj,nj->n", a - o, d))
    return np.asarray(o + t[:, None] * d)


def _weights(
    a: NDArray[np.float64],
    b: NDArray[np.float64],
    c: NDArray[np.float64],
    n: NDArray[np.float64],
    p: NDArray[np.float64],
) -> NDArray[np.float64]:
    """(N, 3) barycentric coordinates of p, held to the triangle a, b, c with normal n (any length)."""
    area = np.einsum("nj,nj->n", n, n)
    w_b = np.einsum("nj,nj->n", np.cross(p - a, c - a), n) / area
    w_c = np.einsum("nj,nj->n", np.cross(b - a, p - a), n) / area
    w = np.maximum(np.stack([1 - w_b - w_c, w_b, w_c], axis=1), 0)
    return np.asarray(w / w.sum(1, keepdims=True))


def _shading_normal(
    geometry: Geometry,
    corner: NDArray[np.int32],
    weights: NDArray[np.float64],
    geo_normal: NDArray[np.float64],
) -> NDArray[np.float64]:
    """(N, 3) interpolated vertex normals on the geometric normal's side; that normal where flat."""
    shading = np.einsum("nk,nkj->nj", weights, geometry.normals[corner].astype(np.float64))
    length = np.linalg.norm(shading, axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        shading /= length[:, None]
    flat = ~(np.isfinite(shading).all(1) & (length > 1e-6))
    shading[flat] = geo_normal[flat]
    shading[np.einsum("nj,nj->n", shading, geo_normal) < 0] *= -1
    return np.asarray(shading)


def _scattered(
    values: NDArray[Any], pixels: NDArray[np.intp], shape: tuple[int, ...], dtype: type[np.generic]
) -> NDArray[Any]:
    """Image of shape + values' own axes, values at the pixels and 0 elsewhere."""
    image = np.zeros((int(np.prod(shape)), *values.shape[1:]), dtype)
    image[pixels] = values
    return image.reshape(*shape, *values.shape[1:])
