"""Replace kitchen boxes by runs of matching units: cabinets, sink, cooker, wall cabinets; no effects.

A source gives "a kitchen, 3.2 m by 0.6 m" or "a counter", and the place of a sink in it. The result is a
row of units under one worktop. A box deeper than a unit becomes an L or a U along the walls that it
touches, or an island of two rows.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from shapely.geometry import Point

from pbrs_farm.core import keys
from pbrs_farm.core.arrays import F64
from pbrs_farm.core.catalogue import Catalogue, Piece
from pbrs_farm.core.classes import CABINET, COUNTER, SINK
from pbrs_farm.core.house import Box, Item
from pbrs_farm.home.names import words_of_item

MODULE_M: Final = 0.6  # width of a standard unit
_NARROWEST_M: Final = 0.28  # minimum width of a unit; a smaller rest goes to its neighbour
_DEPTH_M: Final = 0.62  # depth of a run along a wall, for deeper boxes
_DEPTHS_M: Final = (0.4, 0.96)  # depth of boxes that become one run
_TOPS_M: Final = (0.7, 1.1)  # a worktop's height above the floor
_FOOT_M: Final = 0.35  # maximum bottom height of a box on the floor
_HUNG_M: Final = 1.2  # minimum bottom height of a wall cabinet
_HUNG_HEIGHTS_M: Final = (0.3, 1.1)
_HUNG_DEPTH_M: Final = 0.5
_AT_WALL_M: Final = 0.2
_ASIDE_M: Final = 0.1  # maximum offset of a unit's centre from the run (accuracy of scans)
_STANDS_OVER_M: Final = (
    0.4  # maximum height of a sink's or hob's centre above the worktop; higher is a hood
)
_SINK_M: Final = 0.8
_COUNTERS: Final = frozenset({"kitchen", "counter", "countertop", "worktop", "island"})
_COOKERS: Final = frozenset({"stove", "cooker", "hob", "cooktop", "stovetop", "range", "oven"})
_OTHERS: Final = frozenset({"hood", "microwave"})
_BUILT_IN: Final = frozenset({"washing", "washer", "fridge", "refrigerator", "freezer", "dryer"})


class Unit(NamedTuple):
    """A piece of a run and its box, aligned at their backs."""

    piece: Piece
    box: Box
    scale: F64  # (3,) along the piece's width, height, depth
    is_invented: bool = False  # not in the source, added because the room is a kitchen


class _Set(NamedTuple):
    bases: tuple[Piece, ...]
    sink: Piece
    cooker: Piece
    dishwashers: tuple[Piece, ...]
    uppers: tuple[Piece, ...]

    @property
    def top(self) -> float:
        return self.bases[0].size[2]


@dataclass(slots=True)
class _Run:
    """A row of units in its local frame: along x from 0 to length, facing z."""

    item: Item
    origin: F64  # its left back lower corner, world
    right: F64
    front: F64
    length: float
    depth: float
    height: float
    is_hung: bool

    def along(self, item: Item) -> float | None:
        """Coordinate along the run of another box's centre; None if the box is elsewhere."""
        assert item.box is not None
        away = item.box.centre - self.origin
        x, z = float(away @ self.right), float(away @ self.front)
        is_along = -_ASIDE_M <= x <= self.length + _ASIDE_M
        is_across = -_ASIDE_M <= z <= self.depth + _ASIDE_M
        is_on_it = float(away[1]) < self.height + _STANDS_OVER_M
        return x if is_along and is_across and is_on_it else None

    def box(self, low: float, high: float) -> Box:
        """The box of a unit between two places along it."""
        up = np.array([0.0, 1.0, 0.0])
        middle = self.right * (low + high) / 2 + self.front * self.depth / 2 + up * self.height / 2
        half = np.array([high - low, self.height, self.depth]) / 2
        return Box(self.origin + middle, half, np.stack([self.right, up, self.front], 1))


class _Module(NamedTuple):
    """A section of a run: a unit for an item, or a gap for an appliance."""

    low: float
    high: float
    kind: str  # "base", "sink", "cooker", "gap"
    item: Item | None = None  # the item it replaces; None = a unit of the run itself
    absorbed: tuple[str, ...] = ()  # ids of the other items in it


