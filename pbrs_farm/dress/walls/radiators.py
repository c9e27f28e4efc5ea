"""Panel radiators below the windows of a home without any. Effects: changes the house."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from pbrs_farm.dress.content import content
from pbrs_farm.dress.finish_scheme import finish_scheme
from pbrs_farm.dress.models import Model
from pbrs_farm.dress.mutable_house import MutableHouse
from pbrs_farm.dress.style import Style
from pbrs_farm.dress.surface_finishes import material_of_finish
from pbrs_farm.dress.walls.hanging import Hanging
from pbrs_farm.home.names import RADIATORS, words_of_item
from pbrs_farm.home.room_use import RoomKind

_HEATED: Final = 0.75  # share of homes without radiators that get some
_LOW_M, _SPACE_M = 0.12, 0.1  # above the floor; below the sill
_LEAST_SILL_M: Final = 0.6
_OTHER_HEAT: Final = frozenset({"fireplace", "stove"})
_UNHEATED = (RoomKind.STORE, RoomKind.OUTDOOR)


def wants_radiators(house: MutableHouse) -> bool:
    """True if the home has neither radiators in the source nor floor heating."""
    drawn = any(words_of_item(item) & (RADIATORS | _OTHER_HEAT) for item in house.source.items)
    return not drawn and float(house.rng("radiators").random()) < _HEATED


def hang_radiators(hanging: Hanging, style: Style, share: float) -> None:
    """A radiator below each window of the room whose wall is free there, in the home's scheme."""
    room, rng = hanging.room, hanging.house.rng("radiators", hanging.room.room.id)
    if room.kind in _UNHEATED or rng.random() >= share:
        return
    paint = material_of_finish(finish_scheme(hanging.house, style).radiator)

    def make(wide: float, high: float) -> Model:
        return content().things["wall_radiator"](rng, style, wide, high, paint)

    for window in room.windows:
        side = window.side_of(room.room.id)
        sill = window.bottom_y - hanging.floor_y
        if side is None or not _LEAST_SILL_M <= sill <= 1.4:
            continue
        height = min(sill - _LOW_M - _SPACE_M, 0.6)
        spot = window.face_point(side)
        for k, face in enumerate(hanging.faces):
            if face.normal @ window.inward(side) < 0.99 or abs(face.out_of(spot[None])[0]) > 0.03:
                continue
            s, width = float(face.s_of(spot[None])[0]), window.width
            if _hang_below(hanging, k, s, (width, height), make):
                break


def _hang_below(
    hanging: Hanging,
    face: int,
    s: float,
    size: tuple[float, float],
    make: Callable[[float, float], Model],
) -> bool:
    width, height = size
    low = hanging.floor_y + _LOW_M
    for factor in (0.85, 0.6, 0.45):
        wide = round(min(width * factor, 1.6) / 0.1) * 0.1
        half = wide / 2 + 0.08
        if wide < 0.4:
            return False
        if (
            hanging.faces[face].free_m(s - half, s + half, hanging.floor_y + 0.05, low + height)
            > 0.3
        ):
            model = make(wide, height)
            hanging.hang(*model, face, s, low, margin_m=0.02)
            return True
    return False
