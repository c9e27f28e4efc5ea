"""Kitchens of the generated catalogue: units, sinks, cookers, fridges, hoods, machines; no effects.

Fronts end 30 mm before the depth that a unit is said to have: room for what opens them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import product
from math import radians
from typing import Annotated, Final

import numpy as np

from pbrs_farm.core.arrays import I32
from pbrs_farm.core.frames import LYING_ALONG_X, LYING_ALONG_Z
from pbrs_farm.core.house import Material, Surface
from pbrs_farm.dress.style import mix
from pbrs_farm.dress.thing_materials import (
    BLACK_GLASS,
    BLACK_STEEL,
    BRASS,
    CAST_IRON,
    CERAMIC,
    CHROME,
    ENAMEL,
    RUBBER,
    STEEL,
    WHITE,
    WHITE_STEEL,
    glass,
    glossy,
    plain,
)
from pbrs_farm.furnishings.things.catalogued import catalogued
from pbrs_farm.furnishings.things.joints import (
    Inside,
    Look,
    clock,
    drawer_box,
    drawer_front,
    fronts_of,
    hollow,
    opens,
    panel,
    pull,
    shell,
)
from pbrs_farm.furnishings.things.maker import Maker, Size
from pbrs_farm.furnishings.things.parameters import Choice, Front, Pull, Range
from pbrs_farm.furnishings.things.shapes import Pair, row
from pbrs_farm.geometry.bodies import creased
from pbrs_farm.geometry.outlines import bent, d_shape, oval, rect, rings

# fmt: off
_OVEN: Final = glossy("oven enamel", (0.09, 0.09, 0.095), 0.35)
CLEAR_PLASTIC: Final = glass((0.93, 0.96, 0.96), 0.25)
_FALLING_RAD: Final = radians(88)  # of doors that fall open
_FRIDGE_RAD: Final = radians(95)  # beside a wall it opens no farther
_MACHINE_RAD: Final = radians(110)  # of a washing machine's round door
_BACK_M: Final = 0.008  # of a unit's back
_HOB_M: Final = {"gas": 0.044, "ceramic": 0.006, "plates": 0.019}  # that a hob is high


@dataclass(frozen=True, slots=True)
class KitchenSet:
    """Shared values of the units of one kitchen."""

    top_h: float  # of the worktop's upper side
    top_t: float  # its thickness
    look: Look
    upper_look: Look  # of wall units
    worktop: Material
    plinth: Material
    plinth_h: float


def kitchen_set(m: Maker) -> KitchenSet:
    """The taste of one kitchen: its fronts, worktop, pulls and plinth."""
    top_h, top_t = m.pick(0.86, 0.88, 0.9, 0.9, 0.92), m.pick(0.02, 0.03, 0.038, 0.04)
    kind = m.pick("flat", "flat", "shaker", "shaker", "grooved", "raised")
    is_wood = m.chance(0.25)
    colour = m.paint()
    front = m.timber if is_wood else glossy("front", colour, m.uniform(0.2, 0.5))
    second = m.weighted(0.55, 0.25, 0.2)
    upper_front = (front, glossy("front", (0.91, 0.91, 0.89), 0.4), m.timber)[second]
    body = WHITE if m.chance(0.7) else glossy("carcass", (0.4, 0.4, 0.4), 0.5)
    stone = m.weighted(0.4, 0.2, 0.2, 0.1, 0.1)
    worktop = (plain("oak wood", mix(m.wood, (0.6, 0.45, 0.3), 0.4), 0.45),
        glossy("stone", (0.88, 0.87, 0.84), 0.25), glossy("stone", (0.13, 0.13, 0.14), 0.25),
        glossy("stone", (0.55, 0.53, 0.5), 0.3), STEEL)[stone]
    pull_kind = m.pick("bar", "bow", "knob", "disc", "square", "cup", "edge", "edge")
    pull_material = m.metal if m.chance(0.6) else m.pick(STEEL, BLACK_STEEL, BRASS)
    look = Look(kind, front, body, worktop, pull_kind, pull_material)
    upper_look = Look(m.pick(kind, kind, kind, "glazed"), upper_front, body, worktop, pull_kind,
        pull_material)
    plinth = front if m.chance(0.5) else m.pick(STEEL, RUBBER)
    plinth_h = m.pick(0.1, 0.12, 0.15)
    return KitchenSet(top_h, top_t, look, upper_look, worktop, plinth, plinth_h)


def unit_body(m: Maker, size: Size, top_h: float, k: KitchenSet, has_top: bool = True) -> None:
    """A unit's carcass and plinth; its worktop's upper side is to be at top_h.

    has_top: False for a sink's, whose bowl hangs in it.
    """
    w, d, _h = size
    f = d / 2 - 0.049
    hollow(m, (-w / 2 + 0.0005, w / 2 - 0.0005), (k.plinth_h, top_h - k.top_t), (-d / 2, f), 0.016,
        k.look.body, has_top)
    m.box(w, k.plinth_h, (-d / 2 + 0.02, f - 0.05), of=k.plinth)


def worktop(m: Maker, w: float, y: Pair, d: float, material: Material,
    back: float | None = None) -> None:
    """A worktop to 12 mm before a unit's depth d, its front edges cut by 3 mm; flush at both ends."""
    back, front, cut = -d / 2 if back is None else back, d / 2 - 0.012, 0.003
    # Outlines across it, which lie on their side: x is down there.
    outline = [(-y[1], back), (-y[1], front - cut), (cut - y[1], front), (-y[0] - cut, front),
        (-y[0], front - cut), (-y[0], back)]
    m.loft([(outline, -w / 2), (outline, w / 2)], sharp=20.0, turn=LYING_ALONG_X, of=material)


_FRONTS: Final[Mapping[str, list[tuple[str, ...]]]] = {"door": [("door",)],
    "low_door": [("low", "door")], "three_drawers": [("drawer", "drawer", "drawer")],
    "low_two_drawers": [("low", "drawer", "drawer")], "two_doors": [("door",), ("door",)],
    "two_drawers": [("drawer", "drawer")], "four_drawers": [("low", "low", "drawer", "drawer")]}


@dataclass(frozen=True, slots=True)
class KitchenUnit:
    """Parameters of a base unit; all but the first are those of its kitchen."""

    fronts: Annotated[str, Choice(*_FRONTS)]
    front: Material
    front_kind: Front
    body: Material
    pull: Pull
    pull_material: Material
    worktop: Material
    plinth: Material


