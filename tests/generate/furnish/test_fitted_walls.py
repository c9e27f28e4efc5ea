"""Walls filled from side to side: the free stretches, and the pieces that fill them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pbrs_farm.core.catalogue import EMPTY, Piece, Place
from pbrs_farm.core.classes import CABINET, CHAIR, TABLE
from pbrs_farm.generate.floor_plan import (
    OpeningKind,
    Plan,
    PlanOpening,
    PlanRoom,
    PlanWall,
    RoomType,
)
from pbrs_farm.generate.furnish.living_rooms import dining
from pbrs_farm.generate.furnish.pieces import Shelf
from pbrs_farm.generate.furnish.places import places_of
from pbrs_farm.generate.furnish.room_space import FurnishSpace, free_stretches, room_space
from pbrs_farm.generate.furnish.small_rooms import fitted_wardrobes
from pbrs_farm.generate.furnish.template import PieceGroup

W, D = 4.0, 3.0
DOOR_M, WINDOW_M = 0.9, 1.2


def room() -> FurnishSpace:
    """A door in the middle of one long side, a window in the middle of the other."""
    corners = ((0.0, 0.0), (W, 0.0), (W, D), (0.0, D))
    walls = tuple(
        PlanWall(a, b, 0.02) for a, b in zip(corners, (*corners[1:], corners[0]), strict=True)
    )
    openings = (
        PlanOpening(OpeningKind.DOOR, 0, W / 2, DOOR_M, 2.1, 0.0, 0),
        PlanOpening(OpeningKind.WINDOW, 2, W / 2, WINDOW_M, 1.2, 0.9, 0),
    )
    return room_space(
        Plan((PlanRoom(RoomType.BEDROOM, "Bedroom", corners),), walls, openings, 2.5), 0
    )


def test_a_stretch_ends_at_doors_windows_and_corners() -> None:
    beside_door, beside_window = (W - DOOR_M) / 2, (W - WINDOW_M) / 2
    stretches = free_stretches(room(), 0.5)
    assert stretches == pytest.approx((D, beside_door, beside_window), abs=0.03)
    assert free_stretches(room(), 2.0) == pytest.approx((D,), abs=0.03)


def shelf(*widths: float) -> Shelf:
    pieces = tuple(
        Piece(f"p{w}", "Doors", "fitted_wardrobe", Place.FLOOR, CABINET, (w, 0.6, 2.4))
        for w in widths
    )
    return Shelf(replace(EMPTY, pieces=pieces), np.random.default_rng(1))


def test_a_row_of_doors_is_stretched_from_wall_to_wall() -> None:
    templates = fitted_wardrobes(shelf(1.2, 2.8), (D,))
    assert [t.slots[0].piece.size[0] for t in templates] == [2.8], (
        "the other would be bent too much"
    )
    places = places_of(PieceGroup("wardrobe", templates), room(), np.random.default_rng(1))
    assert places.n
    for k in range(places.n):
        x0, z0, x1, z1 = places.standing(k).bodies[0]
        assert z1 - z0 == pytest.approx(D, abs=0.03), "along a short side, which has no door"
        assert min(x0, W - x1) < 0.03


def test_a_stretch_far_from_all_pieces_is_unchanged() -> None:
    assert fitted_wardrobes(shelf(1.2), (D,)) == ()


def table_and_chairs(width: float) -> Shelf:
    pieces = (
        Piece("table", "Table", "dining_table", Place.FLOOR, TABLE, (width, 0.9, 0.75)),
        Piece("chair", "Chair", "chair", Place.FLOOR, CHAIR, (0.45, 0.5, 0.9)),
    )
    return Shelf(replace(EMPTY, pieces=pieces), np.random.default_rng(1))


@pytest.mark.parametrize(
    ("width", "seats", "chairs"), [(1.8, 8, 8), (1.8, 6, 6), (1.4, 6, 6), (1.4, 4, 4)]
)
def test_a_long_table_has_a_chair_at_each_end_if_enough_are_requested(
    width: float, seats: int, chairs: int
) -> None:
    best = max(dining(table_and_chairs(width), seats), key=lambda t: t.rank)
    seated = [s for s in best.slots if s.piece.group == "chair"]
    assert len(seated) == chairs
    # Chairs at the ends face along the table, and reach under it.
    ends = [s for s in seated if s.turns % 2]
    assert len(ends) == (2 if (width, seats) in ((1.8, 8), (1.4, 6)) else 0)
    assert all(abs(s.u) - s.depth / 2 == pytest.approx(width / 2 - 0.2) for s in ends)
