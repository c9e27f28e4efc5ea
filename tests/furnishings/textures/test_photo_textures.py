"""Photographed surfaces of libraries on floors, walls and furniture."""

from __future__ import annotations

import numpy as np
import pytest

from pbrs_farm.core.catalogue import EMPTY, Catalogue, Picture
from pbrs_farm.core.house import Texture
from pbrs_farm.dress.mutable_house import MutableHouse
from pbrs_farm.dress.patterns import Pattern, pattern_material, photographed
from pbrs_farm.images import jpeg_from_array
from pbrs_farm.read.builtin.builtin_home import builtin_home


def _picture(name: str, group: str, size_m: float = 1.0, data: bytes | None = None) -> Picture:
    if data is None:
        data = jpeg_from_array(np.full((32, 32, 3), 128, np.uint8), 95)
    return Picture(Texture(name, f"{name}.jpg", "image/jpeg", data), group, (size_m, size_m))


def _catalogue(*pictures: Picture) -> Catalogue:
    return Catalogue((), lambda _piece: None, "test", pictures=pictures)


def _shown(catalogue: Catalogue, family: str, n: int = 60) -> list[str]:
    mutable = MutableHouse(builtin_home(), 1)
    return [photographed(mutable, catalogue, Pattern(family, seed)).photograph for seed in range(n)]


def test_as_many_pictures_as_drawn_ones_take_half_of_the_floors() -> None:
    twelve = _catalogue(*(_picture(f"oak{k}", "planks") for k in range(12)))
    shown = _shown(twelve, "strip", 400)
    assert 0.42 < sum(map(bool, shown)) / 400 < 0.58
    assert len(set(shown)) > 10


def test_a_picture_that_repeats_every_few_centimetres_is_only_for_furniture() -> None:
    small = _catalogue(*(_picture(f"w{k}", g, 0.4) for k, g in enumerate(["planks", "wood"] * 30)))
    assert not any(_shown(small, "planks"))
    assert any(_shown(small, "grain"))


def test_a_photographed_material_has_its_size_and_its_mean() -> None:
    catalogue = _catalogue(*(_picture(f"c{k}", "cloth", 0.4) for k in range(100)))
    mutable = MutableHouse(builtin_home(), 1)
    several = (photographed(mutable, catalogue, Pattern("weave", seed)) for seed in range(9))
    pattern = next(p for p in several if p.photograph)
    material = pattern_material(mutable, pattern)
    assert material.size_m == (0.4, 0.4)
    assert material.mean_rgb == pytest.approx([0.216] * 3, abs=0.01)
    assert mutable.materials[material.number].texture_id == pattern.photograph
    assert pattern.photograph in mutable.textures


def test_photographed_veneer_is_narrower_than_a_plank() -> None:
    catalogue = _catalogue(*(_picture(f"v{k}", "wood", 0.5) for k in range(100)))
    mutable = MutableHouse(builtin_home(), 1)
    several = (photographed(mutable, catalogue, Pattern("grain", seed)) for seed in range(9))
    made = pattern_material(mutable, next(p for p in several if p.photograph))
    assert made.size_m == pytest.approx((0.5, 0.3))


def test_a_damaged_picture_is_one_note_and_the_surface_is_drawn() -> None:
    broken = _catalogue(*(_picture(f"x{k}", "tiles", 1.0, b"\xff\xd8\xff") for k in range(50)))
    mutable = MutableHouse(builtin_home(), 1)
    shown = [photographed(mutable, broken, Pattern("tiles", seed)).photograph for seed in range(9)]
    assert not any(shown)
    assert {n.kind for n in mutable.notes} == {"unreadable-texture"}
    places = [n.place for n in mutable.notes]
    assert len(places) == len(set(places))


def test_without_pictures_nothing_changes() -> None:
    assert not any(_shown(EMPTY, "tiles"))