def draw_unit(m: Maker, k: KitchenSet, *fronts: str) -> KitchenUnit:
    """Draw a unit's fronts."""
    look = k.look
    return KitchenUnit(m.pick(*fronts), look.front, look.kind, look.body, look.pull,
        look.pull_material, k.worktop, k.plinth)


def unit(m: Maker, size: Size, k: KitchenSet, p: KitchenUnit) -> None:
    """A unit with its worktop and columns of fronts."""
    look = Look(p.front_kind, p.front, p.body, p.worktop, p.pull, p.pull_material)
    unit_body(m, size, k.top_h, replace(k, look=look, plinth=p.plinth))
    w, d, h = size
    worktop(m, w, (h - k.top_t, h), d, p.worktop)
    y = (k.plinth_h, h - k.top_t - 0.003)
    fronts_of(m, look, (-w / 2, w / 2), y, d / 2 - 0.049, _FRONTS[p.fronts], False,
        Inside(-d / 2 + _BACK_M))


@catalogued(of_set=kitchen_set, size=lambda m, k: (0.6, 0.6, k.top_h), draw=lambda m, _size,
    k: draw_unit(m, k, "door", "low_door", "three_drawers", "low_two_drawers", "two_doors"))
def base_cabinet(m: Maker, size: Size, k: KitchenSet, p: KitchenUnit) -> None:
    """A kitchen's unit with a worktop: doors, drawers, or both."""
    unit(m, size, k, p)


@catalogued(of_set=kitchen_set, size=lambda m, k: (0.6, 0.6, k.top_h), draw=lambda m, _size,
    k: draw_unit(m, k, "low_two_drawers", "two_drawers", "four_drawers", "low_door"))
def drawer_cabinet(m: Maker, size: Size, k: KitchenSet, p: KitchenUnit) -> None:
    """A second unit of the kitchen, mostly of drawers."""
    unit(m, size, k, p)


@catalogued(of_set=kitchen_set, size=lambda m, k: (0.67, 0.588, k.top_h))
def blind_cabinet(m: Maker, size: Size, k: KitchenSet) -> None:
    """A blind unit for the corner of a kitchen, its front fixed."""
    w, h = size[0], size[2]
    # It is drawn like its neighbours, whose pulls reach 12 mm before their worktop.
    unit_body(m, (w, 0.6, h), k.top_h, k)
    worktop(m, w, (h - k.top_t, h), 0.6, k.worktop)
    panel(m, "flat", (-w / 2, w / 2), (k.plinth_h, h - k.top_t - 0.003), 0.251, k.look.front)


@catalogued(of_set=kitchen_set)
def upper_cabinet(m: Maker, size: Size, k: KitchenSet) -> None:
    """A kitchen's cupboard on the wall: one door or two, a flap, glass, or open shelves."""
    w, d, h = size
    hw = w / 2
    f, t = d - (0.022 if k.look.pull == "edge" else 0.049), 0.016
    with m.of(k.look.body):
        m.box(w, h, (0.0, 0.008))
        m.box(t, h, (0.008, f), left=-hw)
        m.box((hw - t, hw), h, (0.008, f))
        for y in (0.0, h * 0.36, h * 0.68, h - t):
            m.box(w - 2 * t, t, (0.008, f - 0.002), on=y)
    if not m.chance(0.12):
        fronts_of(m, k.upper_look, (-hw, hw), (0.0, h), f, m.pick([("door",), ("door",)],
            [("door",)], [("flap", "flap")]), True, Inside(_BACK_M, has_boards=False))
    else:
        m.box(t, (-0.0001, h), (f, d - 0.002), left=-hw, of=k.upper_look.front)
        m.box((hw - t, hw), (-0.0001, h), (f, d - 0.002), of=k.upper_look.front)
        m.box(w - 2 * t, t, (f, d), of=k.upper_look.front)
        m.box(w - 2 * t, (h - t, h), (f, d), of=k.upper_look.front)


@catalogued(of_set=kitchen_set, size=lambda m, k: (0.8, 0.6, k.top_h + 0.3))
def kitchen_sink(m: Maker, size: Size, k: KitchenSet) -> None:
    """A unit with a sink in its worktop: one bowl, two, or one with a drainer; many taps."""
    w, d, h = size
    hd = d / 2
    unit_body(m, size, k.top_h, k, has_top=False)
    m.box(w - 0.034, (k.top_h - k.top_t - 0.08, k.top_h - k.top_t), 0.016, against=hd - 0.065,
        of=k.look.body)
    fronts_of(m, k.look, (-w / 2, w / 2), (k.plinth_h, k.top_h - k.top_t - 0.003), hd - 0.049,
        [("door",), ("door",)] if m.chance(0.7) else [("drawer", "drawer")], False,
        Inside(-hd + _BACK_M, has_boards=False, top=k.top_h - 0.2))
    # The bowl, and a worktop of four pieces around it.
    basin = m.pick(STEEL, STEEL, CERAMIC, glossy("granite", (0.12, 0.12, 0.13), 0.4))
    form = m.weighted(0.4, 0.25, 0.25, 0.1)
    bw = (0.5, 0.72, 0.72, 0.44)[form]
    bd, z0 = 0.4, -0.005
    x0, x1, a, b = -bw / 2, bw / 2, z0 - bd / 2, z0 + bd / 2
    with m.of(k.worktop):
        m.box((-w / 2, x0), (k.top_h - k.top_t, k.top_h), (-hd, b))
        m.box((x1, w / 2), (k.top_h - k.top_t, k.top_h), (-hd, b))
        m.box((x0, x1), (k.top_h - k.top_t, k.top_h), (-hd, a))
    worktop(m, w, (k.top_h - k.top_t, k.top_h), d, k.worktop, b)
    with m.of(basin):
        match form:
            case 0:  # one bowl
                sink_bowl(m, 0.0, z0, 0.5, bd, k.top_h, 0.06)
            case 1:  # two
                sink_bowl(m, -0.18, z0, 0.36, bd, k.top_h, 0.05)
                sink_bowl(m, 0.18, z0, 0.36, bd, k.top_h, 0.05)
            case 2:  # one and a drainer
                sink_bowl(m, -0.15, z0, 0.42, bd, k.top_h, 0.06)
                m.box((0.06, x1), 0.013, (a, b), 0.002, on=k.top_h - 0.01)
                for i in range(6):
                    m.box((0.09, x1 - 0.03), 0.005, 0.01, 0.002, on=k.top_h + 0.002,
                        against=a + 0.05 + i * 0.05)
            case 3:  # round
                m.loft([(oval(0.36, 0.36, z=z0), k.top_h - 0.17),
                    (oval(0.43, 0.39, z=z0), k.top_h - 0.02), (rect(0.44, bd, 0.02, z=z0, n=5),
                    k.top_h - 0.001), (rect(0.46, bd + 0.02, 0.02, z=z0, n=5), k.top_h + 0.004),
                    (oval(0.39, 0.38, z=z0), k.top_h + 0.003), (oval(0.36, 0.35, z=z0),
                    k.top_h - 0.1), (oval(0.25, 0.25, z=z0), k.top_h - 0.15)])
    with m.moved(at=(0.0 if form != 2 else -0.15, 0.0, 0.0)):
        kitchen_tap(m, k.top_h, -hd + 0.06, h)


