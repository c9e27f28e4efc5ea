"""What of a home is loose: what stands on something below it, wherever that is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pbrs_farm.core.house import FLOATING, Item
from pbrs_farm.export.home_pieces import exported_home
from tests.inputs.loose_items import loose, small_home


def bookcase() -> Item:
    """Two sides and three boards, 1 m high; its middle board's top is at 0.5."""
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
        (loose("mug", (0.4, 0.505, 0.1), (0.48, 0.6, 0.18)), True),  # on a board amid others
        (turned(loose("book", (0.6, 0.5, 0.05), (0.63, 0.7, 0.2)), 20), True),  # leans
        (loose("box", (0.2, 1.0, 0.16), (0.5, 1.2, 0.42)), True),  # looks over the edge
        (loose("box", (0.2, 1.0, 0.26), (0.5, 1.2, 0.66)), False),  # would fall
        (loose("switch", (0.4, 0.75, 0.1), (0.48, 0.8, 0.12)), False),  # hangs
        # A shelf whose left end alone meets another.
        (loose("shelf", (0.95, 1.0, 0.0), (2.0, 1.02, 0.3)), False),
    ],
)
def test_a_thing_is_loose_where_something_below_bears_it(thing: Item, is_loose: bool) -> None:
    home = exported_home(small_home(bookcase(), thing))
    assert home.pieces[1].is_fixed  # a bookcase stands still
    assert home.pieces[2].is_fixed != is_loose


def test_what_hangs_in_the_air_on_purpose_stays_where_it_is() -> None:
    mug = loose("mug", (0.4, 0.505, 0.1), (0.48, 0.6, 0.18))
    for tags, is_fixed in (((), False), ((FLOATING,), True)):
        home = exported_home(small_home(bookcase(), replace(mug, tags=tags)))
        assert home.pieces[2].is_fixed == is_fixed
