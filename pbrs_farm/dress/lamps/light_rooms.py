"""The part `lamps` of dressing: which rooms lack light, and what lamps they get; no effects."""

from __future__ import annotations

from pbrs_farm.core.catalogue import Catalogue
from pbrs_farm.core.house import ItemKind
from pbrs_farm.core.lighting import flux_lm
from pbrs_farm.dress.draft import Draft
from pbrs_farm.dress.lamps.ceiling_lamps import hang_from_ceiling
from pbrs_farm.dress.lamps.standing_lamps import stand_by_beds, stand_by_sofas
from pbrs_farm.dress.space import RoomSpace, house_space
from pbrs_farm.dress.space.room_kinds import RoomKind
from pbrs_farm.dress.style import Style

_WANTED_LX = {RoomKind.KITCHEN: 200, RoomKind.BATHROOM: 180, RoomKind.OFFICE: 180, RoomKind.HALL: 110}  # fmt: skip
_USUAL_LX = 150
_WEAK_LX = 30  # a room with less gets a lamp beside those it has
_UTILISATION = 0.45  # share of a lamp's flux that reaches the floor, about
_LEAST_M2 = 0.8
_FLUX_LM = (500.0, 9000.0)  # of one lamp


def lamps(draft: Draft, catalogue: Catalogue, style: Style, share: float) -> None:
    """Hang a lamp in rooms without one or with too little light; stand some by sofas and beds.

    share: of such rooms, 0..1.
    """
    for room_id in [room.room.id for room in house_space(draft).rooms]:
        rng = draft.rng("lamps", room_id)
        room = house_space(draft).room(room_id)
        if room.area.area < _LEAST_M2 or room.kind is RoomKind.OUTDOOR or not room.room.has_floor:
            continue
        if rng.random() < share:
            area, has = float(room.area.area), room_flux_lm(draft, room)
            wanted = _WANTED_LX.get(room.kind, _USUAL_LX) * area / _UTILISATION
            if has * _UTILISATION / area < _WEAK_LX:
                flux = min(max(wanted - has, _FLUX_LM[0]), _FLUX_LM[1])
                hang_from_ceiling(draft, catalogue, style, room_id, flux, rng)
        if rng.random() < share:
            stand_by_beds(draft, catalogue, style, room_id, rng)
            stand_by_sofas(draft, catalogue, style, room_id, rng)


def room_flux_lm(draft: Draft, room: RoomSpace) -> float:
    """Luminous flux of all lamps in the room, lm."""
    return sum(
        flux_lm(light.power, light.unit, light.share)
        for number in room.items
        for light in draft.items[number].lights
        if draft.items[number].kind is not ItemKind.PERSON
    )
