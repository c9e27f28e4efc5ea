"""Furnish the empty rooms of an imported home like those of generated homes. Effects: reads the catalogue.

A room is empty if furniture covers less than 3 % of its floor, and sparse below 20 %: for `sparse`, such
a room keeps its furniture and gets the rest of its brief. Its use follows from its name and its furniture;
if its name says nothing, the room gets the use that the home lacks. A garage remains unchanged, with a note.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from typing import Final, Literal, NamedTuple

import numpy as np
import shapely
from shapely.geometry import Point, Polygon

from pbrs_farm.core import keys
from pbrs_farm.core.arrays import F64
from pbrs_farm.core.catalogue import Catalogue, Place
from pbrs_farm.core.classes import (
    BATHTUB,
    BED,
    BOOKSHELF,
    CABINET,
    CHAIR,
    COUNTER,
    DESK,
    DRESSER,
    LAMP,
    OTHERFURNITURE,
    REFRIGERATOR,
    SHELVES,
    SHOWER_CURTAIN,
    SINK,
    SOFA,
    TABLE,
    TOILET,
)
from pbrs_farm.core.house import House, ItemKind, Note
from pbrs_farm.dress.mutable_house import MutableHouse
from pbrs_farm.dress.space.house_space import HouseSpace, RoomSpace, floor_space
from pbrs_farm.dress.space.passages import Passage
from pbrs_farm.generate.floor_plan import (
    OpeningKind,
    PlacedPiece,
    Plan,
    PlanOpening,
    PlanRoom,
    PlanWall,
    Rect,
    RoomType,
    turned_by,
    upright_angle,
)
from pbrs_farm.generate.furnish.briefs import UseWithoutType
from pbrs_farm.generate.furnish.furnished import furnished
from pbrs_farm.generate.plan_walls import corners
from pbrs_farm.home.room_use import RoomKind

Furnish = Literal["none", "empty", "sparse"]

# maximum share of the floor under furniture
_MOST_COVERED: Final[dict[Furnish, float]] = {"none": 0.0, "empty": 0.03, "sparse": 0.2}
_STANDS_M: Final = 0.5  # minimum bottom height above the floor of a hanging item
_FLAT_M: Final = 0.12  # maximum height of an item to walk on
_SMALL_BATH_M2: Final = 2.6
_LEAST_M2: Final = 1.2
_MOST_DARK_M2: Final = {RoomKind.BATHROOM: 14.0, RoomKind.KITCHEN: 20.0}  # of rooms without windows
_LEAST_LIVING_M2, _LEAST_BEDROOM_M2 = 12.0, 7.0  # minimum floor areas of a room without a name


class _Use(NamedTuple):
    """How a kind of room is furnished: as which type of generated plans, or by which brief without a type."""

    type: RoomType
    brief: UseWithoutType | None = None


_USES: Final = {
    RoomKind.LIVING: _Use(RoomType.LIVING),
    RoomKind.BEDROOM: _Use(RoomType.BEDROOM),
    RoomKind.KITCHEN: _Use(RoomType.KITCHEN),
    RoomKind.BATHROOM: _Use(RoomType.BATHROOM),
    RoomKind.HALL: _Use(RoomType.HALL),
    RoomKind.DINING: _Use(RoomType.DINING),
    RoomKind.OFFICE: _Use(RoomType.OFFICE),
}

# Groups of briefs -> NYU40 classes of furniture that a room needs once.
# fmt: off
_SERVED_BY: Final[dict[str, frozenset[int]]] = {
    "bed": frozenset({BED}), "lounge": frozenset({SOFA}), "dining": frozenset({TABLE}),
    "desk": frozenset({DESK}), "wardrobe": frozenset({CABINET, OTHERFURNITURE}),
    "dresser": frozenset({CABINET, DRESSER}), "console": frozenset({CABINET, DRESSER, TABLE}),
    "shelves": frozenset({BOOKSHELF, SHELVES}), "armchair": frozenset({CHAIR}),
    "lamp": frozenset({LAMP}), "toilet": frozenset({TOILET}), "washbasin": frozenset({SINK}),
    "bath": frozenset({BATHTUB, SHOWER_CURTAIN}),
    "kitchen": frozenset({CABINET, COUNTER, SINK, REFRIGERATOR}),
}
# fmt: on


@dataclass(frozen=True, slots=True)
class _Storey:
    plan: Plan  # upright
    angle_rad: float  # rotation of the upright plan
    rooms: tuple[RoomSpace, ...]
    uses: tuple[_Use, ...]
    wanting: tuple[int, ...]  # rooms to furnish


def furnish_rooms(
    house: House, catalogue: Catalogue, seed: int, style: str = "", which: Furnish = "empty"
) -> House:
    """Furnish the empty (and `sparse`) rooms of a house by seed; BadInput for an unknown style."""
    with closing(MutableHouse(house, seed)) as mutable:
        return _furnished(mutable, catalogue, style, _MOST_COVERED[which])


def _furnished(
    mutable: MutableHouse, catalogue: Catalogue, style: str, most_covered: float
) -> House:
    house = mutable.source
    space = floor_space(mutable)
    kinds = _kinds_of_rooms(space)
    rng = np.random.default_rng(keys.seed(house.id, "furnish", mutable.seed))
    for level in house.levels:
        storey = _storey(house, space, level.id, mutable, kinds, most_covered)
        if storey.wanting:
            standing = {k: _standing(storey, k, mutable) for k in storey.wanting}
            pieces = furnished(
                storey.plan,
                catalogue,
                rng,
                style,
                rooms=storey.wanting,
                standing=standing,
                uses={k: u.brief for k, u in enumerate(storey.uses) if u.brief is not None},
                present={k: _present(storey.rooms[k], mutable) for k in storey.wanting},
            )
            _add(mutable, storey, pieces, catalogue)
    # Attribution licences (CC-BY) require users of the pictures to name the authors.
    owed = sorted(
        {(p.creator or p.library, p.licence) for p in mutable.used.values() if "BY" in p.licence}
    )
    after = mutable.frozen()
    if not owed:
        return after
    credit = "; ".join(f"{creator}, {licence}" for creator, licence in owed)
    line = "; ".join(x for x in (house.source.attribution, f"furniture: {credit}, modified") if x)
    return replace(after, source=replace(after.source, attribution=line))


def _kinds_of_rooms(space: HouseSpace) -> dict[str, RoomKind]:
    """Room id -> use; rooms of unknown use get the uses that the home lacks, the largest room first.

    In a home with windows, a room without them becomes the bathroom or kitchen that the home lacks, else a hall.
    """
    kinds = {room.room.id: room.kind for room in space.rooms}
    has_windows = any(room.windows for room in space.rooms)
    unnamed = [
        r for r in space.rooms if r.kind is RoomKind.OTHER and (r.windows or not has_windows)
    ]
    for room in sorted(unnamed, key=lambda r: (-r.area.area, r.room.id)):
        if room.area.area >= _LEAST_LIVING_M2 and RoomKind.LIVING not in kinds.values():
            kinds[room.room.id] = RoomKind.LIVING
        elif room.area.area >= _LEAST_BEDROOM_M2:
            kinds[room.room.id] = RoomKind.BEDROOM
    dark = [r for r in space.rooms if r.kind is RoomKind.OTHER and r not in unnamed]
    for room in sorted(dark, key=lambda r: (r.area.area, r.room.id)):
        kinds[room.room.id] = RoomKind.HALL
        for kind, most_m2 in _MOST_DARK_M2.items():
            if kind not in kinds.values() and room.area.area <= most_m2:
                kinds[room.room.id] = kind
                break
    return kinds


def _storey(
    house: House,
    space: HouseSpace,
    level_id: str,
    mutable: MutableHouse,
    kinds: Mapping[str, RoomKind],
    most_covered: float,
) -> _Storey:
    """The rooms of a level as a plan, with the numbers of those to furnish."""
    rooms, shapes, uses = [], [], []
    for room in space.rooms:
        # Furniture touches the walls' faces, wherever the outline was drawn.
        ground = corners(room.area.difference(room.walls.buffer(0.002, join_style="mitre")))
        if room.room.level_id == level_id and len(ground) >= 3:
            use = _use_of(room, kinds[room.room.id])
            rooms.append(room)
            uses.append(use)
            shapes.append(PlanRoom(use.type, room.room.name, ground))
    number = {room.room.id: k for k, room in enumerate(rooms)}
    walls: list[PlanWall] = []
    openings: list[PlanOpening] = []
    for passage in space.passages:
        sides = [number[r] for r in passage.room_ids if r in number]
        if sides:
            opening, wall = _opening(passage, sides, len(walls), rooms[sides[0]].room.floor_y)
            openings.append(opening)
            walls.append(wall)
    height = min((r.room.ceiling_y - r.room.floor_y for r in rooms), default=2.5)
    plan = Plan(tuple(shapes), tuple(walls), tuple(openings), max(height, 2.0))
    wanting = [
        k
        for k, room in enumerate(rooms)
        if _is_wanting(room, kinds[room.room.id], shapes[k].area, mutable, most_covered)
    ]
    angle = upright_angle(plan.rooms) if plan.rooms else 0.0
    return _Storey(turned_by(plan, angle), angle, tuple(rooms), tuple(uses), tuple(wanting))


def _use_of(room: RoomSpace, kind: RoomKind) -> _Use:
    if kind is RoomKind.BATHROOM and room.area.area < _SMALL_BATH_M2:
        return _Use(RoomType.WC)
    return _USES.get(kind, _Use(RoomType.STORE))


def _present(room: RoomSpace, mutable: MutableHouse) -> list[str]:
    """Groups of briefs already covered by the room's furniture."""
    classes = {mutable.items[n].nyu40 for n in _on_floor(room, mutable)}
    return [name for name, served in _SERVED_BY.items() if served & classes]


