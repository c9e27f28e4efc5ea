"""Films with point tracks in the format of TAP-Vid's DAVIS file, compared with tracks.npz."""

from __future__ import annotations

import pickle
from pathlib import Path

import numpy as np
import pytest

import pbrs_farm as pf
from pbrs_farm.core.recipe import recipe_from_name
from pbrs_farm.run.plan import check_layers
from pbrs_farm.run.request import Wanted
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
