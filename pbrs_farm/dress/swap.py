"""The part `swap`: furniture gets another model of its group within its old footprint; no effects.

Sets swap together: what is the same model in one room (chairs round a table, both bedside tables).
What stood on it is set down on the new one.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from typing import Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.catalogue import Catalogue, Piece, Place, Shape
from pbrs_farm.core.classes import CHAIR, TABLE
from pbrs_farm.core.frames import rotation_y
from pbrs_farm.core.house import Item, ItemKind, LightPart
from pbrs_farm.core.mesh import boxes_meeting, triangle_bounds
from pbrs_farm.dress.draft import Draft, moved_item
from pbrs_farm.dress.style import Style
from pbrs_farm.dress.surfaces.skirting import BASEBOARD
from pbrs_farm.geometry.heights import highest_below
from pbrs_farm.geometry.surface_points import item_triangles, surface_points
from pbrs_farm.home.room_use import is_outdoors

# Where a piece of furniture of the source stands, which way it faces, what it is.


_UPRIGHT: Final = 0.999  # cosine to the vertical of what is not tilted
_HIGH_PART: Final = 0.25  # of the height, at the top: where the back of a seat is
_CLEAR: Final = 0.12  # of the depth: how far the top must lie behind the middle
_BOARD_M: Final = 0.04  # a thicker one is no skirting board
_APART_M: Final = 0.0005
_OFF_WALL_M: Final = 0.03
_HIGH_TABLE_M: Final = 0.62  # one eats or works at what is higher
_BACKED: Final = frozenset({"chair", "office_chair", "armchair", "sofa", "bed"})


class HeldBy(Enum):
    """What of a piece keeps its place when it gets another model."""

    BACK = "back"
    CENTRE = "centre"
    TOP = "top"


# What may be swapped. Doors, windows and what kitchens are built of stay.
HELD: Final[Mapping[str, HeldBy]] = {
    **dict.fromkeys(
        ("sofa", "armchair", "bed", "desk", "nightstand", "tv_stand", "bookcase", "shelves",
         "wardrobe", "dresser", "cabinet", "fridge", "toilet", "bidet", "washbasin", "bathtub",
         "washer", "wall_lamp", "piano", "radiator"),
        HeldBy.BACK,
    ),
    **dict.fromkeys(
        ("chair", "office_chair", "stool", "ottoman", "coffee_table", "dining_table", "plant", "table_lamp",
         "floor_lamp", "tv", "laptop", "vase", "bin"),
        HeldBy.CENTRE,
    ),
    "ceiling_lamp": HeldBy.TOP,
}  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False)
class OldPlace:
    """An item as it stands: its box about its own axes, front towards +z."""

    turn_rad: float  # about +y
    low: F64  # (3,) in the turned frame, metres
    high: F64

    @property
    def size(self) -> tuple[float, float, float]:
        """Width, depth, height in metres."""
        width, height, depth = (float(v) for v in self.high - self.low)
        return width, depth, height

    @property
    def turn(self) -> F64:
        """(3, 3) world from the turned frame."""
        return rotation_y(self.turn_rad)

    def local(self, points: F64) -> F64:
        """(N, 3) points of the turned frame."""
        return np.asarray(points @ self.turn)

    def held_at(self, held: HeldBy) -> F64:
        """(3,) in the turned frame: the point that stays, of the box's bottom or top."""
        middle = (self.low + self.high) / 2
        y = self.high[1] if held is HeldBy.TOP else self.low[1]
        return np.array([middle[0], y, self.low[2] if held is HeldBy.BACK else middle[2]])


