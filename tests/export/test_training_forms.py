"""Formats of training programs, read back by loaders written from their documentation only."""

from __future__ import annotations

import json
import os
import shutil
from pathlib import Path

import numpy as np
import pytest

from pbrs_farm import truth
from pbrs_farm.core.camera import Camera, Intrinsics
from pbrs_farm.core.classes import NYU40_NAMES
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.house_split import SplitShares
from pbrs_farm.core.lenses import Lens
from pbrs_farm.export.chosen_view import Choice
from pbrs_farm.export.export_views import export, remarks_of
from pbrs_farm.formats.class_map import class_map
from pbrs_farm.images import array_from_png, exr_from_layers, png_from_array
from pbrs_farm.read.builtin.builtin_home import builtin_home
from tests.check.roots import SIZE, make_root
from tests.export import loaders


def gradient(k: int) -> np.ndarray:
    """A picture whose pixels are all different."""
    picture = np.full((SIZE[1], SIZE[0], 3), 40 * k, np.uint8)
    picture[..., 0] = np.arange(SIZE[0])
    picture[..., 1] = np.arange(SIZE[1])[:, None]
    return picture


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("finished")
    house = make_root(folder)
    for k, view in enumerate(sorted((house / "views").iterdir())):
        (view / "mlt_il_ol.png").write_bytes(png_from_array(gradient(k)))
        depth = png(view / "depth.png").copy()
        depth[0, :4] = 0, 1, 65534, 65535
        (view / "depth.png").write_bytes(png_from_array(depth))
        metres = np.where(depth < 65535, depth / 1000, 80).astype(np.float32)
        (view / "depth_z.exr").write_bytes(exr_from_layers({"Z": metres}))
    return folder


def png(file: Path) -> np.ndarray:
    return array_from_png(file.read_bytes())


def views(root: Path) -> list[Path]:
    return sorted(next((root / "houses").iterdir()).glob("views/*"))


def within_png(depth: np.ndarray) -> np.ndarray:
    """Metres in depth.png, 0 for its last value."""
    return np.where(depth == 65535, 0, depth) / 1000


def test_yolo_reads_metric_depth_and_nothing_else(root, tmp_path, monkeypatch):
    assert export(root, tmp_path / "set", "yolo-depth", shares=SplitShares(1, 0, 0)) == (2, 5)
    # Works in any directory: ultralytics resolves a yaml's folders relative to the yaml.
    monkeypatch.chdir(tmp_path)
    assert "path:" not in (tmp_path / "set/data.yaml").read_text()
    for split in ("train", "val"):  # equal with one home
        examples = list(loaders.yolo_depth(Path(os.path.relpath("set/data.yaml")), split))
        for k, (example, view) in enumerate(zip(examples, views(root), strict=True)):
            np.testing.assert_array_equal(example.rgb, gradient(k))
            np.testing.assert_array_equal(example.target, within_png(png(view / "depth.png")))


def test_yolos_depth_is_metres_in_numpy_if_depth_z_is_requested(root, tmp_path):
    export(root, tmp_path / "set", "yolo-depth", choice=Choice(layers=("depth_z",)))
    first = next(loaders.yolo_depth(tmp_path / "set/data.yaml", "val"))
    assert first.target.dtype == np.float32
    assert first.target[0, :4] == pytest.approx([0, 0.001, 65.534, 80])


def test_yolos_masks_name_the_class_of_every_pixel(root, tmp_path):
    assert export(root, tmp_path / "set", "yolo-semantic") == (2, 5)
    names = np.array(["", *NYU40_NAMES[1:]])
    examples = loaders.yolo_semantic(tmp_path / "set/data.yaml", "train")
    for example, view in zip(examples, views(root), strict=True):
        np.testing.assert_array_equal(example.target, names[png(view / "semantic.png")])


def test_yolos_masks_take_custom_classes(root, tmp_path):
    (tmp_path / "mine.csv").write_text("from,id,name\nchair,7,seat\nbed,3,bed: a\n")
    choice = Choice(classes=class_map(tmp_path / "mine.csv"))
    export(root, tmp_path / "set", "yolo-semantic", choice=choice)
    names = np.full(41, "", object)
    names[[NYU40_NAMES.index("chair"), NYU40_NAMES.index("bed")]] = "seat", "bed: a"
    examples = loaders.yolo_semantic(tmp_path / "set/data.yaml", "train")
    for example, view in zip(examples, views(root), strict=True):
        np.testing.assert_array_equal(example.target, names[png(view / "semantic.png")])