def sink_bowl(m: Maker, x: float, z: float, w: float, d: float, y: float, r: float) -> None:
    """A bowl w by d about (x, z), its rim at y, with its drain; r: of its corners."""
    m.loft(rings(rect, [(w - 0.04, d - 0.04, r, y - 0.19), (w - 0.014, d - 0.014, r, y - 0.16),
        (w - 0.002, d - 0.002, r, y - 0.001), (w, d, r, y + 0.002),
        (w - 0.02, d - 0.02, r, y + 0.003), (w - 0.03, d - 0.03, r, y - 0.14),
        (w - 0.1, d - 0.1, r, y - 0.175)], x=x, z=z))
    # A strainer in a ring, and the slots of an overflow under the back rim.
    m.revolve([(0.026, 0.0), (0.043, 0.0), (0.041, 0.004), (0.03, 0.003), (0.026, 0.0)], n=24,
        at=(x, y - 0.175, z), of=CHROME)
    m.cylinder(0.027, y - 0.1748, y - 0.1738, n=20, at=(x, 0.0, z), of=RUBBER)
    m.turned([(0.012, 0.0), (0.012, 0.002), (0.004, 0.004), (0.004, 0.009)], n=12,
        at=(x, y - 0.174, z), of=CHROME)
    for k in range(3):
        m.box(0.008, 0.014, 0.001, 0.0, x=x + 0.014 * (k - 1), on=y - 0.045,
            against=z - d / 2 + 0.0145, of=RUBBER)


def kitchen_tap(m: Maker, y: float, z: float, top: float) -> None:
    """From the worktop at y up to top: an arch, a bend, an angle or a pull-out."""
    material = m.pick(CHROME, CHROME, STEEL, BLACK_STEEL, m.metal)
    form, r, t = m.weighted(0.4, 0.3, 0.3), m.uniform(0.01, 0.014), top
    with m.of(material):
        m.turned([(0.028, y), (0.028, y + 0.006), (0.022, y + 0.012), (0.022, y + 0.05)], n=20,
            at=(0.0, 0.0, z))
        match form:
            case 0:  # an arch
                m.tube(bent([(0.0, y + 0.04, z), (0.0, t - r, z), (0.0, t - r, z + 0.2),
                    (0.0, t - 0.12, z + 0.2)], 0.09, n=6), r, n=10)
            case 1:  # a bend
                m.tube(bent([(0.0, y + 0.04, z), (0.0, t - r, z), (0.0, t - r, z + 0.2),
                    (0.0, t - 0.05, z + 0.2)], 0.03, n=3), r, n=10)
            case 2:  # an angle, its head pulls out
                m.tube(bent([(0.0, y + 0.04, z), (0.0, t - r - 0.06, z), (0.0, t - r, z + 0.22)],
                    0.05, n=4), r * 1.1, n=10)
                m.tube([(0.0, t - r - 0.004, z + 0.2), (0.0, t - r - 0.05, z + 0.215)], r, n=10)
        if m.chance(0.7):
            m.tube([(0.02, y + 0.035, z), (0.05, y + 0.045, z), (0.1, y + 0.075, z)], 0.005, n=6)
        else:
            for s in (-1.0, 1.0):
                m.rod((s * 0.015, s * 0.055), y + 0.03, z, 0.012)


def hob_top(m: Maker, w: float, d: float, y: float, z: float, kind: str,
    material: Material) -> None:
    """A hob over y: gas, ceramic, or solid plates, in w by d about z."""
    match kind:
        case "ceramic":
            m.board(w, d, y, y + 0.006, 0.01, 0.002, z=z, of=BLACK_GLASS)
            ring = glossy("ring", (0.3, 0.3, 0.31), 0.3)
            for x, c, r in ((-0.24, -0.22, 0.09), (0.24, -0.22, 0.075), (-0.24, 0.22, 0.075),
                (0.24, 0.22, 0.1)):
                m.ring((r * 0.97, r), (y + 0.0055, y + 0.0065), n=28, at=(x * w, 0.0, z + c * d),
                    of=ring)
        case "plates":
            m.board(w, d, y, y + 0.008, 0.015, 0.003, z=z, of=material)
            for x, c, r in ((-0.24, -0.22, 0.09), (0.24, -0.22, 0.073), (-0.24, 0.22, 0.073),
                (0.24, 0.22, 0.09)):
                m.turned([(r + 0.008, y + 0.006), (r + 0.006, y + 0.011), (r, y + 0.012),
                    (r, y + 0.019), (r * 0.3, y + 0.019), (r * 0.28, y + 0.016)], n=26,
                    at=(x * w, 0.0, z + c * d), of=CAST_IRON)
        case "gas":
            m.board(w, d, y, y + 0.008, 0.015, 0.003, z=z, of=material)
            for x, c, r in ((-0.24, -0.22, 0.05), (0.24, -0.22, 0.038), (-0.24, 0.22, 0.03),
                (0.24, 0.22, 0.042)):
                m.turned([(r + 0.012, y + 0.007), (r, y + 0.014), (r, y + 0.022),
                    (r - 0.008, y + 0.026)], n=18, at=(x * w, 0.0, z + c * d), of=CAST_IRON)
            # Grates: a frame over each side and four fingers a burner.
            with m.of(CAST_IRON):
                for s in (-0.24, 0.24):
                    a, b, c = s * w - 0.21 * w, s * w + 0.21 * w, 0.44 * d
                    for q in (-c, c):
                        m.box((a, b), 0.01, 0.01, 0.002, on=y + 0.034, z=z + q)
                    for x in (a, b):
                        m.box(0.01, 0.01, 2 * c, 0.002, x=x, on=y + 0.034, z=z)
                    m.box((a, b), 0.01, 0.01, 0.002, on=y + 0.034, z=z)
                    for q in (-0.22 * d, 0.22 * d):
                        for e in (-1.0, 1.0):
                            m.box((min(s * w + e * 0.06 * w, s * w + e * 0.21 * w),
                                max(s * w + e * 0.06 * w, s * w + e * 0.21 * w)), 0.008, 0.008,
                                0.0015, on=y + 0.036, z=z + q)
                    for x, q in product((a, b), (-c, c)):
                        m.box(0.01, 0.029, 0.01, x=x, on=y + 0.006, z=z + q)


