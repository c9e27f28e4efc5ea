"""Triangles seen from above on a turned grid of square cells: which cells they cover, and their heights there; no effects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pbrs_farm.core.arrays import F64, Bools, Points2
from pbrs_farm.core.frames import rotation_y
from pbrs_farm.core.mesh import triangle_bounds

_FLAT = 1e-9  # maximum plan area of a vertical triangle, square metres
_MAX_SLOPE = 50.0  # height over distance; steeper faces take their whole height in every cell

Ints = NDArray[np.intp]


@dataclass(frozen=True, slots=True, eq=False)
class PlanGrid:
    """Square cells over a piece of plan; rows run along its own +z (the front), columns along +x.

    Cell (row, column) covers the plan from (column, row) * cell_m to the next, in the grid's own axes,
    which are the world's x and z turned by turn_rad about +y. Only plan: heights are the world's.

        grid = PlanGrid.around(points, turn_rad=0.0, cell_m=0.01, border_m=0.05)
        heights = top_heights(grid, corners)  # (rows, columns) metres, -inf = nothing there
    """

    origin: F64  # (2,) world (x, z) of the corner of cell (0, 0)
    turn_rad: float  # of its axes about +y
    cell_m: float
    shape: tuple[int, int]  # rows, columns

    @staticmethod
    def around(points: Points2, turn_rad: float, cell_m: float, border_m: float) -> PlanGrid:
        """The grid, turned by turn_rad, of at least one cell over plan points (N, 2) and border_m around."""
        local = points @ _plan_turn(turn_rad)
        low = local.min(0) - border_m
        columns, rows = np.maximum(np.ceil((local.max(0) + border_m - low) / cell_m), 1).astype(int)
        return PlanGrid(_plan_turn(turn_rad) @ low, turn_rad, cell_m, (int(rows), int(columns)))

    def cropped(self, cells: tuple[slice, ...]) -> PlanGrid:
        """The grid of these slices (both ends given) of rows and columns, in place."""
        rows, columns = cells
        shape = (rows.stop - rows.start, columns.stop - columns.start)
        return PlanGrid(self.plan_of(columns.start, rows.start), self.turn_rad, self.cell_m, shape)

    def local(self, points: F64) -> F64:
        """(..., 3) world points as (column, height in metres, row); a cell's middle is at halves."""
        moved = points - np.array([self.origin[0], 0.0, self.origin[1]])
        turned = moved @ rotation_y(self.turn_rad)
        return np.asarray(turned / [self.cell_m, 1.0, self.cell_m])

    def plan_of(self, column: ArrayLike, row: ArrayLike) -> F64:
        """(..., 2) world (x, z) of columns and rows, broadcast: the inverse of `local`."""
        local = np.stack(np.broadcast_arrays(column, row), -1).astype(np.float64) * self.cell_m
        return np.asarray(self.origin + local @ _plan_turn(self.turn_rad).T)

    def centres(self) -> F64:
        """(rows, columns, 2) world (x, z) of the middles of the cells."""
        rows, columns = np.indices(self.shape)
        return self.plan_of(columns + 0.5, rows + 0.5)


@dataclass(frozen=True, slots=True, eq=False)
class CellHits:
    """Pairs of triangle and grid cell below it, with the height range of each."""

    triangle: NDArray[np.intp]  # (N,)
    row: NDArray[np.intp]
    column: NDArray[np.intp]
    low: F64  # (N,) metres: the least height of the triangle in the cell, or lower
    high: F64


def cells_over(grid: PlanGrid, corners: F64, *, touched: bool) -> CellHits:
    """The cells of each triangle (T, 3, 3) in the world.

    touched: every cell that a triangle touches, upright ones too; else those whose middle it covers.
    """
    local = grid.local(corners)
    triangle, row, column, doubled = _cells_over(grid, local, touched=touched)
    steepest, half = _MAX_SLOPE * grid.cell_m, 0.5 if touched else 0.0
    x, z = (np.asarray(cell + 0.5, np.float64) for cell in (column, row))
    low, high = _heights_in_cells(local, doubled, steepest, triangle, x, z, half)
    return CellHits(triangle, row, column, low, high)


