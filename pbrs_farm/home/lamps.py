"""Illuminance of a room's floor by its lamps; no effects."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

from pbrs_farm.core.house import Item, ItemKind
from pbrs_farm.core.lighting import flux_lm

# Share of a ceiling lamp's flux that a furnished floor gets; rooms measure 0.12 to 0.40
# (docs/houses/repair.md).
UTILISATION: Final = 0.3


def flux_for_floor(area_m2: float, lux: float) -> float:
    """Luminous flux in lm of ceiling lamps that give a floor this illuminance on average.

    area_m2: of the floor; lux: wanted mean illuminance. The utilisation is one number for all
    rooms: good enough to choose bulbs by, no design of lighting. `illuminance_record` measures what
    came of it.
    """
    return lux * area_m2 / UTILISATION


def flux_of_lamps(items: Iterable[Item]) -> float:
    """Luminous flux of all lamps among the items, lm; what people carry does not count.

    Bulbs' own output: what a shade swallows is not subtracted. Lights whose power is in Sweet Home
    3D's unit are converted as the renderer does.
    """
    return sum(
        flux_lm(light.power, light.unit, light.share)
        for item in items
        if item.kind is not ItemKind.PERSON
        for light in item.lights
    )
