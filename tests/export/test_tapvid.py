"""Films with point tracks in the format of TAP-Vid's DAVIS file, compared with tracks.npz."""

from __future__ import annotations

import pickle
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import pbrs_farm as pf
from pbrs_farm.core.recipe import recipe_from_name
from pbrs_farm.formats.output_folder import views_of
from pbrs_farm.images import array_from_png
from pbrs_farm.run.plan import check_layers
from pbrs_farm.run.request import Wanted
from tests.inputs.made_views import made_view
from tests.scene.homes import small_home

SIZE = (64, 48)


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A film of three frames of an opening door, with tracks, and a view that is not a frame."""
    home = small_home().open("door_inner", at={0: 0, 1: 1})
    camera = home.cameras_around("door_inner", distance_m=(1.5, 2.5))[0].camera.with_size(*SIZE)
    out = tmp_path_factory.mktemp("tapvid") / "root"
    film = pf.film(home, camera, fps=2, seconds=1.5, modes=["opengl_dl"], tracks=True)
    film.save(out)
    return out


def test_a_reader_of_tap_vid_finds_video_points_and_occlusion(root: Path, tmp_path: Path) -> None:
    pf.open(root).export(tmp_path / "out", "tapvid")
    (video,) = pickle.loads((tmp_path / "out/tapvid.pkl").read_bytes()).values()
    assert (video["video"].shape, video["video"].dtype) == ((3, 48, 64, 3), np.uint8)
    tracks = np.load(next(root.glob("houses/*/tracks.npz")))
    n = len(tracks["points"])
    assert n > 900
    assert (video["points"].shape, video["points"].dtype) == ((n, 3, 2), np.float32)
    assert (video["occluded"].shape, video["occluded"].dtype) == ((n, 3), bool)
    np.testing.assert_allclose(video["points"] * SIZE, tracks["points"], rtol=1e-5, atol=1e-3)
    # As its loaders require: each point starts in the first frame that sees it, within the picture.
    first = (~video["occluded"]).argmax(1)
    begin = video["points"][np.arange(n), first]
    assert ((begin >= 0) & (begin <= 1)).all()


def test_of_some_frames_the_points_that_they_see_are_exported(root: Path, tmp_path: Path) -> None:
    pf.open(root)[1:2].export(tmp_path / "out", "tapvid")
    (video,) = pickle.loads((tmp_path / "out/tapvid.pkl").read_bytes()).values()
    assert video["points"].shape[1] == len(video["video"]) == 1
    assert not video["occluded"].any()


def test_a_home_without_tracks_is_reported(root: Path, tmp_path: Path) -> None:
    tracks = next(root.glob("houses/*/tracks.npz"))
    data = tracks.read_bytes()
    tracks.write_bytes(data[:-200])
    with pytest.raises(pf.BadInput, match=r"tracks.npz: not a tracks.npz"):
        pf.open(root).export(tmp_path / "out", "tapvid")
    tracks.unlink()
    with pytest.raises(pf.BadInput, match="run it with tracks"):
        pf.open(root).export(tmp_path / "out", "tapvid")
    tracks.write_bytes(data)


def test_tracks_of_views_that_are_no_film_are_refused_before_any_output() -> None:
    want = Wanted(tracks=True)
    with pytest.raises(pf.BadInput, match="needs a walk"):
        check_layers(want, recipe_from_name("preview"))
    check_layers(want, recipe_from_name("preview", {"cameras.source": "walk"}))


def kubric_film(folder: Path, depth_in: str) -> tuple[dict, np.ndarray, np.ndarray, np.ndarray]:
    """Table, pictures, planar depth and K of TAPIP3D's reader: `<name>/<name>.npy`, three digits a frame.

    Stored depth is a distance between the two of depth_range, K is divided by the size. TAPIP3D counts pixels from
    the centre of the first one.
    """
    table = np.load(folder / f"{folder.name}.npy", allow_pickle=True).item()
    pictures = np.stack(
        [np.asarray(Image.open(f)) for f in sorted((folder / "frames").glob("???.png"))]
    )
    files = sorted((folder / depth_in).glob("???_depth.png"))
    values = np.stack([np.asarray(Image.open(f)) for f in files]).astype(np.float64)
    near, far = table["depth_range"].astype(np.float64)
    distance = near + values * (far - near) / 65535
    k = table["intrinsics"].astype(np.float64)
    k[:, 0] *= pictures.shape[2]
    k[:, 1] *= pictures.shape[1]
    v, u = np.mgrid[: pictures.shape[1], : pictures.shape[2]]
    first = 0.0 if depth_in == "frames" else 0.5
    rays = np.stack([u + first, v + first, np.ones(u.shape)], -1) @ np.linalg.inv(k[0]).T
    return table, pictures, distance / np.linalg.norm(rays, axis=-1), k


@pytest.mark.parametrize("reader", ["cotracker", "tapip3d"])
def test_cotracker_reads_frames_tracks_depth_and_places(
    root: Path, tmp_path: Path, reader: str
) -> None:
    pf.open(root).export(tmp_path / "out", "cotracker", reader=reader)
    (folder,) = (path for path in (tmp_path / "out").iterdir() if path.is_dir())
    depth_in = "frames" if reader == "tapip3d" else "depth"
    if reader == "cotracker":  # takes every file for a frame
        assert len(list((folder / "frames").iterdir())) == 3
    table, pictures, depth, k = kubric_film(folder, depth_in)
    tracks = np.load(next(root.glob("houses/*/tracks.npz")))
    views = [v for v in views_of(root) if "frame" in v.facts]
    n = len(tracks["points"])
    assert pictures.shape == (3, 48, 64, 3)
    assert table["coords"].shape == (n, 3, 2)
    np.testing.assert_allclose(table["coords"], tracks["points"], atol=1e-3)
    # CoTracker inverts `visibility`.
    np.testing.assert_array_equal(~table["visibility"], ~tracks["occluded"])
    for t, view in enumerate(views):
        stored = array_from_png((view.folder / "depth.png").read_bytes()) / 1000
        seen = stored > 0
        np.testing.assert_allclose(depth[t][seen], stored[seen], atol=2e-3)
        extrinsics = np.diag([1, -1, -1, 1]) @ np.linalg.inv(table["matrix_world"][t].astype(float))
        local = table["traj_3d"][:, t] @ extrinsics[:3, :3].T + extrinsics[:3, 3]
        front = tracks["depth_m"][:, t] > 0
        np.testing.assert_allclose(
            local[front, 2], tracks["depth_m"][front, t], rtol=1e-4, atol=1e-4
        )
        px = local[front] @ k[t].T
        corner = 0.5 if reader == "tapip3d" else 0.0
        xy = px[:, :2] / px[:, 2:] + corner
        np.testing.assert_allclose(xy, table["coords"][front, t], atol=0.02)
    assert (tmp_path / "out/remarks.txt").read_text().startswith("films with fewer than the 24")


def test_a_point_behind_the_camera_has_the_place_of_the_nearest_frame() -> None:
    from pbrs_farm.export.forms.cotracker import places_of_tracks

    facts = {"width_px": 4, "height_px": 4, "K": [[2, 0, 2], [0, 2, 2], [0, 0, 1]]}
    pose = np.eye(4)
    frames = [made_view(facts | {"world_from_camera_opencv": pose.tolist()}) for _ in range(3)]
    depth = np.array([[1, 0, 3], [0, 0, 5]], np.float32)
    places = places_of_tracks(np.full((2, 3, 2), 2.0), depth, frames)
    np.testing.assert_allclose(places[..., 2], [[1, 1, 3], [5, 5, 5]])
