"""Behaviour common to all readers: pictures, notes, strict reading."""

from __future__ import annotations

from pathlib import Path

import pytest

from pbrs_farm.assets import homes_package
from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.house import House
from pbrs_farm.core.recipe import ReadFields, Recipe
from pbrs_farm.prepare.finished_house import repaired_house
from pbrs_farm.prepare.read_source import read_house
from pbrs_farm.prepare.source import resolve
from pbrs_farm.prepare.source_ref import SourceRef
from pbrs_farm.read.common.material_library import MaterialLibrary, texture_from_bytes
from pbrs_farm.read.common.notes import HARMLESS, Notes
from tests.example_homes import example_homes
from tests.inputs.pictures import picture
from tests.read.sweethome3d.sh3d_source import BOX_OBJ, WALLS, home_xml, piece, sh3d
from tests.read.textured_sources import FORMATS

STRICT = ReadFields(strict=True)
STRICT_RECIPE = Recipe(read=STRICT)
formats = pytest.mark.parametrize("kind", FORMATS)


def texture_notes(house: House) -> list[str]:
    return [n.kind for n in house.notes if n.kind.endswith("-texture")]


def is_cut_out(house: House, texture_id: str) -> bool:
    (is_cut,) = {m.alpha_cutout for m in house.materials if m.texture_id == texture_id}
    return is_cut


@formats
@pytest.mark.parametrize("encoding", ["PNG", "JPEG", "GIF", "BMP", "TIFF", "WEBP"])
def test_a_picture_becomes_the_same_texture_in_every_format(
    tmp_path: Path, kind: str, encoding: str
) -> None:
    data = picture(encoding)
    house = read_house(FORMATS[kind](tmp_path, data), ReadFields())
    expected, _ = texture_from_bytes(data, "")
    texture = house.textures[expected.id]
    assert (texture.media_type, texture.data) == (expected.media_type, expected.data)
    assert texture_notes(house) == []


@formats
def test_only_alpha_below_one_half_makes_a_cut_out(tmp_path: Path, kind: str) -> None:
    for alpha in (255, 100):
        data = picture(alpha=alpha)
        (tmp_path / str(alpha)).mkdir()
        house = read_house(FORMATS[kind](tmp_path / str(alpha), data), ReadFields())
        assert is_cut_out(house, texture_from_bytes(data, "")[0].id) is (alpha < 128)


@formats
@pytest.mark.parametrize(
    ("data", "expected"), [(None, "missing-texture"), (b"no picture", "unreadable-texture")]
)
def test_an_unusable_picture_is_one_note_and_an_error_if_strict(
    tmp_path: Path, kind: str, data: bytes | None, expected: str
) -> None:
    source = FORMATS[kind](tmp_path, data)
    assert texture_notes(read_house(source, ReadFields())) == [expected]
    with pytest.raises(BadHouse, match=expected):
        read_house(source, STRICT)
    with pytest.raises(BadHouse, match=expected):
        repaired_house(source, STRICT_RECIPE)


@pytest.mark.quick(4)
@formats
def test_the_house_step_accepts_a_strictly_read_house(tmp_path: Path, kind: str) -> None:
    source = FORMATS[kind](tmp_path, picture())
    assert {n.kind for n in read_house(source, STRICT).notes} <= HARMLESS
    repaired_house(source, STRICT_RECIPE)


def test_a_harmless_note_is_kept_and_passes_reader_and_step(tmp_path: Path) -> None:
    path = tmp_path / "home.sh3d"
    body = WALLS + piece("name='Xyzzy'")
    path.write_bytes(sh3d(home_xml(body), {"1": BOX_OBJ}))
    source = resolve(str(path))
    assert [n.kind for n in read_house(source, STRICT).notes] == ["unmapped-class"]
    house, _ = repaired_house(source, STRICT_RECIPE)
    assert [n.kind for n in house.notes] == ["unmapped-class"]


@pytest.mark.slow
@pytest.mark.homes
def test_eight_of_the_nine_example_homes_are_accepted_strictly() -> None:
    example_homes()
    rejected = [
        h.name for h in homes_package.example_homes() if not _reads_strictly(resolve(h.name))
    ]
    assert rejected == ["2BedroomApartmentWithBowWindow"]


def _reads_strictly(source: SourceRef) -> bool:
    try:
        read_house(source, STRICT)
    except BadHouse:
        return False
    return True


def test_a_library_numbers_equal_materials_once_and_decodes_a_picture_once() -> None:
    library = MaterialLibrary(Notes("f", strict=False))
    calls = 0

    def load() -> bytes:
        nonlocal calls
        calls += 1
        return picture()

    for _ in range(2):
        assert library.texture("a", name="a", place="p", load=load) is not None
    assert calls == 1
    assert library.textures == {}, "no material names it yet"
