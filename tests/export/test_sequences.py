"""A stereo walk in the formats of SLAM, reconstruction and stereo tools."""

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.lenses import lens_of_opencv
from pbrs_farm.core.recipe import recipe_from_name
from pbrs_farm.export.chosen_view import Choice, ChosenView, require_lens, resize_layer
from pbrs_farm.export.export_views import export
from pbrs_farm.export.forms.colmap import colmap_camera_line
from pbrs_farm.formats.output_folder import views_of
from pbrs_farm.images import array_from_png
from pbrs_farm.run.local import run_local
from pbrs_farm.run.local_run import Run
from pbrs_farm.run.plan import wanted
from pbrs_farm.sample.walks.trajectory_file import poses_from_tum
from tests.check.roots import make_root
from tests.inputs.made_views import made_view

LAYERS = ["flow_forward", "occlusion_forward", "disparity", "occlusion_stereo"]


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("walk")
    fields = {
        "image.width_px": "64", "image.height_px": "48", "cameras.source": "walk",
        "cameras.walk_frames": "3", "cameras.walk_fps": "5", "cameras.stereo_m": "0.065",
    }  # fmt: skip
    recipe = recipe_from_name("preview", fields)
    summary = run_local(Run(["builtin"], str(out), recipe, wanted(["opengl_dl"], LAYERS)))
    assert summary.failures == []
    return out


def facts_of(root: Path, view: str) -> dict:
    return next(v.facts for v in views_of(root) if v.id == view)


def only(folder: Path) -> Path:
    return next(p for p in folder.iterdir() if p.is_dir())


def test_nerfstudios_poses_turn_the_home_to_z_up(root: Path, tmp_path: Path) -> None:
    n_views, n_files = export(root, tmp_path / "x", "nerfstudio")
    house = only(tmp_path / "x")
    assert (n_views, n_files) == (6, 20)
    transforms = json.loads((house / "transforms.json").read_text())
    turn = np.array([*transforms["applied_transform"], [0, 0, 0, 1]])
    assert len(transforms["frames"]) == 6
    for frame in transforms["frames"]:
        facts = facts_of(root, Path(frame["file_path"]).stem)
        pose = turn @ np.array(facts["world_from_camera_opengl"])
        np.testing.assert_allclose(frame["transform_matrix"], pose, atol=1e-12)
        assert (house / frame["file_path"]).is_file()
        assert (house / frame["depth_file_path"]).is_file()
        assert (house / frame["normal_file_path"]).is_file()
    # The eye's height is the third coordinate.
    assert 1.4 < transforms["frames"][0]["transform_matrix"][2][3] < 1.7


def test_colmaps_points_project_to_the_pixels_they_came_from(root: Path, tmp_path: Path) -> None:
    from scipy.spatial.transform import Rotation

    export(root, tmp_path / "x", "colmap")
    sparse = only(tmp_path / "x") / "sparse/0"
    models = [line.split() for line in (sparse / "cameras.txt").read_text().splitlines()]
    model = models[0]
    # Both eyes are separate sensors with equal values.
    assert [m[0] for m in models] == ["1", "2"]
    assert models[1][1:] == model[1:]
    assert model[1:4] == ["PINHOLE", "64", "48"]
    fx, fy, cx, cy = map(float, model[4:])
    points = [line.split() for line in (sparse / "points3D.txt").read_text().splitlines()]
    rows = (sparse / "images.txt").read_text().splitlines()
    # gsplat and pycolmap read an empty line as the end of the file.
    assert all(rows)
    names = []
    for pose_row, seen_row in zip(rows[::2], rows[1::2], strict=True):
        number, w, x, y, z, *shift, camera, name = pose_row.split()
        names.append(name)
        assert camera == ("2" if "_right" in name else "1")
        observed = np.array(seen_row.split(), float).reshape(-1, 3)
        observed_points = [points[int(n) - 1] for n in observed[:, 2]]
        # Each point has one observation, in this picture, at the index of its track.
        assert [point[8:] for point in observed_points] == [
            [number, str(k)] for k in range(len(observed_points))
        ]
        turn = Rotation.from_quat([float(v) for v in (x, y, z, w)])
        local = turn.apply(np.array([point[1:4] for point in observed_points], float)) + np.array(
            shift, float
        )
        projected = local[:, :2] / local[:, 2:] * (fx, fy) + (cx, cy)
        np.testing.assert_allclose(projected, observed[:, :2], atol=0.05)
    assert names[0] == "frame_00000.png"
    assert [point[0] for point in points] == [str(n) for n in range(1, len(points) + 1)]


