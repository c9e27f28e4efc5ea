"""Soft bodies: cushions, sheets, covers with folds, padded walls, seats in one sheet; no effects.

Metres, y up. Every body is closed, its faces counter-clockwise seen from outside.
"""

from __future__ import annotations

import numpy as np

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.house import Surface
from pbrs_farm.geometry.bodies import creased, smooth


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


def sheet(grid: F64, thick: float) -> Surface:
    """A closed sheet around a grid of places (rows, columns, 3), half its thickness to either side."""
    du, dv = np.gradient(grid, axis=1), np.gradient(grid, axis=0)
    normal = np.cross(du, dv)
    normal /= np.maximum(np.linalg.norm(normal, axis=-1, keepdims=True), 1e-12)
    rows, columns = grid.shape[:2]
    upper, lower = grid + normal * thick / 2, grid - normal * thick / 2
    i = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    first = np.concatenate(
        [np.stack([i, i + 1, i + columns + 1], -1), np.stack([i, i + columns + 1, i + columns], -1)]
    )
    n = rows * columns
    last = n - columns
    rim = np.concatenate(
        [
            np.arange(columns - 1),
            np.arange(rows - 1) * columns + columns - 1,
            last + np.arange(columns - 1, 0, -1),
            np.arange(rows - 1, 0, -1) * columns,
        ]
    )
    after = np.roll(rim, -1)
    sides = np.concatenate(
        [np.stack([rim, rim + n, after + n], -1), np.stack([rim, after + n, after], -1)]
    )
    points = np.concatenate([upper.reshape(-1, 3), lower.reshape(-1, 3)])
    faces = np.concatenate([first, first[:, ::-1] + n, sides])
    return creased("sheet", points, faces, np.radians(75))


def draped(
    w: float,
    d: float,
    drop: float,
    thick: float,
    *,
    folds: float = 0.012,
    wave: float = 1.0,
    n: int = 14,
) -> Surface:
    """A cover over the left, right and front edge of a top w wide and d deep about the origin.

    Its top is at y = 0, drop hangs down; folds: how deep they are at the hem; wave: how many.
    """
    reach = drop + 0.02
    hem = np.array([0.01, reach / 2, reach])
    x_at = np.r_[-w / 2 - hem[::-1], np.linspace(-w / 2 + 0.05, w / 2 - 0.05, n), w / 2 + hem]
    z_at = np.r_[np.linspace(-d / 2, d / 2 - 0.05, n), d / 2 + hem]
    x, z = np.meshgrid(_over_edge(x_at, w / 2)[0], _over_edge(z_at, d / 2)[0])
    fall_x, fall_z = np.meshgrid(_over_edge(x_at, w / 2)[1], _over_edge(z_at, d / 2)[1])
    # A corner hangs lower than an edge.
    fall = (fall_x**4 + fall_z**4) ** 0.25
    share = fall / max(drop, 1e-6)
    ripple = folds * share * np.sin(28.0 * wave * (x / max(w, 0.1) + 1.7 * z / max(d, 0.1)))
    # soft waves on top
    swell = np.sin(7.1 * wave * x / w + 2.3 * z / d) + np.sin(5.3 * wave * z / d - 3.1 * x / w)
    swell *= 0.35 * folds * (1 - share)
    to_side, to_front = np.sign(x) * (fall_x >= fall_z), 1.0 * (fall_z > fall_x)
    grid = np.stack([x + ripple * to_side, swell - fall, z + ripple * to_front], -1)
    return sheet(grid[::-1], thick)


def _over_edge(at: F64, half: float) -> tuple[F64, F64]:
    """(position across, drop) of a cloth: flat up to `half` either way, hanging beyond."""
    over = np.maximum(np.abs(at) - half, 0.0)
    out = np.minimum(np.abs(at), half) + 0.02 * np.minimum(over / 0.05, 1.0)
    return np.sign(at) * out, np.maximum(over - 0.015, 0.0)


