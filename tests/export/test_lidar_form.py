"""Laser scans as files: PLY and PCD have the same returns, which are on the home's surfaces."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import trimesh

from pbrs_farm.core.errors import BadInput
from pbrs_farm.export.export_views import export
from pbrs_farm.export.forms.lidar import scanners_table
from pbrs_farm.truth.lidar import LIDARS
from tests.check.roots import make_root
from tests.export import loaders


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("finished")
    make_root(folder)
    return folder


@pytest.fixture(scope="module")
def scans(root: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("scans") / "set"
    assert export(root, out, "lidar", scanner="vlp16") == (2, 5)
    return next(p for p in out.iterdir() if p.is_dir())


def view_of(root: Path, name: str) -> dict:
    file = next((root / "houses").iterdir()) / "views" / name / "view.json"
    return json.loads(file.read_text())


def triangles_of(root: Path) -> np.ndarray:
    """(F, 3, 3) the home's triangles, read by trimesh."""
    file = next((root / "houses").iterdir()) / "house.glb"
    triangles = trimesh.load(file, process=False).to_mesh().triangles
    return triangles[trimesh.triangles.area(triangles) > 0]  # closest_point divides by an edge


def test_ply_and_pcd_hold_the_same_returns_and_the_same_pose(scans: Path) -> None:
    poses = [line.split() for line in (scans / "poses.txt").read_text().splitlines()]
    for number, name in enumerate(("v0", "v1")):
        ply, (pcd, pose) = (
            loaders.ply_cloud(scans / f"{name}.ply"),
            loaders.pcd_cloud(scans / f"{name}.pcd"),
        )
        names = {"normal_x": "nx", "normal_y": "ny", "normal_z": "nz"}
        assert ply.equals(pcd.rename(columns=names))
        assert float(poses[number][0]) == number
        np.testing.assert_allclose(pose[:3, 3], [float(v) for v in poses[number][1:4]], atol=1e-6)


def test_the_scanner_is_upright_at_the_camera_and_looks_its_way(root, scans) -> None:
    for name in ("v0", "v1"):
        _pcd, pose = loaders.pcd_cloud(scans / f"{name}.pcd")
        camera = np.array(view_of(root, name)["world_from_camera_opencv"])
        np.testing.assert_allclose(pose[:3, 3], camera[:3, 3], atol=1e-6)
        np.testing.assert_allclose(pose[:3, 2], [0, 1, 0], atol=1e-6)
        ahead = camera[:3, 2] * [1, 0, 1]
        np.testing.assert_allclose(pose[:3, 0], ahead / np.linalg.norm(ahead), atol=1e-6)
        assert np.linalg.det(pose[:3, :3]) == pytest.approx(1)


def test_returns_lie_on_the_homes_surfaces_in_their_rings(root, scans) -> None:
    triangles = triangles_of(root)
    cloud, pose = loaders.pcd_cloud(scans / "v0.pcd")
    assert 0.5 * LIDARS["vlp16"].n_beams < len(cloud) <= LIDARS["vlp16"].n_beams
    local = cloud[["x", "y", "z"]].to_numpy(float)
    np.testing.assert_allclose(np.linalg.norm(local, axis=1), cloud.range, rtol=1e-5)
    elevation = np.degrees(np.arcsin(local[:, 2] / cloud.range))
    np.testing.assert_allclose(elevation, -15 + 2 * cloud.ring.astype(float), atol=1e-3)
    # The exact range, for every hundredth unmirrored beam.
    some = cloud[cloud.mirrored == 0].iloc[::100]
    exact = some[["x", "y", "z"]].to_numpy(float) / some.range.to_numpy()[:, None]
    world = exact * some.range_true.to_numpy()[:, None] @ pose[:3, :3].T + pose[:3, 3]
    for point in world:
        near = trimesh.triangles.closest_point(triangles, np.tile(point, (len(triangles), 1)))
        assert np.linalg.norm(near - point, axis=1).min() < 1e-3
    noise = (cloud.range - cloud.range_true).to_numpy()
    assert noise.std() == pytest.approx(0.015, rel=0.05)


def test_labels_are_those_of_the_home(root, scans) -> None:
    items = json.loads((next((root / "houses").iterdir()) / "house.json").read_text())["items"]
    cloud = loaders.ply_cloud(scans / "v1.ply")
    classes = np.array([0, *(item["nyu40"] for item in items)])
    assert (classes[cloud.instance] == cloud.label).all()
    assert len(set(cloud.instance)) > 5
    assert cloud.intensity.between(0, 1).all()
    np.testing.assert_allclose((cloud[["nx", "ny", "nz"]] ** 2).sum(axis=1), 1, atol=1e-5)


def test_the_docs_have_the_scanners() -> None:
    page = Path(__file__).parents[2] / "docs/howto/sensors.md"
    assert scanners_table() in page.read_text()


def test_a_flat_scanner_has_one_ring_and_an_unknown_one_is_refused(root, tmp_path) -> None:
    export(root, tmp_path / "a", "lidar", scanner="rplidar_a1")
    cloud = loaders.ply_cloud(next((tmp_path / "a").glob("*/v0.ply")))
    assert len(cloud) <= 360
    assert (cloud.z == 0).all()
    with pytest.raises(BadInput, match=r"^scanner: vlp61 is not a choice.*vlp16"):
        export(root, tmp_path / "b", "lidar", scanner="vlp61")