def oven(m: Maker, x: Pair, y: Pair, z: Pair) -> None:
    """The interior of an oven: a cavity of dark enamel with a grid and a tray."""
    wall = 0.035
    shell(m, x, y, z, wall, _OVEN)
    a, b, c = x[0] + wall, x[1] - wall, (z[0] + 0.06, z[1] - 0.03)
    low, high = y[0] + wall, y[1] - wall
    rack(m, (a, b), low + 0.55 * (high - low), c, STEEL)
    m.box((a, b), 0.012, (c[0], c[1]), 0.003, on=low + 0.25 * (high - low), of=_OVEN)


def rack(m: Maker, x: Pair, y: float, z: Pair, material: Material, n: int = 8) -> None:
    """A grid of bars from front to back on two rails, at a height."""
    with m.of(material):
        for bar in z:
            m.box((x[0], x[1]), 0.006, 0.008, on=y, z=bar)
        for k in range(n):
            bar = x[0] + (x[1] - x[0]) * (k + 0.5) / n
            m.box(0.004, 0.004, (z[0], z[1]), x=bar, on=y + 0.001)


def oven_front(m: Maker, x: Pair, y: Pair, z: float, panel_h: float, material: Material, grip: str,
    has_knobs: bool, n: int) -> None:
    """An oven's door with its window and handle, in x and y before z.

    Its knobs or its display above.
    """
    a, b, c, d = x[0] + 0.002, x[1] - 0.002, y[0] + 0.002, y[1]
    w = b - a
    m.box((a, b), (d - panel_h, d - 0.001), 0.02, 0.002, against=z, of=material)
    e = d - panel_h - 0.004
    with m.hinged("door", at=(a, c, z + 0.02), axis=(1.0, 0.0, 0.0), upper_rad=_FALLING_RAD):
        m.box((a, b), (c, e), 0.02, 0.003, against=z, of=m.pick(BLACK_GLASS, material))
        m.box((a + 0.06, b - 0.06), (c + 0.07, e - 0.1), 0.0025, 0.001, against=z + 0.0195,
            of=BLACK_GLASS)
        pull(m, grip, (a + b) / 2, e - 0.04, z + 0.019, True, 0.8 * w,
            m.pick(STEEL, CHROME, BLACK_STEEL))
    knob = m.pick(RUBBER, STEEL, CHROME, WHITE)
    if has_knobs:
        for k in range(n):
            m.revolve([(0.0, 0.0), (0.02, 0.0), (0.018, 0.01), (0.016, 0.024), (0.0, 0.025)], n=14,
                front=(a + w * (k + 0.5) / n, d - panel_h / 2, z + 0.019), of=knob)
        if m.chance(0.4):
            m.box(0.1, 0.03, 0.0008, x=a / 2 + b / 2, on=d - panel_h / 2 - 0.015,
                against=z + 0.0199, of=BLACK_GLASS)
    else:
        m.box((a + 0.25 * w, b - 0.25 * w), (d - panel_h + 0.012, d - 0.012), 0.0008,
            against=z + 0.0199, of=BLACK_GLASS)


@catalogued()
def cooker(m: Maker, size: Size) -> None:
    """A freestanding cooker between the units.

    Hob, knobs, oven door, a drawer below; some have a lid or a splash back.
    """
    w, d, h = size
    hw = w / 2
    material = m.pick(ENAMEL, STEEL, STEEL, glossy("black enamel", (0.06, 0.06, 0.065), 0.25),
        glossy("cream enamel", (0.9, 0.86, 0.74), 0.2))
    kind = m.pick("gas", "gas", "ceramic", "plates")
    y, f = h - _HOB_M[kind], d / 2 - 0.049
    box = (-d / 2, f)
    m.board(w, d - 0.02, y - 0.012, y + 0.0005, 0.008, 0.003, z=-0.01, of=material)
    hob_top(m, w - 0.02, d - 0.09, y, -0.02, kind, material)
    for x, z in product((-hw + 0.05, hw - 0.05), (-d / 2 + 0.06, f - 0.06)):
        m.frustum((0.02, 0.0), (0.016, 0.06), n=10, at=(x, 0.0, z), of=RUBBER)
    drawer = m.uniform(0.14, 0.2) if m.chance(0.7) else 0.0
    if drawer > 0:
        hollow(m, (-hw, hw), (0.06, 0.062 + drawer), box, 0.012, material)
        with opens(m, "drawer", (-hw, hw), (0.065, 0.06 + drawer), f + 0.02, box[0]):
            m.box(w - 0.004, (0.065, 0.06 + drawer), 0.02, 0.003, against=f, of=material)
            drawer_box(m, (-hw + 0.012, hw - 0.012), (0.065, 0.06 + drawer), (box[0] + 0.012, f),
                STEEL)
    panel_h = m.pick(0.09, 0.1, 0.11)
    # The oven in a body of its sheet, and what its knobs turn above it.
    low, high = 0.06 + (drawer + 0.002 if drawer > 0 else 0.0), y - 0.016 - panel_h - 0.004
    shell(m, (-hw, hw), (low, high), box, 0.004, material)
    oven(m, (-hw + 0.004, hw - 0.004), (low + 0.004, high - 0.004), (box[0] + 0.004, f - 0.001))
    m.box(w, (high, y - 0.012), (box[0], f), of=material)
    oven_front(m, (-hw, hw), (0.064 + drawer, y - 0.016), f, panel_h, material,
        m.pick("bar", "bow", "square"), m.chance(0.8), m.pick(5, 6))


