"""Generated soft items in one plain colour get threads, and some a print."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pbrs_farm.core.catalogue import EMPTY
from pbrs_farm.core.classes import NYU40_NAMES
from pbrs_farm.core.frames import linear_from_srgb
from pbrs_farm.core.house import Item, Material
from pbrs_farm.dress.mutable_house import MutableHouse
from pbrs_farm.dress.patterns import PatternMaterial
from pbrs_farm.dress.soft_cloth import weave_soft_things
from pbrs_farm.dress.style import style_for
from tests.dress.furniture import house, solid

RED = (0.6, 0.2, 0.1)


def cushion(item_id: str = "c", x: float = 1.0) -> Item:
    return solid(item_id, [x, 0.5, 1], [x + 0.4, 0.62, 1.4], NYU40_NAMES.index("pillow"))


def woven(
    *items: Item, name: str = "cushion", seed: int = 5, share: float = 1.0, **changes: object
) -> MutableHouse:
    material = replace(Material(name, diffuse=RED), **changes)  # type: ignore[arg-type]
    mutable = MutableHouse(replace(house(*items), materials=(material,)), seed)
    weave_soft_things(mutable, EMPTY, style_for(mutable.rng("style"), ""), share)
    return mutable


def material_of(mutable: MutableHouse, index: int = 0) -> Material:
    return mutable.materials[mutable.items[index].surfaces[0].material]


def test_a_plain_cushion_shows_threads_and_keeps_its_colour_unless_it_is_printed() -> None:
    woven_items = [woven(cushion(), seed=seed) for seed in range(12)]
    families = {material_of(m).name.split("-")[0] for m in woven_items}
    assert {"wallpaper"} < families <= {"wallpaper", "weave", "twill"}
    for mutable in woven_items:
        cloth = material_of(mutable)
        assert cloth.texture_id
        assert mutable.items[0].surfaces[0].uvs is not None
        if not cloth.name.startswith("wallpaper"):
            (print_material,) = (v for v in mutable.kept.values() if isinstance(v, PatternMaterial))
            mean = np.array(print_material.mean_rgb) * linear_from_srgb(np.array(cloth.diffuse))
            np.testing.assert_allclose(mean, linear_from_srgb(np.array(RED)), rtol=0.05)


def test_parts_of_one_colour_in_one_room_get_one_material() -> None:
    for seed in range(4):
        mutable = woven(cushion("a"), cushion("b", 2.0), seed=seed)
        assert material_of(mutable, 0) == material_of(mutable, 1)


def test_the_print_of_upholstery_is_smaller_than_a_hand() -> None:
    n_printed = 0
    for seed in range(24):
        mutable = woven(cushion(), name="fabric", seed=seed)
        if material_of(mutable).name.startswith("wallpaper"):
            n_printed += 1
            surface = mutable.items[0].surfaces[0]
            corners, uvs = surface.positions[surface.faces], surface.uvs[surface.faces]
            sides = np.linalg.norm(corners - np.roll(corners, 1, 1), axis=2)
            repeats = np.linalg.norm(uvs - np.roll(uvs, 1, 1), axis=2)
            assert np.median(sides / repeats) < 0.2
    assert n_printed


def test_bed_linen_is_not_printed_if_the_table_excludes_it() -> None:
    names = {material_of(woven(cushion(), name="pillow", seed=s)).name for s in range(8)}
    assert all(name.startswith("twill") for name in names)


def test_a_packed_models_name_is_recognised_and_no_other_material_changes() -> None:
    assert material_of(woven(cushion(), name="m3_cushion")).texture_id
    for name in ("shade fabric", "china", "cushion shop"):
        assert woven(cushion(), name=name).items[0].surfaces[0].material == 0
    assert woven(cushion(), texture_id="t").items[0].surfaces[0].material == 0
    assert woven(cushion(), share=0.0).items[0].surfaces[0].material == 0


def test_the_large_plain_parts_of_a_sofa_keep_their_colour_and_its_feet_stay() -> None:
    sofa = solid("s", [0, 0, 0], [2, 0.8, 0.9], NYU40_NAMES.index("sofa"))
    assert material_of(woven(sofa, name="cojines")).texture_id
    for name in ("steel", "oak wood"):
        assert woven(sofa, name=name).items[0].surfaces[0].material == 0
    foot = solid("f", [0, 0, 0], [0.05, 0.1, 0.05], NYU40_NAMES.index("sofa"))
    assert woven(foot, name="patas").items[0].surfaces[0].material == 0
    table = solid("t", [0, 0, 0], [2, 0.8, 0.9], NYU40_NAMES.index("table"))
    assert woven(table, name="cojines").items[0].surfaces[0].material == 0
