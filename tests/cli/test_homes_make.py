"""`homes make` on the command line: files, a page of plans, one line for an impossible home."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from pbrs_farm.cli import main


def refused(capsys: pytest.CaptureFixture[str], *words: object) -> str:
    """The single line of a command that fails."""
    capsys.readouterr()
    assert main(["homes", "make", *map(str, words)]) != 0
    lines = [x for x in capsys.readouterr().err.splitlines() if x]
    assert not [x for x in lines if "Traceback" in x]
    return lines[0]


def test_homes_and_their_plans_are_made_and_a_second_call_keeps_them(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["homes", "make", "2", "--empty", "--rooms", "0..1", "--out", str(tmp_path)]
    assert main(words) == 0
    names = {p.name for p in tmp_path.iterdir()}
    assert names == {"made-1.sh3d", "made-1.svg", "made-2.sh3d", "made-2.svg", "plans.html"}
    # On a slow machine a line of progress comes first.
    assert capsys.readouterr().out.splitlines()[-1].startswith("2 homes made in ")
    assert main(words) == 0
    assert "0 homes made" in (output := capsys.readouterr().out)
    assert "2 kept" in output


def test_a_programme_file_names_the_rooms(tmp_path: Path) -> None:
    flat = tmp_path / "flat.json"
    rooms = [{"type": "bedroom", "name": "Ada"}, "living", "kitchen", "bathroom"]
    flat.write_text(json.dumps({"rooms": rooms, "adjacent": [["Ada", "kitchen"]]}))
    words = ["make", "--empty", "--programme", str(flat), "--out", str(tmp_path / "flats")]
    assert main(["homes", *words]) == 0
    assert "Ada" in (tmp_path / "flats/made-1.svg").read_text()


def test_a_users_plan_becomes_a_home_of_its_name(tmp_path: Path) -> None:
    plan = tmp_path / "salon.json"
    square = [[0, 0], [5, 0], [5, 4], [0, 4]]
    plan.write_text(json.dumps({"rooms": [{"type": "living", "polygon": square}]}))
    out = tmp_path / "own"
    assert main(["homes", "make", "--empty", "--plan", str(plan), "--out", str(out)]) == 0
    assert {p.name for p in out.iterdir()} == {"salon.sh3d", "salon.svg"}


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--rooms", "4..2"], "runs downwards: try 2..4"),
        (["--rooms", "4", "--area", "20..25"], "homes of 4 bedrooms have 76 to 180 m2"),
        (["--style", "baroque"], "no such style: try one of classic"),
        (["0"], "expected 1 home or more"),
        (["--programme", "none.json"], "none.json"),
        (["--apartment", "7"], "needs --plan FILE.csv"),
        (["--programme", "none.json", "--storeys", "2"], "describes one storey only"),
        (["--seed", "-1"], "is below 0: try --seed 1"),
        (["--storeys", "5"], "one storey or two: try storeys=2"),
        (["--plan", "none.json", "--rooms", "2"], "fixes the rooms: omit --rooms"),
    ],
)
def test_an_impossible_home_is_one_line_with_the_alternatives(
    words: list[str], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    line = refused(capsys, *words, "--empty", "--out", tmp_path / "homes")
    for part in said.split(": try "):
        assert part in line
    assert not (tmp_path / "homes").exists()


def test_ten_rooms_in_twenty_square_metres_are_refused_with_their_least_area(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    flat = tmp_path / "flat.json"
    rooms = ["living", "kitchen", "bathroom", *["bedroom"] * 7]
    flat.write_text(json.dumps({"rooms": rooms, "area": 20}))
    line = refused(capsys, "--empty", "--programme", flat, "--out", tmp_path / "homes")
    assert "11 rooms in 20 m2 cannot be met" in line
    assert "rooms of these types take 101 to" in line


def test_without_the_furniture_package_one_line_explains_how_to_get_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PBRS_CACHE", str(tmp_path / "cache"))
    line = refused(capsys, "--out", tmp_path / "homes")
    assert "`pbrs-farm homes --furniture` (120 MB), or --empty" in line
    capsys.readouterr()
    assert main(["run", "made:1", "--out", str(tmp_path / "out")]) != 0
    assert "made:1,furniture=none" in capsys.readouterr().err
