"""Kitchen runs: a row, an L or a U of modules along walls, with all appliances; no effects.

The sink is below a window if there is one, the cooker below a hood and never below a window, the
fridge at a far end; wall cabinets fill the rest.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import permutations
from typing import Final

import numpy as np

from pbrs_farm.core.catalogue import Piece
from pbrs_farm.generate.floor_plan import Rect
from pbrs_farm.generate.furnish.kitchen_walls import (
    CORNER_M,
    DEPTH_M,
    FILLER_M,
    MODULE_M,
    PULL_M,
    WORKTOP_M,
    Arm,
    run_shapes,
)
from pbrs_farm.generate.furnish.pieces import Shelf
from pbrs_farm.generate.furnish.places import allowed, frames_array
from pbrs_farm.generate.furnish.room_space import FurnishSpace
from pbrs_farm.generate.furnish.template import PieceSlot, Standing, Template

UPPER_M: Final = 1.45  # lower edge of wall cabinets
UPPER_DEPTH_M: Final = 0.36
_BUILT_IN: Final = 0.6  # share of homes that have the oven built into the units
_FRONT_M: Final = 0.8  # free before the run
_GAP: Final = 0.005  # behind the units
_HUNG_GAP: Final = 0.001  # gap between a wall-mounted piece and its wall, metres
_STRIP: Final = 0.02  # gap between a front and a deeper neighbour (fridge, hood), metres


@dataclass(frozen=True, slots=True)
class Units:
    """The pieces of one kitchen."""

    fridge: Piece
    sink: Piece
    cooker: Piece
    bases: tuple[Piece, ...]
    top: float  # height of the worktop
    hood: Piece | None = None
    uppers: tuple[Piece, ...] = ()
    dishwasher: Piece | None = None
    blind: Piece | None = None  # what no front opens: the corner, strips beside it


@dataclass(frozen=True, slots=True)
class _Module:
    kind: str  # "fridge", "sink", "cooker", "base", "corner", "filler"
    arm: int
    low: float  # along its wall
    width: float

    @property
    def high(self) -> float:
        return self.low + self.width


def units_of(shelf: Shelf) -> Units | None:
    """The units of one set, or of one library, that fit together; None where it lacks one."""
    fridges = shelf.of("fridge", width=(0.5, 0.95), height=(1.1, 2.2))
    fridges.sort(key=lambda p: p.size[0] > 0.7)
    for sink in shelf.of("sink", width=(0.5, 1.3)):
        bases = _sold_with(
            sink, shelf.of("base_cabinet", width=(0.5, 0.7), depth=(0.5, 0.72)), alone=True
        )
        cookers = _sold_with(sink, shelf.of("cooker", width=(0.45, 0.75)))
        if not (bases and fridges and cookers):
            continue
        uppers = shelf.of("upper_cabinet", width=(0.5, 0.7), depth=(0.2, 0.5), height=(0.4, 0.9))
        uppers_of_set = _sold_with(sink, uppers, alone=True)
        hoods = shelf.of("hood", width=(0.5, 0.7), height=(0.1, 0.95))
        washers = _sold_with(sink, shelf.of("dishwasher", width=(0.55, 0.65)))
        blinds = _sold_with(sink, shelf.of("blind_cabinet"), alone=True)
        # Most who buy a set build the oven into it.
        built_in = [p for p in cookers if p.of_set and shelf.likes(p, _BUILT_IN)]
        return Units(
            fridges[0],
            sink,
            (built_in or [p for p in cookers if not p.of_set] or cookers)[0],
            tuple(bases[:3]),
            bases[0].size[2],
            hoods[0] if hoods else None,
            tuple(uppers_of_set or uppers)[:2],
            washers[0] if washers else None,
            blinds[0] if blinds else None,
        )
    return None


def _sold_with(sink: Piece, pieces: list[Piece], *, alone: bool = False) -> list[Piece]:
    """Pieces of the sink's set and pieces of no set; alone: only of its set, or of its library."""
    mine = sink.of_set or sink.library
    if alone:
        return [p for p in pieces if (p.of_set or p.library) == mine]
    return [p for p in pieces if p.of_set in ("", sink.of_set)]


