"""Free places of a support for items of a size; state: the free cells."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from pbrs_farm.core.arrays import F64, I32, Bools
from pbrs_farm.dress.supports import LEAST_FREE_M, Support

MARGIN_M = 0.02  # between items
_HEADROOM_M = 0.01  # free height left above an item
LIFT_M = 0.0001  # above the support, so that no faces coincide


@dataclass(frozen=True, slots=True)
class TopSpot:
    """A place for an item of Worktop.spots: its first row and column, and how many of each."""

    row: int
    column: int
    n_rows: int
    n_columns: int


class Worktop:
    """A support with its free cells. Rows run from the back to the front.

    `spots` lists every place for an item of a size, `take` occupies one:

        top = Worktop(support)
        rows, columns, n = top.spots((0.3, 0.25, 0.2))  # width, height, depth in metres
        if len(rows):
            spot = TopSpot(int(rows[0]), int(columns[0]), *n)
            top.take(spot)
            place = top.middle(spot)  # (3,) world, for the centre of its base
    """

    def __init__(self, support: Support) -> None:
        self.support = support
        self.grid = support.grid
        self.clear = support.clear.copy()
        rows, columns = np.nonzero(support.mask)
        self.rows = int(rows.min()), int(rows.max()) + 1
        self.columns = int(columns.min()), int(columns.max()) + 1

    @property
    def width(self) -> float:
        """Metres from its left to its right end."""
        return (self.columns[1] - self.columns[0]) * self.grid.cell_m

    @property
    def depth(self) -> float:
        """Metres from its back to its front."""
        return (self.rows[1] - self.rows[0]) * self.grid.cell_m

    @property
    def height(self) -> float:
        """World y of the supporting surface."""
        return self.support.height + LIFT_M

    def free_height(self) -> float:
        """Median free height of the free cells, metres; 0 without any."""
        free_heights = self.clear[self.support.mask & (self.clear > 0)]
        return float(np.median(free_heights)) if len(free_heights) else 0.0

    def free_share(self) -> float:
        """The share of the support that nothing was put on."""
        mask = self.support.mask
        return float((mask & (self.clear > 0)).sum() / max(mask.sum(), 1))

    def spots(
        self, size: tuple[float, float, float], *, margin_m: float = MARGIN_M, inset_m: float = 0.0
    ) -> tuple[I32, I32, tuple[int, int]]:
        """Rows and columns of the first cells of all places for a (width, height, depth), metres.

        Also the number of rows and columns of such a place. The size is along the grid's axes: for a
        turned item pass `turned_size`. margin_m: distance to other items; inset_m: to the support's
        edge. Empty arrays if it fits nowhere.
        """
        cell = self.grid.cell_m
        n = (int(np.ceil(size[2] / cell)) + 1, int(np.ceil(size[0] / cell)) + 1)
        margin, inset = round(margin_m / cell), round(inset_m / cell)
        # The item must be completely on the support, with enough height nearby.
        off = _count_in_windows(~self.support.mask, n, inset)
        hit = _count_in_windows(self.clear < size[1] + _HEADROOM_M, n, margin)
        rows, columns = np.nonzero((off == 0) & (hit == 0))
        return rows.astype(np.int32), columns.astype(np.int32), n

    def take(self, spot: TopSpot) -> None:
        """Mark a spot, unchecked, as occupied up to the ceiling."""
        ahead = slice(spot.row, spot.row + spot.n_rows)
        self.clear[ahead, spot.column : spot.column + spot.n_columns] = 0.0

    def is_free(self, at: F64, side_m: float) -> bool:
        """True if a square around a plan position (2,) is on the support and free; it is occupied then."""
        column, _y, row = self.grid.local(np.array([at[0], self.support.height, at[1]]))
        n = round(side_m / self.grid.cell_m)
        i, j = int(row) - n // 2, int(column) - n // 2
        if i < 0 or j < 0 or i + n > self.clear.shape[0] or j + n > self.clear.shape[1]:
            return False
        part = self.clear[i : i + n, j : j + n]
        if not (self.support.mask[i : i + n, j : j + n] & (part > LEAST_FREE_M)).all():
            return False
        part[:] = 0.0
        return True

    def free_height_around(self, at: F64, radius_m: float) -> float:
        """Least free height, metres, of cells within radius_m of a plan position, border included."""
        column, _y, row = self.grid.local(np.array([at[0], 0.0, at[1]]))
        rows, columns = np.indices(self.grid.shape)
        reach = radius_m / self.grid.cell_m + 0.75  # a cell touches the circle up to its corner
        near = (rows + 0.5 - row) ** 2 + (columns + 0.5 - column) ** 2 <= reach**2
        return float(self.clear[near].min(initial=np.inf))

    def keep_free(self, zone: BaseGeometry) -> None:
        """Reserve a plan area (x, z), maybe empty or outside, such as a door's swing."""
        plan = self.grid.centres()
        corners = plan[[0, 0, -1, -1], [0, -1, 0, -1]]
        if not zone.is_empty and shapely.box(*corners.min(0), *corners.max(0)).intersects(zone):
            self.clear[shapely.contains_xy(zone, plan[..., 0], plan[..., 1])] = 0.0

    def middle(self, spot: TopSpot) -> F64:
        """(3,) world place of the spot's middle, on the support."""
        x, z = self.grid.plan_of(spot.column + spot.n_columns / 2, spot.row + spot.n_rows / 2)
        return np.array([x, self.height, z])


def turned_size(size: F64, turn_rad: float) -> tuple[float, float, float]:
    """Width, height and depth of the box around a turned box (3,) of width, height, depth."""
    c, s = abs(np.cos(turn_rad)), abs(np.sin(turn_rad))
    return (float(size[0] * c + size[2] * s), float(size[1]), float(size[0] * s + size[2] * c))


def _count_in_windows(bad: Bools, n: tuple[int, int], grown: int) -> I32:
    # Count the blocked cells in each window of n cells, enlarged on each side.
    tall, wide = n[0] + 2 * grown, n[1] + 2 * grown
    total = np.zeros((bad.shape[0] + 2 * grown + 1, bad.shape[1] + 2 * grown + 1), np.int32)
    total[1:, 1:] = np.pad(bad, grown).astype(np.int32).cumsum(0).cumsum(1)
    if tall >= total.shape[0] or wide >= total.shape[1]:
        return np.ones((0, 0), np.int32)
    return np.asarray(
        total[tall:, wide:] - total[:-tall, wide:] - total[tall:, :-wide] + total[:-tall, :-wide]
    )
