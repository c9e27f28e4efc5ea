"""`pbrs-farm scatter`: the user's models in a home, rendered; a second call renders nothing."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import pbrs_farm as pf
from pbrs_farm.check import verify
from pbrs_farm.cli import main
from tests.scene.homes import SMALL, can, crate, small_home

FIELDS = [word for name, value in SMALL.items() for word in ("--set", f"{name}={value}")]


@pytest.mark.long
def test_scattered_models_are_seen_and_kept(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "models").mkdir()
    can(tmp_path / "models")
    words = [
        "scatter", "builtin", "--models", str(tmp_path / "models"), "--unit", "mm", "--count", "4",
        "--views", "2", "--on", "dining table", "--out", str(tmp_path / "out"), "--recipe", "preview",
        "--modes", "opengl_dl", *FIELDS,
    ]  # fmt: skip
    assert main(words) == 0
    assert "2 views, 0 already there" in capsys.readouterr().out
    assert main(words) == 0
    assert "2 views, 2 already there" in capsys.readouterr().out
    frames = pf.open(tmp_path / "out")
    assert len(frames) == 2
    for frame in frames:
        rows = [row for row in frame.instances if row.get("model") == "can"]
        assert max(row["visible_fraction"] for row in rows) >= 0.5
    assert verify(tmp_path / "out").is_clean


def test_floating_models_are_labelled_as_such(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "models").mkdir()
    can(tmp_path / "models")
    words = [
        "scatter", "builtin", "--models", str(tmp_path / "models"), "--unit", "mm", "--count", "30",
        "--views", "1", "--float", "--out", str(tmp_path / "out"), "--recipe", "preview",
        "--modes", "opengl_dl", *FIELDS,
    ]  # fmt: skip
    assert main(words) == 0
    (frame,) = pf.open(tmp_path / "out")
    for row in frame.instances:
        assert row.get("floating", False) == (row.get("model") == "can")
    assert any("floating" in row for row in frame.instances)
    assert verify(tmp_path / "out").is_clean
    assert main([*words, "--physics"]) == 1
    assert "floating objects do not fall" in capsys.readouterr().err


def test_a_models_missing_parts_are_a_line_and_a_note_of_the_home(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "mug.mtl").write_text("newmtl a\nmap_Kd none.png\n")
    (tmp_path / "mug.obj").write_text(
        "mtllib mug.mtl\nusemtl a\nv 0 0 0\nv .1 0 0\nv 0 .1 0\nv 0 0 .1\nvt 0 0\n"
        "f 1/1 2/1 3/1\nf 1/1 3/1 4/1\nf 1/1 4/1 2/1\nf 2/1 4/1 3/1\n"
    )
    words = [
        "scatter", "builtin", "--models", str(tmp_path / "mug.obj"), "--count", "2", "--views", "1",
        "--on", "dining table", "--out", str(tmp_path / "out"), "--recipe", "preview", "--modes",
        "opengl_dl", *FIELDS,
    ]  # fmt: skip
    assert main(words) == 0
    printed = capsys.readouterr()
    assert "mug.obj: none.png does not exist" in printed.err
    assert "1 note (1 missing-texture)" in printed.out
    (file,) = (tmp_path / "out").glob("houses/*/house.json")
    assert [note["kind"] for note in json.loads(file.read_bytes())["notes"]] == ["missing-texture"]


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (["--count", "0"], "--count: 0: expected 1 or more"),
        (["--distance", "near"], "--distance: near: expected metres"),
        (["--on", "dinning table"], "did you mean dining table"),
        (["--unit", "feet"], "unit: feet: no such unit"),
        (["--models", "nothing/*.ply"], "no model found"),
    ],
)
def test_models_that_cannot_be_scattered_are_reported(
    options: list[str], says: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    can(tmp_path)
    words = ["scatter", "builtin", "--out", str(tmp_path / "out"), "--unit", "mm", *FIELDS]
    if "--models" not in options:
        words += ["--models", str(tmp_path / "can.ply")]
    assert main([*words, *options]) == 1
    assert says in capsys.readouterr().err


def test_cameras_are_in_rooms_at_the_requested_distance(tmp_path: Path) -> None:
    home = small_home().scatter([crate(tmp_path)], 3, on="desk")
    cameras = home.cameras_around(n=4, distance_m=(0.6, 0.9), size=(64, 48), seed=1)
    middles = np.array([i.bounds.mean(0) for i in home.house.items if i.pose])
    for camera in cameras:
        # The distance to one of the three; the others may be nearer.
        away = np.linalg.norm(middles - camera.camera.eye, axis=1)
        assert ((away >= 0.6 - 1e-6) & (away <= 0.9 + 1e-6)).any()
        assert camera.room == "0_1"
    again = home.cameras_around(n=4, distance_m=(0.6, 0.9), size=(64, 48), seed=1)
    assert [camera.id for camera in cameras] == [camera.id for camera in again]
