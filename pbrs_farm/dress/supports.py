"""Supporting surfaces: the horizontal tops of furniture and the floors of rooms, with their free height.

Works on raw meshes: open, thin, wound either way. Bounding boxes decide nothing; no effects.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from shapely import MultiPoint, Polygon, contains_xy, minimum_rotated_rectangle

from pbrs_farm.core.arrays import F64, Bools
from pbrs_farm.core.house import Item, ItemKind, Room
from pbrs_farm.core.mesh import face_areas, triangle_bounds, unit_normals
from pbrs_farm.geometry.plan_grid import CellHits, PlanGrid, cells_over, covered, covered_by_each
from pbrs_farm.geometry.scene_triangles import SceneTriangles

CELL_M = 0.01
LEAST_AREA_M2 = 0.02
LEAST_FREE_M = 0.12  # lower spaces hold nothing
MOST_FREE_M = 3.0  # clearance is capped at this height
_LEAST_NORMAL_Y = 0.95
_FLAT_M = 0.0006  # heights of one support differ by less
_BORDER_M = 0.05  # border of the grid around a support
_NEAR_M = 0.003  # maximum gap between a support and another item's face on it, metres
_LEVEL_M = (
    0.0002  # furniture's own face counts as the support up to here; a higher one is an obstacle
)
_OPEN_SHARE = 0.5  # a side is open where this share of its length is
_OUT_OF_REACH_M = 2.35  # supports higher above the floor are left out
_RIM_M = 0.03  # a bowl's rim rises at least this much above its bottom
_RIM_WITHIN_M = 0.16  # a rim is looked for this far beyond the edge of the bottom
_FLOOR_CELL_M = 0.02
_FLOOR_M = 0.004  # a floor's faces are within this of the room's floor_y


@dataclass(frozen=True, slots=True, eq=False)
class Support:
    """A horizontal surface for items. Its grid's +z points to the side from which it is used.

    One level of a piece of furniture may have several supports: a worktop with a sink in it has two.
    `dress.worktop.Worktop` gives the places for an item of a size.
    """

    item: int  # index of the furniture; FLOOR: the room's floor
    room_id: str
    height: float  # world y of its highest point
    above_floor: float  # metres
    grid: PlanGrid
    mask: Bools  # (rows, columns) the support is there and free
    clear: F64  # (rows, columns) free height above, metres; 0 = occupied
    open_sides: tuple[bool, bool, bool, bool]  # right (+x), front (+z), left, back
    is_covered: bool  # a shelf: something is above most of it

    @property
    def area(self) -> float:
        """Free area in square metres."""
        return float(self.mask.sum()) * self.grid.cell_m**2


FLOOR = -1


def supports_of_item(
    scene: SceneTriangles, index: int, room: Room, *, border_m: float = _BORDER_M
) -> list[Support]:
    """The horizontal tops and inner shelves of scene.items[index] inside the room, from low to high.

    A support is horizontal, has LEAST_AREA_M2 in one piece with LEAST_FREE_M above it, and is between
    4 cm above the floor and 2.35 m. The insides of closed bodies and the bottoms of bowls and sinks
    are excluded. border_m: width of the border around a support in its grid. Empty if the item has no
    horizontal surface.

        scene = SceneTriangles(house.items)
        heights = [s.height for s in supports_of_item(scene, 3, room)]  # world y, metres
    """
    item, corners = scene.items[index], scene.of_item(index)
    level = np.abs(unit_normals(corners)[:, 1]) > _LEAST_NORMAL_Y
    groups = _group_levels(corners[level], room)
    if not groups:
        return []
    plan = corners.reshape(-1, 3)[:, [0, 2]]
    grid = PlanGrid.around(plan, plan_turn(item, corners.reshape(-1, 3)), CELL_M, border_m)
    # See everything around from above once, for all its levels.
    around = faces_around(scene, [index], grid, float(groups[0][..., 1].max()))
    centres = grid.centres()
    indoors = contains_xy(Polygon(room.polygon), centres[..., 0], centres[..., 1])
    supports = []
    free, border = indoors & ~around.solid, round(border_m / CELL_M)
    for group, cover in zip(groups, covered_by_each(grid, groups), strict=True):
        found_level = _Level(index, cover & free, float(group[..., 1].max()), item.box is not None)
        supports += _supports_of_level(around, found_level, room, border)
    return supports


def floor_support(
    scene: SceneTriangles, room: Room, *, border_m: float = _BORDER_M
) -> Support | None:
    """The free part of a room's floor, without rugs and other items; None without a face there."""
    corners = np.insert(np.asarray(room.polygon, np.float64), 1, room.floor_y, axis=1)
    grid = PlanGrid.around(room.polygon, _turn_of_outline(corners), _FLOOR_CELL_M, border_m)
    off, kinds = np.array([0.0, _FLOOR_M, 0.0]), (ItemKind.FLOOR, ItemKind.GROUND)
    near = scene.items_in(corners.min(0) - off, corners.max(0) + off)
    floors = [k for k in near if scene.items[k].kind in kinds]
    faces = np.concatenate([np.zeros((0, 3, 3)), *(scene.of_item(k) for k in floors)])
    is_level = (np.abs(faces[..., 1] - room.floor_y) <= _FLOOR_M).all(1)
    mask = covered(grid, faces[is_level])
    centres = grid.centres()
    mask &= contains_xy(Polygon(room.polygon), centres[..., 0], centres[..., 1])
    if not mask.any():
        return None
    height = float(faces[is_level][..., 1].max())
    around = faces_around(scene, floors, grid, height)
    clear = np.minimum(around.clearance(height), max(room.ceiling_y - height, 0.0))
    mask &= clear >= LEAST_FREE_M
    sides = (True, True, True, True)
    return Support(FLOOR, room.id, height, height - room.floor_y, grid, mask, clear, sides, False)


