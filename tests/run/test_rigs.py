"""A walk by a rig of four cameras through the small home: outputs of a run, checks of verify, and exports."""

from __future__ import annotations

import json
import math
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pbrs_farm.check import verify
from pbrs_farm.check.certificate import Certificate
from pbrs_farm.cli import main
from pbrs_farm.core.errors import BadInput, BadRecipe
from pbrs_farm.core.recipe import Recipe, recipe_from_name
from pbrs_farm.export.export_views import export
from pbrs_farm.formats.recipe_toml import recipe_from_toml, toml_from_recipe
from pbrs_farm.formats.rig_toml import rig_from_toml
from pbrs_farm.run.local import run_local
from pbrs_farm.run.local_run import Run
from pbrs_farm.run.plan import wanted

RIG = """
name = "head"

[[cameras]]
name = "front"
translation_m = [0.0, 0.0, 0.05]

[[cameras]]
name = "beside"
translation_m = [0.12, 0.0, 0.05]

[[cameras]]
name = "left"
translation_m = [-0.1, -0.02, 0.0]
yaw_deg = -90
pitch_deg = 10
hfov_deg = 100

[[cameras]]
name = "back"
rotation_wxyz = [0.6, 0.0, 0.8, 0.0]
lens = { preset = "kinect" }
"""
EYES = ("", "_beside", "_left", "_back")
LAYERS = ["flow_forward", "occlusion_forward", "disparity", "occlusion_stereo"]
FIELDS = {
    "image.width_px": "64",
    "image.height_px": "48",
    "cameras.source": "walk",
    "cameras.walk_frames": "3",
    "cameras.walk_fps": "5",
}


def rig_file(folder: Path, text: str = RIG) -> Path:
    file = folder / "rig.toml"
    file.write_text(text)
    return file


def recipe_of(rig: Path, **fields: str) -> Recipe:
    text = rig_from_toml(rig).model_dump_json(exclude_unset=True)
    return recipe_from_name("preview", {**FIELDS, **fields, "rig": text})


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("rig")
    recipe = recipe_of(rig_file(out))
    layers = [name for name in LAYERS if "disparity" not in name and "stereo" not in name]
    want = wanted(["opengl_dl"], layers).model_copy(update={"tracks": True})
    run = Run(["builtin"], str(out / "out"), recipe, want)
    assert run_local(run).failures == []
    return out / "out"


@pytest.fixture(scope="module")
def certificate(root: Path) -> Certificate:
    return verify(root)


def house(root: Path) -> Path:
    return next(root.glob("houses/*"))


def table(root: Path, view: str) -> dict[str, Any]:
    view_facts: dict[str, Any] = json.loads((house(root) / f"views/{view}/view.json").read_text())
    return view_facts


@pytest.mark.long
def test_each_instant_has_a_view_of_every_camera(root: Path) -> None:
    views = {p.name for p in house(root).glob("views/*")}
    assert views == {f"frame_{k:05d}{eye}" for k in range(3) for eye in EYES}


@pytest.mark.long
def test_a_view_records_rig_camera_instant_and_transform(root: Path) -> None:
    rig_facts = table(root, "frame_00001_left")["rig"]
    assert (rig_facts["name"], rig_facts["camera"], rig_facts["instant"]) == (
        "head",
        "left",
        "frame_00001",
    )
    c, s = math.cos(math.radians(10)), math.sin(math.radians(10))
    # Its z axis points to the rig's left and 10 degrees up, and y is down.
    expected = [[0, -s, -c, -0.1], [0, c, -s, -0.02], [1, 0, 0, 0], [0, 0, 0, 1]]
    np.testing.assert_allclose(rig_facts["rig_from_camera_opencv"], expected, atol=1e-12)


