"""Acceptance tests of a furnished plan, each with its violations, and measures; no effects."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from typing import Final

import numpy as np

from pbrs_farm.core.catalogue import Catalogue
from pbrs_farm.generate.floor_plan import PlacedPiece, Plan, Rect, RoomType
from pbrs_farm.generate.furnish.room_space import FurnishSpace, room_space
from pbrs_farm.generate.furnish.walk_bitmap import WalkMap

_SEATS: Final = ("sofa", "corner_sofa", "armchair", "chair")
MUST_HAVES: Final[dict[RoomType, tuple[tuple[str, ...], ...]]] = {
    RoomType.BEDROOM: (("bed",),),
    RoomType.OFFICE: (("desk",),),
    RoomType.DINING: (("dining_table",),),
    RoomType.STUDIO: (("bed",), _SEATS),
    RoomType.LIVING: (_SEATS,),
    RoomType.KITCHEN: (("sink",), ("cooker", "hob"), ("fridge",)),
    RoomType.BATHROOM: (("toilet",), ("washbasin",), ("bathtub", "shower")),
    RoomType.WC: (("toilet",),),
}
"""Of each type of room: one piece of each of these groups; and a lamp in every room."""

_MAY_OVERLAP: Final = {
    frozenset(pair)
    for pair in (
        ("chair", "dining_table"),
        ("chair", "desk"),
        ("office_chair", "desk"),
        ("chair", "coffee_table"),
        ("stool", "piano"),
        ("armchair", "dining_table"),
    )
}
_ON_FLOOR_M: Final = 0.05
_DEEP_M: Final = 0.01


@dataclass(frozen=True, slots=True)
class FurnishReport:
    """Faults of a furnished plan, one line each, and how full the home is."""

    broken: tuple[str, ...]
    pieces_per_m2: float  # on the floor
    walkable: float  # share of the floor of all rooms


def furnish_report(
    plan: Plan, pieces: tuple[PlacedPiece, ...], catalogue: Catalogue
) -> FurnishReport:
    """Check a furnished plan for missing (of those in the catalogue), blocked or overlapping pieces."""
    broken, walked, area = [], 0.0, 0.0
    grounds = [_ground_rect(p) for p in pieces]
    for number, room in enumerate(plan.rooms):
        placed = [p for p in pieces if p.room == number]
        broken += [f"{room.name}: no {group}" for group in missing(room.type, placed, catalogue)]
        space = room_space(plan, number)
        standing = [r for p, r in zip(pieces, grounds, strict=True) if p.elevation < 0.4]
        walk = WalkMap(space, standing)
        region = walk.reached(walk.free, ())
        if WalkMap(space).joined_ways != walk.joined_ways or region is None:
            broken.append(f"{room.name}: its doors are not joined")
        walked += walk.share(region) * room.area if region is not None else 0.0
        area += room.area
        broken += _blocked(space, placed)
    broken += _overlapping_pieces(pieces, grounds)
    n = sum(p.elevation < _ON_FLOOR_M for p in pieces)
    return FurnishReport(tuple(broken), n / area, walked / area)


def missing(type_: RoomType, pieces: list[PlacedPiece], catalogue: Catalogue) -> list[str]:
    """The groups that a room of that type lacks."""
    has = {p.piece.group for p in pieces}
    needed = MUST_HAVES.get(type_, ())
    if type_ not in (RoomType.BALCONY, RoomType.STAIRS):
        needed = (*needed, ("ceiling_lamp", "floor_lamp"))
    return [
        " or ".join(groups) for groups in needed if not has & set(groups) and catalogue.of(*groups)
    ]


def _blocked(space: FurnishSpace, pieces: list[PlacedPiece]) -> list[str]:
    """Furniture before doors, above window sills, or outside the room."""
    faults = []
    for piece in pieces:
        ground = _ground_rect(piece)
        if piece.elevation < 1.9 and any(_meet(ground, d) for d in space.doors.tolist()):
            faults.append(f"{piece.piece.name} blocks a door")
        if any(_meet(ground, o) for o in space.outside.tolist()):
            faults.append(f"{piece.piece.name} is in a wall")
        top = piece.elevation + piece.height
        if piece.piece.group == "sink":
            top = 0.9
        for window in space.windows:
            hides = any(
                top > low + 0.02 and _meet(ground, zone) for zone, low in window.clear_above
            )
            if hides and piece.elevation < 1.9:
                faults.append(f"{piece.piece.name} hides a window")
    return faults


def _overlapping_pieces(pieces: tuple[PlacedPiece, ...], grounds: list[Rect]) -> list[str]:
    faults = []
    for (a, ra), (b, rb) in combinations(zip(pieces, grounds, strict=True), 2):
        if a.room != b.room or not _meet(ra, rb):
            continue
        depth = min(a.elevation + a.height, b.elevation + b.height) - max(a.elevation, b.elevation)
        pair = frozenset((a.piece.group, b.piece.group))
        if depth > _DEEP_M and pair not in _MAY_OVERLAP:
            # Allow a television inside the edge of its cabinet, and taps below wall cabinets.
            if "tv" in pair and depth < 0.3:
                continue
            faults.append(f"{a.piece.name} and {b.piece.name} overlap")
    return faults


def _meet(a: Rect | list[float], b: Rect | list[float]) -> bool:
    x = min(a[2], b[2]) - max(a[0], b[0])
    z = min(a[3], b[3]) - max(a[1], b[1])
    return bool(np.minimum(x, z) > _DEEP_M)


def _ground_rect(piece: PlacedPiece) -> Rect:
    xs, zs = [p[0] for p in piece.corners], [p[1] for p in piece.corners]
    return min(xs), min(zs), max(xs), max(zs)
