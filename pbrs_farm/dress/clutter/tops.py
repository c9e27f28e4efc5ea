"""What stands on tables, desks, counters, chests: by the table of shares, greatest first."""

from __future__ import annotations

import numpy as np

from pbrs_farm.dress.clutter.kinds import is_round
from pbrs_farm.dress.clutter.placing import Placing
from pbrs_farm.dress.clutter.receptacles import shares, usual_area
from pbrs_farm.dress.clutter.worktop import Worktop
from pbrs_farm.dress.generated.made import Made

_MOST_OF_A_KIND = 3
_ANOTHER = 0.35  # chance of one more of the kind
_FULL = 0.45  # no more is put where less than this share of the surface is free
_MOST_FACTOR = 1.6

# Kinds that are drawn to the front: hands reach for them.
_IN_FRONT = ("laptop", "papers", "notebook", "remote", "phone", "plates", "cutlery", "glass", "cup")


def fill_top(placing: Placing, top: Worktop, receptacle: str) -> int:
    """Put things on the worktop as the table says; how many were put there."""
    rng = placing.rng
    factor = min(top.support.area / usual_area(receptacle), _MOST_FACTOR)
    wanted: list[str] = []
    for row in shares().get(receptacle, ()):
        chance = np.clip((row.share + placing.bias * row.share**0.5) * factor, 0, 0.98)
        n = 0
        while n < _MOST_OF_A_KIND and rng.random() < chance * placing.share:
            n, chance = n + 1, _ANOTHER * chance
        wanted += [row.kind] * n
    return put_all(placing, top, wanted)


def put_all(placing: Placing, top: Worktop, kinds: list[str]) -> int:
    """Put a thing of each of the kinds on the worktop, the largest first."""
    things: list[tuple[str, Made]] = []
    for kind in kinds:
        made = placing.stock.take(placing.rng, kind, placing.style)
        if made is None:
            placing.refuse(f"no {kind} in the catalogue")
        else:
            things.append((kind, made))
    things.sort(key=lambda thing: -thing[1][0].size[0] * thing[1][0].size[1])
    n = 0
    for kind, made in things:
        if top.free_share() < _FULL and n:
            placing.refuse("surface full")
            continue
        pull = -3.0 if kind in _IN_FRONT else 5.0 + 12.0 * made[0].size[2]
        n += placing.drop(top, made, faces_anywhere=is_round(kind), depth_pull=pull)
    return n
