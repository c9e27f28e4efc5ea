"""Room layout: the corners of the camera's room, in the world and in the picture; no effects."""

from __future__ import annotations

from typing import Any

import numpy as np

from pbrs_farm.core.arrays import F64, DepthZ
from pbrs_farm.core.camera import Camera
from pbrs_farm.core.frames import transform_points
from pbrs_farm.core.house import Room

VISIBLE_M = 0.05  # a corner is visible when the depth at its pixel is at most this much less


def layout_table(room: Room, camera: Camera, depth_z: DepthZ) -> list[dict[str, Any]]:
    """A row per corner of the room's polygon, at its floor and at its nominal ceiling.

    corner: number in the polygon. at: "floor" or "ceiling". world: (x, y, z) in metres. pixel: (x, y) in px, also beyond
    the picture's edges; None if the lens does not see it. visible: in the picture and not occluded in depth_z (H, W).
    Sloped or stepped ceilings are not followed.
    """
    rows = []
    for where, y in (("floor", room.floor_y), ("ceiling", room.ceiling_y)):
        corners = np.insert(room.polygon, 1, y, axis=1)
        pixels, depths = _projected(corners, camera)
        for number, (world, pixel, z) in enumerate(zip(corners, pixels, depths, strict=True)):
            rows.append(
                {
                    "corner": number,
                    "at": where,
                    "world": world.tolist(),
                    "pixel": pixel,
                    "visible": pixel is not None and _is_visible(pixel, z, depth_z),
                }
            )
    return rows


def _projected(points: F64, camera: Camera) -> tuple[list[list[float] | None], list[float]]:
    """(x, y) in px of each point, None where the lens does not see it; and its depth."""
    i = camera.intrinsics
    if not i.lens.is_pinhole:
        projections = [p if np.isfinite(p).all() else None for p in camera.pixels_of(points)]
        pixels = [None if p is None else [float(v) for v in p] for p in projections]
        return pixels, [float(z) for z in camera.depths_of(points)]
    # OpenGL's camera looks along -z, rows count down.
    camera_from_world = np.asarray(np.linalg.inv(camera.world_from_camera), np.float64)
    local = transform_points(camera_from_world, points)
    depths = [-float(z) for z in local[:, 2]]
    return [
        [float(i.fx * p[0] / z + i.cx), float(-i.fy * p[1] / z + i.cy)] if z > 1e-6 else None
        for p, z in zip(local, depths, strict=True)
    ], depths


def _is_visible(pixel: list[float], z: float, depth_z: DepthZ) -> bool:
    column, row = int(np.floor(pixel[0])), int(np.floor(pixel[1]))
    height, width = depth_z.shape
    if not (0 <= column < width and 0 <= row < height):
        return False
    # A corner joins three surfaces: compare with the farthest depth around it.
    around = depth_z[max(row - 1, 0) : row + 2, max(column - 1, 0) : column + 2]
    farthest = float(np.where(around > 0, around, np.inf).max())
    return farthest >= z - VISIBLE_M
