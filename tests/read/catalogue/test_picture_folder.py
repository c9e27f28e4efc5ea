"""A folder of photographs as pictures for walls."""

from __future__ import annotations

import io
from pathlib import Path

import pytest
from PIL import Image

from pbrs_farm.core.catalogue import PRINTS
from pbrs_farm.core.errors import BadInput
from pbrs_farm.read.catalogue.read_catalogue import catalogue_from


def _write(path: Path, size: tuple[int, int], orientation: int = 1) -> None:
    image = Image.new("RGB", size, (200, 60, 30))
    exif = Image.Exif()
    exif[0x0112] = orientation
    path.parent.mkdir(parents=True, exist_ok=True)
    image.save(path, exif=exif)


def test_photographs_are_upright_and_small(tmp_path: Path) -> None:
    _write(tmp_path / "a.jpg", (1600, 1200))
    _write(tmp_path / "b" / "turned.JPEG", (1600, 1200), orientation=6)
    catalogue = catalogue_from([], given=[tmp_path])
    assert [p.group for p in catalogue.pictures] == [PRINTS, PRINTS]
    assert [p.size[0] / p.size[1] for p in catalogue.pictures] == pytest.approx([4 / 3, 3 / 4])
    with Image.open(io.BytesIO(catalogue.pictures[1].texture.data)) as image:
        assert image.size == (600, 800)


def test_another_photograph_is_another_catalogue(tmp_path: Path) -> None:
    _write(tmp_path / "a.jpg", (80, 60))
    before = catalogue_from([], given=[tmp_path]).digest
    _write(tmp_path / "b.png", (80, 60))
    assert catalogue_from([], given=[tmp_path]).digest != before


def test_an_undecodable_picture_is_a_note_and_an_empty_folder_an_error(tmp_path: Path) -> None:
    _write(tmp_path / "a.jpg", (80, 60))
    (tmp_path / "b.jpg").write_bytes(b"no picture")
    _write(tmp_path / "strip.png", (800, 10))
    catalogue = catalogue_from([], given=[tmp_path])
    assert [p.texture.name for p in catalogue.pictures] == ["a.jpg"]
    assert [n.kind for n in catalogue.notes] == ["unreadable-texture"] * 2
    (tmp_path / "empty").mkdir()
    with pytest.raises(BadInput, match="no model found"):
        catalogue_from([], given=[tmp_path / "empty"])
