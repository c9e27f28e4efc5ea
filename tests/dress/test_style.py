"""The style of a home."""

import numpy as np
import pytest

from pbrs_farm.core.errors import BadRecipe
from pbrs_farm.dress.style import STYLES, room_style, style_for


@pytest.mark.parametrize("name", STYLES)
def test_every_style_is_available_and_has_colours_between_0_and_1(name: str) -> None:
    style = style_for(np.random.default_rng(1), name)
    assert style.name == name
    colours = [*style.palette, *style.textiles, style.accent, style.wood.mean, style.metal.colour]
    assert all(0.0 <= c <= 1.0 for colour in colours for c in colour)


def test_the_same_seed_gives_the_same_style() -> None:
    assert style_for(np.random.default_rng(4)) == style_for(np.random.default_rng(4))


def test_many_seeds_meet_every_style() -> None:
    assert {style_for(np.random.default_rng(n)).name for n in range(200)} == set(STYLES)


def test_a_fifth_of_the_rooms_has_another_taste_and_the_homes_wood() -> None:
    home = style_for(np.random.default_rng(0), "nordic")
    rooms = [room_style(home, np.random.default_rng(n)) for n in range(500)]
    assert 0.12 < np.mean([r.name != home.name for r in rooms]) < 0.26
    assert {r.wood for r in rooms} == {home.wood}


def test_an_unknown_style_is_refused_in_one_line() -> None:
    with pytest.raises(BadRecipe, match="style: gothic: no such style"):
        style_for(np.random.default_rng(0), "gothic")
