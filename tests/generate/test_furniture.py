"""Front and corners of a placed piece."""

import math

import pytest

from pbrs_farm.core.catalogue import Piece, Place
from pbrs_farm.generate.floor_plan import PlacedPiece

_SOFA = Piece("x#sofa", "Sofa", "sofa", Place.FLOOR, 6, (2.0, 1.0, 0.8))


def _placed(angle: float) -> PlacedPiece:
    return PlacedPiece(_SOFA, 3.0, 4.0, 0.0, angle, 2.0, 1.0, 0.8, room=0)


def test_a_piece_that_is_not_turned_looks_down_the_page() -> None:
    assert _placed(0.0).front == pytest.approx((0, 1))
    assert _placed(0.0).corners[0] == pytest.approx((2.0, 3.5))


def test_a_quarter_turn_clockwise_makes_it_look_to_the_left() -> None:
    placed = _placed(math.pi / 2)
    assert placed.front == pytest.approx((-1, 0))
    # Its back left corner is now on the page's right side.
    assert placed.corners[0] == pytest.approx((3.5, 3.0))
