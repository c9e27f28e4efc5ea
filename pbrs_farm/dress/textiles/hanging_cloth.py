"""Hanging cloth as closed thin bodies: pleated panels, blinds, towels over a rail; no effects."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.house import Surface
from pbrs_farm.core.mesh import unit_vectors
from pbrs_farm.geometry.solids import lathe

_THICK_M = 0.003
_COLUMNS_PER_FOLD = 10
_ROWS = 9
# turns an upright solid along +x
_ALONG_X = np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]])


@dataclass(frozen=True, slots=True)
class Pleats:
    """How a panel is pleated."""

    length_m: float  # of one fold across
    depth_m: float  # from the middle of the folds to their crests, at the lower edge
    phase: float = 0.0
    sway: float = 0.3  # how far folds wander from top to bottom, radians

    def depths(self, x: F64, v: F64) -> F64:
        """Offset from the middle plane at x metres across and v from 0 (bottom) to 1 (top)."""
        across = 2 * np.pi * x / self.length_m + self.phase + self.sway * np.sin(2.2 * (1 - v))
        # Pleats are pinched above and open below; crests are rounder than a sine.
        wave = np.sin(across + 0.35 * np.sin(across))
        second = 0.22 * np.sin(0.53 * across + 1.3 * self.phase) * (1 - v)
        return np.asarray(self.depth_m * (0.62 + 0.38 * (1 - v)) * (wave + second), np.float64)


def pleated_panel(
    name: str, width: float, height: float, z: float, folds: Pleats, tile_m: float
) -> Surface:
    """A pleated panel with its lower left corner at x = 0, y = 0, its middle plane at z."""
    n = max(int(np.ceil(width / folds.length_m * _COLUMNS_PER_FOLD)), 8)
    x, v = np.meshgrid(np.linspace(0, width, n + 1), np.linspace(0, 1, _ROWS + 1))
    depth = folds.depths(x, v)
    # The cloth is longer than the panel is wide: texture runs along it.
    steps = np.hypot(np.diff(x, axis=1), np.diff(depth, axis=1))
    run = np.concatenate([np.zeros((_ROWS + 1, 1)), np.cumsum(steps, 1)], 1)
    middle = np.stack([x, v * height, z + depth], -1)
    return solid_sheet(name, middle, np.stack([run, v * height], -1) / tile_m)


def solid_sheet(name: str, middle: F64, uv: F64, thick_m: float = _THICK_M) -> Surface:
    """A closed body around a sheet of points (R, C, 3), its front towards +z where it is flat."""
    rows, columns = middle.shape[:2]
    across, up = np.gradient(middle, axis=1), np.gradient(middle, axis=0)
    normal = unit_vectors(np.cross(across, up))
    front, back = middle + normal * thick_m / 2, middle - normal * thick_m / 2
    n = rows * columns
    index = np.arange(n).reshape(rows, columns)
    a, b, c, d = index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]
    faces = np.concatenate([np.stack(t, -1).reshape(-1, 3) for t in ((a, b, c), (a, c, d))])
    # Close the rim with separate vertices, so that the sheet's shading stays smooth.
    rim = np.concatenate([index[0, :-1], index[:-1, -1], index[-1, :0:-1], index[:0:-1, 0]])
    after = np.roll(rim, -1)
    rim_points = np.concatenate([front.reshape(-1, 3)[rim], back.reshape(-1, 3)[rim]])
    k = np.arange(len(rim))
    nxt = np.roll(k, -1)
    f, g = 2 * n, 2 * n + len(rim)
    rim_faces = np.concatenate(
        [np.stack([f + k, g + k, g + nxt], -1), np.stack([f + k, g + nxt, f + nxt], -1)]
    )
    outward = np.cross(
        front.reshape(-1, 3)[after] - front.reshape(-1, 3)[rim], normal.reshape(-1, 3)[rim]
    )
    outward = unit_vectors(outward)
    positions = np.concatenate([front.reshape(-1, 3), back.reshape(-1, 3), rim_points])
    normals = np.concatenate([normal.reshape(-1, 3), -normal.reshape(-1, 3), outward, outward])
    flat_uv = uv.reshape(-1, 2)
    return Surface(
        name,
        positions.astype(np.float32),
        np.concatenate([faces, faces[:, ::-1] + n, rim_faces]).astype(np.int32),
        0,
        np.concatenate([flat_uv, flat_uv, flat_uv[rim], flat_uv[rim]]).astype(np.float32),
        normals.astype(np.float32),
    )


def round_rail(name: str, x0: float, x1: float, y: float, z: float, radius: float) -> Surface:
    """A round rail along x with closed ends, metres."""
    profile = np.array([[0, x0], [radius, x0], [radius, x1], [0, x1]])
    upright = lathe(name, profile, np.zeros(3), 0, n=12)
    normals = upright.normals
    assert normals is not None
    turn = _ALONG_X.astype(np.float32)
    moved = upright.positions @ turn.T + np.array([0, y, z], np.float32)
    return replace(
        upright, positions=moved.astype(np.float32), normals=(normals @ turn.T).astype(np.float32)
    )


def towel_over_rail(width: float, drop: float, z: float, rng: np.random.Generator) -> Surface:
    """A towel folded over a rail at height drop, both halves hanging, gently waved."""
    n_side, columns = 8, 14
    short = drop * float(rng.uniform(0.55, 0.9))
    radius = 0.014
    # Go up the back, over the rail, down the front.
    back = [(drop - short * (1 - t), -radius) for t in np.linspace(0, 1, n_side)]
    over = [
        (drop + radius * np.sin(a), -radius * np.cos(a)) for a in np.linspace(0, np.pi, 7)[1:-1]
    ]
    front = [(drop * (1 - t), radius) for t in np.linspace(0, 1, n_side)]
    path = np.array([*back, *over, *front])[::-1]
    x, along = np.meshgrid(np.linspace(-width / 2, width / 2, columns), np.arange(len(path)))
    y, depth = path[along, 0], path[along, 1]
    wave = (
        0.004 * np.sin(2 * np.pi * x / width * 1.5 + float(rng.uniform(0, 6))) * (drop - y) / drop
    )
    middle = np.stack([x, y, z + depth + np.where(depth > 0, wave + 0.004, -0.2 * wave)], -1)
    run = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    return solid_sheet("towel", middle, np.stack([x, run[along]], -1) / 0.25, 0.006)
