"""The surfaces of a piece of furniture that things can stand on, and how much is free above them.

Works on raw meshes: open, thin, wound either way. Nothing is decided by boxes; no effects.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import ndimage
from shapely import MultiPoint, Polygon, contains_xy, minimum_rotated_rectangle

from pbrs_farm.core.arrays import F64, I32, Bools, Points2
from pbrs_farm.core.frames import rotation_y
from pbrs_farm.core.house import Item, ItemKind, Room
from pbrs_farm.core.mesh import boxes_meeting, face_areas, triangle_bounds, unit_normals
from pbrs_farm.geometry.surface_points import item_triangles

# Triangles seen from above on a turned grid of cells: coverage and heights.


_FLAT = 1e-9  # square metres in plan: a triangle with less stands upright
_MAX_SLOPE = 50.0  # height over distance; steeper faces take their whole height in every cell


Ints = NDArray[np.intp]


@dataclass(frozen=True, slots=True, eq=False)
class PlanGrid:
    """Square cells over a piece of plan; rows run along its own +z (the front), columns along +x."""

    origin: F64  # (2,) world (x, z) of the corner of cell (0, 0)
    turn_rad: float  # of its axes about +y
    cell_m: float
    shape: tuple[int, int]  # rows, columns

    @staticmethod
    def around(points: Points2, turn_rad: float, cell_m: float, border_m: float) -> PlanGrid:
        """The grid that covers plan points (N, 2) and border_m around them."""
        local = points @ _plan_turn(turn_rad)
        low = local.min(0) - border_m
        columns, rows = np.maximum(np.ceil((local.max(0) + border_m - low) / cell_m), 1).astype(int)
        return PlanGrid(_plan_turn(turn_rad) @ low, turn_rad, cell_m, (int(rows), int(columns)))

    def cropped(self, cells: tuple[slice, ...]) -> PlanGrid:
        """The grid of these rows and columns alone."""
        rows, columns = cells
        shape = (rows.stop - rows.start, columns.stop - columns.start)
        return PlanGrid(self.plan_of(columns.start, rows.start), self.turn_rad, self.cell_m, shape)

    def local(self, points: F64) -> F64:
        """(..., 3) world points as (column, height in metres, row), in cells from the corner."""
        moved = points - np.array([self.origin[0], 0.0, self.origin[1]])
        turned = moved @ rotation_y(self.turn_rad)
        return np.asarray(turned / [self.cell_m, 1.0, self.cell_m])

    def plan_of(self, column: ArrayLike, row: ArrayLike) -> F64:
        """(..., 2) world (x, z) of places given in cells from the corner."""
        local = np.stack(np.broadcast_arrays(column, row), -1).astype(np.float64) * self.cell_m
        return np.asarray(self.origin + local @ _plan_turn(self.turn_rad).T)

    def centres(self) -> F64:
        """(rows, columns, 2) world (x, z) of the middles of the cells."""
        rows, columns = np.indices(self.shape)
        return self.plan_of(columns + 0.5, rows + 0.5)


@dataclass(frozen=True, slots=True, eq=False)
class CellHits:
    """Which triangle lies over which cell, and between which heights there."""

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
    low, high = _heights(local, doubled, steepest, triangle, x, z, half)
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
    """(rows, columns) whether a triangle covers the cell's middle, or touches the cell."""
    mask = np.zeros(grid.shape, np.bool_)
    _triangle, row, column, _doubled = _cells_over(grid, grid.local(corners), touched=touched)
    mask[row, column] = True
    return mask


def covered_by_each(grid: PlanGrid, groups: Sequence[F64]) -> Bools:
    """(G, rows, columns) whether a triangle of each group (T, 3, 3) covers the cell's middle."""
    masks = np.zeros((len(groups), *grid.shape), np.bool_)
    if groups:
        group = np.repeat(np.arange(len(groups)), [len(g) for g in groups])
        local = grid.local(np.concatenate(groups))
        triangle, row, column, _doubled = _cells_over(grid, local, touched=False)
        masks[group[triangle], row, column] = True
    return masks


