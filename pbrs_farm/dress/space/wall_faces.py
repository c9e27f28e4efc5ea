"""Walls as rooms see them, by their triangles, and free depth before each place; no effects."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pbrs_farm.core.arrays import F32, F64, Bools
from pbrs_farm.core.house import Item
from pbrs_farm.core.mesh import area_vectors, edges_are_paired
from pbrs_farm.geometry.surface_points import item_triangles

CELL_M = 0.025
FAR_M = 1.2  # free space is measured up to here
_SAME_PLANE_M = 0.002
_LEAST_LENGTH_M = 0.25
_LEAST_AREA_M2 = 0.02  # minimum area of a triangle to start a plane, square metres


@dataclass(frozen=True, slots=True, eq=False)
class WallFace:
    """A flat stretch of wall that one room sees. Its frame: s to the right of who looks at it, y up.

    Cell (i, j) of `clear` covers heights low_y + i * CELL_M and lengths j * CELL_M and on.
    """

    wall_id: str
    room_id: str
    level_id: str
    origin: F64  # (3,) on the face where s = 0 and y = low_y
    along: F64  # (3,) unit, horizontal
    normal: F64  # (3,) unit, horizontal, into the room
    clear: F32  # (H, S) metres free before the cell, at most FAR_M; 0 = no wall to be seen
    recess: F32  # (S,) depth of the wall behind the face's plane, at most 2 mm

    @property
    def length(self) -> float:
        """Metres along the face."""
        return float(self.clear.shape[1] * CELL_M)

    @property
    def low_y(self) -> float:
        """World y of the first row."""
        return float(self.origin[1])

    @property
    def high_y(self) -> float:
        """World y of the last row's end."""
        return float(self.low_y + self.clear.shape[0] * CELL_M)

    @property
    def turn_rad(self) -> float:
        """The turn about +y that brings a piece's front, +z, to the normal."""
        return float(np.arctan2(self.normal[0], self.normal[2]))

    def point(self, s: float, y: float, out_m: float = 0.0) -> F64:
        """(3,) world point at s from the first column, world height y, out_m before the face; metres."""
        point = self.origin + self.along * s + self.normal * out_m
        point[1] = y
        return np.asarray(point)

    def s_of(self, points: F64) -> F64:
        """(N,) metres along the face of points (N, 3), outside 0 .. `length` beside it."""
        return np.asarray((points - self.origin) @ self.along)

    def out_of(self, points: F64) -> F64:
        """(N,) metres before the face of points (N, 3); negative behind the wall's plane."""
        return np.asarray((points - self.origin) @ self.normal)

    def recess_m(self, s0: float, s1: float) -> float:
        """Minimum depth of the wall behind the plane between s0 and s1."""
        columns = _cells_between(s0, s1)
        part = self.recess[max(columns[0], 0) : max(columns[1], 0)]
        return float(part.min()) if part.size else 0.0

    def free_m(self, s0: float, s1: float, y0: float, y1: float) -> float:
        """Least free depth, metres, before s0..s1, y0..y1 (world); 0 if it reaches beyond the face."""
        rows, columns = self._window(s0, s1, y0, y1)
        n_rows, n_columns = self.clear.shape
        if rows[0] < 0 or columns[0] < 0 or rows[1] > n_rows or columns[1] > n_columns:
            return 0.0
        part = self.clear[rows[0] : rows[1], columns[0] : columns[1]]
        return float(part.min()) if part.size else 0.0

    def starts(self, width_m: float, y0: float, y1: float, depth_m: float) -> F64:
        """(K,) start positions s, in steps of a cell, at which an item fits.

        width_m: of the item along the face. y0, y1: world heights of its lower and upper edge. depth_m:
        required free depth in front of the face. Empty if it fits nowhere.
        """
        rows, columns = self._window(0.0, width_m, y0, y1)
        if rows[0] < 0 or rows[1] > self.clear.shape[0] or rows[1] <= rows[0]:
            return np.zeros(0)
        free = np.asarray((self.clear[rows[0] : rows[1]] >= depth_m).all(0))
        n = max(columns[1], 1)
        if n > len(free):
            return np.zeros(0)
        # A run of n free columns begins where the count over n columns is n.
        count = np.concatenate([[0], np.cumsum(free)])
        return np.asarray(np.flatnonzero(count[n:] - count[:-n] == n) * CELL_M, np.float64)

    def taken(self, s0: float, s1: float, y0: float, y1: float) -> WallFace:
        """A copy with the part inside of the rectangle s0..s1, y0..y1 (world heights) occupied."""
        return self.limited(s0, s1, y0, y1, 0.0)

    def limited(self, s0: float, s1: float, y0: float, y1: float, free_m: float) -> WallFace:
        """A copy with at most free_m free before a rectangle, behind an obstacle for flat items."""
        rows, columns = self._window(s0, s1, y0, y1)
        clear = self.clear.copy()
        part = clear[max(rows[0], 0) : max(rows[1], 0), max(columns[0], 0) : max(columns[1], 0)]
        np.minimum(part, np.float32(free_m), out=part)
        return replace(self, clear=clear)

    def _window(
        self, s0: float, s1: float, y0: float, y1: float
    ) -> tuple[tuple[int, int], tuple[int, int]]:
        rows = _cells_between(y0 - self.low_y, y1 - self.low_y)
        return rows, _cells_between(s0, s1)


