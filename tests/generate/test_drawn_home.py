"""Furnished homes by seed."""

from __future__ import annotations

import numpy as np
import pytest

from pbrs_farm.generate.drawn_home import drawn_home
from pbrs_farm.generate.programme import Wishes
from tests.generate.furnish.shelves import plain_catalogue


@pytest.mark.parametrize("seed", [9, 12, 29])
def test_a_drawn_home_breaks_no_gate(seed: int) -> None:
    home = drawn_home(np.random.default_rng(seed), plain_catalogue())
    assert home.broken == ()


def test_the_same_seed_gives_the_same_home() -> None:
    wishes = Wishes((0, 1))
    first = drawn_home(np.random.default_rng(4), plain_catalogue(), wishes=wishes)
    assert drawn_home(np.random.default_rng(4), plain_catalogue(), wishes=wishes) == first
