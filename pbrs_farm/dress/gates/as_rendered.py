"""Gates after repair: items whose wall was removed move to the next wall, or are removed.

No effects. Repair drops and moves walls: where rooms overlap, or a wall is duplicated. Items hung on
such a wall would float in front of the remaining one, or be inside it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import replace
from typing import Final

import numpy as np

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.catalogue import Piece, Place
from pbrs_farm.core.house import House, Item, ItemKind
from pbrs_farm.core.mesh import boxes_meeting
from pbrs_farm.dress.gates.bodies import Body, bodies_of, boxes_of
from pbrs_farm.dress.gates.keep_gates import CONTACT, keep_gates
from pbrs_farm.dress.gates.penetration import MOST_M, near_pairs, penetration_m
from pbrs_farm.dress.gates.plumb import Plumb
from pbrs_farm.dress.gates.shells import Solids
from pbrs_farm.dress.gates.support import held
from pbrs_farm.dress.mutable_house import MutableHouse, moved_item
from pbrs_farm.dress.report import DressReport
from pbrs_farm.dress.walls.hanging import GAP_M
from pbrs_farm.geometry.heights import highest_below

_REACH_M: Final = 0.12  # maximum distance that a hung item is moved to another wall, metres
_BACK_M: Final = 0.003  # depth of the layer at an item's back that counts as touching, metres
_MOST_POINTS: Final = 200
_FLAT_M: Final = 0.0015  # greatest difference among a back's distances to a wall
_SEES_WALL: Final = 0.95  # share of a back that must have the wall behind it


def refit_to_walls(
    dressed: House, n_source: int, repaired: House, report: DressReport, pieces: Mapping[str, Piece]
) -> tuple[House, DressReport]:
    """The dressed house without items that have no support in the repaired one, and its report.

    Returns the same objects if everything is supported. Items hung on a wall that repair moved are
    moved to the remaining wall, if it is within 12 cm. n_source: number of items before dressing.
    pieces: of the added items, by id.
    """
    added_ids = {i.id for i in dressed.items[n_source:] if not i.kind.is_structure}
    added = [item for item in repaired.items if item.id in added_ids]
    base = repaired.with_items(item for item in repaired.items if item.id not in added_ids)
    with closing(MutableHouse(base, report.seed)) as house:
        house.items += added
        bodies = bodies_of(house, pieces)
        if _is_held(bodies):
            return dressed, report
        moved = _hung_anew(house, bodies)
        gates = {gate.name: gate for gate in keep_gates(house, pieces, CONTACT)}
        remaining_ids = {item.id for item in house.items[len(base.items) :]}
        out, why = {item.id for item in added} - remaining_ids, house.refused
    if not out and not moved:
        return dressed, report
    items = [
        moved_item(item, moved[item.id]) if item.id in moved else item
        for item in dressed.items
        if item.id not in out
    ]
    taken = {name: gate.n_taken_out for name, gate in gates.items()}
    refused = dict(report.refused)
    for reason, n in why.items():
        refused[f"{reason} after repair"] = refused.get(f"{reason} after repair", 0) + n
    new_report = report.model_copy(
        update={
            "refused": dict(sorted(refused.items())),
            "moved_after_repair": report.moved_after_repair + len(moved),
            "gates": tuple(
                g.model_copy(update={"n_taken_out": g.n_taken_out + taken.get(g.name, 0)})
                for g in report.gates
            ),
        }
    )
    return replace(dressed, items=tuple(items)), new_report


def _is_held(bodies: Sequence[Body]) -> bool:
    """True if hung items touch their support and no wall penetrates an added item; repair moves neither."""
    hung = [k for k, b in enumerate(bodies) if b.is_new and _hangs(b)]
    plumb = Plumb(bodies, hung)
    if not all(by.is_good for by in held(bodies, hung, plumb).values()):
        return False
    solids = Solids()
    return not any(
        penetration_m(bodies[i], bodies[j], solids) > MOST_M
        for i, j in near_pairs(bodies)
        if ItemKind.WALL in (bodies[i].item.kind, bodies[j].item.kind)
    )


def _hangs(body: Body) -> bool:
    return body.piece is not None and body.piece.place in (Place.WALL, Place.CEILING)


def _hung_anew(house: MutableHouse, bodies: Sequence[Body]) -> dict[str, F64]:
    """Move hung items without support to a wall, in place; returns the offsets by id."""
    walls = [b for b in bodies if b.item.kind is ItemKind.WALL]
    hung = [k for k, b in enumerate(bodies) if b.is_new and _hangs(b)]
    moved: dict[str, F64] = {}
    for k, by in held(bodies, hung, Plumb(bodies, hung)).items():
        item, piece = bodies[k].item, bodies[k].piece
        if by.is_good or item.box is None or piece is None or piece.place is not Place.WALL:
            continue
        step = _to_wall(item, walls)
        if step is not None:
            moved[item.id] = step
            house.items[bodies[k].index] = moved_item(item, step)
    return moved


def _to_wall(item: Item, walls: Sequence[Body]) -> F64 | None:
    """(3,) offset in metres that brings an item's back to the wall behind it; None without a wall."""
    assert item.box is not None
    right, front = item.box.axes[:, 0], item.box.axes[:, 2]
    # Lay the item on its back: the wall is then below it.
    turn = np.stack([right, front, np.cross(right, front)])
    low, high = item.bounds
    lows, highs = boxes_of(walls)
    near = np.flatnonzero(boxes_meeting(lows, highs, low - _REACH_M, high + _REACH_M))
    if not len(near):
        return None
    corners = np.concatenate([walls[k].corners for k in near.tolist()]) @ turn.T
    points = np.concatenate([s.positions for s in item.surfaces]).astype(np.float64) @ turn.T
    back = points[points[:, 1] < points[:, 1].min() + _BACK_M]
    back = back[:: max(1, len(back) // _MOST_POINTS)]
    wall = highest_below(back[:, [0, 2]], corners, back[:, 1] + _REACH_M)
    gaps = back[:, 1] - wall
    gaps = gaps[gaps < _REACH_M]
    if len(gaps) < _SEES_WALL * len(back) or float(np.ptp(gaps)) > _FLAT_M + _BACK_M:
        return None
    return np.asarray(-(float(gaps.min()) - GAP_M) * front)