@catalogued(of_set=kitchen_set, size=lambda m, k: (0.6, 0.6, k.top_h))
def built_in_cooker(m: Maker, size: Size, k: KitchenSet) -> None:
    """An oven in a unit of the kitchen, a hob in the worktop over it."""
    w, d, h = size
    hw = w / 2
    kind = m.pick("ceramic", "ceramic", "ceramic", "gas", "plates")
    f = d / 2 - 0.049
    # Lower the worktop by the height of the hob.
    y = h - _HOB_M[kind]
    unit_body(m, (w, d, y), y, k)
    worktop(m, w, (y - k.top_t, y), d, k.worktop)
    hob_top(m, w - 0.02, 0.51, y - 0.001, -0.02, kind, m.pick(STEEL, ENAMEL, BLACK_GLASS))
    material = m.pick(STEEL, STEEL, BLACK_GLASS, ENAMEL)
    low, panel_h = y - k.top_t - 0.003 - 0.595, m.pick(0.09, 0.12)
    high, inner = y - k.top_t - 0.003 - panel_h - 0.004, (-hw + 0.0166, hw - 0.0166)
    oven(m, inner, (max(low, k.plinth_h + 0.017), high), (-d / 2 + 0.02, f - 0.001))
    m.box((inner[0], inner[1]), (high, y - k.top_t - 0.017), (-d / 2 + 0.02, f), of=material)
    oven_front(m, (-hw, hw), (low, y - k.top_t - 0.003), f, panel_h, material,
        m.pick("bar", "square", "bow"), m.chance(0.6), m.pick(2, 4))
    if low - k.plinth_h > 0.06:
        with opens(m, "drawer", (-hw, hw), (k.plinth_h, low), f + 0.019, -d / 2):
            drawer_front(m, k.look, (-hw, hw), (k.plinth_h, low), f)
            drawer_box(m, inner, (k.plinth_h, low), (-d / 2 + _BACK_M, f), k.look.body)


@dataclass(frozen=True, slots=True)
class Dishwasher:
    """Parameters of a dishwasher; if built in, it has the kitchen's front and ignores the rest."""

    built_in: bool
    front: Material
    panel: Material  # above the front, with keys and a display
    panel_m: Annotated[float, Range(0.06, 0.16)]
    pull: Annotated[str, Choice("bar", "square", "bow", "pocket")]
    pull_material: Material
    keys: Annotated[int, Range(0, 6)]
    key_material: Material


def draw_dishwasher(m: Maker, _size: Size, _k: KitchenSet) -> Dishwasher:
    """Draw a dishwasher's parameters."""
    front = m.pick(ENAMEL, STEEL, STEEL, BLACK_STEEL)
    return Dishwasher(m.chance(0.3), front, m.pick(front, front, BLACK_GLASS, BLACK_STEEL),
        m.pick(0.09, 0.11, 0.13), m.pick("bar", "square", "bow", "pocket"), m.pick(STEEL, CHROME),
        m.pick(3, 4, 5), m.pick(CHROME, RUBBER))


@catalogued(of_set=kitchen_set, draw=draw_dishwasher, size=lambda m, k: (0.6, 0.6, k.top_h))
def dishwasher(m: Maker, size: Size, k: KitchenSet, p: Dishwasher) -> None:
    """A dishwasher under the kitchen's worktop: a front of the kitchen, or its own with a panel."""
    w, d, h = size
    hw = w / 2
    f, y = d / 2 - 0.049, h - k.top_t - 0.003
    unit_body(m, size, k.top_h, k)
    worktop(m, w, (h - k.top_t, h), d, k.worktop)
    # A tub of steel with two baskets behind the door, which falls open.
    shell(m, (-hw + 0.0166, hw - 0.0166), (k.plinth_h + 0.0166, y - 0.014),
        (-d / 2 + _BACK_M, f - 0.001), 0.02, STEEL)
    for level in (k.plinth_h + 0.12, k.plinth_h + 0.42):
        for rim in (0.0, 0.09):
            rack(m, (-hw + 0.05, hw - 0.05), level + rim, (-d / 2 + 0.07, f - 0.03), WHITE_STEEL,
                n=12 if rim == 0 else 2)
    with m.hinged("door", at=(-hw, k.plinth_h, f + 0.02), axis=(1.0, 0.0, 0.0),
        upper_rad=_FALLING_RAD):
        dishwasher_front(m, k, (-hw, hw), y, f, p)


def dishwasher_front(m: Maker, k: KitchenSet, x: Pair, y: float, f: float, p: Dishwasher) -> None:
    """A front of the kitchen, or a maker's front with a panel, up to y before f."""
    hw, low = x[1], k.plinth_h
    if p.built_in:
        # Its keys are on the upper edge, a dark line over the front.
        drawer_front(m, k.look, x, (low, y - 0.012), f)
        m.box(2 * hw - 0.006, (y - 0.0095, y), 0.016, 0.0015, against=f, of=p.panel)
        return
    top = y - p.panel_m - 0.004
    m.box(2 * hw - 0.006, (low + 0.002, top), 0.02, 0.003, against=f, of=p.front)
    m.box(2 * hw - 0.006, (top + 0.004, y), 0.02, 0.003, against=f, of=p.panel)
    front, middle = f + 0.0199, top + 0.004 + p.panel_m / 2
    if p.pull == "pocket":
        m.box(0.26, 0.03, 0.001, against=front, on=middle - 0.024, of=RUBBER)
        m.box(0.28, 0.006, 0.012, 0.0025, against=front, on=middle + 0.006, of=p.front)
    else:
        pull(m, p.pull, 0.0, top - 0.04, f + 0.019, True, m.pick(0.42, 0.5), p.pull_material)
    clock(m, -0.75 * hw if p.pull == "pocket" else 0.0, middle, front)
    for i in range(p.keys):
        m.turned([(0.009, 0.0), (0.009, 0.002), (0.007, 0.0035)], n=12,
            front=(hw - 0.03 - i * 0.027, middle, front), of=p.key_material)
    m.box(0.05, 0.005, 0.0008, x=0.0, on=low + 0.05, against=front, of=CHROME)
    for i in range(8):  # air for drying
        m.box(0.03, 0.003, 0.0006, left=-hw + 0.04, on=low + 0.03 + 0.007 * i, against=front,
            of=RUBBER)


