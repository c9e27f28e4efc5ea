"""A walk through the small home while its doors open: stored files, and checks of verify."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

import pbrs_farm as pf
from pbrs_farm.check import verify
from pbrs_farm.check.certificate import Certificate
from pbrs_farm.images import exr_from_layers, layers_from_exr
from pbrs_farm.run.processes.render_task import Event
from tests.check.roots import sign

LAYERS = [
    "flow_forward", "flow_backward", "flow_forward_kitti", "occlusion_forward",
    "occlusion_backward", "scene_flow", "part", "behind_glass_depth",
]  # fmt: skip
FIELDS = {
    "image.width_px": 96, "image.height_px": 72, "cameras.source": "walk",
    "cameras.walk_frames": 4, "cameras.walk_fps": 4,
}  # fmt: skip


@pytest.fixture(scope="module")
def moving() -> pf.Home:
    return pf.load("builtin", recipe="preview", **FIELDS).open("door_*", at={0: 0.1, 0.75: 1})


@pytest.fixture(scope="module")
def finished_run(moving: pf.Home, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("out")
    pf.render_homes(moving, out, modes=["opengl_dl"], layers=LAYERS, tracks=True)
    return out


@pytest.fixture(scope="module")
def certificate(finished_run: Path) -> Certificate:
    return verify(finished_run, all_pixels=True)


def view(root: Path, number: int) -> Path:
    return next(root.glob("houses/*")) / f"views/frame_{number:05d}"


def table(root: Path, number: int) -> dict:
    return json.loads((view(root, number) / "view.json").read_text())


@pytest.mark.long
def test_every_pixel_and_every_table_is_right(certificate: Certificate) -> None:
    assert certificate.is_clean, certificate.text()
    for name in ("flow_forward", "flow_backward", "occlusion_forward", "scene_flow"):
        # Pixels on an edge, where the ray of verify meets the other surface, are left out.
        assert 0 <= 3 * 96 * 72 - certificate.counts[f"motion: {name}"].checked <= 3
    assert certificate.counts["motions"].checked > 20
    # Each point is checked for its place and visibility in each frame.
    assert certificate.counts["tracks"].checked > 2 * 4 * 900
    assert certificate.counts["tracks"].ties <= 20


@pytest.mark.long
def test_each_view_records_the_time_and_the_opening_of_doors(
    finished_run: Path, moving: pf.Home
) -> None:
    for number, share in enumerate((0.1, 0.4, 0.7, 1.0)):
        facts = table(finished_run, number)
        assert facts["time_s"] == number / 4
        values = {row["item"]: row["value"] for row in facts["motion"]["joints"]}
        expected = {row["item"]: share * row["upper"] for row in moving.joints}
        assert values == pytest.approx(expected)


@pytest.mark.long
def test_a_door_that_is_seen_flows_and_its_frame_does_not(finished_run: Path) -> None:
    moved = {
        k: np.stack([layers_from_exr((view(finished_run, k) / "scene_flow.exr").read_bytes())[c] for c in "XYZ"])
        for k in range(3)
    }  # fmt: skip
    shares = [(np.abs(m).max(0) > 1e-3).mean() for m in moved.values()]
    assert max(shares) > 0.02
    assert min(shares) < 0.9
    # A hinge is vertical: no part of a door moves up or down.
    assert max(np.abs(m[1]).max() for m in moved.values()) < 1e-6


@pytest.mark.long
def test_ids_of_instances_stay_over_time(finished_run: Path) -> None:
    names = [
        {row["id"]: row["item"] for row in table(finished_run, k)["instances"]} for k in range(4)
    ]
    for a, b in pairwise(names):
        assert {k: a[k] for k in a.keys() & b.keys()} == {k: b[k] for k in a.keys() & b.keys()}


def shift(file: str, channel: str, by: float) -> Callable[[Path], None]:
    def plant(root: Path) -> None:
        path = view(root, 1) / file
        planes = {k: v.copy() for k, v in layers_from_exr(path.read_bytes()).items()}
        planes[channel][20:40, 30:60] += np.float32(by)
        path.write_bytes(exr_from_layers(planes))

    return plant


def change(file: Callable[[Path], Path], edit: Callable[[dict], None]) -> Callable[[Path], None]:
    def plant(root: Path) -> None:
        document = json.loads(file(root).read_text())
        edit(document)
        file(root).write_text(json.dumps(document))

    return plant


def further(held: dict) -> None:
    held["motion"]["joints"][0]["value"] += 0.01


def faster(held: dict) -> None:
    for motion in held["motions"]:
        motion["times_s"][1] = 0.7


def house_json(root: Path) -> Path:
    return next(root.glob("houses/*")) / "house.json"


def wrong_tracks(edit: Callable[[dict], None]) -> Callable[[Path], None]:
    def plant(root: Path) -> None:
        file = house_json(root).with_name("tracks.npz")
        arrays = dict(np.load(file))
        edit(arrays)
        np.savez_compressed(file, **arrays)

    return plant


def aside(held: dict) -> None:
    held["points"][held["query_frame"] != 2, 2, 0] += 0.2


def unseen(held: dict) -> None:
    held["occluded"][5:15, 3] ^= True


def nearer(held: dict) -> None:
    held["depth_m"][:, 1] *= 0.99


FALSEHOODS = {
    "track": (wrong_tracks(aside), "tracks"),
    "occlusion of tracks": (wrong_tracks(unseen), "tracks"),
    "depth of tracks": (wrong_tracks(nearer), "tracks"),
    "flow": (shift("flow_forward.exr", "X", 0.3), "motion: flow_forward"),
    "scene flow": (shift("scene_flow.exr", "Z", 0.002), "motion: scene_flow"),
    "state": (change(lambda r: view(r, 2) / "view.json", further), "motions"),
    "keys": (change(house_json, faster), "motions"),
}


@pytest.mark.long
@pytest.mark.parametrize("name", FALSEHOODS)
def test_a_falsehood_about_motion_is_found(finished_run: Path, tmp_path: Path, name: str) -> None:
    plant, check = FALSEHOODS[name]
    root = tmp_path / "root"
    shutil.copytree(finished_run, root)
    plant(root)
    sign(root, house_json(root).parent)
    counts = verify(root, sample=1000).counts
    assert counts[check].failed > 0


@pytest.mark.long
def test_a_film_in_memory_shows_the_home_at_each_time(moving: pf.Home) -> None:
    camera = moving.viewpoint(moving.cameras_around("door_inner", distance_m=(1.5, 2.5))[0].camera)
    frames = pf.film(moving, camera.camera, fps=4, seconds=0.75, modes=[], layers=["part"])
    assert [frame.ref.view for frame in frames] == ["frame_00000", "frame_00001", "frame_00002"]
    # The home stopped at a frame's time and rendered separately has the same labels.
    stopped = pf.render(moving.at(0.5), camera.camera, modes=[], layers=["part"])
    np.testing.assert_array_equal(frames[2].depth, stopped.depth)
    np.testing.assert_array_equal(frames[2].layer("part"), stopped.layer("part"))
    assert (frames[0].depth != frames[2].depth).mean() > 0.02
    # A film of the same frames at other times is another film.
    later = pf.film(moving, camera.camera, 4, 0.75, from_s=0.5, modes=[], layers=["part"])
    np.testing.assert_array_equal(later[0].depth, frames[2].depth)


def test_pictures_of_opengl_follow(moving: pf.Home) -> None:
    small = moving
    camera = small.cameras_around("door_inner", distance_m=(1.5, 2.5))[0].camera
    modes = ["opengl_dl", "opengl_il"]
    film = pf.film(small, camera, fps=2, seconds=1.0, modes=modes)
    stopped = pf.render(small.at(0.5), camera, modes=modes)
    for mode in modes:
        np.testing.assert_array_equal(film[1].picture(mode), stopped.picture(mode))
        assert (film[0].picture(mode) != film[1].picture(mode)).mean() > 0.02


def test_a_wrong_film_is_refused(moving: pf.Home) -> None:
    camera = moving.cameras_around("door_inner", distance_m=(1.5, 2.5))[0].camera
    with pytest.raises(pf.BadInput, match="4 frames"):
        pf.film(moving, [camera] * 3, fps=2, seconds=2, modes=[])
    with pytest.raises(pf.BadInput, match="seconds: share"):
        moving.open("door_*", at={0: 2})


def test_a_rig_films_each_frame_by_all_its_cameras(moving: pf.Home) -> None:
    camera = moving.cameras_around("door_inner", distance_m=(1.5, 2.5))[0].camera
    rig = {"cameras": [{"name": "a"}, {"name": "b", "translation_m": [0.2, 0, 0]}]}
    film = pf.film(moving, camera, fps=2, seconds=1, modes=[], layers=["disparity"], rig=rig)
    names = ["frame_00000", "frame_00000_b", "frame_00001", "frame_00001_b"]
    assert [frame.ref.view for frame in film] == names
    # The same pictures as from explicit cameras at that time.
    pose = camera.world_from_camera.copy()
    pose[:3, 3] += 0.2 * pose[:3, 0]
    aside = replace(camera, world_from_camera=pose)
    alone = pf.render(moving.at(0.5), aside, modes=[])
    np.testing.assert_array_equal(film[3].depth, alone.depth)
    assert film[3].table["rig"]["camera"] == "b"
    both_seen = (film[0].depth > 0) & (film[0].layer("disparity") > 0)
    f = film[0].table["K"][0][0]
    expected = 256 * f * 0.2 / film[0].depth[both_seen]
    np.testing.assert_allclose(film[0].layer("disparity")[both_seen], expected, rtol=2e-3, atol=1)
    with pytest.raises(pf.BadInput, match=r"rig: cameras\[0\].yaw"):
        pf.film(moving, camera, fps=2, seconds=1, rig={"cameras": [{"name": "a", "yaw": 3}]})


@pytest.mark.long
def test_a_killed_film_is_resumed(finished_run: Path, moving: pf.Home, tmp_path: Path) -> None:
    root = tmp_path / "root"
    shutil.copytree(finished_run, root)
    (folder,) = root.glob("houses/*")
    # State after a kill: one frame is not started; of another the last step, and the tracks, are
    # missing.
    shutil.rmtree(folder / "views/frame_00001")
    for marker in folder.glob("done/*frame_00001.json"):
        marker.unlink()
    for lost in ("done/view.frame_00002.json", "views/frame_00002/view.json", "done/tracks.json"):
        (folder / lost).unlink()
    again: list[str] = []

    def hear(event: Event) -> None:
        if event.kind == "done":
            again.append(f"{event.step} {event.view_id}")

    pf.render_homes(moving, root, modes=["opengl_dl"], layers=LAYERS, tracks=True, observe=hear)
    assert sorted(again) == [
        "opengl_dl frame_00001", "tracks None", "truth frame_00001", "view frame_00001",
        "view frame_00002",
    ]  # fmt: skip
    ((before, after),) = zip(finished_run.glob("houses/*"), root.glob("houses/*"), strict=True)
    names = [
        p.relative_to(before) for p in before.rglob("*") if p.is_file() and p.parent.name != "done"
    ]
    for name in names:
        if name.name != "manifest.jsonl":
            assert (after / name).read_bytes() == (before / name).read_bytes(), name