def old_place(item: Item, group: str) -> OldPlace | None:
    """Where an item stands; None where it is tilted or its front is not known.

    The front is its box's third axis; of seats and beds the back rest says which way it looks.
    """
    if item.box is None or item.box.axes[1, 1] < _UPRIGHT or not item.n_faces:
        return None
    points = np.concatenate([s.positions for s in item.surfaces]).astype(np.float64)
    if not np.isfinite(points).all():
        return None
    front = item.box.axes[:, 2]
    turn_rad = float(np.arctan2(front[0], front[2]))
    place = _boxed(points, turn_rad)
    if group in _BACKED:
        back = _back_of(place.local(points), place)
        # Seats that look another way than their box are turned by quarters.
        quarter = {"-z": 0, "+z": 2, "-x": 1, "+x": 3}.get(back, 0)
        if quarter:
            place = _boxed(points, turn_rad + quarter * np.pi / 2)
    return place


def before_boards(place: OldPlace, boards: Sequence[F64]) -> OldPlace:
    """The place drawn in so far that its back stands before skirting boards, which homes draw into it.

    boards: (N, 3) points of each in the world.
    """
    back, low = float(place.low[2]), place.low.copy()
    for points in boards:
        local = place.local(points)
        first, last = local.min(0), local.max(0)
        runs_along = last[2] - first[2] < _BOARD_M
        behind = back - _BOARD_M < first[2] and back < last[2] < back + _BOARD_M
        beside = last[0] > place.low[0] and first[0] < place.high[0] and first[1] < place.high[1]
        if runs_along and behind and beside and last[1] > place.low[1]:
            low[2] = max(low[2], last[2] + _APART_M)
    return replace(place, low=low)


def at_wall(place: OldPlace, walls: Sequence[F64]) -> OldPlace:
    """The place moved to the wall face at its back, where it was drawn a little before it or in it.

    walls: (F, 3, 3) triangles of each wall in the world.
    """
    back, faces = float(place.low[2]), [np.zeros(0)]
    for corners in walls:
        local = place.local(corners.reshape(-1, 3)).reshape(-1, 3, 3)
        low, high = triangle_bounds(local)
        # Faces across its front direction, within 3 cm of its back.
        level = (high[:, 2] - low[:, 2] < _APART_M) & (np.abs(high[:, 2] - back) < _OFF_WALL_M)
        beside = (high[:, :2] > place.low[:2]).all(1) & (low[:, :2] < place.high[:2]).all(1)
        faces.append(high[level & beside, 2])
    found = np.concatenate(faces)
    if not len(found):
        return place
    step = np.array([0.0, 0.0, float(found.max()) + _APART_M - back])
    return replace(place, low=place.low + step, high=place.high + step)


def _boxed(points: F64, turn_rad: float) -> OldPlace:
    local = points @ rotation_y(turn_rad)
    return OldPlace(turn_rad, local.min(0), local.max(0))


def _back_of(local: F64, place: OldPlace) -> str:
    # Where the highest part lies against the middle, if clearly to one side.
    low, high = place.low, place.high
    top = local[local[:, 1] > high[1] - _HIGH_PART * (high[1] - low[1])]
    off = ((top.min(0) + top.max(0)) / 2 - (low + high) / 2) / np.maximum(high - low, 1e-6)
    axis = 0 if abs(off[0]) > abs(off[2]) else 2
    if abs(off[axis]) < _CLEAR:
        return ""
    return ("-" if off[axis] < 0 else "+") + ("x" if axis == 0 else "z")


def group_of_item(item: Item, catalogue: Mapping[str, Piece]) -> str:
    """The group of an item of the source by its catalogue id, else by its class; "" = unknown.

    catalogue: by plain_id.
    """
    piece = catalogue.get(plain_id(item.source_class))
    if piece is not None and (piece.nyu40 == item.nyu40 or piece.group in HELD):
        return piece.group
    if item.nyu40 == TABLE:
        low, high = item.bounds
        return "dining_table" if high[1] - low[1] > _HIGH_TABLE_M else "coffee_table"
    return _GROUP_OF_CLASS.get(item.nyu40, "")


# Classes that mean one group, whatever the size.
_GROUP_OF_CLASS: Final[Mapping[int, str]] = {
    4: "bed", 6: "sofa", 14: "desk", 17: "dresser", 32: "nightstand", 33: "toilet", 36: "bathtub",
    5: "chair", 10: "bookcase", 25: "tv",
}  # fmt: skip


