from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from pbrs_farm.core.catalogue import EMPTY
from pbrs_farm.core.classes import NYU40_NAMES
from pbrs_farm.core.frames import LUMINANCE, linear_from_srgb
from pbrs_farm.core.house import House, Item, Material, MaterialKind
from pbrs_farm.dress.finishes import finish_furniture
from pbrs_farm.dress.mutable_house import MutableHouse
from pbrs_farm.dress.part_kinds import is_brown, is_dark, is_white, kind_by_name
from pbrs_farm.dress.patterns import PatternMaterial
from pbrs_farm.dress.style import Rgb, style_for
from tests.dress.furniture import boards, house, solid

BROWN: Rgb = (0.58, 0.27, 0.0)
WHITE: Rgb = (0.97, 0.97, 0.97)


def _plain_item(class_name: str, item_id: str = "t") -> Item:
    return solid(item_id, [1, 0, 1], [2, 0.8, 1.6], NYU40_NAMES.index(class_name))


def _dressed(
    *items: Item, materials: tuple[Material, ...], share: float = 1.0, seed: int = 5
) -> MutableHouse:
    whole: House = replace(house(*items), materials=materials)
    mutable = MutableHouse(whole, seed)
    finish_furniture(mutable, EMPTY, style_for(mutable.rng("style"), ""), share)
    return mutable


def _material(mutable: MutableHouse, index: int = 0, surface: int = 0) -> Material:
    return mutable.materials[mutable.items[index].surfaces[surface].material]


def test_a_brown_table_becomes_wood_of_a_similar_colour() -> None:
    mutable = _dressed(_plain_item("table"), materials=(Material("amber", diffuse=BROWN),))
    wood, surface = _material(mutable), mutable.items[0].surfaces[0]
    assert wood.name.startswith("grain")
    assert wood.roughness_texture_id
    assert surface.uvs is not None
    luminance = linear_from_srgb(np.array(BROWN)) @ LUMINANCE
    # The picture's mean times the colour is the item's mean.
    (wood_material,) = (v for v in mutable.kept.values() if isinstance(v, PatternMaterial))
    mean = np.array(wood_material.mean_rgb) * linear_from_srgb(np.array(wood.diffuse))
    assert 0.4 * luminance < mean @ LUMINANCE < 5 * luminance
    assert mean[0] > mean[1] > mean[2]


@pytest.mark.parametrize(
    "class_name", ["refrigerator", "television", "toilet", "sink", "lamp", "window", "clothes"]
)
def test_items_never_made_of_wood_keep_their_material(class_name: str) -> None:
    mutable = _dressed(_plain_item(class_name), materials=(Material("amber", diffuse=BROWN),))
    assert mutable.items[0] is mutable.source.items[0]


@pytest.mark.parametrize(
    "material",
    [
        Material("amber", MaterialKind.GLASS, BROWN),
        Material("amber", MaterialKind.MIRROR, BROWN),
        Material("amber", MaterialKind.BULB, BROWN),
        Material("wood", diffuse=BROWN, texture_id="t"),
        Material("wood", diffuse=BROWN, opacity=0.5),
        Material("glass", diffuse=BROWN),
        Material("screen", diffuse=BROWN),
    ],
)
def test_glass_mirrors_bulbs_and_pictures_stay(material: Material) -> None:
    mutable = _dressed(_plain_item("table"), materials=(material,))
    assert mutable.items[0] is mutable.source.items[0]


def test_white_lacquer_keeps_its_colour_and_gets_a_sheen() -> None:
    white = Material("white", diffuse=WHITE)
    lacquer = _material(_dressed(_plain_item("table"), materials=(white,)))
    assert_allclose(lacquer.diffuse, WHITE, atol=1e-3)
    assert lacquer.texture_id is None
    assert lacquer.roughness is not None


def test_black_paint_throws_some_light_back() -> None:
    black = Material("x", diffuse=(0.0, 0.0, 0.0))
    for seed in range(3):
        material = _material(_dressed(_plain_item("cabinet"), materials=(black,), seed=seed))
        assert max(material.diffuse) > 0.1


def test_the_soft_part_of_a_sofa_is_cloth_or_leather_in_a_colour_of_the_style() -> None:
    kinds = {
        _material(_dressed(_plain_item("sofa"), materials=(Material("iris", diffuse=BROWN),), seed=s)).name
        for s in range(12)
    }  # fmt: skip
    families = {name.rpartition("-")[0] for name in kinds}
    assert families == {"weave", "twill", "leather"}


