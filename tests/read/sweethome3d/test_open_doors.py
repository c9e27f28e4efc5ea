"""`read.doors=open`: leaves swing about their hinges, everything else is unchanged."""

from __future__ import annotations

import numpy as np
import pytest

from pbrs_farm.core.house import House
from pbrs_farm.core.recipe import ReadFields, Recipe
from tests.inputs.sh3d_doors import FRAME, HINGED, LEAF, NORTH, SOUTH, box, door_of, read
from tests.read.sweethome3d.sh3d_source import piece

UNHINGED = LEAF.replace("sweethome3d_opening_on_hinge_1_door", "leaf") + FRAME


def leaf_points(house: House) -> np.ndarray:
    """The door's points below the frame's head."""
    points = np.concatenate([s.positions for s in door_of(house).surfaces])
    return points[points[:, 1] < 0.5]


def test_an_open_leaf_is_on_the_side_of_its_hinge() -> None:
    low, high = leaf_points(read("open")).min(0), leaf_points(read("open")).max(0)
    # The hinge is at x = 1.59 and the leaf reaches 0.8 m into the room at 85 degrees.
    assert high[2] == pytest.approx(0.03 + 0.81 * np.sin(np.radians(85)), abs=0.01)
    assert low[0] > 1.55
    assert high[0] < 1.75
    shut = leaf_points(read("drawn"))
    assert np.ptp(shut[:, 0]) == pytest.approx(0.8, abs=1e-5)


def test_a_mirrored_door_opens_to_the_same_room_from_its_other_end() -> None:
    points = leaf_points(read("open", modelMirrored="true"))
    assert points[:, 2].max() > 0.8
    assert points[:, 0].min() > 2.25


def test_a_turned_door_opens_to_the_room_behind() -> None:
    assert leaf_points(read("open", angle=str(np.pi)))[:, 2].min() < -0.8


def test_the_box_of_an_open_door_holds_its_leaf() -> None:
    door = door_of(read("open"))
    box = door.oriented_box
    for surface in door.surfaces:
        local = (surface.positions - box.centre) @ box.axes
        assert (np.abs(local) <= box.half + 1e-5).all()


def test_hole_and_frame_do_not_move() -> None:
    drawn, opened = read("drawn"), read("open")
    assert np.array_equal(drawn.openings[0].cutter.positions, opened.openings[0].cutter.positions)
    heads = [
        np.sort(np.concatenate([s.positions for s in door_of(h).surfaces])[:, 1])[-8:]
        for h in (drawn, opened)
    ]
    assert np.array_equal(*heads)


@pytest.mark.parametrize("north", ["", NORTH.replace("<room>", "<room ceilingVisible='false'>")])
def test_a_door_that_leads_outdoors_stays_shut(north: str) -> None:
    drawn, opened = read("drawn", SOUTH + north), read("open", SOUTH + north)
    assert np.array_equal(leaf_points(drawn), leaf_points(opened))


def test_a_leaf_that_furniture_blocks_is_left_out_with_a_note() -> None:
    chest = piece("x='200' y='40' width='150' depth='40' height='100'")
    house = read("open", more=chest)
    assert len(leaf_points(house)) == 0
    assert house.notes[-1].kind == "door-leaf-left-out"


def test_a_door_whose_only_visible_leaf_is_blocked_leaves_a_doorway() -> None:
    chest = piece("x='200' y='40' width='150' depth='40' height='100'")
    parts = HINGED.replace("g sweethome3d_opening", "usemtl white\ng sweethome3d_opening")
    parts = parts.replace("g frame", "usemtl redwood\ng frame")
    hidden = "<material name='redwood' color='00FFFFFF'/>"
    assert len(leaf_points(read("drawn", obj=parts, inner=hidden))) > 0
    house = read("open", obj=parts, inner=hidden, more=chest)
    assert door_of(house).surfaces == ()
    assert [n.kind for n in house.notes] == ["unmapped-class", "door-leaf-left-out"]
    # Repair cuts the doorway anyway.
    assert [o.item_id for o in house.openings] == ["piece_0"]


def test_a_door_without_a_hinge_stays_as_drawn_with_a_note() -> None:
    house = read("open", obj=UNHINGED)
    assert np.array_equal(leaf_points(house), leaf_points(read("drawn", obj=UNHINGED)))
    assert [n.kind for n in house.notes] == ["door-without-hinge"]


@pytest.mark.parametrize("angle", ["0", "0.4"])
def test_a_leaf_that_is_a_sheet_swings_open_too(angle: str) -> None:
    corners = "v -0.4 0 0\nv 0.4 0 0\nv 0.4 2 0\nv -0.4 2 0\nf 1 2 3 4\n"
    sheet = f"g sweethome3d_opening_on_hinge_1_door\n{corners}"
    frame = box("frame", (-0.5, 2, -0.1), (0.5, 2.1, 0.1), 5)
    hinge = box("sweethome3d_hinge_1_1", (-0.42, 1, 0.0), (-0.4, 1.1, 0.02), 13)
    points = leaf_points(read("open", obj=sheet + frame + hinge, angle=angle))
    assert np.ptp(points[:, 2]) > 0.6


def test_an_archway_has_nothing_to_open() -> None:
    left_post = box("frame", (-0.5, 0, -0.1), (-0.45, 2.1, 0.1), 1)
    right = box("frame", (0.45, 0, -0.1), (0.5, 2.1, 0.1), 9)
    assert read("open", obj=left_post + right).notes == ()


def test_doors_as_drawn_keep_the_digest_of_before() -> None:
    assert Recipe().digest("read") == Recipe(read=ReadFields(doors="drawn")).digest("read")
    assert Recipe().digest("read") != Recipe(read=ReadFields(doors="open")).digest("read")
