"""Small closed meshes in the world frame: boxes, cylinders, spheres, wall prisms; no effects.

Every solid's faces are counter-clockwise seen from outside. Texture coordinates are in metres.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations, pairwise

import numpy as np

from pbrs_farm.core.arrays import F64, I32, I64, Points2
from pbrs_farm.core.house import Surface
from pbrs_farm.core.mesh import cross_products, unit_vectors

Triple = tuple[float, float, float]

# Corner i of a box has the sign of bit k of i along axis k; quads seen from outside.
_BOX_QUADS = np.array(
    [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]]
)
_SIGNS = np.array([[1 if i >> k & 1 else -1 for k in range(3)] for i in range(8)])
_QUAD = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
_BOX_FACES = (_QUAD + 4 * np.arange(6, dtype=np.int32)[:, None, None]).reshape(-1, 3)


def boxes_surface(name: str, boxes: Sequence[tuple[Triple, Triple]], material: int) -> Surface:
    """A surface of axis-aligned boxes by low and high corner, metres, inner faces kept."""
    corners = np.asarray(boxes, np.float64).reshape(-1, 2, 3)
    quads = [box_quads((low + high) / 2, (high - low) / 2) for low, high in corners]
    return quads_surface(name, np.concatenate(quads), material)


def quads_surface(name: str, quads: F64, material: int) -> Surface:
    """A surface of planar quads (N, 4, 3), counter-clockwise from outside, uv in metres from corner 0."""
    quads = np.asarray(quads, np.float64).reshape(-1, 4, 3)
    # Lay u along the first edge, v at right angles to it in the quad's plane.
    u = unit_vectors(quads[:, 1] - quads[:, 0])
    normal = cross_products(u, quads[:, 3] - quads[:, 0])
    v = unit_vectors(cross_products(normal, u))
    local = quads - quads[:, :1]
    uvs = np.empty((len(quads), 4, 2))
    for k, axis in enumerate((u, v)):
        x, y, z = np.moveaxis(local * axis[:, None], -1, 0)
        uvs[..., k] = x + y + z + 0.0  # no negative zero, as of numpy's sum
    faces = _faces_of_quads(len(quads))
    return Surface(
        name,
        quads.reshape(-1, 3).astype(np.float32),
        faces,
        material,
        uvs.reshape(-1, 2).astype(np.float32),
    )


def _faces_of_quads(n: int) -> I32:
    if n == len(_BOX_FACES) // 2:
        return _BOX_FACES.copy()
    faces = _QUAD[None] + 4 * np.arange(n, dtype=np.int32)[:, None, None]
    return np.asarray(faces.reshape(-1, 3), np.int32)


def box_quads(centre: F64, half: F64, axes: F64 | None = None) -> F64:
    """(6, 4, 3) outward quads of a box; centre, half: (3,); axes: (3, 3), right-handed, or the world's."""
    axes = np.eye(3) if axes is None else axes
    corners = np.asarray(centre) + (_SIGNS * np.asarray(half)) @ axes.T
    return np.asarray(corners[_BOX_QUADS], np.float64)


def box(name: str, centre: F64, half: F64, material: int, *, axes: F64 | None = None) -> Surface:
    """A closed box of 24 vertices, sharp edges, uv in metres; axes: (3, 3), right-handed, or the world's."""
    return quads_surface(name, box_quads(centre, half, axes), material)


def lathe(name: str, profile: F64, centre: F64, material: int, *, n: int = 16) -> Surface:
    """The (radius, height) profile (P, 2), bottom to top, turned about the vertical, smooth around."""
    angles = 2 * np.pi * np.arange(n + 1) / n
    around = np.stack([np.cos(angles), np.zeros(n + 1), -np.sin(angles)], -1)
    # Close the ring exactly.
    around[-1] = around[0]
    positions, normals, faces, uvs = [], [], [], []
    # Turn each stretch of the profile into a ring of quads, or of triangles at the axis.
    for k, ((r0, y0), (r1, y1)) in enumerate(pairwise(profile)):
        ring = [around * r + [0, y, 0] + centre for r, y in ((r0, y0), (r1, y1))]
        # Stand the normal on the stretch.
        slope = unit_vectors(around * (y1 - y0) + np.array([0, r0 - r1, 0]))
        base = k * 2 * (n + 1)
        i = np.arange(n) + base
        j = i + n + 1
        if r0 > 0:
            faces.append(np.stack([i, i + 1, j + (r1 > 0)], -1))
        if r1 > 0:
            faces.append(np.stack([i, j + 1, j], -1))
        positions += ring
        normals += [slope, slope]
        length = angles * max(r0, r1)
        uvs += [np.stack([length, np.full(n + 1, y)], -1) for y in (y0, y1)]
    return Surface(
        name,
        np.concatenate(positions).astype(np.float32),
        np.concatenate(faces).astype(np.int32),
        material,
        np.concatenate(uvs).astype(np.float32),
        np.concatenate(normals).astype(np.float32),
    )


