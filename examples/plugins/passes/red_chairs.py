"""A custom pass of dressing: chairs in red lacquer.

pbrs-farm run Studio --dress 3 --set dress.passes=red_chairs --out out/red
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from pbrs_farm.plugin import NYU40_NAMES, Material

_CHAIR = NYU40_NAMES.index("chair")


def red_chairs(house: Any, _catalogue: Any, _style: Any, _share: float) -> None:
    """Change a pbrs_farm.dress.mutable_house.MutableHouse: items, materials, its streams of random numbers."""
    shade = house.rng("red_chairs").uniform(0.45, 0.75)
    red = house.material(Material("red lacquer", diffuse=(float(shade), 0.04, 0.04), roughness=0.3))
    for number, item in enumerate(house.items):
        if item.nyu40 == _CHAIR:
            painted = tuple(replace(surface, material=red) for surface in item.surfaces)
            house.change(number, replace(item, surfaces=painted), "red_chairs")
