"""Uniform blocks of the shaders: one of each material, one of each item's lights; pure numpy, no effects."""

from __future__ import annotations

import numpy as np

from pbrs_farm.core.arrays import F32
from pbrs_farm.core.frames import linear_from_srgb
from pbrs_farm.core.house import House, Material, MaterialKind
from pbrs_farm.raster.light_choice import LIGHT_FLOATS, best_lights, light_table

BLOCK_FLOATS = 16  # four vec4, as surface.frag.glsl declares them
_HEADER_FLOATS = 4  # before the lights: their number, transmission, 0, 0
LAMP_TRANSMISSION = 0.1  # share of light that passes through a lamp's own parts: shades look lit
_EMISSION = {MaterialKind.BULB: 1.0, MaterialKind.SHADE: 0.5}


def material_blocks(house: House) -> F32:
    """(n_materials, 16) float32: the Material block of each material, in the layout that shaders read (std140)."""
    rows = [_material_block(m) for m in house.materials]
    return np.array(rows, np.float32).reshape(-1, BLOCK_FLOATS)


def _material_block(material: Material) -> list[float]:
    # Decode colours to linear light; a black highlight gets exponent 0, which switches it off.
    diffuse = linear_from_srgb(np.array(material.diffuse))
    specular = linear_from_srgb(np.array(material.specular))
    if material.is_metal:
        diffuse = np.minimum(diffuse + specular, 1.0)  # there is no environment to reflect
    emission = _EMISSION.get(material.kind, 0.0) * diffuse
    exponent = material.shininess if specular.any() else 0.0
    is_pane = material.kind is MaterialKind.PANE
    return [
        *diffuse,
        material.opacity,
        *specular,
        exponent,
        *emission,
        0.0,
        float(is_pane),
        material.alpha_cutoff if material.alpha_cutout else 0.0,
        0.0,
        0.0,
    ]


def light_blocks(house: House, n_best: int) -> F32:
    """(n_items + 1, 4 + 16 n_best) float32 std140 Lights of each instance: their number, then the best."""
    lights = light_table(house)
    block = np.zeros((len(house.items) + 1, _HEADER_FLOATS + LIGHT_FLOATS * n_best), np.float32)
    if len(lights) and house.items:
        bounds = np.array([item.bounds for item in house.items])
        best = best_lights(lights, bounds[:, 0], bounds[:, 1], n_best)
        block[1:, 0] = best.shape[1]
        block[1:, 1] = [LAMP_TRANSMISSION if item.lights else 0.0 for item in house.items]
        end = _HEADER_FLOATS + LIGHT_FLOATS * best.shape[1]
        block[1:, _HEADER_FLOATS:end] = lights[best].reshape(len(best), -1)
    return block


def aligned_rows(rows: F32, alignment_bytes: int) -> F32:
    """Rows (N, K) float32 padded with 0 so that each starts at a multiple of alignment_bytes."""
    step = -(-rows.shape[1] * 4 // alignment_bytes) * alignment_bytes // 4
    padded = np.zeros((len(rows), step), np.float32)
    padded[:, : rows.shape[1]] = rows
    return padded
