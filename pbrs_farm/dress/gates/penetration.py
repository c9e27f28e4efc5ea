"""Gate: no two items overlap by more than 1 cm: solids of closed shells, samples of open meshes; no effects."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.classes import BLINDS, CURTAIN, FLOOR_MAT
from pbrs_farm.core.house import ItemKind
from pbrs_farm.core.mesh import boxes_meeting, triangle_bounds
from pbrs_farm.dress.gates.bodies import Body, Shell, boxes_of
from pbrs_farm.dress.gates.shells import Solids, crossing_m, depths_inside, thickness
from pbrs_farm.geometry.surface_points import surface_points

MOST_M: Final = 0.01
_SPACING_M: Final = 0.015  # spacing of sample points on open meshes
_MOST_POINTS: Final = 500  # sample points of one shell in another
_UNMEASURED = (ItemKind.FLOOR, ItemKind.CEILING, ItemKind.GROUND, ItemKind.PERSON)
_BEHIND_CURTAINS = (ItemKind.WALL, ItemKind.WINDOW, ItemKind.DOOR)


def near_pairs(bodies: Sequence[Body]) -> Iterator[tuple[int, int]]:
    """Pairs of an added body and any other with an overlapping box, once each, if measured and not allowed."""
    low, high = boxes_of(bodies)
    measured = np.array([b.item.kind not in _UNMEASURED for b in bodies], bool)
    is_new = np.array([b.is_new for b in bodies], bool) & measured
    for i in np.flatnonzero(is_new):
        meets = (_box_depth(low[i], high[i], low, high) > MOST_M) & measured
        # A pair of two new bodies is given once.
        meets[: i + 1] &= ~is_new[: i + 1]
        for j in np.flatnonzero(meets):
            pair = (int(min(i, j)), int(max(i, j)))
            if not is_allowed(bodies[pair[0]], bodies[pair[1]]):
                yield pair


def _box_depth(low: F64, high: F64, lows: F64, highs: F64) -> F64:
    """(N,) how far a box must be moved along an axis to leave each of the others."""
    return np.asarray(np.minimum(high - lows, highs - low).min(-1))


def is_allowed(a: Body, b: Body) -> bool:
    """True if two items may overlap, in any order: added rugs under legs, curtains at walls and windows."""
    for first, second in ((a, b), (b, a)):
        if first.is_new and first.item.nyu40 == FLOOR_MAT:
            return True
        if first.item.nyu40 in (CURTAIN, BLINDS) and second.item.kind in _BEHIND_CURTAINS:
            return True
    return False


def penetration_m(a: Body, b: Body, solids: Solids) -> float:
    """Metres, 0 if apart: the deepest point, the overlap's thickness or an edge's way through a face."""
    deepest, others = 0.0, _shells_near(b, a)
    for shell in _shells_near(a, b) if others else ():
        for other_shell in others:
            if _box_depth(shell.low, shell.high, other_shell.low, other_shell.high) > MOST_M:
                deepest = max(deepest, _depth_of_shells(shell, other_shell, solids))
    return deepest


def _shells_near(body: Body, other: Body) -> list[Shell]:
    return [s for s in body.shells if _box_depth(s.low, s.high, other.low, other.high) > MOST_M]


def _depth_of_shells(a: Shell, b: Shell, solids: Solids) -> float:
    if a.is_closed and b.is_closed:
        parts = solids.shared(a, b)
        if not parts:
            return 0.0
        depth = max(_depth_of_part(part, a, b) for part in parts)
    else:
        depth = max(_deepest(_points_in(a, b), b), _deepest(_points_in(b, a), a))
    if depth > MOST_M:
        return depth
    # Crossing plates have a small overlap without deep points.
    return max(depth, crossing_m(a, b, MOST_M), crossing_m(b, a, MOST_M))


def _depth_of_part(part: F64, a: Shell, b: Shell) -> float:
    # A thin plate in a solid shares little thickness, and its points lie deep.
    points = np.concatenate([part.reshape(-1, 3), part.mean(1)])
    points = points[:: max(1, len(points) // _MOST_POINTS)]
    return max(thickness(part), _deepest(points, a), _deepest(points, b))


def _deepest(points: F64, shell: Shell) -> float:
    return float(depths_inside(points, shell.corners).max(initial=0.0))


def _points_in(a: Shell, b: Shell) -> F64:
    """Points on one shell that lie in the box of another, spread evenly."""
    corners = a.corners
    low, high = triangle_bounds(corners)
    meets = boxes_meeting(low, high, b.low, b.high)
    box = np.stack([b.low + MOST_M / 2, b.high - MOST_M / 2])
    inside = ((a.vertices > box[0]) & (a.vertices < box[1])).all(1)
    points = np.concatenate([a.vertices[inside], surface_points(corners[meets], _SPACING_M, box)])
    return points[:: max(1, len(points) // _MOST_POINTS)]
