from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.catalogue import EMPTY, Catalogue, Piece, Place, Shape
from pbrs_farm.core.frames import rotation_y
from pbrs_farm.core.house import Box, Item, ItemKind, LightPart, Material
from pbrs_farm.core.joints import Joint, JointKind
from pbrs_farm.core.lighting import PowerUnit
from pbrs_farm.core.recipe import DressFields
from pbrs_farm.dress import dressing
from pbrs_farm.dress.mutable_house import ADDED_TAG, MutableHouse
from pbrs_farm.dress.old_place import OldPlace, before_boards
from pbrs_farm.dress.style import style_for
from pbrs_farm.dress.swap import swap_furniture
from pbrs_farm.geometry.solids import box
from tests.dress.furniture import house, solid

Size = tuple[float, float, float]  # width, depth, height


def _chair_boxes(size: Size) -> list[tuple[F64, F64]]:
    # A seat block and a back rest at the back.
    w, d, h = size
    return [
        (np.array([-w / 2, 0.0, -d / 2]), np.array([w / 2, h / 2, d / 2])),
        (np.array([-w / 2, h / 2, -d / 2]), np.array([w / 2, h, -d / 2 + 0.1 * d])),
    ]


def _shape(size: Size, *, is_seat: bool = False, lights: tuple[LightPart, ...] = ()) -> Shape:
    w, d, h = size
    whole = [(np.array([-w / 2, 0.0, -d / 2]), np.array([w / 2, h, d / 2]))]
    parts = _chair_boxes(size) if is_seat else whole
    surfaces = tuple(box("new", (a + b) / 2, (b - a) / 2, 0) for a, b in parts)
    return Shape(surfaces, (Material("new", diffuse=(0.1, 0.2, 0.3)),), {}, lights)


def _catalogue(*entries: tuple[str, str, Size], lights: tuple[LightPart, ...] = ()) -> Catalogue:
    classes = {"chair": 5, "dresser": 17, "table_lamp": 35, "nightstand": 32, "bed": 4}
    pieces = tuple(
        Piece(f"T#{name}", name, group, Place.FLOOR, classes[group], size)
        for group, name, size in entries
    )
    seats = ("chair", "bed")
    return Catalogue(
        pieces, lambda p: _shape(p.size, is_seat=p.group in seats, lights=lights), "test"
    )


def _item(
    item_id: str, size: Size, at: list[float], nyu40: int, *, turn_deg: float = 0.0,
    is_seat: bool = False, kind: ItemKind = ItemKind.OBJECT, lights: tuple[LightPart, ...] = (),
) -> Item:  # fmt: skip
    turn, shape = rotation_y(np.radians(turn_deg)), _shape(size, is_seat=is_seat)
    place = np.array(at)
    surfaces = tuple(
        replace(s, positions=(s.positions @ turn.T + place).astype(np.float32))
        for s in shape.surfaces
    )
    w, d, h = size
    whole = Box(place + np.array([0, h / 2, 0]), np.array([w, h, d]) / 2, turn)
    return Item(
        item_id, item_id, kind, "0", surfaces, nyu40, "T#old", "0_0", box=whole, lights=lights
    )  # fmt: skip


def _swapped(catalogue: Catalogue, *items: Item, share: float = 1.0, seed: int = 3) -> MutableHouse:
    mutable = MutableHouse(house(*items), seed)
    swap_furniture(mutable, catalogue, style_for(mutable.rng("style"), ""), share)
    return mutable


def _corners(item: Item) -> F64:
    return np.concatenate([s.positions for s in item.surfaces]).astype(np.float64)


DRESSER: Size = (1.2, 0.5, 0.8)


@pytest.mark.parametrize("turn_deg", [0.0, 90.0, 180.0, 33.0])
def test_a_new_model_keeps_back_axis_and_floor_within_the_old_footprint(turn_deg: float) -> None:
    old = _item("d", DRESSER, [2.0, 0.02, 1.5], 17, turn_deg=turn_deg)
    mutable = _swapped(_catalogue(("dresser", "new", (1.0, 0.45, 0.85))), old)
    turn = rotation_y(np.radians(turn_deg))
    new_corners, was = (_corners(i) @ turn for i in (mutable.items[0], old))
    assert mutable.items[0].source_class == "T#new"
    assert_allclose(new_corners[:, 2].min(), was[:, 2].min(), atol=1e-5)
    assert_allclose(new_corners[:, 1].min(), was[:, 1].min(), atol=1e-5)
    assert_allclose(
        (new_corners.min(0) + new_corners.max(0))[0], (was.min(0) + was.max(0))[0], atol=1e-5
    )
    assert (np.ptp(new_corners, axis=0) <= np.ptp(was, axis=0) * [1, 1.15, 1] + 1e-5).all()
    assert (np.ptp(new_corners, axis=0) >= np.ptp(was, axis=0) * [0.75, 0.85, 0.75] - 1e-5).all()