@catalogued()
def hood(m: Maker, size: Size) -> None:
    """An extractor over the cooker: a chimney, a pyramid, a dome, a glass plate, or a flat one."""
    w, d, h = size
    hd = d / 2
    material = m.pick(STEEL, STEEL, ENAMEL, glossy("black enamel", (0.06, 0.06, 0.065), 0.3),
        m.metal)
    form = m.weighted(0.3, 0.3, 0.2, 0.2) if h > 0.5 else 4
    # Everything is drawn from the wall, z = -d / 2.
    c, cd = 0.24, 0.26
    cz = -hd + cd / 2
    with m.of(material):
        if form < 4:
            # The chimney telescopes, or is of one piece.
            joint = m.pick(h, 0.55 * h, 0.62 * h)
            m.box(c, (0.1, joint), cd, 0.002, against=-hd)
            if joint < h:
                m.box(c - 0.006, (joint - 0.01, h), cd - 0.004, 0.001, against=-hd)
        match form:
            case 0:  # a beam
                m.box(w, 0.07, d, 0.002)
            case 1:  # a pyramid
                m.box(w, 0.045, d, 0.002)
                m.loft([(rect(w, d, 0.004), 0.044), (rect(c + 0.01, cd + 0.01, 0.004, z=cz), 0.26)])
            case 2:  # a dome
                m.loft(rings(d_shape, [(w, d, 0.5, 0.0), (w, d, 0.5, 0.02), (w * 0.9, d * 0.9, 0.5,
                    0.09), (c + 0.02, cd + 0.02, 0.3, 0.2)], column="share", back=-hd))
            case 3:  # a glass plate
                m.box(c + 0.1, (0.03, 0.09), (-hd, -hd + cd + 0.08), 0.003)
                m.board(w, d, 0.02, 0.03, 0.05, 0.002, of=glass((0.8, 0.9, 0.9), 0.3))
                m.box(c + 0.06, 0.02, cd, 0.002, against=-hd)
            case 4:  # flat
                m.box(w, 0.035, d, 0.002)
                m.box(w - 0.04, (0.035, h), (-hd, hd - 0.14), 0.003)
    filters = m.pick(1, 2, 2, 3)
    for a, b in row(-0.24, 0.24, filters, gap=0.008):
        m.box((a, b), (-0.002, 0.001), d - 0.2, 0.001, of=glossy("filter", (0.35, 0.35, 0.36), 0.4))
        m.box((a + 0.02, b - 0.02), (-0.003, 0.001), d - 0.26, of=STEEL)
    for x in m.pick((-0.18, 0.18), (-0.2, 0.0, 0.2), (0.0,)):  # lights
        m.cylinder(0.026, -0.0025, 0.001, n=16, at=(x, 0.0, hd - 0.055), of=CHROME)
    n = m.pick(3, 4, 5)
    for k in range(n):
        m.box(0.02, (0.012, 0.024), 0.002, x=0.035 * (k - (n - 1) / 2), against=hd - 0.001,
            of=m.pick(RUBBER, CHROME))
    if m.chance(0.35):  # a rail along the front edge
        m.rod((-w / 2 + 0.03, w / 2 - 0.03), 0.03, hd - 0.001, 0.005, of=STEEL)


@dataclass(frozen=True, slots=True)
class Fridge:
    """Parameters of a fridge."""

    body: Material
    doors: Annotated[str, Choice("one", "two", "beside", "over_drawer")]
    split: Annotated[float, Range(0.2, 0.8)]  # share of the height below the upper of two doors
    hinges_left: bool
    pull: Annotated[str, Choice("bar", "square", "bow", "none")]
    pull_material: Material
    retro: bool  # round edges, no grille
    display: bool
    water: bool  # a niche in a high door
    notes: bool


def draw_fridge(m: Maker, size: Size) -> Fridge:
    """Draw a fridge's parameters."""
    is_wide = size[0] > 0.8
    body = m.pick(ENAMEL, ENAMEL, STEEL, STEEL, glossy("black", (0.07, 0.07, 0.075), 0.25),
        glossy("enamel", m.pick((0.62, 0.75, 0.72), (0.75, 0.2, 0.16), (0.9, 0.86, 0.72),
        (0.35, 0.48, 0.58)), 0.2))
    grip = m.pick("bar", "square", "bow", *["none"] * (not is_wide))
    doors = m.pick("beside", "over_drawer") if is_wide else m.pick(*["two"] * 4, "one")
    retro = m.chance(0.25) and not is_wide
    return Fridge(body, doors, m.pick(0.38, 0.36, 0.68, 0.72), m.chance(0.5), grip,
        m.pick(STEEL, CHROME, CHROME, body), retro, grip == "none" or m.chance(0.2),
        m.chance(0.4 if is_wide else 0.12), m.chance(0.3) and not retro)


@catalogued(draw=draw_fridge)
def fridge(m: Maker, size: Size, p: Fridge) -> None:
    """A fridge.

    One door, a freezer below or above, two doors side by side, drawers below two doors, or a round one on feet.
    """
    w, d, h = size
    hw, cut = w / 2, p.split * h
    f, foot = d / 2 - (0.07 if p.pull == "none" else 0.1), 0.05
    # Its compartments from below: low, high, filling, number of doors.
    spaces = {"one": [(foot, h, "shelves", 1)],
        "two": [(foot, cut, "drawers" if cut < 0.6 * h else "shelves", 1), (cut, h, "shelves", 1)],
        "beside": [(foot, h, "shelves", 2)],
        "over_drawer": [(foot, 0.4 * h, "", 0), (0.4 * h, h, "shelves", 2)]}[p.doors]
    for c, e, filling, n_doors in spaces:
        fridge_space(m, (-hw, hw), (c, e), (-d / 2, f), p.body, 0.05 if p.retro else 0.006, filling)
        if n_doors == 0:
            with opens(m, "drawer", (-hw, hw), (c, e), f + 0.07, -d / 2), m.of(p.body):
                m.rounded(w - 0.004, (c, e - 0.002), 0.066, 0.01, n=1, against=f + 0.004)
                pull(m, p.pull, 0.0, e - 0.06, f + 0.069, True, 0.5 * w, p.pull_material)
                drawer_box(m, (-hw + 0.05, hw - 0.05), (c + 0.05, e - 0.05),
                    (-d / 2 + 0.08, f + 0.004), WHITE)
        for k in range(n_doors):
            span = (-hw, hw) if n_doors == 1 else ((-hw, -0.002), (0.002, hw))[k]
            is_left = p.hinges_left if n_doors == 1 else k == 0
            with m.hinged("door", at=(span[0] if is_left else span[1], c, f + 0.07),
                axis=(0.0, -1.0 if is_left else 1.0, 0.0), upper_rad=_FRIDGE_RAD):
                fridge_door(m, p, span, (c, e), f, is_left, n_doors == 2)
                if e == h and k == 0:
                    fridge_fittings(m, p, sum(span) / 2, (c, e), f + 0.0695)
    for x, z in product((-hw + 0.06, hw - 0.06), (-d / 2 + 0.06, f - 0.06)):
        m.frustum((0.022, 0.0), (0.018, foot + 0.01), n=10, at=(x, 0.0, z), of=RUBBER)
    if not p.retro:  # a grille before its feet
        m.box(w - 0.03, (0.008, foot - 0.004), 0.01, against=f - 0.02, of=RUBBER)
        for k in range(m.pick(0, 1, 2)):
            m.box(w - 0.1, 0.004, 0.002, on=0.018 + 0.012 * k, against=f - 0.0105, of=STEEL)


