"""Items given only by class and box: the best fitting piece, off the walls, its front to the room."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from pbrs_farm.core.catalogue import Catalogue, Piece, Place, Shape
from pbrs_farm.core.house import House, Item, ItemKind, Material, MaterialKind
from pbrs_farm.geometry.solids import box_quads, quads_surface
from pbrs_farm.prepare.stand_ins import STAND_IN, has_box_only_items, with_stand_ins
from pbrs_farm.read.common.given_classes import box_only_item
from tests.inputs.empty_room import empty_room

BED, CHAIR, TABLE = 4, 5, 7


def shape_of(piece: Piece) -> Shape:
    """A box of the piece's size with a lower one in front, which marks the front."""
    w, d, h = piece.size
    quads = box_quads(np.array([0.0, h / 2, -d / 4]), np.array([w, h, d / 2]) / 2)
    low = box_quads(np.array([0.0, h / 4, d / 4]), np.array([w, h / 2, d / 2]) / 2)
    surface = quads_surface("box", np.concatenate([quads, low]), 0)
    return Shape((surface,), (Material("grey"),))


def catalogue(*pieces: tuple[str, tuple[float, float, float], int]) -> Catalogue:
    catalogue_pieces = tuple(
        Piece(f"t#{group}{k}", group, group, Place.FLOOR, nyu40, size, creator="Ada", licence="CC-BY 3.0")
        for k, (group, size, nyu40) in enumerate(pieces)
    )  # fmt: skip
    return Catalogue(catalogue_pieces, shape_of, "test")


PIECES = catalogue(
    ("bed", (1.6, 2.1, 0.9), BED), ("bed", (0.95, 2.05, 0.8), BED), ("chair", (0.45, 0.5, 0.9), CHAIR),
    ("dining_table", (1.4, 0.8, 0.75), TABLE),
)  # fmt: skip


def box_only(
    name: str,
    at: tuple[float, float, float],
    size: tuple[float, float, float],
    turn: float = 0.0,
    *,
    number: int = 0,
    is_front_given: bool = False,
) -> Item:
    item = box_only_item(
        f"box_{number}", "spatiallm", name, at, size, turn, is_front_given=is_front_given
    )
    assert item is not None
    return item


def furnished(*items: Item, shelf: Catalogue = PIECES, how: str = "pieces") -> House:
    house = empty_room()
    with_box_only = house.with_items((*house.items, *items))
    return with_stand_ins(with_box_only, shelf, how)  # type: ignore[arg-type]


def of(house: House, number: int = 0) -> Item:
    (item,) = (i for i in house.items if i.id == f"box_{number}")
    return item


def test_the_piece_with_the_best_proportions_is_scaled_to_the_box() -> None:
    item = of(furnished(box_only("bed", (1.0, 0.4, 2.5), (0.9, 0.8, 2.2))))
    assert f"piece:{PIECES.pieces[1].id}" in item.tags
    assert STAND_IN in item.tags
    np.testing.assert_allclose(item.bounds.mean(0), [1.0, 0.4, 2.5], atol=2e-3)
    np.testing.assert_allclose(np.ptp(item.bounds, axis=0), [0.9, 0.8, 2.2], atol=2e-3)
    assert (item.nyu40, item.source_class, item.kind) == (BED, "bed", ItemKind.OBJECT)


def test_the_given_box_is_kept_as_the_items_box() -> None:
    box = of(furnished(box_only("bed", (1.0, 0.4, 2.5), (0.9, 0.8, 2.2)))).box
    assert box is not None
    np.testing.assert_allclose(np.sort(2 * box.half), [0.8, 0.9, 2.2])


@pytest.mark.parametrize(
    ("at", "size", "front"),
    [
        ((2.5, 0.4, 1.1), (1.6, 0.8, 2.1), (0, 1)),
        ((2.5, 0.4, 2.9), (1.6, 0.8, 2.1), (0, -1)),
        ((1.1, 0.4, 2.0), (2.1, 0.8, 1.6), (1, 0)),
        ((3.9, 0.4, 2.0), (2.1, 0.8, 1.6), (-1, 0)),
    ],
)
def test_a_back_at_a_wall_turns_the_front_into_the_room(
    at: tuple[float, float, float], size: tuple[float, float, float], front: tuple[int, int]
) -> None:
    item = of(furnished(box_only("bed", at, size)))
    assert item.box is not None
    np.testing.assert_allclose(item.box.axes[[0, 2], 2], front, atol=1e-9)
    # The mesh turns with the box: its high half is at the back.
    points = np.concatenate([s.positions for s in item.surfaces])
    top = points[points[:, 1] > points[:, 1].max() - 1e-3].mean(0) - item.bounds.mean(0)
    assert top[[0, 2]] @ np.array(front) < -0.2


