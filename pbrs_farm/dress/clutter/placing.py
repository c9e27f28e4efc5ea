"""Puts things on worktops: draws a spot, drops the thing to exact contact, adds it to the draft."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.frames import rotation_y
from pbrs_farm.core.house import Room
from pbrs_farm.dress.clutter.kinds import Stock
from pbrs_farm.dress.clutter.worktop import Spot, Worktop, turned_size
from pbrs_farm.dress.draft import Draft
from pbrs_farm.dress.generated.assembly import Made
from pbrs_farm.dress.style import Style

PART = "clutter"
_NEAR_M = 0.06


@dataclass(slots=True)
class Placing:
    """What is needed to put things into one room."""

    draft: Draft
    stock: Stock
    room: Room
    style: Style
    rng: np.random.Generator
    share: float
    bias: float = 0.0  # of the home: how much more or less than usual lies about

    def put(self, made: Made, at: F64, turn_rad: float) -> None:
        """Add the thing with the middle of its base at (3,), turned about +y."""
        piece, shape = made
        low, high = shape.bounds
        base = np.array([(low[0] + high[0]) / 2, low[1], (low[2] + high[2]) / 2])
        number = sum(self.draft.done.values())
        item = self.draft.placed(
            piece, shape, at - rotation_y(turn_rad) @ base, turn_rad,
            item_id=f"dress-{PART}-{len(self.draft.items)}-{number}",
            room_id=self.room.id, level_id=self.room.level_id,
        )  # fmt: skip
        self.draft.add(item, PART, piece)

    def refuse(self, reason: str) -> None:
        """Count a thing that was not put down."""
        self.draft.refused[f"{PART}: {reason}"] += 1

    def drop(self, top: Worktop, made: Made, *, faces_anywhere: bool, depth_pull: float) -> bool:
        """Put the thing where it fits on the worktop; False where it fits nowhere.

        depth_pull: how strongly it is drawn to the back (> 0) or to the front (< 0), per metre.
        """
        size = np.asarray(made[0].size)[[0, 2, 1]]
        low, high = made[1].bounds
        size = high - low
        turn = self.rng.uniform(-np.pi, np.pi) if faces_anywhere else self.rng.normal(0, 0.12)
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
        spot = Spot(int(rows[k]), int(columns[k]), *n)
        top.take(spot)
        self.put(made, top.middle(spot), top.grid.turn_rad + float(turn_rad))
        return True

    def drop_near(self, top: Worktop, made: Made, at: F64) -> bool:
        """Put the thing at a plan place (2,), or within 6 cm of it; False where it does not fit."""
        low, high = made[1].bounds
        # Of the free spots take the nearest; n: the rows and columns of cells that it covers.
        rows, columns, n = top.spots(turned_size(high - low, 0.0), margin_m=0.01)
        if not len(rows):
            return False
        places = top.grid.plan_of(columns + n[1] / 2, rows + n[0] / 2)
        away = np.linalg.norm(places - at, axis=1)
        k = int(np.argmin(away))
        if away[k] > _NEAR_M:
            return False
        spot = Spot(int(rows[k]), int(columns[k]), *n)
        top.take(spot)
        self.put(made, top.middle(spot), top.grid.turn_rad)
        return True