def plain_id(text: str) -> str:
    """An id without case, blanks and hyphens: libraries write their own name in two ways."""
    return re.sub(r"[\s_-]", "", text).lower()


def pieces_by_plain_id(catalogue: Catalogue) -> dict[str, Piece]:
    """The catalogue's pieces by plain_id."""
    return {plain_id(p.id): p for p in catalogue.pieces}


# Which pieces of the catalogue fit an old place, and at which scale.


LEAST_SIDE: Final = 0.75  # of the old footprint's sides
HEIGHT: Final = 0.15  # how far the height may differ
SCALE: Final = (0.8, 1.25)  # models are of their true size
STRETCH: Final = 1.2
ALIKE: Final = 0.93
MADE_OF_BOARDS: Final = frozenset(
    {"bed", "desk", "nightstand", "tv_stand", "bookcase", "shelves", "wardrobe", "dresser",
     "cabinet", "dining_table", "coffee_table", "fridge", "washer"}
)  # fmt: skip

Scale = tuple[float, float, float]  # along a piece's width, height, depth


def scale_of(piece: Piece, place: OldPlace) -> Scale | None:
    """The scale at which a piece fills the old footprint; None where it does not fit.

    Each side is 75 to 100 % of the old one, the height within 15 %. What is made of boards may be
    up to STRETCH longer along one axis than along another, all else keeps its proportions.
    """
    width, depth, height = piece.size
    old_width, old_depth, old_height = place.size
    if min(width, depth, height) <= 0:
        return None
    # Along x, y, z: how much larger the piece may become.
    room = (old_width / width, (1 + HEIGHT) * old_height / height, old_depth / depth)
    least = min(room)
    most = STRETCH * least if piece.group in MADE_OF_BOARDS else least
    across, up, along = (min(r, most) for r in room)
    up = min(up, max(old_height / height, least))
    fits = (
        SCALE[0] <= least
        and max(across, up, along) <= SCALE[1]
        and across * width >= LEAST_SIDE * old_width
        and along * depth >= LEAST_SIDE * old_depth
        and up * height >= (1 - HEIGHT) * old_height
    )
    return (across, up, along) if fits else None


def common_scale(piece: Piece, places: Sequence[OldPlace]) -> Scale | None:
    """The scale at which a piece fits every place of a set; None where it fits not all.

    A set's members are of one size, or nearly so.
    """
    scales = [scale_of(piece, place) for place in places]
    known = [s for s in scales if s is not None]
    if len(known) < len(places):
        return None
    least = (min(s[0] for s in known), min(s[1] for s in known), min(s[2] for s in known))
    is_alike = all(least[k] >= ALIKE * s[k] for s in known for k in range(3))
    return least if is_alike else None


def is_lit_alike(piece_has_lights: bool, items: Sequence[Item]) -> bool:
    """Whether a piece can carry the lights of the items: a lamp that is on needs a light source."""
    return piece_has_lights or not any(item.lights for item in items)


# The items round a thing: their bounds, and where its surface reaches into theirs.
# State: bounds and cubes of the items that were asked for are kept.


CUBE_M: Final = 0.02
_BITS: Final = 21  # of a cube's number along each axis

Cubes = NDArray[np.int64]