def _is_wanting(
    room: RoomSpace, kind: RoomKind, area: float, mutable: MutableHouse, most_covered: float
) -> bool:
    """True if a room has too little furniture; adds a note for a room of unknown use."""
    if kind is RoomKind.OUTDOOR or area < _LEAST_M2 or not room.room.has_floor:
        return False
    covered = sum(_ground(mutable.items[n].bounds).area for n in _on_floor(room, mutable))
    if covered > most_covered * area:
        return False
    if kind not in _USES:
        text = f"{room.room.name or 'a room without a name'} is empty and its use is not known"
        mutable.notes.append(Note("not-furnished", f"room {room.room.id}", text))
        return False
    return True


def _on_floor(room: RoomSpace, mutable: MutableHouse) -> list[int]:
    """Indices of the room's items at the height of a person."""
    floor = room.room.floor_y
    return [
        n
        for n in room.items
        if not mutable.items[n].kind.is_structure
        and mutable.items[n].bounds[0, 1] < floor + _STANDS_M
        and mutable.items[n].bounds[1, 1] > floor + _FLAT_M
    ]


def _ground(bounds: F64) -> Polygon:
    (x0, _, z0), (x1, _, z1) = bounds.tolist()
    return Polygon([(x0, z0), (x1, z0), (x1, z1), (x0, z1)])