def top_heights(grid: PlanGrid, corners: F64) -> F64:
    """(rows, columns) height of the highest triangle over each cell's middle; -inf = none."""
    top = np.full(grid.shape, -np.inf)
    hits = cells_over(grid, corners, touched=False)
    np.maximum.at(top, (hits.row, hits.column), hits.high)
    return top


def _heights(
    local: F64, doubled: F64, steepest: float,
    triangle: NDArray[np.intp], x: F64, z: F64, half: float,
) -> tuple[F64, F64]:  # fmt: skip
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


# The triangles of a house by item, found again by place; state: what was asked for is kept.


class SceneTriangles:
    """Corners of the items' faces in double precision, and which items meet a box."""

    def __init__(self, items: Sequence[Item]) -> None:
        self.items = tuple(items)
        bounds = [item.bounds for item in self.items]
        self.bounds: F64 = np.array(bounds) if bounds else np.zeros((0, 2, 3))
        self._corners: dict[int, F64] = {}
        self._of_faces: dict[int, tuple[F64, F64]] = {}

    def of_item(self, index: int) -> F64:
        """(F, 3, 3) corners of the faces of items[index] that have finite corners, metres."""
        if index not in self._corners:
            self._corners[index] = item_triangles(self.items[index])
        return self._corners[index]

    def _bounds_of(self, index: int) -> tuple[F64, F64]:
        # (F, 3) lowest and highest corners of the boxes around the item's faces.
        if index not in self._of_faces:
            self._of_faces[index] = triangle_bounds(self.of_item(index))
        return self._of_faces[index]

    def items_in(self, low: F64, high: F64) -> list[int]:
        """Indices of the items whose bounds meet the box low..high (3,)."""
        meets = boxes_meeting(self.bounds[:, 0], self.bounds[:, 1], low, high)
        return [int(i) for i in np.flatnonzero(meets)]

    def in_box(self, low: F64, high: F64) -> tuple[F64, I32]:
        """(T, 3, 3) faces whose bounds meet the box low..high, and (T,) the item of each."""
        parts, owners = [np.zeros((0, 3, 3))], [np.zeros(0, np.int32)]
        for index in self.items_in(low, high):
            corners = self.of_item(index)
            least, most = self._bounds_of(index)
            meets = boxes_meeting(least, most, low, high)
            parts.append(corners[meets])
            owners.append(np.full(int(meets.sum()), index, np.int32))
        return np.concatenate(parts), np.concatenate(owners)


# The surfaces of a piece of furniture that things can stand on, and how much is free above them.


CELL_M = 0.01
LEAST_AREA_M2 = 0.02
LEAST_FREE_M = 0.12
MOST_FREE_M = 3.0  # what is higher above a support is nobody's business
_LEAST_NORMAL_Y = 0.95
_FLAT_M = 0.0006  # heights of one support differ by less
_BORDER = 5  # cells of the grid around a support
_NEAR_M = 0.003  # a face of another thing this near to the support's height lies on it
_LEVEL_M = 0.0002  # its own face this near belongs to it; a higher one is a board beside it
_OPEN_SHARE = 0.5  # of a side's length
_OUT_OF_REACH_M = 2.35  # above the floor
_RIM_M = 0.03  # that a bowl's rim rises above its bottom
_RIM_WITHIN_M = 0.16  # beyond the edge of the bottom


@dataclass(frozen=True, slots=True, eq=False)
class Support:
    """A flat surface that things can stand on. Its grid's +z points to the side it is used from."""

    item: int  # index of the furniture
    room_id: str
    height: float  # world y of its highest point
    above_floor: float  # metres
    grid: PlanGrid
    mask: Bools  # (rows, columns) the support is there and free
    clear: F64  # (rows, columns) free height above, metres; 0 = something stands there
    open_sides: tuple[bool, bool, bool, bool]  # right (+x), front (+z), left, back
    is_covered: bool  # a shelf: something is above most of it

    @property
    def area(self) -> float:
        """Free area in square metres."""
        return float(self.mask.sum()) * self.grid.cell_m**2


