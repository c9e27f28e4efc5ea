"""The pass `furniture`: add pieces with their back at free walls, all ways and most floor kept free; no effects."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

import numpy as np
import shapely
from pydantic import model_validator

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.catalogue import Catalogue, Place
from pbrs_farm.core.classes import BOOKSHELF, COUNTER, SINK
from pbrs_farm.core.record import Nyu40, Record, read_toml
from pbrs_farm.dress.content import content
from pbrs_farm.dress.filled_walls import fill_wall, is_filled
from pbrs_farm.dress.fitting_pieces import own_or_all
from pbrs_farm.dress.furniture_look import BoardLook, grained, look_of
from pbrs_farm.dress.models import Model
from pbrs_farm.dress.mutable_house import MutableHouse
from pbrs_farm.dress.room_floor import LOWER_M, OUT_M, FloorSpot, RoomFloor, spot_at
from pbrs_farm.dress.space import RoomSpace, house_space
from pbrs_farm.dress.style import Style, room_style
from pbrs_farm.dress.walls.hanging import next_id
from pbrs_farm.geometry.swept import swept_by
from pbrs_farm.home.room_use import RoomKind, is_cooked_in

Range = tuple[float, float]
PASS = "furniture"
_LEAST_M2 = 3.0  # smaller rooms get nothing
_SIDE_M = 0.03  # distance to the neighbours, metres
_LIFT_M = 0.0001  # above the floor, so that no faces coincide
_FREE_BEFORE_M = 1.19  # free depth before a wall is measured up to this
_TRIES = 8  # attempts to place one piece
_MOST_FACES = 12_000  # models of the catalogue with more are left out
_FROM_CATALOGUE = 0.35  # chance to use the catalogue for a piece that can also be generated
_ALIKE, _BESIDE_ALIKE = 0.7, 0.8  # weight factors for kinds that the room already contains
_FROM_KITCHEN_M = 1.0  # least distance of bookcases from worktops, cookers and fridges
_BESIDE_M = 0.15  # greatest gap between a bed and its nightstand
_END_LIKED = 0.5  # an end of a free stretch, where all its other places together count 1
_FILLED = ("full", "filled")  # models with these words in their names have contents already
_LOOKS = 3  # different looks of the furniture added to one home


class WantedKind(Record):
    """A kind of wall furniture, and the conditions for adding it."""

    model: str
    width: Range
    height: Range
    depth: Range
    before_m: float = 0.55  # free floor in front of it
    alike: tuple[Nyu40, ...] = ()  # classes that make this kind less likely in a room
    groups: tuple[str, ...] = ()  # of the catalogue
    beside: Nyu40 | None = None  # placed next to an item of that class


class FurnitureTable(Record):
    kinds: dict[str, WantedKind]
    wanted: dict[RoomKind, tuple[tuple[str, float], ...]]

    @model_validator(mode="after")
    def _rooms_want_what_there_is(self) -> FurnitureTable:
        names = {*self.kinds}
        for room, wishes in self.wanted.items():
            if unknown := {name for name, _chance in wishes} - names:
                raise ValueError(f"{room}: no kind {', '.join(sorted(unknown))}")
        return self


_FILE: Final = read_toml(Path(__file__).with_name("furniture.toml"), FurnitureTable)
KINDS: Final[Mapping[str, WantedKind]] = _FILE.kinds
WANTED: Final[Mapping[RoomKind, tuple[tuple[str, float], ...]]] = _FILE.wanted


def add_furniture(house: MutableHouse, catalogue: Catalogue, style: Style, share: float) -> None:
    """Add furniture to the rooms of the house. share: 0..1 of what a room would get."""
    space = house_space(house)
    for room in space.rooms:
        wishes = WANTED.get(room.kind, ())
        if not wishes or not room.room.has_floor or room.area.area < _LEAST_M2:
            continue
        rng = house.rng(PASS, room.room.id)
        names = _draw_wanted(house, room, wishes, rng, share)
        floor = RoomFloor.of(house, space, room) if names or is_filled(room.kind) else None
        if floor is None:
            continue
        fill_wall(house, catalogue, floor, PASS, share)
        own_style = room_style(style, house.rng("style", room.room.id))
        look = look_of(
            house, catalogue, own_style, house.rng(PASS, "look", int(rng.integers(_LOOKS)))
        )
        for name in names:
            _stand_at_wall(house, catalogue, floor, name, look, rng)


def _draw_wanted(
    house: MutableHouse,
    room: RoomSpace,
    wishes: Sequence[tuple[str, float]],
    rng: np.random.Generator,
    share: float,
) -> list[str]:
    has = {house.items[n].nyu40 for n in room.items}
    names = []
    for name, chance in wishes:
        kind = KINDS[name]
        # The other side of a bed may still want its nightstand.
        less = _BESIDE_ALIKE if kind.beside is not None else _ALIKE
        chance *= less if has & set(kind.alike) else 1.0
        if rng.random() < chance * share:
            names.append(name)
    return names


def _stand_at_wall(
    house: MutableHouse,
    catalogue: Catalogue,
    floor: RoomFloor,
    name: str,
    look: BoardLook,
    rng: np.random.Generator,
) -> None:
    """Add a piece of that kind where it fits, trying narrower ones too."""
    kind = KINDS[name]
    width, height, depth = (
        float(rng.uniform(*side)) for side in (kind.width, kind.height, kind.depth)
    )
    piece_seed, from_catalogue = int(rng.integers(1 << 30)), rng.random() < _FROM_CATALOGUE
    widths = {max(width * factor, kind.width[0]) for factor in (1.0, 0.75, 0.55, 0.0)}
    for w in sorted(widths, reverse=True):
        if w > floor.wall_m:
            continue
        share = house.own_share
        model = (
            model_from_catalogue(catalogue, kind, w, piece_seed, share) if from_catalogue else None
        )
        model = model or _generated(kind, look, (w, height, depth), piece_seed)
        spot = _find_spot(house, floor, kind, model, rng)
        if spot is None:
            continue
        _put_at_spot(house, floor, model, spot)
        if name == "desk":
            _chair_before(house, floor, spot, look, rng)
        return
    house.refused[f"{PASS}: no free wall for a {name}"] += 1


def _generated(
    kind: WantedKind, look: BoardLook, size: tuple[float, float, float], seed: int
) -> Model:
    rng = np.random.default_rng(seed)
    return grained(content().things[kind.model](rng, look.style, look.boards, size), look)


def model_from_catalogue(
    catalogue: Catalogue, kind: WantedKind, width: float, seed: int, own_share: float
) -> Model | None:
    """A model of about that width, if any."""
    fit = [
        p
        for p in catalogue.of(*kind.groups)
        if p.place is Place.FLOOR
        and 0.7 * width < p.size[0] <= width * 1.1
        and p.size[1] < kind.depth[1] + 0.15
        and 0.6 * kind.height[0] < p.size[2] < kind.height[1] + 0.1
        and not any(word in p.name.lower() for word in _FILLED)
    ]
    if not fit:
        return None
    chosen = own_or_all(fit, catalogue.own, own_share, np.random.default_rng(seed))
    piece = chosen[seed % len(chosen)]
    shape = catalogue.shape(piece)
    if shape is None or sum(len(s.faces) for s in shape.surfaces) > _MOST_FACES:
        return None
    return piece, shape


def _find_spot(
    house: MutableHouse, floor: RoomFloor, kind: WantedKind, model: Model, rng: np.random.Generator
) -> FloorSpot | None:
    """A random free place for the piece, if any."""
    low, high = model[1].bounds
    w, h, d = (float(v) for v in high - low)
    if floor.is_too_full(w * d):
        return None
    y = floor.room.room.floor_y
    # As far as its own doors and drawers come out.
    swept = [s.area.bounds[3] for s in swept_by(model[1].surfaces, model[1].joints)]
    before_m = max(kind.before_m, max(swept, default=0.0) - float(high[2]) + _SIDE_M)
    depth = min(OUT_M + d + before_m, _FREE_BEFORE_M)
    places: list[tuple[int, float, float]] = []
    for k, face in enumerate(floor.faces):
        starts = face.starts(w + 2 * _SIDE_M, y + LOWER_M, y + h + 0.05, depth)
        places += [(k, s + _SIDE_M + w / 2, liked) for s, liked in _liked(starts)]
    weights = np.array([liked for _, _, liked in places])
    if kind.beside is not None:
        weights *= [_is_beside(house, floor, kind.beside, k, s, w) for k, s, _ in places]
    if BOOKSHELF in kind.alike:
        weights *= [not _is_cooked_at(house, floor, k, s, w) for k, s, _ in places]
    if not weights.any():
        return None
    n = min(_TRIES, int(np.count_nonzero(weights)))
    for j in rng.choice(len(places), n, replace=False, p=weights / weights.sum()):
        k, s, _ = places[int(j)]
        spot = spot_at(floor.faces[k], s, w, d, before_m)
        if floor.allows(spot.body, spot.front):
            return spot
    return None


def _liked(starts: F64) -> list[tuple[float, float]]:
    """(s, how much it is liked) of each start: furniture fills walls from their ends."""
    if not len(starts):
        return []
    breaks = np.flatnonzero(np.diff(starts) > 0.03)
    ends = {0, len(starts) - 1, *breaks.tolist(), *(breaks + 1).tolist()}
    rest = 1.0 / len(starts)
    return [(float(s), _END_LIKED if k in ends else rest) for k, s in enumerate(starts)]


def _is_beside(
    house: MutableHouse, floor: RoomFloor, nyu40: int, face_number: int, s: float, width: float
) -> bool:
    """True if a place at a wall is right next to an item of the class at that wall."""
    face = floor.faces[face_number]
    for number in floor.room.items:
        if house.items[number].nyu40 != nyu40:
            continue
        low, high = floor.space.bounds[number]
        corners = np.array([[x, 0.0, z] for x in (low[0], high[0]) for z in (low[2], high[2])])
        out, along = face.out_of(corners), face.s_of(corners)
        gap = max(float(along.min()) - (s + width / 2), s - width / 2 - float(along.max()))
        if -0.1 < out.min() < 0.4 and abs(gap) < _BESIDE_M:
            return True
    return False


def _is_cooked_at(
    house: MutableHouse, floor: RoomFloor, face_number: int, s: float, width: float
) -> bool:
    """Whether a place at a wall is among what a kitchen is made of: nobody keeps books there."""
    face = floor.faces[face_number]
    ends = [face.point(x, 0.0, 0.0) for x in (s - width / 2, s + width / 2)]
    low, high = np.min(ends, 0) - _FROM_KITCHEN_M, np.max(ends, 0) + _FROM_KITCHEN_M
    if floor.room.kind is RoomKind.KITCHEN:
        return True
    plan = [0, 2]
    for number in floor.room.items:
        item, bounds = house.items[number], floor.space.bounds[number]
        is_kitchen = item.nyu40 in (COUNTER, SINK) or is_cooked_in([item])
        if (
            is_kitchen
            and (bounds[0, plan] < high[plan]).all()
            and (bounds[1, plan] > low[plan]).all()
        ):
            return True
    return False


def _put_at_spot(house: MutableHouse, floor: RoomFloor, model: Model, spot: FloorSpot) -> None:
    _piece, shape = model
    low, high = shape.bounds
    # Its back comes to the wall, the middle of its width to the spot.
    y = floor.room.room.floor_y + _LIFT_M - float(low[1])
    position = spot.face.point(spot.s, y, OUT_M - float(low[2]))
    position = position - spot.face.along * float(low[0] + high[0]) / 2
    _add_to_floor(house, floor, model, position, spot.face.turn_rad)
    floor.take(spot.body, spot.front)
    floor.wall_m -= float(high[0] - low[0])


def _chair_before(
    house: MutableHouse,
    floor: RoomFloor,
    spot: FloorSpot,
    look: BoardLook,
    rng: np.random.Generator,
) -> None:
    """A chair before a desk, turned to it; none where it would be in the way."""
    chair = grained(content().things["desk_chair"](rng, look.style, look.boards), look)
    high = chair[1].bounds[1]
    out = OUT_M + spot.depth + float(high[2]) + float(rng.uniform(0.05, 0.12))
    y = floor.room.room.floor_y
    position = spot.face.point(spot.s + float(rng.normal(0, 0.06)), y + _LIFT_M, out)
    body = shapely.Point(position[0], position[2]).buffer(float(high[2]) + 0.04)
    x0, z0, x1, z1 = body.bounds
    # The chair is in front of the desk: ignore the desk's own front.
    front = floor.fronts.pop()
    is_free = floor.allows(body, shapely.Polygon()) and floor.space.is_free(
        np.array([x0, y + 0.03, z0]), np.array([x1, y + 1.0, z1])
    )
    floor.fronts.append(front)
    if is_free:
        _add_to_floor(
            house, floor, chair, position, spot.face.turn_rad + np.pi + float(rng.normal(0, 0.25))
        )
        floor.take(body, shapely.Polygon())


def _add_to_floor(
    house: MutableHouse, floor: RoomFloor, model: Model, at: F64, turn_rad: float
) -> None:
    room = floor.room.room
    item = house.placed(
        *model, at, turn_rad, item_id=next_id(house, PASS), room_id=room.id, level_id=room.level_id
    )
    house.add(item, PASS, model[0])
