"""A file whose content contradicts its suffix is reported with its real kind by every reader."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import pbrs_farm as pf
from pbrs_farm.core.file_kinds import kind_of, wrong_kind
from pbrs_farm.core.recipe import ReadFields
from pbrs_farm.core.recipe_fields import CameraFields
from pbrs_farm.curate.photographs import stored_depth
from pbrs_farm.formats.bop_camera import camera_of_bop
from pbrs_farm.formats.class_map import class_map
from pbrs_farm.images import decode_photo, decode_radiance
from pbrs_farm.prepare.read_source import read_house
from pbrs_farm.prepare.source import resolve
from pbrs_farm.run.step_cache import camera_file_text
from tests.read.gltf.gltf_scenes import two_rooms


def _png() -> bytes:
    buffer = io.BytesIO()
    Image.new("RGB", (4, 4)).save(buffer, "PNG")
    return buffer.getvalue()


def _zip() -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        archive.writestr("a.txt", "a")
    return buffer.getvalue()


PAGE = b"\n<!doctype html>\n<html><title>Sign in</title></html>\n"
POINTER = b"version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 123\n"
CONTENTS = {
    "a PNG picture": _png(),
    "a ZIP archive": _zip(),
    "a PDF document": b"%PDF-1.7\n%\xe2\xe3\n",
    "an HTML page": PAGE,
    "a pointer of Git LFS": POINTER,
}

Take = Callable[[Path], object]
TAKEN: list[tuple[str, Take]] = [
    *(
        (f"home{suffix}", lambda path: read_house(resolve(str(path)), ReadFields()))
        for suffix in (
            ".glb",
            ".gltf",
            ".ifc",
            ".usda",
            ".usdz",
            ".json",
            ".svg",
            ".txt",
            ".csv",
            ".obj",
        )
    ),
    *((f"model{suffix}", pf.model) for suffix in (".glb", ".gltf", ".obj", ".ply", ".stl", ".off")),
    ("sky.hdr", lambda path: decode_radiance(path.read_bytes(), path.name)),
    ("photo.jpg", lambda path: decode_photo(path.read_bytes(), path.name)),
    ("depth.npy", stored_depth),
    ("recipe.toml", lambda path: pf.load("builtin", path)),
    ("classes.csv", class_map),
    ("camera.json", camera_of_bop),
    ("walk.txt", lambda path: camera_file_text(CameraFields(file=str(path)))),
]


@pytest.mark.parametrize(
    ("name", "take", "words"),
    [
        pytest.param(name, take, words, id=f"{name} {words}")
        for name, take in TAKEN
        for words in CONTENTS
        # USDZ is ZIP, and a picture is accepted under any suffix.
        if (name, words) not in {("home.usdz", "a ZIP archive"), ("photo.jpg", "a PNG picture")}
    ],
)
def test_a_file_of_another_kind_is_reported_with_its_kind(
    name: str, take: Take, words: str, tmp_path: Path
) -> None:
    with pytest.raises(pf.PbrsError, match=f"{name}: is {words}"):
        take(_written(tmp_path / name, CONTENTS[words]))


def _written(path: Path, data: bytes) -> Path:
    path.write_bytes(data)
    return path


def test_a_damaged_file_of_the_right_kind_keeps_its_readers_message(tmp_path: Path) -> None:
    scene = two_rooms().glb()
    with pytest.raises(pf.BadHouse, match=r"cut short|longer|ends"):
        read_house(
            resolve(str(_written(tmp_path / "a.glb", scene[: len(scene) // 2]))), ReadFields()
        )
    # A scene is read by its content, under any name.
    assert read_house(resolve(str(_written(tmp_path / "a.gltf", scene))), ReadFields()).rooms


def test_text_is_of_no_known_kind() -> None:
    for text in (
        b"",
        b"hello",
        b"{}",
        b"a,b\n1,2\n",
        b"<house/>",
        b"v 0 0 0\n",
        b"BM and other words",
    ):
        assert kind_of(text) is None
    assert wrong_kind(b"", "a.glb") == ("is empty", "copy it again")
    assert wrong_kind(_png(), "a.PNG") == ("", "")
    array = io.BytesIO()
    np.save(array, np.zeros(3))
    assert wrong_kind(array.getvalue(), "a.hdr")[0] == "is a NumPy array, though named .hdr"
    assert wrong_kind(_png(), "room")[0] == "is a PNG picture"


def test_a_name_with_braces_is_a_file(tmp_path: Path) -> None:
    path = _written(tmp_path / "{room}.glb", two_rooms().glb())
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(tmp_path)
        assert read_house(resolve(path.name), ReadFields()).rooms
        with pytest.raises(pf.BadHouse, match="no such file"):
            resolve("{none}.glb")


def test_a_model_may_be_called_like_a_pattern(tmp_path: Path) -> None:
    import trimesh

    trimesh.creation.box((0.1, 0.1, 0.1)).export(tmp_path / "box [1].ply")
    assert [model.id for model in pf.models(tmp_path / "box [1].ply")] == ["box-1"]
