"""Shader features that a material and a house's lamps need, as bits; no effects.

A software renderer pays for every instruction of a shader at every pixel, so each combination of
features gets the smallest program that is right for it.
"""

from __future__ import annotations

from typing import Final

from pbrs_farm.core.house import House, Material, MaterialKind
from pbrs_farm.core.lighting import LightForm

GLOSSY: Final = 1  # a specular highlight
ALPHA_CUTOUT: Final = 2  # the texture's alpha discards fragments
TRANSPARENT: Final = 4  # blended: glass, panes, opacity below 1
TEXTURED: Final = 8  # the texture multiplies the diffuse colour


def features_of_material(material: Material, *, is_textured: bool = True) -> int:
    """The features a material needs, as a sum of bits."""
    kind = TEXTURED if is_textured and material.texture_id is not None else 0
    if material.shininess > 0 and any(material.specular):
        kind |= GLOSSY
    if material.kind in (MaterialKind.GLASS, MaterialKind.PANE) or material.opacity < 1:
        return kind | TRANSPARENT
    return kind | (ALPHA_CUTOUT if material.alpha_cutout and kind & TEXTURED else 0)


def feature_names(kind: int) -> list[str]:
    """The shader's #defines of the features in the bits kind."""
    names = {
        "GLOSSY": GLOSSY,
        "ALPHA_CUTOUT": ALPHA_CUTOUT,
        "TRANSPARENT": TRANSPARENT,
        "TEXTURED": TEXTURED,
    }
    return [name for name, bit in names.items() if kind & bit]


def light_features(house: House) -> list[str]:
    """The shader's #defines of the forms of light that the house has beside points."""
    forms = {part.form for item in house.items for part in item.lights}
    names = {"WITH_SPOTS": LightForm.SPOT, "WITH_LINES": LightForm.LINE}
    return [name for name, form in names.items() if form in forms]