def kitchen_places(
    units: Units, space: FurnishSpace, rng: np.random.Generator, *, wanted: float
) -> list[Standing]:
    """Every run of units that keeps doors free and its cooker off windows; wanted: metres of modules."""
    standings: list[Standing] = []
    for arms in run_shapes(space):
        length = sum(a.length for a in arms)
        best = _best_run(arms, units, space)
        if best is None:
            continue
        template, score = best
        frame = arms[0].wall.frame
        if not allowed(template, frames_array([frame]), space)[0]:
            continue
        score -= 0.8 * abs(length - wanted) - 0.4 * (len(arms) - 1)
        standings.append(Standing(template, frame, score + 0.3 * float(rng.random())))
    return standings


def _best_run(
    arms: tuple[Arm, ...], units: Units, space: FurnishSpace
) -> tuple[Template, float] | None:
    """The best order of units along the arms."""
    best: tuple[float, list[_Module]] | None = None
    for fridge_arm, fridge_high in _far_ends(arms):
        for sink_arm in range(len(arms)):
            for cooker_arm in range(len(arms)):
                for order in _orders(arms, units, (fridge_arm, fridge_high, sink_arm, cooker_arm)):
                    score = _run_score(order, arms, space)
                    if score is not None and (best is None or score > best[0]):
                        best = score, order
    if best is None:
        return None
    score, modules = best
    return _template(modules, arms, units, space), score


def _far_ends(arms: tuple[Arm, ...]) -> list[tuple[int, bool]]:
    # The main arm's low end; and the far end of the last one.
    return [(0, False), (len(arms) - 1, True)]


def _orders(
    arms: tuple[Arm, ...], units: Units, where: tuple[int, bool, int, int]
) -> Iterator[list[_Module]]:
    """Rows of modules: the fridge at its end, sink and cooker anywhere, cabinets between."""
    fridge_arm, fridge_high, sink_arm, cooker_arm = where
    rows = []
    for k, arm in enumerate(arms):
        fixed = [units.fridge.size[0] + _STRIP] * (k == fridge_arm)
        movable = ["sink"] * (k == sink_arm) + ["cooker"] * (k == cooker_arm)
        widths = {"sink": units.sink.size[0], "cooker": units.cooker.size[0]}
        # Where two arms meet nothing opens: fronts and what opens them would be in each other's way.
        blind = 0.0 if len(arms) == 1 else (CORNER_M, FILLER_M)[k]
        remaining = arm.length - blind - sum(fixed) - sum(widths[m] for m in movable)
        if remaining < -1e-6:
            return
        n = int(remaining / MODULE_M + 0.5) if remaining > 0.28 else 0
        # A remainder too narrow for a cabinet stays open at the free end.
        width = remaining / n if n else 0.0
        rows.append(
            list(
                _arm_rows(
                    k, arm, movable, widths, (n, width), units, fridge_arm == k, fridge_high, blind
                )
            )
        )
    if len(rows) == 1:
        yield from rows[0]
        return
    for first in rows[0]:
        for second in rows[1]:
            yield first + second


def _arm_rows(
    k: int,
    arm: Arm,
    movable: list[str],
    widths: dict[str, float],
    bases: tuple[int, float],
    units: Units,
    has_fridge: bool,
    fridge_high: bool,
    blind: float,
) -> Iterator[list[_Module]]:
    n, width = bases
    total = n + len(movable)
    fridge = units.fridge.size[0] + _STRIP
    fixed = {"base": width, "fridge": fridge, "corner": blind, "filler": blind}
    for spots in permutations(range(total), len(movable)):
        kinds = ["base"] * total
        for spot, kind in zip(spots, movable, strict=True):
            kinds[spot] = kind
        if has_fridge:
            kinds = [*kinds, "fridge"] if fridge_high else ["fridge", *kinds]
        if blind:
            kinds = ["filler", *kinds] if k else [*kinds, "corner"]
        # A fridge is deeper than the filler next to it is wide.
        if kinds[:2] == ["filler", "fridge"]:
            continue
        start, row = arm.low, []
        if kinds[-1] == "corner":
            # The remainder stays open at the free end.
            start = arm.high - sum((fixed | widths)[kind] for kind in kinds)
        for kind in kinds:
            row.append(_Module(kind, k, start, (fixed | widths)[kind]))
            start = row[-1].high
        yield row