def _cells_between(low_m: float, high_m: float) -> tuple[int, int]:
    return int(np.floor(low_m / CELL_M + 1e-6)), int(np.ceil(high_m / CELL_M - 1e-6))


@dataclass(frozen=True, slots=True, eq=False)
class WallPlane:
    """All wall triangles of one plane and side, in the plane's frame."""

    wall_id: str
    point: F64  # (3,) on the plane, at s = 0 and y = 0
    along: F64
    normal: F64
    corners: F64  # (F, 3, 2) s and y
    behind: F64  # (F,) depth of a triangle behind the plane, metres

    def recess(self, s0: float, n_columns: int) -> F32:
        """(S,) depth behind the plane of the nearest triangle in each column from s0 on."""
        depths = np.full(n_columns, np.inf)
        s = (self.corners[:, :, 0] - s0) / CELL_M
        first = np.clip(np.floor(s.min(1) + 1e-6), 0, n_columns).astype(int)
        last = np.clip(np.ceil(s.max(1) - 1e-6), 0, n_columns).astype(int)
        for behind, i, j in zip(self.behind, first, last, strict=True):
            depths[i:j] = np.minimum(depths[i:j], behind)
        return np.where(np.isfinite(depths), depths, 0.0).astype(np.float32)

    def world(self, s: F64, out_m: float) -> F64:
        """(N, 2) plan places at s (N,) along the plane and out_m before it."""
        points = self.point + s[:, None] * self.along + out_m * self.normal
        return np.asarray(points[:, [0, 2]])

    def covered(self, s0: float, y0: float, shape: tuple[int, int]) -> Bools:
        """(H, S) cells from s0 and y0 (world) on, metres, whose middle is on a triangle or its edge."""
        ss = s0 + (np.arange(shape[1]) + 0.5) * CELL_M
        yy = y0 + (np.arange(shape[0]) + 0.5) * CELL_M
        mask = np.zeros(shape, bool)
        for (sa, ya), (sb, yb), (sc, yc) in self.corners:
            # Look at the cells in the triangle's bounds.
            i0, i1 = np.searchsorted(yy, [min(ya, yb, yc), max(ya, yb, yc)])
            j0, j1 = np.searchsorted(ss, [min(sa, sb, sc), max(sa, sb, sc)])
            s, y = ss[None, j0:j1], yy[i0:i1, None]
            # A place inside is on the same side of all edges.
            sides = [
                (q[0] - p[0]) * (y - p[1]) - (q[1] - p[1]) * (s - p[0])
                for p, q in (((sa, ya), (sb, yb)), ((sb, yb), (sc, yc)), ((sc, yc), (sa, ya)))
            ]
            positive = (sides[0] >= -1e-9) & (sides[1] >= -1e-9) & (sides[2] >= -1e-9)
            negative = (sides[0] <= 1e-9) & (sides[1] <= 1e-9) & (sides[2] <= 1e-9)
            mask[i0:i1, j0:j1] |= positive | negative
        return mask


