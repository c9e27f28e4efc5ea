"""Convex parts of a mesh, for collision: exact ones by CoACD, quick ones by what hangs together; no effects."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import ConvexHull, QhullError

from pbrs_farm.core.arrays import F64, I64
from pbrs_farm.core.errors import MachineFailed
from pbrs_farm.core.mesh import signed_volume
from pbrs_farm.installation import install_command

_NEARLY_CONVEX = 0.95  # share of its hull that a mesh fills which needs no decomposition
_MOST_MOVES = 200  # of a point back into a hull, plane by plane
_BEYOND_M = 1e-6  # of a hull, where a point may stay
_FLAT_M = 5e-4  # half the thickness of a flat thing


def hulls_of_parts(triangles: F64, *, most: int = 12) -> tuple[F64, ...]:
    """The convex hull (V, 3) of each part of triangles (F, 3, 3) that hangs together; never none.

    A table is its top and its legs, a chair its seat, back and legs, in milliseconds; a part that is
    hollow is filled. The `most` largest parts are kept.
    """
    points = triangles.reshape(-1, 3)
    corners = np.unique(points.round(5), axis=0, return_inverse=True)[1].reshape(-1, 3)
    ends = np.concatenate([corners[:, [0, 1]], corners[:, [1, 2]]])
    graph = coo_array((np.ones(len(ends)), ends.T), shape=(corners.max() + 1,) * 2)
    _, part_of = connected_components(graph, directed=False)
    part_of_face = part_of[corners[:, 0]]
    groups = [triangles[part_of_face == k].reshape(-1, 3) for k in np.unique(part_of_face)]
    hulls = [hull for group in groups if (hull := hull_of(group)) is not None]
    largest = sorted(hulls, key=lambda hull: -ConvexHull(hull).volume)[:most]
    return tuple(largest) or (thickened(points),)


def convex_parts(triangles: F64, *, most: int = 24, threshold: float = 0.05) -> tuple[F64, ...]:
    """Convex parts of triangles (F, 3, 3), (V, 3) vertices each; never none, and none beyond their hull.

    most: parts. threshold: concavity that stays (CoACD). Raises MachineFailed without coacd.
    """
    try:
        import coacd
    except ImportError:
        raise MachineFailed("physics needs coacd", hint=install_command("physics")) from None
    points = triangles.reshape(-1, 3)
    whole = hull_of(points)
    # What is nearly its hull needs no decomposition.
    volume = abs(signed_volume(triangles, np.zeros(3)))
    if whole is not None and volume > _NEARLY_CONVEX * ConvexHull(whole).volume:
        return (whole,)
    vertices, faces = np.unique(points.round(7), axis=0, return_inverse=True)
    coacd.set_log_level("error")
    mesh = coacd.Mesh(vertices, faces.reshape(-1, 3).astype(np.int32))
    found = coacd.run_coacd(mesh, threshold=threshold, max_convex_hull=most, seed=1)
    # CoACD works on a grown mesh, by a hundredth of its size: what rests on such parts hovers.
    parts_within = (_within(np.asarray(part, np.float64), points) for part, _faces in found)
    hulls = (hull_of(part) for part in parts_within)
    parts = tuple(hull for hull in hulls if hull is not None)
    return parts or ((whole,) if whole is not None else (thickened(points),))


def _within(points: F64, body: F64) -> F64:
    """points (N, 3), those beyond the convex hull of body (M, 3) moved onto it."""
    try:
        planes = ConvexHull(body).equations
    except (QhullError, ValueError):
        return points
    moved = points.copy()
    for _ in range(_MOST_MOVES):
        # Move each point back through the plane that it lies farthest beyond.
        beyond = moved @ planes[:, :3].T + planes[:, 3]
        worst = beyond.argmax(axis=1)
        by = np.maximum(beyond[np.arange(len(moved)), worst], 0.0)
        if by.max() <= _BEYOND_M:
            break
        moved -= by[:, None] * planes[worst, :3]
    return moved


def hull_of(points: F64) -> F64 | None:
    """The corners (V, 3) of the convex hull of points; None where they lie in a plane.

    points: (N, 3) float64, finite. The corners are some of the points, unchanged; their order is
    qhull's, so use `hull_faces` where the triangles are needed. Fewer than four points give None,
    too.
    """
    try:
        return np.asarray(points[ConvexHull(points).vertices])
    except (QhullError, ValueError):
        return None


def hull_faces(points: F64) -> I64:
    """(F, 3) triangles of the convex hull of points, looking outwards; none where they lie in a plane.

    points: (N, 3) float64, finite; faces index into all of them, inner points are simply not named.
    The order of the faces is qhull's. No error is raised for points without a volume: test the
    length.
    """
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
    """A flat thing as the corners (8, 3) of a box a millimetre thicker than it on every side.

    points: (N, 3), metres. The box lies along the axes, so a flat thing that stands askew becomes a
    thick one: for physics engines that need a volume, not for measuring.
    """
    low, high = points.min(0) - _FLAT_M, points.max(0) + _FLAT_M
    return np.array(
        [[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])]
    )
