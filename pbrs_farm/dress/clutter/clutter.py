"""The part `clutter` of the dressing: every room's surfaces, shelves, beds, seats and floor."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
import shapely
from scipy import ndimage
from shapely.geometry.base import BaseGeometry

from pbrs_farm.core.arrays import F64, Bools
from pbrs_farm.core.catalogue import Catalogue
from pbrs_farm.core.classes import (
    BED,
    CABINET,
    CHAIR,
    COUNTER,
    DRESSER,
    OTHERFURNITURE,
    REFRIGERATOR,
    SOFA,
)
from pbrs_farm.core.house import Item, ItemKind
from pbrs_farm.core.record import Record, read_toml
from pbrs_farm.core.walkable import CELL_M
from pbrs_farm.dress.clutter.cloths import drop_clothes, lay_throw
from pbrs_farm.dress.clutter.cushions import dress_bed, dress_seat, find_seat
from pbrs_farm.dress.clutter.placing import Placing, apart
from pbrs_farm.dress.clutter.receptacles import can_hold, receptacle_of, shares
from pbrs_farm.dress.clutter.stock import Stock, is_round
from pbrs_farm.dress.draft import Draft
from pbrs_farm.dress.space.floor_bitmaps import (
    FloorBitmap,
    doors_are_joined,
    flights_of,
    floor_bitmap,
    with_body,
)
from pbrs_farm.dress.space.house_space import HouseSpace, RoomSpace, house_space
from pbrs_farm.dress.style import Style, room_style
from pbrs_farm.dress.supports import faces_around, supports_of_item
from pbrs_farm.dress.things.assembly import Made
from pbrs_farm.dress.things.books import book_covers, leaning_book, run_of_books, stack_of_books
from pbrs_farm.dress.worktop import LIFT_M, TopSpot, Worktop
from pbrs_farm.geometry.plan_grid import PlanGrid
from pbrs_farm.geometry.scene_triangles import SceneTriangles
from pbrs_farm.home.names import words_of_item
from pbrs_farm.home.room_use import RoomKind

# What stands on tables, desks, counters, chests: by the table of shares, greatest first.


_MOST_OF_A_KIND = 3  # on one surface
_MOST_IN_ROOM = 4
_ANOTHER = 0.35  # chance of one more of the kind
_FULL = 0.45  # no more is put where less than this share of the surface is free
_MOST_FACTOR = 1.6
_LEFT_M, _NAPKINS, _NAPKIN_M = 0.025, 0.6, 0.12  # after a meal: how far aside; napkins
_CHAIR_M = 0.6  # from a chair's middle to the table it belongs to

_Kinds = tuple[tuple[str, float], ...]


class _Clutter(Record):
    # The file clutter.toml.
    in_front: tuple[str, ...]
    at_walls: tuple[str, ...]
    most_on_one: dict[str, int]
    most_in_room: dict[str, int]
    usual_m2: dict[str, float]
    floors: dict[RoomKind, _Kinds]
    shelves: dict[str, _Kinds]


_FILE: Final = read_toml(Path(__file__).with_name("clutter.toml"), _Clutter)
_USUAL_M2 = 0.4  # of receptacles that the file does not name


def fill_top(placing: Placing, top: Worktop, receptacle: str, there: Collection[str] = ()) -> int:
    """Put things on the worktop as the table says; how many were put there.

    there: kinds that the home has there already.
    """
    rng = placing.rng
    factor = min(top.support.area / _FILE.usual_m2.get(receptacle, _USUAL_M2), _MOST_FACTOR)
    wanted: list[str] = []
    most = _FILE.most_on_one | dict.fromkeys(there, 0)
    for row in shares().get(receptacle, ()):
        chance = np.clip((row.share + placing.bias * row.share**0.5) * factor, 0, 0.98)
        left = most.get(row.kind, _MOST_OF_A_KIND) - wanted.count(row.kind)
        while left > 0 and rng.random() < chance * placing.share:
            wanted.append(row.kind)
            left, chance = left - 1, _ANOTHER * chance
    return put_all(placing, top, wanted)


def set_table(placing: Placing, top: Worktop, chairs: Sequence[F64], scene: SceneTriangles) -> int:
    """Lay a place before each chair (plan points (2,)): a plate, a glass to its right; how many.

    After a meal things stand where hands left them, and a napkin lies beside a plate.
    """
    rng, is_eaten = placing.rng, placing.rng.random() < placing.draft.mess
    plate = placing.stock.take(placing.rng, "one_plate", placing.style)
    glass = placing.stock.take(placing.rng, "glass", placing.style)
    if plate is None or glass is None:
        return 0
    rows, columns = np.nonzero(top.support.mask)
    cells = top.grid.plan_of(columns + 0.5, rows + 0.5)
    middle, n = cells.mean(0), 0
    for chair in chairs:
        # Go in from the table's edge that is nearest to the chair.
        edge = cells[int(np.argmin(((cells - chair) ** 2).sum(1)))]
        inward = middle - edge
        if np.linalg.norm(chair - edge) > _CHAIR_M or np.linalg.norm(inward) < 0.2:
            continue
        inward = inward / np.linalg.norm(inward)
        right = np.array([-inward[1], inward[0]])
        at = edge + inward * (plate[0].size[0] / 2 + 0.03)
        aside = rng.normal(0, _LEFT_M, (2, 2)) if is_eaten else np.zeros((2, 2))
        turned = float(rng.normal(0, 0.6)) if is_eaten else 0.0
        n += placing.drop_near(top, plate, at + aside[0], turn_rad=turned)
        n += placing.drop_near(top, glass, at + inward * 0.1 + right * 0.17 + aside[1])
        if is_eaten and rng.random() < _NAPKINS:
            place = at - right * 0.22 + inward * 0.02
            if top.is_free(place, _NAPKIN_M):
                drop_clothes(placing, scene, place, top.height, napkin=True)
                n += 1
    return n


def put_all(placing: Placing, top: Worktop, kinds: list[str]) -> int:
    """Put a thing of each of the kinds on the worktop, the largest first."""
    things: list[tuple[str, Made]] = []
    for kind in kinds:
        made = _taken(placing, kind)
        if made is not None:
            things.append((kind, made))
    things.sort(key=lambda thing: -thing[1][0].size[0] * thing[1][0].size[1])
    n = 0
    for kind, made in things:
        if top.free_share() < _FULL and n:
            placing.refuse("surface full")
            continue
        pull = -3.0 if kind in _FILE.in_front else 5.0 + 12.0 * made[0].size[2]
        n += placing.drop(top, made, faces_anywhere=is_round(kind), depth_pull=pull)
    return n


def _taken(placing: Placing, kind: str) -> Made | None:
    """A thing of that kind; None, with its reason counted, where the room has enough of them."""
    if placing.taken[kind] >= _FILE.most_in_room.get(kind, _MOST_IN_ROOM):
        placing.refuse(f"enough of {kind} in the room")
        return None
    made = placing.stock.take(placing.rng, kind, placing.style)
    if made is None:
        placing.refuse(f"no {kind} in the catalogue")
    placing.taken[kind] += made is not None
    return made


# Things on the floor: bins, bags, shoes, baskets, boxes near walls, never in anybody's way.


_WALK_M = 0.65  # the width of a way, with something to spare
_REACH_M = 0.35  # a thing's middle is no farther from a wall or furniture
_NEAR_WALLS_M = 0.5  # of a room: farther ones are not its own
_AT_WALL_M = 0.12  # beyond its own radius, of what stands at walls
_KEPT_M = 0.04  # between things
_DOOR_M = 1.0  # kept free before doors
_OPEN_M = 0.6  # the same before what has doors or drawers
_OPENED = (CABINET, COUNTER, REFRIGERATOR, DRESSER, OTHERFURNITURE)
_STANDS_M, _LEAST_FRONT_M = 0.15, 0.4  # above the floor, how low and how high it reaches
_HEAD_M = 1.9
_RUG_M = 0.03  # what is lower may lie anywhere, but carries nothing


@dataclass(slots=True)
class _Floor:
    # Cells of a room's floor while things are put there.
    room: RoomSpace
    bitmap: FloorBitmap
    grid: PlanGrid  # of the same cells
    free: Bools  # nothing stands there, no door needs it
    walkable: Bools  # nothing stands there
    has_ways: bool  # one way joins the room's doors


def fill_floor(placing: Placing, scene: SceneTriangles, space: HouseSpace, room: RoomSpace) -> int:
    """Put things on the floor of a room; how many."""
    rng = placing.rng
    # Draw what the room usually has before its floor is looked at, which costs more.
    wanted = [
        kind
        for kind, chance in _FILE.floors.get(room.kind, ())
        if rng.random() < chance * placing.share
    ]
    floor = _floor(scene, space, room) if wanted else None
    flights = flights_of(placing.draft, room.room, room.area)
    if floor is not None and not flights.before.is_empty:
        plan = floor.grid.centres()
        floor.free &= ~shapely.contains_xy(flights.before, plan[..., 0], plan[..., 1])
    if floor is None or not floor.free.any():
        return 0
    n = 0
    for kind in wanted:
        made = placing.stock.take(rng, kind, placing.style)
        if made is not None and kind == "shoes":
            made = apart(made, rng, placing.draft.mess)
        if made is not None:
            n += _put(placing, floor, made, at_wall=kind in _FILE.at_walls)
    return n


def _floor(scene: SceneTriangles, space: HouseSpace, room: RoomSpace) -> _Floor | None:
    if room.area.is_empty or room.room.polygon.shape[0] < 3:
        return None
    y = room.room.floor_y
    bitmap = floor_bitmap(space, room)
    grid = PlanGrid(np.asarray(bitmap.origin), 0.0, CELL_M, bitmap.inside.shape)
    plan = grid.centres()
    around = faces_around(scene, (), grid, y)
    hits, inside = around.hits, bitmap.inside & ~around.solid
    # Rugs carry nothing, but one walks over them.
    stands = (hits.low < y + _HEAD_M) & (hits.high > y + 0.002)
    blocks = stands & (hits.high > y + _RUG_M)
    low, body = np.zeros(grid.shape, np.bool_), np.zeros(grid.shape, np.bool_)
    low[hits.row[stands], hits.column[stands]] = True
    body[hits.row[blocks], hits.column[blocks]] = True
    walkable = inside & ~body
    # Keep a metre before doors and windows that reach the floor.
    kept = np.zeros(grid.shape, np.bool_)
    for passage in (*room.doors, *(w for w in room.windows if w.bottom_y < y + 0.4)):
        side = passage.side_of(room.room.id)
        if side is None:
            continue
        zone = passage.before(side, _DOOR_M).union(passage.swing(side)).buffer(CELL_M)
        kept |= shapely.contains_xy(zone, plan[..., 0], plan[..., 1])
    fronts = shapely.union_all([_before_front(scene.items[k], y) for k in room.items])
    kept |= shapely.contains_xy(fronts, plan[..., 0], plan[..., 1])
    joined = doors_are_joined(bitmap, room)
    return _Floor(room, bitmap, grid, inside & ~low & ~kept, walkable, joined)


def _before_front(item: Item, floor_y: float) -> BaseGeometry:
    """Where one stands to open what has doors or drawers: a cupboard, a wardrobe, a cooker."""
    low_y, high_y = item.bounds[:, 1]
    is_closed = item.kind is ItemKind.OBJECT and item.nyu40 in _OPENED
    if not is_closed or low_y > floor_y + _STANDS_M or high_y < floor_y + _LEAST_FRONT_M:
        return shapely.Polygon()
    box = item.oriented_box
    out, across = box.axes[[0, 2], 2], box.axes[[0, 2], 0] * box.half[0]
    near = box.centre[[0, 2]] + out * box.half[2]
    far = near + out * _OPEN_M
    return shapely.Polygon([near - across, near + across, far + across, far - across])


def _put(placing: Placing, floor: _Floor, made: Made, *, at_wall: bool) -> bool:
    low, high = made[1].bounds
    reach = float(np.hypot(high[0] - low[0], high[2] - low[2])) / 2
    # Its middle keeps from everything by its own radius, but not much more.
    distance = ndimage.distance_transform_edt(np.pad(floor.free, 1))[1:-1, 1:-1] * CELL_M
    to_wall = ndimage.distance_transform_edt(np.pad(floor.walkable, 1))[1:-1, 1:-1] * CELL_M
    least = reach + _KEPT_M + CELL_M
    near = distance >= least
    if not at_wall:
        near &= to_wall <= least + _REACH_M
    else:
        # Boxes and bins stand at walls; beside a chair they would stand in the middle of a room.
        near &= _distance_to_walls(floor, distance >= least) <= least + _AT_WALL_M
    rows, columns = np.nonzero(near)
    for k in placing.rng.permutation(len(rows))[:12]:
        disc = _disc(floor.grid.shape, int(rows[k]), int(columns[k]), reach + CELL_M)
        # One way still joins all doors, where one did.
        if floor.has_ways and not doors_are_joined(
            with_body(floor.bitmap, disc, _WALK_M), floor.room
        ):
            continue
        x, z = floor.grid.plan_of(columns[k] + 0.5, rows[k] + 0.5)
        turn = _facing(to_wall, int(rows[k]), int(columns[k]))
        placing.put(
            made, np.array([x, placing.room.floor_y + LIFT_M, z]),
            turn + float(placing.rng.normal(0, 0.2)),
        )  # fmt: skip
        floor.free &= ~disc
        floor.walkable &= ~disc
        floor.bitmap.occupied[disc] = True
        return True
    placing.refuse("no place on the floor")
    return False


def _distance_to_walls(floor: _Floor, asked: Bools) -> F64:
    """(H, W) metres from the asked cells to real walls: rooms may open into each other.

    Where a home has no walls, to the room's outline.
    """
    found = np.full(asked.shape, np.inf)
    room = floor.room
    near = shapely.intersection(room.walls, room.area.buffer(_NEAR_WALLS_M))
    near = room.area.boundary if near.is_empty else near
    found[asked] = shapely.distance(shapely.points(floor.grid.centres()[asked]), near)
    return found


def _disc(shape: tuple[int, int], row: int, column: int, radius_m: float) -> Bools:
    i, j = np.ogrid[: shape[0], : shape[1]]
    return np.asarray((i - row) ** 2 + (j - column) ** 2 <= (radius_m / CELL_M) ** 2)


def _facing(to_wall: F64, row: int, column: int) -> float:
    # Away from what is nearest: up the slope of the distance.
    i, j = slice(max(row - 2, 0), row + 3), slice(max(column - 2, 0), column + 3)
    part = to_wall[i, j]
    if min(part.shape) < 2:
        return 0.0
    down, right = np.gradient(part)
    return float(np.arctan2(right.mean(), down.mean()))


# Fills shelves from left to right: runs of books with their spines out, piles, boxes, ornaments.


_LEAST_BOOK_M = 0.14  # free height that upright books need
_HEADROOM_M = 0.015
_TOUCH_M = 0.0003  # between a run and the book that leans on it


@dataclass(frozen=True, slots=True)
class ShelfPlan:
    """How a whole bookcase is filled."""

    books: float  # share of its length
    fullness: float
    others: _Kinds
    inset_m: float  # of the spines behind the front edge


def plan_shelves(placing: Placing, kind: RoomKind) -> ShelfPlan:
    """How the shelves of one bookcase are filled, by the room it stands in."""
    rng = placing.rng
    others, books = "decor", float(rng.uniform(0.08, 0.26))
    if kind is RoomKind.KITCHEN or (kind is RoomKind.DINING and rng.random() < 0.4):
        others, books = "kitchen", 0.05
    elif kind is RoomKind.OFFICE:
        others, books = "office", float(rng.uniform(0.15, 0.35))
    elif kind is RoomKind.BEDROOM and rng.random() < 0.35:
        others, books = "child", float(rng.uniform(0.08, 0.25))
    fullness = float(np.clip(rng.uniform(0.55, 1.0) + placing.bias, 0.2, 1.0))
    inset_m = float(rng.uniform(0.01, 0.04))
    return ShelfPlan(books, fullness * min(placing.share, 1.0), _FILE.shelves[others], inset_m)


def fill_shelf(placing: Placing, top: Worktop, plan: ShelfPlan) -> int:
    """Fill one shelf from left to right; how many things were put there."""
    rng = placing.rng
    n, column = 0, top.columns[0]
    free = top.free_height()
    while column < top.columns[1] - 4:
        if rng.random() > plan.fullness:
            # Leave a gap.
            column += int(rng.uniform(0.08, 0.22) / top.grid.cell_m)
            continue
        if free > _LEAST_BOOK_M and rng.random() < plan.books:
            after = _put_books(placing, top, column, plan, free)
        else:
            after = _put_other(placing, top, column, plan, free)
        n += after is not None
        column = after if after is not None else column + 6
    return n


def _put_books(
    placing: Placing, top: Worktop, column: int, plan: ShelfPlan, free: float
) -> int | None:
    rng, stock = placing.rng, placing.stock
    tall = free - _HEADROOM_M - 0.01
    depth = min(top.depth - 0.01, 0.24)
    if depth < 0.1 or tall < 0.11:
        return None
    # Now and then they lie; a pile may carry nothing.
    mess = placing.draft.mess
    if rng.random() < 0.08 + 0.14 * mess:
        return _leftmost(placing, top, column, [_lying(rng, placing, depth, tall)], plan.inset_m)
    most = min(float(rng.uniform(0.14, 0.6)), (top.columns[1] - column) * top.grid.cell_m - 0.012)
    leans = rng.random() < 0.2 + 0.4 * mess and most > 0.3
    for length in (most, 0.6 * most, 0.35 * most):
        if length < 0.03:
            return None
        made, last = run_of_books(rng, stock.covers, length - 0.09 * leans, tall, depth)
        row = [made]
        if leans and last > 0.14:
            row.append(leaning_book(rng, stock.covers, last * 0.97, depth))
        after = _leftmost(placing, top, column, row, plan.inset_m)
        if after is not None:
            return after
    return None


def _lying(rng: np.random.Generator, placing: Placing, depth: float, tall: float) -> Made:
    # A pile as high as the shelf lets it, its spines out.
    n = int(rng.integers(2, 6))
    while True:
        made = stack_of_books(rng, placing.stock.covers, n, most=min(depth / 0.72, 0.32))
        if made[0].size[2] < tall or n == 1:
            return made
        n -= 1


def _put_other(
    placing: Placing, top: Worktop, column: int, plan: ShelfPlan, free: float
) -> int | None:
    rng = placing.rng
    share = np.array([p for _, p in plan.others])
    kind = plan.others[int(rng.choice(len(share), p=share / share.sum()))][0]
    made = _taken(placing, kind)
    if made is None or made[0].size[2] > free - _HEADROOM_M or made[0].size[1] > top.depth:
        return None
    return _leftmost(placing, top, column + 1, [made], plan.inset_m + float(rng.uniform(0, 0.04)))


def _leftmost(
    placing: Placing, top: Worktop, column: int, row: list[Made], inset_m: float
) -> int | None:
    """Put things that touch side by side as far left as they fit; the next free column, or None.

    Their fronts stand in one line, inset_m behind the shelf's edge where there is room.
    """
    sizes = np.array([made[1].bounds[1] - made[1].bounds[0] for made in row])
    width = float(sizes[:, 0].sum() + _TOUCH_M * (len(row) - 1))
    needed = (width, float(sizes[:, 1].max()), float(sizes[:, 2].max()))
    rows, columns, n = top.spots(needed, margin_m=0.0)
    usable = columns >= column
    if not usable.any():
        return None
    first = int(columns[usable].min())
    choices = rows[usable & (columns == first)]
    target = top.rows[1] - n[0] - inset_m / top.grid.cell_m
    spot = TopSpot(int(choices[np.argmin(np.abs(choices - target))]), first, *n)
    top.take(spot)
    _put_row(placing, top, spot, row, sizes)
    return spot.column + spot.n_columns


def _put_row(placing: Placing, top: Worktop, spot: TopSpot, row: list[Made], sizes: F64) -> None:
    # Line the things up from the spot's left, their fronts on its front.
    cell, turn = top.grid.cell_m, top.grid.turn_rad
    front = (spot.row + spot.n_rows) * cell - 0.5 * cell
    x = spot.column * cell + 0.5 * cell
    for made, size in zip(row, sizes, strict=True):
        place = top.grid.plan_of((x + size[0] / 2) / cell, (front - size[2] / 2) / cell)
        placing.put(made, np.array([place[0], top.height, place[1]]), turn)
        x += float(size[0]) + _TOUCH_M


# The part `clutter` of the dressing.


_LEAST_SHELF_DEPTH_M = 0.12
_DOOR_MARGIN_M = 0.02  # around where doors swing
_THROWN = 0.9  # of sofas, where nobody tidies up
_SEAT_M = 0.72  # wide: a chair, wider ones are armchairs
_ON_SEAT_M = 0.2  # before its back
_LAID = 0.3  # of the dining tables
_ON_TOP_M = 0.1
_SCREENS = ("laptop", "monitor")
_SCREEN_WORDS = frozenset({"laptop", "computer", "monitor", "screen", "notebook", "pc", "imac"})


def clutter(draft: Draft, catalogue: Catalogue, style: Style, share: float) -> None:
    """Put small things where they belong, touching what they stand on and nothing else."""
    space = house_space(draft)
    scene = SceneTriangles(draft.items)
    covers = book_covers(draft.rng("clutter", "covers"), style)
    stock = Stock(catalogue, covers, int(draft.rng("clutter", "stock").integers(1 << 31)))
    bias = house_bias(draft.rng("clutter", "bias"))
    owners = _owners(scene, space)
    for room in space.rooms:
        rng = draft.rng("clutter", room.room.id)
        own = room_style(style, draft.rng("style", room.room.id))
        placing = Placing(draft, stock, room.room, own, rng, share, bias, room.kind)
        _fill_room(placing, scene, room, owners)
        fill_floor(placing, scene, space, room)


def house_bias(rng: np.random.Generator) -> float:
    """How much more or less than usual lies about in a home: ProcTHOR's Beta(3.5, 1.9) on -0.3..0.1, raised."""
    return float(rng.beta(3.5, 1.9) * 0.4 - 0.15)


