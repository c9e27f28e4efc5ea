"""Surroundings outside the windows: outside the home, visible, without a class, by a seed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.frames import LUMINANCE
from pbrs_farm.core.house import House, Item, ItemKind, corners_of_surfaces
from pbrs_farm.core.recipe import Recipe, RepairFields, recipe_from_name
from pbrs_farm.furnishings.surroundings import surroundings, with_surroundings
from pbrs_farm.furnishings.surroundings.plants import SPECIES, leaves_of
from pbrs_farm.furnishings.surroundings.scenery import grass
from pbrs_farm.repair import repair
from tests.inputs.windowed_room import RECT, with_window

NEAR = {"ground", "railings"}


@pytest.fixture(scope="module")
def home() -> House:
    return repair(with_window(0.1), RepairFields())[0]


def outside(house: House) -> list[Item]:
    return [i for i in house.items if i.is_outside]


def distances_m(item: Item) -> F64:
    """Distances of the triangles' plan from the room with its walls, 0.2 m thick."""
    walls = shapely.box(*RECT).buffer(0.2, join_style="mitre")
    corners = corners_of_surfaces(item.surfaces)[:, :, [0, 2]]
    return np.asarray(shapely.distance(walls, shapely.multipoints(corners)))


@pytest.mark.quick(2)
@pytest.mark.parametrize("kind", surroundings.KINDS)
def test_surroundings_are_off_the_walls_and_are_no_objects(home: House, kind: str) -> None:
    after = with_surroundings(home, kind, 1)
    items_outside = outside(after)
    # They are last, so that no other instance id changes.
    assert after.items[: len(home.items)] == home.items
    assert items_outside == list(after.items[len(home.items) :])
    assert 1_000 < sum(i.n_faces for i in items_outside) < surroundings.MAX_FACES
    assert {(i.kind, i.nyu40, i.lights) for i in items_outside} == {(ItemKind.GROUND, 0, ())}
    for item in items_outside:
        if item.id.removeprefix("outside_") not in NEAR:
            assert distances_m(item).min() > surroundings.LEAST_M, item.id
    # The ground ends at the walls, below the sill, and is under no room.
    (ground,) = [i for i in items_outside if i.id == "outside_ground"]
    assert ground.bounds[1, 1] < 0.9
    middles = shapely.points(corners_of_surfaces(ground.surfaces).mean(1)[:, [0, 2]])
    assert not shapely.contains(shapely.box(*RECT), middles).any()


def test_the_same_seed_gives_the_same_bits_and_another_seed_another_place(home: House) -> None:
    def bits(seed: int) -> bytes:
        items_outside = outside(with_surroundings(home, "drawn", seed))
        return b"".join(s.positions.tobytes() for i in items_outside for s in i.surfaces)

    assert bits(1) == bits(1)
    assert bits(1) != bits(2)


@pytest.mark.slow
def test_upper_storeys_look_down_and_houses_see_the_ground(home: House) -> None:
    def depths(house: House) -> set[float]:
        grounds = [
            next(
                i for i in with_surroundings(house, "drawn", seed).items if i.id == "outside_ground"
            )
            for seed in range(6)
        ]
        return {round(float(-i.bounds[0, 1]), 1) for i in grounds}

    below = depths(home)
    assert len(below) > 2
    assert max(below) > 8  # a flat is on the ground or up to four storeys above it
    garage = replace(home.rooms[0], id="0_9", name="Garage")
    assert len(depths(replace(home, rooms=(*home.rooms, garage)))) == 1


def test_lawns_and_leaves_have_measured_albedo_in_many_greens() -> None:
    for seed in range(6):
        lawn = grass(np.random.default_rng(seed))
        red, green, blue = lawn.reshape(-1, 3).mean(0)
        assert 0.05 < LUMINANCE @ (red, green, blue) < 0.25
        # A lawn of a saturated green would tint ceilings.
        assert green / red < 1.3
        assert green / blue < 2.4
        # Square metres differ in value and in hue.
        patches = lawn[:378, :378].reshape(9, 42, 9, 42, 3).mean((1, 3)).reshape(-1, 3)
        assert np.std(patches @ LUMINANCE) / np.mean(patches @ LUMINANCE) > 0.03
        assert np.std(patches[:, 1] / patches[:, 0]) > 0.02
    for number, species in enumerate(SPECIES):
        leaves = leaves_of(np.random.default_rng(number), number)
        colour = leaves.spray[leaves.spray[..., 3] > 0, :3].mean(0)
        assert 0.015 < LUMINANCE @ colour < 0.17, species.name
        assert colour.max() / colour.min() < 3.2, species.name
        assert len({leaves.of_plant(np.random.default_rng(k)).outer.rgb for k in range(30)}) > 3


def test_a_home_without_windows_stays_as_it_is(home: House) -> None:
    blind = replace(home, openings=())
    assert with_surroundings(blind, "drawn", 1) is blind


def test_surroundings_are_in_the_digest_of_a_recipe() -> None:
    groups = ("read", "repair")
    assert recipe_from_name("paper").surroundings.kind == "none"
    assert recipe_from_name("released").surroundings.kind == "none"
    fast: Recipe = recipe_from_name("fast")
    assert fast.surroundings.kind == "drawn"
    assert fast.digest(*groups, "surroundings") != fast.digest(*groups)
