"""The pass `walls`: hang all wall items, room by room; no effects."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.catalogue import Catalogue
from pbrs_farm.core.classes import BED
from pbrs_farm.dress.content import content
from pbrs_farm.dress.mutable_house import MutableHouse
from pbrs_farm.dress.space import HouseSpace, WallFace, house_space
from pbrs_farm.dress.style import Style
from pbrs_farm.dress.walls.fittings import fit_switches, hang_clock, hang_mirrors, hang_notes
from pbrs_farm.dress.walls.hanging import WANTS, Hanging
from pbrs_farm.dress.walls.kitchens import hang_kitchen
from pbrs_farm.dress.walls.pictures import Gallery, hang_pictures, hang_pin_board
from pbrs_farm.dress.walls.radiators import hang_radiators, wants_radiators
from pbrs_farm.dress.walls.wall_shelves import hang_cloth, hang_shelves
from pbrs_farm.home.room_use import RoomKind, is_cooked_in

_HOOKS_M: Final = 1.68  # height of the hook board's lower edge above the floor
_RACK_BEFORE_M: Final = 0.55
_FROM_BED_M: Final = 0.6  # nobody sleeps below coats or against them
PASS = "walls"


def hang_coats(hanging: Hanging, space: HouseSpace, style: Style, share: float) -> None:
    """Hooks with what the room's people take off there, on a free stretch of wall."""
    kind = hanging.room.kind
    rng = hanging.house.rng("coats", hanging.room.room.id)
    if rng.random() >= WANTS[kind].coats * share:
        return
    # Nobody hangs coats where it smells of cooking.
    items = hanging.house.items
    if is_cooked_in(items[k] for k in hanging.room.items if k < len(items)):
        return
    beds = [space.bounds[k] for k in hanging.room.items if items[k].nyu40 == BED]
    for n in range(WANTS[kind].most_coats, 0, -1):
        piece, shape = content().things["coat_rack"](rng, style, n, kind is RoomKind.BATHROOM)
        low, high = shape.bounds
        width, bottom = float(high[0] - low[0]), hanging.floor_y + _HOOKS_M
        places = [
            (k, float(s))
            for k, face in enumerate(hanging.faces)
            for s in face.starts(width + 0.1, bottom + float(low[1]), bottom + 0.12, _RACK_BEFORE_M)
            if not _is_at_a_bed(face, float(s), width + 0.1, beds)
        ]
        if places:
            k, s = places[int(rng.integers(len(places)))]
            hanging.hang(piece, shape, k, s + 0.05 + width / 2, bottom)
            return
    hanging.house.refused["walls: no free wall for a coat rack"] += 1


def _is_at_a_bed(face: WallFace, s: float, width: float, beds: Sequence[F64]) -> bool:
    """Whether what hangs at s on a face hangs over or beside one of the beds, by their bounds."""
    ends = [face.point(x, 0.0, out) for x in (s, s + width) for out in (0.0, _RACK_BEFORE_M)]
    low, high = np.min(ends, 0) - _FROM_BED_M, np.max(ends, 0) + _FROM_BED_M
    plan = [0, 2]
    return any(
        bool((bed[0, plan] < high[plan]).all() and (bed[1, plan] > low[plan]).all()) for bed in beds
    )


def furnish_walls(house: MutableHouse, catalogue: Catalogue, style: Style, share: float) -> None:
    """Hang a share of mirrors, radiators, switches, coats, shelves, pictures, clocks, notes and sockets."""
    space = house_space(house)
    is_heated = wants_radiators(house)
    gallery = Gallery(house, catalogue, style)
    for room in space.rooms:
        if not room.faces or room.kind is RoomKind.OUTDOOR:
            continue
        hanging = Hanging(house, room, PASS)
        # Items with a single valid place come first.
        hang_mirrors(hanging, space, style, share)
        if is_heated:
            hang_radiators(hanging, style, share)
        fit_switches(hanging, catalogue, style, share)
        hang_kitchen(hanging, space, style, share)
        hang_coats(hanging, space, style, share)
        hang_pin_board(hanging, space, style, share)
        hang_shelves(hanging, style, share)
        hang_pictures(hanging, space, gallery, style, share)
        hang_cloth(hanging, style, share)
        hang_clock(hanging, style, share)
        hang_notes(hanging, style, share)