def sphere(name: str, centre: F64, radius: float, material: int, *, n: int = 16) -> Surface:
    """A closed, inscribed sphere with smooth normals, n segments around; radius in metres."""
    angles = np.linspace(-np.pi / 2, np.pi / 2, n // 2 + 1)
    profile = radius * np.stack([np.cos(angles), np.sin(angles)], -1)
    profile[[0, -1], 0] = 0.0
    surface = lathe(name, profile, centre, material, n=n)
    # Replace the stretches' normals by those of the sphere.
    outward = surface.positions - np.asarray(centre, np.float32)
    outward = outward / np.linalg.norm(outward, axis=1, keepdims=True)
    return replace(surface, normals=outward.astype(np.float32))


def wall_prism(
    left: Points2,
    right: Points2,
    bottom_y: float,
    left_top_y: F64,
    right_top_y: F64,
    materials: tuple[int, int, int],
    *,
    top: int | None = None,
) -> tuple[Surface, ...]:
    """A wall as a closed solid: surfaces left, right, top, bottom, start, end.

    left, right: (N, 2) plan points from the wall's start to its end. *_top_y: (N,) heights.
    materials: of the left side, the right side, and the rest (with the top, unless top is given).
    u runs to the right of who looks at the side, v is the height above the wall's bottom.
    """
    left_low, right_low = _lifted(left, bottom_y), _lifted(right, bottom_y)
    left_high, right_high = _lifted(left, left_top_y), _lifted(right, right_top_y)
    rest = materials[2]
    # Close the two ends.
    start = np.stack([left_low[0], right_low[0], right_high[0], left_high[0]])
    end = np.stack([right_low[-1], left_low[-1], left_high[-1], right_high[-1]])
    return (
        _side("left", left_low[::-1], left_high[::-1], materials[0]),
        _side("right", right_low, right_high, materials[1]),
        quads_surface("top", _quads_between(right_high, left_high), rest if top is None else top),
        quads_surface("bottom", _quads_between(left_low, right_low), rest),
        quads_surface("start", start, rest),
        quads_surface("end", end, rest),
    )


def _lifted(plan: Points2, y: F64 | float) -> F64:
    points = np.empty((len(plan), 3))
    points[:, 0], points[:, 1], points[:, 2] = plan[:, 0], y, plan[:, 1]
    return points


def _quads_between(near: F64, far: F64) -> F64:
    # Quads between two polylines; counter-clockwise if far is left of near's direction.
    return np.stack([near[:-1], near[1:], far[1:], far[:-1]], 1)


def _side(name: str, low: F64, high: F64, material: int) -> Surface:
    surface = quads_surface(name, _quads_between(low, high), material)
    # Measure u along the side in plan, v from the wall's bottom.
    steps = np.linalg.norm(np.diff(low[:, [0, 2]], axis=0), axis=1)
    u = np.concatenate([[0.0], np.cumsum(steps)])
    corner_u = np.stack([u[:-1], u[1:], u[1:], u[:-1]], 1).ravel()
    corner_v = surface.positions[:, 1] - low[0, 1]
    return replace(surface, uvs=np.stack([corner_u, corner_v], -1).astype(np.float32))


def icosphere_mesh(corners: F64, n_splits: int) -> tuple[F64, I64]:
    """(unit vertices, faces of either winding) of the icosahedron of 12 unit corners, edges halved n_splits times."""
    near = np.linalg.norm(corners[:, None] - corners[None], axis=2) < 1.2  # an edge is 1.05 long
    faces = np.array([f for f in combinations(range(12), 3) if near[np.ix_(f, f)].all()])
    unit = corners
    for _ in range(n_splits):
        unit, faces = _split_parts(unit, faces)
    return unit, faces


def _split_parts(unit: F64, faces: I64) -> tuple[F64, I64]:
    # Make one middle vertex for the two faces of an edge, on the sphere.
    edges = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    pairs, inverse = np.unique(edges, axis=0, return_inverse=True)
    middle = unit_vectors(unit[pairs].mean(1))
    ab, bc, ca = np.ravel(inverse).reshape(3, -1) + len(unit)
    # Put four faces in the place of each.
    a, b, c = faces.T
    parts = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
    return np.concatenate([unit, middle]), np.concatenate([np.stack(p, 1) for p in parts])