def kitchen_units(
    items: Sequence[Item],
    floor_y: float,
    catalogue: Catalogue,
    house_id: str,
    *,
    is_kitchen: bool,
    distance_to_wall: Callable[[Point], float],
    choose_front: Callable[[Sequence[Box]], int],
) -> Mapping[str, list[Unit]]:
    """Units for a room's counters, by the id of the box-only item that they replace.

    items: the room's box-only items. is_kitchen: cabinets are kitchen cabinets. choose_front: index of the
    likeliest of boxes with different fronts. Items outside every run are not in the result; items inside
    another item's unit have an empty list. Empty if the catalogue has no kitchen set.
    """
    is_kitchen = is_kitchen or any(_is_named_counter(i) for i in items)
    counters = [i for i in items if _is_counter(i, floor_y, is_kitchen=is_kitchen)]
    hung = [i for i in items if is_kitchen and _is_hung(i, floor_y)]
    chosen = _set_of_kitchen(catalogue, counters, house_id) if counters or hung else None
    if chosen is None:
        return {}
    runs = [
        run
        for item in (*counters, *hung)
        for run in _runs_of(item, floor_y, distance_to_wall, choose_front, is_hung=item in hung)
    ]
    units: dict[str, list[Unit]] = {}
    appliances = [i for i in items if i not in counters and i not in hung]
    whole = [r for r in runs if not r.is_hung and "kitchen" in words_of_item(r.item)]
    longest = max(whole, key=lambda r: r.length, default=None)
    invented = _missing(appliances) if longest else ()
    for run in runs:
        modules = _modules_of(run, [] if run.is_hung else appliances)
        if run is longest:
            modules = _with_invented(modules, invented)
        units.setdefault(run.item.id, [])
        units |= {id_: [] for module in modules for id_ in module.absorbed}
        for number, module in enumerate(modules):
            unit = _unit_of(module, number, run, chosen)
            if unit is not None:
                units.setdefault((module.item or run.item).id, []).append(unit)
        appliances = [i for i in appliances if i.id not in units]
    return units


def _is_named_counter(item: Item) -> bool:
    words = words_of_item(item)
    return bool(item.nyu40 == COUNTER or words & _COUNTERS or {"base", "cabinet"} <= words) and (
        item.nyu40 in (COUNTER, CABINET)
    )


def _is_counter(item: Item, floor_y: float, *, is_kitchen: bool) -> bool:
    assert item.box is not None
    low, high = (float(item.box.centre[1] + s * item.box.half[1]) - floor_y for s in (-1, 1))
    if low > _FOOT_M or not _TOPS_M[0] <= high <= _TOPS_M[1]:
        return False
    if 2 * min(item.box.half[0], item.box.half[2]) < _DEPTHS_M[0]:
        return False
    return _is_named_counter(item) or (is_kitchen and item.nyu40 == CABINET)


def _is_hung(item: Item, floor_y: float) -> bool:
    assert item.box is not None
    low, tall = float(item.box.centre[1] - item.box.half[1]) - floor_y, 2 * float(item.box.half[1])
    return bool(
        item.nyu40 == CABINET
        and low >= _HUNG_M
        and _HUNG_HEIGHTS_M[0] <= tall <= _HUNG_HEIGHTS_M[1]
        and 2 * min(item.box.half[0], item.box.half[2]) <= _HUNG_DEPTH_M
    )


def _set_of_kitchen(catalogue: Catalogue, counters: Sequence[Item], house_id: str) -> _Set | None:
    """A set with a worktop about as high as the counters; the same set for a whole home."""
    by_set: dict[str, dict[str, list[Piece]]] = {}
    for piece in catalogue.of("base_cabinet", "sink", "cooker", "dishwasher", "upper_cabinet"):
        if piece.of_set:
            by_set.setdefault(piece.of_set, {}).setdefault(piece.group, []).append(piece)
    whole = [s for s in by_set.values() if {"base_cabinet", "sink", "cooker"} <= set(s)]
    if not whole:
        return None
    tops = [2 * float(i.box.half[1]) for i in counters if i.box is not None] or [0.9]
    away = [abs(s["base_cabinet"][0].size[2] - tops[0]) for s in whole]
    near = [s for s, far in zip(whole, away, strict=True) if far <= min(away) + 0.021]
    chosen = near[keys.seed(house_id, "kitchen set") % len(near)]
    return _Set(
        tuple(chosen["base_cabinet"]),
        chosen["sink"][0],
        chosen["cooker"][0],
        tuple(chosen.get("dishwasher", ())),
        tuple(chosen.get("upper_cabinet", ())),
    )


def _runs_of(
    item: Item,
    floor_y: float,
    distance_to_wall: Callable[[Point], float],
    choose_front: Callable[[Sequence[Box]], int],
    *,
    is_hung: bool,
) -> Iterator[_Run]:
    """The rows of units for a box; none if it is too deep and away from all walls."""
    box = item.box
    assert box is not None
    right, front = box.axes[:, 0] * [1, 0, 1], box.axes[:, 2] * [1, 0, 1]
    half = box.half[[0, 2]]
    # The long side is the width.
    if half[1] > half[0]:
        right, front, half = front, -right, half[::-1]
    low = float(box.centre[1] - box.half[1]) if is_hung else floor_y
    height = float(box.centre[1] + box.half[1]) - low
    middle = np.array([box.centre[0], low, box.centre[2]])

    def run(x: tuple[float, float], z: tuple[float, float], way: F64) -> _Run:
        # The part x by z of the box, in its right and front; way: where it looks.
        across = np.cross([0.0, 1.0, 0.0], way)
        corners = [middle + right * a + front * b for a in x for b in z]
        back = min(corners, key=lambda c: float(c @ way + c @ across))
        spans = [float(np.ptp([c @ v for c in corners])) for v in (across, way)]
        return _Run(item, back, across, way, spans[0], spans[1], height, is_hung)

    w, d = float(half[0]), float(half[1])
    if 2 * d <= _DEPTHS_M[1]:
        ways = [run((-w, w), (-d, d), way) for way in (front, -front)]
        yield ways[choose_front([r.box(0, r.length) for r in ways])]
        return
    x, z = [-w, w], [-d, d]
    sides = [(z, 1, front), (z, 0, -front), (x, 1, right), (x, 0, -right)]
    at_walls = [
        (span, end, way)
        for span, end, way in sides
        if distance_to_wall(Point(*(middle + way * abs(span[end]))[[0, 2]])) < _AT_WALL_M
    ]
    if not at_walls and d <= _DEPTHS_M[1]:
        # An island: two rows, back to back.
        yield run((-w, w), (0.0, d), front)
        yield run((-w, w), (-d, 0.0), -front)
    for span, end, way in at_walls:
        if min(x[1] - x[0], z[1] - z[0]) < _DEPTH_M:
            return
        # Cut a strip along the wall off the box.
        inner = span[end] - (_DEPTH_M if end else -_DEPTH_M)
        strip = min(inner, span[end]), max(inner, span[end])
        yield run(strip if span is x else (x[0], x[1]), strip if span is z else (z[0], z[1]), -way)
        span[end] = inner


