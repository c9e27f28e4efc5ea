"""Meshes of the user's own: read in metres, and refused with the file and the reason."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image

import pbrs_farm as pf
from pbrs_farm.core.errors import BadInput
from tests.scene.homes import can, crate


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
        ("a.blend", lambda path: path.write_bytes(b"x"), "no mesh that is read"),
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


def test_files_of_one_name_are_told_apart_by_their_folders(tmp_path: Path) -> None:
    for folder in ("002_can", "003_box"):
        (tmp_path / folder).mkdir()
        trimesh.creation.box((0.1, 0.1, 0.1)).export(tmp_path / folder / "textured.ply")
    assert [m.id for m in pf.models(tmp_path)] == ["002-can-textured", "003-box-textured"]


def test_a_picture_beside_a_model_is_part_of_it(tmp_path: Path) -> None:
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


def test_bad_options_are_told(tmp_path: Path) -> None:
    can(tmp_path)
    for options, says in (({"unit": "feet"}, "no such unit"), ({"up": "w"}, "no such axis")):
        with pytest.raises(BadInput, match=says):
            pf.model(tmp_path / "can.ply", **options)
    with pytest.raises(BadInput, match="no model found"):
        pf.models(tmp_path / "*.obj")