def tub(w: float, d: float, y: float, low: float, high: float, t: float, *, n: int = 18) -> Surface:
    """A padded wall round the back of an oval w by d, from y up: `low` at its ends, `high` at its middle."""
    # From the right end past the back to the left one; a third of the way round stays open in front.
    angle = np.linspace(-0.22 * np.pi, 1.22 * np.pi, n + 1)
    top = low + (high - low) * np.sin(np.pi * np.linspace(0, 1, n + 1)) ** 1.5
    rings = []
    for a, tall in zip(angle, top, strict=True):
        out = np.array([np.cos(a), 0.0, -np.sin(a)])
        size = np.array([w / 2, 0.0, d / 2])
        outer, inner = out * size, out * (size - np.array([t, 0.0, t]))
        mid = (outer + inner) / 2
        e = min(0.35 * t, 0.2 * (tall - y))
        lifted = [
            (outer, y),
            (outer, tall - e),
            (outer * 0.75 + mid * 0.25, tall - 0.3 * e),
            (mid, tall),
            (inner * 0.75 + mid * 0.25, tall - 0.3 * e),
            (inner, tall - e),
            (inner, y),
        ]
        rings.append(np.array([p + np.array([0.0, h, 0.0]) for p, h in lifted]))
    places = np.stack(rings)
    k = places.shape[1]
    points = np.concatenate([places.reshape(-1, 3), places[[0, -1]].mean(1)])
    i = np.arange(k)
    j = (i + 1) % k
    faces = []
    for row in range(n):
        a0, b0 = row * k, (row + 1) * k
        faces += [np.stack([a0 + i, b0 + j, a0 + j], -1), np.stack([a0 + i, b0 + i, b0 + j], -1)]
    last = len(places) * k
    faces += [np.stack([np.full(k, last), i, j], -1)]
    faces += [np.stack([np.full(k, last + 1), n * k + j, n * k + i], -1)]
    return creased("tub", points, np.concatenate(faces), np.radians(60))


def chair_shell(w: float, d: float, seat: float, high: float, thick: float) -> Surface:
    """A seat and a back in one bent sheet: the seat's top at `seat`, the back's edge at `high`."""
    rows, columns = 15, 9
    u = np.linspace(-1, 1, columns)
    # Along: from the front edge down over the seat and up the back.
    z = np.r_[
        d / 2 - 0.01,
        np.linspace(d / 2 - 0.04, -d / 2 + 0.16, 6),
        -d / 2 + 0.1,
        np.linspace(-d / 2 + 0.065, -d / 2 + thick / 2 + 0.003, 7),
    ]
    top = high - thick / 2 - 0.002
    low = seat - thick / 2
    y = np.r_[
        low - 0.025,
        np.full(6, low) - 0.012 * np.sin(np.linspace(0, np.pi, 6)),
        low + 0.03,
        np.linspace(low + 0.09, top, 7),
    ]
    half = w / 2 - thick / 2 - 0.001
    taper = np.r_[0.86, 0.93, np.ones(7), np.linspace(0.99, 0.72, 6)]
    grid = np.empty((rows, columns, 3))
    curl = np.r_[np.zeros(2), np.full(5, 0.035), 0.05, np.linspace(0.06, 0.03, 7)]
    is_back = np.r_[np.zeros(7), 0.4, np.ones(7)]
    grid[..., 0] = half * taper[:, None] * u[None]
    grid[..., 1] = y[:, None] + (curl * (1 - is_back))[:, None] * u[None] ** 4
    grid[..., 2] = z[:, None] + (curl * is_back)[:, None] * u[None] ** 2
    return sheet(grid, thick)


def hanging(w: float, h: float, depth: float, thick: float, folds: float) -> Surface:
    """Cloth that hangs in folds along x, its top at y = h: curtains of showers, towels on rails."""
    n = max(int(folds * 6), 8)
    x = np.linspace(-w / 2, w / 2, n + 1)
    y = np.linspace(h, 0.0, 6)
    grid = np.empty((len(y), len(x), 3))
    grid[..., 0], grid[..., 1] = x[None], y[:, None]
    wide = 0.55 + 0.45 * (1 - y / h)
    grid[..., 2] = depth / 2 * wide[:, None] * np.sin(2 * np.pi * folds * (x / w + 0.5))[None]
    return sheet(grid[::-1], thick)
