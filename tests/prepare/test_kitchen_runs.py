"""Kitchens given as boxes: runs of matching units, built-in appliances, items on top."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from itertools import pairwise

import numpy as np
import pytest

from pbrs_farm.core.catalogue import EMPTY, Catalogue
from pbrs_farm.core.house import House, Item
from pbrs_farm.furnishings.things.families import family_pieces, with_families
from pbrs_farm.prepare.stand_ins import with_stand_ins
from pbrs_farm.read.common.given_classes import box_only_item
from tests.inputs.empty_room import empty_room

Triple = tuple[float, float, float]
GROUP = {f"piece:{p.id}": p.group for p in family_pieces()}
SET = {f"piece:{p.id}": p.of_set for p in family_pieces()}


@cache
def generated() -> Catalogue:
    return with_families(EMPTY)


def boxed_item(
    name: str, at: Triple, size: Triple, source: str = "swiss-feature", number: int = 0
) -> Item:
    """An item with a name and a box; at: the middle of its base. size: width, height, depth."""
    x, y, z = at
    item = box_only_item(f"box_{number}", source, name, (x, y + size[1] / 2, z), size, 0.0)
    assert item is not None
    return item


def furnished(*items: Item, room: str = "Kitchen") -> House:
    house = empty_room()
    named = replace(house, rooms=tuple(replace(r, name=room, types=(room,)) for r in house.rooms))
    return with_stand_ins(named.with_items((*named.items, *items)), generated(), "pieces")


def stand_ins(house: House, prefix: str = "box_") -> list[Item]:
    return [i for i in house.items if i.id.startswith(prefix)]


def groups(items: list[Item]) -> list[str]:
    return [next((GROUP[t] for t in i.tags if t in GROUP), "box") for i in items]


def sets(items: list[Item]) -> set[str]:
    return {next(SET[t] for t in i.tags if t in SET) for i in items}


def test_a_kitchen_is_a_row_of_units_with_one_worktop() -> None:
    items = stand_ins(furnished(boxed_item("KITCHEN", (2.0, 0, 0.32), (3.0, 0.9, 0.6))))
    assert sorted(groups(items)) == ["base_cabinet"] * 3 + ["cooker", "sink"]
    assert len(sets(items)) == 1
    # They fill the box from end to end with their backs at the wall.
    spans = sorted((float(i.bounds[0, 0]), float(i.bounds[1, 0])) for i in items)
    assert (spans[0][0], spans[-1][1]) == pytest.approx((0.5, 3.5), abs=0.02)
    for (_, high), (low, _) in pairwise(spans):
        assert low == pytest.approx(high, abs=0.02)
    tops = [i.bounds[1, 1] for i in items if "sink" not in groups([i])]
    np.testing.assert_allclose(tops, 0.9, atol=0.01)
    assert all(i.box is not None and i.box.axes[2, 2] > 0.99 for i in items)


def test_a_sink_inside_a_kitchen_box_becomes_its_unit() -> None:
    kitchen = boxed_item("KITCHEN", (2.0, 0, 0.32), (3.0, 0.9, 0.6))
    sink = boxed_item("SINK", (1.2, 0, 0.3), (0.5, 0.85, 0.45), number=1)
    house = furnished(kitchen, sink)
    (unit,) = stand_ins(house, "box_1")
    assert groups([unit]) == ["sink"]
    assert unit.bounds.mean(0)[0] == pytest.approx(1.2, abs=0.03)
    assert np.ptp(unit.bounds[:, 0]) >= 0.6
    rest = stand_ins(house, "box_0")
    assert "sink" not in groups(rest)
    assert not any(
        i.bounds[0, 0] < unit.bounds[1, 0] - 0.02 and i.bounds[1, 0] > unit.bounds[0, 0] + 0.02
        for i in rest
    )


def test_a_machine_in_a_counter_keeps_its_place() -> None:
    counter = boxed_item("CounterTop", (2.0, 0, 0.32), (3.0, 0.9, 0.6), "ai2thor")
    washer = boxed_item("washing machine", (2.9, 0, 0.32), (0.6, 0.85, 0.6), "roomplan", 1)
    house = furnished(counter, washer)
    assert groups(stand_ins(house, "box_1")) == ["washer"]
    for unit in stand_ins(house, "box_0"):
        assert unit.bounds[1, 0] < 2.62 or unit.bounds[0, 0] > 3.18
    # A counter is not a whole kitchen: no units are added to it.
    assert set(groups(stand_ins(house, "box_0"))) == {"base_cabinet"}


def test_a_counter_full_of_appliances_gets_no_other_units() -> None:
    counter = boxed_item("storage", (1.4, 0, 0.32), (2.0, 0.92, 0.62), "roomplan")
    inside = [
        boxed_item("dishwasher", (0.7, 0.03, 0.32), (0.6, 0.82, 0.6), "roomplan", 1),
        boxed_item("sink", (1.4, 0.78, 0.32), (0.55, 0.16, 0.45), "roomplan", 2),
        boxed_item("stove", (2.1, 0.88, 0.32), (0.58, 0.06, 0.5), "roomplan", 3),
        boxed_item("oven", (2.1, 0.1, 0.32), (0.58, 0.6, 0.55), "roomplan", 4),
    ]
    items = stand_ins(furnished(counter, *inside))
    # The cooker includes its oven.
    assert {i.id: g for i, g in zip(items, groups(items), strict=True)} == {
        "box_1": "dishwasher", "box_2": "sink", "box_3": "cooker",
    }  # fmt: skip
    assert len(sets(items)) == 1
    low, high = (f(i.bounds[k, 0] for i in items) for f, k in ((min, 0), (max, 1)))
    assert (low, high) == pytest.approx((0.4, 2.4), abs=0.03)


def test_a_deep_counter_in_a_corner_is_an_l() -> None:
    items = stand_ins(
        furnished(boxed_item("CounterTop", (1.3, 0, 0.9), (2.6, 0.95, 1.8), "ai2thor"))
    )
    assert set(groups(items)) == {"base_cabinet"}
    along_north = [i for i in items if i.bounds[1, 2] < 0.7]
    along_west = [i for i in items if i.bounds[1, 0] < 0.7 and i.bounds[0, 2] > 0.5]
    assert len(along_north) + len(along_west) == len(items)
    assert len(along_north) >= 3
    assert len(along_west) >= 1


def test_storage_of_a_scan_is_kitchen_units_only_in_a_kitchen() -> None:
    low = boxed_item("storage", (2.0, 0, 0.32), (2.4, 0.92, 0.62), "roomplan")
    high = boxed_item("storage", (2.0, 1.45, 0.2), (2.4, 0.7, 0.35), "roomplan", 1)
    kitchen = furnished(low, high)
    assert set(groups(stand_ins(kitchen, "box_0"))) == {"base_cabinet"}
    uppers = stand_ins(kitchen, "box_1")
    assert set(groups(uppers)) == {"upper_cabinet"}
    assert len(uppers) == 4
    np.testing.assert_allclose([i.bounds[0, 1] for i in uppers], 1.45, atol=0.01)
    assert "base_cabinet" not in groups(stand_ins(furnished(low, room="Bedroom"), "box_0"))


@pytest.mark.parametrize(("room", "group"), [("Kitchen", "sink"), ("Bathroom", "washbasin")])
def test_a_basin_fits_its_room_and_keeps_its_rim_height(room: str, group: str) -> None:
    # A scan measures only the bowl.
    (basin,) = stand_ins(
        furnished(boxed_item("sink", (2.0, 0.65, 0.3), (0.5, 0.2, 0.45), "roomplan"), room=room)
    )
    assert groups([basin]) == [group]
    assert basin.bounds[0, 1] == pytest.approx(0.0, abs=0.01)
    assert 0.85 < basin.bounds[1, 1] < 1.3


@pytest.mark.parametrize("size", [(0.45, 0.42, 0.7), (0.5, 0.4, 0.5), (0.35, 1.1, 0.9)])
def test_a_toilet_with_any_box_is_a_toilet(size: Triple) -> None:
    house = furnished(
        boxed_item("toilet", (2.0, 0, size[2] / 2 + 0.02), size, "roomplan"), room="Bathroom"
    )
    (toilet,) = stand_ins(house)
    assert groups([toilet]) == ["toilet"]
    assert not house.notes
    assert 0.28 < np.ptp(toilet.bounds[:, 0]) < 0.55
    assert toilet.bounds[0, 2] >= -0.02


@pytest.mark.parametrize(
    ("source", "name"),
    [("ai2thor", "Faucet"), ("cubicasa-icon", "WaterTap"), ("hssd", "kitchen faucet")],
)
def test_a_faucet_is_part_of_its_sink(source: str, name: str) -> None:
    assert box_only_item("x", source, name, (0, 1, 0), (0.15, 0.3, 0.2), 0.0) is None