def _cells_over(grid: PlanGrid, local: F64, *, touched: bool) -> tuple[Ints, Ints, Ints, F64]:
    """Triangles, rows and columns of hits, and twice the plan area of each triangle, in cells."""
    plan = local[..., [0, 2]]
    half = 0.5 if touched else 0.0
    # List the cells of each triangle's bounds that lie in the grid.
    low, high = triangle_bounds(plan)
    first = np.ceil(low - 0.5 - half).clip(0, None).astype(np.intp)
    last = np.floor(high - 0.5 + half).astype(np.intp)
    last = np.minimum(last, np.array(grid.shape[::-1]) - 1)
    n_across, n_down = (np.maximum(last - first + 1, 0)).T
    count = n_across * n_down
    triangle = np.repeat(np.arange(len(local)), count)
    number = np.arange(len(triangle)) - np.repeat(np.cumsum(count) - count, count)
    width = n_across[triangle]
    down = number // width
    column, row = first[:, 0][triangle] + number - down * width, first[:, 1][triangle] + down

    # Keep the cells on the inner side of all three edges, or half a cell beyond them.
    edges = plan[:, [1, 2, 0]] - plan
    doubled = edges[:, 0, 0] * edges[:, 1, 1] - edges[:, 0, 1] * edges[:, 1, 0]
    edges *= np.where(doubled < 0, -1.0, 1.0)[:, None, None]
    beyond = half * (np.abs(edges[..., 0]) + np.abs(edges[..., 1])) + 1e-9
    start = edges[..., 1] * plan[..., 0] - edges[..., 0] * plan[..., 1] + beyond
    x, z = column + 0.5, row + 0.5
    inside = np.ones(len(triangle), np.bool_)
    for k in range(3):
        along, across, least = edges[:, k, 0], edges[:, k, 1], -start[:, k]
        inside &= along[triangle] * z - across[triangle] * x >= least[triangle]
    if not touched:
        inside &= (np.abs(doubled) * grid.cell_m**2 > _FLAT)[triangle]
    return triangle[inside], row[inside], column[inside], doubled


def covered(grid: PlanGrid, corners: F64, *, touched: bool = False) -> Bools:
    """(rows, columns) true where a triangle (T, 3, 3) covers the cell's centre or, if touched, touches it."""
    mask = np.zeros(grid.shape, np.bool_)
    _triangle, row, column, _doubled = _cells_over(grid, grid.local(corners), touched=touched)
    mask[row, column] = True
    return mask


def covered_by_each(grid: PlanGrid, groups: Sequence[F64]) -> Bools:
    """(G, rows, columns) true where a triangle of each group covers the cell's centre, in one pass."""
    masks = np.zeros((len(groups), *grid.shape), np.bool_)
    if groups:
        group = np.repeat(np.arange(len(groups)), [len(g) for g in groups])
        local = grid.local(np.concatenate(groups))
        triangle, row, column, _doubled = _cells_over(grid, local, touched=False)
        masks[group[triangle], row, column] = True
    return masks


def top_heights(grid: PlanGrid, corners: F64) -> F64:
    """(rows, columns) height of the highest triangle (T, 3, 3) at each cell's middle; -inf = none."""
    top = np.full(grid.shape, -np.inf)
    hits = cells_over(grid, corners, touched=False)
    np.maximum.at(top, (hits.row, hits.column), hits.high)
    return top


def _heights_in_cells(
    local: F64,
    doubled: F64,
    steepest: float,
    triangle: NDArray[np.intp],
    x: F64,
    z: F64,
    half: float,
) -> tuple[F64, F64]:
    # The plane's height in the cell, no lower or higher than the triangle itself.
    flat = np.abs(doubled) > 1e-12
    safe = np.where(flat, doubled, 1.0)
    u, v = local[:, 1] - local[:, 0], local[:, 2] - local[:, 0]
    slope_x = (u[:, 1] * v[:, 2] - v[:, 1] * u[:, 2]) / safe
    slope_z = (v[:, 1] * u[:, 0] - u[:, 1] * v[:, 0]) / safe
    flat &= np.maximum(np.abs(slope_x), np.abs(slope_z)) < steepest
    bottom, top = (y[triangle] for y in triangle_bounds(local[..., 1]))
    sx, sz = np.where(flat, slope_x, 0.0)[triangle], np.where(flat, slope_z, 0.0)[triangle]
    start = local[triangle, 0]
    y = start[:, 1] + sx * (x - start[:, 0]) + sz * (z - start[:, 2])
    spread = half * (np.abs(sx) + np.abs(sz))
    is_flat = flat[triangle]
    low = np.where(is_flat, np.clip(y - spread, bottom, top), bottom)
    high = np.where(is_flat, np.clip(y + spread, bottom, top), top)
    return low, high


def _plan_turn(turn_rad: float) -> F64:
    # (2, 2) world (x, z) from local (x, z).
    c, s = float(np.cos(turn_rad)), float(np.sin(turn_rad))
    return np.array([[c, s], [-s, c]])
