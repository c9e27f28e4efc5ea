"""The types of a house as text."""

from __future__ import annotations

from pbrs_farm.core.house import Texture, geometry_from_house
from pbrs_farm.read.builtin.builtin_home import builtin_home


def test_a_house_and_its_parts_describe_themselves_in_a_line() -> None:
    house = builtin_home()
    item = next(item for item in house.items if item.surfaces)
    texture = Texture("0f", "oak", "image/png", bytes(40_000))
    geometry = geometry_from_house(house)
    for noun in (house, item, item.surfaces[0], geometry, texture):
        assert len(repr(noun)) < 200, type(noun)
    assert repr(house).startswith(f"House('{house.id}', {len(house.rooms)} rooms, ")
    assert f"{len(geometry.faces):,} triangles" in repr(house)
    assert repr(texture) == "Texture('0f', 'oak', image/png, 40,000 bytes)"
    assert all(len(repr(opening)) < 2000 for opening in house.openings)