def fridge_door(m: Maker, p: Fridge, x: Pair, y: Pair, f: float, is_left: bool,
    is_pair: bool) -> None:
    """A door before f with its racks, a seal in the gap to the body, and what opens it.

    is_left: its hinges are there. is_pair: it has another beside it.
    """
    (a, b), (c, e) = x, y
    door_racks(m, (a + 0.06, b - 0.06), y, f)
    m.frame((a + 0.012, b - 0.012), (c + 0.012, e - 0.012), 0.014, (f, f + 0.0045), of=RUBBER)
    grip_x = b - 0.05 if is_left else a + 0.05
    if is_pair:
        m.rounded((a + 0.002, b - 0.002), (c + 0.003, e), 0.066, 0.01, n=1, against=f + 0.004,
            of=p.body)
        level, long = (c + e) / 2, 0.5 * (e - c)
    else:
        m.rounded((a + 0.001, b - 0.001), (c + 0.002, e - 0.002), 0.064, 0.05 if p.retro else 0.008,
            n=3 if p.retro else 1, against=f + 0.006, of=p.body)
        long = min(0.34, 0.6 * (e - c))
        level = c + 0.52 * (e - c) if e - c > 1.2 else c + min(0.28, 0.5 * (e - c))
        level = e - 0.2 if c < 0.1 and p.doors == "two" and p.split < 0.6 else level
    pull(m, p.pull, grip_x, level, f + 0.069, False, long, p.pull_material)
    if p.pull == "none":
        # A dark groove for fingers.
        m.box(0.016, (c + 0.06, min(e - 0.06, c + 0.9)), 0.0008,
            left=b - 0.03 if is_left else a + 0.014, against=f + 0.0695, of=RUBBER)


def fridge_fittings(m: Maker, p: Fridge, x: float, y: Pair, z: float) -> None:
    """A display, a niche for water, a badge and notes on a fridge's door before z."""
    if p.water and y[1] - y[0] > 0.8:
        low = y[0] + 0.5 * (y[1] - y[0])
        m.box(0.2, 0.3, 0.0012, 0.0005, x=x, on=low, against=z, of=BLACK_GLASS)
        m.frame((x - 0.085, x + 0.085), (low + 0.015, low + 0.2), 0.008, 0.004, 0.001, against=z,
            of=STEEL)
        m.box(0.05, 0.03, 0.014, 0.003, x=x, on=low + 0.165, against=z, of=RUBBER)
        m.box(0.13, 0.006, 0.012, 0.001, x=x, on=low + 0.022, against=z, of=STEEL)
        clock(m, x, low + 0.25, z + 0.0012)
    elif p.display:
        m.box(0.1, 0.1, 0.0013, x=x, on=y[1] - 0.3, against=z, of=BLACK_GLASS)
        clock(m, x, y[1] - 0.24, z + 0.0012)
    if m.chance(0.7):
        m.box(m.pick(0.05, 0.08), 0.009, 0.0012, x=x, on=y[1] - 0.1, against=z, of=CHROME)
    for _ in range(m.integers(2, 7) if p.notes else 0):
        wide, high = m.uniform(0.05, 0.1), m.uniform(0.05, 0.12)
        at = x + m.uniform(-0.12, 0.12), y[0] + (y[1] - y[0]) * m.uniform(0.5, 0.86)
        m.box(wide, high, 0.0006, x=at[0], on=at[1], against=z + 0.0014 * m.integers(0, 6),
            of=plain("note", m.pick((0.93, 0.92, 0.88), m.any_colour()), 0.9))
        m.turned([(0.012, 0.0), (0.012, 0.003), (0.01, 0.005)], n=12, front=(at[0],
            at[1] + high - 0.012, z + 0.0078), of=m.coloured("magnet", 0.4))


def fridge_space(m: Maker, x: Pair, y: Pair, z: Pair, material: Material, r: float,
    filling: str) -> None:
    """A compartment of a fridge: foam between sheet and a white liner; 'shelves' or 'drawers' in it."""
    wall = 0.045
    shell(m, x, y, z, wall, material, r, liner=WHITE)
    a, b, c = x[0] + wall + 0.003, x[1] - wall - 0.003, (z[0] + wall + 0.003, z[1] - 0.1)
    low, high = y[0] + wall + 0.003, y[1] - wall - 0.003
    n = max(1, round((high - low) / 0.26))
    if filling == "drawers":
        for drawer in row(low - 0.004, high - 0.004, n, gap=0.02):
            m.box((a + 0.004, b - 0.004), drawer, (c[0], c[1] + 0.04), 0.006, of=CLEAR_PLASTIC)
    for k in range(1, n) if filling == "shelves" else ():
        level = low + (high - low) * k / n
        m.box((a, b), 0.005, (c[0], c[1]), on=level, of=CLEAR_PLASTIC)
        m.box((a, b), 0.014, 0.012, on=level - 0.004, against=c[1] - 0.012, of=WHITE)


def door_racks(m: Maker, x: Pair, y: Pair, z: float) -> None:
    """Racks for bottles on the inside of a fridge's door at z."""
    n = max(1, round((y[1] - y[0]) / 0.4))
    for k in range(n):
        level = y[0] + 0.08 + (y[1] - y[0] - 0.12) * k / n
        with m.of(WHITE):
            m.box((x[0], x[1]), 0.006, 0.076, on=level, against=z - 0.07)
            m.box((x[0], x[1]), 0.064, 0.004, on=level + 0.006, against=z - 0.07)
            for a in (x[0], x[1] - 0.004):
                m.box(0.004, 0.064, 0.072, left=a, on=level + 0.006, against=z - 0.066)


