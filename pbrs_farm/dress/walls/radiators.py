"""Panel radiators below the windows of a home that has none; no effects but on the draft."""

from __future__ import annotations

from typing import Final

from pbrs_farm.core.classes import OTHERFURNITURE
from pbrs_farm.core.house import Material
from pbrs_farm.dress.draft import Draft
from pbrs_farm.dress.generated.assembly import Made, Part, hung, plain
from pbrs_farm.dress.generated.turned import slab
from pbrs_farm.dress.joinery.coating import coat_material
from pbrs_farm.dress.joinery.scheme import joinery_scheme
from pbrs_farm.dress.name_words import RADIATORS, words_of_item
from pbrs_farm.dress.space.room_kinds import RoomKind
from pbrs_farm.dress.style import Style
from pbrs_farm.dress.walls.hanging import Hanging

_HEATED: Final = 0.75  # of homes without any, that are heated so
_LOW_M, _SPACE_M = 0.12, 0.1  # above the floor; below the sill
_LEAST_SILL_M: Final = 0.6
_DEPTH_M: Final = 0.11
_OTHER_HEAT: Final = frozenset({"fireplace", "stove"})
_UNHEATED = (RoomKind.STORE, RoomKind.OUTDOOR)


def wants_radiators(draft: Draft) -> bool:
    """Whether the home is heated neither by what was drawn nor from its floors."""
    drawn = any(words_of_item(item) & (RADIATORS | _OTHER_HEAT) for item in draft.source.items)
    return not drawn and float(draft.rng("radiators").random()) < _HEATED


def hang_radiators(hanging: Hanging, style: Style, share: float) -> None:
    """A radiator below each window of the room whose wall is free there, in the home's scheme."""
    room, rng = hanging.room, hanging.draft.rng("radiators", hanging.room.room.id)
    if room.kind in _UNHEATED or rng.random() >= share:
        return
    paint = coat_material(joinery_scheme(hanging.draft, style).radiator)
    for window in room.windows:
        side = window.side_of(room.room.id)
        sill = window.bottom_y - hanging.floor_y
        if side is None or not _LEAST_SILL_M <= sill <= 1.4:
            continue
        height = min(sill - _LOW_M - _SPACE_M, 0.6)
        at = window.face_point(side)
        for k, face in enumerate(hanging.faces):
            if face.normal @ window.inward(side) < 0.99 or abs(face.out_of(at[None])[0]) > 0.03:
                continue
            s, width = float(face.s_of(at[None])[0]), window.width
            if _hang_below(hanging, k, s, (width, height), paint):
                break


def _hang_below(
    hanging: Hanging, face: int, s: float, size: tuple[float, float], paint: Material
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
            hanging.hang(*radiator(wide, height, paint), face, s, low, margin_m=0.02)
            return True
    return False


def radiator(width: float, height: float, paint: Material) -> Made:
    """A painted panel with ribs, a grille on top and a white valve; hung by two brackets."""
    front, back = _DEPTH_M, 0.035
    half = width / 2
    parts: list[Part] = [(slab((-half, 0.0, back), (half, height, front - 0.008)), paint)]
    # Press ribs into the front, 4 cm apart.
    n = max(4, round(width / 0.04))
    step = width / n
    for k in range(n):
        x = -half + (k + 0.5) * step
        rib = slab((x - 0.3 * step, 0.02, front - 0.008), (x + 0.3 * step, height - 0.03, front))
        parts.append((rib, paint))
    for x in (-half + 0.1, half - 0.1):
        parts.append((slab((x - 0.015, 0.1, 0.0), (x + 0.015, height - 0.1, back)), paint))
    dark = plain("radiator grille", (0.55, 0.55, 0.54), 0.6)
    for k in range(max(3, round(width / 0.06))):
        x = -half + 0.03 + k * 0.06
        if x + 0.045 < half:
            top = slab((x, height, back + 0.01), (x + 0.045, height + 0.002, front - 0.02))
            parts.append((top, dark))
    knob = slab((half, height - 0.07, 0.05), (half + 0.05, height - 0.03, 0.09))
    parts.append((knob, plain("radiator valve", (0.9, 0.9, 0.89), 0.4)))
    return hung("panel_radiator", "radiator", OTHERFURNITURE, parts)
