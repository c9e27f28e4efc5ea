"""The lighting modes, the light groups they are sums of, and what a lamp emits; no effects."""

from __future__ import annotations

from enum import StrEnum
from types import MappingProxyType
from typing import Final


class Mode(StrEnum):
    """A lighting mode of the paper (section 3.2); the value is the name of its picture."""

    OPENGL_DL = "opengl_dl"  # OpenGL, a headlight and two directional lights
    OPENGL_IL = "opengl_il"  # OpenGL, the lamps, no shadows
    MLT_OL = "mlt_ol"  # light transport, outdoor light
    MLT_IL_OL = "mlt_il_ol"  # light transport, indoor and outdoor light

    @property
    def groups(self) -> tuple[Group, ...]:
        """The light groups whose sum is this mode; empty for the OpenGL modes."""
        return GROUPS_OF_MODE[self]


class Group(StrEnum):
    """A light group. Light transport is linear: groups are rendered apart and modes are sums (rule 9)."""

    OUTDOOR = "outdoor"  # sky and sun
    INDOOR = "indoor"  # lamps


GROUPS_OF_MODE: Final = MappingProxyType(
    {
        Mode.OPENGL_DL: (),
        Mode.OPENGL_IL: (),
        Mode.MLT_OL: (Group.OUTDOOR,),
        Mode.MLT_IL_OL: (Group.OUTDOOR, Group.INDOOR),
    }
)

ALL_MODES: Final = tuple(Mode)

BULB_RADIUS_M: Final = 0.0325  # of a lamp whose source does not tell: a bulb 65 mm across


class LightForm(StrEnum):
    """The shape of a lamp's light source as its model describes it."""

    POINT = "point"  # all directions alike
    SPOT = "spot"  # a cone about a direction
    LINE = "line"  # a tube between two points


class PowerUnit(StrEnum):
    """Unit of the source's number LightPart.power."""

    SWEETHOME3D = "sweethome3d"  # power 0..1, 0.5 in every example lamp
    WATT = "watt"  # SUNCG: electric watts of an incandescent lamp
    LUMEN = "lumen"


def flux_lm(
    power: float,
    unit: PowerUnit,
    share: float,
    *,
    lamp_lm: float = 1_600.0,
    lm_per_watt: float = 13.0,
) -> float:
    """Flux of a share of a power (docs/light.md); lamp_lm: of Sweet Home 3D's power 0.5; lm_per_watt: SUNCG's."""
    if unit is PowerUnit.SWEETHOME3D:
        return float(lamp_lm * (power / 0.5) ** 2 * share)
    if unit is PowerUnit.WATT:
        return power * lm_per_watt * share
    return power * share
