from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pbrs_farm.core.gloss import MAX_ALBEDO
from pbrs_farm.core.house import Material, MaterialKind
from pbrs_farm.core.recipe import Recipe, recipe_from_name
from pbrs_farm.transport.scene_tables.material_rows import ALPHA, F0, MAP_ROUGHNESS, material_rows
from pbrs_farm.transport.scene_tables.portals import MAX_PORTALS, nearest_portals, portals_of_house
from pbrs_farm.transport.scene_tables.texture_atlas import TextureAtlas, texture_atlas
from pbrs_farm.transport.validation import known_rooms as rooms

FAST = recipe_from_name("fast")


EMPTY = TextureAtlas(np.zeros(1, np.uint32), {})


def single_row(material: Material, recipe: Recipe = FAST) -> tuple[np.ndarray, list[str]]:
    rows, notes = material_rows(rooms.house([], [material]), EMPTY, recipe)
    return rows[0], notes


def test_whites_stop_at_the_albedo_of_paint() -> None:
    row, _notes = single_row(Material("white"))
    np.testing.assert_allclose(row[:3], MAX_ALBEDO)


def test_kd_and_ks_above_one_are_scaled_and_reported() -> None:
    bright = Material("bright", diffuse=(1, 1, 1), specular=(1, 1, 1), shininess=50)
    row, notes = single_row(bright)
    assert row[4] == pytest.approx(0.08)
    assert any("'bright'" in n and "scaled" in n for n in notes)
    metal, _notes = single_row(
        Material("m", diffuse=(0.2, 0.2, 0.2), specular=(1, 1, 1), shininess=50)
    )
    assert metal[0] + metal[4] <= 1 + 1e-6


def test_the_released_preset_reads_kd_as_linear_and_glass_as_nothing() -> None:
    released = recipe_from_name("released")
    grey, _notes = single_row(
        Material("grey", diffuse=(0.5, 0.5, 0.5), specular=(1, 1, 1), shininess=9), released
    )
    assert grey[0] == 0.5
    assert grey[7] == 0
    glass, _notes = single_row(Material("glass", opacity=0.5), released)
    assert glass[11] == 3


def row_of(material: Material, packed: TextureAtlas = EMPTY) -> np.ndarray:
    return material_rows(rooms.house([], [material]), packed, FAST)[0][0]


def test_a_named_roughness_is_squared_and_gives_a_coat_of_glass_at_least() -> None:
    assert row_of(Material("m", roughness=0.5))[ALPHA] == pytest.approx(0.25)
    np.testing.assert_allclose(row_of(Material("m", roughness=0.5))[F0], 0.04)
    assert row_of(Material("m", roughness=0.0))[ALPHA] == pytest.approx(0.05)
    assert row_of(Material("m"))[ALPHA] == 0
    lacquer = Material("m", roughness=0.3, specular=(0.8, 0.8, 0.8))
    np.testing.assert_allclose(row_of(lacquer)[F0], 0.064)
    gold = Material("m", roughness=0.3, diffuse=(0, 0, 0), specular=(1, 0.8, 0.4))
    assert row_of(gold)[F0][0] == pytest.approx(1.0)


def test_a_normal_map_leaves_the_roughness_that_a_phong_exponent_gives() -> None:
    shiny = Material("m", specular=(0.5, 0.5, 0.5), shininess=30, normal_texture_id="n")
    flat = np.full((4, 4, 3), (128, 128, 255), np.uint8)
    packed = texture_atlas(rooms.house([], [shiny]), {"n": flat})
    row = row_of(shiny, packed)
    assert row[MAP_ROUGHNESS] ** 2 == pytest.approx(row[ALPHA])
    assert row_of(shiny)[MAP_ROUGHNESS] == 0


def test_only_windows_and_glazed_doors_are_portals_and_the_widest_are_kept() -> None:
    house, view = rooms.window_room()
    assert portals_of_house(house).shape == (1, 4, 3)
    many = np.concatenate([portals_of_house(house) + np.array([0, 0, 5.0 * k]) for k in range(9)])
    assert len(nearest_portals(many, view.eye)) == MAX_PORTALS
    assert any((p == many[0]).all() for p in nearest_portals(many, view.eye))


def test_pane_materials_make_a_door_a_portal() -> None:
    house, _view = rooms.window_room(pane=True)
    door = replace(house.openings[0], is_window=False, item_id="walls")
    assert len(portals_of_house(replace(house, openings=(door,)))) == 1
    solid, _view = rooms.window_room()
    assert len(portals_of_house(replace(solid, openings=(door,)))) == 0
    assert house.materials[2].kind is MaterialKind.PANE


def grey(level: float) -> np.ndarray:
    return np.full((32, 32, 3), level, np.float32)
