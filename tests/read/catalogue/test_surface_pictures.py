from __future__ import annotations

import io
from pathlib import Path

import pytest
from PIL import Image

from pbrs_farm.core.errors import BadInput
from pbrs_farm.read.catalogue.read_catalogue import catalogue_from
from pbrs_farm.read.catalogue.surface_pictures import MOST_OF_A_GROUP, TEXTURES, surface_group
from tests.read.catalogue.small_library import library_bytes


def picture(size: tuple[int, int] = (8, 8), colour: str = "red") -> bytes:
    buffer = io.BytesIO()
    Image.new("RGB", size, colour).save(buffer, "PNG")
    return buffer.getvalue()


def row(name: str, image: str = "a.png", **more: str) -> dict[str, str]:
    return {"id": name, "name": name, "image": f"/{image}", "width": "60", "height": "40"} | more


def textures(folder: Path, rows: list[dict[str, str]], contents: dict[str, bytes]) -> Path:
    path = folder / "Small.sh3t"
    path.write_bytes(library_bytes(rows, contents, catalogue=TEXTURES))
    return path


def test_a_texture_library_gives_pictures_with_their_size(tmp_path: Path) -> None:
    path = textures(tmp_path, [row("Oak wood")], {"a.png": picture()})
    (wood,) = catalogue_from([], given=[path]).pictures
    assert (wood.group, wood.size, wood.licence) == ("wood", (0.6, 0.4), "CC-BY 3.0")
    assert wood.texture.data == picture()


def test_large_pictures_are_made_smaller(tmp_path: Path) -> None:
    path = textures(tmp_path, [row("Brick")], {"a.png": picture((2048, 1024))})
    (smaller,) = catalogue_from([], given=[path]).pictures
    assert Image.open(io.BytesIO(smaller.texture.data)).size == (1024, 512)


def test_an_undecodable_picture_becomes_a_note_and_the_others_are_read(tmp_path: Path) -> None:
    rows = [row("Oak wood"), row("Marble", "b.png"), row("Brick", "c.png"), row("Tile", width="x")]
    path = textures(tmp_path, rows, {"a.png": picture(), "b.png": b"no picture"})
    catalogue = catalogue_from([], given=[path])
    assert [p.group for p in catalogue.pictures] == ["wood"]
    kinds = [n.kind for n in catalogue.notes]
    assert kinds == ["unreadable-texture", "unreadable-texture", "unreadable-entry"]


def test_a_large_library_gives_some_of_each_kind(tmp_path: Path) -> None:
    shades = [(f"{k}.png", picture(colour=f"#{k:06x}")) for k in range(MOST_OF_A_GROUP + 9)]
    rows = [row("Fabric", name, id=name) for name, _ in shades]
    path = textures(tmp_path, rows, dict(shades))
    assert len(catalogue_from([], given=[path]).pictures) == MOST_OF_A_GROUP


@pytest.mark.parametrize(
    "data", [b"", b"PK\3\4 damaged", library_bytes([])], ids=["empty", "damaged", "no texture"]
)
def test_a_damaged_texture_library_is_refused(tmp_path: Path, data: bytes) -> None:
    path = tmp_path / "bad.sh3t"
    path.write_bytes(data)
    with pytest.raises(BadInput, match="no usable piece or picture"):
        catalogue_from([], given=[path])


@pytest.mark.parametrize(
    ("name", "category", "group"),
    [
        ("Oak", "Wood", "wood"),
        ("Wooden floor", "Floor", "planks"),
        ("Red tiles", "Floor", "tiles"),
        ("Marble", "Wall", "marble"),
        ("X12", "Fabrics", "cloth"),
        ("Blue sky", "Sky", ""),
        ("Grass", "Floor", ""),
    ],
)
def test_the_name_of_a_picture_gives_its_kind(name: str, category: str, group: str) -> None:
    assert surface_group(name, category) == group