def _run_score(modules: list[_Module], arms: tuple[Arm, ...], space: FurnishSpace) -> float | None:
    """Usability of a kitchen run; None if a hood would cover a window."""
    modules = [m for m in modules if m.kind != "filler"]
    kinds = ["base" if m.kind == "corner" else m.kind for m in modules]
    sink, cooker, fridge = (kinds.index(k) for k in ("sink", "cooker", "fridge"))
    score = 0.0
    if _below_window(modules[cooker], arms, space) > 0.02 or (
        _below_window(modules[fridge], arms, space) > 0.02
    ):
        return None
    score += 1.0 * min(_below_window(modules[sink], arms, space) / 0.5, 1.0)
    # Keep worktop between sink and cooker, and beside the cooker on both sides.
    between = abs(sink - cooker) - 1
    score += {0: -1.0, 1: 0.6, 2: 0.5}.get(between, 0.0)
    neighbours = [kinds[i] for i in (cooker - 1, cooker + 1) if 0 <= i < len(kinds)]
    score += 0.4 * neighbours.count("base") - 0.6 * ("fridge" in neighbours)
    score -= 0.1 * abs(fridge - sink)
    if modules[sink].arm == 1 and modules[sink].low < arms[1].low + FILLER_M + 0.05:
        score -= 0.3
    return score


def _below_window(module: _Module, arms: tuple[Arm, ...], space: FurnishSpace) -> float:
    """Length of a module below windows, metres."""
    wall = arms[module.arm].wall
    return sum(
        max(min(module.high, w.high + 0.03) - max(module.low, w.low - 0.03), 0.0)
        for w in space.windows
        if w.wall >= 0 and space.walls[w.wall] == wall
    )


def _template(
    modules: list[_Module], arms: tuple[Arm, ...], units: Units, space: FurnishSpace
) -> Template:
    slots: list[PieceSlot] = []
    n_base = 0
    dishes = units.dishwasher if len(modules) >= 6 else None
    kinds = [m.kind for m in modules]
    sink = kinds.index("sink")
    for i, module in enumerate(modules):
        piece: Piece = units.bases[n_base % len(units.bases)]
        height, depth, gap = units.top, DEPTH_M, _GAP
        if module.kind == "fridge":
            piece, height = units.fridge, units.fridge.size[2]
            depth = max(piece.size[1], 0.5)
            # Offset the opening corner unit so that its door turns clear of the others.
            gap = max(_GAP, DEPTH_M + _GAP + PULL_M + 0.01 - depth)
            # The strip between it and its neighbour.
            is_last = i > 0 and modules[i - 1].arm == module.arm
            low = module.low + _STRIP * is_last
            module = replace(module, low=low, width=module.width - _STRIP)
        elif module.kind == "sink":
            piece, height = units.sink, units.sink.size[2]
        elif module.kind == "cooker":
            piece = units.cooker
        elif module.kind == "base":
            n_base += 1
            # Put the dishwasher next to the sink.
            if dishes is not None and abs(i - sink) == 1 and 0.55 <= module.width <= 0.66:
                piece, dishes = dishes, None
        else:
            # Sets without a blind corner unit get a cabinet there that cannot be opened.
            piece, depth = units.blind or piece, WORKTOP_M
        unit = PieceSlot(piece, 0, 0, module.width, depth, height)
        slots.append(_place_unit(unit, module, arms, gap))
    slots += _hung(modules, units, arms, space)
    clear, fronts = _rects(modules, arms)
    name = f"kitchen of {len(arms)} arms, {len(modules)} modules"
    return Template(name, tuple(slots), clear, fronts)