class PieceSurroundings:
    """The items of a draft, as they are when they are asked for."""

    def __init__(self, items: Sequence[Item]) -> None:
        self.items = items
        self._kept: dict[int, tuple[Item, F64]] = {}  # by id, with the item so that it lives
        self._triangles: dict[int, tuple[Item, F64]] = {}

    def bounds(self) -> F64:
        """(I, 2, 3) of all items, NaN for those without vertices."""
        for item in self.items:
            if id(item) not in self._kept:
                self._kept[id(item)] = (item, item.bounds)
        return np.array([self._kept[id(item)][1] for item in self.items]).reshape(-1, 2, 3)

    def triangles(self, item: Item) -> F64:
        """(F, 3, 3) an item's triangles, metres."""
        if id(item) not in self._triangles:
            self._triangles[id(item)] = (item, item_triangles(item))
        return self._triangles[id(item)][1]

    def near(self, low: F64, high: F64) -> list[int]:
        """Places of the items that are no structure and whose bounds meet the box low..high (3,)."""
        bounds = self.bounds()
        meets = ((bounds[:, 1] >= low) & (bounds[:, 0] <= high)).all(1)
        return [int(k) for k in np.flatnonzero(meets) if not self.items[int(k)].kind.is_structure]

    def n_shared(self, item: Item, without: Collection[int]) -> int:
        """Cubes of 2 cm that an item's surface shares with others'; without: places left out."""
        low, high = item.bounds
        own = _cubes(self.triangles(item))
        count = 0
        for k in self.near(low, high):
            if k not in without:
                corners = self.triangles(self.items[k])
                least, most = triangle_bounds(corners)
                meets = ((most >= low) & (least <= high)).all(1)
                count += len(np.intersect1d(own, _cubes(corners[meets]), assume_unique=True))
        return count


def _cubes(corners: F64) -> Cubes:
    if not len(corners):
        return np.zeros(0, np.int64)
    points = surface_points(corners, CUBE_M)
    cube = np.floor(points / CUBE_M).astype(np.int64) + (1 << (_BITS - 1))
    return np.unique((cube[:, 0] << 2 * _BITS) | (cube[:, 1] << _BITS) | cube[:, 2])


# What stands on a piece of furniture, and how far it goes down to another one.


_ROUNDING_M: Final = 1e-3  # of the bounds
_CONTACT_M: Final = 0.015  # how far a thing may hang above or sink into what it stands on
_LOW_PART_M: Final = 0.05  # of a thing, at its bottom: what can touch
_FLAT_M: Final = 0.06  # rugs and mats lie under everything
_LEFT_ALONE: Final = frozenset(
    {ItemKind.DOOR, ItemKind.WINDOW, ItemKind.STAIRS}
)  # fmt: skip


def things_on(around: PieceSurroundings, index: int) -> tuple[list[int], list[int]]:
    """(what stands on an item, what stands in it or under it), by place; index: the item's.

    Structure, doors and windows, and what lies flat below it, are neither.
    """
    bounds = around.bounds()
    (low, high), corners = bounds[index], around.triangles(around.items[index])
    on: list[int] = []
    inside: list[int] = []
    for k in around.near(low - _CONTACT_M, high + _CONTACT_M):
        item, (own_low, own_high) = around.items[k], bounds[k]
        middle = (own_low + own_high) / 2
        is_over = (low[[0, 2]] < middle[[0, 2]]).all() and (middle[[0, 2]] < high[[0, 2]]).all()
        if k == index or item.kind in _LEFT_ALONE or not is_over or not item.n_faces:
            continue
        if own_high[1] < low[1] + _FLAT_M:
            continue
        (on if _stands_on(item, corners, float(high[1])) else inside).append(k)
    return on, inside


def _stands_on(item: Item, corners: F64, top_y: float) -> bool:
    # Its foot is where the furniture seen from above is.
    points = lowest_points(item)
    height = highest_below(points[:, [0, 2]], corners, top_y + _ROUNDING_M)
    gap = points[:, 1] - height
    return bool(np.isfinite(height).any() and abs(float(gap.min())) <= _CONTACT_M)


# What holds a thing: a fact of it that another model keeps, with its height.


_STANDS_M: Final = 0.03  # above the floor, at most
ALIKE_HELD: Final[Mapping[Place, frozenset[Place]]] = {
    Place.FLOOR: frozenset({Place.FLOOR, Place.KITCHEN, Place.SURFACE}),
    Place.SURFACE: frozenset({Place.FLOOR, Place.SURFACE}),
    Place.WALL: frozenset({Place.WALL}),
    Place.CEILING: frozenset({Place.CEILING}),
}
"""By what holds a thing, the places of the models that may be held so."""


