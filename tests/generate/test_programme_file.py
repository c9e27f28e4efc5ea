"""A user's programme: valid fields, and one clear line for each error."""

from __future__ import annotations

import json
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from shapely.geometry import Polygon

from pbrs_farm.core.errors import BadInput
from pbrs_farm.generate.drawn_plan import drawn_plan
from pbrs_farm.generate.floor_plan import RoomType
from pbrs_farm.generate.openings import plan_faults
from pbrs_farm.generate.programme_file import programme_from_json

FLAT = [{"type": "bedroom", "name": "Ada"}, {"type": "living", "area": 24}, "kitchen", "bathroom"]


def written(folder: Path, value: object) -> Path:
    path = folder / "flat.json"
    path.write_text(value if isinstance(value, str) else json.dumps(value))
    return path


def test_a_programme_is_drawn_with_its_rooms_and_a_hall(tmp_path: Path) -> None:
    programme = programme_from_json(written(tmp_path, {"rooms": FLAT, "open_kitchen": True}))
    assert programme.open_kitchen
    plan = drawn_plan(np.random.default_rng(1), None, programme)
    assert plan.rooms[0].type is RoomType.LIVING
    assert {r.name for r in plan.rooms} >= {"Ada", "Hall", "Kitchen", "Bathroom"}


def test_the_rooms_take_the_area_of_the_whole_home(tmp_path: Path) -> None:
    programme = programme_from_json(written(tmp_path, {"rooms": FLAT, "area": 70}))
    assert programme.area == pytest.approx(70, rel=0.01)


@pytest.mark.parametrize(
    ("value", "message"),
    [
        ("{", "flat.json: line 1 column 2: not valid JSON"),
        ([], "flat.json: expected an object, got a list.*rooms"),
        (
            {"rooms": [*FLAT, "cellar"]},
            "room 5, type: expected 'living'.*or 'hall', got \"cellar\"",
        ),
        ({"rooms": [*FLAT, *["bedroom"] * 6], "area": 20}, "11 rooms in 20 m2.*take 1[0-9]{2} to"),
        ({"rooms": [{"type": "bedroom", "area": 2}]}, "has 2 m2; 9 to 17 works.*nearest is 9 m2"),
        ({"rooms": ["bedroom"]}, "0 rooms to live in"),
        ({"rooms": FLAT[:3]}, "no bathroom"),
        ({"rooms": FLAT, "garden": 1}, "garden: no such field.*open_kitchen"),
        ({"rooms": FLAT, "balcony": 1}, "balcony: expected true or false, got 1"),
        ({"rooms": FLAT, "notch": "x"}, "notch: expected a number"),
        ({"rooms": ["bedroom"] * 40}, "at most 14"),
        ({"rooms": [*FLAT, {"name": "x"}]}, "room 5, type: is missing"),
        ({"rooms": FLAT, "area": True}, "area: expected a number, got true"),
        ({"rooms": FLAT, "n_blind_sides": 3}, "n_blind_sides: expected 2 or less"),
    ],
)
def test_an_unsatisfiable_programme_is_refused(tmp_path: Path, value: object, message: str) -> None:
    with pytest.raises(BadInput, match=message) as caught:
        programme_from_json(written(tmp_path, value))
    assert "\n" not in str(caught.value)


def test_a_missing_file_is_refused_in_one_line(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match=r"none\.json"):
        programme_from_json(tmp_path / "none.json")


def test_rooms_that_are_wished_adjacent_share_a_wall(tmp_path: Path) -> None:
    value = {"rooms": FLAT, "adjacent": [["Ada", "kitchen"]]}
    programme = programme_from_json(written(tmp_path, value))
    for seed in (1, 2):
        plan = drawn_plan(np.random.default_rng(seed), None, programme)
        ada, kitchen = (
            next(Polygon(r.polygon) for r in plan.rooms if r.name == name)
            for name in ("Ada", "Kitchen")
        )
        shared = ada.buffer(0.1).intersection(kitchen.buffer(0.1))
        assert max(np.ptp(shared.bounds[::2]), np.ptp(shared.bounds[1::2])) > 0.7


def test_a_programme_has_an_office_of_the_size_of_its_wish(tmp_path: Path) -> None:
    programme = programme_from_json(written(tmp_path, {"rooms": [*FLAT, "office"]}))
    plan = drawn_plan(np.random.default_rng(3), None, programme)
    (office,) = [room for room in plan.rooms if room.type is RoomType.OFFICE]
    assert office.name == "Office"
    assert office.area == pytest.approx(9, rel=0.25)
    assert not plan_faults(plan)


@pytest.mark.long
def test_a_programme_without_a_plan_names_the_fields_to_drop(tmp_path: Path) -> None:
    # Five rooms on a page cannot all be adjacent: these four and the hall.
    four = ("living", "Ada", "Ben", "store")
    rooms = [*FLAT, {"type": "bedroom", "name": "Ben"}, "store"]
    value = {"rooms": rooms, "adjacent": [list(pair) for pair in combinations(four, 2)]}
    programme = programme_from_json(written(tmp_path, value))
    with pytest.raises(BadInput, match=r"no plan with these rooms adjacent.*leave it out"):
        drawn_plan(np.random.default_rng(1), None, programme)


@pytest.mark.parametrize(
    ("rooms", "is_only"), [(FLAT, True), ([*FLAT, {"type": "bathroom", "name": "Bath"}], False)]
)
def test_a_bathroom_beside_a_bedroom_is_entered_from_it(
    tmp_path: Path, rooms: list[object], is_only: bool
) -> None:
    value = {"rooms": rooms, "adjacent": [["Ada", "bathroom" if is_only else "Bath"]]}
    programme = programme_from_json(written(tmp_path, value))
    for seed in (1, 2):
        plan = drawn_plan(np.random.default_rng(seed), None, programme)
        names = [room.name for room in plan.rooms]
        bath = "Bathroom" if is_only else "Bath"
        doors = [{names[o.room], names[o.other]} for o in plan.openings if o.other is not None]
        assert {"Ada", bath} in doors
        # The other bathroom is shared; this one is only Ada's.
        assert is_only or {"Hall", bath} not in doors
        assert is_only or any("Hall" in pair and "Bathroom 1" in pair for pair in doors)


@pytest.mark.parametrize(
    ("pairs", "message"),
    [
        ("Ada", "adjacent: expected a list"),
        ([["Ada"]], "adjacent 1: expected 2 rooms"),
        ([["Ada", "cellar"]], "no room is called 'cellar'.*one of living, Ada, kitchen"),
        ([["Ada", "bedroom"]], "'Ada' is one room"),
        ([["Ada", "Ada"]], "'Ada' is one room"),
    ],
)
def test_adjacency_of_missing_rooms_is_refused(tmp_path: Path, pairs: object, message: str) -> None:
    with pytest.raises(BadInput, match=message):
        programme_from_json(written(tmp_path, {"rooms": FLAT, "adjacent": pairs}))
