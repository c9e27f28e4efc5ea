"""The part `walls` of dressing: everything that hangs on walls, room by room; no effects."""

from __future__ import annotations

from pbrs_farm.core.catalogue import Catalogue
from pbrs_farm.dress.draft import Draft
from pbrs_farm.dress.space import house_space
from pbrs_farm.dress.space.room_kinds import RoomKind
from pbrs_farm.dress.style import Style
from pbrs_farm.dress.walls.coat_racks import hang_coats
from pbrs_farm.dress.walls.fittings import fit_switches, hang_clock, hang_mirrors
from pbrs_farm.dress.walls.hanging import Hanging
from pbrs_farm.dress.walls.kitchen_walls import hang_kitchen
from pbrs_farm.dress.walls.pictures import Gallery, hang_pictures
from pbrs_farm.dress.walls.pin_boards import hang_pin_board
from pbrs_farm.dress.walls.radiators import hang_radiators, wants_radiators
from pbrs_farm.dress.walls.wall_furniture import hang_cloth, hang_shelves

PART = "walls"


def walls(draft: Draft, catalogue: Catalogue, style: Style, share: float) -> None:
    """Hang mirrors, radiators, switches, coats, shelves, pictures, clocks and sockets in the rooms of the draft.

    share: 0..1 of what a room would get.
    """
    space = house_space(draft)
    is_heated = wants_radiators(draft)
    gallery = Gallery(draft, catalogue, style)
    for room in space.rooms:
        if not room.faces or room.kind is RoomKind.OUTDOOR:
            continue
        hanging = Hanging(draft, room, PART)
        # What has one right place comes first.
        hang_mirrors(hanging, space, style, share)
        if is_heated:
            hang_radiators(hanging, style, share)
        fit_switches(hanging, catalogue, style, share)
        hang_kitchen(hanging, space, style, share)
        hang_coats(hanging, style, share)
        hang_pin_board(hanging, space, style, share)
        hang_shelves(hanging, style, share)
        hang_pictures(hanging, space, gallery, style, share)
        hang_cloth(hanging, style, share)
        hang_clock(hanging, style, share)