def _kind_of(item: Item) -> str:
    words = words_of_item(item)
    if words & _OTHERS:
        return ""
    if item.nyu40 == SINK:
        return "sink"
    if words & {"dishwasher", "dish"}:
        return "dishwasher"
    return "gap" if words & _BUILT_IN else "cooker" if words & _COOKERS else ""


def _missing(appliances: Sequence[Item]) -> tuple[str, ...]:
    kinds = {_kind_of(i) for i in appliances}
    return tuple(kind for kind in ("cooker", "sink") if kind not in kinds)


def _modules_of(run: _Run, appliances: Sequence[Item]) -> list[_Module]:
    """The modules of a run from end to end: the source's items, and cabinets between."""
    fixed: list[_Module] = []
    inside = [(x, i) for i in appliances if _kind_of(i) and (x := run.along(i)) is not None]
    for x, item in sorted(inside, key=lambda row: row[0]):
        kind = _kind_of(item)
        assert item.box is not None
        if fixed and fixed[-1].kind == kind == "cooker" and x < fixed[-1].high:
            # A hob, and the oven under it.
            fixed[-1] = fixed[-1]._replace(absorbed=(*fixed[-1].absorbed, item.id))
            continue
        width = MODULE_M
        if kind == "gap":
            width = 2 * float(np.abs(item.box.axes.T @ run.right * item.box.half).sum())
        elif kind == "sink" and run.length > 2 * _SINK_M:
            width = _SINK_M
        low = max(x - width / 2, fixed[-1].high if fixed else 0.0)
        low = min(low, run.length - width)
        if low >= (fixed[-1].high if fixed else 0.0) - 1e-6:
            fixed.append(_Module(low, low + width, kind, None if kind == "gap" else item))
    modules: list[_Module] = []
    place = 0.0
    for module in (*fixed, _Module(run.length, run.length, "gap")):
        rest = module.low - place
        if rest >= _NARROWEST_M:
            n = max(round(rest / MODULE_M), 1)
            modules += [
                _Module(place + rest * k / n, place + rest * (k + 1) / n, "base") for k in range(n)
            ]
        elif modules and modules[-1].kind != "gap":
            modules[-1] = modules[-1]._replace(high=module.low)
        elif module.kind != "gap":
            module = module._replace(low=place)
        modules.append(module)
        place = module.high
    return modules[:-1]


def _with_invented(modules: list[_Module], kinds: Sequence[str]) -> list[_Module]:
    """The run with a cooker a third along it and a sink at two thirds, in place of cabinets."""
    modules = list(modules)
    for kind, share in (("cooker", 1 / 3), ("sink", 2 / 3)):
        free = [k for k, m in enumerate(modules) if m.kind == "base"]
        if kind in kinds and len(free) > 1:
            middle = share * modules[-1].high
            best = min(free, key=lambda k: abs((modules[k].low + modules[k].high) / 2 - middle))
            modules[best] = modules[best]._replace(kind=kind)
    return modules


def _unit_of(module: _Module, number: int, run: _Run, chosen: _Set) -> Unit | None:
    pieces = {
        "base": chosen.uppers if run.is_hung else chosen.bases,
        "sink": (chosen.sink,),
        "cooker": (chosen.cooker,),
        "dishwasher": chosen.dishwashers,
    }.get(module.kind)
    if not pieces:
        return None
    piece = pieces[number % len(pieces)]
    box = run.box(module.low, module.high)
    # A tap rises above the worktop, whose height is the same for all units of the set.
    top = piece.size[2] if run.is_hung else chosen.top
    width, depth, _ = piece.size
    scale = np.array([2 * box.half[0] / width, 2 * box.half[1] / top, 2 * box.half[2] / depth])
    is_invented = module.kind != "base" and module.item is None
    return Unit(piece, box, scale, is_invented)