def _door_zone(room: RoomSpace) -> BaseGeometry:
    """Where leaves swing and people go: nothing is put there, not even on a shelf."""
    sides = [(door, door.side_of(room.room.id)) for door in room.doors]
    zones = [d.before(s, d.clear_m).union(d.swing(s)) for d, s in sides if s is not None]
    return shapely.union_all(zones).buffer(_DOOR_MARGIN_M)


def _owners(scene: SceneTriangles, space: HouseSpace) -> dict[int, str]:
    """The one room that furnishes each item: its own, else the first of those it stands in."""
    owners: dict[int, str] = {}
    for room in space.rooms:
        for index in room.items:
            if index not in owners or scene.items[index].room_id == room.room.id:
                owners[index] = room.room.id
    return owners


def _fill_room(
    placing: Placing, scene: SceneTriangles, room: RoomSpace, owners: Mapping[int, str]
) -> None:
    zone = _door_zone(room)
    for index in room.items:
        item = scene.items[index] if index < len(scene.items) else None
        if item is None or owners[index] != room.room.id:
            continue
        if can_hold(item):
            _fill_item(placing, scene, room, index, zone)
        elif item.kind is ItemKind.OBJECT and item.nyu40 == BED:
            dress_bed(placing, scene, index)
        elif item.kind is ItemKind.OBJECT and item.nyu40 in (SOFA, CHAIR):
            _dress_seat(placing, scene, index, item)