def test_marigold_reads_depth_and_normals_from_its_lists(root, tmp_path):
    n = export(root, tmp_path / "set", "marigold", shares=SplitShares(1, 0, 0))
    assert n == (2, 8)
    folder = tmp_path / "set/train"
    depths = loaders.marigold(folder, "filename_list_train.txt")
    for k, (example, view) in enumerate(zip(depths, views(root), strict=True)):
        np.testing.assert_array_equal(example.rgb, gradient(k))
        np.testing.assert_array_equal(example.target, within_png(png(view / "depth.png")))
    normals = loaders.marigold(folder, "filename_list_normals_train.txt")
    for example, view in zip(normals, views(root), strict=True):
        n = png(view / "normal.png") * (2 / 65535) - 1
        mine = np.stack([n[..., 0], n[..., 2], -n[..., 1]], axis=-1)
        valid = png(view / "valid.png") > 0
        np.testing.assert_allclose(example.target[valid], mine[valid], atol=1e-4)
        assert (example.target[~valid] == 0).all()
        # Z points to the camera: no visible surface faces away.
        assert (example.target[valid] * rays()[valid]).sum(-1).max() < 1e-3


def test_marigold_reads_light_and_materials_from_their_lists(root, tmp_path):
    folder = tmp_path / "homes"
    shutil.copytree(root, folder)
    rng = np.random.default_rng(5)
    first, second = views(folder)
    colours = rng.integers(0, 256, (*png(first / "depth.png").shape, 3)).astype(np.uint8)
    light = {n: rng.random(colours.shape).astype(np.float16) for n in ("shading", "residual")}
    light["residual"] -= np.float16(0.4)
    grey = {n: rng.integers(0, 256, colours.shape[:2]) for n in ("roughness", "metallic", "mirror")}
    (first / "albedo.png").write_bytes(png_from_array(colours))
    for name, array in light.items():
        planes = dict(zip("RGB", np.moveaxis(array.astype(np.float32), -1, 0), strict=True))
        (first / f"{name}.exr").write_bytes(exr_from_layers(planes, half=True))
    for view in (first, second):
        (view / "albedo.png").write_bytes(png_from_array(colours))
        for name, array in grey.items():
            (view / f"{name}.png").write_bytes(png_from_array(array.astype(np.uint8)))
    export(folder, tmp_path / "set", "marigold")
    srgb = colours / 255
    linear = np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)
    (lit,) = loaders.marigold_lighting(tmp_path / "set", "filename_list_iid_lighting.txt")
    albedo, shading, residual = lit.target
    np.testing.assert_allclose(albedo, linear, atol=1e-6)
    np.testing.assert_array_equal(shading, light["shading"])
    np.testing.assert_array_equal(residual, light["residual"])
    n_negative = int((light["residual"] < 0).any(-1).sum())
    (remark,) = remarks_of(tmp_path / "set")
    assert remark.startswith(f"residual: negative at {n_negative} of {colours[..., 0].size} pixels")
    examples = loaders.marigold_appearance(tmp_path / "set", "filename_list_iid_appearance.txt")
    for example, view in zip(examples, views(folder), strict=True):
        surface, rough, metallic, mask = example.target
        np.testing.assert_array_equal(surface, colours)
        np.testing.assert_allclose(rough * 255, grey["roughness"], atol=0.1)
        np.testing.assert_allclose(metallic * 255, grey["metallic"], atol=0.1)
        counts = (png(view / "valid.png") > 0) & (grey["mirror"] == 0)
        np.testing.assert_array_equal(mask, counts)


def rays() -> np.ndarray:
    """(H, W, 3) rays of the root's pinhole camera, x right, y up, z backward."""
    i = Intrinsics.from_hfov(*SIZE)
    x, y = np.meshgrid(np.arange(SIZE[0]) + 0.5, np.arange(SIZE[1]) + 0.5)
    directions = np.stack([(x - i.cx) / i.fx, -(y - i.cy) / i.fy, -np.ones_like(x)], axis=-1)
    return directions / np.linalg.norm(directions, axis=-1, keepdims=True)


