"""Squares in front of a camera, for flow and point tracks."""

import math

import numpy as np

from pbrs_farm.core.camera import Camera, Intrinsics
from pbrs_farm.core.house import Geometry
from pbrs_farm.raycast.caster import Caster

WIDTH, HEIGHT, F = 64, 48, 40.0
INTRINSICS = Intrinsics(WIDTH, HEIGHT, F, F, WIDTH / 2, HEIGHT / 2)


def squares(*rows: tuple[float, float, float, float]) -> Caster:
    """Squares across the axis of a camera at the origin: half edge, x and y of the middle, distance."""
    positions, faces = [], []
    for k, (half, x, y, z) in enumerate(rows):
        corners = [(-1, -1), (1, -1), (1, 1), (-1, 1)]
        positions += [(x + half * a, y + half * b, -z) for a, b in corners]
        faces += [(4 * k, 4 * k + 1, 4 * k + 2), (4 * k, 4 * k + 2, 4 * k + 3)]
    n, f = len(positions), len(faces)
    return Caster(
        Geometry(
            np.array(positions, np.float32), np.zeros((n, 3), np.float32),
            np.zeros((n, 2), np.float32), np.array(faces, np.int32),
            np.repeat(np.arange(1, f // 2 + 1), 2).astype(np.uint32),
            np.zeros(f, np.int32), np.zeros(f, np.int32),
        )
    )  # fmt: skip


def camera_at(x: float, y: float = 0.0, z: float = 0.0, yaw: float = 0.0) -> Camera:
    towards = np.array([math.sin(yaw), 0.0, -math.cos(yaw)])
    return Camera.look(INTRINSICS, np.array([x, y, z]), towards)
