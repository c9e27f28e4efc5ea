"""Shader features that a material and a house's lamps need, as bits; no effects.

A software renderer pays for every instruction of a shader at every pixel, so each combination of
features gets the smallest program that is right for it.
"""

from __future__ import annotations

from enum import IntFlag

from pbrs_farm.core.house import House, Material, MaterialKind
from pbrs_farm.core.lighting import LightForm


class Feature(IntFlag):
    """What a surface's shader must be able to do; the names are the shader's #defines."""

    GLOSSY = 1  # a specular highlight
    ALPHA_CUTOUT = 2  # the texture's alpha discards fragments
    TRANSPARENT = 4  # blended: glass, panes, opacity below 1
    TEXTURED = 8  # the texture multiplies the diffuse colour


def features_of_material(material: Material, *, is_textured: bool = True) -> int:
    """The features a material needs, as a sum of bits."""
    features = Feature.TEXTURED if is_textured and material.texture_id is not None else Feature(0)
    if material.shininess > 0 and any(material.specular):
        features |= Feature.GLOSSY
    # Blend what is transparent; alpha then needs no cut-out of its own.
    if material.kind in (MaterialKind.GLASS, MaterialKind.PANE) or material.opacity < 1:
        features |= Feature.TRANSPARENT
    elif material.alpha_cutout and features & Feature.TEXTURED:
        features |= Feature.ALPHA_CUTOUT
    return int(features)


def feature_names(features: int) -> list[str]:
    """The shader's #defines of a sum of bits."""
    return [str(f.name) for f in Feature if f & features]


def light_features(house: House) -> list[str]:
    """The shader's #defines of the forms of light that the house has beside points."""
    forms = {part.form for item in house.items for part in item.lights}
    names = {"WITH_SPOTS": LightForm.SPOT, "WITH_LINES": LightForm.LINE}
    return [name for name, form in names.items() if form in forms]