def held_by(draft: Draft, around: PieceSurroundings, index: int, group: str) -> Place:
    """What holds items[index]: the floor, another piece (SURFACE), a wall or the ceiling."""
    if HELD.get(group) is HeldBy.TOP:
        return Place.CEILING
    item, low_y = around.items[index], float(around.bounds()[index, 0, 1])
    if _above_floor(draft, item, low_y) <= _STANDS_M:
        return Place.FLOOR
    # What stands on a piece, a step or a platform does not hang.
    (low, high), all_bounds = around.bounds()[index], around.bounds()
    below = boxes_meeting(all_bounds[:, 0], all_bounds[:, 1], low - _CONTACT_M, high)
    others = [around.items[int(k)] for k in np.flatnonzero(below) if k != index]
    stands = any(
        other.kind is not ItemKind.WALL
        and other.n_faces
        and _stands_on(item, around.triangles(other), low_y + _CONTACT_M)
        for other in others
    )
    return Place.SURFACE if stands else Place.WALL


def _above_floor(draft: Draft, item: Item, low_y: float) -> float:
    """How far a height lies above the floor of the item's room, or of its storey."""
    floors = [room.floor_y for room in draft.source.rooms if room.id == item.room_id]
    floors += [lv.elevation for lv in draft.source.levels if lv.id == item.level_id]
    return low_y - floors[0] if floors else 0.0


