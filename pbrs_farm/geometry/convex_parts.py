"""Convex decomposition of a mesh for collision: exact for boards and legs, CoACD for the rest; no effects."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import ConvexHull, QhullError, cKDTree

from pbrs_farm.core.arrays import F64, I64, Bools
from pbrs_farm.core.errors import MachineFailed
from pbrs_farm.core.frames import rotation_y
from pbrs_farm.core.mesh import (
    area_vectors,
    closed_edge_share,
    face_areas,
    lengths,
    numbered_points,
    signed_volume,
    unit_normals,
)
from pbrs_farm.geometry.connected import connected_faces
from pbrs_farm.geometry.surface_points import spread_points
from pbrs_farm.installation import install_command

_NEARLY_CONVEX = 0.95  # share of its hull that a mesh fills which needs no decomposition
_MOST_MOVES = 200  # of a point back into a hull, plane by plane
_BEYOND_M = 1e-6  # of a hull, where a point may stay
_FLAT_M = 5e-4  # half the thickness given to a flat mesh, metres
_SPACING_M = 0.008  # spacing of the surface samples that hulls are compared with, metres
_MOST_POINTS, _FEW = 200_000, 2_000
_HULL_SPACING_M, _HULL_STEPS = 0.02, 16  # of points on hulls
_FAR_M = 0.03  # distances beyond this are approximate, metres
_CLOSED = 0.9  # share of paired edges from which triangles bound a solid
_LEAST_WIDE_M = 0.004  # thinner parts are not cut across, metres
_HOLLOW = 0.2  # what depth of hollows counts beside volume, in choosing a cut
_SLIVER_M = 1e-3  # narrower faces get no slab, metres
_LEVEL = 0.99  # minimum cosine between a face's normal and an axis to count as perpendicular to it
_SAME_M = 1e-3  # faces that near lie in one plane
_MOST_PLANES = 1  # along an axis, beside its middle
_STRAIGHT = 0.5  # minimum share of axis-aligned faces for a mesh to keep its axes


def connected(triangles: F64) -> list[F64]:
    """Triangles (F, 3, 3) by what hangs together: corners nearer than 0.01 mm are one."""
    corners = numbered_points(triangles.reshape(-1, 3).round(5))[1].reshape(-1, 3)
    part_of_face = connected_faces(corners)
    return [triangles[part_of_face == k] for k in np.unique(part_of_face)]


@dataclass(frozen=True, slots=True, eq=False)
class _Part:
    """Triangles that one hull holds."""

    groups: tuple[F64, ...]  # (F, 3, 3) each, which hang together
    hull: F64  # (V, 3)
    beyond_m: float  # distance that the hull extends beyond the mesh, metres


def close_parts(triangles: F64, *, within_m: float = 0.005, most: int = 32) -> tuple[F64, ...]:
    """Decompose triangles (F, 3, 3) into convex parts (V, 3); returns at least one part.

    Connected components are separated, then cut along their axes, worst first, until no hull extends
    more than within_m beyond the mesh or there are `most` parts. Up to 4 x `most` components stay
    apart, so that no shelf of a wide bookcase is filled. Hollows stay open; boards and legs are
    reproduced exactly.
    """
    turn = rotation_y(_level_turn(triangles))
    groups = [_fronts_outwards(group) for group in connected(triangles @ turn)]
    thing = _Thing.of(groups, within_m)
    if len(groups) <= 4 * most:
        parts = [thing.part((group,)) for group in groups]
    else:
        parts = [thing.part(tuple(groups))]
    done: list[_Part] = []
    while parts and len(parts) + len(done) < most:
        part = parts.pop(max(range(len(parts)), key=lambda k: parts[k].beyond_m))
        halves = thing.halves(part) if part.beyond_m > within_m else ()
        if halves:
            parts += halves
        else:
            done.append(part)
    return tuple(part.hull @ turn.T for part in (*done, *parts))


@dataclass(frozen=True, slots=True, eq=False)
class _Thing:
    """Surface samples of a mesh, to measure hulls against."""

    points: F64  # (N, 3)
    normals: F64  # (N, 3) unit, outwards of solids
    bounds_solid: Bools  # (N,)
    spacing_m: float  # of the points
    tree: cKDTree[None]
    few: tuple[
        cKDTree[None], I64
    ]  # a tree of some of the points, quick to ask from far, their numbers
    within_m: float

    @classmethod
    def of(cls, groups: Sequence[F64], within_m: float) -> _Thing:
        triangles = np.concatenate(groups)
        spacing_m = max(_SPACING_M, float(np.sqrt(face_areas(triangles).sum() / _MOST_POINTS)))
        points, which = spread_points(triangles, spacing_m)
        solid = np.repeat([_is_solid(g) for g in groups], [len(g) for g in groups])
        some = np.arange(0, len(points), max(1, len(points) // _FEW))
        few = cKDTree(points[some]), some
        normals = unit_normals(triangles)[which]
        return cls(points, normals, solid[which], spacing_m, cKDTree(points), few, within_m)

    def part(self, groups: tuple[F64, ...]) -> _Part:
        points = np.concatenate(groups).reshape(-1, 3)
        hull = None if _is_flat(points) else hull_of(points)
        if hull is None:
            return _Part(groups, flat_part(points), 0.0)
        return _Part(groups, hull, self._beyond(hull))

    def _beyond(self, hull: F64) -> float:
        """Largest distance from the hull's faces to the mesh, on its outside."""
        corners = hull[hull_faces(hull)]
        if not len(corners):
            return 0.0
        points, _ = spread_points(corners, max(_HULL_SPACING_M, float(np.ptp(hull)) / _HULL_STEPS))
        nearest = self.tree.query(points, distance_upper_bound=_FAR_M)
        far, near = np.asarray(nearest[0]), np.asarray(nearest[1])
        lost = ~np.isfinite(far)
        if lost.any():
            tree, numbers = self.few
            nearest = tree.query(points[lost])
            far[lost], near[lost] = nearest[0], numbers[nearest[1]]
        above = ((points - self.points[near]) * self.normals[near]).sum(1)
        # Between points on a face, what counts is how far off its plane.
        far = np.where(far < self.within_m + self.spacing_m, np.abs(above), far)
        # Points deep inside a solid are also far from its faces.
        is_outside = (above >= 0) | ~self.bounds_solid[near]
        return float(far[is_outside].max(initial=0.0))

    def halves(self, part: _Part) -> tuple[_Part, ...]:
        """The part in two; () where nothing cuts it."""
        if len(part.groups) > 1:
            middles = np.array([(g.min((0, 1)) + g.max((0, 1))) / 2 for g in part.groups])
            order = np.argsort(middles[:, np.ptp(middles, axis=0).argmax()], kind="stable")
            ends = order[: len(order) // 2], order[len(order) // 2 :]
            return tuple(self.part(tuple(part.groups[k] for k in end)) for end in ends)
        (triangles,) = part.groups
        best: tuple[_Part, ...] = ()
        least, size = np.inf, float(np.linalg.norm(np.ptp(part.hull, axis=0)))
        for axis, place in _planes(triangles):
            sides = [half for half in _cut_in_two(triangles, axis, place) if len(half)]
            if len(sides) < 2:
                continue
            halves = tuple(self.part((half,)) for half in sides)
            # Halves to cut further, by volume; ties go to the smaller excess.
            candidates = [h for h in halves if h.beyond_m > self.within_m]
            cost = sum(hull_volume(h.hull) * (1 + _HOLLOW * h.beyond_m / size) for h in candidates)
            if cost < least:
                best, least = halves, cost
        return best


def slabs(triangles: F64, depth_m: float = 0.02) -> tuple[F64, ...]:
    """Convex slabs (V, 3) behind faces (F, 3, 3), one for the faces of a plane with a convex outline."""
    longest = lengths(triangles - np.roll(triangles, 1, axis=1)).max(1)
    triangles = triangles[2 * face_areas(triangles) > _SLIVER_M * longest]
    normals = unit_normals(triangles)
    offsets = (normals * triangles[:, 0]).sum(1)
    rows = np.column_stack([np.rint(normals * 500), np.rint(offsets / _SAME_M)])
    _, plane = np.unique(rows, axis=0, return_inverse=True)
    slab_parts = []
    for k in range(int(plane.max(initial=-1)) + 1):
        members = np.flatnonzero(plane == k)
        normal = normals[members[0]]
        outline = _outline(triangles[members].reshape(-1, 3), normal)
        whole = face_areas(triangles[members]).sum()
        faces = [outline[0]] if outline and outline[1] < 1.001 * whole else list(triangles[members])
        slab_parts += [np.concatenate([face, face - depth_m * normal]) for face in faces]
    return tuple(slab_parts)


def _outline(points: F64, normal: F64) -> tuple[F64, float] | None:
    """The convex outline of points in a plane, (V, 3) and its area; None where they lie in a line."""
    first = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
    first /= np.linalg.norm(first)
    plane = points @ np.stack([first, np.cross(normal, first)], -1)
    try:
        hull = ConvexHull(plane)
    except (QhullError, ValueError):
        return None
    return points[hull.vertices], float(hull.volume)


def _fronts_outwards(group: F64) -> F64:
    """Triangles (F, 3, 3) of a solid, turned over where they look inwards."""
    return group[:, ::-1] if signed_volume(group, group.mean((0, 1))) < 0 else group


def _is_solid(group: F64) -> bool:
    return closed_edge_share(group.round(5)) >= _CLOSED


def _planes(triangles: F64) -> Iterator[tuple[int, float]]:
    """Planes (axis, place) along which a part may be cut: its middle, and its largest level faces."""
    normals = area_vectors(triangles) / 2
    areas = lengths(normals)
    corners = triangles.reshape(-1, 3)
    for axis in range(3):
        low, high = corners[:, axis].min(), corners[:, axis].max()
        if high - low < 2 * _LEAST_WIDE_M:
            continue
        yield axis, float((low + high) / 2)
        level = np.abs(normals[:, axis]) > _LEVEL * areas
        bins = np.rint(triangles[level, :, axis].mean(1) / _SAME_M).astype(np.int64)
        places, which = np.unique(bins, return_inverse=True)
        weight = np.bincount(which, areas[level], len(places))
        inner = (places * _SAME_M > low + _SAME_M) & (places * _SAME_M < high - _SAME_M)
        for k in np.argsort(-weight * inner, kind="stable")[:_MOST_PLANES]:
            if inner[k]:
                # The place itself, not the middle of its step.
                positions = triangles[level, :, axis].mean(1)[which == k]
                yield axis, float(positions.mean())


def _cut_in_two(triangles: F64, axis: int, place: float) -> tuple[F64, F64]:
    """Split triangles by a plane; coplanar triangles go to the side behind their front."""
    return _above(triangles, axis, place, -1.0), _above(triangles, axis, place, 1.0)


def _above(triangles: F64, axis: int, place: float, sign: float) -> F64:
    height = sign * (triangles[..., axis] - place)
    inner = height >= -_BEYOND_M
    count = inner.sum(1)
    rises = height.max(1) > _BEYOND_M
    bounds = sign * area_vectors(triangles)[:, axis] < 0
    pieces = [triangles[(count == 3) & (rises | bounds)]]
    for n in (1, 2):
        # Turn each triangle so that its first corner is alone on its side.
        crossing, h = triangles[rises & (count == n)], height[rises & (count == n)]
        lonely = (inner[rises & (count == n)] == (n == 1)).argmax(1)
        rows = np.arange(len(crossing))
        (a, ha), (b, hb), (c, hc) = (
            (crossing[rows, (lonely + k) % 3], h[rows, (lonely + k) % 3]) for k in range(3)
        )
        on_ab = a + (b - a) * (ha / (ha - hb))[:, None]
        on_ac = a + (c - a) * (ha / (ha - hc))[:, None]
        if n == 1:
            pieces.append(np.stack([a, on_ab, on_ac], 1))
        else:
            pieces += [np.stack([on_ab, b, c], 1), np.stack([on_ab, c, on_ac], 1)]
    return np.concatenate(pieces)


def _level_turn(triangles: F64) -> float:
    """Rotation about y, radians, that aligns most upright faces with x and z."""
    normals = area_vectors(triangles)
    area = np.hypot(normals[:, 0], normals[:, 2])
    upright = area > _LEVEL * lengths(normals)
    if not upright.any():
        return 0.0
    # Directions that differ by a quarter turn are one: fold them, and take the commonest degree.
    angle = np.arctan2(normals[upright, 2], normals[upright, 0]) % (np.pi / 2)
    degree = np.rint(np.degrees(angle)).astype(np.int64) % 90
    weight = np.bincount(degree, area[upright], 90)
    best = int(weight.argmax())
    same = degree == best
    off = (angle[same] - np.radians(best) + np.pi / 4) % (np.pi / 2) - np.pi / 4
    turn = np.radians(best) + float(np.average(off, weights=area[upright][same]))
    return 0.0 if weight[0] >= _STRAIGHT * weight[best] else -turn


def _is_flat(points: F64) -> bool:
    off = points - points.mean(0)
    least = np.linalg.eigh(off.T @ off)[1][:, 0]
    return bool(np.ptp(off @ least) < _FLAT_M / 2)


def flat_part(points: F64) -> F64:
    """Points (N, 3) in a plane as a convex part a millimetre thick, those of its outline twice."""
    middle = points.mean(0)
    _, size, axes = np.linalg.svd(points - middle, full_matrices=False)
    if len(size) < 3 or size[1] < _BEYOND_M:
        return thickened(points)
    plane = (points - middle) @ axes[:2].T
    try:
        rim = points[ConvexHull(plane).vertices]
    except (QhullError, ValueError):
        return thickened(points)
    return np.concatenate([rim - _FLAT_M * axes[2], rim + _FLAT_M * axes[2]])


def convex_parts(triangles: F64, *, most: int = 24, threshold: float = 0.05) -> tuple[F64, ...]:
    """Convex parts (V, 3) of triangles, `most` at most, down to a concavity (CoACD); MachineFailed."""
    try:
        import coacd
    except ImportError:
        raise MachineFailed("physics needs coacd", hint=install_command("physics")) from None
    points = triangles.reshape(-1, 3)
    whole = hull_of(points)
    # Skip the decomposition of nearly convex meshes.
    volume = abs(signed_volume(triangles, np.zeros(3)))
    if whole is not None and volume > _NEARLY_CONVEX * ConvexHull(whole).volume:
        return (whole,)
    vertices, faces = np.unique(points.round(7), axis=0, return_inverse=True)
    coacd.set_log_level("error")
    mesh = coacd.Mesh(vertices, faces.reshape(-1, 3).astype(np.int32))
    result = coacd.run_coacd(mesh, threshold=threshold, max_convex_hull=most, seed=1)
    # CoACD works on a grown mesh, by a hundredth of its size: what rests on such parts hovers.
    parts_within = (
        clamped_to_hull(np.asarray(part, np.float64), points) for part, _faces in result
    )
    hulls = (hull_of(part) for part in parts_within)
    parts = tuple(hull for hull in hulls if hull is not None)
    return parts or ((whole,) if whole is not None else (thickened(points),))


def clamped_to_hull(points: F64, body: F64) -> F64:
    """points (N, 3), those beyond the convex hull of body (M, 3) moved onto it."""
    try:
        planes = ConvexHull(body).equations
    except (QhullError, ValueError):
        return points
    moved = points.copy()
    for _ in range(_MOST_MOVES):
        # Project each point onto the plane that it violates most.
        beyond = moved @ planes[:, :3].T + planes[:, 3]
        worst = beyond.argmax(axis=1)
        by = np.maximum(beyond[np.arange(len(moved)), worst], 0.0)
        if by.max() <= _BEYOND_M:
            break
        moved -= by[:, None] * planes[worst, :3]
    return moved


def hull_of(points: F64) -> F64 | None:
    """The corners (V, 3), in no useful order, of the convex hull of points (N, 3); None if flat."""
    try:
        return np.asarray(points[ConvexHull(points).vertices])
    except (QhullError, ValueError):
        return None


def hull_volume(points: F64) -> float:
    """Cubic metres of the convex hull of points (N, 3); 0 where they lie in a plane."""
    try:
        return float(ConvexHull(points).volume)
    except (QhullError, ValueError):
        return 0.0


def hull_faces(points: F64) -> I64:
    """(F, 3) outward triangles over all points of their convex hull, none if they lie in a plane."""
    try:
        hull = ConvexHull(points)
    except (QhullError, ValueError):
        return np.zeros((0, 3), np.int64)
    faces = hull.simplices.astype(np.int64)
    a, b, c = (points[faces[:, k]] for k in range(3))
    inward = (np.cross(b - a, c - a) * hull.equations[:, :3]).sum(1) < 0
    faces[inward] = faces[inward][:, ::-1]
    return faces


def thickened(points: F64) -> F64:
    """Box (8, 3) around points (N, 3), a millimetre larger on every side, for engines that need a volume."""
    low, high = points.min(0) - _FLAT_M, points.max(0) + _FLAT_M
    return np.array(
        [[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])]
    )