def test_an_item_two_millimetres_above_the_floor_gets_a_standing_replacement() -> None:
    old = _item("d", DRESSER, [2.0, 0.002, 1.5], 17)
    mutable = _swapped(_catalogue(("dresser", "new", (1.0, 0.45, 0.85))), old)
    assert mutable.items[0].source_class == "T#new"
    assert_allclose(_corners(mutable.items[0])[:, 1].min(), 0.0, atol=1e-6)


@pytest.mark.parametrize(
    ("above_m", "place", "low_m", "is_swapped"),
    [
        (0.16, Place.FLOOR, 0.0, False),  # a standing model would float
        (0.16, Place.WALL, 0.0, True),
        (0.16, Place.FLOOR, 0.2, True),  # its library hangs it on a wall
        (0.0, Place.FLOOR, 0.2, False),  # a hung model would drop to the floor
        (0.0, Place.FLOOR, 0.0, True),
    ],
)
def test_hung_items_stay_hung_and_standing_ones_standing(
    above_m: float, place: Place, low_m: float, is_swapped: bool
) -> None:
    catalogue = _catalogue(("dresser", "new", DRESSER))
    (piece,) = catalogue.pieces
    catalogue = replace(catalogue, pieces=(replace(piece, place=place, low_m=low_m),))
    mutable = _swapped(catalogue, _item("d", DRESSER, [2.0, above_m, 1.5], 17))
    assert (mutable.items[0].source_class == "T#new") is is_swapped
    assert mutable.items[0].bounds[0, 1] == pytest.approx(above_m, abs=1e-5)
    assert ("swap: no other model is held as the old one is" in mutable.refused) is not is_swapped


def test_an_item_on_a_platform_stands_rather_than_hangs() -> None:
    platform = solid("platform", [1.0, 0.0, 1.0], [3.0, 0.3, 2.0])
    catalogue = _catalogue(("dresser", "new", DRESSER))
    mutable = _swapped(catalogue, _item("d", DRESSER, [2.0, 0.3, 1.5], 17), platform)
    assert mutable.items[0].source_class == "T#new"


def test_a_replacement_keeps_the_id_and_names_its_source() -> None:
    mutable = _swapped(_catalogue(("dresser", "new", DRESSER)), _item("d", DRESSER, [2, 0, 1], 17))
    item = mutable.items[0]
    assert (item.id, item.nyu40, item.room_id, len(mutable.items)) == ("d", 17, "0_0", 1)
    assert f"{ADDED_TAG}T#new" in item.tags
    assert mutable.done["swap: dresser"] == 1


@pytest.mark.parametrize("size", [(2.0, 0.5, 0.8), (0.5, 0.5, 0.8), (1.2, 0.5, 1.6), (0, 0.5, 0.8)])
def test_a_model_of_another_size_does_not_fit(size: Size) -> None:
    mutable = _swapped(_catalogue(("dresser", "new", size)), _item("d", DRESSER, [2, 0, 1], 17))
    assert mutable.items[0].source_class == "T#old"
    assert mutable.refused["swap: no other model fits"] == 1


def test_a_seat_that_looks_another_way_than_its_box_keeps_its_back_rest_behind() -> None:
    # The front of its box is +z, but its backrest is at +x.
    old = _item("c", (0.45, 0.45, 0.9), [2, 0, 1], 5, turn_deg=-90.0, is_seat=True)
    assert old.box is not None
    old = replace(old, box=replace(old.box, axes=np.eye(3)))
    new = _swapped(_catalogue(("chair", "new", (0.45, 0.45, 0.9))), old).items[0]
    high, was = (p[p[:, 1] > 0.8].mean(0) for p in (_corners(new), _corners(old)))
    assert new.source_class == "T#new"
    assert_allclose(high, was, atol=0.02)


@pytest.mark.parametrize(("name", "is_kept"), [("Balcony", True), ("Living room", False)])
def test_a_chair_on_a_balcony_stays_and_an_indoor_one_is_swapped(name: str, is_kept: bool) -> None:
    size = (0.5, 0.5, 0.9)
    home = house(_item("chair", size, [1, 0, 1], 5, is_seat=True), name=name)
    mutable = MutableHouse(home, 3)
    swap_furniture(
        mutable, _catalogue(("chair", "new", size)), style_for(mutable.rng("style"), ""), 1.0
    )
    assert (mutable.items[0] is home.items[0]) == is_kept