def test_a_bed_has_linen_on_a_wooden_frame() -> None:
    head = solid("b", [0, 0, 0], [0.1, 1.0, 1.6], 4).surfaces[0]
    mattress = replace(solid("b", [0.1, 0.3, 0.1], [1.9, 0.5, 1.5], 4).surfaces[0], material=1)
    bed = replace(_plain_item("bed"), surfaces=(head, mattress))
    materials = (Material("a", diffuse=BROWN), Material("b", diffuse=WHITE))
    mutable = _dressed(bed, materials=materials)
    names = [_material(mutable, 0, k).name.split("-")[0] for k in (0, 1)]
    assert names[0] == "grain"
    assert names[1] in ("weave", "twill")


def test_linen_of_a_bed_never_shines_as_paint_does() -> None:
    bed = _plain_item("bed")
    blanket = replace(bed.surfaces[0], material=1, faces=bed.surfaces[0].faces[:2])
    materials = (Material("a", diffuse=(0.5, 0.5, 0.5)), Material("b", diffuse=(0.4, 0.42, 0.45)))
    mutable = _dressed(replace(bed, surfaces=(*bed.surfaces, blanket)), materials=materials)
    assert all(m.specular != (0.5, 0.5, 0.5) for m in (_material(mutable, 0, k) for k in (0, 1)))


def test_metals_have_measured_colours_and_no_colour_beneath() -> None:
    mutable = _dressed(
        _plain_item("sink"), materials=(Material("Chrome_01", diffuse=(0.7, 0.7, 0.7)),)
    )
    metal = _material(mutable)
    kd, ks = (linear_from_srgb(np.array(c)) @ LUMINANCE for c in (metal.diffuse, metal.specular))
    assert metal.roughness is not None
    assert ks > 4 * kd
    assert ks > 0.2
    brass = _dressed(_plain_item("lamp"), materials=(Material("brass", diffuse=(0.7, 0.6, 0.2)),))
    assert _material(brass).specular == (0.91, 0.78, 0.42)


def test_parts_of_one_colour_in_one_room_get_one_material() -> None:
    chairs = [_plain_item("chair", f"c{k}") for k in range(5)]
    mutable = _dressed(*chairs, materials=(Material("amber", diffuse=BROWN),))
    assert len({i.surfaces[0].material for i in mutable.items}) == 1
    assert mutable.done["parts: object"] == 5


def test_the_share_and_the_seed_decide() -> None:
    material = (Material("amber", diffuse=BROWN),)
    assert not _dressed(_plain_item("table"), materials=material, share=0.0).done
    first, again, other_seed = (
        _dressed(_plain_item("table"), materials=material, seed=s) for s in (1, 1, 2)
    )
    assert _material(first) == _material(again)
    assert first.items[0].surfaces[0].uvs is not None
    assert_allclose(first.items[0].surfaces[0].uvs, again.items[0].surfaces[0].uvs)  # type: ignore[arg-type]
    assert _material(first) != _material(other_seed)


def test_small_knobs_of_other_colours_stay() -> None:
    desk = boards("d", [([0, 0, 0], [1.2, 0.7, 0.6]), ([0.5, 0.3, 0.6], [0.52, 0.32, 0.62])], 14)
    knob = replace(desk.surfaces[1], material=1)
    desk = replace(desk, surfaces=(desk.surfaces[0], knob))
    materials = (Material("amber", diffuse=BROWN), Material("x", diffuse=(0.5, 0.5, 0.5)))
    mutable = _dressed(desk, materials=materials)
    assert mutable.items[0].surfaces[1].uvs is knob.uvs
    assert _material(mutable, 0, 1).texture_id is None
    assert _material(mutable).name.startswith("grain")


def test_words_of_a_name_give_the_kind() -> None:
    assert kind_by_name("Metal_Chrome.001") == "metal"
    assert kind_by_name("lightWood") == "other"
    assert kind_by_name("dark wood") == "wood"
    assert kind_by_name("sofaFabric") == "soft"
    assert kind_by_name("amber") is None


def test_colours_are_distinguished() -> None:
    assert is_brown(BROWN)
    assert is_brown((0.98, 0.67, 0.0))
    assert not is_brown((0.1, 0.2, 0.6))
    assert is_white(WHITE)
    assert not is_white((0.9, 0.5, 0.5))
    assert is_dark((0.1, 0.1, 0.1))


def test_no_furniture_keeps_a_screen_colour() -> None:
    blue = Material("blue", diffuse=(0.1, 0.1, 1.0), specular=(0.3, 0.3, 0.3), shininess=30.0)
    for seed in range(12):
        material = _material(_dressed(_plain_item("cabinet"), materials=(blue,), seed=seed))
        assert max(material.diffuse) - min(material.diffuse) < 0.6
