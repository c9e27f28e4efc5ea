"""Loose parts of a home: items with a support below, of any kind."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pbrs_farm.core.house import FLOATING, Item
from pbrs_farm.export.home_pieces import exported_home
from tests.inputs.loose_items import loose, small_home


def bookcase() -> Item:
    """A bookcase of two sides and three boards, 1 m high; the top of its middle board is at 0.5."""
    boards = (
        loose("left", (0, 0, 0), (0.02, 1, 0.3)), loose("right", (0.98, 0, 0), (1, 1, 0.3)),
        *(loose(f"board {y}", (0.02, y - 0.02, 0), (0.98, y, 0.3)) for y in (0.1, 0.5, 1.0)),
    )  # fmt: skip
    item = loose("bookcase", (0, 0, 0), (1, 1, 0.3))
    return replace(item, surfaces=tuple(s for b in boards for s in b.surfaces), nyu40=10)


def turned(item: Item, degrees: float) -> Item:
    """The item turned about its lower left edge."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    (surface,) = item.surfaces
    low = item.bounds[0]
    points = (surface.positions - low) @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]) + low
    points[:, 1] += low[1] - points[:, 1].min()
    return replace(item, surfaces=(replace(surface, positions=points.astype(np.float32)),))


@pytest.mark.parametrize(
    ("thing", "is_loose"),
    [
        (loose("mug", (0.4, 0.505, 0.1), (0.48, 0.6, 0.18)), True),  # on a board between others
        (turned(loose("book", (0.6, 0.5, 0.05), (0.63, 0.7, 0.2)), 20), True),  # leans
        (loose("box", (0.2, 1.0, 0.16), (0.5, 1.2, 0.42)), True),  # overhangs the edge
        (loose("box", (0.2, 1.0, 0.26), (0.5, 1.2, 0.66)), False),  # would fall
        (loose("switch", (0.4, 0.75, 0.1), (0.48, 0.8, 0.12)), False),  # hangs on a wall
        # A shelf of which only the left end touches another.
        (loose("shelf", (0.95, 1.0, 0.0), (2.0, 1.02, 0.3)), False),
    ],
)
def test_an_item_is_loose_if_something_below_supports_it(thing: Item, is_loose: bool) -> None:
    home = exported_home(small_home(bookcase(), thing))
    assert home.pieces[1].is_fixed  # a bookcase is fixed
    assert home.pieces[2].is_fixed != is_loose


def test_the_contents_of_a_wall_cupboard_are_no_support() -> None:
    cupboard = loose("cupboard", (0, 1.5, 0), (0.6, 1.516, 0.3))
    mug = loose("mug", (0.2, 1.516, 0.1), (0.4, 1.6, 0.2))
    _floor, on_wall, inside = exported_home(small_home(cupboard, mug)).pieces
    assert on_wall.is_fixed
    assert not inside.is_fixed


def test_deliberately_floating_items_stay_in_place() -> None:
    mug = loose("mug", (0.4, 0.505, 0.1), (0.48, 0.6, 0.18))
    for tags, is_fixed in (((), False), ((FLOATING,), True)):
        home = exported_home(small_home(bookcase(), replace(mug, tags=tags)))
        assert home.pieces[2].is_fixed == is_fixed
