"""Closed bodies that furniture is built of: boxes, turned bodies, lofts, tubes; no effects.

Metres, y up. Every body is closed, its faces counter-clockwise seen from outside, with normals that
bend over soft edges and break at sharp ones.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F64, I32, I64, Bools
from pbrs_farm.core.house import Surface
from pbrs_farm.core.mesh import area_vectors, cross_products, lengths, unit_vectors
from pbrs_farm.geometry import solids
from pbrs_farm.geometry.outlines import Outline, Profile, Triple, oval, rect

HALF_TURN: Final[F64] = np.diag([-1.0, 1.0, -1.0])  # about the vertical

_SHARP_RAD: Final = np.radians(50)  # where a surface turns by more it has an edge


def _surface(
    name: str, points: F64, faces: NDArray[np.integer], normals: NDArray[np.floating]
) -> Surface:
    """A surface of the first material, in single precision."""
    floats = points.astype(np.float32), normals.astype(np.float32)
    return Surface(name, floats[0], faces.astype(np.int32), 0, None, floats[1])


def slab(low: Sequence[float], high: Sequence[float]) -> Surface:
    """An axis-aligned closed box between two corners, metres."""
    a, b = np.asarray(low, np.float64), np.asarray(high, np.float64)
    return solids.box("box", (a + b) / 2, (b - a) / 2, 0)


def box(centre: Triple, half: Triple) -> Surface:
    """An axis-aligned closed box about a point, half as wide, high and deep, metres."""
    return solids.box("box", np.array(centre), np.array(half), 0)


def sphere(centre: Triple, radius: float, *, n: int = 16) -> Surface:
    """A ball, n sides round."""
    return solids.sphere("sphere", np.asarray(centre, np.float64), radius, 0, n=n)


def bevelled(low: Sequence[float], high: Sequence[float], r: float = 0.003) -> Surface:
    """A box between two corners, its edges cut by r: 44 triangles."""
    a, b = np.asarray(low, np.float64), np.asarray(high, np.float64)
    half = np.maximum((b - a) / 2, 1e-4)
    cut = min(float(r), 0.4 * float(half.min()))
    inner = half - cut
    # Vertex (axis, side, i, j) belongs to the face of that axis and side.
    points = _BEVEL_SIGNS * np.where(_BEVEL_IS_OUT, half, inner) + (a + b) / 2
    return _surface("bevelled", points, _BEVEL_FACES, _BEVEL_NORMALS)


def _bevel_mesh() -> tuple[F64, Bools, I32]:
    """Signs (24, 3), which coordinate is out (24, 3), faces (44, 3)."""
    corners = [(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
    rows = [(axis, corner) for axis in range(3) for corner in corners]
    number = {row: k for k, row in enumerate(rows)}

    def at(axis: int, along: int, u: int, v: int, of: int) -> int:
        # The vertex on the face of axis `of` at the corner with sign `along` on `axis`.
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
    faces: list[NDArray[np.integer]] = []
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
            triangles = np.concatenate([grid[:, [0, 1, 2]], grid[:, [0, 2, 3]]])
            faces.append(triangles if side > 0 else triangles[:, ::-1])
    corners, directions = np.concatenate(points), np.concatenate(normals)
    return _surface("rounded", corners, np.concatenate(faces), directions)


def revolve(profile: Profile | F64, *, n: int = 16) -> Surface:
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
    mean = outward[:-1] + outward[1:]
    mean /= np.maximum(np.linalg.norm(mean, axis=1, keepdims=True), 1e-12)
    begin, end = outward.copy(), outward.copy()
    begin[1:][soft] = mean[soft]
    end[:-1][soft] = mean[soft]
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


def cylinder(r: float, low: float, high: float, *, n: int = 16) -> Surface:
    """An upright cylinder about the axis between two heights."""
    return frustum((r, low), (r, high), n=n)


def frustum(low: tuple[float, float], high: tuple[float, float], *, n: int = 16) -> Surface:
    """A cone without its tip: (radius, height) of its lower and of its upper end."""
    return revolve([(0.0, low[1]), low, high, (0.0, high[1])], n=n)


def vessel(outside: Profile, wall_m: float, *, n: int = 16) -> Surface:
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
    return revolve(profile[moves], n=n)


def loft(rings: Sequence[tuple[Outline, float]], *, sharp: float = 50.0) -> Surface:
    """The body through outlines (all of so many points) at heights, its ends closed.

    Upwards outside; down again inside for a vessel. sharp: degrees of turning that make an edge.
    """
    places = np.array([[(x, y, z) for x, z in outline] for outline, y in rings], np.float64)
    k, n = places.shape[:2]
    middles = np.stack([places[0].mean(0), places[-1].mean(0)])
    points = np.concatenate([places.reshape(-1, 3), middles])
    return creased("loft", points, _faces_of_rings(k, n), np.radians(sharp))


def _faces_of_rings(k: int, n: int) -> I64:
    """Faces around k rings of n points, one after another, closed by the middles of the first and the last."""
    i = np.arange(n)
    j = (i + 1) % n
    faces = []
    for row in range(k - 1):
        a, b = row * n, (row + 1) * n
        faces += [np.stack([a + i, a + j, b + j], -1), np.stack([a + i, b + j, b + i], -1)]
    top = (k - 1) * n
    faces += [np.stack([np.full(n, k * n), j, i], -1)]
    faces += [np.stack([np.full(n, k * n + 1), top + i, top + j], -1)]
    return np.concatenate(faces)


def board(
    w: float,
    d: float,
    low: float,
    high: float,
    corner: float = 0.0,
    edge: float = 0.003,
    *,
    x: float = 0.0,
    z: float = 0.0,
    n: int = 4,
) -> Surface:
    """A board with round corners in plan and edges cut by `edge`: tops of tables, seats, lids."""
    e = min(edge, 0.45 * (high - low))
    small = rect(w - 2 * e, d - 2 * e, max(corner - e, 0.0005), x=x, z=z, n=n)
    wide = rect(w, d, max(corner, e), x=x, z=z, n=n)
    return loft([(small, low), (wide, low + e), (wide, high - e), (small, high)])


def disc(
    w: float,
    d: float,
    low: float,
    high: float,
    edge: float = 0.003,
    *,
    x: float = 0.0,
    z: float = 0.0,
    n: int = 32,
    power: float = 2.0,
) -> Surface:
    """A round or oval board with its edges cut by `edge`."""
    e = min(edge, 0.45 * (high - low))
    small = oval(w - 2 * e, d - 2 * e, x=x, z=z, n=n, power=power)
    wide = oval(w, d, x=x, z=z, n=n, power=power)
    return loft([(small, low), (wide, low + e), (wide, high - e), (small, high)])


def tube(path: Sequence[Triple], r: float, *, n: int = 8, end: float | None = None) -> Surface:
    """A round bar along a path, closed at both ends; end: its radius there where it tapers."""
    points = np.asarray(path, np.float64)
    step = unit_vectors(np.diff(points, axis=0))
    along = unit_vectors(np.concatenate([step[:1], step[:-1] + step[1:], step[-1:]]))
    # Carry one direction across along the path, so that the tube does not twist.
    aside = (0.0, 1.0, 0.0) if abs(along[0, 1]) < 0.9 else (1.0, 0.0, 0.0)
    side = cross_products(along[0], np.array(aside))
    t = 2 * np.pi * np.arange(n) / n
    rings = []
    for k, direction in enumerate(along):
        side = side - direction * float(side @ direction)
        side = side / max(float(np.linalg.norm(side)), 1e-12)
        up = cross_products(side, direction)
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
    return creased("tube", places, _faces_of_rings(len(rings), n)[:, [0, 2, 1]], _SHARP_RAD)


def hoop(outline: Outline, y: float, r: float, *, n: int = 6) -> Surface:
    """A closed ring of round section along an outline at a height."""
    path = np.array([(x, y, z) for x, z in outline], np.float64)
    step = unit_vectors(np.roll(path, -1, 0) - np.roll(path, 1, 0))
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
    return _surface("bar", points, bar.faces, normals)


def stretched(surface: Surface, size: tuple[float, float, float]) -> Surface:
    """A body stretched along the axes."""
    scale = np.asarray(size)
    # Normals scale by the inverse, so that they stay at right angles to the surface.
    normals = unit_vectors(np.asarray(surface.normals, np.float64) / scale)
    points = surface.positions.astype(np.float64) * scale
    return _surface(surface.name, points, surface.faces, normals)


def sheared(surface: Surface, foot: tuple[float, ...], top: tuple[float, ...]) -> Surface:
    """Shear an upright body 1 m high into a leg from foot to top; level edges stay level."""
    shear = np.eye(3)
    shear[:, 1] = np.asarray(top) - foot
    points = surface.positions.astype(np.float64) @ shear.T + np.asarray(foot)
    return smooth(surface.name, points, surface.faces)


def smooth(name: str, points: F64, faces: I32) -> Surface:
    """A surface whose shading normals are the mean of its faces', by area."""
    corners = points[faces]
    n = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals = np.zeros_like(points)
    for k in range(3):
        np.add.at(normals, faces[:, k], n)
    return _surface(name, points, faces, unit_vectors(normals))


def creased(name: str, points: F64, faces: NDArray[np.integer], sharp_rad: float) -> Surface:
    """A surface whose normals are means of faces that turn by less than sharp_rad, by area."""
    faces = np.asarray(faces, np.int64)
    corners = points[faces]
    area = area_vectors(corners)
    size = lengths(area)
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
    normals = unit_vectors(normals)
    # One vertex for each place and normal: one number for both, in the order of rows.
    key = vertex
    for column in np.rint(normals * 1e4).astype(np.int64).T:
        key = (key << 15) + (column + (1 << 14))
    _, first, number = np.unique(key, return_index=True, return_inverse=True)
    return _surface(name, points[vertex[first]], number.reshape(-1, 3), normals[first])
