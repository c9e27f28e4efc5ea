"""Pictures in memory equal those of a run, from any thread, and are refused in a forked child."""

from __future__ import annotations

import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest

import pbrs_farm as pf
from pbrs_farm.check import verify
from pbrs_farm.core.errors import BadRecipe
from pbrs_farm.run.local import run_local
from pbrs_farm.run.local_run import Run
from pbrs_farm.run.plan import wanted
from tests.scene.homes import can, small_home


@pytest.fixture(scope="module")
def home() -> pf.Home:
    return small_home()


def files(root: Path) -> dict[str, bytes]:
    """All files but markers, which hold clocks."""
    files_found = (p for p in root.rglob("*") if p.is_file() and p.parent.name != "done")
    return {str(p.relative_to(root)): p.read_bytes() for p in files_found}


@pytest.mark.long
def test_a_saved_frame_has_the_bytes_of_a_run(home: pf.Home, tmp_path: Path) -> None:
    frames = pf.render(home, home.cameras(n=2), modes=["opengl_dl", "mlt_il_ol"], layers=["albedo"])
    frames.save(tmp_path / "mine")
    want = wanted(["opengl_dl", "mlt_il_ol"], ["albedo"], 2)
    run_local(Run(["builtin"], str(tmp_path / "run"), home.recipe, want))
    mine, theirs = files(tmp_path / "mine"), files(tmp_path / "run")
    assert mine.keys() == theirs.keys()
    assert [name for name in mine if mine[name] != theirs[name]] == []
    # Stored files are not made again.
    again = run_local(Run(["builtin"], str(tmp_path / "mine"), home.recipe, want))
    assert (again.n_done, again.failures) == (0, [])


def test_a_frame_has_pictures_labels_and_poses(home: pf.Home, tmp_path: Path) -> None:
    shown = home.place(can(tmp_path), at=(2, 0.8, 2), name="mine")
    camera = pf.Camera.look_at((2.5, 1.2, 2.4), (2, 0.86, 2), size=(64, 48), hfov_deg=40)
    frame = pf.render(shown, camera)
    assert frame.colour.shape == (48, 64, 3)
    assert frame.depth.dtype == np.float32
    (row,) = [r for r in frame.instances if r.get("model")]
    assert (row["model"], row["item"]) == ("can", "mine")
    pose = np.array(row["camera_from_model_opencv"])
    inside = frame.instance == row["id"]
    v, u = np.argwhere(inside).mean(0) + 0.5
    projected = frame.k @ pose[:3, 3]
    assert projected[:2] / projected[2] == pytest.approx([u, v], abs=1.5)
    assert pose[2, 3] == pytest.approx(frame.depth[inside].mean(), abs=0.05)
    assert "mine" in repr(frame.instances) or "can" in repr(frame.instances)
    assert "<img" in frame._repr_html_()


@pytest.mark.long
def test_a_frame_has_only_the_modes_of_its_call(home: pf.Home) -> None:
    camera = home.cameras(n=1)[0]
    rich = pf.render(home, camera, modes=["opengl_dl", "opengl_il"], layers=["albedo"])
    plain = pf.render(home, camera, modes=["opengl_dl"])
    assert (rich.modes, plain.modes) == (("opengl_dl", "opengl_il"), ("opengl_dl",))
    assert ("albedo" in rich.layers, "albedo" in plain.layers) == (True, False)
    assert pf.render(home, camera, modes=[]).modes == ()
    assert "opengl_il" not in plain.table["modes"]


def test_a_frame_saved_twice_has_the_files_of_both_calls(home: pf.Home, tmp_path: Path) -> None:
    camera = home.cameras(n=1)[0]
    pf.render(home, camera, modes=["opengl_dl"], layers=["albedo"]).save(tmp_path)
    pf.render(home, camera, modes=["opengl_il"], layers=["material"]).save(tmp_path)
    frame = pf.open(tmp_path)[0]
    assert frame.modes == ("opengl_dl", "opengl_il")
    assert {"albedo", "material"} <= set(frame.layers)
    assert {"opengl_dl", "opengl_il"} <= set(frame.table["modes"])
    assert verify(tmp_path).is_clean


@pytest.mark.long
def test_frames_of_custom_cameras_share_a_folder(home: pf.Home, tmp_path: Path) -> None:
    for x in (2.0, 3.0):
        camera = pf.Camera.look_at((x, 1.5, 3.5), (2, 0.8, 1), size=(64, 48))
        pf.render(home, camera).save(tmp_path)
    opened = pf.open(tmp_path)
    assert len(opened) == 2
    assert verify(tmp_path).is_clean
    with pytest.raises(BadRecipe, match="another recipe"):
        pf.render(home.set(**{"light.spp": 3}), camera).save(tmp_path)


def test_k_and_opencv_poses_are_kept(home: pf.Home) -> None:
    k = np.array([[70.0, 0, 30.0], [0, 71.0, 25.0], [0, 0, 1]])
    look = pf.Camera.look_at((2, 1.5, 3.5), (2, 0.8, 1), size=(64, 48), K=k)
    frame = pf.render(home, look, modes=[])
    assert frame.k == pytest.approx(k)
    same = pf.Camera.from_opencv(frame.world_from_camera_opencv, frame.k, size=(64, 48))
    assert (pf.render(home, same, modes=[]).depth == frame.depth).all()


@pytest.mark.long
def test_a_homes_edits_reach_the_pool_and_verify(home: pf.Home, tmp_path: Path) -> None:
    edited = home.without("sofa").scatter([can(tmp_path)], 3, on="dining table")
    frames = pf.render_homes([edited], tmp_path / "out", views=1, modes=["opengl_dl"])
    assert frames.homes == (edited.id,)
    assert verify(tmp_path / "out").is_clean


def test_threads_take_turns(home: pf.Home) -> None:
    cameras = home.cameras(n=2)
    pictures: dict[int, np.ndarray] = {}

    def work(k: int) -> None:
        pictures[k] = pf.render(home, cameras[k % 2], modes=["opengl_dl"]).colour

    threads = [threading.Thread(target=work, args=(k,)) for k in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert (pictures[0] == pictures[2]).all()
    assert (pictures[1] == pictures[3]).all()


_FORK = """
import os, sys
import pbrs_farm as pf
from tests.scene.homes import small_home
home = small_home()
home.rooms
pid = os.fork()
if pid == 0:
    try:
        home.cameras(n=1)
    except Exception as error:
        print(error)
        sys.stdout.flush()
    os._exit(0)
os.waitpid(pid, 0)
"""


@pytest.mark.long
def test_a_forked_child_is_refused(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", _FORK], capture_output=True, text=True, timeout=120, cwd=Path.cwd()
    )
    assert "was forked from a rendering process" in done.stdout, done.stderr


def test_a_camera_in_no_room_is_a_warning(home: pf.Home) -> None:
    with pytest.warns(UserWarning, match="is in no room"):
        pf.render(home, pf.Camera.look_at((-5, 1, -5), (0, 1, 0), size=(64, 48)), modes=[])