@pytest.mark.parametrize(("name", "n_textures"), [("painting", 1), ("mirror", 0)])
def test_a_picture_or_mirror_that_no_piece_fits_is_made_in_its_size(
    name: str, n_textures: int
) -> None:
    house = furnished(box_only(name, (2.5, 1.4, 0.02), (1.1, 0.7, 0.04)))
    item = of(house)
    assert "piece:box" not in item.tags
    np.testing.assert_allclose(np.ptp(item.bounds, axis=0)[:2], [1.1, 0.7], atol=2e-3)
    assert item.bounds[0, 2] == pytest.approx(0.0, abs=2e-3)
    materials = [house.materials[s.material] for s in item.surfaces]
    assert len([m for m in materials if m.texture_id]) == n_textures
    assert (MaterialKind.MIRROR in [m.kind for m in materials]) == (name == "mirror")


@pytest.mark.parametrize("way", [(0.0, 1.0), (0.0, -1.0), (1.0, 0.0), (-1.0, 0.0)])
def test_chairs_look_at_the_nearest_table(way: tuple[float, float]) -> None:
    x, z = 2.5 - 0.9 * way[0], 2.0 - 0.7 * way[1]
    table = box_only("dining_table", (2.5, 0.37, 2.0), (1.4, 0.75, 0.8), number=1)
    chair = of(furnished(box_only("dining_chair", (x, 0.45, z), (0.45, 0.9, 0.48)), table))
    assert chair.box is not None
    np.testing.assert_allclose(chair.box.axes[[0, 2], 2], way, atol=1e-9)


@pytest.mark.parametrize(("z", "top"), [(1.8, 0.75), (2.2, 0.375)])
def test_contents_of_an_item_are_moved_onto_its_stand_in(z: float, top: float) -> None:
    """The front half of a stand-in is half as high as its box."""
    table = box_only(
        "dining_table", (2.5, 0.375, 2.0), (1.4, 0.75, 0.8), number=1, is_front_given=True
    )
    mug = box_only("cup", (2.5, 0.8, z), (0.09, 0.1, 0.09))
    assert of(furnished(mug, table)).bounds[0, 1] == pytest.approx(top, abs=1e-3)


def test_contents_of_a_plain_box_stay_on_it() -> None:
    plain = box_only("bed", (2.5, 0.375, 2.0), (4.0, 0.75, 0.5), number=1)
    seat = box_only("chair", (2.5, 0.3, 2.0), (0.45, 0.6, 0.5), number=2)
    cup = box_only("cup", (2.5, 0.85, 2.0), (0.09, 0.1, 0.09))
    assert of(furnished(seat, plain, cup)).bounds[0, 1] == pytest.approx(0.75, abs=5e-3)


def test_a_hung_item_with_nothing_below_stays_in_place() -> None:
    table = box_only("dining_table", (2.5, 0.375, 2.0), (1.4, 0.75, 0.8), number=1)
    picture = box_only("painting", (2.5, 1.5, 0.03), (0.6, 0.4, 0.03))
    assert of(furnished(picture, table)).bounds[0, 1] == pytest.approx(1.3, abs=0.01)


@pytest.mark.parametrize("size", [(1.0, 0.6, 0.06), (0.06, 0.6, 1.0)])
def test_a_flat_screen_looks_across_its_thin_side(size: tuple[float, float, float]) -> None:
    # Sideways the modelled screen of .62 m fits better than frontally.
    screens = catalogue(("tv", (0.62, 0.18, 0.6), 25), ("tv", (0.95, 0.1, 0.6), 25))
    item = of(furnished(box_only("television", (2.5, 1.3, 2.0), size), shelf=screens))
    width, _height, depth = np.ptp(item.bounds, axis=0)
    assert (width > depth) == (size[0] > size[2])
    assert max(width, depth) == pytest.approx(1.0, abs=0.01)


