"""Overlap of two views, by reprojection of one's (32 x 24) pixels into the other; no effects."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F32
from pbrs_farm.core.camera import Camera

DEPTH_SIZE: Final = (32, 24)
TOLERANCE: Final = 0.05
"""Two depths of one direction are of one surface when they differ by less than this part."""

DepthOf = Callable[[Sequence[Camera]], F32]
"""Planar depth at each pixel's centre of cameras of one size: (N, H, W) metres, 0 = nothing."""

ItemPictures = Callable[[Sequence[Camera]], tuple[F32, NDArray[np.uint32]]]
"""The same depth, and (N, H, W) instance id of each pixel, 0 = nothing."""


def shared_part(a: Camera, depth_a: F32, b: Camera, depth_b: F32) -> float:
    """Part of a's pixels with a surface that b sees too, or 0; depth: (H, W) planar metres, 0 = nothing."""
    # Lift a's pixels to points of the world.
    origin, directions = a.rays()
    points = (origin + directions * depth_a[..., None])[depth_a > 0]
    if not len(points):
        return 0.0

    # Project them into b, and keep those that lie in its picture.
    camera = (points - b.eye) @ b.world_from_camera[:3, :3]
    z = -camera[:, 2]
    in_front = z > 1e-3
    camera, z = camera[in_front], z[in_front]
    i = b.intrinsics
    column = np.floor(i.cx + i.fx * camera[:, 0] / z).astype(np.int64)
    row = np.floor(i.cy - i.fy * camera[:, 1] / z).astype(np.int64)
    inside = (column >= 0) & (column < i.width_px) & (row >= 0) & (row < i.height_px)

    # A point is visible if no surface is in front of it.
    depth = depth_b[row[inside], column[inside]]
    visible = np.abs(depth - z[inside]) <= TOLERANCE * z[inside]
    return float(visible.sum() / len(points))


def overlap(a: Camera, depth_a: F32, b: Camera, depth_b: F32) -> float:
    """The larger of both directions' shared parts, 0..1; depth_a, depth_b: (H, W) float32 of two cameras."""
    return max(shared_part(a, depth_a, b, depth_b), shared_part(b, depth_b, a, depth_a))