def test_tums_trajectory_is_read_back_as_the_same_poses(root: Path, tmp_path: Path) -> None:
    export(root, tmp_path / "x", "tum")
    house = only(tmp_path / "x")
    poses = poses_from_tum((house / "groundtruth.txt").read_text(), "groundtruth.txt")
    assert [p.time_s for p in poses] == pytest.approx([0.0, 0.2, 0.4])
    stored = facts_of(root, "frame_00001")["world_from_camera_opengl"]
    np.testing.assert_allclose(poses[1].world_from_camera, stored, atol=1e-7)
    time, file = (house / "depth.txt").read_text().split("\n")[1].split()
    assert float(time) == pytest.approx(0.2)
    depth = array_from_png((house / file).read_bytes())
    view = next(v for v in views_of(root) if v.id == "frame_00001")
    millimetres = array_from_png((view.folder / "depth.png").read_bytes())
    np.testing.assert_array_equal(depth, millimetres.astype(int) * 5)


def test_tum_writes_both_views_of_every_pair(root: Path, tmp_path: Path) -> None:
    n_views, n_files = export(root, tmp_path / "x", "tum")
    house = only(tmp_path / "x")
    pictures = [*house.glob("rgb*/*.png")]
    assert len(pictures) == n_views == 6
    assert n_files == len([p for p in (tmp_path / "x").rglob("*") if p.is_file()])
    for name in ("rgb_right", "depth_right"):
        rows = [line.split() for line in (house / f"{name}.txt").read_text().splitlines()]
        assert all((house / file).exists() for _time, file in rows)
    text = (house / "groundtruth_right.txt").read_text()
    right = poses_from_tum(text, "groundtruth_right.txt")[2].world_from_camera
    stored = facts_of(root, "frame_00002_right")["world_from_camera_opengl"]
    np.testing.assert_allclose(right, stored, atol=1e-7)


def test_kittis_maps_have_its_units_and_noc_leaves_out_hidden_pixels(
    root: Path, tmp_path: Path
) -> None:
    export(root, tmp_path / "x", "kitti")
    out = tmp_path / "x"
    index = [line.split() for line in (out / "index.txt").read_text().splitlines()]
    assert [row[2] for row in index] == [f"frame_{k:05d}" for k in range(3)]
    occ, noc = (
        array_from_png((out / f"disp_{n}_0/000000_10.png").read_bytes()) for n in ("occ", "noc")
    )
    assert (occ > 0).sum() > (noc > 0).sum() > 0
    np.testing.assert_array_equal(noc[noc > 0], occ[noc > 0])
    flow = array_from_png((out / "flow_noc/000000_10.png").read_bytes())
    assert set(np.unique(flow[..., 2])) == {0, 1}
    assert (out / "image_2/000000_11.png").read_bytes() == (
        out / "image_2/000001_10.png"
    ).read_bytes()
    assert not (out / "image_2/000002_11.png").exists()
    assert not (out / "flow_occ/000002_10.png").exists()
    p2, p3 = (out / "calib/000000.txt").read_text().strip().split("\n")
    left, right = (np.array(p.split()[1:], float).reshape(3, 4) for p in (p2, p3))
    assert (left - right)[0, 3] == pytest.approx(left[0, 0] * 0.065)
    # Its pixel coordinates start at the centre of the first: the middle of 64 x 48 is (31.5, 23.5).
    assert left[:2, 2] == pytest.approx([31.5, 23.5])


