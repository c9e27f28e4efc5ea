"""The bank of painted materials returns exactly the materials that would be painted."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from pbrs_farm.core.frames import linear_from_srgb
from pbrs_farm.core.house import Material, Texture
from pbrs_farm.dress.mutable_house import MutableHouse
from pbrs_farm.dress.painted_bank import PaintedBank
from pbrs_farm.dress.painted_materials import Painted
from pbrs_farm.dress.patterns import Pattern, pattern_material
from pbrs_farm.images import decode_texture
from pbrs_farm.read.builtin.builtin_home import builtin_home

OAK = Painted(
    Material("oak", texture_id="a", normal_texture_id="b", specular=(0.5, 0.5, 0.5)),
    (Texture("a", "a.jpg", "image/jpeg", b"1\n23"), Texture("b", "b.jpg", "image/jpeg", b"\n4")),
    (0.1, 0.2, 1 / 3),
)


def _never() -> Painted:
    raise AssertionError("painted again")


def _counting(calls: list[int]) -> Callable[[], Painted]:
    def paint() -> Painted:
        calls.append(1)
        return OAK

    return paint


def test_a_process_finds_pictures_painted_by_another(tmp_path: Path) -> None:
    assert PaintedBank(tmp_path).painted("oak", lambda: OAK) == OAK
    assert PaintedBank(tmp_path).painted("oak", _never) == OAK


@pytest.mark.parametrize("damage", [b"", b"x", b"\n\n\n"])
def test_a_damaged_file_is_painted_again(tmp_path: Path, damage: bytes) -> None:
    PaintedBank(tmp_path).painted("oak", lambda: OAK)
    (file,) = tmp_path.iterdir()
    file.write_bytes(damage or file.read_bytes()[:-1])
    calls: list[int] = []
    assert PaintedBank(tmp_path).painted("oak", _counting(calls)) == OAK
    assert calls == [1]
    assert PaintedBank(tmp_path).painted("oak", _never) == OAK


def test_a_folder_that_cannot_be_written_costs_only_time(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"")
    assert PaintedBank(tmp_path / "file").painted("oak", lambda: OAK) == OAK


def test_a_bank_stays_below_its_size(tmp_path: Path) -> None:
    bank = PaintedBank(tmp_path, most_bytes=4000)
    for k in range(400):
        bank.painted(f"oak {k}", lambda: OAK)
    assert 0 < sum(f.stat().st_size for f in tmp_path.iterdir()) < 400 * 400


def test_a_home_does_not_depend_on_the_banks_contents(tmp_path: Path) -> None:
    pictures = []
    for bank in (PaintedBank(None), PaintedBank(tmp_path), PaintedBank(tmp_path)):
        house = MutableHouse(builtin_home(), 1, bank=bank)
        pattern = pattern_material(house, Pattern("paint", 1, ((0.8, 0.7, 0.6),)))
        pictures.append((house.materials[pattern.number], pattern.mean_rgb, house.textures))
        house.close()
    assert pictures[0] == pictures[1] == pictures[2]


def test_surfaces_of_two_tints_share_a_picture_and_have_their_colours() -> None:
    house = MutableHouse(builtin_home(), 1)
    tints = ((0.86, 0.7, 0.6), (0.8, 0.85, 0.77), (0.3, 0.2, 0.1))
    painted = [pattern_material(house, Pattern("paint", 1, (tint,))) for tint in tints]
    materials = [house.materials[m.number] for m in painted]
    assert materials[0].texture_id == materials[1].texture_id != materials[2].texture_id
    for tint, material, pattern in zip(tints, materials, painted, strict=True):
        texture = house.textures[material.texture_id or ""]
        picture = decode_texture(texture.data, texture.name, texture.media_type)
        linear = linear_from_srgb(picture / 255).mean((0, 1)) * linear_from_srgb(
            np.array(material.diffuse)
        )
        assert linear == pytest.approx(linear_from_srgb(np.array(tint)), rel=0.02)
        assert pattern.mean_rgb == pytest.approx(linear, rel=0.01)
    house.close()