def test_a_given_front_is_kept() -> None:
    item = of(
        furnished(box_only("bed", (2.5, 0.4, 1.1), (1.6, 0.8, 2.1), math.pi, is_front_given=True))
    )
    assert item.box is not None
    np.testing.assert_allclose(item.box.axes[[0, 2], 2], [0, -1], atol=1e-9)


def test_a_box_that_reaches_into_a_wall_moves_inwards_by_the_overlap() -> None:
    item = of(furnished(box_only("bed", (0.95 / 2 - 0.1, 0.4, 2.0), (0.95, 0.8, 2.05))))
    assert -0.011 <= item.bounds[0, 0] - 0.01 <= 0.06


def test_a_box_mostly_inside_a_wall_is_dropped_with_a_note() -> None:
    house = furnished(box_only("bed", (-0.1, 0.4, 2.0), (0.95, 0.8, 2.05)))
    assert not any(STAND_IN in i.tags for i in house.items)
    assert [n.text for n in house.notes] == ["1 items reach into walls and are left out: 1 bed"]


def test_a_box_without_a_fitting_piece_stays_a_plain_box_with_a_note() -> None:
    house = furnished(box_only("bed", (2.5, 0.15, 2.0), (4.0, 0.3, 0.5)))
    item = of(house)
    assert "piece:box" in item.tags
    np.testing.assert_allclose(np.ptp(item.bounds, axis=0), [4.0, 0.3, 0.5], atol=1e-6)
    assert [n.kind for n in house.notes] == ["stand-in-box"]


def test_a_box_slightly_off_the_floor_is_put_on_it() -> None:
    for y in (0.2, 0.6):
        assert of(furnished(box_only("bed", (2.5, y, 2.0), (1.6, 0.8, 2.1)))).bounds[
            0, 1
        ] == pytest.approx(0.0, abs=1e-3)


def test_nothing_reaches_through_the_ceiling() -> None:
    tall = box_only("bed", (2.5, 1.4, 2.0), (1.0, 3.0, 1.0))
    assert of(furnished(tall)).bounds[1, 1] <= 2.5


@pytest.mark.parametrize(("how", "expected"), [("boxes", 1), ("none", 0)])
def test_the_recipe_may_ask_for_boxes_or_for_nothing(how: str, expected: int) -> None:
    house = furnished(box_only("bed", (2.5, 0.4, 2.0), (1.6, 0.8, 2.1)), how=how)
    assert sum("piece:box" in i.tags for i in house.items) == expected
    assert not has_box_only_items(house)
    assert [n.kind for n in house.notes] == ["box-only-left-out"] * (how == "none")


def test_the_author_of_a_piece_is_credited() -> None:
    assert (
        "Ada, CC-BY 3.0"
        in furnished(box_only("bed", (2.5, 0.4, 2), (1.6, 0.8, 2.1))).source.attribution
    )


def test_an_item_belongs_to_the_room_that_contains_it_rather_than_the_nearest() -> None:
    house = empty_room()
    (room,) = house.rooms
    beside = replace(room, id="0_0", polygon=room.polygon - np.array([5.02, 0], np.float32))
    item = box_only("chair", (0.3, 0.45, 2.0), (0.45, 0.9, 0.5))
    two_rooms = replace(house, rooms=(beside, replace(room, id="0_1")), items=(*house.items, item))
    assert of(with_stand_ins(two_rooms, PIECES, "pieces")).room_id == "0_1"


@pytest.mark.parametrize(
    ("at", "size"),
    [((math.nan, 0, 0), (1, 1, 1)), ((0, 0, 0), (1, math.inf, 1)), ((0, 0, 0), (0, 1, 1)),
     ((0, 0, 0), (1e30, 1, 1)), ((0, 0, 0), (-1, 1, 1))],
)  # fmt: skip
def test_a_degenerate_box_is_no_item(
    at: tuple[float, float, float], size: tuple[float, float, float]
) -> None:
    assert box_only_item("x", "spatiallm", "bed", at, size, 0.0) is None


def test_names_without_a_drawn_class_are_no_items() -> None:
    assert box_only_item("x", "swiss-feature", "ELEVATOR", (0, 0, 0), (1, 1, 1), 0.0) is None
    assert box_only_item("x", "ai2thor", "Doorway", (0, 0, 0), (1, 1, 1), 0.0) is None
    item = box_only_item("x", "ai2thor", "TVStand", (0, 0, 0), (1, 1, 1), 0.0)
    assert item is not None
    assert (item.name, item.source_class) == ("TV Stand", "TVStand")
