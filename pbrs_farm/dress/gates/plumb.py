"""Faces above and below positions of a house, with their items; state: a cache of grids."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.mesh import triangle_bounds
from pbrs_farm.dress.gates.bodies import Body, boxes_of
from pbrs_farm.geometry.heights import heights_in

_CELLS_M: Final = (0.1, 1.0)
_MANY_CELLS: Final = 400  # a triangle that covers more cells goes into the next coarser grid
_NEAR_M: Final = 0.5  # faces are looked for this far above and below a body
_STEEP: Final = 1e-9  # maximum plan area of a vertical triangle, square metres
_EDGE: Final = 1e-6  # tolerance at a triangle's edge, as a share of its extent
# Margin around a triangle's bounds, as a share of its extent: far above _EDGE and rounding.
_SPARE: Final = 1e-3
_BESIDE_M: Final = 1e-6

Ints = NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class Hits:
    """Intersections of vertical lines with faces."""

    place: Ints  # (N,) number of the place
    y: F64  # (N,) where its line meets a face
    body: Ints  # (N,) number of the face's body


class Plumb:
    """Vertical lines through all faces of bodies but vertical ones and those far from the bodies `asked`."""

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
        remaining, self._grids = np.arange(len(self._corners)), list[_Grid]()
        for cell_m in _CELLS_M:
            grid, remaining = _grid_of_triangles(
                self._corners, remaining, cell_m, is_last=cell_m == _CELLS_M[-1]
            )
            self._grids.append(grid)

    def hits(self, points: F64, reach_m: float) -> Hits:
        """Number of the point, height and body of every face within reach_m above or below points (N, 3)."""
        candidates = [grid.candidates(points[:, [0, 2]]) for grid in self._grids]
        place, triangle = (np.concatenate(parts) for parts in zip(*candidates, strict=True))
        # Leave out faces that lie too high or too low, then those beside the place.
        for axis, reach in ((1, reach_m), (0, _BESIDE_M), (2, _BESIDE_M)):
            coordinate = np.ascontiguousarray(points[:, axis])[place]
            near = self._low[axis][triangle] < coordinate + reach
            near &= self._high[axis][triangle] > coordinate - reach
            place, triangle = place[near], triangle[near]
        y = heights_in(points[place][:, [0, 2]], self._corners[triangle], _EDGE)
        with np.errstate(invalid="ignore"):
            is_near = np.abs(y - points[place, 1]) < reach_m
        return Hits(place[is_near], y[is_near], self._owner[triangle[is_near]])


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


def _grid_of_triangles(
    corners: F64, numbers: Ints, cell_m: float, *, is_last: bool
) -> tuple[_Grid, Ints]:
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
    grid = _Grid(cell_m, origin, stride, keys[order], numbers[fits][row[order]])
    return grid, numbers[~fits]


def _counting(counts: Ints) -> Ints:
    """0, 1, ... for each count, one after another."""
    return np.asarray(np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts))
