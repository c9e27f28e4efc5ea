"""Closed bodies that furniture is built of: bevelled and rounded boxes, lofts, tubes, sheets; no effects.

Metres, y up. Every body is closed, its faces counter-clockwise seen from outside, with normals that
bend over soft edges and break at sharp ones.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from pbrs_farm.core.arrays import F64, I32, Bools
from pbrs_farm.core.house import Surface

Triple = tuple[float, float, float]
Outline = Sequence[tuple[float, float]]  # (x, z), clockwise seen from above

_SHARP_RAD: Final = np.radians(50)  # where a surface turns by more it has an edge


# Boxes whose edges light shows: each vertex has the normal of the face it lies on, so that shading
# runs round the edge.


def bevelled(low: Sequence[float], high: Sequence[float], r: float = 0.003) -> Surface:
    """A box between two corners, its edges cut by r: 44 triangles."""
    a, b = np.asarray(low, np.float64), np.asarray(high, np.float64)
    half = np.maximum((b - a) / 2, 1e-4)
    cut = min(float(r), 0.4 * float(half.min()))
    inner = half - cut
    # Vertex (axis, side, i, j) lies on the face of that axis and side.
    points = _BEVEL_SIGNS * np.where(_BEVEL_IS_OUT, half, inner) + (a + b) / 2
    return Surface(
        "bevelled", points.astype(np.float32), _BEVEL_FACES.copy(), 0, None, _BEVEL_NORMALS.copy()
    )


def _bevel_mesh() -> tuple[F64, Bools, I32]:
    """Signs (24, 3), which coordinate is out (24, 3), faces (44, 3)."""
    corners = [(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
    rows = [(axis, corner) for axis in range(3) for corner in corners]
    number = {row: k for k, row in enumerate(rows)}

    def at(axis: int, along: int, u: int, v: int, of: int) -> int:
        # The vertex on the face of axis `of` at the corner that is `along` on `axis`.
        signs = {axis: along, (axis + 1) % 3: u, (axis + 2) % 3: v}
        return number[of, (signs[0], signs[1], signs[2])]

    faces: list[tuple[int, int, int]] = []
    for axis in range(3):
        for side in (-1, 1):
            a, b, c, d = (
                at(axis, side, u, v, axis) for u, v in ((-1, -1), (1, -1), (1, 1), (-1, 1))
            )
            faces += [(a, b, c), (a, c, d)]
        # The cut along each edge that runs along this axis.
        for u, v in ((-1, -1), (-1, 1), (1, -1), (1, 1)):
            p, s = (at(axis, side, u, v, (axis + 1) % 3) for side in (-1, 1))
            q, t = (at(axis, side, u, v, (axis + 2) % 3) for side in (-1, 1))
            faces += [(p, q, t), (p, t, s)]
    faces += [(number[0, c], number[1, c], number[2, c]) for c in corners]
    signs = np.array([corner for _axis, corner in rows], np.float64)
    is_out = np.array([[k == axis for k in range(3)] for axis, _corner in rows])
    triangles = np.array(faces, np.int32)
    # Turn those that look inwards.
    p3 = (signs * np.where(is_out, 1.0, 0.8))[triangles]
    normal = np.cross(p3[:, 1] - p3[:, 0], p3[:, 2] - p3[:, 0])
    inwards = (normal * p3.mean(1)).sum(1) < 0
    triangles[inwards] = triangles[inwards][:, ::-1]
    return signs, is_out, triangles


_BEVEL_SIGNS, _BEVEL_IS_OUT, _BEVEL_FACES = _bevel_mesh()
_BEVEL_NORMALS: Final = (_BEVEL_SIGNS * _BEVEL_IS_OUT).astype(np.float32)


def rounded(low: Sequence[float], high: Sequence[float], r: float, *, n: int = 2) -> Surface:
    """A box between two corners, its edges round with radius r in 2 n steps: 12 (2 n + 1)^2 triangles."""
    a, b = np.asarray(low, np.float64), np.asarray(high, np.float64)
    half = np.maximum((b - a) / 2, 1e-4)
    cut = min(float(r), 0.98 * float(half.min()))
    inner = half - cut
    step = np.tan(np.pi / 4 * np.arange(n + 1) / n)
    along, sign = np.r_[-step[::-1], step], np.r_[-np.ones(n + 1), np.ones(n + 1)]
    m = 2 * n + 2
    quads = (np.arange(m - 1)[:, None] * m + np.arange(m - 1)).ravel()
    points: list[F64] = []
    normals: list[F64] = []
    faces: list[F64] = []
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        for side in (-1.0, 1.0):
            d, s = np.empty((m, m, 3)), np.empty((m, m, 3))
            d[..., axis], s[..., axis] = side, side
            d[..., u], s[..., u] = along[:, None], sign[:, None]
            d[..., v], s[..., v] = along[None], sign[None]
            out = d / np.sqrt((d * d).sum(-1, keepdims=True))
            first = sum(len(p) for p in points)
            points.append((s * inner + cut * out).reshape(-1, 3) + (a + b) / 2)
            normals.append(out.reshape(-1, 3))
            grid = np.stack([quads, quads + m, quads + m + 1, quads + 1], -1) + first
            both = np.concatenate([grid[:, [0, 1, 2]], grid[:, [0, 2, 3]]])
            faces.append(both if side > 0 else both[:, ::-1])
    return Surface(
        "rounded", np.concatenate(points).astype(np.float32),
        np.concatenate(faces).astype(np.int32), 0, None,
        np.concatenate(normals).astype(np.float32),
    )  # fmt: skip


# Outlines in plan, and bodies through outlines at heights.


def oval(
    w: float, d: float, *, x: float = 0.0, z: float = 0.0, n: int = 24, power: float = 2.0
) -> list[tuple[float, float]]:
    """An ellipse w wide and d deep about (x, z); a higher power is nearer to a rectangle."""
    t = 2 * np.pi * (np.arange(n) + 0.5) / n
    c, s = np.cos(t), -np.sin(t)
    px = np.sign(c) * np.abs(c) ** (2 / power) * w / 2 + x
    pz = np.sign(s) * np.abs(s) ** (2 / power) * d / 2 + z
    return [(float(p), float(q)) for p, q in zip(px, pz, strict=True)]


def rect(
    w: float, d: float, r: float = 0.0, *, x: float = 0.0, z: float = 0.0, n: int = 4
) -> list[tuple[float, float]]:
    """A rectangle about (x, z) with round corners of radius r, n + 1 points a corner."""
    r = max(min(r, 0.49 * min(w, d)), 1e-4)
    found = []
    for k, (sx, sz) in enumerate(((1, -1), (-1, -1), (-1, 1), (1, 1))):
        for t in np.pi / 2 * (k + np.arange(n + 1) / n):
            found.append((
                float(x + sx * (w / 2 - r) + r * np.cos(t)),
                float(z + sz * (d / 2 - r) - r * np.sin(t)),
            ))  # fmt: skip
    return found


def fluted(w: float, ribs: int, depth: float) -> list[tuple[float, float]]:
    """A circle w wide whose rim goes in and out so many times, by a share of its radius."""
    n = 3 * ribs
    t = 2 * np.pi * np.arange(n) / n
    r = w / 2 * (1 - depth / 2 + depth / 2 * np.cos(ribs * t))
    return [(float(a * np.cos(b)), float(-a * np.sin(b))) for a, b in zip(r, t, strict=True)]


def d_shape(
    w: float, d: float, *, back: float = 0.0, share: float = 0.6, r: float = 0.01, n: int = 16
) -> list[tuple[float, float]]:
    """An outline straight at the back (z = back) and round at the front: basins, toilets, seats.

    share: of its depth that the round front takes; r: radius of its two corners at the back.
    """
    t = np.pi * np.arange(n + 1) / n
    end = back + d * (1 - share)
    front = [(float(-w / 2 * np.cos(a)), float(end + d * share * np.sin(a))) for a in t]
    quarter = np.pi / 2 * np.arange(4) / 3
    right = [(float(w / 2 - r + r * np.cos(a)), float(back + r - r * np.sin(a))) for a in quarter]
    left = [(float(-w / 2 + r - r * np.sin(a)), float(back + r - r * np.cos(a))) for a in quarter]
    return [*front, *right, *left]


def loft(rings: Sequence[tuple[Outline, float]], *, sharp: float = 50.0) -> Surface:
    """The body through outlines (all of so many points) at heights, its ends closed.

    Upwards outside; down again inside for a vessel. sharp: degrees of turning that make an edge.
    """
    places = np.array([[(x, y, z) for x, z in outline] for outline, y in rings], np.float64)
    k, n = places.shape[:2]
    middles = np.stack([places[0].mean(0), places[-1].mean(0)])
    points = np.concatenate([places.reshape(-1, 3), middles])
    i = np.arange(n)
    j = (i + 1) % n
    faces = []
    for row in range(k - 1):
        a, b = row * n, (row + 1) * n
        faces += [np.stack([a + i, a + j, b + j], -1), np.stack([a + i, b + j, b + i], -1)]
    top = (k - 1) * n
    faces += [np.stack([np.full(n, k * n), j, i], -1)]
    faces += [np.stack([np.full(n, k * n + 1), top + i, top + j], -1)]
    return creased("loft", points, np.concatenate(faces), np.radians(sharp))


def board(
    w: float, d: float, low: float, high: float, corner: float = 0.0, edge: float = 0.003, *,
    x: float = 0.0, z: float = 0.0, n: int = 4,
) -> Surface:  # fmt: skip
    """A board with round corners in plan and edges cut by `edge`: tops of tables, seats, lids."""
    e = min(edge, 0.45 * (high - low))
    small = rect(w - 2 * e, d - 2 * e, max(corner - e, 0.0005), x=x, z=z, n=n)
    wide = rect(w, d, max(corner, e), x=x, z=z, n=n)
    return loft([(small, low), (wide, low + e), (wide, high - e), (small, high)])


def disc(
    w: float, d: float, low: float, high: float, edge: float = 0.003, *, x: float = 0.0,
    z: float = 0.0, n: int = 32, power: float = 2.0,
) -> Surface:  # fmt: skip
    """A round or oval board with its edges cut by `edge`."""
    e = min(edge, 0.45 * (high - low))
    small = oval(w - 2 * e, d - 2 * e, x=x, z=z, n=n, power=power)
    wide = oval(w, d, x=x, z=z, n=n, power=power)
    return loft([(small, low), (wide, low + e), (wide, high - e), (small, high)])


# Tubes along a path.


def bent(points: Sequence[Triple], r: float, *, n: int = 4) -> list[Triple]:
    """The path with its corners rounded, r before and after each."""
    path = [np.asarray(p, np.float64) for p in points]
    found = [path[0]]
    for before, corner, after in zip(path, path[1:], path[2:], strict=False):
        to, off = before - corner, after - corner
        near = min(r, 0.49 * float(np.linalg.norm(to)), 0.49 * float(np.linalg.norm(off)))
        a = corner + to / np.linalg.norm(to) * near
        b = corner + off / np.linalg.norm(off) * near
        for t in np.linspace(0, 1, n + 1):
            found.append((1 - t) ** 2 * a + 2 * t * (1 - t) * corner + t**2 * b)
    found.append(path[-1])
    return [(float(p[0]), float(p[1]), float(p[2])) for p in found]


def ring_path(r: float, *, y: float = 0.0, n: int = 24, share: float = 1.0) -> list[Triple]:
    """Points on a level circle about the origin, or on a share of it; the first comes again at the end."""
    t = 2 * np.pi * share * np.arange(n + 1) / n
    return [(float(r * np.cos(a)), float(y), float(-r * np.sin(a))) for a in t]


def tube(path: Sequence[Triple], r: float, *, n: int = 8, end: float | None = None) -> Surface:
    """A round bar along a path, closed at both ends; end: its radius there where it tapers."""
    points = np.asarray(path, np.float64)
    step = np.diff(points, axis=0)
    step /= np.maximum(np.linalg.norm(step, axis=1, keepdims=True), 1e-12)
    along = np.concatenate([step[:1], step[:-1] + step[1:], step[-1:]])
    along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-12)
    # Carry one direction across along the path, so that the tube does not twist.
    side = np.cross(along[0], (0.0, 1.0, 0.0) if abs(along[0, 1]) < 0.9 else (1.0, 0.0, 0.0))
    t = 2 * np.pi * np.arange(n) / n
    rings = []
    for k, direction in enumerate(along):
        side = side - direction * float(side @ direction)
        side = side / max(float(np.linalg.norm(side)), 1e-12)
        up = np.cross(side, direction)
        # At a corner the cut is longer than the tube is thick.
        stretch = 1.0
        if 0 < k < len(along) - 1:
            stretch = 1 / max(float(direction @ step[k]), 0.5)
        turn = step[min(k, len(step) - 1)] - step[max(k - 1, 0)]
        size = float(np.linalg.norm(turn))
        across = turn / size if size > 1e-6 else np.zeros(3)
        wide = r if end is None else r + (end - r) * k / (len(along) - 1)
        ring = wide * (np.cos(t)[:, None] * side + np.sin(t)[:, None] * up)
        ring = ring + (stretch - 1) * (ring @ across)[:, None] * across
        rings.append(points[k] + ring)
    places = np.concatenate([*rings, points[:1], points[-1:]])
    k, i = len(rings), np.arange(n)
    j = (i + 1) % n
    faces = []
    for row in range(k - 1):
        a, b = row * n, (row + 1) * n
        faces += [np.stack([a + i, b + j, a + j], -1), np.stack([a + i, b + i, b + j], -1)]
    top = (k - 1) * n
    faces += [np.stack([np.full(n, k * n), i, j], -1)]
    faces += [np.stack([np.full(n, k * n + 1), top + j, top + i], -1)]
    return creased("tube", places, np.concatenate(faces), _SHARP_RAD)


def hoop(outline: Outline, y: float, r: float, *, n: int = 6) -> Surface:
    """A closed ring of round section along an outline at a height."""
    path = np.array([(x, y, z) for x, z in outline], np.float64)
    step = np.roll(path, -1, 0) - np.roll(path, 1, 0)
    step /= np.maximum(np.linalg.norm(step, axis=1, keepdims=True), 1e-12)
    out = np.cross(step, (0.0, 1.0, 0.0))
    t = 2 * np.pi * np.arange(n) / n
    rings = path[:, None] + r * (
        np.cos(t)[None, :, None] * out[:, None] + np.sin(t)[None, :, None] * np.array([0, 1.0, 0])
    )
    m = len(path)
    a = (np.arange(m)[:, None] * n + np.arange(n)).ravel()
    b = (np.arange(m)[:, None] * n + (np.arange(n) + 1) % n).ravel()
    after = n * m
    c, d = (b + n) % after, (a + n) % after
    faces = np.concatenate([np.stack([a, c, b], -1), np.stack([a, d, c], -1)])
    return creased("hoop", rings.reshape(-1, 3), faces, np.radians(80))


def square_tube(a: Triple, b: Triple, w: float, d: float) -> Surface:
    """A straight bar of rectangular section from a to b: w across the horizontal, d across the other."""
    start, stop = np.asarray(a, np.float64), np.asarray(b, np.float64)
    along = (stop - start) / max(float(np.linalg.norm(stop - start)), 1e-12)
    side = np.cross(along, (0.0, 1.0, 0.0) if abs(along[1]) < 0.9 else (0.0, 0.0, -1.0))
    side /= np.linalg.norm(side)
    matrix = np.stack([side, np.cross(along, side), along], -1)
    length = float(np.linalg.norm(stop - start))
    bar = bevelled((-w / 2, -d / 2, 0.0), (w / 2, d / 2, length), 0.002)
    normals = np.asarray(bar.normals, np.float64) @ matrix.T
    points = bar.positions.astype(np.float64) @ matrix.T + start
    return Surface("bar", points.astype(np.float32), bar.faces, 0, None, normals.astype(np.float32))


# Cloth: sheets of a thickness, with folds.


def sheet(grid: F64, thick: float) -> Surface:
    """A closed sheet around a grid of places (rows, columns, 3), half its thickness to either side."""
    du, dv = np.gradient(grid, axis=1), np.gradient(grid, axis=0)
    normal = np.cross(du, dv)
    normal /= np.maximum(np.linalg.norm(normal, axis=-1, keepdims=True), 1e-12)
    rows, columns = grid.shape[:2]
    upper, lower = grid + normal * thick / 2, grid - normal * thick / 2
    i = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    first = np.concatenate([
        np.stack([i, i + 1, i + columns + 1], -1), np.stack([i, i + columns + 1, i + columns], -1),
    ])  # fmt: skip
    n = rows * columns
    last = n - columns
    rim = np.concatenate([
        np.arange(columns - 1), np.arange(rows - 1) * columns + columns - 1,
        last + np.arange(columns - 1, 0, -1), np.arange(rows - 1, 0, -1) * columns,
    ])  # fmt: skip
    after = np.roll(rim, -1)
    sides = np.concatenate([
        np.stack([rim, rim + n, after + n], -1), np.stack([rim, after + n, after], -1),
    ])  # fmt: skip
    points = np.concatenate([upper.reshape(-1, 3), lower.reshape(-1, 3)])
    faces = np.concatenate([first, first[:, ::-1] + n, sides])
    return creased("sheet", points, faces, np.radians(75))


def draped(
    w: float, d: float, drop: float, thick: float, *, folds: float = 0.012, wave: float = 1.0,
    n: int = 14,
) -> Surface:  # fmt: skip
    """A cover over the left, right and front edge of what is w wide and d deep about the origin.

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
    # On top it lies in soft waves.
    swell = np.sin(7.1 * wave * x / w + 2.3 * z / d) + np.sin(5.3 * wave * z / d - 3.1 * x / w)
    swell *= 0.35 * folds * (1 - share)
    to_side, to_front = np.sign(x) * (fall_x >= fall_z), 1.0 * (fall_z > fall_x)
    grid = np.stack([x + ripple * to_side, swell - fall, z + ripple * to_front], -1)
    return sheet(grid[::-1], thick)


