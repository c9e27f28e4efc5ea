"""Smudges and brushed steel: mean roughness is kept, matt surfaces are unchanged."""

from __future__ import annotations

import io
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from pbrs_farm.core.catalogue import EMPTY
from pbrs_farm.core.classes import NYU40_NAMES
from pbrs_farm.core.house import Material, MaterialKind
from pbrs_farm.dress.mutable_house import MutableHouse
from pbrs_farm.dress.style import style_for
from pbrs_farm.dress.wear import SIZE_M, add_wear
from tests.dress.furniture import house, solid

FRONT = Material("coated front", specular=(0.4, 0.4, 0.4), roughness=0.3)
STEEL = Material("brushed steel", specular=(0.78, 0.77, 0.75), roughness=0.38)


def _worn(material: Material, size: float = 1.0, share: float = 1.0) -> MutableHouse:
    thing = solid("t", [1, 0, 1], [1 + size, size, 1 + size], NYU40_NAMES.index("cabinet"))
    mutable = MutableHouse(replace(house(thing), materials=(material,)), 5)
    add_wear(mutable, EMPTY, style_for(mutable.rng("style"), ""), share)
    return mutable


def _mean(mutable: MutableHouse, texture_id: str | None) -> float:
    data = mutable.textures[str(texture_id)].data
    return float(np.asarray(Image.open(io.BytesIO(data))).mean()) / 255


@pytest.mark.parametrize("material", [FRONT, STEEL])
def test_a_smooth_front_is_as_rough_as_before_in_the_mean(material: Material) -> None:
    mutable = _worn(material)
    surface = mutable.items[0].surfaces[0]
    worn = mutable.materials[surface.material]
    assert (worn.normal_texture_id is not None) == (material is STEEL)
    mean = (worn.roughness or 0) * _mean(mutable, worn.roughness_texture_id)
    assert mean == pytest.approx(material.roughness, rel=0.15)
    assert surface.uvs is not None
    assert np.ptp(surface.uvs[:, 0]) == pytest.approx(1.0 / SIZE_M[0], rel=0.7)


@pytest.mark.parametrize(
    "kept",
    [
        replace(FRONT, roughness=0.8), replace(FRONT, roughness=None),
        replace(FRONT, kind=MaterialKind.MIRROR), replace(STEEL, name="chrome"),
    ],
)  # fmt: skip
def test_matt_mirror_and_chrome_surfaces_are_unchanged(kept: Material) -> None:
    mutable = _worn(kept)
    assert mutable.items[0] is mutable.source.items[0]


def test_small_items_stay_and_a_share_of_zero_changes_nothing() -> None:
    for mutable in (_worn(FRONT, size=0.2), _worn(FRONT, share=0.0)):
        assert mutable.items[0] is mutable.source.items[0]
