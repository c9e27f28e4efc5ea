"""Furniture of boards: bookcases, racks, chests, cupboards, tables for walls, a chair, a bench; no effects.

Sizes here are width, height, depth; boards are 18 mm thick, backs 6 mm.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise, product
from typing import Final, NamedTuple

import numpy as np

from pbrs_farm.core.catalogue import Place
from pbrs_farm.core.classes import (
    BOOKSHELF,
    CABINET,
    CHAIR,
    DESK,
    DRESSER,
    NIGHT_STAND,
    SHELVES,
    TABLE,
)
from pbrs_farm.core.house import Material
from pbrs_farm.dress.style import Rgb
from pbrs_farm.dress.thing_materials import plain
from pbrs_farm.furnishings.things.joints import Inside, Look, fronts_of, hollow
from pbrs_farm.furnishings.things.maker import Maker, Size, Thing, thing
from pbrs_farm.geometry.outlines import spaced

# fmt: off
_BOARD_M: Final = 0.018
_FRONT_M: Final = 0.02  # of a piece's depth, for its fronts


class Boards(NamedTuple):
    """Materials of a piece."""

    body: Material
    front: Material
    top: Material
    cloth: Rgb = (0.6, 0.58, 0.55)


@thing(group="bookcase", nyu40=BOOKSHELF, place=Place.FLOOR)
def bookcase(m: Maker, boards: Boards, size: Size) -> None:
    """Open shelves between two sides; some have doors below, some no back."""
    w, h, d = size
    hw, hd = w / 2, d / 2
    sides(m, boards, size)
    has_doors = h > 1.5 and m.chance(0.25)
    plinth = m.uniform(0.05, 0.09)
    with m.of(boards.body):
        m.box(w - 0.036, plinth, 0.015, against=hd - 0.04)
        if has_doors or m.chance(0.75):
            m.box(w - 0.036, (plinth, h - 0.018), 0.006, against=-hd)
        # Shelves are as far apart as large books need, evenly; longer ones sag and get an upright.
        n = max(2, round((h - plinth) / m.uniform(0.28, 0.37)))
        levels = spaced(plinth, h - 0.018, n + 1)
        for y in levels:
            m.box(w - 0.036, 0.018, (-hd + 0.006, hd - 0.002), on=y)
        for low, high in pairwise(levels) if w > 0.95 else ():
            m.box(0.018, (low + 0.018, high), (-hd + 0.006, hd - 0.004))
    if has_doors:
        fronts_of(m, look_of(m, boards), (-hw, hw), (levels[0], levels[2] + 0.018), hd,
            [("door",)] * (2 if w > 0.55 else 1), False, Inside(-hd, has_boards=False))


@thing(group="shelves", nyu40=SHELVES, place=Place.FLOOR)
def cube_shelf(m: Maker, boards: Boards, size: Size) -> None:
    """A grid of open boxes of 34 cm, a board of 45 mm around it; up to five above one another."""
    columns = max(1, int(size[0] / 0.36))
    rows = min(max(1, int(size[1] / 0.36)), 5 if columns > 1 else 4)
    inner, outer, d = 0.34, 0.045, 0.38
    w, h = (columns * inner + (columns - 1) * 0.018 + 2 * outer,
        rows * inner + (rows - 1) * 0.018 + 2 * outer)
    hw = w / 2
    with m.of(boards.body):
        m.box(w, outer, d)
        m.box(w, (h - outer, h), d)
        m.box(outer, (outer, h - outer), d, left=-hw)
        m.box((hw - outer, hw), (outer, h - outer), d)
        for k in range(1, columns):
            x = -hw + outer + k * (inner + 0.018) - 0.018
            m.box(0.018, (outer, h - outer), d - 0.004, left=x)
        # Shelves run from upright to upright.
        for i, k in product(range(1, rows), range(columns)):
            x, y = -hw + outer + k * (inner + 0.018), outer + i * (inner + 0.018) - 0.018
            m.box(inner, 0.018, d - 0.004, left=x, on=y)


@thing(group="shelves", nyu40=SHELVES, place=Place.FLOOR)
def rack(m: Maker, boards: Boards, size: Size) -> None:
    """Boards between four posts of metal, open on all sides; a rail under each end carries them."""
    w, h, d = size
    hw, hd = w / 2, d / 2
    post, thick = 0.022, 0.024
    for x, z in product((-(hw - post / 2), hw - post / 2), (-(hd - post / 2), hd - post / 2)):
        m.box(post, h, post, x=x, z=z, of=m.metal)
    for y in spaced(0.09, h - thick - 0.004, max(3, round(h / m.uniform(0.34, 0.42)))):
        m.box(w - 2 * post, thick, d - 0.008, on=y, of=boards.body)
        for a, b in ((-(hw - 0.004), -(hw - post)), (hw - post, hw - 0.004)):
            m.box((a, b), thick, d - 2 * post, on=y, of=m.metal)


@thing(group="dresser", nyu40=DRESSER, place=Place.FLOOR)
def chest(m: Maker, boards: Boards, size: Size) -> None:
    """A chest of drawers, one or two of them side by side."""
    chest_of_drawers(m, boards, size)


@thing(group="nightstand", nyu40=NIGHT_STAND, place=Place.FLOOR)
def nightstand(m: Maker, boards: Boards, size: Size) -> None:
    """A chest of drawers beside a bed."""
    chest_of_drawers(m, boards, size)


def chest_of_drawers(m: Maker, boards: Boards, size: Size) -> None:
    """Drawers of equal height, in two columns where it is wide."""
    w, h, _d = size
    column = ("drawer",) * max(1, round((h - 0.12) / m.uniform(0.17, 0.25)))
    cupboard(m, boards, size, True, [column] * (2 if w > 0.95 else 1))


@thing(group="cabinet", nyu40=CABINET, place=Place.FLOOR)
def sideboard(m: Maker, boards: Boards, size: Size) -> None:
    """A long low cupboard with doors, and drawers in one column."""
    n = max(2, round(size[0] / 0.46))
    k = m.integers(0, n)
    cupboard(m, boards, size, True, [("door",)] * k + [("drawer",) * 3] + [("door",)] * (n - k - 1))


@thing(group="wardrobe", nyu40=CABINET, place=Place.FLOOR)
def wardrobe(m: Maker, boards: Boards, size: Size) -> None:
    """A tall cupboard of two to four doors; some have drawers below."""
    column = ("door", "drawer") if m.chance(0.3) else ("door",)
    cupboard(m, boards, size, False, [column] * max(2, round(size[0] / 0.48)))


@thing(group="cabinet", nyu40=CABINET, place=Place.FLOOR)
def tall_cabinet(m: Maker, boards: Boards, size: Size) -> None:
    """A narrow cupboard: open shelves in the middle, doors above and below."""
    w, h, d = size
    hw, hd = w / 2, d / 2
    low, high = 0.4 * h, 0.62 * h
    sides(m, boards, size)
    with m.of(boards.body):
        m.box(w - 0.036, (0.06, h - 0.018), 0.006, against=-hd)
        m.box(w - 0.036, 0.06, 0.015, against=hd - 0.03)
        for y in (0.06, low, (low + high) / 2, high, h - 0.018):
            m.box(w - 0.036, 0.018, (-hd + 0.006, hd - 0.002), on=y)
    look = look_of(m, boards)
    for span in ((0.06, low + 0.018), (high, h)):
        fronts_of(m, look, (-hw, hw), span, hd, [("door",)], span[0] > 1.2, Inside(-hd, has_boards=False))


@thing(group="cabinet", nyu40=CABINET, place=Place.FLOOR)
def shoe_cabinet(m: Maker, boards: Boards, size: Size) -> None:
    """A flat cupboard with flaps one above another."""
    cupboard(m, boards, size, False,
        [("flap",) * max(2, round(size[1] / 0.42))] * (2 if size[0] > 0.85 else 1))


@thing(group="coffee_table", nyu40=TABLE, place=Place.FLOOR)
def console(m: Maker, boards: Boards, size: Size) -> None:
    """A narrow table on four legs, some with a board near the floor."""
    w, _h, d = size
    table(m, boards, size, m.uniform(0.03, 0.045))
    if m.chance(0.6):
        y = m.uniform(0.12, 0.2)
        m.box(w - 0.06, 0.018, d - 0.05, on=y, of=boards.body)


@thing(group="desk", nyu40=DESK, place=Place.FLOOR)
def desk(m: Maker, boards: Boards, size: Size) -> None:
    """A table to write at, drawers under one end of it."""
    w, h, d = size
    table(m, boards, size, 0.04)
    # Three drawers between the legs of one end, or down to the floor.
    if m.chance(0.7):
        side = m.pick(-1.0, 1.0)
        x0, x1 = sorted((side * (w / 2 - 0.06), side * (w / 2 - 0.44)))
        low, high = 0.06 if m.chance(0.5) else h - 0.24, h - 0.026
        hollow(m, (x0, x1), (low, high), (-d / 2 + 0.03, d / 2 - 0.04), _BOARD_M, boards.body)
        fronts_of(m, look_of(m, boards), (x0, x1), (low, high), d / 2 - 0.04,
            [("drawer",) * max(1, round((high - low) / 0.19))], False, Inside(-d / 2 + 0.038))


@thing(group="chair", nyu40=CHAIR, place=Place.FLOOR)
def desk_chair(m: Maker, boards: Boards) -> None:
    """A plain chair of wood: four legs, a seat, two bars as its back."""
    w, d, seat, h, leg = 0.43, 0.44, 0.46, m.uniform(0.8, 0.92), 0.034
    hw, hd = w / 2, d / 2
    with m.of(boards.body):
        for x, front in product((-(hw - leg / 2), hw - leg / 2), (True, False)):
            z, high = hd - leg / 2 if front else -hd + leg / 2, seat - 0.022 if front else h
            m.box(leg, high, leg, x=x, z=z)
        m.box(w - 2 * leg, (seat - 0.022, seat), (-hd + 0.003, hd))
        for a, b in ((-hw, -(hw - leg)), (hw - leg, hw)):
            m.box((a, b), (seat - 0.022, seat), (-hd + leg, hd))
        for y in (h - 0.09, h - 0.24):
            m.box(w - 2 * leg, 0.07, 0.018, on=y, against=-hd + 0.006)


@thing(group="ottoman", nyu40=CHAIR, place=Place.FLOOR)
def bench(m: Maker, boards: Boards, size: Size) -> None:
    """A bench for two with a cushion on it."""
    w, h, d = size
    table(m, boards, (w, h - 0.05, d), 0.045)
    m.bulged((w - 0.02, 0.05, d - 0.02), n=8, edge=0.6, bulge=8.0, at=(0.0, h - 0.0255, 0.0),
        of=plain("bench cushion", boards.cloth, 0.95))


def sides(m: Maker, boards: Boards, size: Size) -> None:
    """Two uprights from the floor to the top."""
    w, h, d = size
    m.box(0.018, h, d, left=-w / 2, of=boards.body)
    m.box(0.018, h, d, left=w / 2 - 0.018, of=boards.body)


def table(m: Maker, boards: Boards, size: Size, leg: float) -> None:
    """A top on four legs with rails under it."""
    w, h, d = size
    thick, x, z = 0.025, w / 2 - 0.01 - leg / 2, d / 2 - 0.01 - leg / 2
    m.box(w, (h - thick, h), d, of=boards.top)
    with m.of(boards.body):
        for a, c in product((-x, x), (-z, z)):
            m.box(leg, h - thick, leg, x=a, z=c)
        to_x, to_z = w / 2 - 0.01 - leg, d / 2 - 0.01 - leg
        m.box(2 * to_x, 0.06, 0.018, on=h - thick - 0.06, z=-z, mirrored="z")
        m.box(0.018, 0.06, 2 * to_z, x=-x, on=h - thick - 0.06, mirrored="x")


def cupboard(m: Maker, boards: Boards, size: Size, may_have_legs: bool,
    columns: Sequence[Sequence[str]]) -> None:
    """A closed box behind columns of fronts, which are named from the top downwards."""
    w, h, d = size
    foot = carcass(m, boards, size, may_have_legs)
    fronts_of(m, look_of(m, boards), (-w / 2, w / 2), (foot, h - 0.026), d / 2 - _FRONT_M, columns,
        False, Inside(-d / 2 + 0.008, rail=m.metal))


def look_of(m: Maker, boards: Boards) -> Look:
    """The fronts and pulls of a piece."""
    kind = m.pick("flat", "flat", "flat", "shaker", "shaker", "grooved", "raised")
    pull = m.pick("bar", "bow", "square", "knob", "knob", "disc", "ring", "edge")
    return Look(kind, boards.front, boards.body, boards.top, pull, m.metal)


def carcass(m: Maker, boards: Boards, size: Size, may_have_legs: bool) -> float:
    """The box behind fronts, a top over it, a plinth or legs that taper under it.

    The box comes first.
    """
    w, h, d = size
    hw, hd = w / 2, d / 2
    thick = m.pick(0.018, 0.025)
    has_legs = may_have_legs and m.chance(0.55)
    foot = m.uniform(0.09, 0.16) if has_legs else m.uniform(0.04, 0.07)
    hollow(m, (-hw, hw), (foot, h - thick), (-hd, hd - _FRONT_M), _BOARD_M, boards.body)
    m.box(w + 0.008, (h - thick, h), (-hd, hd + 0.006), of=boards.top)
    if not has_legs:
        m.box(w - 0.02, foot, (-hd, hd - 0.05), of=boards.body)
    else:
        for x, z in product((-hw + 0.06, hw - 0.06), (-hd + 0.05, hd - 0.08)):
            m.frustum((0.013, 0.0), (0.022, foot), n=12, at=(x, 0.0, z), of=boards.top)
    return float(np.float32(foot))


CASE_GOODS: Final[Mapping[str, Thing[[Boards, Size]]]] = {one.name: one for one in (bookcase,
    cube_shelf, rack, chest, nightstand, sideboard, wardrobe, tall_cabinet, shoe_cabinet, console,
    desk, bench)}
"""What furniture.toml may name as a model; desk_chair has one size."""