def _fill_item(
    placing: Placing, scene: SceneTriangles, room: RoomSpace, index: int, zone: BaseGeometry
) -> None:
    plan, item = None, scene.items[index]
    there = _SCREENS if _has_screen(scene, room, index) else ()
    for support in supports_of_item(scene, index, room.room):
        receptacle = receptacle_of(item, support, room.kind)
        if not receptacle:
            continue
        top = Worktop(support)
        top.keep_free(zone)
        if receptacle == "shelf":
            plan = plan or plan_shelves(placing, room.kind)
            if top.depth >= _LEAST_SHELF_DEPTH_M:
                fill_shelf(placing, top, plan)
        else:
            if receptacle == "dining_table" and placing.rng.random() < _LAID * placing.share:
                set_table(placing, top, _chairs(scene, room), scene)
            fill_top(placing, top, receptacle, there)


def _has_screen(scene: SceneTriangles, room: RoomSpace, index: int) -> bool:
    """Whether a laptop or a monitor of the home stands on items[index]."""
    low, high = scene.bounds[index]
    for k in room.items:
        middle, foot = scene.bounds[k].mean(0), scene.bounds[k][0, 1]
        is_over = (low < middle)[[0, 2]].all() and (middle < high)[[0, 2]].all()
        is_on = low[1] < foot < high[1] + _ON_TOP_M
        if k != index and is_over and is_on and words_of_item(scene.items[k]) & _SCREEN_WORDS:
            return True
    return False


