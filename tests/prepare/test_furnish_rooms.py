"""Empty rooms of a read home get furniture; furnished rooms keep theirs."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from shapely.geometry import Point, Polygon

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.catalogue import EMPTY
from pbrs_farm.core.classes import SOFA
from pbrs_farm.core.house import House, Surface
from pbrs_farm.core.made_home import MadeHome
from pbrs_farm.core.recipe import recipe_from_name
from pbrs_farm.generate.generated_home import generate_home
from pbrs_farm.prepare.furnish_rooms import furnish_rooms
from pbrs_farm.prepare.passes import step_depends, uses_catalogue
from pbrs_farm.prepare.source import resolve
from pbrs_farm.read.sweethome3d.home import read_home
from tests.inputs.box_catalogue import boxes

HOME = MadeHome(2, furniture=False, offices=0)


@cache
def empty_house() -> House:
    """Drawn once: each drawing takes two seconds."""
    return read_home(generate_home(HOME, EMPTY).data, "home.sh3d")


def turned(house: House, angle: float) -> House:
    """The house turned about its origin, with oblique walls and rooms."""
    cos, sin = math.cos(angle), math.sin(angle)

    def at(points: F64) -> F64:
        x, z = points[..., 0], points[..., -1]
        parts = [x * cos - z * sin, *([points[..., 1]] if points.shape[-1] == 3 else [])]
        return np.stack([*parts, x * sin + z * cos], -1)

    def surface(s: Surface) -> Surface:
        return replace(s, positions=at(s.positions.astype(np.float64)).astype(np.float32))

    items = [replace(i, surfaces=tuple(map(surface, i.surfaces)), box=None) for i in house.items]
    openings = tuple(
        replace(o, cutter=surface(o.cutter), quad=at(o.quad), normal=at(o.normal))
        for o in house.openings
    )
    rooms = tuple(replace(r, polygon=at(r.polygon)) for r in house.rooms)
    return replace(house.with_items(items), rooms=rooms, openings=openings)


@pytest.mark.parametrize("angle", [0.0, 0.4])
def test_every_room_gets_its_required_furniture_inside_its_outline(angle: float) -> None:
    house = turned(empty_house(), angle)
    furnished = furnish_rooms(house, boxes(), 1)
    added = furnished.items[len(house.items) :]
    has = {room.name: {i.name for i in added if i.room_id == room.id} for room in house.rooms}
    assert {"sink", "fridge", "cooker"} <= has["Kitchen"]
    assert all("bed" in names for room, names in has.items() if room.startswith("Bedroom"))
    for item in added:
        room = house.room(item.room_id or "")
        assert Polygon(room.polygon).buffer(0.01).contains(Point(*item.bounds.mean(0)[[0, 2]]))
        assert item.bounds[0, 1] >= room.floor_y - 1e-3
        assert item.bounds[1, 1] <= room.ceiling_y + 1e-3


def test_a_furnished_room_is_unchanged() -> None:
    once = furnish_rooms(empty_house(), boxes(), 1)
    again = furnish_rooms(once, boxes(), 2)
    rooms = [r for r in once.rooms if {"bed", "sofa", "sink"} & names_in(once, r.id)]
    assert rooms
    assert all(names_in(again, r.id) == names_in(once, r.id) for r in rooms)


def names_in(house: House, room: str) -> set[str]:
    return {i.name for i in house.items if i.room_id == room}


def renamed(house: House, name: str, new: str) -> House:
    """The house with a room renamed, which changes its use."""
    types = (new,) if new else ()
    rooms = tuple(replace(r, name=new, types=types) if r.name == name else r for r in house.rooms)
    return replace(house, rooms=rooms)


def test_a_room_of_unknown_use_is_left_with_a_note() -> None:
    house = renamed(empty_house(), "Kitchen", "Garage")
    furnished = furnish_rooms(house, boxes(), 1)
    notes = [n for n in furnished.notes[len(house.notes) :] if "Garage" in n.text]
    assert [n.kind for n in notes] == ["not-furnished"]
    assert not any("sink" in i.name for i in furnished.items)


@pytest.mark.parametrize(("bathroom", "has"), [("Cellar", "toilet"), ("Bathroom", "")])
def test_a_dark_room_without_a_name_gets_the_use_that_the_home_lacks(
    bathroom: str, has: str
) -> None:
    house = renamed(renamed(empty_house(), "Hall", ""), "Bathroom", bathroom)
    dark = next(r for r in house.rooms if not r.name)
    furnished = furnish_rooms(house, boxes(), 1)
    assert not [n for n in furnished.notes[len(house.notes) :] if dark.id in n.place]
    assert ("toilet" in names_in(furnished, dark.id)) == bool(has)


@pytest.mark.quick(1)
@pytest.mark.parametrize(("use", "has"), [("Office", "desk"), ("Dining room", "dining_table")])
def test_an_office_gets_a_desk_and_a_dining_room_a_table(use: str, has: str) -> None:
    house = renamed(empty_house(), "Bedroom 1", use)
    room = next(r for r in house.rooms if r.name == use)
    names = names_in(furnish_rooms(house, boxes(), 1), room.id)
    assert has in names
    assert "bed" not in names


@pytest.mark.quick(1)
@pytest.mark.parametrize("name", ["", "Room 3"])
def test_a_room_with_a_neutral_name_gets_a_use_that_the_home_lacks(name: str) -> None:
    house = empty_house()
    living = next(r for r in house.rooms if r.name == "Living room")
    names = names_in(furnish_rooms(renamed(house, living.name, name), boxes(), 1), living.id)
    assert "sofa" in names
    bedroom = next(r for r in house.rooms if r.name == "Bedroom 1")
    names = names_in(furnish_rooms(renamed(house, bedroom.name, name), boxes(), 1), bedroom.id)
    assert "bed" in names


@pytest.mark.long
def test_a_sparse_room_keeps_its_furniture_and_gets_the_missing_pieces() -> None:
    house = empty_house()
    room = next(r for r in house.rooms if r.name == "Living room")
    full = furnish_rooms(house, boxes(), 1)
    room_items = [i for i in full.items if i.room_id == room.id]
    sofas = [replace(i, nyu40=SOFA) for i in room_items if i.name == "sofa"]
    # A lone sofa covers more than the limit of empty rooms, and less than that of furnished ones.
    start = house.with_items([*house.items, *sofas])
    empty = furnish_rooms(start, boxes(), 2)
    assert names_in(empty, room.id) == names_in(start, room.id)
    sparse = furnish_rooms(start, boxes(), 2, which="sparse")
    now = [i for i in sparse.items if i.room_id == room.id and i.name == "sofa"]
    assert [i.bounds.tolist() for i in now] == [i.bounds.tolist() for i in sofas]
    assert names_in(sparse, room.id) > names_in(start, room.id)


@pytest.mark.long
def test_the_same_seed_repeats_the_furniture_and_another_changes_it() -> None:
    bounds = [
        np.concatenate([i.bounds for i in furnish_rooms(empty_house(), boxes(), s).items])
        for s in (1, 1, 2)
    ]
    assert np.array_equal(bounds[0], bounds[1])
    assert bounds[0].shape != bounds[2].shape or not np.array_equal(bounds[0], bounds[2])


def test_furnishing_is_part_of_the_house_steps_digest() -> None:
    source = resolve(HOME.word)
    plain = recipe_from_name("fast", {"dress.catalogue": '"generated"'})
    with_furnish = recipe_from_name(
        "fast", {"dress.catalogue": '"generated"', "dress.furnish": "empty"}
    )
    assert [row[0] for row in step_depends(source, plain)[1:]] == ["read", "repair", "surroundings"]
    assert "furnish" in [row[0] for row in step_depends(source, with_furnish)[1:]]
    assert (uses_catalogue(source, plain), uses_catalogue(source, with_furnish)) == (False, True)
    assert plain.digest("dress") == recipe_from_name(
        "preview", {"dress.catalogue": '"generated"'}
    ).digest("dress")
