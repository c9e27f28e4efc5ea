"""Point clouds: points are on the home's surfaces, with the labels of their pixels."""

import json
from pathlib import Path

import numpy as np
import pytest
import trimesh

import pbrs_farm as pf
from pbrs_farm.core.errors import BadInput
from pbrs_farm.export.chosen_view import Choice
from pbrs_farm.export.export_views import export
from pbrs_farm.formats.class_map import class_map
from pbrs_farm.images import array_from_png, png_from_array
from tests.check.roots import SIZE, make_root
from tests.scene.homes import small_home

LABELS = ("depth", "normal", "semantic", "instance")
KINDS = {"float": "<f4", "uchar": "u1", "ushort": "<u2"}


def read_ply(file: Path) -> tuple[np.ndarray, list[str]]:
    """Vertices and comments of a binary PLY, read according to its specification."""
    head, _, body = file.read_bytes().partition(b"end_header\n")
    lines = head.decode().splitlines()
    assert lines[:2] == ["ply", "format binary_little_endian 1.0"]
    fields = [(w[2], KINDS[w[1]]) for w in map(str.split, lines) if w[0] == "property"]
    (n,) = [int(w[2]) for w in map(str.split, lines) if w[0] == "element"]
    vertices = np.frombuffer(body, fields)
    assert len(vertices) == n
    return vertices, [line[8:] for line in lines if line.startswith("comment ")]


def xyz(vertices: np.ndarray) -> np.ndarray:
    return np.stack([vertices[name] for name in "xyz"], axis=1)


@pytest.fixture(scope="module")
def roots(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """The same views with and without `position`, with pictures."""
    folders = {}
    for name in ("with", "without"):
        folder = tmp_path_factory.mktemp(name)
        house = make_root(folder, with_optional=name == "with")
        for view in (house / "views").iterdir():
            picture = np.zeros((SIZE[1], SIZE[0], 3), np.uint8)
            picture[..., 0] = np.arange(SIZE[0])
            picture[..., 1] = np.arange(SIZE[1])[:, None]
            (view / "mlt_il_ol.png").write_bytes(png_from_array(picture))
        folders[name] = house
    return folders


def cloud(house: Path, out: Path, choice: Choice | None = None) -> tuple[np.ndarray, list[str]]:
    assert export(house.parent.parent, out, "ply", choice=choice) == (2, 2)
    return read_ply(out / house.name / "v0.ply")


def test_points_have_the_labels_colour_and_normal_of_their_pixel(roots, tmp_path):
    house = roots["without"]
    vertices, comments = cloud(house, tmp_path / "ply")
    files = {x: array_from_png((house / f"views/v0/{x}.png").read_bytes()) for x in LABELS}
    visible = files["depth"] > 0
    assert len(vertices) == visible.sum() > 1000
    rows, columns = np.nonzero(visible)
    assert (vertices["red"] == columns).all()
    assert (vertices["green"] == rows).all()
    assert (vertices["label"] == files["semantic"][visible]).all()
    assert (vertices["instance"] == files["instance"][visible]).all()
    # Floor points share one height and their normals point up.
    floor = vertices[vertices["label"] == 2]
    assert np.ptp(floor["y"]) < 2e-3
    assert np.allclose(floor["ny"], 1, atol=1e-3)
    assert "label 2 floor" in comments
    # Other readers accept it, too.
    mesh = trimesh.load(tmp_path / "ply" / house.name / "v0.ply")
    assert len(mesh.vertices) == len(vertices)


def test_points_project_to_their_pixels_at_their_depth(roots, tmp_path):
    house = roots["without"]
    vertices, _ = cloud(house, tmp_path / "ply")
    facts = json.loads((house / "views/v0/view.json").read_text())
    pose, k = np.array(facts["world_from_camera_opencv"]), np.array(facts["K"])
    camera = (xyz(vertices) - pose[:3, 3]) @ pose[:3, :3]
    pixels = camera @ k.T
    pixels = pixels[:, :2] / pixels[:, 2:]
    expected = np.stack([vertices["red"], vertices["green"]], axis=1) + 0.5
    assert np.abs(pixels - expected).max() < 1e-2


def test_depth_and_position_give_the_same_points(roots, tmp_path):
    exact, _ = cloud(roots["with"], tmp_path / "a")
    approximate, _ = cloud(roots["without"], tmp_path / "b")
    assert np.abs(xyz(exact) - xyz(approximate)).max() < 2e-3
    assert np.abs(xyz(exact) - xyz(approximate)).max() > 0  # depth has whole mm


def test_labels_are_the_users_and_only_chosen_fields_are_written(roots, tmp_path):
    (tmp_path / "map.csv").write_text("from,id,name\nfloor,900,ground\n")
    choice = Choice(classes=class_map(tmp_path / "map.csv"))
    vertices, comments = cloud(roots["without"], tmp_path / "a", choice)
    assert set(np.unique(vertices["label"])) == {0, 900}
    assert "label 900 ground" in comments
    few = Choice(layers=("depth",), modes=())
    assert cloud(roots["without"], tmp_path / "b", few)[0].dtype.names == ("x", "y", "z")
    small, _ = cloud(roots["without"], tmp_path / "c", Choice(size=(32, 24)))
    assert len(small) <= 32 * 24


def test_another_lens_needs_positions(tmp_path):
    fields = {"lens.preset": "tum_vi", "image.width_px": 64, "image.height_px": 64}
    home = small_home().set(**fields)
    camera = home.cameras(n=1)[0]
    pf.render(home, camera, modes=[]).save(tmp_path / "none")
    with pytest.raises(BadInput, match=r"fisheye needs the layer position .*with layers position"):
        export(tmp_path / "none", tmp_path / "x", "ply")
    pf.render(home, camera, modes=[], layers=["position"]).save(tmp_path / "some")
    assert export(tmp_path / "some", tmp_path / "y", "ply") == (1, 2)
    vertices, _ = read_ply(next((tmp_path / "y").rglob("*.ply")))
    floor = vertices[vertices["label"] == 2]
    assert "red" not in vertices.dtype.names
    assert np.ptp(floor["y"]) < 1e-3
