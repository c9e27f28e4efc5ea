"""Items that break a gate are removed with their contents, and the final count is measured."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pbrs_farm.core.catalogue import Piece, Place, Shape
from pbrs_farm.core.classes import CHAIR
from pbrs_farm.core.house import House, Item, ItemKind, Material
from pbrs_farm.core.joints import Joint, JointKind
from pbrs_farm.dress.gates import fronts, keep_gates
from pbrs_farm.dress.mutable_house import MutableHouse
from pbrs_farm.dress.report import Gate
from pbrs_farm.geometry.opened import stops
from pbrs_farm.geometry.solids import box
from pbrs_farm.read.builtin.builtin_home import builtin_home
from tests.dress.furniture import house, solid

TABLE = solid("table", [1.0, 0.0, 1.0], [2.2, 0.75, 1.8])


def piece(group: str, place: Place = Place.SURFACE, nyu40: int = 40) -> Piece:
    return Piece(f"generated#{group}", group, group, place, nyu40, (0.1, 0.1, 0.1))


def with_box(
    mutable: MutableHouse, name: str, low: list[float], high: list[float], kind: Piece | None = None
) -> Item:
    """Add a box like an item of the dressing."""
    low_, high_ = np.array(low), np.array(high)
    half = (high_ - low_) / 2
    surface = box("", np.array([0.0, half[1], 0.0]), half, 0)
    kind = kind or piece("cup")
    item = mutable.placed(
        kind, Shape((surface,), (Material("white"),)), np.array([*(low_ + half)]) - [0, half[1], 0],
        0.0, item_id=f"dress-test-{name}", room_id="0_0", level_id="0",
    )  # fmt: skip
    mutable.add(item, "test", kind)
    return item


def empty_home() -> House:
    """The built-in home without its furniture: doors between two rooms, a window in each."""
    home = builtin_home()
    return home.with_items(i for i in home.items if not i.id.startswith("piece_"))


def gates_of(mutable: MutableHouse) -> dict[str, Gate]:
    return {gate.name: gate for gate in keep_gates(mutable, mutable.used)}


def names(mutable: MutableHouse) -> set[str]:
    return {item.id.removeprefix("dress-test-") for item in mutable.items}


def test_supported_items_stay_and_floating_or_sunk_ones_are_removed():
    mutable = MutableHouse(house(TABLE), 1)
    with_box(mutable, "stands", [1.1, 0.75, 1.1], [1.2, 0.85, 1.2])
    with_box(mutable, "almost", [1.3, 0.7515, 1.1], [1.4, 0.85, 1.2])
    with_box(mutable, "floats", [1.5, 0.755, 1.1], [1.6, 0.85, 1.2])
    with_box(mutable, "sunk", [1.7, 0.745, 1.1], [1.8, 0.85, 1.2])
    gates = gates_of(mutable)
    assert names(mutable) == {"table", "stands", "almost"}
    assert (gates["support"].n_taken_out, gates["support"].n_left) == (2, 0)
    assert mutable.refused["test: floated or sank"] == 2


def test_contents_of_a_removed_item_are_removed():
    mutable = MutableHouse(house(TABLE), 1)
    with_box(mutable, "tray", [1.1, 0.76, 1.1], [1.4, 0.78, 1.4])
    with_box(mutable, "cup", [1.2, 0.78, 1.2], [1.25, 0.85, 1.25])
    with_box(mutable, "plate", [1.6, 0.75, 1.2], [1.7, 0.77, 1.3])
    gates = gates_of(mutable)
    assert names(mutable) == {"table", "plate"}
    assert gates["support"].n_taken_out == 2
    assert all(gate.n_left == 0 for gate in gates.values())


def test_the_later_of_two_items_in_one_place_is_removed():
    mutable = MutableHouse(house(TABLE), 1)
    with_box(mutable, "first", [1.1, 0.75, 1.1], [1.3, 0.85, 1.3])
    with_box(mutable, "second", [1.2, 0.75, 1.2], [1.4, 0.85, 1.4])
    gates = gates_of(mutable)
    assert names(mutable) == {"table", "first"}
    assert (gates["penetration"].n_taken_out, gates["penetration"].n_left) == (1, 0)


def test_an_original_item_is_never_removed():
    twin = replace(TABLE, id="twin")
    mutable = MutableHouse(house(TABLE, twin), 1)
    assert gates_of(mutable)["penetration"].n_checked == 0
    assert names(mutable) == {"table", "twin"}


def test_a_model_inside_another_item_is_replaced_by_the_original():
    cup = solid("shelf", [1.0, 0.0, 1.9], [2.2, 1.0, 2.1])
    mutable = MutableHouse(house(TABLE, cup), 1)
    large = solid("table", [1.0, 0.0, 1.0], [2.2, 0.75, 2.0])
    mutable.change(0, large, "swap")
    gates_of(mutable)
    assert mutable.items[0] is TABLE
    assert mutable.refused["swap: stood in another thing"] == 1


def test_a_replacement_may_hang_as_loosely_as_the_original():
    lamp = solid("lamp", [1.0, 1.5, 1.0], [1.2, 1.7, 1.2])
    mutable = MutableHouse(house(TABLE, lamp), 1)
    mutable.change(1, solid("lamp", [1.05, 1.5, 1.05], [1.15, 1.7, 1.15]), "swap")
    gates_of(mutable)
    assert not mutable.refused


def test_a_replacement_of_another_class_is_reverted():
    mutable = MutableHouse(house(TABLE), 1)
    mutable.change(0, solid("table", [1.0, 0.0, 1.0], [2.2, 0.75, 1.8], nyu40=5), "swap")
    gates = gates_of(mutable)
    assert mutable.items[0] is TABLE
    assert gates["must_haves"].n_taken_out == 1


def test_other_materials_are_no_other_mesh():
    mutable = MutableHouse(house(TABLE), 1)
    surfaces = tuple(replace(s, material=0) for s in TABLE.surfaces)
    mutable.change(0, replace(TABLE, surfaces=surfaces), "parts")
    assert gates_of(mutable)["support"].n_checked == 0


@pytest.mark.parametrize(
    ("out_m", "stays"), [(0.0, True), (0.0015, True), (0.02, False), (-0.02, False)]
)
def test_a_picture_hangs_at_its_wall(out_m, stays):
    mutable = MutableHouse(empty_home(), 1)
    low = [0.6, 1.4, out_m]
    picture = piece("picture", Place.WALL, 11)
    with_box(mutable, "picture", low, [1.0, 1.8, out_m + 0.03], picture)
    gates_of(mutable)
    assert ("picture" in names(mutable)) is stays


def test_no_item_is_before_a_door_or_in_its_swing():
    home = empty_home()
    mutable = MutableHouse(home, 1)
    door = next(i for i in home.items if i.id == "door_inner")
    x, _y, z = door.bounds.mean(0)
    shelf = piece("shelves", Place.FLOOR, 15)
    with_box(mutable, "before", [x - 0.75, 0.0, z - 0.1], [x - 0.65, 0.5, z + 0.1], shelf)
    with_box(mutable, "beside", [x - 0.75, 0.0, z - 0.75], [x - 0.65, 0.5, z - 0.6], shelf)
    with_box(
        mutable, "mat", [x - 0.6, 0.0, z - 0.3], [x - 0.2, 0.01, z + 0.3], piece("rug", nyu40=20)
    )
    gates = gates_of(mutable)
    assert {"beside", "mat"} <= names(mutable)
    assert "before" not in names(mutable)
    assert gates["doors"].n_taken_out == 1
    assert gates["doors"].n_checked >= 3


def test_furniture_may_not_cover_a_fifth_of_a_window_and_curtains_may():
    mutable = MutableHouse(empty_home(), 1)
    tall, low = piece("bookcase", Place.FLOOR, 10), piece("chest", Place.FLOOR, 10)
    with_box(mutable, "tall", [1.7, 0.0, 0.1], [2.4, 2.0, 0.4], tall)
    with_box(mutable, "low", [2.5, 0.0, 0.1], [3.3, 1.0, 0.4], low)
    with_box(
        mutable, "curtain", [1.5, 0.3, 0.0], [1.6, 2.2, 0.05], piece("curtain", Place.OPENING, 16)
    )
    gates = gates_of(mutable)
    assert {"low", "curtain"} <= names(mutable)
    assert "tall" not in names(mutable)
    assert gates["windows"].n_taken_out == 1


def test_an_item_that_blocks_the_way_between_two_doors_is_removed():
    mutable = MutableHouse(empty_home(), 1)
    for k, z in enumerate((0.0, 1.0, 2.0, 3.0)):
        with_box(mutable, f"wall{k}", [2.6, 0.0, z], [2.8, 1.0, z + 1.0], piece("box", Place.FLOOR))
    gates = gates_of(mutable)
    assert gates["path"].n_taken_out >= 1
    assert gates["path"].n_left == 0


def test_people_are_no_obstacle():
    person = replace(solid("person", [1.0, 0.0, 1.0], [1.5, 1.8, 1.5]), kind=ItemKind.PERSON)
    mutable = MutableHouse(house(TABLE, person), 1)
    with_box(mutable, "cup", [1.1, 0.75, 1.1], [1.2, 0.85, 1.2])
    gates_of(mutable)
    assert "cup" in names(mutable)


def drawer_chest(x: float, z: float) -> Item:
    """A chest of drawers 60 cm wide, 50 deep, 70 high; its front at z comes out by 40 cm."""
    body = solid("chest", [x, 0, z - 0.5], [x + 0.6, 0.7, z])
    front = replace(solid("", [x, 0.002, z], [x + 0.6, 0.698, z + 0.02]).surfaces[0], part="drawer")
    joint = Joint("drawer", JointKind.PRISMATIC, (0, 0, 0), (0, 0, 1), 0.4)
    return replace(body, surfaces=(*body.surfaces, front), joints=(joint,))


@pytest.mark.parametrize(
    ("ahead", "kind", "stays"),
    [
        (0.30, piece("box"), False),
        (0.39, piece("box"), True),  # it opens by 90 %
        (0.30, piece("chair", Place.FLOOR, CHAIR), True),  # a chair can be pushed aside
    ],
    ids=["in the way", "beyond", "a chair"],
)
def test_an_item_before_a_drawer_is_removed(ahead: float, kind: Piece, stays: bool) -> None:
    mutable = MutableHouse(house(drawer_chest(1.0, 1.0)), 1)
    z = 1.02 + ahead
    with_box(mutable, "thing", [1.1, 0.0, z], [1.5, 0.5, z + 0.4], kind)
    with_box(mutable, "beside", [1.7, 0.0, 1.1], [2.1, 0.5, 1.5])
    (gate,) = keep_gates(mutable, mutable.used, ("fronts",))
    assert ("thing" in names(mutable)) is stays
    assert "beside" in names(mutable)
    assert gate.n_taken_out == (not stays)


def test_a_new_chest_that_cannot_open_goes_itself() -> None:
    bed = solid("bed", [1.0, 0.0, 1.2], [2.0, 0.5, 3.0])
    mutable = MutableHouse(house(bed), 1)
    chest = replace(
        drawer_chest(1.1, 1.0), id="dress-test-chest", tags=("dressed:generated#chest",)
    )
    mutable.add(chest, "test", piece("chest", Place.FLOOR))
    (gate,) = keep_gates(mutable, mutable.used, ("fronts",))
    assert "chest" not in names(mutable)
    assert mutable.refused["test: stood before a front"] == 1
    assert gate.n_left == 0


def test_a_front_is_measured_against_each_item_once(monkeypatch: pytest.MonkeyPatch) -> None:
    mutable = MutableHouse(house(drawer_chest(1.0, 1.0)), 1)
    for name, z in (("thing", 1.41), ("beyond", 1.40)):
        with_box(mutable, name, [1.1, 0.0, z], [1.5, 0.5, z + 0.4], piece("box"))
    asked: list[int] = []

    def counted(*arguments: Any) -> dict[int, float]:
        asked.extend(arguments[-1])
        return stops(*arguments)

    monkeypatch.setattr(fronts, "stops", counted)
    keep_gates(mutable, mutable.used, ("fronts",))
    n_first = len(asked)
    with_box(mutable, "third", [1.1, 0.0, 1.405], [1.5, 0.5, 1.8], piece("box"))
    keep_gates(mutable, mutable.used, ("fronts",))
    assert (n_first, len(asked)) == (3, 4)  # the chest itself and two items, then the third
