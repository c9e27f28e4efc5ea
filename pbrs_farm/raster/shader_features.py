"""Which shader features a material and a house's lamps need; no effects.

On a CPU every instruction of a shader is paid at every pixel, so each kind of material gets the
smallest program that is right for it.
"""

from __future__ import annotations

from typing import Final

from pbrs_farm.core.house import House, Material, MaterialKind
from pbrs_farm.core.lighting import LightForm

GLOSSY: Final = 1
CUTOUT: Final = 2
SEE_THROUGH: Final = 4
TEXTURED: Final = 8


def kind_of_material(material: Material, *, is_textured: bool = True) -> int:
    """Sum of the features a material needs. See-through: glass, panes, opacity below 1."""
    kind = TEXTURED if is_textured and material.texture_id is not None else 0
    if material.shininess > 0 and any(material.specular):
        kind |= GLOSSY
    if material.kind in (MaterialKind.GLASS, MaterialKind.PANE) or material.opacity < 1:
        return kind | SEE_THROUGH
    return kind | (CUTOUT if material.alpha_cutout and kind & TEXTURED else 0)


def features_of_kind(kind: int) -> list[str]:
    """The shader's names of the features in kind."""
    names = {"GLOSSY": GLOSSY, "CUTOUT": CUTOUT, "SEE_THROUGH": SEE_THROUGH, "TEXTURED": TEXTURED}
    return [name for name, bit in names.items() if kind & bit]


def light_features(house: House) -> list[str]:
    """The forms of light the house has beside points."""
    forms = {part.form for item in house.items for part in item.lights}
    names = {"WITH_SPOTS": LightForm.SPOT, "WITH_LINES": LightForm.LINE}
    return [name for name, form in names.items() if form in forms]