@pytest.fixture(scope="module")
def panoramas(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Tilted panoramas of a room, coloured by world direction."""
    folder, home = tmp_path_factory.mktemp("panoramas"), builtin_home()
    size = (256, 128)
    i = Intrinsics(*size, size[0] / (2 * np.pi), size[1] / np.pi, 128, 64, Lens("equirect"))
    eyes, towards = ((2.0, 1.5, 2.0), (1.2, 1.4, 3.0)), ((1, -0.3, 0.5), (-0.2, 0.1, -1))
    cameras = {
        f"v{k}": Camera.look(i, np.array(e), np.array(t))
        for k, (e, t) in enumerate(zip(eyes, towards, strict=True))
    }
    cameras["a pinhole"] = Camera.look(
        Intrinsics.from_hfov(*SIZE), np.array(eyes[0]), np.array(towards[0])
    )
    cameras = {name.replace(" ", "_"): camera for name, camera in cameras.items()}
    house = make_root(folder, home, cameras)
    for name, camera in cameras.items():
        view = house / "views" / name
        _origin, directions = camera.exact_rays()
        colours = np.rint(
            (directions / np.linalg.norm(directions, axis=-1, keepdims=True) + 1) * 127.5
        )
        (view / "mlt_il_ol.png").write_bytes(png_from_array(colours.astype(np.uint8)))
        table = json.loads((view / "view.json").read_text())
        far = np.full(directions.shape[:2], 99, np.float32)
        table["layout"] = truth.layout_table(home.rooms[0], camera, far)
        (view / "view.json").write_text(json.dumps(table))
    return folder


def test_horizonnet_finds_the_rooms_corners_in_upright_pictures(panoramas, tmp_path):
    assert export(panoramas, tmp_path / "set", "layoutnet") == (3, 5)
    assert "a_pinhole: has no panorama" in (tmp_path / "set/left_out.txt").read_text()
    room, examples = builtin_home().rooms[0], list(loaders.horizonnet(tmp_path / "set"))
    for example, eye in zip(examples, np.array([(2.0, 1.5, 2.0), (1.2, 1.4, 3.0)]), strict=True):
        corners = example.target
        longitude = ((corners[:, 0] + 0.5) / 1024 - 0.5) * 2 * np.pi
        down = np.tan(((corners[:, 1] + 0.5) / 512 - 0.5) * np.pi)
        assert (np.diff(corners[::2, 0]) > 0).all()
        # The floor's line gives the distance of a corner, and the ceiling's its height.
        far = (eye[1] - room.floor_y) / down[1::2]
        np.testing.assert_allclose(eye[1] - far * down[::2], room.ceiling_y, atol=0.01)
        plan = far[:, None] * np.stack([np.cos(longitude[::2]), np.sin(longitude[::2])], axis=1)
        mine = np.sort(np.linalg.norm(room.polygon - eye[[0, 2]], axis=1))
        np.testing.assert_allclose(np.sort(far), mine, atol=0.01)
        # Walls are along the picture's axes.
        walls = np.roll(plan, -1, axis=0) - plan
        np.testing.assert_allclose(np.abs(walls).min(1), 0, atol=0.01)
        # Each corner of the label has its colour in the picture.
        x, y = np.rint(corners[1::2]).astype(int).T
        colours = example.rgb[y, x] / 127.5 - 1
        expected = np.insert(room.polygon, 1, room.floor_y, axis=1) - eye
        expected /= np.linalg.norm(expected, axis=1, keepdims=True)
        distances = np.linalg.norm(colours[:, None] - expected[None], axis=-1)
        assert distances.min(1).max() < 0.04
        assert len(set(distances.argmin(1))) == len(room.polygon)


def test_views_without_a_forms_layers_are_refused_or_named(root, tmp_path):
    with pytest.raises(BadInput, match="no view is a panorama"):
        export(root, tmp_path / "a", "layoutnet")
    none = Choice(modes=())
    for form in ("marigold", "yolo-depth", "coco"):
        with pytest.raises(BadInput, match="no view has a picture"):
            export(root, tmp_path / form, form, choice=none)
