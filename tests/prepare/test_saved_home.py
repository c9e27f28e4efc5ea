"""Homes with edits as files: accepted wherever a home is named, and reported if changed since."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import pbrs_farm as pf
from pbrs_farm.cli import main
from pbrs_farm.core.errors import BadHouse
from pbrs_farm.prepare.source import resolve, variants, words_of_homes
from tests.scene.homes import crate, small_home


def write_falling_home(folder: Path, home: pf.Home) -> Path:
    """Save the home with a crate that falls while a door opens."""
    home = home.place(crate(folder), at=(2.6, 1.2, 2.0))
    moving = home.drop("crate 1").open("door_inner", at={0: 0, 2: 1})
    return moving.save(folder / "falling.home.json")


@pytest.fixture(scope="module")
def saved(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The small home with a crate that falls while a door opens."""
    return write_falling_home(tmp_path_factory.mktemp("saved"), small_home())


@pytest.mark.parametrize("dress_seed", [0, pytest.param(2, marks=pytest.mark.long)])
def test_a_saved_home_is_the_same_home(dress_seed: int, tmp_path: Path) -> None:
    home = small_home() if dress_seed == 0 else small_home().dress(seed=dress_seed)
    saved = write_falling_home(tmp_path, home)
    source = resolve(str(saved))
    assert source.dress_seed == dress_seed
    assert [edit.do for edit in source.edits] == ["place", "record", "key_joints"]
    home = pf.load(saved, recipe="preview")
    assert home.motions.column("part") == ["", "leaf 1"]
    again = home.save(saved.with_name("again.home.json"))
    assert again.read_bytes() == saved.read_bytes()


def test_a_home_without_edits_is_saved_too(tmp_path: Path) -> None:
    home = small_home()
    assert pf.load(home.save(tmp_path / "a.home.json")).id == home.id


def test_a_folder_of_saved_homes_is_all_of_them(tmp_path: Path) -> None:
    for name in ("b", "a"):
        small_home().save(tmp_path / f"{name}.home.json")
    words = words_of_homes([str(tmp_path)])
    assert [Path(word).name for word in words] == ["a.home.json", "b.home.json"]


@pytest.mark.long
def test_a_walk_from_the_command_line_shows_moving_items(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = small_home().open("door_*", at={0: 0, 1: 1}).save(tmp_path / "doors.home.json")
    out = tmp_path / "out"
    words = ["run", str(file), "--recipe", "preview", "--size", "64x48", "--cameras", "walk"]
    words += ["--frames", "3", "--fps", "2", "--modes", "opengl_dl", "--layers", "scene_flow"]
    assert main([*words, "--tracks", "--out", str(out)]) == 0
    (house,) = out.glob("houses/*")
    tables = [json.loads(p.read_text()) for p in sorted(house.glob("views/*/view.json"))]
    shares = [t["motion"]["joints"][0]["value"] / (np.pi / 2) for t in tables]
    assert shares == pytest.approx([0, 0.5, 1.0])
    assert (house / "tracks.npz").is_file()
    capsys.readouterr()


def test_faults_of_the_file_are_one_line(saved: Path, tmp_path: Path) -> None:
    document = json.loads(saved.read_text())
    for change, text in (
        ({"house_id": "builtin-0"}, "has changed since"),
        ({"format": "pbrs_farm home 9"}, "format"),
        ({"edits": [{"do": "fly"}]}, r"edits"),
        ({"home": str(saved)}, "refers to another file"),
    ):
        file = tmp_path / "bad.home.json"
        file.write_text(json.dumps(document | change))
        with pytest.raises(BadHouse, match=text) as caught:
            resolve(str(file))
        assert "\n" not in str(caught.value)
    with pytest.raises(BadHouse, match="no such file"):
        resolve(str(tmp_path / "none.home.json"))
    with pytest.raises(BadHouse, match="dress a home before editing it"):
        variants(resolve(str(saved)), [3])
