"""Specular reflectance at right angles and roughness of a material, for light and labels; no effects.

Kd, Ks and the Phong exponent, or glTF's roughness, become a clear coat or a metal of the GGX model
(Walter et al. 2007; glTF 2.0, appendix B).
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.frames import LUMINANCE, linear_from_srgb
from pbrs_farm.core.house import Material, MaterialKind

MAX_ALBEDO: Final = (
    0.9  # of light in the preset `physical`: the whitest paints; paths in 1 would never end
)
MIN_ALPHA: Final = 0.05  # below it a highlight is as narrow as a mirror's
GLASS_F0: Final = 0.04  # of a dielectric of index 1.5

_MIRROR_REFLECTANCE: Final = 0.9  # of a mirror whose source gives no colour
_MOST_MIRRORED: Final = 0.98


class Coat(NamedTuple):
    """The coat above a material's diffuse base, or a metal's surface."""

    f0: F64  # (3,) linear, reflectance at right angles
    alpha: float  # GGX roughness, without the material's map
    is_metal: bool
    left: float  # factor of Kd, where Kd + Ks would be above 1


def coat_of(material: Material) -> Coat | None:
    """The coat of a material other than mirror and glass; None for a matte one or a lampshade.

    Ks is the strength of a clear coat, F0 = 0.08 Ks (0.04 = glass of index 1.5 at Ks 0.5), unless Ks is
    four times brighter than Kd: then the surface is a metal of reflectance Ks. A material with a roughness
    has a coat of F0 0.04 at least, and GGX alpha is the roughness squared; otherwise alpha follows from the
    Phong exponent.

        >>> coat_of(Material("oak", roughness=0.5)).alpha
        0.25
    """
    encoded = np.clip(np.nan_to_num(material.specular), 0, 1)
    ks = linear_from_srgb(encoded)
    is_rough = material.roughness is not None or material.roughness_texture_id is not None
    has_coat = is_rough or (material.shininess > 1 and float(ks.max()) > 0)
    if not has_coat or material.kind is MaterialKind.SHADE:
        return None
    # Square the roughness, or turn the Phong exponent into GGX roughness.
    phong = math.sqrt(2 / (min(material.shininess, 1e4) + 2))
    named = 1.0 if material.roughness is None else min(max(material.roughness, 0.0), 1.0)
    alpha = max(named**2 if is_rough else phong, MIN_ALPHA)
    if material.is_metal:
        kd = np.minimum(
            linear_from_srgb(np.clip(np.nan_to_num(material.diffuse), 0, 1)), MAX_ALBEDO
        )
        scale = 1 / max(float((kd + ks).max()), 1.0)
        return Coat(ks * scale, alpha, True, scale)
    return Coat(np.maximum(0.08 * encoded, GLASS_F0 if is_rough else 0), alpha, False, 1.0)


def mirror_reflectance(material: Material) -> F64:
    """(3,) linear reflectance of a mirror: its Ks if bright."""
    ks = linear_from_srgb(np.clip(np.nan_to_num(material.specular), 0, 1))
    tint = ks if ks @ LUMINANCE > 0.3 else np.full(3, _MIRROR_REFLECTANCE)
    return np.asarray(np.minimum(tint, _MOST_MIRRORED))
