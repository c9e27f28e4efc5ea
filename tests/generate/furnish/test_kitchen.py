"""Kitchen runs with opening fronts: corner units without fronts, fillers beside deeper units."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from shapely.geometry import Polygon, box

from pbrs_farm.core.catalogue import Catalogue, Piece, Place
from pbrs_farm.generate.furnish.kitchen import Units, kitchen_places, units_of
from pbrs_farm.generate.furnish.pieces import Shelf
from pbrs_farm.generate.furnish.room_space import FurnishSpace, RoomWall, outside_of
from pbrs_farm.generate.furnish.template import PieceSlot, WallFrame
from tests.generate.furnish.shelves import plain_catalogue

_OPENS = ("base_cabinet", "sink", "cooker", "fridge", "upper_cabinet")
_TRAVEL_M = 0.5  # more than the travel of a drawer or the height of an oven door
_SLIT_M = 0.004


def units(cooker_m: float = 0.6) -> Units:
    plain = plain_catalogue()
    blind = Piece(
        "plain#blind", "blind", "blind_cabinet", Place.KITCHEN, 39, (0.67, 0.588, 0.88),
        library="plain",
    )  # fmt: skip
    pieces = [
        replace(p, size=(cooker_m, *p.size[1:])) if p.group == "cooker" else p
        for p in (*plain.pieces, blind)
    ]
    catalogue = Catalogue(tuple(pieces), lambda _piece: None, "kitchen")
    kitchen_units = units_of(Shelf(catalogue, np.random.default_rng(1)))
    assert kitchen_units is not None
    return kitchen_units


def corner_room(w: float, d: float) -> FurnishSpace:
    """A room with two walls, which meet in the right corner of the first."""
    polygon = Polygon([(0, 0), (w, 0), (w, d), (0, d)])
    walls = (
        RoomWall(WallFrame(0.0, 0.0, 1, 0), w, True, True),
        RoomWall(WallFrame(w, 0.0, 0, 1), d, True, True),
    )
    return FurnishSpace(
        0, polygon, polygon, walls, outside_of(polygon), np.zeros((0, 4)), (), (), 2.6
    )


def swept_area(slot: PieceSlot) -> Polygon:
    """The area swept by a unit's front, in the template's frame; 4 mm less at the sides, where neighbours start."""
    u0, v0, u1, v1 = slot.rect
    reach = slot.width if slot.piece.group in ("upper_cabinet", "fridge") else _TRAVEL_M
    # A side arm's units face the main arm.
    if slot.turns == 0:
        return box(u0 + _SLIT_M, v1 + 1e-3, u1 - _SLIT_M, v1 + reach)
    return box(u0 - reach, v0 + _SLIT_M, u0 - 1e-3, v1 - _SLIT_M)


@pytest.mark.parametrize("size", [(3.4, 3.4), (2.6, 4.0), (4.0, 2.7)])
@pytest.mark.parametrize("cooker_m", [0.5, 0.6])
def test_no_unit_of_a_kitchen_is_in_front_of_anothers_doors(
    size: tuple[float, float], cooker_m: float
) -> None:
    places = kitchen_places(
        units(cooker_m), corner_room(*size), np.random.default_rng(1), wanted=4.5
    )
    corners = [s for s in places if any(slot.turns for slot in s.template.slots)]
    assert 5 < len(corners) < len(places)
    for standing in places:
        slots = standing.template.slots
        for slot in (s for s in slots if s.piece.group in _OPENS):
            swept = swept_area(slot)
            for neighbour in slots:
                level = min(slot.top, neighbour.top) - max(slot.elevation, neighbour.elevation)
                if neighbour is not slot and level > 0.01:
                    assert swept.intersection(box(*neighbour.rect)).area < 1e-6, (slot, neighbour)


def test_a_corner_has_a_unit_that_nothing_opens_and_a_filler_wider_than_a_pull() -> None:
    places = kitchen_places(units(), corner_room(3.4, 3.4), np.random.default_rng(1), wanted=4.5)
    for standing in places:
        slots = standing.template.slots
        if not any(slot.turns for slot in slots):
            continue
        corner, filler = (s for s in slots if s.piece.group == "blind_cabinet")
        # Pulls protrude 3 cm from fronts that end 62.5 cm from the wall.
        free = corner.width - 0.625
        assert free >= 0.03
        assert filler.width >= 0.03
        assert filler.turns == 1
        # Both worktops meet, without a gap between filler and corner.
        assert filler.rect[1] - corner.rect[3] == pytest.approx(0.0, abs=0.005)


def test_a_fridge_protrudes_so_that_its_door_clears_the_worktop() -> None:
    places = kitchen_places(units(), corner_room(3.4, 3.4), np.random.default_rng(1), wanted=4.5)
    for standing in places:
        slots = standing.template.slots
        fridge = next(s for s in slots if s.piece.group == "fridge")
        ahead = fridge.rect[3] if fridge.turns == 0 else 3.4 - fridge.rect[0]
        assert ahead - 0.03 >= 0.625  # 3 cm of it are its pull
        # A filler separates it from its neighbour.
        neighbours = [
            s for s in slots if s.turns == fridge.turns and s.elevation < 1 and s is not fridge
        ]
        gaps = [
            max(s.rect[k] - fridge.rect[k + 2], fridge.rect[k] - s.rect[k + 2])
            for s in neighbours for k in (fridge.turns,)
        ]  # fmt: skip
        assert min(gaps) == pytest.approx(0.02, abs=1e-6)