def test_kitti_leaves_out_views_of_other_lenses_that_no_frame_needs(
    root: Path, tmp_path: Path
) -> None:
    mixed = Path(shutil.copytree(root, tmp_path / "mixed"))
    first = views_of(mixed)[0]
    still = next(mixed.glob(f"houses/*/views/{first.id}")).with_name("still")
    shutil.copytree(still.with_name(first.id), still)
    for name in ("flow_forward", "disparity"):
        next(still.glob(f"{name}.*")).unlink()
    facts = first.facts | {"view": "still", "lens": {"model": "equirect"}}
    (still / "view.json").write_text(
        json.dumps({k: v for k, v in facts.items() if k not in ("frame", "time_s")})
    )
    export(mixed, tmp_path / "x", "kitti")
    export(root, tmp_path / "y", "kitti")
    assert (tmp_path / "x/index.txt").read_text() == (tmp_path / "y/index.txt").read_text()


def test_a_walk_has_a_laser_scan_a_frame(root: Path, tmp_path: Path) -> None:
    export(root, tmp_path / "x", "lidar", scanner="rplidar_a1")
    house = only(tmp_path / "x")
    poses = poses_from_tum((house / "poses.txt").read_text(), "poses.txt")
    assert [p.time_s for p in poses] == pytest.approx([0.0, 0.2, 0.4])
    # Scans of the left eye only: a scanner has no pair.
    assert sorted(p.name for p in house.glob("*.pcd")) == [f"frame_{k:05d}.pcd" for k in range(3)]
    eye = np.array(facts_of(root, "frame_00001")["world_from_camera_opengl"])[:3, 3]
    words = (house / "poses.txt").read_text().splitlines()[1].split()
    np.testing.assert_allclose([float(v) for v in words[1:4]], eye, atol=1e-6)


@pytest.mark.parametrize(
    ("form", "reason"), [("tum", "no view is a frame"), ("kitti", "no view has flow or disparity")]
)
def test_views_that_belong_to_no_sequence_are_refused(
    form: str, reason: str, tmp_path: Path
) -> None:
    make_root(tmp_path / "root")
    with pytest.raises(BadInput, match=reason):
        export(tmp_path / "root", tmp_path / "x", form, choice=Choice())


def test_flow_and_disparity_are_measured_in_the_pixels_of_the_new_size() -> None:
    flow = np.full((4, 8, 2), 6.0, np.float32)
    np.testing.assert_array_equal(resize_layer("flow_forward", flow, 4, 4)[0, 0], [3.0, 6.0])
    kitti = np.full((4, 8, 3), 2**15 + 64, np.uint16)
    kitti[..., 2] = 1
    assert resize_layer("flow_forward_kitti", kitti, 4, 4)[0, 0].tolist() == [
        2**15 + 32,
        2**15 + 64,
        1,
    ]
    assert resize_layer("disparity", np.full((4, 8), 512, np.uint16), 4, 4)[0, 0] == 256


def test_forms_name_the_lens_or_refuse_it() -> None:
    facts = {"width_px": 640, "height_px": 480, "K": [[500, 0, 320], [0, 501, 240], [0, 0, 1]]}
    radtan = {"model": "radtan", "k1": 0.1, "k2": 0.2, "p1": 0.3, "p2": 0.4, "k3": 0.5}
    cube = {"model": "cubemap"}

    def view_through(lens: dict[str, Any]) -> ChosenView:
        return made_view(facts | {"lens": lens}, id="a")

    bent, strip = view_through(radtan), view_through(cube)
    assert (
        colmap_camera_line(bent) == "FULL_OPENCV 640 480 500 501 320 240 0.1 0.2 0.3 0.4 0.5 0 0 0"
    )
    eight, twelve = (
        lens_of_opencv([0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, *more]).table()
        for more in ([], [0.9, 0, 0, 0])
    )
    assert colmap_camera_line(view_through(eight)).endswith("0.1 0.2 0.3 0.4 0.5 0.6 0.7 0.8")
    with pytest.raises(BadInput, match=r"no prism \(s1 to s4\)"):
        colmap_camera_line(view_through(twelve))
    for form, models in (("colmap", ("radtan", "fisheye")), ("kitti", ()), ("released", ())):
        with pytest.raises(BadInput, match=r"lens\.model cubemap"):
            require_lens(strip, form, *models)
