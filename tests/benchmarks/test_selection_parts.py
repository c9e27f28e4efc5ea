"""The parts of the bench of selection, small."""

from __future__ import annotations

from benchmarks.selection import time_one_house


def test_the_selection_of_a_house_of_one_view_is_timed() -> None:
    assert time_one_house(n_views=1) > 0