def supports_of_item(scene: SceneTriangles, index: int, room: Room) -> list[Support]:
    """The supports of items[index] that lie in the room, from low to high."""
    item, corners = scene.items[index], scene.of_item(index)
    level = np.abs(unit_normals(corners)[:, 1]) > _LEAST_NORMAL_Y
    groups = _levels(corners[level], room)
    if not groups:
        return []
    plan = corners.reshape(-1, 3)[:, [0, 2]]
    grid = PlanGrid.around(plan, plan_turn(item, corners.reshape(-1, 3)), CELL_M, _BORDER * CELL_M)
    # See everything around from above once, for all its levels.
    around = surroundings(scene, index, grid, float(groups[0][..., 1].max()))
    centres = grid.centres()
    indoors = contains_xy(Polygon(room.polygon), centres[..., 0], centres[..., 1])
    found = []
    free = indoors & ~around.solid
    for group, cover in zip(groups, covered_by_each(grid, groups), strict=True):
        mask = cover & free
        found += _supports_at(around, mask, float(group[..., 1].max()), room, item.box is not None)
    return found


def plan_turn(item: Item, points: F64) -> float:
    """Angle about +y of the item's own axes: of its box, else of the least box around its plan.

    points: (N, 3) its vertices, for where there is no box.
    """
    if item.box is not None:
        axes = item.box.axes
        return float(np.arctan2(-axes[2, 0], axes[0, 0]))
    outline = minimum_rotated_rectangle(MultiPoint(points[:, [0, 2]]))
    if not isinstance(outline, Polygon):
        return 0.0
    edge = np.diff(np.asarray(outline.exterior.coords)[:2], axis=0)[0]
    return float(np.arctan2(-edge[1], edge[0]))


def _levels(faces: F64, room: Room) -> list[F64]:
    # Groups of flat faces whose heights agree, with enough area together, within reach.
    low, high = triangle_bounds(faces[..., 1])
    top = min(_OUT_OF_REACH_M, room.ceiling_y - room.floor_y - LEAST_FREE_M) + room.floor_y
    flat = (high - low < _FLAT_M) & (low > room.floor_y + 0.04) & (high < top)
    faces, high = faces[flat], high[flat]
    order = np.argsort(high, kind="stable")
    faces, high = faces[order], high[order]
    groups, start = [], 0
    for k in range(1, len(high) + 1):
        if k == len(high) or high[k] - high[start] > _FLAT_M:
            group = faces[start:k]
            if float(face_areas(group).sum()) >= LEAST_AREA_M2:
                groups.append(group)
            start = k
    return groups


@dataclass(frozen=True, slots=True, eq=False)
class Surroundings:
    """All faces over a grid, as heights in its cells, and where walls are."""

    index: int  # of the furniture itself
    grid: PlanGrid
    hits: CellHits
    is_own: Bools  # (N,) of the hits: a face of the furniture itself
    solid: Bools  # (rows, columns) inside a wall

    def clearance(self, height: float) -> F64:
        """(rows, columns) metres that are free above height, at most MOST_FREE_M.

        The furniture's own faces at that height are the support and no obstacle.
        """
        hits = self.hits
        # Let every face that rises above the support lower what is free in its cells.
        stands = hits.high > height + np.where(self.is_own, _LEVEL_M, -_NEAR_M)
        clear = np.full(self.grid.shape, MOST_FREE_M)
        free = np.maximum(hits.low[stands] - height, 0.0)
        cell = hits.row[stands] * clear.shape[1] + hits.column[stands]
        np.minimum.at(clear.reshape(-1), cell, free)  # one index: numpy's fast way
        clear[self.solid] = 0.0
        return clear


