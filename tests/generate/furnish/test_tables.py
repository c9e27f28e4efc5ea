"""Chairs at tables are as far under the top as both allow."""

from __future__ import annotations

import numpy as np
import pytest

from pbrs_farm.core.catalogue import Catalogue, Piece, Place, Shape
from pbrs_farm.core.house import Material
from pbrs_farm.generate.furnish.living_rooms import dining
from pbrs_farm.generate.furnish.pieces import Shelf, way_under_m
from pbrs_farm.geometry.solids import box

SEAT_M, BACK_M = 0.45, 0.04


def shape_of(*boxes: tuple[tuple[float, float, float], tuple[float, float, float]]) -> Shape:
    ends = [(np.array(low), np.array(high)) for low, high in boxes]
    surfaces = tuple(box("", (a + b) / 2, (b - a) / 2, 0) for a, b in ends)
    return Shape(surfaces, (Material("wood"),))


def shelf(w: float, d: float, apron: float) -> Shelf:
    """A table with an apron 3 cm inside its edge; a chair with arms 65 cm high."""
    table = Piece("t", "table", "dining_table", Place.FLOOR, 7, (w, d, 0.75))
    chair = Piece("c", "chair", "chair", Place.FLOOR, 5, (0.45, 0.5, 0.9))
    inset = (w / 2 - 0.03, d / 2 - 0.03)
    shapes = {
        "t": shape_of(
            ((-w / 2, 0.72, -d / 2), (w / 2, 0.75, d / 2)),
            ((-inset[0], 0.72 - apron, -inset[1]), (inset[0], 0.72, inset[1])),
            ((-0.05, 0.0, -0.05), (0.05, 0.1, 0.05)),
        ),
        "c": shape_of(
            ((-0.225, 0.0, -0.25), (0.225, SEAT_M, 0.25)),
            ((-0.225, SEAT_M, -0.25), (0.225, 0.9, -0.25 + BACK_M)),
            ((-0.225, SEAT_M, -0.25), (-0.17, 0.65, 0.2)),
        ),
    }
    catalogue = Catalogue((table, chair), lambda piece: shapes[piece.id], "tables")
    return Shelf(catalogue, np.random.default_rng(1))


@pytest.mark.parametrize(
    ("apron", "under"),
    # Arms 5 cm behind the seat's front pass below a thin top, and end 4 mm before a deep apron.
    [(0.02, 0.2), (0.15, 0.03 + 0.05 - 0.004)],
)
@pytest.mark.parametrize("at_wall", [False, True])
def test_a_chair_goes_as_far_under_a_table_as_its_arms_pass(
    apron: float, under: float, at_wall: bool
) -> None:
    template = dining(shelf(1.4, 0.9, apron), 4, at_wall=at_wall)[0]
    table, *chairs = template.slots
    assert len(chairs) == (2 if at_wall else 4)
    for chair in chairs:
        edge = table.rect[3] if chair.v > table.v else table.rect[1]
        inner = chair.rect[1] if chair.v > table.v else chair.rect[3]
        assert abs(edge - inner) == pytest.approx(under, abs=0.003)


@pytest.mark.parametrize(("turns", "free"), [(0, 0.15), (1, 0.25), (2, 0.55), (3, 0.35)])
def test_a_chair_stops_at_what_a_table_has_near_that_side(turns: int, free: float) -> None:
    # A top above the chair, and a block below it at other distances from each edge.
    top, block = ((-1.0, 0.7, -0.5), (1.0, 0.75, 0.5)), ((-0.65, 0.0, -0.35), (0.75, 0.7, -0.05))
    table, chair = shape_of(top, block), shape_of(((-0.2, 0.0, -0.2), (0.2, 0.5, 0.2)))
    ways = [way_under_m(chair, table, 0.0, turns, most) for most in (0.05, free + 0.02, 9.0)]
    assert ways == [0.05, ways[2], pytest.approx(free - 0.004, abs=0.005)]
