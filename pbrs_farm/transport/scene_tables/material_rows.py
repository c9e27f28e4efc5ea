"""Materials as rows of floats for the kernels, textures as one atlas; pure numpy, no effects."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F32
from pbrs_farm.core.frames import LUMINANCE, linear_from_srgb
from pbrs_farm.core.house import House, Material, MaterialKind
from pbrs_farm.core.recipe import Recipe

MATERIAL_FLOATS: Final = 16  # columns of a material's row: four packets of four
KD, TAU = slice(0, 3), slice(8, 11)  # diffuse reflectance; transmittance, diffuse or of thin glass
F0, ALPHA = slice(4, 7), 7  # specular reflectance at right angles, GGX roughness
KIND = 11  # of the next four
FIRST_TEXEL = 12  # in the atlas, 0 = none: an unsigned integer in the float's bits
TEXTURE_SIZE, IS_CUTOUT = slice(13, 15), 15  # width and height in texels; alpha cuts out

SURFACE, MIRROR, GLASS = 0, 1, 2  # rough and diffuse, delta mirror, thin glass
NULL = 3  # Mitsuba's null BSDF: rays pass as if there were nothing

MAX_ALBEDO: Final = 0.9  # in the preset `physical`: the whitest paints; paths in 1 would never end
_MIRROR_REFLECTANCE: Final = 0.9  # of a mirror whose source tells no colour
_MIN_ALPHA: Final = 0.05  # below it a highlight is as narrow as a mirror's
_MAX_TEXTURE_PX: Final = 2048


@dataclass(frozen=True, slots=True, eq=False)
class TextureAtlas:
    """All textures in one list of texels."""

    texels: NDArray[np.uint32]  # 10 bits for the square root of each linear component, 2 of alpha
    slots: dict[str, tuple[int, int, int]]  # texture id -> first texel, width, height


def texture_atlas(house: House, textures: dict[str, NDArray[np.uint8]]) -> TextureAtlas:
    """The atlas of the textures that materials use, without those that could not be decoded."""
    # Leave texel 0 out: a first texel of 0 means that there is no texture.
    parts: list[NDArray[np.uint32]] = [np.zeros(1, np.uint32)]
    slots: dict[str, tuple[int, int, int]] = {}
    first = 1
    for texture_id in sorted({m.texture_id for m in house.materials if m.texture_id}):
        picture = textures.get(texture_id)
        if picture is None or picture.size == 0:
            continue
        texels = _packed(_shrunk(picture))
        slots[texture_id] = (first, texels.shape[1], texels.shape[0])
        parts.append(texels.ravel())
        first += texels.size
    return TextureAtlas(np.concatenate(parts), slots)


def material_rows(house: House, packed: TextureAtlas, recipe: Recipe) -> tuple[F32, list[str]]:
    """(M, 16) rows and notes on what had to be changed."""
    rows = np.zeros((max(len(house.materials), 1), MATERIAL_FLOATS), np.float32)
    scaled: list[str] = []
    for index, material in enumerate(house.materials):
        if recipe.materials.preset == "released":
            row = _released(material)
        else:
            row, was_scaled = _physical(material, recipe)
            if was_scaled:
                scaled.append(material.name)
        # Add the place of the texture in the atlas.
        slot = packed.slots.get(material.texture_id or "")
        if slot is not None:
            row[FIRST_TEXEL] = np.array([slot[0]], np.uint32).view(np.float32)[0]
            row[TEXTURE_SIZE] = slot[1:]
            row[IS_CUTOUT] = float(material.alpha_cutout)
        rows[index] = row
    notes = [f"material {n!r}: Kd + Ks above 1, scaled to conserve energy" for n in scaled]
    return rows, notes


def _physical(material: Material, recipe: Recipe) -> tuple[F32, bool]:
    """(row, whether Kd + Ks had to be scaled) in the preset `physical`.

    Ks is read as the strength of a clear coat, F0 = 0.08 Ks (0.04 = glass of index 1.5 at Ks
    0.5), unless Ks is four times brighter than Kd: then the surface is a metal of reflectance Ks.
    What the coat reflects is taken off Kd (bsdf.py); metals are scaled to Kd + Ks <= 1.
    """
    # Decode colours to linear light.
    row = np.zeros(MATERIAL_FLOATS, np.float32)
    kd = linear_from_srgb(np.clip(np.nan_to_num(material.diffuse), 0, 1))
    kd = np.minimum(kd, MAX_ALBEDO)
    ks_encoded = np.clip(np.nan_to_num(material.specular), 0, 1)
    ks = linear_from_srgb(ks_encoded)
    row[KIND] = SURFACE
    # Describe mirrors, thin glass and lampshades, which have no coat.
    if material.kind is MaterialKind.MIRROR:
        tint = ks if ks @ LUMINANCE > 0.3 else np.full(3, _MIRROR_REFLECTANCE)
        row[F0], row[KIND] = np.minimum(tint, 0.98), MIRROR
        return row, False
    if material.kind is MaterialKind.GLASS:
        # Tint by the glass's own colour as much as it is opaque.
        row[TAU], row[KIND] = 1 - material.opacity * (1 - kd), GLASS
        return row, False
    if material.kind is MaterialKind.SHADE:
        row[TAU] = recipe.repair.shade_transmission * kd
        row[KD] = np.minimum(0.9 * kd, 1 - recipe.repair.shade_transmission) * 0.9
        return row, False
    # Tell metals from coated surfaces.
    too_much = bool(np.any(kd + ks > 1 + 1e-6))
    has_coat = material.shininess > 1 and float(ks.max()) > 0
    if (
        has_coat
        and material.texture_id is None
        and ks @ LUMINANCE > 4 * (kd @ LUMINANCE)
        and ks @ LUMINANCE > 0.2
    ):
        scale = 1 / max(float((kd + ks).max()), 1.0)
        kd, f0 = kd * scale, ks * scale
    else:
        f0 = 0.08 * ks_encoded
    # Turn the Phong exponent into GGX roughness.
    row[KD] = kd
    if has_coat:
        row[F0] = f0
        row[ALPHA] = max(math.sqrt(2 / (min(material.shininess, 1e4) + 2)), _MIN_ALPHA)
    return row, too_much and has_coat


def _released(material: Material) -> F32:
    """The preset `released`: diffuse with a linear Kd or its texture; glass is a null BSDF."""
    row = np.zeros(MATERIAL_FLOATS, np.float32)
    transparent = material.opacity < 1 or material.kind in (MaterialKind.GLASS, MaterialKind.PANE)
    row[KIND] = NULL if transparent else SURFACE
    row[KD] = 1.0 if material.texture_id else np.clip(np.nan_to_num(material.diffuse), 0, 1)
    return row


def _shrunk(picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
    step = -(-max(picture.shape[:2]) // _MAX_TEXTURE_PX)
    return picture[::step, ::step] if step > 1 else picture


def _packed(picture: NDArray[np.uint8]) -> NDArray[np.uint32]:
    """(H, W) uint32 texels, as TextureAtlas packs them."""
    # Take grey pictures as three equal components.
    if picture.ndim == 2:
        picture = picture[..., None]
    rgb = picture[..., :3] if picture.shape[-1] >= 3 else np.repeat(picture[..., :1], 3, -1)
    # Encode by the square root of linear light; cut alpha at one half.
    table = np.round(np.sqrt(linear_from_srgb(np.arange(256) / 255)) * 1023).astype(np.uint32)
    bits = table[rgb]
    alpha = picture[..., 3] if picture.shape[-1] == 4 else np.full(picture.shape[:2], 255, np.uint8)
    opaque = np.where(alpha >= 128, np.uint32(3), np.uint32(0)) << np.uint32(30)
    packed: NDArray[np.uint32] = (
        bits[..., 0] | bits[..., 1] << np.uint32(10) | bits[..., 2] << np.uint32(20) | opaque
    )
    return packed
