"""Materials and textures as rows of numbers for the kernels; pure numpy, no effects.

A row of 16 floats: kd r g b | f0 r g b, alpha | tau r g b, kind | first texel, width, height, cut.
The first texel is an unsigned integer in the float's bits (a float holds 24 bits only).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.frames import LUMINANCE, linear_from_srgb
from pbrs_farm.core.house import House, Material, MaterialKind
from pbrs_farm.core.recipe import Recipe

MATERIAL_FLOATS: Final = 16
KD, F0, ALPHA, TAU, KIND = slice(0, 3), slice(4, 7), 7, slice(8, 11), 11
FIRST_TEXEL, TEXTURE_SIZE, IS_CUT = 12, slice(13, 15), 15

SURFACE, MIRROR, GLASS, HOLE = 0, 1, 2, 3
"""Kinds of the kernels: diffuse, specular and translucent; delta mirror; thin glass; nothing."""

_MIRROR_REFLECTANCE: Final = 0.9
_MIN_ALPHA: Final = 0.05
MAX_ALBEDO: Final = 0.9
"""Of any diffuse surface in the preset `physical`: the whitest paints reach it, 1 never ends."""

_MAX_TEXTURE_PX: Final = 2048


@dataclass(frozen=True, slots=True, eq=False)
class TextureAtlas:
    """All textures in one list of texels; slots: texture id -> (first texel, width, height).

    A texel holds 10 bits for the square root of each linear component and 2 bits of alpha.
    """

    texels: NDArray[np.uint32]
    slots: dict[str, tuple[int, int, int]]


def texture_atlas(house: House, textures: dict[str, NDArray[np.uint8]]) -> TextureAtlas:
    """Pack the textures that materials use. Textures that were not decoded are left out."""
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


def material_rows(
    house: House, packed: TextureAtlas, recipe: Recipe
) -> tuple[NDArray[np.float32], list[str]]:
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
        slot = packed.slots.get(material.texture_id or "")
        if slot is not None:
            row[FIRST_TEXEL] = np.array([slot[0]], np.uint32).view(np.float32)[0]
            row[TEXTURE_SIZE] = slot[1:]
            row[IS_CUT] = float(material.alpha_cutout)
        rows[index] = row
    notes = [f"material {n!r}: Kd + Ks above 1, scaled to conserve energy" for n in scaled]
    return rows, notes


def _physical(material: Material, recipe: Recipe) -> tuple[NDArray[np.float32], bool]:
    """The preset `physical`.

    Ks is read as the strength of a clear coat, F0 = 0.08 Ks (0.04 = glass of index 1.5 at Ks
    0.5), unless Ks outshines Kd four times: then it is a metal of reflectance Ks. Kd is dimmed
    by what the coat reflects (bsdf.py), metals are scaled to Kd + Ks <= 1.
    """
    row = np.zeros(MATERIAL_FLOATS, np.float32)
    kd = linear_from_srgb(np.clip(np.nan_to_num(material.diffuse), 0, 1))
    kd = np.minimum(kd, MAX_ALBEDO)
    ks_encoded = np.clip(np.nan_to_num(material.specular), 0, 1)
    ks = linear_from_srgb(ks_encoded)
    row[KIND] = SURFACE
    if material.kind is MaterialKind.MIRROR:
        tint = ks if ks @ LUMINANCE > 0.3 else np.full(3, _MIRROR_REFLECTANCE)
        row[F0], row[KIND] = np.minimum(tint, 0.98), MIRROR
        return row, False
    if material.kind is MaterialKind.GLASS:
        # Opacity is how much of the glass's own colour the light takes on.
        row[TAU], row[KIND] = 1 - material.opacity * (1 - kd), GLASS
        return row, False
    if material.kind is MaterialKind.SHADE:
        transmitted = recipe.repair.shade_transmission * kd
        row[TAU] = transmitted
        row[KD] = np.minimum(0.9 * kd, 1 - recipe.repair.shade_transmission) * 0.9
        return row, False
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
    row[KD] = kd
    if has_coat:
        row[F0] = f0
        row[ALPHA] = max(math.sqrt(2 / (min(material.shininess, 1e4) + 2)), _MIN_ALPHA)
    return row, too_much and has_coat


def _released(material: Material) -> NDArray[np.float32]:
    """The preset `released`: diffuse, Kd taken as linear, a texture replaces it, glass is nothing."""
    row = np.zeros(MATERIAL_FLOATS, np.float32)
    transparent = material.opacity < 1 or material.kind in (MaterialKind.GLASS, MaterialKind.PANE)
    row[KIND] = HOLE if transparent else SURFACE
    row[KD] = 1.0 if material.texture_id else np.clip(np.nan_to_num(material.diffuse), 0, 1)
    return row


def _shrunk(picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
    step = -(-max(picture.shape[:2]) // _MAX_TEXTURE_PX)
    return picture[::step, ::step] if step > 1 else picture


def _packed(picture: NDArray[np.uint8]) -> NDArray[np.uint32]:
    if picture.ndim == 2:
        picture = picture[..., None]
    rgb = picture[..., :3] if picture.shape[-1] >= 3 else np.repeat(picture[..., :1], 3, -1)
    table = np.round(np.sqrt(linear_from_srgb(np.arange(256) / 255)) * 1023).astype(np.uint32)
    bits = table[rgb]
    alpha = picture[..., 3] if picture.shape[-1] == 4 else np.full(picture.shape[:2], 255, np.uint8)
    opaque = np.where(alpha >= 128, np.uint32(3), np.uint32(0)) << np.uint32(30)
    packed: NDArray[np.uint32] = (
        bits[..., 0] | bits[..., 1] << np.uint32(10) | bits[..., 2] << np.uint32(20) | opaque
    )
    return packed
