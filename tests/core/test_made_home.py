"""Words of made homes."""

from __future__ import annotations

import pytest

from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.made_home import MadeHome, made_homes
from pbrs_farm.prepare.source import words_of_homes


def test_a_range_names_one_home_per_seed() -> None:
    words = words_of_homes(["builtin", "made:3..5,rooms=2..3"])
    assert words == ["builtin", *(f"made:{k},rooms=2..3" for k in (3, 4, 5))]


def test_a_word_defines_its_home_completely() -> None:
    home = MadeHome(
        7, (2, 3), (90, 110), "nordic", furniture=False, storeys=2, plans="us", offices=1
    )
    assert made_homes(home.word) == [home]
    assert home.digest != MadeHome(7).digest


@pytest.mark.parametrize(
    ("word", "part"),
    [
        ("made:", "neither a number nor a range"),
        ("made:x", "neither a number nor a range"),
        ("made:9..3", "downwards"),
        ("made:99999999999", "above 2147483647"),
        ("made:1,rooms=5", "above 4"),
        ("made:1,walls=3", "not an option"),
        ("made:1,storeys=3", "one storey or two"),
        ("made:1,plans=castle", "no such family of plans.*alpine"),
        ("made:1,storeys=2,rooms=1", "2 to 4 bedrooms"),
        (
            "made:1,offices=2,rooms=1..2",
            "offices: 2 of 2 bedrooms: .*one bedroom must stay.*rooms=3..4",
        ),
        ("made:1,offices=4", "one bedroom must stay"),
        ("made:1,offices=3,area=20..40", "homes of 4 bedrooms have 76 to 180 m2"),
        ("made:1,offices=x", "neither a number nor a range"),
        ("made:1,offices=0..2", "offices=0..2: is a range, expected a number"),
        ("made:1,storeys=1..2", "storeys=1..2: is a range, expected a number"),
        ("made:1..2000000", "at most"),
    ],
)
def test_a_word_that_names_no_home_is_refused_with_the_nearest(word: str, part: str) -> None:
    with pytest.raises(BadInput, match=part):
        made_homes(word)
