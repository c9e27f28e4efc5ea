"""Custom furniture: racks for one plant, of wood or metal, some with a pot on top.

pbrs-farm run Studio --dress 3 --catalogue generated --out out/racks
"""

from __future__ import annotations

from itertools import product

from pbrs_farm.plugin import OTHERFURNITURE, Maker, Place, Size, bevelled, family, tube, vessel


@family(
    group="plant_stand", nyu40=OTHERFURNITURE, place=Place.FLOOR, variants=12,
    size=lambda m: (m.uniform(0.26, 0.4), m.uniform(0.26, 0.4), m.uniform(0.5, 0.8)),
)  # fmt: skip
def plant_stand(m: Maker, size: Size) -> None:
    """Four legs that lean outwards, a board on them; two thirds carry a pot."""
    w, d, h = size
    pot_h = min(0.35 * h, 0.5 * min(w, d)) if m.chance(0.67) else 0.0
    top = h - pot_h
    with m.of(m.timber if m.chance(0.6) else m.metal):
        m.add(bevelled((-w / 2, top - 0.02, -d / 2), (w / 2, top, d / 2)))
        for x, z in product((-1, 1), (-1, 1)):
            foot = (x * (w / 2 - 0.01), 0.0, z * (d / 2 - 0.01))
            m.add(tube([foot, (x * w / 3, top - 0.015, z * d / 3)], 0.01))
    if pot_h:
        r = 0.4 * min(w, d)
        m.add(vessel([(0, top), (0.8 * r, top), (r, h)], 0.006), of=m.china())
