"""What stands on tables, desks, counters, chests: by the table of shares, greatest first."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pbrs_farm.core.arrays import F64
from pbrs_farm.dress.clutter.kinds import is_round
from pbrs_farm.dress.clutter.placing import Placing
from pbrs_farm.dress.clutter.receptacles import shares, usual_area
from pbrs_farm.dress.clutter.worktop import Worktop
from pbrs_farm.dress.generated.assembly import Made

_MOST_OF_A_KIND = 3
_ANOTHER = 0.35  # chance of one more of the kind
_FULL = 0.45  # no more is put where less than this share of the surface is free
_MOST_FACTOR = 1.6
_CHAIR_M = 0.6  # from a chair's middle to the table it belongs to

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


def set_table(placing: Placing, top: Worktop, chairs: Sequence[F64]) -> int:
    """Lay a place before each chair (plan points (2,)): a plate, a glass to its right; how many."""
    plate = placing.stock.take(placing.rng, "one_plate", placing.style)
    glass = placing.stock.take(placing.rng, "glass", placing.style)
    if plate is None or glass is None:
        return 0
    rows, columns = np.nonzero(top.support.mask)
    cells = top.grid.plan_of(columns + 0.5, rows + 0.5)
    middle, n = cells.mean(0), 0
    for chair in chairs:
        # Go in from the table's edge that is nearest to the chair.
        edge = cells[int(np.argmin(((cells - chair) ** 2).sum(1)))]
        inward = middle - edge
        if np.linalg.norm(chair - edge) > _CHAIR_M or np.linalg.norm(inward) < 0.2:
            continue
        inward = inward / np.linalg.norm(inward)
        right = np.array([-inward[1], inward[0]])
        at = edge + inward * (plate[0].size[0] / 2 + 0.03)
        n += placing.drop_near(top, plate, at)
        n += placing.drop_near(top, glass, at + inward * 0.1 + right * 0.17)
    return n


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
