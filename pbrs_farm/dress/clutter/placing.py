"""Put small items into a room, on worktops or at given positions. Effects: changes the house."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.catalogue import Shape
from pbrs_farm.core.frames import rotation_y
from pbrs_farm.core.house import Room, Surface
from pbrs_farm.dress.clutter.stock import CLUTTER, Stock
from pbrs_farm.dress.models import Model
from pbrs_farm.dress.mutable_house import MutableHouse
from pbrs_farm.dress.style import Style
from pbrs_farm.dress.worktop import TopSpot, Worktop, turned_size
from pbrs_farm.geometry.connected import connected_places
from pbrs_farm.home.room_use import RoomKind

PASS = "clutter"
_NEAR_M = 0.06
_MOST_IN_ROOM = 4


def separate_pair(model: Model, rng: np.random.Generator, mess: float) -> Model:
    """Turn and move the halves of a pair along x by mess (0: not at all); size updated, normals dropped."""
    piece, shape = model
    turns, ahead = rng.normal(0, 0.6 * mess, 2), rng.normal(0, 0.06 * mess, 2)
    quarter = piece.size[0] / 4
    surfaces = []
    for surface in shape.surfaces:
        points = surface.positions.astype(np.float64)
        # Each connected part goes with the side that its middle is on.
        of = _connected_part_of_vertices(surface)
        middle = np.array([points[of == k, 0].mean() for k in range(int(of.max()) + 1)])[of]
        for side, sign in enumerate((-1, 1)):
            mask = middle * sign > 0
            pivot, turn = np.array([sign * quarter, 0.0, 0.0]), rotation_y(float(turns[side]))
            step = [sign * abs(float(turns[side])) * quarter, 0.0, float(ahead[side])]
            points[mask] = (points[mask] - pivot) @ turn.T + pivot + step
        surfaces.append(replace(surface, positions=points.astype(np.float32), normals=None))
    moved = Shape(tuple(surfaces), shape.materials, shape.textures)
    low, high = moved.bounds
    width, height, depth = (float(v) for v in high - low)
    return replace(piece, size=(width, depth, height)), moved


def _connected_part_of_vertices(surface: Surface) -> NDArray[np.int64]:
    """(N,) the number of the connected part of each vertex; vertices of one place are one."""
    _, place = np.unique(np.round(surface.positions, 5), axis=0, return_inverse=True)
    place = place.reshape(-1)
    return connected_places(place[surface.faces], int(place.max()) + 1)[place]


@dataclass(slots=True)
class Placing:
    """A room while small items are added, and their source; state: the items placed so far.

    `drop` and `drop_near` find a free place on a worktop, `put` takes a position known to be free. All
    draw from `rng`, so their order affects the result.
    """

    house: MutableHouse
    stock: Stock
    room: Room
    style: Style
    rng: np.random.Generator
    share: float
    bias: float = 0.0  # tidiness offset of the home, added to fill levels
    kind: RoomKind = RoomKind.OTHER  # what the room is for
    taken: Counter[str] = field(default_factory=Counter)  # in this room, by kind
    laid: list[F64] = field(
        default_factory=list
    )  # triangles of dropped cloth, which later cloth may fall on

    def put(self, model: Model, at: F64, turn_rad: float) -> None:
        """Add the item at a free (3,) place (its base's centre), turned about +y; nothing is tested or marked."""
        piece, shape = model
        low, high = shape.bounds
        base = np.array([(low[0] + high[0]) / 2, low[1], (low[2] + high[2]) / 2])
        number = sum(self.house.done.values())
        item = self.house.placed(
            piece,
            shape,
            at - rotation_y(turn_rad) @ base,
            turn_rad,
            item_id=f"dress-{PASS}-{len(self.house.items)}-{number}",
            room_id=self.room.id,
            level_id=self.room.level_id,
        )
        self.house.add(item, PASS, piece)

    def laid_near(self, low: F64, high: F64) -> list[F64]:
        """The triangles of cloth in the room that may meet the box low..high (3,)."""
        return [
            c for c in self.laid if (c.min((0, 1)) <= high).all() and (c.max((0, 1)) >= low).all()
        ]

    def refuse(self, reason: str) -> None:
        """Count an item that was not placed."""
        self.house.refused[f"{PASS}: {reason}"] += 1

    def drop(self, top: Worktop, model: Model, *, faces_anywhere: bool, depth_pull: float) -> bool:
        """Put the item where it fits; False if nowhere. depth_pull: per metre to the back (> 0) or front."""
        size = np.asarray(model[0].size)[[0, 2, 1]]
        low, high = model[1].bounds
        size = high - low
        sd = 0.06 + 0.3 * self.house.mess
        turn = self.rng.uniform(-np.pi, np.pi) if faces_anywhere else self.rng.normal(0, sd)
        for turn_rad, inset in ((turn, 0.02), (0.0, 0.01), (0.0, 0.0)):
            needed = turned_size(size, turn_rad)
            rows, columns, n = top.spots(needed, inset_m=inset)
            if len(rows):
                break
        else:
            self.refuse("no room on the surface")
            return False
        # Prefer the back or the front, and leave the rest to chance.
        weight = np.exp(-depth_pull * rows * top.grid.cell_m)
        k = int(self.rng.choice(len(rows), p=weight / weight.sum()))
        spot = TopSpot(int(rows[k]), int(columns[k]), *n)
        top.take(spot)
        self.put(model, top.middle(spot), top.grid.turn_rad + float(turn_rad))
        return True

    def drop_near(self, top: Worktop, model: Model, at: F64, *, turn_rad: float = 0.0) -> bool:
        """Put the item within 6 cm of plan position (2,), taking its cells; False, uncounted, if it does not fit."""
        low, high = model[1].bounds
        # Of the free spots take the nearest; n: the rows and columns of cells that it covers.
        rows, columns, n = top.spots(turned_size(high - low, turn_rad), margin_m=0.01)
        if not len(rows):
            return False
        places = top.grid.plan_of(columns + n[1] / 2, rows + n[0] / 2)
        away = np.linalg.norm(places - at, axis=1)
        k = int(np.argmin(away))
        if away[k] > _NEAR_M:
            return False
        spot = TopSpot(int(rows[k]), int(columns[k]), *n)
        top.take(spot)
        self.put(model, top.middle(spot), top.grid.turn_rad + turn_rad)
        return True


def take_for_room(placing: Placing, kind: str) -> Model | None:
    """An item of that kind, counted as there; None, with the reason counted, beyond the room's most."""
    if placing.taken[kind] >= CLUTTER.most_in_room.get(kind, _MOST_IN_ROOM):
        placing.refuse(f"enough of {kind} in the room")
        return None
    model = placing.stock.take(placing.rng, kind, placing.style)
    if model is None:
        placing.refuse(f"no {kind} in the catalogue")
    placing.taken[kind] += model is not None
    return model