def plan_turn(item: Item, points: F64) -> float:
    """Angle about +y of the item's box, else of the least box around its vertices (N, 3) in plan."""
    if item.box is not None:
        axes = item.box.axes
        return float(np.arctan2(-axes[2, 0], axes[0, 0]))
    return _turn_of_outline(points)


def _turn_of_outline(points: F64) -> float:
    outline = minimum_rotated_rectangle(MultiPoint(points[:, [0, 2]]))
    if not isinstance(outline, Polygon):
        return 0.0
    edge = np.diff(np.asarray(outline.exterior.coords)[:2], axis=0)[0]
    return float(np.arctan2(-edge[1], edge[0]))


def _group_levels(faces: F64, room: Room) -> list[F64]:
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
class FacesAround:
    """All faces over a grid, as heights in its cells, and where walls are."""

    grid: PlanGrid
    hits: CellHits
    is_own: Bools  # (N,) of the hits: a face of the furniture itself
    solid: Bools  # (rows, columns) inside a wall

    def clearance(self, height: float) -> F64:
        """(rows, columns) free metres above height, to MOST_FREE_M, the support's own faces apart."""
        hits = self.hits
        # Every face above the support limits the free height of its cells.
        stands = hits.high > height + np.where(self.is_own, _LEVEL_M, -_NEAR_M)
        clear = np.full(self.grid.shape, MOST_FREE_M)
        free = np.maximum(hits.low[stands] - height, 0.0)
        cell = hits.row[stands] * clear.shape[1] + hits.column[stands]
        np.minimum.at(clear.reshape(-1), cell, free)  # one index: numpy's fast way
        clear[self.solid] = 0.0
        return clear


def faces_around(
    scene: SceneTriangles, supports: Collection[int], grid: PlanGrid, low_y: float
) -> FacesAround:
    """Faces over a grid from low_y upwards; supports: indices of the supporting items."""
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
    return FacesAround(grid, hits, np.isin(owner, list(supports))[hits.triangle], solid)


class _Level(NamedTuple):
    item: int  # index of the furniture
    mask: Bools  # (rows, columns) it is there, indoors and outside walls
    height: float  # world y
    has_front: bool  # the furniture's grid points to its front


def _supports_of_level(
    around: FacesAround, level: _Level, room: Room, border: int
) -> list[Support]:
    least, height = LEAST_AREA_M2 / CELL_M**2, level.height
    if level.mask.sum() < least:
        return []
    clear = np.minimum(around.clearance(height), max(room.ceiling_y - height, 0.0))
    free = level.mask & (clear >= LEAST_FREE_M)

    # Take each connected part that can be reached from a side.
    parts, n = ndimage.label(free)
    parts = np.asarray(parts)
    supports = []
    for k, window in enumerate(ndimage.find_objects(parts, n), start=1):
        if np.count_nonzero(np.equal(parts[window], k)) < least:
            continue
        around_it = tuple(
            slice(max(s.start - border, 0), min(s.stop + border, size))
            for s, size in zip(window, parts.shape, strict=True)
        )
        part, air = np.asarray(parts[around_it] == k), clear[around_it]
        sides = _find_open_sides(part, air)
        # Leave out the inside of closed bodies: nothing leads there but from above.
        if not any(sides) and np.median(air[part]) < room.ceiling_y - height - 0.01:
            continue
        if not any(sides) and _is_in_a_bowl(around, parts == k, height):
            continue
        supports.append(
            turned_to_front(
                Support(
                    level.item,
                    room.id,
                    height,
                    height - room.floor_y,
                    around.grid.cropped(around_it),
                    part,
                    air,
                    sides,
                    bool(np.mean(air[part] < 0.6) > 0.5),
                ),
                room,
                has_front=level.has_front,
            )
        )
    return supports


