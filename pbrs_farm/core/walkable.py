"""Where a person can walk, as a bitmap of 5 cm in plan: its cells and the width of a way; no effects."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from pbrs_farm.core.arrays import F64, I64, Bools

CELL_M: Final = 0.05
WALK_M: Final = 0.6  # the width of a way
STEP_M: Final = 0.08  # maximum height of an obstacle to step over
HEAD_M: Final = 1.8  # minimum height of an obstacle to walk under


@dataclass(frozen=True, slots=True)
class FloorGrid:
    """Cells in plan: row i at z = origin[1] + i * CELL_M, column j at x = origin[0] + j * CELL_M."""

    origin: tuple[float, float]  # x, z of the first cell's corner
    shape: tuple[int, int]

    @staticmethod
    def over(x0: float, z0: float, x1: float, z1: float) -> FloorGrid:
        """The grid over a rectangle x0 <= x1, z0 <= z1 in metres, two cells wider on every side."""
        shape = int((z1 - z0) / CELL_M) + 5, int((x1 - x0) / CELL_M) + 5
        return FloorGrid((x0 - 2 * CELL_M, z0 - 2 * CELL_M), shape)

    @property
    def middles(self) -> tuple[F64, F64]:
        """World x and z of every cell's middle, (H, W) each."""
        x = self.origin[0] + (np.arange(self.shape[1]) + 0.5) * CELL_M
        z = self.origin[1] + (np.arange(self.shape[0]) + 0.5) * CELL_M
        xx, zz = np.meshgrid(x, z)
        return xx, zz

    def cells(self, places: F64) -> I64:
        """(N, 2) int64 row (along z) and column (along x) of plan places (N, 2); see `holds`."""
        cells = np.floor((places - np.asarray(self.origin)) / CELL_M).astype(np.int64)
        return np.asarray(cells[:, ::-1])

    def places(self, cells: I64) -> F64:
        """(N, 2) plan places x, z of the middles of cells (N, 2)."""
        return np.asarray(np.asarray(self.origin) + (cells[:, ::-1] + 0.5) * CELL_M)

    def holds(self, cells: I64) -> Bools:
        """(N,) whether cells (N, 2) lie in the grid."""
        return np.asarray(((cells >= 0) & (cells < self.shape)).all(1))

    def marked(self, places: F64) -> Bools:
        """(H, W) the cells that hold one of the plan places (N, 2); places outside the grid are left out."""
        cells = self.cells(places)
        marks = np.zeros(self.shape, bool)
        marks[tuple(cells[self.holds(cells)].T)] = True
        return marks


def clearance_m(free: Bools) -> F64:
    """(H, W) metres from each cell's middle to the nearest cell of the grid that is not free."""
    return np.asarray(ndimage.distance_transform_edt(free) * CELL_M)


def connected_ways(free: Bools, width_m: float = WALK_M) -> NDArray[np.int32]:
    """(H, W) number of the connected way of the middle of a person, half its width off obstacles; 0 = none."""
    wide = clearance_m(free) >= width_m / 2
    ways, _n = ndimage.label(wide, structure=np.ones((3, 3)))
    return np.asarray(ways, np.int32)
