"""Place, orientation and kind of a piece of furniture of the source; no effects."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from typing import Final

import numpy as np

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.catalogue import Catalogue, Piece
from pbrs_farm.core.classes import TABLE
from pbrs_farm.core.frames import rotation_y
from pbrs_farm.core.house import Item
from pbrs_farm.core.mesh import triangle_bounds

_UPRIGHT: Final = 0.999  # minimum cosine to the vertical of an upright item
_HIGH_PART: Final = 0.25  # top share of a seat's height in which its back is looked for
# Minimum offset of the top from the centre that identifies the back, as a share of the depth.
_CLEAR: Final = 0.12
_BOARD_M: Final = 0.04  # a thicker one is no skirting board
_APART_M: Final = 0.0005
_OFF_WALL_M: Final = 0.03
_HIGH_TABLE_M: Final = 0.62  # minimum height of a table for eating or working, metres
_BACKED: Final = frozenset({"chair", "office_chair", "armchair", "sofa", "bed"})


class HeldBy(Enum):
    """The part of a piece that stays when its model is replaced: back, centre (both at the base) or top."""

    BACK = "back"
    CENTRE = "centre"
    TOP = "top"


# Replaceable groups. Doors, windows and kitchen units are not replaced.
# fmt: off
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
}
# fmt: on


@dataclass(frozen=True, slots=True, eq=False)
class OldPlace:
    """Place of an item: its box about its own axes, front towards +z."""

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

    def held_at(self, held_by: HeldBy) -> F64:
        """(3,) in the turned frame: the point that stays, of the box's bottom or top."""
        middle = (self.low + self.high) / 2
        y = self.high[1] if held_by is HeldBy.TOP else self.low[1]
        return np.array([middle[0], y, self.low[2] if held_by is HeldBy.BACK else middle[2]])


def old_place(item: Item, group: str) -> OldPlace | None:
    """Place of an item, front by its box or, of seats and beds, its back rest; None if tilted or unknown."""
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
    """The place made shallower, its back before skirting boards, points (N, 3) of each in the world."""
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
    """The place moved to the wall face, among triangles (F, 3, 3), a little before or behind its back."""
    back, faces = float(place.low[2]), [np.zeros(0)]
    for corners in walls:
        local = place.local(corners.reshape(-1, 3)).reshape(-1, 3, 3)
        low, high = triangle_bounds(local)
        # Faces across its front direction, within 3 cm of its back.
        level = (high[:, 2] - low[:, 2] < _APART_M) & (np.abs(high[:, 2] - back) < _OFF_WALL_M)
        beside = (high[:, :2] > place.low[:2]).all(1) & (low[:, :2] < place.high[:2]).all(1)
        faces.append(high[level & beside, 2])
    depths = np.concatenate(faces)
    if not len(depths):
        return place
    step = np.array([0.0, 0.0, float(depths.max()) + _APART_M - back])
    return replace(place, low=place.low + step, high=place.high + step)


def _boxed(points: F64, turn_rad: float) -> OldPlace:
    local = points @ rotation_y(turn_rad)
    return OldPlace(turn_rad, local.min(0), local.max(0))


def _back_of(local: F64, place: OldPlace) -> str:
    # Side of the highest part relative to the centre, if clearly off centre.
    low, high = place.low, place.high
    top = local[local[:, 1] > high[1] - _HIGH_PART * (high[1] - low[1])]
    off = ((top.min(0) + top.max(0)) / 2 - (low + high) / 2) / np.maximum(high - low, 1e-6)
    axis = 0 if abs(off[0]) > abs(off[2]) else 2
    if abs(off[axis]) < _CLEAR:
        return ""
    return ("-" if off[axis] < 0 else "+") + ("x" if axis == 0 else "z")


def group_of_item(item: Item, catalogue: Mapping[str, Piece]) -> str:
    """Group of a source's item by its plain_id in the catalogue, else by its class; "" = unknown."""
    piece = catalogue.get(plain_id(item.source_class))
    if piece is not None and (piece.nyu40 == item.nyu40 or piece.group in HELD):
        return piece.group
    if item.nyu40 == TABLE:
        low, high = item.bounds
        return "dining_table" if high[1] - low[1] > _HIGH_TABLE_M else "coffee_table"
    return _GROUP_OF_CLASS.get(item.nyu40, "")


# Classes that mean one group, whatever the size.
# fmt: off
_GROUP_OF_CLASS: Final[Mapping[int, str]] = {
    4: "bed", 6: "sofa", 14: "desk", 17: "dresser", 32: "nightstand", 33: "toilet", 36: "bathtub",
    5: "chair", 10: "bookcase", 25: "tv",
}
# fmt: on


def plain_id(text: str) -> str:
    """An id without case, blanks and hyphens: libraries write their own name in two ways."""
    return re.sub(r"[\s_-]", "", text).lower()


def pieces_by_plain_id(catalogue: Catalogue) -> dict[str, Piece]:
    """The catalogue's pieces by plain_id."""
    return {plain_id(p.id): p for p in catalogue.pieces}