def _find_open_sides(part: Bools, clear: F64) -> tuple[bool, bool, bool, bool]:
    """True for each edge of the part (right, front, left, back) without an obstacle next to it."""
    blocked = clear < LEAST_FREE_M
    sides = []
    for axis, step in ((1, 1), (0, 1), (1, -1), (0, -1)):
        # Look at the cells just beyond the outermost ones of each row or column.
        beyond = [_shift_mask(blocked, axis, -step * k) for k in (1, 2, 3)]
        ahead = beyond[0] | beyond[1] | beyond[2]
        order = part if step > 0 else np.flip(part, axis)
        last = order.shape[axis] - 1 - np.argmax(np.flip(order, axis), axis)
        last = last if step > 0 else order.shape[axis] - 1 - last
        lines = np.flatnonzero(part.any(axis))
        position = last[lines]
        edge = ahead[lines, position] if axis == 1 else ahead[position, lines]
        sides.append(bool(np.mean(~edge) > _OPEN_SHARE))
    return (sides[0], sides[1], sides[2], sides[3])


def _is_in_a_bowl(around: FacesAround, part: Bools, height: float) -> bool:
    """Whether a rim rises around a part of the grid on each of its four sides, as of a sink."""
    hits = around.hits
    # A rim begins at the bottom's height or below, unlike what hangs above it.
    rises = (hits.high > height + _RIM_M) & (hits.low < height + _RIM_M)
    rim = np.zeros(part.shape, np.bool_)
    rim[hits.row[rises], hits.column[rises]] = True
    n = round(_RIM_WITHIN_M / around.grid.cell_m)
    for axis in (0, 1):
        lines = np.flatnonzero(part.any(1 - axis))
        part_lines, rims = (np.moveaxis(m, axis, 0)[lines] for m in (part, rim))
        for step in (1, -1):
            own_, rims_ = part_lines[:, ::step], rims[:, ::step]
            last = own_.shape[1] - np.argmax(own_[:, ::-1], 1)
            is_met = [bool(r[e : e + n].any()) for r, e in zip(rims_, last, strict=True)]
            if np.mean(is_met) <= _OPEN_SHARE:
                return False
    return True


def _shift_mask(mask: Bools, axis: int, by: int) -> Bools:
    moved = np.zeros_like(mask)
    target, source = (
        (slice(by, None), slice(0, -by)) if by > 0 else (slice(0, by), slice(-by, None))
    )
    if axis == 0:
        moved[target] = mask[source]
    else:
        moved[:, target] = mask[:, source]
    return moved


def turned_to_front(support: Support, room: Room, *, has_front: bool) -> Support:
    """The support with +z at its known, open front, else at the open side with most room before it."""
    quarter = _front_quarter(support, room, has_front)
    if quarter == 0:
        return support
    return _turn_axes(support, quarter)


def _front_quarter(support: Support, room: Room, has_front: bool) -> int:
    # 0 = +z, 1 = +x, 2 = -z, 3 = -x, as quarters of a turn about +y.
    right, front, left, back = support.open_sides
    is_open = {0: front, 1: right, 2: back, 3: left}
    area = Polygon(room.polygon)
    # A top open on all sides faces the room; a shelf faces its open side.
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
    # Distance from the support's centre past its edge to the end of the room, metres.
    grid, (rows, columns) = support.grid, np.nonzero(support.mask)
    middle = grid.plan_of(columns.mean() + 0.5, rows.mean() + 0.5)
    ahead = grid.plan_of(np.sin(quarter * np.pi / 2), np.cos(quarter * np.pi / 2)) - grid.origin
    ahead = ahead / np.linalg.norm(ahead)
    half = [np.ptp(rows) / 2, np.ptp(columns) / 2][quarter % 2] * grid.cell_m
    steps = half + np.arange(0.05, 2.0, 0.05)
    places = middle + steps[:, None] * ahead
    outside = ~contains_xy(area, places[:, 0], places[:, 1])
    return float(steps[np.argmax(outside)] - half) if outside.any() else 2.0


def _turn_axes(support: Support, quarter: int) -> Support:
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
        support.item,
        support.room_id,
        support.height,
        support.above_floor,
        turned,
        np.asarray(cells(support.mask), np.bool_),
        np.asarray(cells(support.clear), np.float64),
        (
            sides[(0 - quarter) % 4],
            sides[(1 - quarter) % 4],
            sides[(2 - quarter) % 4],
            sides[(3 - quarter) % 4],
        ),
        support.is_covered,
    )
