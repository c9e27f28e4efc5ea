"""Gate: no item floats above or sinks into its support by more than 2 mm, on meshes; no effects.

Floor and surface items are tested by vertical lines from their lowest points; hung items by the
point nearest to a wall or other support; ceiling items at their top.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.catalogue import Place
from pbrs_farm.core.house import ItemKind
from pbrs_farm.core.mesh import distances_to_triangles, triangle_bounds, unique_points
from pbrs_farm.dress.gates.bodies import Body, boxes_of
from pbrs_farm.dress.gates.plumb import Plumb
from pbrs_farm.geometry.surface_points import item_triangles

MOST_M: Final = 0.002
_ROUNDING_M: Final = 1e-5  # rounding of single precision
_RING_M: Final = 0.003  # maximum height of foot vertices above an item's lowest point, metres
_MOST_PLACES: Final = 12  # foot points to test per item
_REACH_M: Final = 0.3  # gaps are measured up to this, up or down
_ALL: Final = 1_000_000
_PAIRS: Final = 1_000_000  # vertex-face pairs per batch, to bound memory
_SOFT: Final = frozenset({"blanket", "throw", "towel", "pillow", "cushion", "curtain"})


@dataclass(frozen=True, slots=True)
class Held:
    """Gap between an item and its support, and the supporting bodies."""

    gap_m: float  # 0 = contact; below 0 = the nearest face is above the item's lowest points
    by: tuple[int, ...] = ()  # numbers of the bodies that it touches

    @property
    def is_good(self) -> bool:
        """Whether it neither floats nor sinks."""
        return abs(self.gap_m) <= MOST_M + _ROUNDING_M


def held(bodies: Sequence[Body], numbers: Sequence[int], plumb: Plumb) -> dict[int, Held]:
    """Support of bodies by number: the surface below, else the wall behind, else the smallest gap (`is_good`)."""
    low, high = boxes_of(bodies)
    supports = _find_what_holds(bodies, numbers, plumb)
    for number in numbers:
        body = bodies[number]
        ways = [supports[number]] if _may_stand(body) else []
        if not any(w.is_good for w in ways) and _may_hang(body):
            ways.append(_hanging(bodies, number, low, high))
        supports[number] = min(ways, key=lambda w: abs(w.gap_m))
    return supports


def held_as_drawn(bodies: Sequence[Body], number: int, plumb: Plumb) -> Held:
    """Support of the source's item that a body replaces; its gap is the one allowed afterwards."""
    body = bodies[number]
    assert body.was is not None
    corners = item_triangles(body.was)
    points = corners.reshape(-1, 3)
    former = Body(body.index, body.was, corners, points.min(0), points.max(0), True, body.was, None)
    return held([*bodies[:number], former, *bodies[number + 1 :]], [number], plumb)[number]


def _place_of_piece(body: Body) -> Place | None:
    return body.piece.place if body.piece is not None else None


def _may_stand(body: Body) -> bool:
    return _place_of_piece(body) not in (Place.WALL, Place.OPENING)


def _may_hang(body: Body) -> bool:
    # A replaced piece of the source may be supported from below or hung.
    is_swapped = body.was is not None
    hangs = _place_of_piece(body) in (Place.WALL, Place.OPENING, Place.CEILING, None)
    return is_swapped or hangs or body.group in _SOFT


def _find_what_holds(
    bodies: Sequence[Body], numbers: Sequence[int], plumb: Plumb
) -> dict[int, Held]:
    """Surface below each body, or above its top if its piece belongs to the ceiling."""
    places = [_places_that_touch(bodies[n]) for n in numbers]
    points = np.concatenate([np.zeros((0, 3)), *places])
    of = np.repeat(np.asarray(numbers, np.int64), [len(p) for p in places])
    hits = plumb.hits(points, _REACH_M)
    # The gap is from a place down to the face below it, negative to a face above.
    gap = points[hits.place, 1] - hits.y
    owner = of[hits.place]
    keep = hits.body != owner
    gap, owner, body = gap[keep], owner[keep], hits.body[keep]
    below = dict.fromkeys(numbers, Held(_REACH_M))
    order = np.argsort(owner, kind="stable")
    gap, owner, body = gap[order], owner[order], body[order]
    cuts = np.flatnonzero(owner[1:] != owner[:-1]) + 1 if len(owner) else np.zeros(0, np.int64)
    for first, last in zip(np.r_[0, cuts], np.r_[cuts, len(owner)], strict=True):
        if first == last:
            continue
        gaps = gap[first:last]
        nearest = float(gaps[np.argmin(np.abs(gaps))])
        by = np.unique(body[first:last][np.abs(gaps) <= MOST_M + _ROUNDING_M])
        below[int(owner[first])] = Held(nearest, tuple(int(b) for b in by))
    return below


