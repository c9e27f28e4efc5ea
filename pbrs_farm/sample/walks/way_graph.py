"""Route of a walk: places in rooms, connected by shortest paths that keep clear of items; no effects."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from pbrs_farm.core.arrays import F64, I64
from pbrs_farm.core.walkable import CELL_M, WALK_M
from pbrs_farm.sample.walks.walk_space import WalkSpace

_ROOMY_M: Final = 0.7  # a way with this clearance costs its length alone
_NARROW_COST: Final = 2.0  # a way without clearance costs so many times its length more
_PLACES_A_ROOM: Final = (1, 2)  # fewest and most places of one visit
_CHOICES: Final = 3  # candidates drawn for each place; the farthest is chosen
_MOST_LEGS: Final = 400
_LEAST_ROOM_CELLS: Final = 60  # a room with fewer cells is not visited


class WayGraph:
    """The cells of a region as a graph of neighbours, with higher edge costs near items."""

    def __init__(self, space: WalkSpace) -> None:
        self.cells: I64 = np.argwhere(space.region)
        number = np.full(space.grid.shape, -1, np.int64)
        number[tuple(self.cells.T)] = np.arange(len(self.cells))
        near = np.clip((_ROOMY_M - space.clearance) / (_ROOMY_M - WALK_M / 2), 0, 1)
        cost = 1 + _NARROW_COST * near
        # Join each cell with four of its neighbours; the graph is undirected.
        ends: list[I64] = []
        weights: list[F64] = []
        for dz, dx in ((0, 1), (1, 0), (1, 1), (1, -1)):
            neighbour = self.cells + np.array([dz, dx])
            inside = space.grid.holds(neighbour)
            a = np.flatnonzero(inside)
            b = number[tuple(neighbour[inside].T)]
            a, b = a[b >= 0], b[b >= 0]
            length = CELL_M * float(np.hypot(dz, dx))
            mean = (cost[tuple(self.cells[a].T)] + cost[tuple(self.cells[b].T)]) / 2
            ends.append(np.stack([a, b]))
            weights.append(length * mean)
        rows, columns = np.concatenate(ends, axis=1)
        n = len(self.cells)
        self._matrix = csr_matrix((np.concatenate(weights), (rows, columns)), shape=(n, n))

    def from_cell(self, start: int) -> tuple[F64, NDArray[np.int32]]:
        """(n,) cost of the way from a cell to each, inf without one, and the cell before each on it."""
        cost, before = dijkstra(
            self._matrix, directed=False, indices=np.array([start]), return_predecessors=True
        )
        return cost[0], before[0]


def way_through_rooms(space: WalkSpace, length_m: float, rng: np.random.Generator) -> F64:
    """(M, 2) places 5 cm apart: from room to room, nearest first, again if short of length_m."""
    graph = WayGraph(space)
    room = space.room[tuple(graph.cells.T)]
    rooms = [int(k) for k in np.unique(room) if k >= 0 and (room == k).sum() >= _LEAST_ROOM_CELLS]
    members = {k: np.flatnonzero(room == k) for k in rooms} or {-1: np.arange(len(graph.cells))}
    # Begin anywhere in the region, in proportion to the floor.
    all_cells = np.concatenate([members[k] for k in sorted(members)])
    cell = int(rng.choice(all_cells))
    cells, length, unvisited = [cell], 0.0, set(members)
    room_index = next((k for k in sorted(members) if cell in members[k]), min(members))
    for _leg in range(_MOST_LEGS):
        if length >= length_m:
            break
        for _place in range(int(rng.integers(_PLACES_A_ROOM[0], _PLACES_A_ROOM[1] + 1))):
            cost, before = graph.from_cell(cell)
            drawn = rng.choice(
                members[room_index], min(_CHOICES, len(members[room_index])), replace=False
            )
            goal = int(drawn[cost[drawn].argmax()])
            leg = _leg_to(goal, before)
            length += _length(graph.cells[[cell, *leg]])
            cells += leg
            cell = goal
        unvisited.discard(room_index)
        unvisited = unvisited or (set(members) - {room_index}) or {room_index}
        cost, _before = graph.from_cell(cell)
        room_index = min(sorted(unvisited), key=lambda k: float(cost[members[k]].min()))
    return space.grid.places(graph.cells[cells])


def _leg_to(goal: int, before: NDArray[np.int32]) -> list[int]:
    """The cells behind the start up to the goal."""
    leg = []
    while before[goal] >= 0:
        leg.append(goal)
        goal = int(before[goal])
    return leg[::-1]


def _length(cells: I64) -> float:
    return float(np.linalg.norm(np.diff(cells, axis=0), axis=1).sum()) * CELL_M