def surroundings(scene: SceneTriangles, index: int, grid: PlanGrid, low_y: float) -> Surroundings:
    """What stands over a grid from low_y upwards; index: the furniture itself, -1 = none."""
    ends = grid.plan_of(np.array([0, grid.shape[1]] * 2), np.repeat([0, grid.shape[0]], 2))
    low = np.array([ends[:, 0].min(), low_y - _NEAR_M, ends[:, 1].min()])
    high = np.array([ends[:, 0].max(), low_y + MOST_FREE_M, ends[:, 1].max()])
    corners, owner = scene.in_box(low, high)
    hits = cells_over(grid, corners, touched=True)
    # A wall is solid: its level faces say where, though they lie far below.
    solid = np.zeros(grid.shape, np.bool_)
    for wall in scene.items_in(low, high):
        if scene.items[wall].kind is ItemKind.WALL:
            corners = scene.of_item(wall)
            level = np.abs(unit_normals(corners)[:, 1]) > 0.5
            solid |= covered(grid, corners[level])
    return Surroundings(index, grid, hits, owner[hits.triangle] == index, solid)


def _supports_at(
    around: Surroundings, mask: Bools, height: float, room: Room, has_front: bool
) -> list[Support]:
    least = LEAST_AREA_M2 / CELL_M**2
    if mask.sum() < least:
        return []
    clear = np.minimum(around.clearance(height), max(room.ceiling_y - height, 0.0))
    free = mask & (clear >= LEAST_FREE_M)

    # Take each connected part that can be reached from a side.
    parts, n = ndimage.label(free)
    parts = np.asarray(parts)
    found = []
    for k, at in enumerate(ndimage.find_objects(parts, n), start=1):
        if np.count_nonzero(np.equal(parts[at], k)) < least:
            continue
        around_it = tuple(
            slice(max(s.start - _BORDER, 0), min(s.stop + _BORDER, size))
            for s, size in zip(at, parts.shape, strict=True)
        )
        part, air = np.asarray(parts[around_it] == k), clear[around_it]
        sides = _open_sides(part, air)
        # Leave out the inside of closed bodies: nothing leads there but from above.
        if not any(sides) and np.median(air[part]) < room.ceiling_y - height - 0.01:
            continue
        if not any(sides) and _is_in_a_bowl(around, parts == k, height):
            continue
        found.append(
            turned_to_front(
                Support(
                    around.index, room.id, height, height - room.floor_y,
                    around.grid.cropped(around_it), part, air, sides,
                    bool(np.mean(air[part] < 0.6) > 0.5),
                ),
                room, has_front=has_front,
            )
        )  # fmt: skip
    return found


def _open_sides(part: Bools, clear: F64) -> tuple[bool, bool, bool, bool]:
    """Whether nothing stands beyond the part's right, front, left and back edge."""
    blocked = clear < LEAST_FREE_M
    sides = []
    for axis, step in ((1, 1), (0, 1), (1, -1), (0, -1)):
        # Look at the cells just beyond the outermost ones of each row or column.
        beyond = [_shifted(blocked, axis, -step * k) for k in (1, 2, 3)]
        ahead = beyond[0] | beyond[1] | beyond[2]
        order = part if step > 0 else np.flip(part, axis)
        last = order.shape[axis] - 1 - np.argmax(np.flip(order, axis), axis)
        last = last if step > 0 else order.shape[axis] - 1 - last
        lines = np.flatnonzero(part.any(axis))
        at = last[lines]
        edge = ahead[lines, at] if axis == 1 else ahead[at, lines]
        sides.append(bool(np.mean(~edge) > _OPEN_SHARE))
    return (sides[0], sides[1], sides[2], sides[3])


def _is_in_a_bowl(around: Surroundings, part: Bools, height: float) -> bool:
    """Whether a rim rises around a part of the grid on each of its four sides, as of a sink."""
    hits = around.hits
    # A rim begins at the bottom's height or below, unlike what hangs above it.
    rises = (hits.high > height + _RIM_M) & (hits.low < height + _RIM_M)
    rim = np.zeros(part.shape, np.bool_)
    rim[hits.row[rises], hits.column[rises]] = True
    n = round(_RIM_WITHIN_M / around.grid.cell_m)
    for axis in (0, 1):
        lines = np.flatnonzero(part.any(1 - axis))
        own, rims = (np.moveaxis(m, axis, 0)[lines] for m in (part, rim))
        for step in (1, -1):
            own_, rims_ = own[:, ::step], rims[:, ::step]
            last = own_.shape[1] - np.argmax(own_[:, ::-1], 1)
            met = [bool(r[e : e + n].any()) for r, e in zip(rims_, last, strict=True)]
            if np.mean(met) <= _OPEN_SHARE:
                return False
    return True