def _chairs(scene: SceneTriangles, room: RoomSpace) -> list[F64]:
    """Plan points (2,) of the middles of the room's chairs."""
    chairs = [k for k in room.items if scene.items[k].nyu40 == CHAIR]
    return [scene.bounds[k].mean(0)[[0, 2]] for k in chairs]


def _dress_seat(placing: Placing, scene: SceneTriangles, index: int, item: Item) -> None:
    low, high = item.bounds
    width = float(max(high[0] - low[0], high[2] - low[2]))
    # Chairs at tables carry none, armchairs one now and then.
    mess, kind = placing.draft.mess, placing.kind
    if item.nyu40 == SOFA:
        # A throw first: cushions need its place, and find it taken.
        if width > 1.2 and placing.rng.random() < _THROWN * mess * placing.share:
            lay_throw(placing, scene, index)
        else:
            dress_seat(placing, scene, index, 4 if width > 1.5 else 2)
    elif width < _SEAT_M and kind is RoomKind.BEDROOM and placing.rng.random() < mess:
        seat = find_seat(scene, index, placing.room.floor_y)
        if seat is not None:
            rows = seat.back_row[np.isfinite(seat.back_row)]
            column = float(np.flatnonzero(np.isfinite(seat.back_row)).mean())
            at = seat.grid.plan_of(column, float(rows.max()) + _ON_SEAT_M / seat.grid.cell_m)
            drop_clothes(placing, scene, at, seat.level)
    elif width > 0.72 and placing.rng.random() < 0.5:
        dress_seat(placing, scene, index, 1)
