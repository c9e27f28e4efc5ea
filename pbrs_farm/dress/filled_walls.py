"""Furniture that fills a free wall from side to side: wardrobes, shelves, show cases. Effects: changes the house."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.catalogue import Catalogue, Piece
from pbrs_farm.core.record import Nyu40, Record, read_toml
from pbrs_farm.dress.mutable_house import MutableHouse
from pbrs_farm.dress.room_floor import LOWER_M, OUT_M, FloorSpot, RoomFloor, spot_at
from pbrs_farm.dress.space import WallFace
from pbrs_farm.dress.space.wall_faces import CELL_M, FAR_M
from pbrs_farm.dress.walls.hanging import next_id
from pbrs_farm.home.room_use import RoomKind

_SIDE_M: Final = 0.012  # distance to the neighbours, metres
_LIFT_M: Final = 0.0001  # above the floor, so that no faces coincide
_UNDER_CEILING_M: Final = 0.02
_HIGHEST_M: Final = 2.7
_LENGTHS_M: Final = (1.3, 4.4)
_STRETCH: Final = (0.85, 1.2)  # what a piece may be narrowed and widened by
_TRIES: Final = 3  # stretches of wall


class _Filling(Record):
    before_m: float  # free floor in front of it
    alike: tuple[Nyu40, ...]  # a room that has one gets none


class _Fillings(Record):
    kinds: dict[str, _Filling]  # by group of the catalogue
    rooms: dict[RoomKind, dict[str, float]]  # group and chance


_FILE: Final = read_toml(Path(__file__).with_name("filled_walls.toml"), _Fillings)
KINDS: Final[Mapping[str, _Filling]] = _FILE.kinds


def is_filled(kind: RoomKind) -> bool:
    """Whether rooms of that use have a filled wall at all."""
    return kind in _FILE.rooms


class _Stretch(NamedTuple):
    face: WallFace
    start: float  # along the face, metres
    length: float
    high: float  # above the floor


def fill_wall(
    house: MutableHouse, catalogue: Catalogue, floor: RoomFloor, part: str, share: float
) -> None:
    """Fill one free wall by chance (share: of it) with a piece stretched to its length, if ways stay free."""
    rng = house.rng(part, "filled", floor.room.room.id)
    has = {house.items[n].nyu40 for n in floor.room.items}
    for group, chance in _FILE.rooms.get(floor.room.kind, {}).items():
        kind = KINDS[group]
        if rng.random() >= chance * share or has & {*kind.alike}:
            continue
        pieces = catalogue.of(group)
        deep = OUT_M + max((p.size[1] for p in pieces), default=0.0) + kind.before_m
        for stretch in _stretches(floor, min(deep, FAR_M - 0.01))[:_TRIES]:
            fits = [p for p in pieces if _STRETCH[0] <= stretch.length / p.size[0] <= _STRETCH[1]]
            if fits and _put(
                house, catalogue, floor, stretch, fits[int(rng.integers(len(fits)))], kind, part
            ):
                return
        house.refused[f"{part}: no free wall for a {group.replace('_', ' ')}"] += 1


def _stretches(floor: RoomFloor, free_m: float) -> Sequence[_Stretch]:
    """Stretches of wall with so much free before them, the longest first."""
    stretches = []
    y = floor.room.room.floor_y
    for face in floor.faces:
        ends = np.stack([face.point(s, y, 0.3) for s in (0.1, face.length - 0.1)])[:, [0, 2]]
        ceiling = min(face.high_y, float(floor.room.ceiling_y(ends).min()))
        high = min(ceiling - y - _UNDER_CEILING_M, _HIGHEST_M)
        if high < 2.0:
            continue
        starts = face.starts(CELL_M, y + LOWER_M, y + high - 0.03, free_m)
        for part in np.split(starts, np.flatnonzero(np.diff(starts) > 1.5 * CELL_M) + 1):
            length = (
                min(float(np.ptp(part)) + CELL_M - 2 * _SIDE_M, _LENGTHS_M[1]) if len(part) else 0.0
            )
            if length >= _LENGTHS_M[0]:
                stretches.append(_Stretch(face, float(part[0]) + _SIDE_M, length, high))
    return sorted(stretches, key=lambda s: -s.length)


def _put(
    house: MutableHouse,
    catalogue: Catalogue,
    floor: RoomFloor,
    stretch: _Stretch,
    piece: Piece,
    kind: _Filling,
    part: str,
) -> bool:
    """Put the piece at its stretch of wall; False where it would be in the way there."""
    wide, deep, tall = piece.size
    if floor.is_too_full(stretch.length * deep):
        return False
    middle = stretch.start + stretch.length / 2
    spot: FloorSpot = spot_at(stretch.face, middle, stretch.length, deep, kind.before_m)
    shape = catalogue.shape(piece) if floor.allows(spot.body, spot.front) else None
    if shape is None:
        return False
    room = floor.room.room
    scale: F64 = np.array([stretch.length / wide, stretch.high / tall, 1.0])
    position = stretch.face.point(middle, room.floor_y + _LIFT_M, OUT_M - float(shape.bounds[0][2]))
    house.add(
        house.placed(
            piece,
            shape,
            position,
            stretch.face.turn_rad,
            item_id=next_id(house, part),
            room_id=room.id,
            level_id=room.level_id,
            scale=scale,
        ),
        part,
        piece,
    )
    floor.take(spot.body, spot.front)
    floor.wall_m -= stretch.length
    return True