def test_no_grown_up_gets_a_childs_chair_and_no_child_a_grown_ups() -> None:
    size = (0.45, 0.45, 0.9)
    chair = _item("c", size, [2, 0, 1], 5, is_seat=True)
    for name in ("childChair", "junior chair"):
        mutable = _swapped(_catalogue(("chair", name, size)), chair)
        assert mutable.items[0].source_class == "T#old"
    childs = replace(chair, name="Child chair")
    assert _swapped(_catalogue(("chair", "new", size)), childs).items[0].source_class == "T#old"
    new = _swapped(_catalogue(("chair", "childChair", size)), childs).items[0]
    assert new.source_class == "T#childChair"


def test_chairs_of_one_room_get_the_same_model() -> None:
    size = (0.45, 0.45, 0.9)
    catalogue = _catalogue(*(("chair", f"n{k}", (0.45, 0.43, 0.88 + 0.01 * k)) for k in range(6)))
    chairs = [_item(f"c{k}", size, [1.0 + k, 0, 1], 5, is_seat=True) for k in range(3)]
    for seed in range(4):
        models = {i.source_class for i in _swapped(catalogue, *chairs, seed=seed).items}
        assert len(models) == 1
        assert models != {"T#old"}


@pytest.mark.long
def test_a_users_library_of_any_size_gets_its_share_of_swaps() -> None:
    catalogue = _catalogue(*(("dresser", f"n{k}", (1.2, 0.5, 0.8)) for k in range(50)))
    one_own = replace(catalogue, own=frozenset({"T#n7"}))
    drawn = {"none": (catalogue, 0.5), "half": (one_own, 0.5), "even": (one_own, 0.0)}
    models = {
        name: [_swapped_dresser(library, share, seed) for seed in range(60)]
        for name, (library, share) in drawn.items()
    }
    # Half of 60 draws plus a fiftieth of the rest, three standard deviations either way.
    assert 19 <= models["half"].count("T#n7") <= 42
    # Without a library of the user's, or with a share of 0, the draws are unchanged.
    assert models["none"] == models["even"]
    assert models["none"].count("T#n7") < 8
    # Choices outside the user's library are the same as before.
    unchanged = [now == before for now, before in zip(models["half"], models["none"], strict=True)]
    assert all(k or now == "T#n7" for k, now in zip(unchanged, models["half"], strict=True))


def test_dressing_hands_the_recipe_s_share_on(monkeypatch: pytest.MonkeyPatch) -> None:
    shares: list[float] = []

    def seen(mutable: MutableHouse, *_others: object) -> tuple[object, object]:
        shares.append(mutable.own_share)
        return mutable.source, None

    monkeypatch.setattr(dressing, "dress_in_place", seen)
    fields = DressFields(library_share=0.3)
    dressing.dressed_house(house(_item("d", DRESSER, [2, 0, 1.1], 17)), EMPTY, fields, 1)
    assert shares == [0.3]


def _swapped_dresser(catalogue: Catalogue, own_share: float, seed: int) -> str:
    house_with_one = house(_item("d", DRESSER, [2, 0, 1.1], 17))
    mutable = MutableHouse(house_with_one, seed, own_share=own_share)
    swap_furniture(mutable, catalogue, style_for(mutable.rng("style"), ""), 1.0)
    return mutable.items[0].source_class


def test_contents_of_an_item_are_moved_onto_its_replacement() -> None:
    thing = solid("vase", [1.9, 0.8, 1.0], [2.1, 1.1, 1.2], 40)
    catalogue = _catalogue(("dresser", "new", (1.2, 0.5, 0.9)))
    mutable = _swapped(catalogue, _item("d", DRESSER, [2, 0, 1.1], 17), thing)
    top = _corners(mutable.items[0])[:, 1].max()
    assert top == pytest.approx(0.9)
    assert mutable.items[1].bounds[0, 1] == pytest.approx(top, abs=1e-4)


def test_an_item_with_others_inside_or_under_it_is_kept() -> None:
    thing = solid("box", [1.9, 0.3, 1.0], [2.1, 0.5, 1.2], 29)
    catalogue = _catalogue(("dresser", "new", DRESSER))
    mutable = _swapped(catalogue, _item("d", DRESSER, [2, 0, 1.1], 17), thing)
    assert mutable.items[0].source_class == "T#old"
    assert mutable.refused["swap: things stand in it or under it"] == 1


def test_it_never_reaches_farther_into_its_neighbours() -> None:
    shelf = solid("shelf", [1.4, 0.83, 0.9], [2.6, 0.85, 1.3], 15)
    catalogue = _catalogue(("dresser", "new", (1.2, 0.5, 0.9)))
    mutable = _swapped(catalogue, _item("d", DRESSER, [2, 0, 1.1], 17), shelf)
    assert mutable.items[0].source_class == "T#old"
    assert mutable.refused["swap: it would reach into its neighbours"] == 1


