"""How deep two meshes enter each other: by edges through faces, by rays, and by the solid they share; no effects."""

from __future__ import annotations

from typing import Any, Final

import manifold3d
import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.mesh import area_vectors, cross_products, triangle_bounds
from pbrs_farm.dress.gates.bodies import Shell

_STEEP: Final = (
    0.5  # minimum cosine of edge and normal: an edge that grazes a round shape crosses nothing
)
_PAIRS: Final = 1_000_000  # edge-face pairs per batch, to bound memory


def crossing_m(a: Shell, b: Shell, least_m: float) -> float:
    """Largest length, twice least_m or more, of an edge of a on both sides of a face of b, metres; or 0."""
    start, end = _edges_near(a, b, 2 * least_m)
    corners = b.corners
    low, high = triangle_bounds(corners)
    near = ((low <= a.high) & (high >= a.low)).all(1)
    corners, low, high = corners[near], low[near], high[near]
    best = 0.0
    step = max(1, _PAIRS // max(len(corners), 1))
    for first in range(0, len(start), step):
        s, e = start[first : first + step], end[first : first + step]
        least, most = np.minimum(s, e), np.maximum(s, e)
        meets = np.ones((len(s), len(corners)), np.bool_)
        for k in range(3):
            meets &= (least[:, k, None] <= high[:, k]) & (most[:, k, None] >= low[:, k])
        i, j = np.nonzero(meets)
        best = max(best, float(_either_side(s[i], e[i], corners[j]).max(initial=0.0)))
    return best


def _edges_near(a: Shell, b: Shell, least_m: float) -> tuple[F64, F64]:
    """The ends of a's edges whose boxes meet b's, long ones alone."""
    pairs = np.sort(np.concatenate([a.faces[:, [0, 1]], a.faces[:, [1, 2]], a.faces[:, [2, 0]]]))
    # Number the pairs: faster than comparing them column by column, and in the same order.
    n = len(a.vertices)
    first, last = np.divmod(np.unique(pairs[:, 0] * n + pairs[:, 1]), n)
    start, end = a.vertices[first], a.vertices[last]
    meets = ((np.minimum(start, end) <= b.high) & (np.maximum(start, end) >= b.low)).all(1)
    meets &= np.linalg.norm(end - start, axis=1) > least_m
    return start[meets], end[meets]


def _either_side(start: F64, end: F64, corners: F64) -> F64:
    """(N,) the shorter part of each edge beyond its triangle (N, 3, 3); 0 where it does not cross."""
    along = end - start
    length = np.linalg.norm(along, axis=1)
    normal = area_vectors(corners)
    size = np.linalg.norm(normal, axis=1)
    slope = (along * normal).sum(1)
    steep = np.abs(slope) > _STEEP * length * size
    t = ((corners[:, 0] - start) * normal).sum(1) / np.where(steep, slope, 1.0)
    place = start + t[:, None] * along
    inside = steep & (t > 0) & (t < 1)
    # A point inside is on the same side of all three edges.
    for k in range(3):
        edge = corners[:, (k + 1) % 3] - corners[:, k]
        inside &= (cross_products(edge, place - corners[:, k]) * normal).sum(1) >= 0
    return np.where(inside, np.minimum(t, 1 - t) * length, 0.0)


_NUDGE: Final = np.array([1.7e-6, 2.9e-6])  # metres: rays pass beside edges that triangles share
_CHUNK: Final = 2_000_000  # point-triangle pairs per batch


def depths_inside(points: F64, corners: F64) -> F64:
    """(P,) metres from points (P, 3) to the nearest face along the axes, 0 for a point outside.

    corners: (F, 3, 3) one connected mesh. Inside means covered from above and on all four sides by an
    odd number of faces: a body without a bottom is full, a bowl is empty.
    """
    inside = np.ones(len(points), bool)
    depth = np.full(len(points), np.inf)
    for axis in (1, 0, 2):
        inside_numbers = np.flatnonzero(inside)
        if not len(inside_numbers):
            break
        n_ahead, ahead, n_behind, behind = _crossings_along(points[inside_numbers], corners, axis)
        odd_ahead, odd_behind = n_ahead % 2 == 1, n_behind % 2 == 1
        inside[inside_numbers] &= odd_ahead if axis == 1 else odd_ahead & odd_behind
        nearest = np.minimum(ahead, np.where(odd_behind, behind, np.inf))
        depth[inside_numbers] = np.minimum(depth[inside_numbers], nearest)
    return np.where(inside & np.isfinite(depth), depth, 0.0)


def _crossings_along(
    points: F64, corners: F64, axis: int
) -> tuple[NDArray[np.int64], F64, NDArray[np.int64], F64]:
    """Faces ahead of and behind each point along an axis: how many, and how far the nearest."""
    u, v = (k for k in range(3) if k != axis)
    plan = points[:, [u, v]] + _NUDGE
    # Keep triangles that some ray can meet.
    low, high = triangle_bounds(corners[:, :, [u, v]])
    meets = ((low <= plan.max(0)) & (high >= plan.min(0))).all(1)
    corners, low, high = corners[meets], low[meets], high[meets]
    n, far = len(points), np.full(len(points), np.inf)
    n_ahead, n_behind = np.zeros(n, np.int64), np.zeros(n, np.int64)
    ahead, behind = far.copy(), far.copy()
    step = max(1, _CHUNK // max(n, 1))
    for first in range(0, len(corners), step):
        part = slice(first, first + step)
        i, j = np.nonzero(
            (plan[:, None] >= low[None, part]).all(-1) & (plan[:, None] <= high[None, part]).all(-1)
        )
        t = _met(plan[i], corners[part][j], u, v, axis) - points[i, axis]
        for rows, count, nearest in ((t > 0, n_ahead, ahead), (t <= 0, n_behind, behind)):
            np.add.at(count, i[rows], 1)
            np.minimum.at(nearest, i[rows], np.abs(t[rows]))
    return n_ahead, ahead, n_behind, behind


def _met(plan: F64, corners: F64, u: int, v: int, axis: int) -> F64:
    """(N,) where the line through a plan point (N, 2) meets its triangle (N, 3, 3); NaN = it does not."""
    a, b, c = (corners[:, k][:, [u, v]] for k in range(3))
    ab, ac, ap = b - a, c - a, plan - a
    det = ab[:, 0] * ac[:, 1] - ab[:, 1] * ac[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        s = (ap[:, 0] * ac[:, 1] - ap[:, 1] * ac[:, 0]) / det
        t = (ab[:, 0] * ap[:, 1] - ab[:, 1] * ap[:, 0]) / det
        inside = (s >= 0) & (t >= 0) & (s + t <= 1)
        height = corners[:, 0, axis] + s * (corners[:, 1, axis] - corners[:, 0, axis])
        height = height + t * (corners[:, 2, axis] - corners[:, 0, axis])
    return np.where(inside, height, np.nan)


_LEAST_M3: Final = 1e-8  # smaller shared volumes are rounding
_MANY: Final = 48  # directions that a solid's width is measured in


class Solids:
    """Closed shells as solids, each made once."""

    def __init__(self) -> None:
        self._made: dict[int, tuple[Shell, Any]] = {}

    def shared(self, a: Shell, b: Shell) -> list[F64]:
        """Parts, as triangles (F, 3, 3), that two closed shells share; [] for open ones or specks."""
        solid_a, solid_b = self._solid(a), self._solid(b)
        if solid_a is None or solid_b is None:
            return []
        # Intersect the solids (manifold's ^); specks below the least volume are rounding.
        common = solid_a ^ solid_b
        if common.is_empty() or common.volume() < _LEAST_M3:
            return []
        parts = []
        for part in common.decompose():
            mesh = part.to_mesh()
            points = np.asarray(mesh.vert_properties, np.float64)[:, :3]
            parts.append(np.asarray(points[np.asarray(mesh.tri_verts)]))
        return parts

    def _solid(self, shell: Shell) -> Any:
        # manifold3d ends the process on open meshes: closed shells alone are given to it.
        assert shell.is_closed
        cached = self._made.get(id(shell))
        if cached is None or cached[0] is not shell:
            mesh = manifold3d.Mesh(shell.vertices.astype(np.float32), shell.faces.astype(np.uint32))
            solid = manifold3d.Manifold(mesh)
            good = solid.status() == manifold3d.Error.NoError
            cached = (shell, solid if good else None)
            self._made[id(shell)] = cached
        return cached[1]


def thickness(corners: F64) -> float:
    """Least width across faces of a closed solid (F, 3, 3), metres, of a bent skin about its thickness."""
    vectors = area_vectors(corners)
    areas = np.linalg.norm(vectors, axis=1)
    surface = float(areas.sum()) / 2
    if surface <= 0:
        return 0.0
    # The divergence theorem: a sixth of the sum of corner times (twice the area) vectors.
    points = corners.reshape(-1, 3) - corners[0, 0]
    volume = abs(float(np.einsum("ij,ij->i", points[0::3], vectors).sum())) / 6
    # The least width across the solid, along the normals of its largest faces.
    largest = np.argsort(-areas, kind="stable")[:_MANY]
    normals = vectors[largest] / np.maximum(areas[largest, None], 1e-30)
    width = float(np.ptp(points @ normals.T, axis=0).min())
    return min(width, 6 * volume / surface)