def wall_planes(walls: Sequence[Item]) -> Iterator[WallPlane]:
    """The upright planes of walls, largest triangle first; both sides of walls that are not closed.

    Faces that lean or lie level are left out, and planes whose largest triangle is smaller than a
    least area. Triangles of several walls in one plane are one, with the id of the wall whose
    triangle is largest.
    """
    corners, owner = [np.zeros((0, 3, 3))], [np.zeros(0, np.int64)]
    for number, wall in enumerate(walls):
        wall_corners = item_triangles(wall)
        if len(wall_corners) and not _is_closed(wall_corners):
            wall_corners = np.concatenate([wall_corners, wall_corners[:, ::-1]])
        corners.append(wall_corners)
        owner.append(np.full(len(wall_corners), number))
    triangles, owners = np.concatenate(corners), np.concatenate(owner)
    vectors = area_vectors(triangles)
    areas = np.linalg.norm(vectors, axis=1)
    normals = vectors / np.maximum(areas, 1e-12)[:, None]
    # Keep upright triangles; slivers say nothing of their plane.
    upright = (np.abs(normals[:, 1]) < 0.02) & (areas > 1e-8)
    triangles, owners, normals, areas = (x[upright] for x in (triangles, owners, normals, areas))
    unassigned = np.ones(len(triangles), bool)
    for first in np.argsort(-areas, kind="stable"):
        if not unassigned[first]:
            continue
        if areas[first] < 2 * _LEAST_AREA_M2:
            break
        # Collect the triangles in the plane of the largest remaining one, with the same
        # orientation.
        normal = normals[first] * [1, 0, 1]
        normal = normal / np.linalg.norm(normal)
        out = (triangles - triangles[first, 0]) @ normal
        same = unassigned & (np.abs(out).max(1) < _SAME_PLANE_M) & (normals @ normal > 0.99)
        unassigned &= ~same
        along = np.array([normal[2], 0.0, -normal[0]])
        # The face is where the outermost of them is.
        nearest = triangles[first, 0] + normal * float(out[same].max())
        point = (nearest - along * (nearest @ along)) * [1, 0, 1]
        flat = np.stack([triangles[same] @ along, triangles[same][:, :, 1]], -1)
        behind = float(out[same].max()) - out[same].max(1)
        yield WallPlane(walls[owners[first]].id, point, along, normal, flat, behind)


def _is_closed(corners: F64) -> bool:
    _, places = np.unique(np.round(corners.reshape(-1, 3), 4), axis=0, return_inverse=True)
    return edges_are_paired(places.reshape(-1, 3))


def runs(room_of_column: Sequence[int]) -> Iterator[tuple[int, int, int]]:
    """(room, first column, end column) of long enough stretches of one room, -1 left out."""
    values = np.asarray(room_of_column)
    edges = np.flatnonzero(np.diff(values)) + 1
    for start, end in zip(np.r_[0, edges], np.r_[edges, len(values)], strict=True):
        if values[start] >= 0 and (end - start) * CELL_M >= _LEAST_LENGTH_M:
            yield int(values[start]), int(start), int(end)


@dataclass(frozen=True, slots=True, eq=False)
class Hidden:
    """Distance of an item in front of a face, for a window of the face's cells."""

    row: int
    column: int
    out: F32  # (h, w) metres before the face, FAR_M where there is nothing

    def limit(self, clear: F32) -> None:
        """Limit the face's free space (H, S) by the item, in place."""
        h, w = self.out.shape
        part = clear[self.row : self.row + h, self.column : self.column + w]
        np.minimum(part, self.out, out=part)


def _least_around(depth: F32) -> F32:
    # The least of each cell and its eight neighbours, in a fifth of the time of ndimage's filter.
    across = depth.copy()
    np.minimum(across[:, 1:], depth[:, :-1], out=across[:, 1:])
    np.minimum(across[:, :-1], depth[:, 1:], out=across[:, :-1])
    least = across.copy()
    np.minimum(least[1:], across[:-1], out=least[1:])
    np.minimum(least[:-1], across[1:], out=least[:-1])
    return least


def hidden_cells(face: WallFace, points: F64) -> Hidden | None:
    """Cells of a face that an item obstructs, from points (N, 3) on its surface, grown by a cell.

    points (N, 3) float64 in the world; None if none of them is near the face. Points farther than
    FAR_M in front, or behind its plane, obstruct nothing. Sample surfaces as densely as the cells, or
    gaps stay free.
    """
    out, s, y = face.out_of(points), face.s_of(points), points[:, 1] - face.low_y
    n_rows, n_columns = face.clear.shape
    near = (out > -0.03) & (out < FAR_M)
    near &= (
        (s > -CELL_M) & (s < face.length + CELL_M) & (y > -CELL_M) & (y < n_rows * CELL_M + CELL_M)
    )
    if not near.any():
        return None
    # Keep the nearest of each cell, on a bitmap two cells larger all round.
    i = np.floor(y[near] / CELL_M).astype(np.int64)
    j = np.floor(s[near] / CELL_M).astype(np.int64)
    row, column = int(i.min()) - 2, int(j.min()) - 2
    depth = np.full((int(i.max()) - row + 3, int(j.max()) - column + 3), FAR_M, np.float32)
    cell = (i - row) * depth.shape[1] + (j - column)
    np.minimum.at(depth.reshape(-1), cell, np.maximum(out[near], 0.0).astype(np.float32))
    depth = _least_around(depth)
    # Clip to the face.
    above, left = max(-row, 0), max(-column, 0)
    depth = depth[above : max(n_rows - row, 0), left : max(n_columns - column, 0)]
    return Hidden(row + above, column + left, depth)