def holed_plate(x: Pair, y: Pair, z: Pair, middle: Pair, r: float) -> Surface:
    """A plate in x and y, from z[0] to its front z[1], with a round hole of radius r about a point."""
    n = 36  # corners of the hole
    t = 2 * np.pi * (np.arange(n) + 0.5) / n
    way = np.stack([np.cos(t), np.sin(t)], -1)
    centre = np.array(middle)
    # From the hole's rim straight out to the plate's edge; its corners go to the nearest of them.
    low, high = np.array([x[0], y[0]]) - centre, np.array([x[1], y[1]]) - centre
    with np.errstate(divide="ignore"):
        reach = np.minimum(*np.where(way > 0, high / way, low / way).T)
    edge = way * reach[:, None]
    for corner in ((low[0], low[1]), (high[0], low[1]), (high[0], high[1]), (low[0], high[1])):
        edge[np.argmax(way @ np.array(corner))] = corner
    flat = np.concatenate([edge, r * way]) + centre
    points = np.concatenate([np.c_[flat, np.full(2 * n, level)] for level in z])
    i, j = np.arange(n), (np.arange(n) + 1) % n
    outer, inner, front = 0, n, 2 * n

    def quads(a: int, b: int) -> I32:
        """Two triangles from ring a to ring b, seen from where a is left of b going round."""
        return np.concatenate([np.stack([a + i, a + j, b + j], -1),
            np.stack([a + i, b + j, b + i], -1)])

    faces = np.concatenate([quads(front + outer, front + inner), quads(inner, outer),
        quads(outer, front + outer), quads(front + inner, inner)])
    return creased("plate", points, faces, radians(40))


@catalogued()
def washing_machine(m: Maker, size: Size) -> None:
    """A machine with a round door in its front: drawer, dial and display above it."""
    w, d, h = size
    hw = w / 2
    material = m.pick(ENAMEL, ENAMEL, ENAMEL, glossy("grey", (0.55, 0.56, 0.58), 0.3), STEEL,
        glossy("black", (0.1, 0.1, 0.105), 0.3))
    f, foot, strip = d / 2 - 0.045, 0.02, m.uniform(0.09, 0.13)
    with m.of(material):
        m.board(w, d - 0.045, h - 0.028, h, 0.02, 0.006, z=-0.0225)
        m.box(w - 0.006, (h - 0.03 - strip, h - 0.032), 0.012, 0.003, against=f)
    y, r, x = (foot + (h - strip - foot) * m.uniform(0.5, 0.55), m.uniform(0.16, 0.2),
        m.pick(0.0, 0.0, 0.0, -0.02))
    frame = m.pick(CHROME, STEEL, material, glossy("dark hoop", (0.15, 0.15, 0.16), 0.3))
    # A body with a round hole in its front, and the drum behind it.
    shell(m, (-hw, hw), (foot, h - 0.03), (-d / 2, f - 0.012), 0.008, material)
    m.add(holed_plate((-hw, hw), (foot, h - 0.03), (f - 0.012, f), (x, y), r - 0.05), of=material)
    drum = min(0.24, hw - 0.03, y - foot - 0.02, h - 0.05 - y)
    m.vessel([(0.0, 0.0), (drum, 0.0), (drum, d - 0.12), (r - 0.052, d - 0.09)], 0.004, n=36,
        front=(x, y, f - 0.003 - (d - 0.09)), of=STEEL)
    # Counterweights, above the drum behind the drawer and below the drum.
    with m.of(plain("concrete", (0.5, 0.5, 0.5), 0.9)):
        m.box(0.42, (y + drum + 0.015, y + drum + 0.115), (0.03 - d / 2, 0.21 - d / 2))
        m.box(0.3, (foot + 0.012, foot + 0.062), (0.05 - d / 2, 0.35 - d / 2))
    with m.hinged("door", at=(x - r, y, f + 0.018), axis=(0.0, -1.0, 0.0), upper_rad=_MACHINE_RAD):
        with m.moved(at=(x, y, f), turn=LYING_ALONG_Z):
            m.revolve([(r - 0.045, 0.0), (r, 0.0), (r, 0.018), (r - 0.012, 0.03), (r - 0.04, 0.026),
                (r - 0.045, 0.012), (r - 0.045, 0.0)], n=36, of=frame)
            m.revolve([(0.0, 0.0), (r - 0.044, 0.0), (r - 0.044, 0.013), (r * 0.45, 0.03),
                (0.0, 0.036)], n=32, of=BLACK_GLASS)
        if m.chance(0.7):
            m.box(0.022, 0.08, 0.026, 0.004, left=x + r - 0.03, on=y - 0.04, against=f + 0.01,
                of=frame)
    # The drawer at the left, the dial in the middle or at the right, a display.
    drawer_y = (h - 0.03 - strip + 0.015, h - 0.045)
    with m.sliding("drawer", along=(0.0, 0.0, 1.0), upper_m=0.18):
        m.box(0.16, (drawer_y[0], drawer_y[1]), 0.0045, 0.003, left=-hw + 0.02, against=f + 0.0115,
            of=material)
        drawer_box(m, (-hw + 0.01, -hw + 0.19), (drawer_y[0] - 0.01, drawer_y[1] + 0.02),
            (f - 0.22, f + 0.0115), material)
    m.revolve([(0.0, 0.0), (0.028, 0.0), (0.026, 0.014), (0.0, 0.016)], n=20, front=(m.pick(0.0,
        0.06, 0.22 * w), h - 0.03 - strip / 2, f + 0.012), of=m.pick(CHROME, material, RUBBER))
    m.box(0.1, 0.036, 0.0009, left=hw - 0.2, on=h - 0.03 - strip / 2 - 0.018, against=f + 0.0119,
        of=BLACK_GLASS)
    for k in range(m.pick(2, 3, 4)):
        m.box(0.012, 0.01, 0.0031, left=hw - 0.085 + k * 0.02, on=h - 0.03 - strip / 2 - 0.005,
            against=f + 0.0119, of=m.pick(CHROME, RUBBER))
    if m.chance(0.5):
        m.box(0.12, 0.06, 0.003, left=-hw + 0.05, on=foot + 0.03, against=f, of=material)
    for x, z in product((-hw + 0.05, hw - 0.05), (-d / 2 + 0.05, f - 0.05)):
        m.cylinder(0.022, 0.0, foot + 0.005, n=10, at=(x, 0.0, z), of=RUBBER)
