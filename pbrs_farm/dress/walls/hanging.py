"""Walls of one room while items are hung; state: the occupied areas."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.catalogue import Piece, Shape
from pbrs_farm.core.house import Item
from pbrs_farm.core.record import Record, read_csv
from pbrs_farm.dress.mutable_house import MutableHouse
from pbrs_farm.dress.space import RoomSpace, WallFace
from pbrs_farm.dress.space.flights import flights_of
from pbrs_farm.dress.space.wall_faces import CELL_M, FAR_M
from pbrs_farm.home.room_use import RoomKind


class RoomWants(Record):
    """Wall items of a room type: a row of rooms.csv. Probabilities 0..1, counts, lux."""

    room: RoomKind
    pictures: int
    most_pictures: int
    shelves: int
    most_shelves: int
    mirror: float
    clock: float
    cloth: float
    pin_board: float
    notes: float
    coats: float
    most_coats: int
    sockets: int
    curtains: float
    blinds: float
    lux: float


WANTS: Final = {row.room: row for row in read_csv(Path(__file__).with_name("rooms.csv"), RoomWants)}

GAP_M = 0.0008  # gap between a wall's face and the back of an item on it
_LEAF_M = (0.03, 0.12, 0.22)  # distances before a wall at which an open door's leaf is looked for
_WAY_M = (0.36, 0.5, 0.7, 0.9)  # distances beyond which only deeper items are obstructed
_DEEP_M = 0.06  # deeper items also obstruct the adjacent walls
_BESIDE_STAIRS_M = 0.1
_OVER_STAIRS_M = 2.1  # minimum height above the floor of items over stairs
IN_FRONT_M = 0.35  # free depth before a picture, so that it is seen


@dataclass
class Hanging:
    """A room's free wall faces; state: the faces, and the house receives the items.

    part: the pass that hangs, for ids and the report. Faces are cut by door swings and stairs.
    `WallFace.starts` of a face gives the places for an item of a size; `hang` puts it there.
    """

    house: MutableHouse
    room: RoomSpace
    part: str
    faces: list[WallFace] = field(init=False)

    def __post_init__(self) -> None:
        sides = [(d, d.side_of(self.room.room.id)) for d in self.room.doors]
        doors = [(d.swing(s).union(d.before(s)), d.top_y) for d, s in sides if s is not None]
        # Nobody reaches what hangs over stairs.
        flights = flights_of(self.house, self.room.room, self.room.area)
        if not flights.under.is_empty:
            doors.append((flights.under.buffer(_BESIDE_STAIRS_M), self.floor_y + _OVER_STAIRS_M))
        self.faces = [_clear_of_doors(face, doors) for face in self.room.faces]

    @property
    def floor_y(self) -> float:
        """World y of the room's floor."""
        return self.room.room.floor_y

    def hang(
        self,
        piece: Piece,
        shape: Shape,
        face: int,
        s: float,
        low_y: float,
        *,
        tags: tuple[str, ...] = (),
        margin_m: float = 0.05,
    ) -> Item:
        """Hang a piece at s, low_y (its lower edge's middle) unchecked, and take its place and margin_m."""
        wall = self.faces[face]
        low, high = shape.bounds
        out = GAP_M - wall.recess_m(s + float(low[0]), s + float(high[0]))
        item = self.house.placed(
            piece,
            shape,
            wall.point(s, low_y, out),
            wall.turn_rad,
            item_id=next_id(self.house, self.part),
            room_id=self.room.room.id,
            level_id=self.room.room.level_id,
            tags=tags,
        )
        self.house.add(item, self.part, piece)
        self.faces[face] = wall.taken(
            s + float(low[0]) - margin_m,
            s + float(high[0]) + margin_m,
            low_y + float(low[1]) - margin_m,
            low_y + float(high[1]) + margin_m,
        )
        if float(high[2]) > _DEEP_M:
            self._stand_before_others(item, face)
        return item

    def _stand_before_others(self, item: Item, face: int) -> None:
        """Limit the free depth of the walls adjacent to a deep item."""
        low, high = item.bounds
        corners = np.array(
            [[x, low[1], z] for x in (low[0], high[0]) for z in (low[2], high[2])], np.float64
        )
        for k, neighbour in enumerate(self.faces):
            out, s = neighbour.out_of(corners), neighbour.s_of(corners)
            is_near = -_DEEP_M < out.min() < FAR_M and s.max() > 0 and s.min() < neighbour.length
            if k != face and is_near:
                self.faces[k] = neighbour.limited(
                    float(s.min()),
                    float(s.max()),
                    float(low[1]),
                    float(high[1]),
                    max(float(out.min()), 0.0),
                )


def _clear_of_doors(face: WallFace, doors: Sequence[tuple[BaseGeometry, float]]) -> WallFace:
    """The face without the area, below its top, that a door's leaf would hit when opened."""
    columns = (np.arange(face.clear.shape[1]) + 0.5) * CELL_M
    clear = face.clear
    for area, top_y in doors:
        rows, zone = max(int((top_y - face.low_y) / CELL_M), 0), area.buffer(CELL_M)
        for out_m in (*_LEAF_M, *_WAY_M):
            places = face.origin + columns[:, None] * face.along + out_m * face.normal
            hit = shapely.contains_xy(zone, places[:, 0], places[:, 2])
            if hit.any():
                clear = clear.copy() if clear is face.clear else clear
                free_m = np.float32(out_m if out_m in _WAY_M else 0.0)
                clear[:rows, hit] = np.minimum(clear[:rows, hit], free_m)
    return face if clear is face.clear else replace(face, clear=clear)


def next_id(house: MutableHouse, part: str) -> str:
    """A new id `dress-<pass>-<n>`."""
    n = house.kept.get(f"number of {part}", 0)
    assert isinstance(n, int)
    house.kept[f"number of {part}"] = n + 1
    return f"dress-{part}-{n}"


def faces_behind(
    room: RoomSpace, low: F64, high: F64, reach_m: float = 0.12
) -> list[tuple[int, float, float]]:
    """(face, s0, s1) of every wall face behind a box low..high (3,), largest first."""
    corners = np.array([[x, 0.0, z] for x in (low[0], high[0]) for z in (low[2], high[2])])
    spans = []
    for k, face in enumerate(room.faces):
        out, s = face.out_of(corners), face.s_of(corners)
        if -0.1 < out.min() < reach_m and s.max() > 0 and s.min() < face.length:
            spans.append((k, float(s.min()), float(s.max())))
    return sorted(spans, key=lambda f: f[1] - f[2])