@pytest.mark.long
def test_the_cameras_of_an_instant_have_the_rigs_poses(root: Path) -> None:
    poses = {
        eye: np.array(table(root, f"frame_00002{eye}")["world_from_camera_opencv"]) for eye in EYES
    }
    front = np.linalg.inv(poses[""])
    np.testing.assert_allclose((front @ poses["_beside"])[:3, 3], [0.12, 0, 0], atol=1e-9)
    back = front @ poses["_back"]
    np.testing.assert_allclose(back[:3, 3], [0, 0, -0.05], atol=1e-9)
    # w = .6 and y = .8: a turn about y whose cosine is .36 - .64 and whose sine is 2 x .6 x .8.
    turn = [[-0.28, 0, 0.96], [0, 1, 0], [-0.96, 0, -0.28]]
    np.testing.assert_allclose(back[:3, :3], turn, atol=1e-9)


@pytest.mark.long
def test_each_camera_has_its_lens(root: Path) -> None:
    left, back = table(root, "frame_00000_left"), table(root, "frame_00000_back")
    assert left["K"][0][0] == pytest.approx(32 / math.tan(math.radians(50)))
    assert back["lens"]["model"] == "radtan"
    assert table(root, "frame_00000")["K"] == table(root, "frame_00000_beside")["K"]


@pytest.mark.long
def test_verify_finds_a_rig_right(certificate: Certificate) -> None:
    assert certificate.is_clean, certificate.text()
    assert certificate.counts["motion: flow_forward"].checked > 500


@pytest.mark.long
@pytest.mark.parametrize(
    "change",
    [
        lambda rig: rig["cameras"][1].update(translation_m=[0.13, 0, 0.05]),
        lambda rig: rig["cameras"][2].update(yaw_deg=-89),
        lambda rig: rig["cameras"][2].update(hfov_deg=90),
        lambda rig: rig["cameras"][3].update(rotation_wxyz=[0.0, 1.0, 0.0, 0.0]),
        lambda rig: rig["cameras"].reverse(),
        lambda rig: rig.update(name="tail"),
    ],
)
def test_verify_finds_a_rig_that_is_not_the_recipes(
    root: Path, tmp_path: Path, change: Any
) -> None:
    shutil.copytree(root, tmp_path / "root", ignore=lambda *_: ["views"])
    file = tmp_path / "root/recipe.json"
    document = json.loads(file.read_text())
    change(document["rig"])
    file.write_text(json.dumps(document))
    assert verify(tmp_path / "root", sample=2).counts["sequence"].failed > 0


@pytest.mark.long
def test_verify_finds_a_camera_that_left_its_rig(root: Path, tmp_path: Path) -> None:
    shutil.copytree(root, tmp_path / "root", ignore=lambda *_: ["views"])
    file = house(tmp_path / "root") / "cameras.json"
    document = json.loads(file.read_text())
    row = next(row for row in document["views"] if row["id"] == "frame_00001_back")
    row["world_from_camera_opengl"][0][3] += 0.001
    file.write_text(json.dumps(document))
    assert verify(tmp_path / "root", sample=2).counts["sequence"].failed == 1


@pytest.mark.long
def test_two_cameras_side_by_side_are_a_stereo_pair(tmp_path: Path) -> None:
    pair = RIG[: RIG.index('[[cameras]]\nname = "left"')]
    recipe = recipe_of(rig_file(tmp_path, pair), **{"cameras.walk_frames": "2"})
    out = tmp_path / "out"
    assert (
        run_local(Run(["builtin"], str(out), recipe, wanted(["opengl_dl"], LAYERS))).failures == []
    )
    certificate = verify(out)
    assert certificate.is_clean, certificate.text()
    assert certificate.counts["motion: disparity"].checked > 500
    assert table(out, "frame_00000")["partners"]["stereo"]["view"] == "frame_00000_beside"
    export(out, tmp_path / "kitti", "kitti")
    assert (tmp_path / "kitti/image_3/000000_10.png").is_file()
    assert "P3" in (tmp_path / "kitti/calib/000000.txt").read_text()


