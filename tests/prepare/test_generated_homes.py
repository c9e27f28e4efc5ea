"""`run made:1..2`: homes by seed go through the ordinary steps."""

from __future__ import annotations

import pytest

from pbrs_farm.core.recipe import Recipe
from pbrs_farm.prepare.finished_house import repaired_house
from pbrs_farm.prepare.read_source import read_house
from pbrs_farm.prepare.source import resolve, variants

BARE = ",furniture=none"  # works without the package


def test_the_house_of_a_seed_has_the_id_its_word_gave() -> None:
    source = resolve(f"made:5{BARE}")
    house = read_house(source, Recipe().read)
    assert house.id == source.house_id
    assert house.id.startswith("made-5-")
    assert house.source.kind == "made"
    assert "pbrs_farm" in house.source.attribution


def test_a_dressed_home_whose_digest_begins_with_a_d_keeps_its_id() -> None:
    # Ids of dressed homes end in -d<seed>.
    words = (f"made:{seed}{BARE}" for seed in range(1, 200))
    source = next(s for s in map(resolve, words) if "-d" in s.house_id)
    for entry in (source, *variants(source, [3])):
        assert read_house(entry, Recipe().read).id == source.house_id


@pytest.mark.long
def test_a_made_home_is_repaired_without_leaks() -> None:
    _house, report = repaired_house(resolve(f"made:5{BARE}"), Recipe())
    assert report.leaks is not None
    assert report.leaks.n_sky == 0


def test_two_seeds_are_two_houses() -> None:
    assert resolve(f"made:1{BARE}").house_id != resolve(f"made:2{BARE}").house_id
