"""Generated homes in a folder: complete, inspected, kept, never overwritten."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path

import pytest

from pbrs_farm.core.catalogue import EMPTY
from pbrs_farm.core.made_home import MadeHome, made_homes
from pbrs_farm.gallery.made_homes import make_homes
from pbrs_farm.gallery.plan_svg import plan_svg
from pbrs_farm.generate.floor_plan import PlanRoom, PlanWall, RoomType, Storey
from pbrs_farm.generate.generated_home import generate_home

HOMES = made_homes("made:1..2,furniture=none")


def of_seed(seed: int) -> MadeHome:
    return MadeHome(seed, furniture=False)


def test_homes_and_their_plans_lie_in_the_folder(tmp_path: Path) -> None:
    assert [done.is_new for done in make_homes(HOMES, tmp_path)] == [True, True]
    names = {path.name for path in tmp_path.iterdir()}
    assert names == {"made-1.sh3d", "made-1.svg", "made-2.sh3d", "made-2.svg", "plans.html"}
    assert (tmp_path / "plans.html").read_text().count("<figure>") == 2


def test_a_second_call_keeps_existing_homes(tmp_path: Path) -> None:
    list(make_homes(HOMES[:1], tmp_path))
    before = (tmp_path / "made-1.sh3d").stat().st_mtime_ns
    assert [done.is_new for done in make_homes(HOMES, tmp_path)] == [False, True]
    assert (tmp_path / "made-1.sh3d").stat().st_mtime_ns == before


def test_a_file_of_another_home_is_not_written_over(tmp_path: Path) -> None:
    (tmp_path / "made-1.sh3d").write_bytes(b"a person's")
    (done,) = make_homes(HOMES[:1], tmp_path)
    assert "differs from this home" in done.fault
    assert (tmp_path / "made-1.sh3d").read_bytes() == b"a person's"


@pytest.mark.slow
def test_two_processes_write_the_files_of_one(tmp_path: Path) -> None:
    for name in "ab":
        (tmp_path / name).mkdir()
    list(make_homes(HOMES, tmp_path / "a"))
    list(make_homes(HOMES, tmp_path / "b", n_jobs=2))
    for path in (tmp_path / "a").iterdir():
        assert path.read_bytes() == (tmp_path / "b" / path.name).read_bytes()


def test_a_plan_shows_every_room_and_escapes_its_name() -> None:
    plan = generate_home(of_seed(1), EMPTY).storeys[0].plan
    rooms = tuple(PlanRoom(r.type, "<b>&", r.polygon) for r in plan.rooms)
    text = plan_svg([Storey(replace(plan, rooms=rooms), ())], "a<b")
    root = ET.fromstring(text)
    shown = [e.text for e in root.iter("{http://www.w3.org/2000/svg}text")]
    assert shown.count("<b>&") == len(rooms)


def test_a_skewed_wall_has_four_corners_around_its_middle() -> None:
    corners = PlanWall((0.0, 0.0), (3.0, 4.0), 0.2).corners()
    ground = PlanRoom(RoomType.STORE, "", corners)
    assert ground.contains((1.5, 2.0))
    assert not ground.contains((1.5, 2.3))
    assert ground.area == pytest.approx(5.2 * 0.2)