def _over_edge(at: F64, half: float) -> tuple[F64, F64]:
    """(place across, how far it hangs) of cloth that lies up to half either way and hangs below."""
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
            (outer, y), (outer, tall - e), (outer * 0.75 + mid * 0.25, tall - 0.3 * e), (mid, tall),
            (inner * 0.75 + mid * 0.25, tall - 0.3 * e), (inner, tall - e), (inner, y),
        ]  # fmt: skip
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
    z = np.r_[d / 2 - 0.01, np.linspace(d / 2 - 0.04, -d / 2 + 0.16, 6), -d / 2 + 0.1,
              np.linspace(-d / 2 + 0.065, -d / 2 + thick / 2 + 0.003, 7)]  # fmt: skip
    top = high - thick / 2 - 0.002
    low = seat - thick / 2
    y = np.r_[low - 0.025, np.full(6, low) - 0.012 * np.sin(np.linspace(0, np.pi, 6)), low + 0.03,
              np.linspace(low + 0.09, top, 7)]  # fmt: skip
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


# Normals that break at sharp edges.


def creased(name: str, points: F64, faces: I32, sharp_rad: float) -> Surface:
    """A surface whose normals are means of faces that turn by less than sharp_rad, by area."""
    faces = np.asarray(faces, np.int64)
    corners = points[faces]
    area = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    size = np.linalg.norm(area, axis=1)
    faces, area, size = faces[size > 1e-12], area[size > 1e-12], size[size > 1e-12]
    unit = area / size[:, None]
    # All pairs of corners at one vertex.
    vertex = faces.ravel()
    order = np.argsort(vertex, kind="stable")
    count = np.bincount(vertex, minlength=len(points))
    start = np.concatenate([[0], np.cumsum(count)[:-1]])
    repeats = count[vertex]
    a = np.repeat(np.arange(len(vertex)), repeats)
    within = np.arange(len(a)) - np.repeat(np.cumsum(repeats) - repeats, repeats)
    b = order[np.repeat(start[vertex], repeats) + within]
    soft = (unit[a // 3] * unit[b // 3]).sum(1) > np.cos(sharp_rad)
    normals = np.zeros((len(vertex), 3))
    for k in range(3):
        normals[:, k] = np.bincount(a[soft], area[b[soft] // 3, k], len(vertex))
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    # One vertex for each place and normal.
    key = np.concatenate([vertex[:, None], np.rint(normals * 1e4).astype(np.int64)], 1)
    _, first, number = np.unique(key, axis=0, return_index=True, return_inverse=True)
    return Surface(
        name, points[vertex[first]].astype(np.float32),
        number.reshape(-1, 3).astype(np.int32), 0, None, normals[first].astype(np.float32),
    )  # fmt: skip


SOLIDS: Final = {
    "bevelled": bevelled, "rounded": rounded, "loft": loft, "board": board, "disc": disc,
    "tube": tube, "square_tube": square_tube, "hoop": hoop, "tub": tub, "chair_shell": chair_shell, "draped": draped, "hanging": hanging,
}  # fmt: skip

OUTLINES: Final = {
    "oval": oval, "rect": rect, "d_shape": d_shape, "fluted": fluted, "bent": bent, "ring_path": ring_path,
}  # fmt: skip
