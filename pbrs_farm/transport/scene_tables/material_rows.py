"""Materials as rows of floats for the kernels; pure numpy, no effects."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from pbrs_farm.core.arrays import F32
from pbrs_farm.core.frames import linear_from_srgb
from pbrs_farm.core.gloss import MAX_ALBEDO, coat_of, mirror_reflectance
from pbrs_farm.core.house import House, Material, MaterialKind
from pbrs_farm.core.recipe import Recipe
from pbrs_farm.transport.scene_tables.texture_atlas import TextureAtlas, map_key

MATERIAL_FLOATS: Final = 20  # columns of a material's row: five packets of four
MAP_ROUGHNESS = 3  # what the maps' roughness is multiplied by; 0 = the material has no maps
KD, TAU = slice(0, 3), slice(8, 11)  # diffuse reflectance; transmittance, diffuse or of thin glass
F0, ALPHA = slice(4, 7), 7  # specular reflectance at right angles, GGX roughness
KIND = 11  # of the next four
FIRST_TEXEL = 12  # in the atlas, 0 = none: an unsigned integer in the float's bits
TEXTURE_SIZE, CUTOFF = slice(13, 15), 15  # width and height in texels; of alpha 0..255, 0 = none
FIRST_MAP_TEXEL, MAP_SIZE = 16, slice(17, 19)  # the same of the roughness and normal maps

SURFACE, MIRROR, GLASS = 0, 1, 2  # rough and diffuse, delta mirror, thin glass
NULL = 3  # Mitsuba's null BSDF: rays pass as if there were nothing


def material_rows(house: House, packed: TextureAtlas, recipe: Recipe) -> tuple[F32, list[str]]:
    """(M, 20) rows and notes on what had to be changed."""
    rows = np.zeros((max(len(house.materials), 1), MATERIAL_FLOATS), np.float32)
    scaled: list[str] = []
    for index, material in enumerate(house.materials):
        if recipe.materials.preset == "released":
            row = _released(material)
        else:
            row, was_scaled = _physical(material, recipe)
            if was_scaled:
                scaled.append(material.name)
        _place_in_atlas(row, material, packed)
        rows[index] = row
    notes = [f"material {n!r}: Kd + Ks above 1, scaled to conserve energy" for n in scaled]
    return rows, notes


def max_albedo(recipe: Recipe) -> float:
    """Upper bound on Kd times its texture, in each of R, G and B, under a recipe."""
    return MAX_ALBEDO if recipe.materials.preset == "physical" else 1.0


def _place_in_atlas(row: F32, material: Material, packed: TextureAtlas) -> None:
    """Write into a row where the material's texture and maps lie in the atlas."""
    slot = packed.slots.get(material.texture_id or "")
    if slot is not None:
        row[FIRST_TEXEL], row[TEXTURE_SIZE] = _float_of_bits(slot[0]), slot[1:]
        row[CUTOFF] = 255 * material.alpha_cutoff if material.alpha_cutout else 0.0
    elif material.alpha_cutout and material.alpha_cutoff > 1:
        row[KIND] = NULL
    slot = packed.map_slots.get(map_key(material))
    if slot is not None and material.shows_maps and int(row[KIND]) != NULL:
        row[FIRST_MAP_TEXEL], row[MAP_SIZE] = _float_of_bits(slot[0]), slot[1:]
        row[MAP_ROUGHNESS] = math.sqrt(row[ALPHA]) if row[ALPHA] > 0 else 1.0


def _physical(material: Material, recipe: Recipe) -> tuple[F32, bool]:
    """(row, whether Kd + Ks had to be scaled) in the preset `physical`; core/gloss.py says what shines.

    What the coat reflects is taken off Kd (bsdf.py); metals are scaled to Kd + Ks <= 1.
    """
    # Decode colours to linear light.
    row = np.zeros(MATERIAL_FLOATS, np.float32)
    tint = linear_from_srgb(np.clip(np.nan_to_num(material.diffuse), 0, 1))
    kd = np.minimum(tint, MAX_ALBEDO)
    row[KIND] = SURFACE
    # Describe mirrors, thin glass and lampshades, which have no coat.
    if material.kind is MaterialKind.MIRROR:
        row[F0], row[KIND] = mirror_reflectance(material), MIRROR
        return row, False
    if material.kind is MaterialKind.GLASS:
        # Tint by the glass's own colour in proportion to its opacity.
        row[TAU], row[KIND] = 1 - material.opacity * (1 - kd), GLASS
        return row, False
    if material.kind is MaterialKind.SHADE:
        row[TAU] = recipe.repair.shade_transmission * kd
        row[KD] = np.minimum(0.9 * kd, 1 - recipe.repair.shade_transmission) * 0.9
        return row, False
    # The kernel holds the product with the texture to MAX_ALBEDO.
    coat = coat_of(material)
    if coat is None:
        row[KD] = tint if material.texture_id else kd
        return row, False
    row[KD] = tint if material.texture_id else kd * coat.left
    row[F0], row[ALPHA] = coat.f0, coat.alpha
    ks = linear_from_srgb(np.clip(np.nan_to_num(material.specular), 0, 1))
    return row, bool(np.any(kd + ks > 1 + 1e-6))


def _float_of_bits(number: int) -> np.float32:
    return np.float32(np.array([number], np.uint32).view(np.float32)[0])


def _released(material: Material) -> F32:
    """The preset `released`: diffuse with a linear Kd or its texture; glass is a null BSDF."""
    row = np.zeros(MATERIAL_FLOATS, np.float32)
    transparent = material.opacity < 1 or material.kind in (MaterialKind.GLASS, MaterialKind.PANE)
    row[KIND] = NULL if transparent else SURFACE
    row[KD] = 1.0 if material.texture_id else np.clip(np.nan_to_num(material.diffuse), 0, 1)
    return row