def _hung(
    modules: list[_Module], units: Units, arms: tuple[Arm, ...], space: FurnishSpace
) -> list[PieceSlot]:
    """The hood and the wall cabinets, and no two of them before each other's fronts."""
    slots: list[tuple[_Module, PieceSlot]] = []
    for number, module in enumerate(modules):
        slot = _above(module, units, arms, space, number)
        if slot is None:
            continue
        if slot.piece is not units.hood:
            # Leave a strip beside deeper neighbours (hood, fridge) and beside the wall in the
            # corner.
            near = [m.kind for m in modules if m.arm == module.arm and m.high == module.low]
            far = [m.kind for m in modules if m.arm == module.arm and m.low == module.high]
            left, right = (_STRIP * bool({"fridge", "cooker"} & set(k)) for k in (near, far))
            right = _STRIP if module.kind == "corner" else right
            module = replace(module, low=module.low + left, width=module.width - left - right)
            slot = replace(slot, width=module.width)
        slots.append((module, slot))
    # In a corner the main arm's cabinet opens before where the side arm's would hang.
    reach = UPPER_DEPTH_M + CORNER_M + PULL_M
    is_cooked_there = any(m.kind == "cooker" and m.arm == 1 and m.low < reach for m, _ in slots)
    free_slots = [
        (m, s)
        for m, s in slots
        if not (m.kind == "corner" and is_cooked_there)
        and not (m.kind != "cooker" and m.arm == 1 and m.low < reach and not is_cooked_there)
    ]
    return [_place_unit(slot, module, arms, _HUNG_GAP) for module, slot in free_slots]


def _above(
    module: _Module, units: Units, arms: tuple[Arm, ...], space: FurnishSpace, number: int
) -> PieceSlot | None:
    """The hood or the wall cabinet over a module."""
    # A run never puts its cooker below a window.
    beside = _below_window(module, arms, space) <= (0.02 if module.kind == "cooker" else 0.0)
    if module.kind == "fridge" or not beside:
        return None
    if module.kind == "cooker":
        if units.hood is None:
            return None
        w, d, h = units.hood.size
        h = min(h, space.height - 1.5 - 0.02)
        return PieceSlot(units.hood, 0, 0, min(w, module.width), d, h, 1.5)
    if not units.uppers or module.width < 0.3:
        return None
    upper = units.uppers[0 if module.kind == "sink" else number % len(units.uppers)]
    _, d, h = upper.size
    return PieceSlot(upper, 0, 0, module.width, min(d, UPPER_DEPTH_M), min(h, 0.72), UPPER_M)


def _place_unit(slot: PieceSlot, module: _Module, arms: tuple[Arm, ...], gap: float) -> PieceSlot:
    """A unit with its back a gap before its arm's wall, in the frame of the main arm's wall."""
    along, across = (module.low + module.high) / 2, gap + slot.depth / 2
    u, v = _in_main(along, across, arms[module.arm])
    return replace(slot, u=u, v=v, turns=arms[module.arm].turns)


def _in_main(along: float, across: float, arm: Arm) -> tuple[float, float]:
    # The side arm goes from the main one's right corner into the room.
    return (along, across) if arm.turns == 0 else (arm.corner - across, along)


def _rects(
    modules: list[_Module], arms: tuple[Arm, ...]
) -> tuple[tuple[Rect, ...], tuple[Rect, ...]]:
    """Area to keep free in front of each arm, and the areas that must be reachable: fridge, sink, cooker."""
    clear, fronts = [], []
    for k, arm in enumerate(arms):
        low = arm.low
        high = arm.high - (CORNER_M if k == 0 and len(arms) > 1 else 0.0)
        clear.append(_rect((low, DEPTH_M + 0.02, high, DEPTH_M + _FRONT_M), arm))
    for module in modules:
        if module.kind in ("fridge", "sink", "cooker"):
            box = (module.low - 0.2, DEPTH_M + 0.2, module.high + 0.2, DEPTH_M + _FRONT_M)
            fronts.append(_rect(box, arms[module.arm]))
    return tuple(clear), tuple(fronts)


def _rect(rect: Rect, arm: Arm) -> Rect:
    a, b = _in_main(rect[0], rect[1], arm), _in_main(rect[2], rect[3], arm)
    return min(a[0], b[0]), min(a[1], b[1]), max(a[0], b[0]), max(a[1], b[1])