def _light(power: float) -> LightPart:
    return LightPart(
        (0.0, 0.3, 0.0), 0.03, power, PowerUnit.SWEETHOME3D, rgb_linear=(1.0, 0.5, 0.2)
    )


def test_a_lamp_keeps_its_power_and_its_colour() -> None:
    size = (0.3, 0.3, 0.5)
    lamp = _item("l", size, [2, 0.7, 1], 35, kind=ItemKind.LAMP, lights=(_light(0.8),))
    new = replace(_light(0.5), rgb_linear=(1.0, 1.0, 1.0), share=1.0)
    table = solid("table", [1.5, 0.0, 0.5], [2.5, 0.7, 1.5])
    catalogue = _catalogue(("table_lamp", "old", size), ("table_lamp", "new", size), lights=(new,))
    mutable = _swapped(catalogue, lamp, table)
    (light,) = mutable.items[0].lights
    assert mutable.items[0].source_class == "T#new"
    assert (light.power, light.rgb_linear) == (0.8, (1.0, 0.5, 0.2))
    assert_allclose(light.position, [2, 1.0, 1], atol=1e-6)


def test_a_lamp_that_is_lit_gets_no_model_without_a_light_source() -> None:
    size = (0.3, 0.3, 0.5)
    lamp = _item("l", size, [2, 0, 1], 35, kind=ItemKind.LAMP, lights=(_light(0.8),))
    catalogue = _catalogue(("table_lamp", "old", size), ("table_lamp", "new", size))
    mutable = _swapped(catalogue, lamp)
    assert mutable.items[0] is lamp
    assert mutable.refused["swap: no other model can be used"] == 1


def test_the_share_gives_the_number_of_swaps_and_the_seed_their_choice() -> None:
    catalogue = _catalogue(("dresser", "new", DRESSER))
    items = [
        replace(_item(f"d{k}", DRESSER, [2.0 * k, 0, 1], 17), source_class=f"T#old{k}")
        for k in range(40)
    ]
    assert not _swapped(catalogue, *items, share=0.0).done
    half = [i.source_class for i in _swapped(catalogue, *items, share=0.5).items]
    assert 10 <= half.count("T#new") <= 30
    assert half == [i.source_class for i in _swapped(catalogue, *items, share=0.5).items]


def test_an_unusable_model_leaves_the_original() -> None:
    broken = replace(_catalogue(("dresser", "new", DRESSER)), load=lambda _piece: None)
    mutable = _swapped(broken, _item("d", DRESSER, [2, 0, 1], 17))
    assert mutable.items[0].source_class == "T#old"
    assert mutable.refused["swap: no other model can be used"] == 1


def test_a_swapped_cabinet_is_in_front_of_the_skirting_board() -> None:
    place = OldPlace(0.0, np.array([0.0, 0.0, 0.0]), np.array([1.0, 2.0, 0.4]))
    along = np.array([[x, y, z] for x in (-1, 2) for y in (0, 0.07) for z in (-0.002, 0.012)])
    beside = np.array([[x, y, z] for x in (0.99, 1.002) for y in (0, 0.07) for z in (-1, 1)])
    drawn_in = before_boards(place, [along, beside])
    assert drawn_in.low[2] == pytest.approx(0.0125)
    assert (drawn_in.high == place.high).all()
    assert before_boards(place, [beside]).low[2] == 0.0


def test_items_with_joints_are_swapped_only_for_items_with_joints() -> None:
    joint = Joint("drawer 1", JointKind.PRISMATIC, (0, 0, 0), (0, 0, 1), 0.3)
    old = replace(_item("chest", DRESSER, [2.0, 0.0, 1.0], 17), joints=(joint,))
    lump = _catalogue(("dresser", "lump", DRESSER))
    assert _swapped(lump, old).items[0].source_class == "T#old"
    # Only generated items with joints: the others may have none of its fronts.
    pieces = tuple(
        Piece(f"generated#{name}", name, "dresser", Place.FLOOR, 17, DRESSER)
        for name in ("opens", "shut")
    )
    shapes = {"opens": replace(_shape(DRESSER), joints=(joint,)), "shut": _shape(DRESSER)}
    catalogue = Catalogue(
        (*lump.pieces, *pieces), lambda p: shapes.get(p.name, _shape(p.size)), "t"
    )
    for seed in range(6):
        assert _swapped(catalogue, old, seed=seed).items[0].source_class == "generated#opens"
