from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from pbrs_farm.core.catalogue import Catalogue, Picture, Shape
from pbrs_farm.core.house import LightPart, Material, MaterialKind, Texture
from pbrs_farm.core.joints import Joint, JointKind
from pbrs_farm.core.lighting import PowerUnit
from pbrs_farm.geometry.solids import box, sphere
from pbrs_farm.read.catalogue.read_catalogue import ShapeStore, catalogue_from, indexed
from tests.read.catalogue.small_library import entry, library


def _shape() -> Shape:
    texture = Texture("ab", "a.png", "image/png", b"\x89PNG\0")
    materials = (
        Material("glass", MaterialKind.GLASS, (0.1, 1 / 3, 0.7), roughness=0.2),
        Material("w", texture_id="ab"),
    )
    light = LightPart((0.1, 0.2, 0.3), 0.03, 0.5, PowerUnit.SWEETHOME3D, emitting=(1,))
    lid = replace(box("b", np.zeros(3), np.ones(3), 0), part="lid")
    joint = Joint("lid", JointKind.REVOLUTE, (0.0, 1 / 3, 0.0), (1.0, 0.0, 0.0), 1.5)
    surfaces = (lid, sphere("s", np.zeros(3), 1 / 3, 1))
    return Shape(surfaces, materials, {"ab": texture}, (light,), (joint,))


def _never() -> Shape | None:
    raise AssertionError("it was stored")


def _not_again() -> Catalogue:
    raise AssertionError("it was stored")


def test_a_stored_shape_has_the_same_bits(tmp_path: Path) -> None:
    store, shape = ShapeStore(tmp_path / "s"), _shape()
    assert store.shape(("a", 1), lambda: shape) is shape
    again = store.shape(("a", 1), _never)
    assert again is not None
    assert (again.materials, again.textures, again.lights, again.joints) == (
        shape.materials, shape.textures, shape.lights, shape.joints,
    )  # fmt: skip
    for surface, two in zip(again.surfaces, shape.surfaces, strict=True):
        assert (surface.name, surface.material, surface.part) == (two.name, two.material, two.part)
        for name in ("positions", "faces", "uvs", "normals"):
            assert_array_equal(getattr(surface, name), getattr(two, name))


def test_a_model_that_cannot_be_used_is_not_tried_again(tmp_path: Path) -> None:
    store = ShapeStore(tmp_path)
    assert store.shape(("a",), lambda: None) is None
    assert store.shape(("a",), _never) is None


@pytest.mark.parametrize("data", [b"", b"PK\3\4", b"nothing", b"cut"])
def test_a_damaged_file_is_rebuilt(tmp_path: Path, data: bytes) -> None:
    store = ShapeStore(tmp_path)
    store.shape(("a",), _shape)
    (file,) = tmp_path.iterdir()
    file.write_bytes(file.read_bytes()[:-8] if data == b"cut" else data)
    assert store.shape(("a",), _shape) is not None
    assert store.shape(("a",), _never) is not None


def test_an_unwritable_folder_is_not_used(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    assert ShapeStore(tmp_path / "file" / "below").shape(("a",), _shape) is not None


def test_a_catalogue_with_a_store_gives_the_shapes_of_one_without(tmp_path: Path) -> None:
    path, shapes = library(tmp_path, [entry("Dresser")]), tmp_path / "kept"
    plain, first, second = (
        c.shape(c.pieces[0])
        for c in (catalogue_from([path]), *(catalogue_from([path], store=shapes) for _ in range(2)))
    )
    assert plain is not None
    assert first is not None
    assert second is not None
    assert_array_equal(first.bounds, plain.bounds)
    assert_array_equal(second.surfaces[0].positions, plain.surfaces[0].positions)


@pytest.mark.parametrize("damage", [0, 1, 30])
def test_a_catalogue_of_an_index_is_the_one_that_was_made(tmp_path: Path, damage: int) -> None:
    path, index = library(tmp_path, [entry("Dresser")]), tmp_path / "kept" / "0a0a0a0a.index"
    texture = Texture("t", "wood", "image/png", b"\x89PNG\n\0")
    made = replace(
        catalogue_from([path], store=index.parent),
        pictures=(Picture(texture, "wood", (0.5, 1 / 3)),),
    )
    assert indexed(index, lambda: made) is made
    piece = made.pieces[0]
    made_shape = made.shape(piece)
    if damage:
        index.write_bytes(index.read_bytes()[:-damage])
        assert indexed(index, lambda: made) is made
    again = indexed(index, _not_again)
    assert (again.pieces, again.pictures, again.digest) == (made.pieces, made.pictures, made.digest)
    shape = again.shape(piece)
    assert made_shape is not None
    assert shape is not None
    assert_array_equal(shape.surfaces[0].positions, made_shape.surfaces[0].positions)
