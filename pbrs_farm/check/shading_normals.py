"""Shading normals of house.glb: interpolated over the mesh, bent by normal maps (glTF 2.0, 3.9.3); no effects."""

from __future__ import annotations

import numpy as np

from pbrs_farm.check.axes import dot
from pbrs_farm.core.arrays import F32, F64

_LEAST_Z = 0.1  # least slope of a map's unit normal: a steeper one is noise of the picture


def between_corners(weights: F64, normals: F32, facing: F64) -> F64:
    """(N, 3) unit normals interpolated from the corners' (N, 3, 3), towards facing; facing without normals."""
    mean = np.einsum("nk,nkc->nc", weights, normals.astype(np.float64))
    length = np.linalg.norm(mean, axis=1, keepdims=True)
    smooth = np.where(length > 1e-6, mean / np.maximum(length, 1e-12), facing)
    away = dot(smooth, facing) < 0
    return np.where(away[:, None], -smooth, smooth)


def bent(normals: F64, corners: F64, uv: F64, mapped: F64) -> F64:
    """(N, 3) normals of triangles (N, 3, 3) with uv (N, 3, 2), v down, bent by mapped (N, 3): see `decoded`."""
    e1, e2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    up = uv * [1.0, -1.0]
    a, b = up[:, 1] - up[:, 0], up[:, 2] - up[:, 0]
    area = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    has_uv = np.abs(area) > 1e-6 * ((a**2).sum(1) + (b**2).sum(1))
    side = np.sign(area)[:, None]
    along = (b[:, 1:] * e1 - a[:, 1:] * e2) * side
    # The map is on the front: turn normals of the back there and back.
    front = np.cross(e1, e2)
    turn = np.where(dot(normals, front) < 0, -1.0, 1.0)[:, None]
    normal = turn * normals
    tangent = along - normal * dot(normal, along)[:, None]
    length = np.linalg.norm(tangent, axis=1, keepdims=True)
    tangent = tangent / np.maximum(length, 1e-30)
    across = np.cross(normal, tangent) * side
    out = mapped[:, :1] * tangent + mapped[:, 1:2] * across + mapped[:, 2:] * normal
    out = out / np.maximum(np.linalg.norm(out, axis=1, keepdims=True), 1e-12)
    return np.where(has_uv[:, None] & (length > 1e-20), turn * out, normals)


def decoded(values: F64, scale: float) -> F64:
    """(N, 3) unit normals in tangent space of (N, 3) bytes; black ones are flat."""
    xyz = values * (2 / 255) - 1
    black = (xyz <= -1).all(axis=1)
    xyz[:, :2] *= scale
    xyz[:, 2] = np.maximum(xyz[:, 2], _LEAST_Z * np.maximum(np.hypot(xyz[:, 0], xyz[:, 1]), 1e-6))
    xyz[black] = [0, 0, 1]
    return np.asarray(xyz / np.linalg.norm(xyz, axis=1, keepdims=True))
