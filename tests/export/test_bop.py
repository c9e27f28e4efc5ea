"""BOP from views of placed models: poses, masks and models agree with each other."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import trimesh

import pbrs_farm as pf
from pbrs_farm.core.errors import BadInput
from pbrs_farm.export.export_views import export
from pbrs_farm.images import array_from_png
from tests.scene.homes import can, crate, small_home


@pytest.fixture(scope="module")
def bop(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("bop")
    home = small_home().place(can(folder), at=(2, 0.5, 2)).place(crate(folder), at=(2.1, 0.5, 1.9))
    cameras = [
        pf.Camera.look_at((x, 0.9, 2.6), (2, 0.56, 2), size=(96, 72), hfov_deg=40)
        for x in (1.9, 2.3)
    ]
    pf.render(home, cameras, modes=["opengl_dl"]).save(folder / "root")
    n_views, _n_files = export(folder / "root", folder / "bop", "bop")
    assert n_views == 2
    return folder / "bop"


def read(path: Path) -> dict:
    return json.loads(path.read_text())


def test_the_layout_is_complete(bop: Path) -> None:
    scene = bop / "train_pbr/000000"
    assert sorted(p.name for p in scene.iterdir()) == [
        "depth", "mask", "mask_visib", "rgb",
        "scene_camera.json", "scene_gt.json", "scene_gt_coco.json", "scene_gt_info.json",
    ]  # fmt: skip
    assert len(list((scene / "mask").iterdir())) == 4
    camera = read(bop / "camera.json")
    assert (camera["width"], camera["cx"]) == (96, 47.5)
    info = read(bop / "models/models_info.json")
    assert info["1"]["name"] == "can"
    assert info["1"]["size_z"] == pytest.approx(122, abs=0.01)
    assert info["2"]["diameter"] == pytest.approx(np.linalg.norm([120, 200, 60]), abs=0.01)
    mesh = trimesh.load(bop / "models/obj_000001.ply", process=False)
    assert mesh.extents == pytest.approx([66, 66, 122], abs=0.2)


def test_a_posed_model_covers_its_mask(bop: Path) -> None:
    """The model, posed and projected only by the files' values, covers the mask."""
    scene = bop / "train_pbr/000000"
    poses, cameras = read(scene / "scene_gt.json"), read(scene / "scene_camera.json")
    facts = read(scene / "scene_gt_info.json")
    for image, rows in poses.items():
        k = np.array(cameras[image]["cam_K"]).reshape(3, 3)
        for number, row in enumerate(rows):
            mesh = trimesh.load(bop / f"models/obj_{row['obj_id']:06d}.ply", process=False)
            points = mesh.vertices @ np.array(row["cam_R_m2c"]).reshape(3, 3).T + row["cam_t_m2c"]
            pixels = points @ k.T
            pixels = pixels[:, :2] / pixels[:, 2:]
            name = f"{int(image):06d}_{number:06d}.png"
            mask = array_from_png((scene / "mask" / name).read_bytes()) > 0
            visible = array_from_png((scene / "mask_visib" / name).read_bytes()) > 0
            y, x = np.nonzero(mask)
            low, high = pixels.min(0), pixels.max(0)
            assert [x.min(), y.min()] == pytest.approx(np.maximum(low, 0), abs=1.0)
            assert [x.max(), y.max()] == pytest.approx(np.minimum(high, [95, 71]), abs=1.0)
            fact = facts[image][number]
            assert fact["px_count_all"] == mask.sum()
            assert fact["visib_fract"] == pytest.approx(visible.sum() / mask.sum())
            assert (visible <= mask).all()
            assert fact["bbox_obj"][:2] == [x.min(), y.min()]


def test_depth_is_that_of_the_posed_model(bop: Path) -> None:
    scene = bop / "train_pbr/000000"
    depth = array_from_png((scene / "depth/000000.png").read_bytes())
    (row, *_others) = read(scene / "scene_gt.json")["0"]
    visible = array_from_png((scene / "mask_visib/000000_000000.png").read_bytes()) > 0
    radius = 70.0  # half of the can's longest extent
    assert np.abs(depth[visible] - row["cam_t_m2c"][2]).max() < radius


def test_coco_has_the_same_poses(bop: Path, tmp_path: Path) -> None:
    export(bop.parent / "root", tmp_path / "coco", "coco")
    document = read(tmp_path / "coco/annotations.json")
    (row, *_others) = read(bop / "train_pbr/000000/scene_gt.json")["0"]
    posed = [a for a in document["annotations"] if a.get("model") == "can" and a["image_id"] == 1]
    assert len(posed) == 1
    mm = 1000 * np.array(posed[0]["camera_from_model_opencv"])[:3, 3]
    assert mm == pytest.approx(row["cam_t_m2c"])


def test_views_without_placed_models_are_reported(tmp_path: Path) -> None:
    home = small_home()
    pf.render(home, home.cameras(n=1), modes=[]).save(tmp_path / "root")
    with pytest.raises(BadInput, match="no home of these views has a placed model"):
        export(tmp_path / "root", tmp_path / "bop", "bop")