def _shifted(mask: Bools, axis: int, by: int) -> Bools:
    moved = np.zeros_like(mask)
    there, here = (slice(by, None), slice(0, -by)) if by > 0 else (slice(0, by), slice(-by, None))
    if axis == 0:
        moved[there] = mask[here]
    else:
        moved[:, there] = mask[:, here]
    return moved


def turned_to_front(support: Support, room: Room, *, has_front: bool) -> Support:
    """The support with its grid turned by quarters, so that +z is the side it is used from.

    That is the front of its furniture where it is known and open (has_front: its grid's +z); else
    the open side with most room before it.
    """
    quarter = _front_quarter(support, room, has_front)
    if quarter == 0:
        return support
    return _turned(support, quarter)


def _front_quarter(support: Support, room: Room, has_front: bool) -> int:
    # 0 = +z, 1 = +x, 2 = -z, 3 = -x, as quarters of a turn about +y.
    right, front, left, back = support.open_sides
    is_open = {0: front, 1: right, 2: back, 3: left}
    area = Polygon(room.polygon)
    # A top that is open all around faces the room; a shelf faces where it is open.
    if has_front and is_open[0] and _way_to_wall(support, 0, area) > 0.25:
        return 0
    reach = {q: _way_to_wall(support, q, area) for q in is_open}
    choices = [q for q in is_open if is_open[q]] or list(is_open)
    rows, columns = np.nonzero(support.mask)
    depth = (np.ptp(rows), np.ptp(columns))

    def liking(q: int) -> tuple[float, float, int, int]:
        # Room before it, a wall behind it, its short side from front to back.
        before, behind = min(reach[q], 1.0), min(reach[(q + 2) % 4], 1.0)
        return round(before, 1), -round(behind, 1), -int(depth[q % 2]), -q

    return max(choices, key=liking)


def _way_to_wall(support: Support, quarter: int, area: Polygon) -> float:
    # How far one can go from the support's middle beyond its edge before the room ends, metres.
    grid, (rows, columns) = support.grid, np.nonzero(support.mask)
    middle = grid.plan_of(columns.mean() + 0.5, rows.mean() + 0.5)
    ahead = grid.plan_of(np.sin(quarter * np.pi / 2), np.cos(quarter * np.pi / 2)) - grid.origin
    ahead = ahead / np.linalg.norm(ahead)
    half = [np.ptp(rows) / 2, np.ptp(columns) / 2][quarter % 2] * grid.cell_m
    steps = half + np.arange(0.05, 2.0, 0.05)
    places = middle + steps[:, None] * ahead
    outside = ~contains_xy(area, places[:, 0], places[:, 1])
    return float(steps[np.argmax(outside)] - half) if outside.any() else 2.0


def _turned(support: Support, quarter: int) -> Support:
    # Turn the axes by quarters; the cells stay where they are in the world.
    grid, (rows, columns) = support.grid, support.grid.shape
    corner = {1: (0, rows), 2: (columns, rows), 3: (columns, 0)}[quarter]
    shape = (columns, rows) if quarter % 2 else (rows, columns)
    turned = PlanGrid(
        grid.plan_of(*corner), grid.turn_rad + quarter * np.pi / 2, grid.cell_m, shape
    )

    def cells(values: NDArray[np.generic]) -> NDArray[np.generic]:
        return np.ascontiguousarray(np.rot90(values, -quarter))

    sides = support.open_sides
    return Support(
        support.item, support.room_id, support.height, support.above_floor, turned,
        np.asarray(cells(support.mask), np.bool_), np.asarray(cells(support.clear), np.float64),
        (sides[(0 - quarter) % 4], sides[(1 - quarter) % 4], sides[(2 - quarter) % 4],
         sides[(3 - quarter) % 4]),
        support.is_covered,
    )  # fmt: skip