@pytest.mark.long
def test_colmap_has_the_rig_and_its_frames(root: Path, tmp_path: Path) -> None:
    from scipy.spatial.transform import Rotation

    export(root, tmp_path / "x", "colmap")
    sparse = next((tmp_path / "x").glob("*/sparse/0"))
    (rig,) = (line.split() for line in (sparse / "rigs.txt").read_text().splitlines())
    assert rig[:4] == ["1", "4", "CAMERA", "1"]
    images = [line.split() for line in (sparse / "images.txt").read_text().splitlines()[::2]]
    poses = {row[0]: row for row in images}

    def motion(words: list[str]) -> np.ndarray:
        w, x, y, z, *shift = map(float, words)
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = Rotation.from_quat([x, y, z, w]).as_matrix(), shift
        return matrix

    # A camera's pose is the rig's pose times its pose in the rig, for every image of every frame.
    camera_from_rig = {"1": np.eye(4)} | {
        rig[k + 1]: motion(rig[k + 3 : k + 10]) for k in range(4, 31, 10)
    }
    frames = [line.split() for line in (sparse / "frames.txt").read_text().splitlines()]
    assert len(frames) == 3
    frames_seen = set()
    for frame in frames:
        rig_from_world = motion(frame[2:9])
        for k in range(10, len(frame), 3):
            sensor, image = frame[k + 1 : k + 3]
            assert poses[image][8] == sensor
            np.testing.assert_allclose(
                camera_from_rig[sensor] @ rig_from_world, motion(poses[image][1:8]), atol=1e-6
            )
            frames_seen.add(image)
    assert frames_seen == set(poses)


@pytest.mark.long
def test_tum_has_a_trajectory_of_each_camera(root: Path, tmp_path: Path) -> None:
    export(root, tmp_path / "x", "tum")
    names = {p.name for p in (tmp_path / "x").glob("*/groundtruth*.txt")}
    assert names == {f"groundtruth{eye}.txt" for eye in EYES}


def test_a_recipe_with_a_rig_is_written_and_read_as_the_same(tmp_path: Path) -> None:
    recipe = recipe_of(rig_file(tmp_path))
    (tmp_path / "own.toml").write_text(toml_from_recipe(recipe))
    again = recipe_from_toml(tmp_path / "own.toml", {})
    assert again.digest() == recipe.digest()


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("cameras = []", "cameras"),
        ("[[cameras]]\nname = 'a'\nyaw = 3", "cameras[0].yaw"),
        ("[[cameras]]\nname = 'a'\ntranslation_m = [1, 2]", "cameras[0].translation_m"),
        ("[[cameras]]\nname = 'A b'", "cameras[0].name"),
        ("[[cameras]]\nname = 'a'\nrotation_wxyz = [1, 1, 0, 0]", "cameras[0].rotation_wxyz"),
        ("[[cameras]]\nname = 'a'\nrotation_wxyz = [1, 0, 0, 0]\nyaw_deg = 3", "cameras[0]"),
        ("[[cameras]]\nname = 'a'\n[[cameras]]\nname = 'a'", "two cameras are named a"),
        ("[[cameras]]\nname = 'a'\nlens = {model = 'bent'}", "cameras[0].lens.model"),
        ("[[cameras]", "is not valid TOML"),
    ],
)
def test_a_file_that_is_no_rig_is_refused_with_its_place(
    text: str, told: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = rig_file(tmp_path, text)
    with pytest.raises(BadInput) as error:
        rig_from_toml(file)
    assert str(file) in str(error.value)
    assert told in str(error.value)
    out = str(tmp_path / "out")
    assert main(["run", "builtin", "--out", out, "--rig", str(file)]) != 0
    assert len(capsys.readouterr().err.strip().splitlines()) == 1


def test_a_rig_that_is_not_there_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match=r"none\.toml"):
        rig_from_toml(tmp_path / "none.toml")


def test_a_rig_and_a_stereo_pair_are_an_error(tmp_path: Path) -> None:
    with pytest.raises(BadRecipe, match="stereo"):
        recipe_of(rig_file(tmp_path), **{"cameras.stereo_m": "0.1"})