def _standing(storey: _Storey, number: int, mutable: MutableHouse) -> list[Rect]:
    """Footprints of the room's furniture in the upright plan."""
    footprints = []
    for n in _on_floor(storey.rooms[number], mutable):
        ground = shapely.affinity.rotate(
            _ground(mutable.items[n].bounds), storey.angle_rad, (0, 0), use_radians=True
        )
        x0, z0, x1, z1 = ground.bounds
        footprints.append((x0, z0, x1, z1))
    return footprints


def _opening(
    passage: Passage, sides: Sequence[int], wall: int, floor_y: float
) -> tuple[PlanOpening, PlanWall]:
    """A door or window, with a wall of the same width."""
    (x, _, z), along = passage.centre.tolist(), passage.along[[0, 2]] * passage.width / 2
    # The wall's ends in plan, rounded to 0.1 mm as in generated homes.
    start = round(x - float(along[0]), 4), round(z - float(along[1]), 4)
    end = round(x + float(along[0]), 4), round(z + float(along[1]), 4)
    sill, height = max(passage.bottom_y - floor_y, 0.0), passage.top_y - passage.bottom_y
    kind = OpeningKind.DOOR
    if passage.is_window:
        kind = OpeningKind.WINDOW if sill > 0.3 else OpeningKind.FRENCH_WINDOW
    far_side = sides[1] if len(sides) > 1 and sides[1] != sides[0] else None
    return (
        PlanOpening(kind, wall, passage.width / 2, passage.width, height, sill, sides[0], far_side),
        PlanWall(start, end, max(2 * min(passage.half_wall), 0.02), far_side is None),
    )


def _add(
    mutable: MutableHouse, storey: _Storey, pieces: Sequence[PlacedPiece], catalogue: Catalogue
) -> None:
    """Add the pieces to the house, turned back into the frame of its walls."""
    cos, sin = math.cos(-storey.angle_rad), math.sin(-storey.angle_rad)
    lit = {k for k, room in enumerate(storey.rooms) if _has_lamp(room, mutable)}
    grounds = [Polygon(room.polygon).buffer(0.02) for room in storey.plan.rooms]
    for piece in pieces:
        shape = catalogue.shape(piece.piece)
        hangs = piece.piece.place is Place.CEILING
        skewed = not grounds[piece.room].contains(Polygon(piece.corners))
        if shape is None or skewed or (hangs and piece.room in lit):
            continue
        room = storey.rooms[piece.room].room
        size = np.ptp(shape.bounds, axis=0)
        scale = np.array([piece.width, piece.height, piece.depth]) / np.maximum(size, 1e-6)
        turn = -(piece.angle_rad - storey.angle_rad)
        # Move the centre of the base of its box to the piece's place.
        low, high = shape.bounds * scale
        mx, mz = (low[0] + high[0]) / 2, (low[2] + high[2]) / 2
        x, z = piece.x * cos - piece.z * sin, piece.x * sin + piece.z * cos
        x -= mx * math.cos(turn) + mz * math.sin(turn)
        z -= mz * math.cos(turn) - mx * math.sin(turn)
        position = np.array([x, room.floor_y + piece.elevation - low[1], z])
        item = mutable.placed(
            piece.piece,
            shape,
            position,
            turn,
            item_id=f"furnished_{len(mutable.items)}",
            room_id=room.id,
            level_id=room.level_id,
            scale=scale,
        )
        mutable.add(item, "furnish", piece.piece)


def _has_lamp(room: RoomSpace, mutable: MutableHouse) -> bool:
    ground = room.area
    return any(
        item.kind is ItemKind.LAMP and ground.contains(Point(*item.bounds.mean(0)[[0, 2]]))
        for item in mutable.items
        if item.n_faces and item.level_id == room.room.level_id
    )
