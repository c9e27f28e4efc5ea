"""A floor plan file becomes a closed house with its doors and furniture in place."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pbrs_farm.core.errors import BadHouse, BadInput
from pbrs_farm.core.house import Enclosure, geometry_from_house
from pbrs_farm.core.recipe import ReadFields, Recipe
from pbrs_farm.generate.plans.plan_files import plan_from_file
from pbrs_farm.prepare.plan_house import furnish_plan_file
from pbrs_farm.prepare.read_source import read_house
from pbrs_farm.prepare.source import resolve
from pbrs_farm.prepare.source_ref import SourceRef, home_id
from pbrs_farm.prepare.stand_ins import STAND_IN, with_stand_ins
from pbrs_farm.raycast.caster import Caster
from pbrs_farm.repair import repair
from pbrs_farm.store import MemoryStore
from tests.inputs.box_catalogue import boxes
from tests.inputs.plan_files import HOLES, ROOMS, TELLING, WRITERS, write_swiss, write_zind
from workers.house_files import entries_from_arguments, upload

# The other formats give the same walls (tests/generate/test_plan_files.py).
formats = pytest.mark.parametrize("name", ["swiss", "procthor", "roomplan", "cubicasa"])


@pytest.mark.quick(1)
@formats
def test_the_house_of_a_plan_is_closed_in_every_format(tmp_path: Path, name: str) -> None:
    house = read_house(resolve(str(WRITERS[name](tmp_path))), ReadFields())
    assert (len(house.rooms), len(house.openings)) == (len(ROOMS), len(HOLES))
    repaired, report = repair(
        with_stand_ins(house, boxes(), "boxes"), Recipe().repair,
        occluder_from=lambda some: Caster(geometry_from_house(some)),
    )  # fmt: skip
    assert report.leaks is not None
    assert report.leaks.n_sky == 0
    assert all(room.enclosure is Enclosure.CLOSED for room in repaired.rooms)


@pytest.mark.parametrize("name", TELLING)
def test_furniture_of_a_plan_is_in_its_room(tmp_path: Path, name: str) -> None:
    house = read_house(resolve(str(WRITERS[name](tmp_path))), ReadFields())
    stood = with_stand_ins(house, boxes(), "pieces")
    things = [i for i in stood.items if STAND_IN in i.tags]
    assert len(things) >= 3
    for item in things:
        room = stood.room(item.room_id or "")
        low, high = room.polygon.min(0) - 0.11, room.polygon.max(0) + 0.11
        assert (item.bounds[0, [0, 2]] >= low).all(), item
        assert (item.bounds[1, [0, 2]] <= high).all(), item
        assert item.bounds[0, 1] >= room.floor_y - 1e-3


def test_storeys_lie_upon_each_other(tmp_path: Path) -> None:
    house = read_house(resolve(str(write_zind(tmp_path, n_floors=3))), ReadFields())
    assert len(house.levels) == 3
    rises = np.diff(sorted(level.elevation for level in house.levels))
    np.testing.assert_allclose(rises, 2.6 + 0.26)


def test_a_part_of_a_file_is_a_separate_house(tmp_path: Path) -> None:
    path = write_zind(tmp_path, n_floors=2)
    whole, upper = resolve(str(path)), resolve(f"{path}#floor=1")
    assert upper.house_id != whole.house_id
    assert (upper.word, upper.sha256) == (f"{path}#floor=1", whole.sha256)
    assert len(read_house(upper, ReadFields()).levels) == 1
    apartment = resolve(f"{write_swiss(tmp_path)}#apartment=a1")
    assert read_house(apartment, ReadFields()).id == apartment.house_id
    with pytest.raises(BadHouse, match="only for floor plans"):
        resolve("builtin#floor=1")
    with pytest.raises(BadInput, match="no apartment"):
        read_house(resolve(f"{path.parent / 'geometries.csv'}#apartment=zz"), ReadFields())


def test_a_file_with_a_hash_in_its_name_is_found(tmp_path: Path) -> None:
    path = tmp_path / "plan#floor=1.json"
    path.write_bytes(WRITERS["own"](tmp_path).read_bytes())
    assert resolve(str(path)).part == ""


def test_a_plan_changed_since_it_was_named_is_reported(tmp_path: Path) -> None:
    path = WRITERS["procthor"](tmp_path)
    source = resolve(str(path))
    (tmp_path / "asset-database.json").write_text("{}")
    with pytest.raises(BadHouse, match="changed since"):
        read_house(source, ReadFields())


def test_strictly_a_lost_opening_is_an_error(tmp_path: Path) -> None:
    path = WRITERS["spatiallm"](tmp_path)
    path.write_text(path.read_text() + "door_9=Door(wall_0,2.5,-2.0,5.9,0.9,2.05)\n")
    notes = read_house(resolve(str(path)), ReadFields()).notes
    assert "plan-left-out" in {n.kind for n in notes}
    with pytest.raises(BadHouse, match="plan-left-out"):
        read_house(resolve(str(path)), ReadFields(strict=True))


@pytest.mark.parametrize("name", ["own", "swiss", "spatiallm", "roomplan", "cubicasa"])
def test_a_plan_travels_to_a_farm(tmp_path: Path, name: str) -> None:
    path = WRITERS[name](tmp_path)
    word = f"{path}#floor=0"
    ((entry, ref),) = entries_from_arguments([word])
    store = MemoryStore()
    upload(store, [ref])
    placed = SourceRef.model_validate_json(entry.source)
    assert store.get(placed.location) == path.read_bytes()
    assert placed.part == "floor=0"
    assert home_id(placed) == home_id(ref)


def test_a_house_beside_its_table_of_sizes_is_not_copied(tmp_path: Path) -> None:
    path = WRITERS["procthor"](tmp_path)
    ((entry, _ref),) = entries_from_arguments([str(path)])
    assert SourceRef.model_validate_json(entry.source).location == str(path)


def test_a_plan_saved_as_a_home_has_its_listed_items_and_generated_furniture(
    tmp_path: Path,
) -> None:
    file = plan_from_file(WRITERS["cubicasa"](tmp_path))
    (storey,) = furnish_plan_file(file, boxes(), seed=1).storeys
    by_room = {r.type.value: {p.piece.group for p in storey.pieces if p.room == k}
               for k, r in enumerate(storey.plan.rooms)}  # fmt: skip
    assert {"toilet", "bathtub"} == by_room["bathroom"]
    assert "bed" in by_room["bedroom"]
