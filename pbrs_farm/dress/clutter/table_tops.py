"""Put items on tables, desks, counters and chests by the table of shares, the largest first. Effects: changes the house."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np

from pbrs_farm.core.arrays import F64
from pbrs_farm.dress.clutter.cloths import drop_clothes
from pbrs_farm.dress.clutter.placing import Placing, take_for_room
from pbrs_farm.dress.clutter.receptacles import shares
from pbrs_farm.dress.clutter.stock import CLUTTER, is_round
from pbrs_farm.dress.models import Model
from pbrs_farm.dress.worktop import Worktop
from pbrs_farm.geometry.scene_triangles import SceneTriangles

_MOST_OF_A_KIND = 3  # on one surface
_ANOTHER = 0.35  # factor on the chance of one more of the same kind
_FULL = 0.45  # no more is put where less than this share of the surface is free
_MOST_FACTOR = 1.6
_LEFT_M, _NAPKINS, _NAPKIN_M = 0.025, 0.6, 0.12  # after a meal: how far aside; napkins
_CHAIR_M = 0.6  # a chair's middle is this near to the table it belongs to

_USUAL_M2 = 0.4  # usual area of receptacles that clutter.toml does not name


def fill_top(placing: Placing, top: Worktop, receptacle: str, present: Collection[str] = ()) -> int:
    """Put items by the table of shares, beside kinds already present; their number."""
    rng = placing.rng
    factor = min(top.support.area / CLUTTER.usual_m2.get(receptacle, _USUAL_M2), _MOST_FACTOR)
    kinds: list[str] = []
    most = CLUTTER.most_on_one | dict.fromkeys(present, 0)
    for row in shares().get(receptacle, ()):
        chance = np.clip((row.share + placing.bias * row.share**0.5) * factor, 0, 0.98)
        remaining = most.get(row.kind, _MOST_OF_A_KIND) - kinds.count(row.kind)
        while remaining > 0 and rng.random() < chance * placing.share:
            kinds.append(row.kind)
            remaining, chance = remaining - 1, _ANOTHER * chance
    return put_all(placing, top, kinds)


def set_table(placing: Placing, top: Worktop, chairs: Sequence[F64], scene: SceneTriangles) -> int:
    """Lay plate and glass for each chair (2,), or, displaced and with a napkin, after a meal; their number."""
    rng, is_eaten = placing.rng, placing.rng.random() < placing.house.mess
    plate = placing.stock.take(placing.rng, "one_plate", placing.style)
    glass = placing.stock.take(placing.rng, "glass", placing.style)
    if plate is None or glass is None:
        return 0
    rows, columns = np.nonzero(top.support.mask)
    cells = top.grid.plan_of(columns + 0.5, rows + 0.5)
    middle, n = cells.mean(0), 0
    for chair in chairs:
        # Move inwards from the table's edge nearest to the chair.
        edge = cells[int(np.argmin(((cells - chair) ** 2).sum(1)))]
        inward = middle - edge
        if np.linalg.norm(chair - edge) > _CHAIR_M or np.linalg.norm(inward) < 0.2:
            continue
        inward = inward / np.linalg.norm(inward)
        right = np.array([-inward[1], inward[0]])
        position = edge + inward * (plate[0].size[0] / 2 + 0.03)
        aside = rng.normal(0, _LEFT_M, (2, 2)) if is_eaten else np.zeros((2, 2))
        turned = float(rng.normal(0, 0.6)) if is_eaten else 0.0
        n += placing.drop_near(top, plate, position + aside[0], turn_rad=turned)
        n += placing.drop_near(top, glass, position + inward * 0.1 + right * 0.17 + aside[1])
        if is_eaten and rng.random() < _NAPKINS:
            place = position - right * 0.22 + inward * 0.02
            if top.is_free(place, _NAPKIN_M):
                drop_clothes(placing, scene, place, top.height, napkin=True)
                n += 1
    return n


def put_all(placing: Placing, top: Worktop, kinds: list[str]) -> int:
    """Put an item of each kind, the largest first, or count why not; their number."""
    things: list[tuple[str, Model]] = []
    for kind in kinds:
        model = take_for_room(placing, kind)
        if model is not None:
            things.append((kind, model))
    things.sort(key=lambda thing: -thing[1][0].size[0] * thing[1][0].size[1])
    n = 0
    for kind, model in things:
        if top.free_share() < _FULL and n:
            placing.refuse("surface full")
            continue
        pull = -3.0 if kind in CLUTTER.in_front else 5.0 + 12.0 * model[0].size[2]
        n += placing.drop(top, model, faces_anywhere=is_round(kind), depth_pull=pull)
    return n
