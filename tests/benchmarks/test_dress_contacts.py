"""The bench's own check of dressed homes finds what is wrong: it must be able to fail."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.dress.contacts import blocked_doors, floating, half_wall, penetrations, things_of
from pbrs_farm.core.house import House, Item, ItemKind
from tests.builders import builtin_home
from tests.dress.furniture import bookcase, house, solid

TABLE = solid("table", [1.0, 0.0, 1.0], [2.2, 0.75, 1.8])


def with_new(home: House, *items: Item) -> House:
    return home.with_items((*home.items, *items))


@pytest.mark.parametrize(("y", "n"), [(0.75, 0), (0.7515, 0), (0.755, 1), (0.74, 1)])
def test_what_floats_or_sinks_is_found(y: float, n: int) -> None:
    home = house(TABLE)
    cup = solid("dress-clutter-1", [1.2, y, 1.2], [1.3, y + 0.1, 1.3])
    assert len(floating(things_of(with_new(home, cup), home))) == n


@pytest.mark.parametrize(("lift_m", "n"), [(0.0, 0), (0.01, 1)])
def test_a_hem_hangs_beside_the_table_that_holds_its_cloth(lift_m: float, n: int) -> None:
    home, y = house(TABLE), 0.75 + lift_m
    top = solid("", [1.5, y, 1.2], [2.25, y + 0.01, 1.6])
    hem = solid("", [2.24, y - 0.3, 1.2], [2.25, y, 1.6])
    cloth = replace(top, id="dress-clutter-1", source_class="generated#throw")
    cloth = replace(cloth, surfaces=(*top.surfaces, *hem.surfaces))
    assert len(floating(things_of(with_new(home, cloth), home))) == n


@pytest.mark.parametrize(
    ("low", "high", "n"),
    [
        ([1.4, 0.12, 0.05], [1.43, 0.4, 0.25], 0),  # on a shelf
        ([1.4, 0.2, 0.05], [1.43, 0.7, 0.25], 1),  # through one
        ([0.9, 0.12, 0.05], [1.1, 0.4, 0.25], 1),  # through the side
    ],
)
def test_a_book_through_a_board_is_found(low: list[float], high: list[float], n: int) -> None:
    home = house(bookcase())
    book = solid("dress-clutter-1", low, high)
    assert len(penetrations(things_of(with_new(home, book), home))) == n


@pytest.mark.parametrize(("sunk_m", "n"), [(0.005, 0), (0.03, 1)])
def test_how_deep_a_cushion_sinks_counts_and_not_how_long_the_seats_edges_are(
    sunk_m: float, n: int
) -> None:
    # The back leans away: its box meets the cushion, it does not.
    chair, (back,) = (
        solid("chair", [1.0, 0.3, 1.0], [1.8, 0.4, 1.9]),
        solid("", [1.0, 0.2, 1.5], [1.8, 0.9, 1.55]).surfaces,
    )
    lean = np.array([[0.0, 0.0, 0.5]]) * (back.positions[:, 1:2] - 0.2)
    back = replace(back, positions=(back.positions + lean).astype(np.float32))
    chair = replace(chair, surfaces=(*chair.surfaces, back))
    cushion = solid("dress-clutter-1", [0.9, 0.4 - sunk_m, 1.3], [1.3, 0.6, 1.55])
    found = penetrations(things_of(with_new(house(chair), cushion), house(chair)))
    assert len(found) == n


def test_a_thing_inside_another_is_found_and_what_came_with_the_home_is_not() -> None:
    home = house(TABLE, solid("twin", [1.0, 0.0, 1.0], [2.2, 0.75, 1.8]))
    assert penetrations(things_of(home, home)) == []
    inside = solid("dress-clutter-1", [1.5, 0.3, 1.3], [1.6, 0.4, 1.4])
    assert len(penetrations(things_of(with_new(house(TABLE), inside), house(TABLE)))) == 1


def test_what_stands_before_a_door_is_found() -> None:
    home = builtin_home()
    door = next(i for i in home.items if i.id == "door_inner")
    x, _y, z = door.bounds.mean(0)
    before = solid("dress-clutter-1", [x - 0.7, 0, z - 0.1], [x - 0.6, 0.5, z + 0.1])
    beside = solid("dress-clutter-2", [x - 0.7, 0, z - 0.75], [x - 0.6, 0.5, z - 0.6])
    dressed = with_new(home, before, beside)
    found = {thing for _door, thing in blocked_doors(dressed, things_of(dressed, home))}
    assert found == {"dress-clutter-1"}


def test_a_door_at_a_corner_counts_from_its_own_wall() -> None:
    # The door's wall lies on one side of the hole alone; on the other begins the wall across.
    own = replace(solid("own", [1.0, 0, -0.04], [3.0, 2.5, 0.04]), kind=ItemKind.WALL)
    across = replace(solid("across", [-0.2, 0, -0.5], [0.0, 2.5, 0.5]), kind=ItemKind.WALL)
    walls = things_of(house(own, across), house(own, across))
    centre, along, out = np.array([0.5, 1.0, 0.0]), np.array([1.0, 0, 0]), np.array([0, 0, 1.0])
    assert half_wall(walls, centre, along, out, 0.9) == pytest.approx(0.04)
