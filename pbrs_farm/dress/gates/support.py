"""Gate: nothing floats or sinks by more than 2 mm where it is held; on meshes, no effects.

What stands is held where an upright line from its lowest places meets a face; what hangs, where
its mesh comes nearest to a wall or to what it hangs on; what hangs from the ceiling, at its top.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.catalogue import Place
from pbrs_farm.core.house import ItemKind
from pbrs_farm.core.mesh import distances_to_triangles, triangle_bounds, unique_points
from pbrs_farm.dress.gates.bodies import Body, boxes_of
from pbrs_farm.geometry.heights import heights_in
from pbrs_farm.geometry.surface_points import item_triangles

# Which faces lie above and below places of a house, and whose.


_CELLS_M: Final = (0.1, 1.0)
_MANY_CELLS: Final = 400  # a triangle over more goes into the next larger cells
_NEAR_M: Final = 0.5  # above and below a body
_STEEP: Final = 1e-9  # square metres in plan: a triangle with less stands upright
_EDGE: Final = 1e-6  # of a triangle's extent: a place on its edge is on it
_SPARE: Final = 1e-3  # of a triangle's extent: far beyond what _EDGE and rounding let in
_BESIDE_M: Final = 1e-6

Ints = NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class Hits:
    """What the upright lines through places meet."""

    place: Ints  # (N,) number of the place
    y: F64  # (N,) where its line meets a face
    body: Ints  # (N,) number of the face's body


class Plumb:
    """Upright lines through all faces of bodies that do not stand upright themselves.

    asked: numbers of bodies; what lies neither above nor below one of them is left out.
    """

    def __init__(self, bodies: Sequence[Body], asked: Sequence[int]) -> None:
        low, high = boxes_of(bodies)
        near = np.zeros(len(bodies), bool)
        for number in asked:
            near |= (
                (low[:, [0, 2]] <= high[number, [0, 2]]).all(1)
                & (high[:, [0, 2]] >= low[number, [0, 2]]).all(1)
                & (low[:, 1] <= high[number, 1] + _NEAR_M)
                & (high[:, 1] >= low[number, 1] - _NEAR_M)
            )
        numbers = np.flatnonzero(near).tolist()
        corners = np.concatenate([np.zeros((0, 3, 3)), *(bodies[k].corners for k in numbers)])
        owner = np.repeat(numbers, [len(bodies[k].corners) for k in numbers]).astype(np.int64)
        plan = corners[:, :, [0, 2]]
        ab, ac = plan[:, 1] - plan[:, 0], plan[:, 2] - plan[:, 0]
        lies = np.abs(ab[:, 0] * ac[:, 1] - ab[:, 1] * ac[:, 0]) > 2 * _STEEP
        self._corners, self._owner = corners[lies], owner[lies]
        low, high = triangle_bounds(self._corners)
        # Leave places on a triangle's edge in its bounds.
        spare = _SPARE * (high - low) * [1, 0, 1]
        self._low, self._high = (np.ascontiguousarray(b.T) for b in (low - spare, high + spare))
        # Enter each triangle into cells of a size that suits it.
        left, self._grids = np.arange(len(self._corners)), list[_Grid]()
        for cell_m in _CELLS_M:
            grid, left = _grid(self._corners, left, cell_m, is_last=cell_m == _CELLS_M[-1])
            self._grids.append(grid)

    def hits(self, points: F64, reach_m: float) -> Hits:
        """Every face at most reach_m above or below points (N, 3), edges included."""
        found = [grid.candidates(points[:, [0, 2]]) for grid in self._grids]
        place, triangle = (np.concatenate(parts) for parts in zip(*found, strict=True))
        # Leave out faces that lie too high or too low, then those beside the place.
        for axis, reach in ((1, reach_m), (0, _BESIDE_M), (2, _BESIDE_M)):
            at = np.ascontiguousarray(points[:, axis])[place]
            near = self._low[axis][triangle] < at + reach
            near &= self._high[axis][triangle] > at - reach
            place, triangle = place[near], triangle[near]
        y = heights_in(points[place][:, [0, 2]], self._corners[triangle], _EDGE)
        with np.errstate(invalid="ignore"):
            met = np.abs(y - points[place, 1]) < reach_m
        return Hits(place[met], y[met], self._owner[triangle[met]])


@dataclass(frozen=True, slots=True, eq=False)
class _Grid:
    # Numbers of triangles by the square cell of the plan that they reach into.
    cell_m: float
    origin: F64  # (2,)
    stride: int
    keys: Ints  # ascending
    triangle: Ints  # of the key of the same row

    def candidates(self, plan: F64) -> tuple[Ints, Ints]:
        """(places, triangles) that share a cell, for plan places (N, 2)."""
        cell = np.floor((plan - self.origin) / self.cell_m).astype(np.int64)
        keys = cell[:, 0] * self.stride + cell[:, 1]
        keys[(cell < 0).any(1) | (cell[:, 1] >= self.stride)] = -1
        low, high = np.searchsorted(self.keys, keys), np.searchsorted(self.keys, keys, "right")
        count = high - low
        place = np.repeat(np.arange(len(plan)), count)
        return place, self.triangle[np.repeat(low, count) + _counting(count)]


def _grid(corners: F64, numbers: Ints, cell_m: float, *, is_last: bool) -> tuple[_Grid, Ints]:
    """A grid of some of the triangles (F, 3, 3), and the numbers of those too large for it."""
    plan = corners[numbers][:, :, [0, 2]]
    origin = plan.min((0, 1)) if len(plan) else np.zeros(2)
    low, high = triangle_bounds(plan)
    first = np.floor((low - origin) / cell_m - _EDGE).astype(np.int64)
    last = np.floor((high - origin) / cell_m + _EDGE).astype(np.int64)
    shape = last - first + 1
    n_cells = shape.prod(1)
    fits = (n_cells <= _MANY_CELLS) | is_last
    first, shape, n_cells = first[fits], shape[fits], n_cells[fits]
    # Repeat each triangle for the cells of its bounds, row by row.
    row = np.repeat(np.arange(len(n_cells)), n_cells)
    k, across = _counting(n_cells), shape[row, 1]
    cell = np.stack([first[row, 0] + k // across, first[row, 1] + k % across], -1)
    stride = int(last[:, 1].max(initial=0)) + 2
    keys = cell[:, 0] * stride + cell[:, 1]
    order = np.argsort(keys, kind="stable")
    held = _Grid(cell_m, origin, stride, keys[order], numbers[fits][row[order]])
    return held, numbers[~fits]


def _counting(counts: Ints) -> Ints:
    """0, 1, ... for each count, one after another."""
    return np.asarray(np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts))


# Gate.


MOST_M: Final = 0.002
_ROUNDING_M: Final = 1e-5  # of single precision
_RING_M: Final = 0.003  # above the lowest point of a thing: what it stands on
_MOST_PLACES: Final = 12  # of one thing
_REACH_M: Final = 0.3  # up or down, that a gap is told of
_ALL: Final = 1_000_000
_PAIRS: Final = 1_000_000  # of vertex and face at once
_SOFT: Final = frozenset({"blanket", "throw", "towel", "pillow", "cushion", "curtain"})


@dataclass(frozen=True, slots=True)
class Held:
    """How far a thing is from what holds it, and by what it is held."""

    gap_m: float  # 0 = it touches; below 0 = the nearest face lies above its lowest places
    by: tuple[int, ...] = ()  # numbers of the bodies that it touches

    @property
    def is_good(self) -> bool:
        """Whether it neither floats nor sinks."""
        return abs(self.gap_m) <= MOST_M + _ROUNDING_M


def held(bodies: Sequence[Body], numbers: Sequence[int], plumb: Plumb) -> dict[int, Held]:
    """By what each of some bodies is held. plumb: of all bodies."""
    low, high = boxes_of(bodies)
    found = _standing(bodies, numbers, plumb)
    for number in numbers:
        body = bodies[number]
        ways = [found[number]] if _may_stand(body) else []
        if not any(w.is_good for w in ways) and _may_hang(body):
            ways.append(_hanging(bodies, number, low, high))
        found[number] = min(ways, key=lambda w: abs(w.gap_m))
    return found


def held_as_drawn(bodies: Sequence[Body], number: int, plumb: Plumb) -> Held:
    """By what the thing of the source was held that a body has replaced, among the same bodies."""
    body = bodies[number]
    assert body.was is not None
    corners = item_triangles(body.was)
    points = corners.reshape(-1, 3)
    former = Body(body.index, body.was, corners, points.min(0), points.max(0), True, body.was, None)
    return held([*bodies[:number], former, *bodies[number + 1 :]], [number], plumb)[number]


def _place(body: Body) -> Place | None:
    return body.piece.place if body.piece is not None else None


def _may_stand(body: Body) -> bool:
    return _place(body) not in (Place.WALL, Place.OPENING)


def _may_hang(body: Body) -> bool:
    # A piece of the source that was replaced may have stood or hung.
    is_swapped = body.was is not None
    hangs = _place(body) in (Place.WALL, Place.OPENING, Place.CEILING, None)
    return is_swapped or hangs or body.group in _SOFT


def _standing(bodies: Sequence[Body], numbers: Sequence[int], plumb: Plumb) -> dict[int, Held]:
    """What each body stands on, or hangs from at its top, where its piece belongs to the ceiling."""
    places = [_places(bodies[n]) for n in numbers]
    points = np.concatenate([np.zeros((0, 3)), *places])
    of = np.repeat(np.asarray(numbers, np.int64), [len(p) for p in places])
    hits = plumb.hits(points, _REACH_M)
    # The gap is from a place down to the face below it, negative to a face above.
    gap = points[hits.place, 1] - hits.y
    own = of[hits.place]
    keep = hits.body != own
    gap, own, body = gap[keep], own[keep], hits.body[keep]
    found = dict.fromkeys(numbers, Held(_REACH_M))
    order = np.argsort(own, kind="stable")
    gap, own, body = gap[order], own[order], body[order]
    cuts = np.flatnonzero(own[1:] != own[:-1]) + 1 if len(own) else np.zeros(0, np.int64)
    for first, last in zip(np.r_[0, cuts], np.r_[cuts, len(own)], strict=True):
        if first == last:
            continue
        gaps = gap[first:last]
        nearest = float(gaps[np.argmin(np.abs(gaps))])
        by = np.unique(body[first:last][np.abs(gaps) <= MOST_M + _ROUNDING_M])
        found[int(own[first])] = Held(nearest, tuple(int(b) for b in by))
    return found


def _places(body: Body) -> F64:
    """(P, 3) the lowest points of a body, or the highest of what hangs from a ceiling."""
    points = body.corners.reshape(-1, 3)
    if _place(body) is Place.CEILING:
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
    for other in near.tolist():
        if other == number or bodies[other].item.kind is ItemKind.PERSON:
            continue
        distance = _distance_m(body, bodies[other])
        if distance <= MOST_M:
            by.append(other)
        best = min(best, distance)
    return Held(best, tuple(by))


def _distance_m(a: Body, b: Body) -> float:
    """The least distance from vertices of one body to faces of the other, either way."""
    return min(_vertices_to_faces(a, b), _vertices_to_faces(b, a))


def _vertices_to_faces(a: Body, b: Body) -> float:
    # Look for what touches; tell a gap by some vertices alone where nothing does.
    for reach, most in ((2 * MOST_M, _ALL), (_REACH_M / 10, 400)):
        i, j = _near(a, b, reach, most)
        if len(i):
            return float(distances_to_triangles(i, j).min())
    return _REACH_M


def _near(a: Body, b: Body, reach: float, most: int) -> tuple[F64, F64]:
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