def lowest_points(item: Item) -> F64:
    """(N, 3) vertices within 5 cm of the item's bottom; every few of them where they are many."""
    points = np.concatenate([s.positions for s in item.surfaces]).astype(np.float64)
    points = points[points[:, 1] <= points[:, 1].min() + _LOW_PART_M]
    return np.asarray(points[:: max(1, len(points) // 600)])


def drop_onto(item: Item, corners: F64) -> float | None:
    """How far (m, upwards) an item goes to stand on triangles (F, 3, 3) seen from above.

    None where less than most of its foot would find something to stand on.
    """
    points = lowest_points(item)
    height = highest_below(points[:, [0, 2]], corners)
    gap = points[:, 1] - height
    if not np.isfinite(height).any():
        return None
    drop = float(gap[np.isfinite(gap)].min())
    # Its foot must be held on both sides of its middle, each way.
    foot = points[points[:, 1] < points[:, 1].min() + 0.01]
    held = foot[foot[:, 1] - drop - highest_below(foot[:, [0, 2]], corners) < _CONTACT_M]
    middle = (foot.min(0) + foot.max(0))[[0, 2]] / 2
    plan = held[:, [0, 2]]
    if len(plan) == 0 or not ((plan.min(0) <= middle).all() and (plan.max(0) >= middle).all()):
        return None
    return -drop


# The part `swap`.


PART: Final = "swap"
FREE_CUBES: Final = 6  # of 2 cm, shared with neighbours beyond what the old one shared: a touch
_TRIES: Final = 5  # pieces that are tried for a set
_MOST_LIFT_M: Final = 0.3  # a thing that stands on it goes no farther up or down
_ON_FLOOR_M: Final = 0.005  # what the source draws so little above a floor stands on it
_ON_WALLS: Final = frozenset({"radiator", "wall_lamp"})
_NEAR_WALL_M: Final = 0.05
_UNDER_TABLES: Final = frozenset({"dining_table", "desk", "coffee_table"})


@dataclass(frozen=True, slots=True, eq=False)
class _Member:
    # One item of a set.
    index: int
    item: Item
    place: OldPlace
    on: tuple[int, ...]  # what stands on it
    held_by: Place


def swap(draft: Draft, catalogue: Catalogue, style: Style, share: float) -> None:
    """Give a share of the source's furniture another model of the catalogue.

    Each side of the new one is 75 to 100 % of the old one's, its height within 15 %; its back and
    its axis stay. Things on it are set down on the new one; where one would find no place, where
    the new one would reach into its neighbours, or where things stand in it, the old one stays.
    What stands on a balcony or a terrace stays, too.
    """
    around = PieceSurroundings(draft.items)
    for key, indices in _sets(draft, catalogue).items():
        group = key[0]
        rng = draft.rng(PART, *key)
        if rng.random() >= share:
            continue
        members = _members(draft, indices, group, around)
        if members is None:
            continue
        _swap_set(draft, catalogue, group, members, around, rng)


def _sets(draft: Draft, catalogue: Catalogue) -> dict[tuple[str, ...], list[int]]:
    # Items of one model in one room, by group, room, level and model.
    by_id = pieces_by_plain_id(catalogue)
    # Catalogues furnish rooms: an upholstered armchair would stand in the rain.
    outdoors = {r.id for r in draft.source.rooms if is_outdoors(r)}
    found: dict[tuple[str, ...], list[int]] = {}
    for index, item in enumerate(draft.items[: len(draft.source.items)]):
        group = "" if item.kind.is_structure else group_of_item(item, by_id)
        if group in HELD and item.room_id not in outdoors:
            key = (group, item.level_id, item.room_id or "", item.source_class or item.name)
            found.setdefault(key, []).append(index)
    return found


def _members(
    draft: Draft, indices: Sequence[int], group: str, around: PieceSurroundings
) -> list[_Member] | None:
    found = []
    for index in indices:
        item = draft.items[index]
        place = old_place(item, group)
        if place is None:
            draft.refused[f"{PART}: which way it faces is not known"] += 1
            return None
        on, inside = things_on(around, index)
        if group in _UNDER_TABLES:
            inside = [k for k in inside if draft.items[k].nyu40 != CHAIR]
        if inside:
            draft.refused[f"{PART}: things stand in it or under it"] += 1
            return None
        if HELD[group] is HeldBy.BACK:
            place = before_boards(place, _boards_near(draft, item))
        if group in _ON_WALLS:
            place = at_wall(place, _walls_near(draft, item))
        by = held_by(draft, around, index, group)
        found.append(
            _Member(index, item, place, tuple(on), Place.WALL if group in _ON_WALLS else by)
        )
    return found


def _boards_near(draft: Draft, item: Item) -> list[F64]:
    """(N, 3) points of each skirting board that the item's bounds meet."""
    low, high = item.bounds
    boards = []
    for board in draft.items:
        if BASEBOARD not in board.tags or not board.n_faces:
            continue
        least, most = board.bounds
        if (least < high).all() and (most > low).all():
            points = np.concatenate([s.positions for s in board.surfaces])
            boards.append(points.astype(np.float64))
    return boards


def _walls_near(draft: Draft, item: Item) -> list[F64]:
    """(F, 3, 3) triangles of each wall whose bounds come near the item's."""
    low, high = item.bounds + np.array([[-_NEAR_WALL_M], [_NEAR_WALL_M]])
    found = []
    for wall in draft.items:
        if wall.kind is ItemKind.WALL and BASEBOARD not in wall.tags and wall.n_faces:
            least, most = wall.bounds
            if (least < high).all() and (most > low).all():
                found.append(item_triangles(wall))
    return found


def _swap_set(
    draft: Draft, catalogue: Catalogue, group: str, members: list[_Member],
    around: PieceSurroundings, rng: np.random.Generator,
) -> None:  # fmt: skip
    places, items = [m.place for m in members], [m.item for m in members]
    old = plain_id(items[0].source_class)
    candidates = [
        (piece, scale)
        for piece in catalogue.of(group)
        if plain_id(piece.id) != old and (scale := common_scale(piece, places)) is not None
    ]
    if not candidates:
        draft.refused[f"{PART}: no other model fits"] += 1
        return
    # What hangs stays hung, what stands keeps standing.
    candidates = [
        (piece, scale)
        for piece, scale in candidates
        if all(piece.held_by in ALIKE_HELD[m.held_by] for m in members)
    ]
    if not candidates:
        draft.refused[f"{PART}: no other model is held as the old one is"] += 1
        return
    why = "no other model can be used"
    for k in rng.permutation(len(candidates))[:_TRIES]:
        piece, scale = candidates[int(k)]
        shape = catalogue.shape(piece)
        if shape is None or not is_lit_alike(bool(shape.lights), items):
            continue
        new = [_placed(draft, piece, shape, scale, group, m) for m in members]
        lifts = _lifts(around, members, new)
        if lifts is None:
            why = "a thing on it would find no place"
        elif not _is_free(around, members, new):
            why = "it would reach into its neighbours"
        else:
            _put(draft, group, piece, members, new, lifts)
            return
    draft.refused[f"{PART}: {why}"] += 1


def _placed(
    draft: Draft, piece: Piece, shape: Shape, scale: Scale, group: str, member: _Member
) -> Item:
    """The piece as the member's item: same id, room, kind and tags of its source."""
    held, place, item = HELD[group], member.place, member.item
    held = HeldBy.BACK if member.held_by is Place.WALL else held
    low, high = shape.bounds * np.array(scale)
    # Bring the point that is held to where the old one's was.
    own = np.array([
        (low[0] + high[0]) / 2,
        high[1] if held is HeldBy.TOP else low[1],
        low[2] if held is HeldBy.BACK else (low[2] + high[2]) / 2,
    ])  # fmt: skip
    at = place.turn @ (place.held_at(held) - own)
    if held is not HeldBy.TOP:
        at[1] -= _above_floor_m(draft, item, float(place.low[1]))
    new = draft.placed(
        piece, shape, at, place.turn_rad, item_id=item.id, room_id=item.room_id,
        level_id=item.level_id, scale=np.array(scale),
    )  # fmt: skip
    new = replace(new, nyu40=item.nyu40 or piece.nyu40, kind=item.kind)
    return replace(new, lights=_lights_like(item.lights, new.lights))


def _above_floor_m(draft: Draft, item: Item, low_y: float) -> float:
    """How much a piece stands above its room's floor where that is a few millimetres; else 0."""
    above = _above_floor(draft, item, low_y)
    return above if 0 < above <= _ON_FLOOR_M else 0.0


def _lights_like(old: tuple[LightPart, ...], new: tuple[LightPart, ...]) -> tuple[LightPart, ...]:
    # A lamp keeps its power and its colour; one that was off stays off.
    if not old:
        return ()
    total = sum(light.share for light in new) or 1.0
    whole = sum(light.share for light in old)
    first = old[0]
    return tuple(
        replace(
            light, power=first.power, unit=first.unit, share=light.share / total * whole,
            rgb_linear=first.rgb_linear,
        )
        for light in new
    )  # fmt: skip


def _is_free(around: PieceSurroundings, members: list[_Member], new: list[Item]) -> bool:
    # The new ones may reach into their neighbours no farther than the old ones did.
    own = {m.index for m in members} | {k for m in members for k in m.on}
    return all(
        around.n_shared(item, own) <= around.n_shared(m.item, own) + FREE_CUBES
        for m, item in zip(members, new, strict=True)
    )


def _lifts(
    around: PieceSurroundings, members: list[_Member], new: list[Item]
) -> dict[int, float] | None:
    # How far each thing on the old ones goes up, with what stands on it; None: one finds no place.
    lifts: dict[int, float] = {}
    for member, item in zip(members, new, strict=True):
        corners = item_triangles(item)
        for index in member.on:
            up = drop_onto(around.items[index], corners)
            if up is None or abs(up) > _MOST_LIFT_M:
                return None
            on, inside = things_on(around, index)
            lifts.update({k: up for k in (index, *on, *inside) if k != member.index})
    return lifts


def _put(
    draft: Draft, group: str, piece: Piece, members: list[_Member], new: list[Item],
    lifts: dict[int, float],
) -> None:  # fmt: skip
    for member, item in zip(members, new, strict=True):
        draft.change(member.index, item, PART)
        draft.done[f"{PART}: {group}"] += 1
    for index, up in lifts.items():
        step = np.array([0.0, up, 0.0])
        draft.change(index, moved_item(draft.items[index], step), PART)
    draft.used[piece.id] = piece