def _places_that_touch(body: Body) -> F64:
    """(P, 3) the lowest points of a body, or the highest of what hangs from a ceiling."""
    points = body.corners.reshape(-1, 3)
    if _place_of_piece(body) is Place.CEILING:
        ring = points[points[:, 1] > body.high[1] - _RING_M]
    elif body.group in _SOFT:
        ring = points
    else:
        ring = points[points[:, 1] < body.low[1] + _RING_M]
    ring = unique_points(ring)
    # Take places evenly over the sorted points; cloth, which sags, needs more of them.
    n = _MOST_PLACES * (16 if body.group in _SOFT else 1)
    rows = np.unique(np.linspace(0, len(ring) - 1, min(n, len(ring))).astype(np.int64))
    return np.asarray(ring[rows])


def _hanging(bodies: Sequence[Body], number: int, low: F64, high: F64) -> Held:
    """The nearest that a body's mesh comes to that of another."""
    body = bodies[number]
    # Only bodies whose boxes come near can be the ones it hangs from.
    below, above = body.low - _REACH_M / 10, body.high + _REACH_M / 10
    near = np.flatnonzero(((low <= above) & (high >= below)).all(1))
    best, by = _REACH_M, list[int]()
    for neighbour in near.tolist():
        if neighbour == number or bodies[neighbour].item.kind is ItemKind.PERSON:
            continue
        distance = _distance_m(body, bodies[neighbour])
        if distance <= MOST_M:
            by.append(neighbour)
        best = min(best, distance)
    return Held(best, tuple(by))


def _distance_m(a: Body, b: Body) -> float:
    """The least distance from vertices of one body to faces of the other, either way."""
    return min(_vertices_to_faces(a, b), _vertices_to_faces(b, a))


def _vertices_to_faces(a: Body, b: Body) -> float:
    # Look for what touches; where nothing does, measure the gap at some vertices alone.
    for reach, most in ((2 * MOST_M, _ALL), (_REACH_M / 10, 400)):
        i, j = _vertices_and_faces_near(a, b, reach, most)
        if len(i):
            return float(distances_to_triangles(i, j).min())
    return _REACH_M


def _vertices_and_faces_near(a: Body, b: Body, reach: float, most: int) -> tuple[F64, F64]:
    """Vertices (N, 3) of a and faces (N, 3, 3) of b whose boxes come as near as reach to each other."""
    points = a.corners.reshape(-1, 3)
    inside = np.ones(len(points), np.bool_)
    for k in range(3):
        inside &= (points[:, k] > b.low[k] - reach) & (points[:, k] < b.high[k] + reach)
    points = unique_points(points[inside])
    points = points[:: max(1, len(points) // most)]
    corners = b.corners
    low, high = triangle_bounds(corners)
    near = (low < a.high + reach).all(1) & (high > a.low - reach).all(1)
    corners, low, high = corners[near], low[near] - reach, high[near] + reach
    found_i, found_j = [np.zeros((0, 3))], [np.zeros((0, 3, 3))]
    # Compare some vertices at a time: meshes of thousands have millions of pairs.
    step = max(1, _PAIRS // max(len(corners), 1))
    for first in range(0, len(points), step):
        part = points[first : first + step]
        meets = np.ones((len(part), len(corners)), np.bool_)
        for k in range(3):
            meets &= (part[:, k, None] > low[:, k]) & (part[:, k, None] < high[:, k])
        i, j = np.nonzero(meets)
        found_i.append(part[i])
        found_j.append(corners[j])
    return np.concatenate(found_i), np.concatenate(found_j)
