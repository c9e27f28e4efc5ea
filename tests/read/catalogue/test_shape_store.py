from __future__ import annotations

import math
import os
import re
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from pbrs_farm.assets.debian import drop_oldest, read_used
from pbrs_farm.core.catalogue import Catalogue, Picture, Shape
from pbrs_farm.core.house import LightPart, Material, MaterialKind, Texture
from pbrs_farm.core.joints import Joint, JointKind
from pbrs_farm.core.lighting import PowerUnit
from pbrs_farm.geometry.solids import box, sphere
from pbrs_farm.prepare.dress_catalogue import digest_of_code
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
    new, again = (store.shape(("a", 1), make) for make in (lambda: shape, _never))
    assert new is not None
    assert again is not None
    assert (again.materials, again.textures, again.lights, again.joints) == (
        shape.materials, shape.textures, shape.lights, shape.joints,
    )  # fmt: skip
    for surface, two in zip((*new.surfaces, *again.surfaces), 2 * shape.surfaces, strict=True):
        assert (surface.name, surface.material, surface.part) == (two.name, two.material, two.part)
        for name in ("positions", "faces", "uvs", "normals"):
            array = getattr(surface, name)
            assert_array_equal(array, getattr(two, name))
            assert array is None or not array.flags.writeable


def test_a_model_that_cannot_be_used_is_not_tried_again(tmp_path: Path) -> None:
    store = ShapeStore(tmp_path)
    assert store.shape(("a",), lambda: None) is None
    assert store.shape(("a",), _never) is None


def test_a_shape_that_cannot_be_stored_is_made_each_time(tmp_path: Path) -> None:
    shape = _shape()
    shape = replace(shape, joints=(replace(shape.joints[0], upper=math.inf),))
    assert ShapeStore(tmp_path).shape(("a",), lambda: shape) is shape


@pytest.mark.parametrize(
    ("old", "new"),
    [
        (b"", b""),
        (b"", b"PK\3\4"),
        (b"", b"nothing"),
        (rb".{8}\Z", b""),
        (rb"\Z", b"too long"),
        (b'"<f4"', b'"odd"'),
        (b'"<f4"', b'"<U1"'),
        (b'"<f4"', b'"<f2"'),
        (rb'\["<f4",\[24,3\]\]', b"null".ljust(14)),
        (rb"\[24,3\]", b"[0,%d]" % 10**30),
        (b'"image/png",5', b'"image/png",-5'),
    ],
)
def test_a_damaged_file_is_rebuilt(tmp_path: Path, old: bytes, new: bytes) -> None:
    store = ShapeStore(tmp_path)
    store.shape(("a",), _shape)
    (file,) = tmp_path.iterdir()
    whole = file.read_bytes()
    damaged = re.sub(old, lambda _: new, whole, count=1, flags=re.DOTALL) if old else new
    assert damaged != whole
    file.write_bytes(damaged)
    assert store.shape(("a",), _shape) is not None
    assert file.read_bytes() == whole


def test_what_was_used_last_stays_in_a_full_folder(tmp_path: Path) -> None:
    ages_s = {"zz.shape": 9, "b.shape": 8, "c.shape": 7, "d.index": 6, "tmpnew": 5,
              "tmpold": 90_000, "e.index": 90_000}  # fmt: skip
    for name, age_s in ages_s.items():
        (tmp_path / name).write_bytes(bytes(100))
        os.utime(tmp_path / name, (time.time() - age_s,) * 2)
    assert read_used(tmp_path / "zz.shape") == bytes(100)
    drop_oldest(tmp_path / "d.index", 200, every=1)
    assert sorted(f.name for f in tmp_path.iterdir()) == ["d.index", "tmpnew", "zz.shape"]


def test_an_unwritable_folder_is_not_used(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    assert ShapeStore(tmp_path / "file" / "below").shape(("a",), _shape) is not None


def test_a_catalogue_with_a_store_gives_the_shapes_of_one_without(tmp_path: Path) -> None:
    path, shapes = library(tmp_path, [entry("Dresser")]), tmp_path / "store"
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
    path, index = library(tmp_path, [entry("Dresser")]), tmp_path / "store" / "0a0a0a0a.index"
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
    elsewhere = replace(piece, id="elsewhere")
    assert indexed(index, lambda: made).load(elsewhere) is None
    assert made_shape is not None
    assert shape is not None
    assert_array_equal(shape.surfaces[0].positions, made_shape.surfaces[0].positions)


def test_names_and_bytes_of_code_and_tables_are_in_its_digest(tmp_path: Path) -> None:
    files = [
        {"a.py": "1", "sub/b.csv": "2"},
        {"a.py": "1", "sub/b.csv": "2", "read.me": "3"},
        {"a.py": "1", "sub/b.csv": "3"},
        {"a.py": "1", "sub/c.csv": "2"},
        {"a.py": "1", "b.csv": "2"},
        {"a.py": "1", "sub/b.csv": "2", "sub/c.toml": ""},
    ]
    for number, texts in enumerate(files):
        for name, text in texts.items():
            path = tmp_path / str(number) / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text)
    digests = [digest_of_code(tmp_path / str(number)) for number in range(len(files))]
    assert digests[0] == digests[1]
    assert len(set(digests)) == len(files) - 1
    (tmp_path / "numpy-9.dist-info").mkdir()
    for name, value in (("version", "4.0"), ("path", [*sys.path, str(tmp_path)])):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(sys, name, value)
            assert digest_of_code.__wrapped__(tmp_path / "0") not in digests
