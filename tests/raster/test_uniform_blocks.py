"""Uniforms that the shaders get for a material."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pbrs_farm.core.house import House, Material
from pbrs_farm.raster.uniform_blocks import material_blocks
from pbrs_farm.read.builtin.builtin_home import builtin_home


def diffuse_of(material: Material) -> list[float]:
    house: House = replace(builtin_home(), materials=(material,))
    return np.round(material_blocks(house)[0, :3], 3).tolist()


def test_a_metal_without_a_picture_has_the_colour_of_its_highlights() -> None:
    gold = Material("gold", diffuse=(0, 0, 0), specular=(1.0, 0.8, 0.4), roughness=0.5)
    assert diffuse_of(gold)[0] == 1
    assert min(diffuse_of(gold)) > 0.1
    # A clear coat is no metal, and a picture is drawn as paint.
    coat = replace(gold, diffuse=(0.5, 0.5, 0.5))
    for material in (coat, replace(gold, texture_id="t"), replace(gold, specular=(0.2,) * 3)):
        assert diffuse_of(material) == diffuse_of(replace(material, specular=(0, 0, 0)))
