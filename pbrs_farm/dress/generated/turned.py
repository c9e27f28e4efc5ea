"""Smooth bodies: profiles turned about the vertical, cushions, boxes on low and high; no effects."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pbrs_farm.core.arrays import F64, I32, Bools
from pbrs_farm.core.house import Surface
from pbrs_farm.geometry.solids import box

_SHARP_RAD = np.radians(50)  # a profile that turns by more has an edge there


def turned(profile: Sequence[tuple[float, float]] | F64, *, n: int = 16) -> Surface:
    """The (radius, height) profile (P, 2) turned about the vertical, n sides, smooth normals.

    The profile runs upwards outside; down again inside for a vessel. Where it turns by more than
    50 degrees there is an edge. Closed where both ends are on the axis.
    """
    points = np.asarray(profile, np.float64)
    steps = np.diff(points, axis=0)
    steps /= np.maximum(np.linalg.norm(steps, axis=1, keepdims=True), 1e-12)
    outward = np.stack([steps[:, 1], -steps[:, 0]], -1)
    # Average the normals of two stretches at a soft corner.
    soft = (outward[:-1] * outward[1:]).sum(1) > np.cos(_SHARP_RAD)
    both = outward[:-1] + outward[1:]
    both /= np.maximum(np.linalg.norm(both, axis=1, keepdims=True), 1e-12)
    begin, end = outward.copy(), outward.copy()
    begin[1:][soft] = both[soft]
    end[:-1][soft] = both[soft]
    angles = 2 * np.pi * np.arange(n + 1) / n
    around = np.stack([np.cos(angles), np.zeros(n + 1), -np.sin(angles)], -1)
    around[-1] = around[0]
    # Each stretch has a ring of points at its begin and one at its end.
    ends = np.stack([points[:-1], points[1:]], 1).reshape(-1, 2)
    slopes = np.stack([begin, end], 1).reshape(-1, 2)
    positions, normals = (_rings(around, rows).astype(np.float32) for rows in (ends, slopes))
    return Surface("turned", positions, _ring_faces(points[:, 0] > 0, n), 0, None, normals)


def _rings(around: F64, rows: F64) -> F64:
    # (R * (n + 1), 3): for each (radius, height) the unit ring, so wide and so high.
    rings = around * rows[:, 0, None, None]
    rings += np.stack([np.zeros(len(rows)), rows[:, 1], np.zeros(len(rows))], -1)[:, None]
    return np.asarray(rings.reshape(-1, 3))


def _ring_faces(is_wide: Bools, n: int) -> I32:
    # Of each stretch two triangles a side, or one where it ends on the axis.
    has_low, has_high = is_wide[:-1], is_wide[1:]
    i = (
        np.arange(n, dtype=np.int32)
        + 2 * (n + 1) * np.arange(len(has_low), dtype=np.int32)[:, None]
    )
    j = i + np.int32(n + 1)
    faces = np.empty((len(has_low), 2, n, 3), np.int32)
    faces[:, 0] = np.stack([i, i + 1, j + has_high[:, None]], -1)
    faces[:, 1] = np.stack([i, j + 1, j], -1)
    return np.asarray(faces[np.stack([has_low, has_high], 1)].reshape(-1, 3))


def vessel(outside: Sequence[tuple[float, float]], wall_m: float, *, n: int = 16) -> Surface:
    """A vessel open at the top: the outer profile from the axis to the rim, and its inside."""
    outer = np.asarray(outside, np.float64)
    inner = outer[::-1].copy()
    inner[:, 0] = np.maximum(inner[:, 0] - wall_m, 0.0)
    inner[:, 1] = np.maximum(inner[:, 1], outer[0, 1] + wall_m)
    inner[0, 1] = outer[-1, 1]
    inner[-1, 0] = 0.0
    # Leave out what the floor of the inside flattens.
    keep = np.ones(len(inner), np.bool_)
    keep[1:-1] = inner[1:-1, 0] > 0
    profile = np.concatenate([outer, inner[keep]])
    moves = np.concatenate([[True], np.linalg.norm(np.diff(profile, axis=0), axis=1) > 1e-6])
    return turned(profile[moves], n=n)


def slab(low: Sequence[float], high: Sequence[float]) -> Surface:
    """An axis-aligned closed box between two corners, metres."""
    a, b = np.asarray(low, np.float64), np.asarray(high, np.float64)
    return box("box", (a + b) / 2, (b - a) / 2, 0)


def bulged(
    size: tuple[float, float, float], *, n: int = 12, edge: float = 0.0, bulge: float = 2.2
) -> Surface:
    """A closed cushion (width, thickness, depth) about the origin, its corners drawn in.

    edge: share of the thickness that its rim has: 0 for a pillow, 1 for a folded cloth.
    bulge: how fast it rises from the rim; 2 is round, 6 boxy.
    """
    # Cells lie closer towards the rim, where it bends most.
    t = np.sin(np.linspace(-1, 1, n + 1) * np.pi / 2)
    u, v = np.meshgrid(t, t)
    rise = ((1 - np.abs(u) ** bulge) * (1 - np.abs(v) ** bulge)).clip(0, 1) ** 0.5
    thick = edge + (1 - edge) * rise
    # Draw the middle of the sides in a little: cloth pulls.
    pull = 1 - 0.06 * (1 - edge) * (1 - np.abs(v) ** 2)
    pull_v = 1 - 0.06 * (1 - edge) * (1 - np.abs(u) ** 2)
    x, z = u * pull * size[0] / 2, v * pull_v * size[2] / 2
    y = thick * size[1] / 2
    top = np.stack([x, y, z], -1).reshape(-1, 3)
    low = np.stack([x, -y, z], -1).reshape(-1, 3)
    m = n + 1
    i = (np.arange(n)[:, None] * m + np.arange(n)).ravel()
    quads = np.stack([i, i + m, i + m + 1, i + 1], -1)
    faces = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    below = faces[:, ::-1] + m * m
    positions = np.concatenate([top, low])
    faces = np.concatenate([faces, below, _rim(n)])
    # Join the two sheets where they meet, so that it is closed and smooth there.
    return _welded(positions, faces)


def _rim(n: int) -> F64:
    # The band between the rims of both sheets.
    m = n + 1
    k = np.arange(n)
    loop = np.concatenate([k, k * m + n, n * m + n - k, (n - k) * m])
    after = np.roll(loop, -1)
    low = m * m
    return np.concatenate(
        [np.stack([loop, after, after + low], -1), np.stack([loop, after + low, loop + low], -1)]
    )


def _welded(positions: F64, faces: F64) -> Surface:
    _, first, number = np.unique(
        np.round(positions, 7), axis=0, return_index=True, return_inverse=True
    )
    points, faces = positions[first], number.ravel()[faces]
    a, b, c = (faces[:, k] for k in range(3))
    faces = faces[(a != b) & (b != c) & (c != a)]
    return smooth("cushion", points, faces.astype(np.int32))


def smooth(name: str, points: F64, faces: I32) -> Surface:
    """A surface whose shading normals are the mean of its faces', by area."""
    corners = points[faces]
    n = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals = np.zeros_like(points)
    for k in range(3):
        np.add.at(normals, faces[:, k], n)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    return Surface(
        name, points.astype(np.float32), faces.astype(np.int32), 0, None, normals.astype(np.float32)
    )
