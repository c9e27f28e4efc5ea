"""The user's meshes: read in metres, and refused with the file and the reason."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image

import pbrs_farm as pf
from pbrs_farm.core.errors import BadInput
from tests.read.gltf.gltf_scenes import Scene
from tests.scene.homes import can, crate, small_home


def test_units_and_up_become_metres_and_y(tmp_path: Path) -> None:
    assert can(tmp_path).size_m == pytest.approx((0.066, 0.066, 0.122), abs=1e-4)
    assert can(tmp_path).up == "z"
    assert crate(tmp_path).up == "y"
    sized = pf.model(tmp_path / "can.ply", size_m=0.5)
    assert max(sized.size_m) == pytest.approx(0.5)
    assert [m.id for m in pf.models(tmp_path / "*.ply", unit="mm")] == ["can"]


def test_colours_of_vertices_become_a_colour_a_triangle(tmp_path: Path) -> None:
    mesh = trimesh.creation.box((1, 1, 1))
    mesh.visual.vertex_colors = np.array([[20 * k, 0, 255, 255] for k in range(8)], np.uint8)
    mesh.export(tmp_path / "box.ply")
    shape = pf.model(tmp_path / "box.ply").shape
    (surface,) = shape.surfaces
    assert len(surface.positions) == 36
    assert shape.materials[surface.material].texture_id in shape.textures


def _empty(path: Path) -> None:
    path.write_text("ply\nformat ascii 1.0\nelement vertex 0\nproperty float x\nend_header\n")


def _scaled(scale: float):
    def write(path: Path) -> None:
        trimesh.creation.box((scale, scale, scale)).export(path)

    return write


def _not_finite(path: Path) -> None:
    path.write_text("OFF\n3 1 0\n0 0 0\n1 nan 0\n0 1 0\n3 0 1 2\n")


@pytest.mark.parametrize(
    ("name", "write", "says"),
    [
        ("none.ply", lambda path: None, "no such file"),
        ("a.blend", lambda path: path.write_bytes(b"x"), "is not a supported mesh format"),
        (
            "noise.ply",
            lambda path: path.write_bytes(bytes(range(256)) * 9),
            "cannot be read as a mesh",
        ),
        ("noise.glb", lambda path: path.write_bytes(b"glTF" + bytes(40)), "noise.glb"),
        ("empty.ply", _empty, "has no triangle|cannot be read"),
        ("nan.off", _not_finite, "not finite|cannot be read"),
        ("large.ply", _scaled(900), "is 900 m large .is its unit millimetres"),
        ("small.stl", _scaled(1e-6), "m large"),
    ],
)
def test_a_bad_mesh_is_refused_with_its_name(name: str, write, says: str, tmp_path: Path) -> None:
    write(tmp_path / name)
    with pytest.raises(BadInput, match=says) as caught:
        pf.model(tmp_path / name)
    assert name in str(caught.value)


def test_a_model_that_changes_is_refused(tmp_path: Path) -> None:
    from pbrs_farm.read.objects.own_model import model_shape

    model = can(tmp_path)
    trimesh.creation.box((10, 10, 10)).export(tmp_path / "can.ply")
    model_shape.cache_clear()
    with pytest.raises(BadInput, match="changed since"):
        _ = model.shape


def test_files_of_one_name_are_distinguished_by_their_folders(tmp_path: Path) -> None:
    for folder in ("002_can", "003_box"):
        (tmp_path / folder).mkdir()
        trimesh.creation.box((0.1, 0.1, 0.1)).export(tmp_path / folder / "textured.ply")
    assert [m.id for m in pf.models(tmp_path)] == ["002-can-textured", "003-box-textured"]


def test_a_picture_next_to_a_model_is_part_of_it(tmp_path: Path) -> None:
    (tmp_path / "box.obj").write_text(
        "mtllib box.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl a\nf 1/1 2/1 3/1\n"
    )
    (tmp_path / "box.mtl").write_text("newmtl a\nmap_Kd box.png\n")
    digests = []
    for colour in ("red", "blue"):
        Image.new("RGB", (4, 4), colour).save(tmp_path / "box.png")
        digests.append(pf.model(tmp_path / "box.obj").ref.companions)
    assert digests[0] != digests[1]
    assert "" not in digests


def _obj(folder: Path, picture: str) -> Path:
    (folder / "box.mtl").write_text(f"newmtl a\nmap_Kd {picture}\n")
    (folder / "box.obj").write_text(
        "mtllib box.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl a\nf 1/1 2/1 3/1\n"
    )
    return folder / "box.obj"


def _ply(folder: Path, picture: str) -> Path:
    vertices = "".join(f"property float {name}\n" for name in "xyzst")
    (folder / "box.ply").write_text(
        f"ply\nformat ascii 1.0\ncomment TextureFile {picture}\nelement vertex 3\n{vertices}"
        "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
        "0 0 0 0 0\n1 0 0 1 0\n0 1 0 0 1\n3 0 1 2\n"
    )
    return folder / "box.ply"


def _gltf(folder: Path, picture: str, suffix: str) -> Path:
    scene = Scene()
    scene.materials = [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]
    scene.more = {"images": [{"uri": picture}], "textures": [{"source": 0}]}
    scene.box([0, 0, 0], [1, 1, 1], 0)
    scene.node("box", mesh=0)
    path = folder / f"box{suffix}"
    path.write_bytes(scene.glb())
    return path


WITH_A_PICTURE = {
    "obj": _obj,
    "ply": _ply,
    "glb": lambda folder, picture: _gltf(folder, picture, ".glb"),
    "gltf": lambda folder, picture: _gltf(folder, picture, ".gltf"),
}


@pytest.mark.parametrize("write", WITH_A_PICTURE.values(), ids=WITH_A_PICTURE)
def test_a_changed_picture_next_to_a_model_changes_the_home(write, tmp_path: Path) -> None:
    home, digests, ids = small_home(), set(), set()
    for colour in ("red", "blue"):
        Image.new("RGB", (4, 4), colour).save(tmp_path / "box.png")
        model = pf.model(write(tmp_path, "box.png"), size_m=0.1)
        assert model.notes == ()
        assert len(model.shape.textures) == 1
        digests.add(model.ref.companions)
        ids.add(home.place(model, at=(2, 1, 2)).id)
    assert len(digests) == len(ids) == 2
    assert "" not in digests


@pytest.mark.parametrize("write", WITH_A_PICTURE.values(), ids=WITH_A_PICTURE)
@pytest.mark.parametrize(
    ("picture", "kind"), [("none.png", "missing-texture"), ("noise.png", "unreadable-texture")]
)
def test_a_picture_that_cannot_be_read_is_a_warning_and_a_note_of_the_home(
    write, picture: str, kind: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "noise.png").write_bytes(b"no picture")
    path = write(tmp_path, picture)
    with pytest.warns(UserWarning, match=rf"{path.name}.*\({kind}\)"):
        model = pf.model(path, size_m=0.1)
    assert [note.kind for note in model.notes] == [kind]
    home = small_home().place(model, at=(2, 1, 2)).place(model, at=(2, 1.3, 2))
    assert [note for note in home.house.notes if path.name in note.place] == list(model.notes)
    assert capfd.readouterr().err == ""


def _colours_of_vertices(path: Path) -> None:
    path.write_text("COFF\n3 1 0\n0 0 0 255 0 0 1\n1 0 0 0 255 0 1\n0 1 0 0 0 255 1\n3 0 1 2\n")


def _cut_short(path: Path) -> None:
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nv 1 1 1\nf 1 2")


def _normals_that_are_words(path: Path) -> None:
    corners = "vertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\n"
    facet = f"facet normal a b c\nouter loop\n{corners}endloop\nendfacet\n"
    path.write_text(f"solid x\n{facet}endsolid x\n")


def _two_pictures(path: Path) -> None:
    for name in ("a.png", "b.png"):
        Image.new("RGB", (4, 4), "red").save(path.parent / name)
    _ply(path.parent, "a.png\ncomment TextureFile b.png")


@pytest.mark.parametrize(
    ("name", "write", "kinds"),
    [
        ("box.off", _colours_of_vertices, ["unread-part"]),
        ("box.obj", _cut_short, ["cut-short", "missing-materials"]),
        ("box.stl", _normals_that_are_words, []),
        ("box.ply", _two_pictures, ["unread-part"]),
    ],
)
def test_missing_and_assumed_parts_of_a_model_are_noted_without_a_traceback(
    name: str, write, kinds: list[str], tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    write(tmp_path / name)
    with warnings.catch_warnings(record=True) as heard:
        warnings.simplefilter("always")
        model = pf.model(tmp_path / name)
    assert sorted(note.kind for note in model.notes) == kinds
    assert len(heard) == bool(kinds)
    assert all(f"({kind})" in str(heard[0].message) for kind in kinds)
    assert "Traceback" not in capfd.readouterr().err


def test_a_picture_of_a_mesh_is_looked_up_in_its_folder(tmp_path: Path) -> None:
    (tmp_path / "in").mkdir()
    with pytest.raises(BadInput, match="leads out of the folder"):
        pf.model(_ply(tmp_path / "in", "../outside.png"))


def test_bad_options_are_refused(tmp_path: Path) -> None:
    can(tmp_path)
    for options, says in (({"unit": "feet"}, "no such unit"), ({"up": "w"}, "no such axis")):
        with pytest.raises(BadInput, match=says):
            pf.model(tmp_path / "can.ply", **options)
    with pytest.raises(BadInput, match="no model found"):
        pf.models(tmp_path / "*.obj")
