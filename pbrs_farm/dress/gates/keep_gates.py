"""Remove added items (and restore replaced ones) that violate the gates of a house, which is changed."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from pbrs_farm.core.catalogue import Piece
from pbrs_farm.core.house import Item
from pbrs_farm.dress.gates.bodies import Body, bodies_of, piece_id
from pbrs_farm.dress.gates.fronts import blocked_fronts
from pbrs_farm.dress.gates.penetration import MOST_M, near_pairs, penetration_m
from pbrs_farm.dress.gates.plumb import Plumb
from pbrs_farm.dress.gates.shells import Solids
from pbrs_farm.dress.gates.support import MOST_M as SUPPORT_M
from pbrs_farm.dress.gates.support import held, held_as_drawn
from pbrs_farm.dress.gates.ways import blocked_doors, closed_ways, covered_windows
from pbrs_farm.dress.mutable_house import MutableHouse
from pbrs_farm.dress.report import Gate
from pbrs_farm.dress.space import HouseSpace, floor_space

_ROUNDS: Final = 12
_LARGE_M: Final = 0.35  # smaller added items off the floor block no way, metres
_ON_FLOOR_M: Final = 0.1
_WAYS: Final = {
    "doors": blocked_doors,
    "windows": covered_windows,
    "path": closed_ways,
    "fronts": blocked_fronts,
}
_NAMES: Final = ("must_haves", "penetration", "support", "doors", "windows", "path", "fronts")
CONTACT: Final = ("penetration", "support")
"""The gates of what touches what: doors, windows and ways are where they were."""
_REASONS: Final = {
    "must_haves": "is no longer what the room had",
    "penetration": "stood in another thing",
    "support": "floated or sank",
    "doors": "stood before a door",
    "windows": "covered a window",
    "path": "closed a way",
    "fronts": "stood before a front",
}


@dataclass(slots=True)
class _Memory:
    """Cached measurements of unchanged items. Items are referenced, so their ids stay unique."""

    bodies: dict[int, Body] = field(default_factory=dict)  # by id of the item
    apart: set[tuple[int, int]] = field(default_factory=set)  # ids of items that share nothing
    supports: dict[int, tuple[int, ...]] = field(default_factory=dict)  # id -> of what holds it
    solids: Solids = field(default_factory=Solids)
    free: dict[str, int] = field(default_factory=dict)  # ways that nothing closes, how many


def keep_gates(
    house: MutableHouse, pieces: Mapping[str, Piece], names: Sequence[str] = _NAMES
) -> tuple[Gate, ...]:
    """Remove items from the house until no gate is violated; returns the gates with their counts.

    Only additions and replacements of dressing are removed: replaced items of the source are restored.
    A removal may leave others without support, so all are measured again, in at most 12 rounds.
    pieces: the catalogue's and generated ones by id, which define the kind of support. names: of the
    gates to check. Measurements of unchanged items are reused between calls.
    """
    memory = house.kept.get("gates")
    if not isinstance(memory, _Memory):
        memory = house.kept["gates"] = _Memory()
    memory.free.clear()
    taken: Counter[str] = Counter()
    for _round in range(_ROUNDS):
        checked, broken = _measure_gates(house, pieces, memory, names)
        out: dict[int, str] = {}
        for name in names:
            for index in broken[name]:
                out.setdefault(index, name)
        if not out:
            break
        taken.update(out.values())
        _take_out(house, out)
    else:
        checked, broken = _measure_gates(house, pieces, memory, names)
    return tuple(
        Gate(name=n, n_checked=checked[n], n_taken_out=taken[n], n_left=len(broken[n]))
        for n in names
    )


def _measure_gates(
    house: MutableHouse, pieces: Mapping[str, Piece], memory: _Memory, names: Sequence[str]
) -> tuple[dict[str, int], dict[str, list[int]]]:
    """Gate -> how much was measured, and gate -> indices of the items that break it."""
    bodies = _bodies(house, pieces, memory)
    checked, broken = dict.fromkeys(_NAMES, 0), {name: list[int]() for name in _NAMES}
    checked["must_haves"], broken["must_haves"] = _changed_class(house)
    if not any(body.is_new for body in bodies):
        return checked, broken
    # Of two overlapping items the later one is removed.
    for i, j in near_pairs(bodies):
        checked["penetration"] += 1
        if not _are_apart(bodies[i], bodies[j], memory):
            broken["penetration"].append(bodies[j if bodies[j].is_new else i].index)
    checked["support"], broken["support"] = _unsupported(bodies, memory)
    # Free ways stay free when items are removed.
    ways = {name: gate for name, gate in _WAYS.items() if name in names}
    if any(name not in memory.free for name in ways):
        space, large = _space(house, bodies)
        for name, gate in ways.items():
            n, bodies_found = gate(space, large)
            checked[name], broken[name] = n, sorted({b.index for b in bodies_found})
            if not bodies_found:
                memory.free[name] = n
    return checked | memory.free, broken


def _space(house: MutableHouse, bodies: list[Body]) -> tuple[HouseSpace, list[Body]]:
    """The space of the house without small items, which block no way, and its bodies in that order."""
    floors = np.array([room.floor_y for room in house.source.rooms] or [0.0])
    large = [
        b
        for b in bodies
        if not b.is_new
        or float((b.high - b.low).max()) > _LARGE_M
        or float(np.abs(floors - b.low[1]).min()) < _ON_FLOOR_M
    ]
    some = copy(house)
    some.items = [b.item for b in large]
    return floor_space(some), large


def _bodies(house: MutableHouse, pieces: Mapping[str, Piece], memory: _Memory) -> list[Body]:
    """The house's bodies, with cached shells."""
    fresh = bodies_of(house, pieces, memory.bodies)
    memory.bodies |= {id(b.item): b for b in fresh}
    return fresh


