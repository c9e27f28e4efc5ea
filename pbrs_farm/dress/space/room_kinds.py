"""What a room is used for, by its types, its name and what stands in it; no effects."""

from __future__ import annotations

import re
from collections.abc import Sequence
from enum import StrEnum

from pbrs_farm.core.house import Item, Room


class RoomKind(StrEnum):
    """What a room is for."""

    LIVING = "living"
    BEDROOM = "bedroom"
    KITCHEN = "kitchen"
    DINING = "dining"
    BATHROOM = "bathroom"
    OFFICE = "office"
    HALL = "hall"
    OUTDOOR = "outdoor"
    STORE = "store"  # garage, cellar, closet, laundry
    OTHER = "other"


# The first kind whose words are in the name holds.
_WORDS = (
    (RoomKind.OUTDOOR, "balcony terrace garden patio deck loggia porch yard balkon garten terrasse balcon jardin"),
    (RoomKind.STORE, "garage cellar basement closet storage store laundry carport keller wardrobe cave warehouse"),
    (RoomKind.BATHROOM, "bath bathroom toilet wc shower restroom lavatory bad badezimmer salle_de_bain"),
    (RoomKind.KITCHEN, "kitchen kitchenette kuche küche cuisine cocina cucina"),
    (RoomKind.BEDROOM, "bed bedroom bedrom guest child nursery kids schlafzimmer kinderzimmer chambre"),
    (RoomKind.DINING, "dining esszimmer"),
    (RoomKind.OFFICE, "office study library buro büro bureau"),
    (RoomKind.LIVING, "living lounge sitting family wohnzimmer salon sejour séjour soggiorno saloon"),
    (RoomKind.HALL, "hall hallway corridor entry entrance entryway foyer landing flur diele stairs lobby"),
)  # fmt: skip

_BED, _SOFA, _TABLE, _DESK, _TOILET, _SINK, _BATHTUB, _FRIDGE = 4, 6, 7, 14, 33, 34, 36, 24
_LARGE_M2 = 9.0


def room_kind(room: Room, items: Sequence[Item], area_m2: float) -> RoomKind:
    """What the room is for: what it is called, else what the items (those in it) say."""
    said = " ".join((*room.types, room.name)).casefold()
    words = set(re.findall(r"[^\W\d]+", said.replace("_", " ")))
    for kind, names in _WORDS:
        if words & set(names.split()):
            return kind
    has = {item.nyu40 for item in items}
    for kind, classes in (
        (RoomKind.BATHROOM, {_TOILET, _BATHTUB}),
        (RoomKind.BEDROOM, {_BED}),
        (RoomKind.KITCHEN, {_FRIDGE}),
        (RoomKind.LIVING, {_SOFA}),
        (RoomKind.OFFICE, {_DESK}),
        (RoomKind.DINING, {_TABLE}),
        (RoomKind.BATHROOM, {_SINK}),
    ):
        if has & classes:
            return kind
    # Small or long rooms without furniture are passages.
    return RoomKind.HALL if area_m2 < _LARGE_M2 else RoomKind.OTHER
