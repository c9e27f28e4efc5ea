"""Keys: built keys are parsed back, and nothing else is."""

from __future__ import annotations

import pytest

from pbrs_farm.core import keys
from pbrs_farm.core.keys import HouseKey


@pytest.mark.parametrize("house", ["studio-0a1b2c3d", "object_chair-1"])
def test_every_key_below_a_house_is_parsed_back(house: str) -> None:
    parse = keys.parse_house_key
    assert parse(keys.house_key(house, "house.glb")) == HouseKey(house, "house.glb")
    file = "behind_glass/depth.png"
    assert parse(keys.view_key(house, "0_0_1", file)) == HouseKey(house, file, "0_0_1")
    assert parse(keys.marker_key(house, "cameras")) == HouseKey(house, step="cameras")
    marker = HouseKey(house, view="0_0_1", step="light")
    assert parse(keys.marker_key(house, "light", "0_0_1")) == marker


@pytest.mark.parametrize(
    "key",
    [
        "",
        "recipe.json",
        "manifest.jsonl",
        "houses/h",
        "houses/h/",
        "houses/h/views/v/",
        "houses/h/views/v",
        "houses/h/done/light.txt",
        "houses/h/other/file.json",
        "houses/object_chair/house.glb",
        "objects/studio/house.glb",
        "selection/histograms/h.bin",
    ],
)
def test_an_unknown_key_below_a_house_is_refused(key: str) -> None:
    assert keys.parse_house_key(key) is None