def _are_apart(a: Body, b: Body, memory: _Memory) -> bool:
    key = (id(a.item), id(b.item))
    if key not in memory.apart:
        if penetration_m(a, b, memory.solids) > MOST_M:
            return False
        memory.apart.add(key)
    return True


def _unsupported(bodies: list[Body], memory: _Memory) -> tuple[int, list[int]]:
    """Number of added bodies, and indices of those without support."""
    present = {id(b.item) for b in bodies}
    new = [k for k, b in enumerate(bodies) if b.is_new]
    # Measure new bodies, and those that lost all their supports.
    unsettled = [
        k for k in new if not present.intersection(memory.supports.get(id(bodies[k].item), ()))
    ]
    if not unsettled:
        return len(new), []
    plumb = Plumb(bodies, unsettled)
    supports = held(bodies, unsettled, plumb)
    for number, by in supports.items():
        memory.supports[id(bodies[number].item)] = tuple(id(bodies[b].item) for b in by.by)
    bad = [k for k, by in supports.items() if not by.is_good]
    # A replacement may have the same gap to its support as the original.
    return len(new), [
        bodies[k].index
        for k in bad
        if bodies[k].was is None
        or abs(supports[k].gap_m) > abs(held_as_drawn(bodies, k, plumb).gap_m) + SUPPORT_M
    ]


def _changed_class(house: MutableHouse) -> tuple[int, list[int]]:
    """Number of items of the source, and those whose class has changed."""
    was = house.source.items
    return len(was), [
        k for k, (a, b) in enumerate(zip(was, house.items, strict=False)) if a.nyu40 != b.nyu40
    ]


def _take_out(house: MutableHouse, out: Mapping[int, str]) -> None:
    """Take items out of the house, or put those of the source back; count why."""
    n_source = len(house.source.items)
    for index, name in out.items():
        item = house.items[index]
        house.refused[
            f"{pass_that_added(item) if index >= n_source else 'swap'}: {_REASONS[name]}"
        ] += 1
        if index < n_source:
            house.items[index] = house.source.items[index]
    house.items = [x for k, x in enumerate(house.items) if k < n_source or k not in out]


def pass_that_added(item: Item) -> str:
    """The pass in an added item's id `dress-<pass>-<n>`, else "dress"."""
    words = item.id.split("-")
    return words[1] if len(words) > 2 and words[0] == "dress" else "dress"


def group_of(item: Item, pieces: Mapping[str, Piece]) -> str:
    """Catalogue group of an added item."""
    name = piece_id(item)
    piece = pieces.get(name)
    return piece.group if piece is not None else name.rpartition("#")[2]
