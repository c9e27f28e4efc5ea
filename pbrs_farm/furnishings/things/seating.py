"""Sofas, armchairs, chairs, stools and benches; no effects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Annotated

from numpy import cos, pi, sin

from pbrs_farm.core.catalogue import Place
from pbrs_farm.core.classes import CHAIR
from pbrs_farm.core.frames import rotation_x
from pbrs_farm.core.house import Material
from pbrs_farm.dress.thing_materials import (
    BLACK_STEEL,
    CHROME,
    STEEL,
    WHITE,
    WHITE_STEEL,
    WICKER,
    glossy,
    plain,
)
from pbrs_farm.furnishings.things.catalogued import catalogued
from pbrs_farm.furnishings.things.cloth import chair_shell, tub
from pbrs_farm.furnishings.things.joints import Inside, Look, fronts_of, hollow
from pbrs_farm.furnishings.things.maker import Maker, Size, thing
from pbrs_farm.furnishings.things.parameters import Choice, Range
from pbrs_farm.furnishings.things.shapes import Pair, on_side, row
from pbrs_farm.geometry.bodies import frustum, sheared
from pbrs_farm.geometry.outlines import bent, gathered, oval, rect, rings, spaced


# fmt: off
@thing(group="ottoman", nyu40=CHAIR, place=Place.FLOOR)
def ottoman(m: Maker) -> None:
    """A square seat without a back: on feet, in a skirt, or a box; buttons on some."""
    w, d, h = m.uniform(0.45, 0.85), m.uniform(0.42, 0.55), m.uniform(0.36, 0.44)
    form = m.weighted(0.4, 0.35, 0.25)
    low = 0.03 if form == 2 else m.uniform(0.1, 0.16)
    with m.of(m.cloth()):
        m.rounded(w - 0.012, (low, h - 0.08), d - 0.012, 0.02, n=1)
        m.bulged((w, 0.13, d), n=10, edge=0.7, bulge=5.0, at=(0.0, h - 0.065, 0.0))
        if form == 1:
            skirt(m, w, d, low + 0.06, (m.uniform(0.1, 0.16), m.pick(0.003, 0.006, 0.009)))
        if m.chance(0.4):
            for x, z in product((-0.22, 0.0, 0.22), (-0.2, 0.2)):
                m.sphere((x * w, h - 0.004, z * d), 0.011, n=6)
    m.legs(m.pick("tapered", "bun", "square"), w, d, low + 0.004, 0.045, 0.06,
        of=m.pick(m.timber, m.dark_timber, BLACK_STEEL))


@thing(group="stool", nyu40=CHAIR, place=Place.FLOOR)
def stool(m: Maker) -> None:
    """A round seat of wood on three or four legs that lean outwards."""
    r, tall = m.uniform(0.15, 0.19), m.uniform(0.42, 0.5)
    white = plain("stool white", (0.88, 0.88, 0.86), 0.4)
    board = plain("stool " + m.style.wood.name, m.wood, 0.45)
    m.turned([(r - 0.006, 0), (r, 0.008), (r, 0.022), (r - 0.006, 0.03)], n=28,
        at=(0, tall - 0.03, 0), of=board)
    leg, n = frustum((0.013, 0), (0.018, 1.0), n=12), m.integers(3, 5)
    with m.of(white if m.chance(0.3) else board):
        for k in range(n):
            x, z = cos(2 * pi * (k + 0.5) / n), sin(2 * pi * (k + 0.5) / n)
            m.add(sheared(leg, (x * (r - 0.005), 0, z * (r - 0.005)),
                (x * (r - 0.07), tall - 0.028, z * (r - 0.07))))


def seat_legs(m: Maker, kind: str, w: float, d: float, high: float, material: Material) -> None:
    """Legs of a sofa or armchair, w by d, up to `high`.

    Tapered, square, round, a sled, a plinth, buns.
    """
    hd = d / 2
    match kind:
        case "plinth":
            m.box(w - 0.08, high + 0.002, (-hd + 0.04, hd - 0.06), of=material)
        case "sled":
            for x in (-w / 2 + 0.1, w / 2 - 0.1):
                m.tube(bent([(x, high + 0.01, -hd + 0.08), (x, 0.008, -hd + 0.08),
                    (x, 0.008, hd - 0.08), (x, high + 0.01, hd - 0.08)], 0.03, n=3), 0.008,
                    of=material)
    if kind not in ("plinth", "sled"):
        m.legs(kind, w, d, high + 0.002, 0.05, 0.08, 0.03 if kind == "tapered" else 0.0,
            of=material)
    if w > 1.5 and kind not in ("plinth", "sled"):
        m.leg(kind, (0.0, 0.0), high + 0.002, 0.05, of=material)


def skirt(m: Maker, w: float, d: float, high: float, fold: Sequence[float]) -> None:
    """Cloth round a seat w by d, from `high` almost down to the floor, its folds wider below.

    fold: length and depth of a fold.
    """
    length, deep = fold
    m.loft([(gathered(w + 0.012, d + 0.012, length, deep), 0.012),
        (gathered(w + 0.012, d + 0.012, length, 0.3 * deep), high)], sharp=80.0)


@dataclass(frozen=True, slots=True)
class Sofa:
    """Parameters of a sofa."""

    seats: Annotated[int, Range(1, 5)]
    arms: Annotated[str, Choice("box", "round", "slope", "thin", "low", "wood")]
    back: Annotated[
        str, Choice("cushions", "firm", "tufted", "one")
    ]  # one: a single seat cushion, a plain back
    cloth: Material
    feet: Annotated[str, Choice("tapered", "square", "round", "sled", "plinth", "bun")]
    feet_material: Material
    foot_m: Annotated[float, Range(0.03, 0.3)]
    seat_m: Annotated[float, Range(0.3, 0.6)]  # height
    arm_width_m: Annotated[float, Range(0.06, 0.4)]
    arm_m: Annotated[float, Range(0.45, 0.9)]  # height
    back_m: Annotated[float, Range(0.08, 0.4)]  # thickness
    seat_edges: tuple[Annotated[float, Range(0.01, 0.1)], ...]  # radius of each seat cushion
    cushion_m: Annotated[float, Range(0.08, 0.3)]  # thickness of the back cushions
    skirt: bool  # of cloth, round feet that are not tall
    skirt_fold: tuple[Annotated[float, Range(0.001, 0.3)], ...]  # length and depth of its folds
    throw: Annotated[str, Choice("none", "left", "right")]  # over an arm
    throw_cloth: Material


def draw_sofa(m: Maker, size: Size) -> Sofa:
    """Draw a sofa's parameters."""
    cloth = m.cloth()
    feet = m.pick("tapered", "square", "round", "sled", "plinth", "bun")
    feet_material = m.pick(m.timber, m.dark_timber, m.metal, BLACK_STEEL)
    foot = 0.06 if feet in ("plinth", "bun") else m.pick(0.1, 0.14, 0.17)
    seat = m.uniform(0.4, 0.45)
    arms = m.pick("box", "box", "round", "slope", "thin", "low", "wood")
    arm_width = 0.1 if arms in ("thin", "wood") else m.uniform(0.15, 0.24)
    arm = seat + (0.1 if arms == "low" else m.uniform(0.16, 0.24))
    n = 2 if size[0] < 1.8 else m.pick(2, 3, 3)
    style = m.pick("cushions", "cushions", "firm", "tufted", "one")
    back = m.uniform(0.14, 0.2)
    edges = tuple(m.uniform(0.035, 0.06) for _ in range(1 if style == "one" else n))
    cushion = m.uniform(0.15, 0.2) if style == "cushions" else 0.17
    has_skirt, fold = False, (0.13, 0.006)
    if arms != "wood" and feet in ("plinth", "bun", "square") and (has_skirt := m.chance(0.5)):
        fold = (m.uniform(0.1, 0.16), m.pick(0.003, 0.006, 0.009))
    throw, throw_colour = "none", m.style.accent
    if arms in ("box", "round", "low") and m.chance(0.2):
        throw = m.pick("left", "right")
        throw_colour = m.style.accent if m.chance(0.4) else m.textile()
    return Sofa(n, arms, style, cloth, feet, feet_material, foot, seat, arm_width, arm, back, edges,
        cushion, has_skirt, fold, throw, plain("fabric throw", throw_colour, 0.95))


@catalogued(draw=draw_sofa)
def sofa(m: Maker, size: Size, p: Sofa) -> None:
    """A sofa of two or three seats.

    Arms, backs, cushions and feet of many kinds; some have a throw over an arm.
    """
    w, d, _h = size
    hw, hd, low, base = w / 2, d / 2, p.foot_m, p.foot_m + 0.12
    seat_legs(m, p.feet, w, d, low, p.feet_material)
    inset = 0.02 if p.arms == "wood" else 0.0
    with m.of(p.cloth):
        m.rounded(w - 2 * inset, (low, base + 0.04), (-hd + 0.01, hd - 0.015), 0.02, n=1)
        sofa_cushions(m, size, p, base)
        for s in (-1.0, 1.0):
            sofa_arm(m, size, p, on_side(s, hw - p.arm_width_m, hw))
        if p.skirt:
            skirt(m, w, d, base + 0.03, p.skirt_fold)
    if p.throw != "none":
        x = (hw - p.arm_width_m / 2) * (1 if p.throw == "right" else -1)
        m.rounded(p.arm_width_m + 0.016, 0.208, 0.38, 0.03, x=x, on=p.arm_m - 0.2, z=0.09,
            of=p.throw_cloth)


def sofa_cushions(m: Maker, size: Size, p: Sofa, base: float) -> None:
    """The back, and the cushions of seats and back, between the arms."""
    w, d, h = size
    hd, n, seat = d / 2, p.seats, p.seat_m
    x, back = (-w / 2 + p.arm_width_m, w / 2 - p.arm_width_m), -hd + p.back_m
    wide = x[1] - x[0]
    top = h - (0.0 if p.back in ("firm", "one") else 0.07)
    m.rounded((x[0] - 0.02, x[1] + 0.02), (p.foot_m, top), p.back_m, 0.05, n=1, against=-hd)
    n_seats = 1 if p.back == "one" else n
    for k, part in enumerate(row(*x, n_seats, gap=0.006)):
        m.rounded(part, (base + 0.03, seat), (back - 0.02, hd), p.seat_edges[k % len(p.seat_edges)],
            n=2 if n_seats < 3 else 1)
    match p.back:
        case "cushions":
            t, tall = p.cushion_m, h - seat + 0.02
            for k in range(n):
                m.bulged((wide / n - 0.01, t, tall), n=7, edge=0.45, bulge=3.4,
                    turn=rotation_x(pi / 2 - 0.16), at=(x[0] + wide * (k + 0.5) / n,
                    seat + tall / 2 - 0.02, back + t * 0.42))
        case "firm":
            for part in row(*x, n, gap=0.006):
                m.rounded(part, (seat - 0.01, h - 0.015), 0.12, 0.04, against=back - 0.03)
        case "tufted":
            m.rounded(x, (seat - 0.01, h), 0.09, 0.04, against=back - 0.03)
            for i, k in product(range(2), range(3 * n)):
                m.sphere((x[0] + wide * (k + 0.5 + 0.25 * (i - 0.5)) / (3 * n),
                    seat + (h - seat) * (0.38 + 0.32 * i), back + 0.062), 0.011, n=5)


def sofa_arm(m: Maker, size: Size, p: Sofa, x: Pair) -> None:
    """An arm between two x."""
    _w, d, _h = size
    hd, low, top, wide = d / 2, p.foot_m, p.arm_m, p.arm_width_m
    middle = (x[0] + x[1]) / 2
    match p.arms:
        case "box" | "thin" | "low":
            r = 0.05 if p.arms == "low" else 0.03
            m.rounded(x, (low, top), (-hd + 0.005, hd - 0.01), r)
        case "round":
            m.rounded((x[0] + 0.02, x[1] - 0.02), (low, top - 0.04), (-hd + 0.01, hd - 0.02), 0.02,
                n=1)
            m.rod(middle, top - wide * 0.5, (-hd + 0.005, hd - 0.01), wide * 0.5, n=16)
        case "slope":
            upright = rect(wide, d - 0.01, 0.025, x=middle)
            m.loft([(rect(wide - 0.01, d - 0.02, 0.02, x=middle), low), (upright, low + 0.05),
                (upright, p.seat_m), (rect(wide, d * 0.75, 0.025, x=middle, z=-d * 0.12),
                top - 0.02), (rect(wide - 0.03, d * 0.7, 0.02, x=middle, z=-d * 0.12), top)])
        case "wood":
            with m.of(m.timber):
                m.box((x[0] + 0.01, x[1] - 0.01), (top - 0.035, top), d - 0.04, 0.006)
                for z in (-hd + 0.06, hd - 0.1):
                    m.box(0.04, (low * 0.5, top - 0.034), 0.045, 0.004, x=middle, against=z)


@catalogued()
def chaise_sofa(m: Maker, size: Size) -> None:
    """A sofa with one seat long enough for a person at full length."""
    w, d, h = size
    hw, hd = w / 2, d / 2
    material, s = m.cloth(), m.pick(-1.0, 1.0)
    low, seat, aw, back, main = m.pick(0.06, 0.1, 0.14), 0.43, m.uniform(0.12, 0.22), 0.17, 0.95
    ah, wide = seat + m.uniform(0.14, 0.22), 0.36 * w
    z1 = -hd + main
    for x, z in ((-hw + 0.1, -hd + 0.1), (hw - 0.1, -hd + 0.1), (-s * (hw - 0.1), z1 - 0.1),
        (s * (hw - 0.1), hd - 0.1), (s * (hw - wide + 0.1), hd - 0.1)):
        m.leg(m.pick("tapered", "square", "round"), (x, z), low + 0.002, 0.05, of=m.timber)
    with m.of(material):
        m.rounded(w, 0.16, (-hd + 0.01, z1 - 0.01), 0.02, n=1, on=low)
        a, b = on_side(s, hw - wide, hw)
        m.rounded((a, b), 0.16, (z1 - 0.1, hd - 0.01), 0.02, n=1, on=low)
        m.rounded((a + (0.003 if s > 0 else aw), b - (aw if s > 0 else 0.003)), (low + 0.15, seat),
            (-hd + back - 0.02, hd), 0.05)
        c, e = (-hw + aw, a) if s > 0 else (b, hw - aw)
        for part in row(c, e, 2, gap=0.006):
            m.rounded(part, (low + 0.15, seat), (-hd + back - 0.02, z1), 0.05)
        m.rounded(w - 2 * aw + 0.04, (low, h - 0.06), back, 0.05, against=-hd)
        for x in (-1.0, 0.0, 1.0):
            m.bulged(((w - 2 * aw) / 3 - 0.01, 0.18, h - seat + 0.02), n=7, edge=0.45, bulge=3.4,
                turn=rotation_x(pi / 2 - 0.16), at=(x * (w - 2 * aw) / 3,
                seat + (h - seat) / 2 - 0.01, -hd + back + 0.075))
        m.rounded((-hw, aw - hw), (low, ah), (-hd + 0.005, z1 - 0.02), 0.04, mirrored="x")


@catalogued()
def armchair(m: Maker, size: Size) -> None:
    """An armchair: boxy, with wings, a tub, of bent wood, a shell on legs, a wooden frame."""
    w, d, h = size
    hw, hd = w / 2, d / 2
    material = m.cloth()
    form = (m.weighted(0.28, 0.18, 0.2, 0.18, 0.16) if h > 0.86 else m.weighted(0.36, 0.0, 0.28,
        0.18, 0.18))
    feet, feet_stuff = (m.pick("tapered", "square", "round", "sled"),
        m.pick(m.timber, m.timber, m.dark_timber, m.metal, BLACK_STEEL))
    low, seat = m.pick(0.12, 0.16, 0.2), m.uniform(0.4, 0.44)
    match form:
        case 0:  # boxy
            aw, ah = m.uniform(0.1, 0.18), seat + m.uniform(0.14, 0.2)
            seat_legs(m, feet, w, d, low, feet_stuff)
            with m.of(material):
                m.rounded(w, (low, seat - 0.11), (-hd + 0.005, hd - 0.012), 0.02, n=1)
                m.rounded(w - 2 * aw - 0.004, (seat - 0.12, seat), (-hd + 0.12, hd), 0.05)
                m.rounded(w - 0.04, (low, h - 0.03), 0.15, 0.06, against=-hd)
                m.bulged((w - 2 * aw - 0.01, 0.16, h - seat + 0.03), n=7, edge=0.45, bulge=3.2,
                    turn=rotation_x(pi / 2 - 0.18), at=(0.0, seat + (h - seat) / 2 - 0.015,
                    -hd + 0.21))
                m.rounded((-hw, aw - hw), (low, ah), (-hd + 0.01, hd - 0.015), min(0.05, 0.4 * aw),
                    mirrored="x")
        case 1:  # with wings
            seat_legs(m, m.pick("tapered", "turned"), w, d - 0.04, low, feet_stuff)
            with m.of(material):
                m.rounded(w - 0.04, (low, seat - 0.1), (-hd + 0.04, hd - 0.01), 0.03, n=1)
                m.rounded(w - 0.24, (seat - 0.11, seat), (-hd + 0.16, hd), 0.05)
                m.loft(rings(rect, [(w - 0.1, 0.2, 0.06, -hd + 0.12, low), (w - 0.1, 0.17, 0.06,
                    -hd + 0.09, h * 0.7), (w - 0.12, 0.14, 0.06, -hd + 0.07, h - 0.03), (w - 0.18,
                    0.08, 0.03, -hd + 0.07, h)], column="z"))
                for s in (-1.0, 1.0):
                    m.rounded(on_side(s, hw - 0.12, hw), (low, seat + 0.2), (-hd + 0.05, hd - 0.03),
                        0.05)
                    m.rounded(on_side(s, hw - 0.1, hw), (seat + 0.12, h - 0.04), 0.28, 0.05,
                        against=-hd + 0.02)
        case 2:  # a tub: a back that runs round into the arms
            ah = seat + m.uniform(0.12, 0.2) if m.chance(0.5) else h - 0.02
            m.legs("tapered" if feet == "sled" else feet, w, d, low + 0.02, 0.045, 0.14, 0.05,
                of=feet_stuff)
            with m.of(material):
                m.loft(rings(oval, [(w * 0.86, d * 0.86, low), (w * 0.96, d * 0.96, low + 0.05),
                    (w * 0.97, d * 0.97, seat - 0.1)], n=26, power=2.6))
                m.rounded(w - 0.24, (seat - 0.11, seat), (-hd + 0.14, hd - 0.005), 0.06)
                m.add(tub(w, d, seat - 0.12, ah, h, 0.11))
        case 3:  # bent wood with loose cushions
            frame = m.pick(m.timber, m.timber, m.dark_timber, BLACK_STEEL)
            with m.of(frame):
                for s in (-1.0, 1.0):
                    x = s * (hw - 0.02)
                    m.tube(bent([(x, 0.018, hd - 0.1), (x, seat + 0.18, hd - 0.03),
                        (x, seat + 0.2, -hd + 0.12), (x, 0.018, -hd + 0.03)], 0.09, n=4), 0.018)
                    m.tube([(s * (hw - 0.04), seat - 0.12, hd - 0.08),
                        (s * (hw - 0.04), seat - 0.18, -hd + 0.15)], 0.014)
                for z, y in ((hd - 0.1, seat - 0.13), (-hd + 0.2, seat - 0.18)):
                    m.rod((-hw + 0.02, hw - 0.02), y, z, 0.014)
                m.rod((-hw + 0.03, hw - 0.03), h - 0.12, -hd + 0.045, 0.014)
                for x in (-0.5, 0.0, 0.5):
                    m.tube([(x * w * 0.6, seat - 0.18, -hd + 0.16),
                        (x * w * 0.6, h - 0.1, -hd + 0.045)], 0.01, n=6)
            with m.of(material):
                m.bulged((w - 0.1, 0.13, d - 0.16), n=7, edge=0.6, bulge=5.0, turn=rotation_x(0.08),
                    at=(0.0, seat - 0.07, 0.075))
                m.bulged((w - 0.1, 0.13, h - seat + 0.1), n=7, edge=0.6, bulge=5.0,
                    turn=rotation_x(pi / 2 - 0.22), at=(0.0, seat + (h - seat) / 2 - 0.035,
                    -hd + 0.205))
        case 4:  # a shell on four legs or a swivel foot
            if m.chance(0.35):
                m.turned([(0.26, 0.0), (0.25, 0.012), (0.03, 0.03), (0.03, 0.3)], n=28,
                    of=m.pick(CHROME, BLACK_STEEL, STEEL))
            else:
                m.legs("tapered", w, d, 0.3, 0.04, 0.22, 0.14, of=feet_stuff)
            with m.of(material):
                m.loft(rings(oval, [(w * 0.5, d * 0.5, 0.29), (w * 0.8, d * 0.8, 0.33),
                    (w * 0.86, d * 0.86, seat - 0.03), (w * 0.8, d * 0.8, seat)], n=26))
                m.add(tub(w, d, seat - 0.1, seat + 0.12, h, 0.08))


@dataclass(frozen=True, slots=True)
class Chair:
    """Parameters of a chair to eat at."""

    back: Annotated[str, Choice("slats", "ladder", "spindles", "panel", "shell", "soft", "cross",
        "bent")]
    frame: Material
    cloth: Material
    seat_m: Annotated[float, Range(0.35, 0.6)]  # height
    post_m: Annotated[float, Range(0.02, 0.06)]  # thickness of the legs of a frame
    padded: bool  # a frame with a cushion on its seat
    bars: Annotated[int, Range(1, 14)]  # slats, steps of the ladder, or spindles
    panel: Material
    stretchers: bool  # bars between the legs of a frame
    shell: Material
    legs: Annotated[str, Choice("tapered", "round", "sled")]  # of a shell
    leg_materials: tuple[Material, ...]  # of a shell's legs, left and right
    fittings: Material  # the tubes of a bent chair
    pad: Material  # seat and back of a bent chair


def draw_chair(m: Maker, size: Size) -> Chair:
    """Draw a chair's parameters."""
    seat = m.uniform(0.44, 0.47)
    back = m.pick("slats", "ladder", "spindles", "panel", "shell", "soft", "cross", "bent")
    frame = m.pick(m.timber, m.timber, m.dark_timber, BLACK_STEEL, WHITE,
        glossy("paint", m.paint(), 0.4))
    soft = m.cloth()
    p = Chair(back, frame, soft, seat, 0.033, False, 2 if back == "ladder" else 5, frame, False,
        soft, "tapered", (m.timber, m.timber), CHROME, soft)
    match back:
        case "slats" | "ladder" | "panel" | "cross":
            p = replace(p, post_m=m.uniform(0.028, 0.038), padded=m.chance(0.4))
            if back == "slats":
                p = replace(p, bars=m.integers(3, 7))
            elif back == "ladder":
                p = replace(p, bars=m.integers(1, 4))
            elif back == "panel":
                p = replace(p, panel=m.pick(frame, soft, soft, WICKER))
            return replace(p, stretchers=m.chance(0.4))
        case "spindles":
            return replace(p, bars=m.integers(5, 9))
        case "shell" | "soft":
            if back == "shell":
                colour = m.pick((0.92, 0.92, 0.9), (0.1, 0.1, 0.1), m.any_colour(), m.textile())
                p = replace(p, shell=glossy("shell", colour, 0.35))
            if m.chance(0.7):
                legs = m.pick("tapered", "round")
                material = m.pick(m.timber, m.timber, BLACK_STEEL, CHROME)
                return replace(p, legs=legs, leg_materials=(material, material))
            tubes = tuple(m.pick(CHROME, BLACK_STEEL, STEEL) for _ in range(2))
            return replace(p, legs="sled", leg_materials=tubes)
        case _:
            fittings = m.pick(CHROME, BLACK_STEEL, m.timber)
            return replace(p, fittings=fittings, pad=m.pick(soft, WICKER, m.timber))


@catalogued(draw=draw_chair)
def chair(m: Maker, size: Size, p: Chair) -> None:
    """A chair to eat at.

    Slats, a ladder, spindles, a panel, a shell, cane, upholstered; many legs.
    """
    match p.back:
        case "slats" | "ladder" | "panel" | "cross":
            framed_chair(m, size, p)
        case "spindles":
            with m.of(p.frame):
                spindle_chair(m, size, p)
        case "shell" | "soft":
            shell_chair(m, size, p)
        case "bent":
            bent_chair(m, size, p)


def framed_chair(m: Maker, size: Size, p: Chair) -> None:
    """A chair of four posts, those behind leaning back above the seat."""
    w, d, h = size
    hw, hd, seat, t = w / 2, d / 2, p.seat_m, p.post_m
    with m.of(p.frame):
        for s in (-1.0, 1.0):
            x = s * (hw - t / 2 - 0.02)
            m.square_tube((s * (hw - t / 2 - 0.01), 0.0, hd - 0.04),
                (s * (hw - t / 2 - 0.015), seat - 0.01, hd - 0.045), t, t)
            m.square_tube((x, 0.001, -hd + t / 2 + 0.0), (x, seat, -hd + 0.065), t, t)
            m.square_tube((x, seat - 0.02, -hd + 0.065), (x, h, -hd + t / 2 + 0.001), t, t * 0.9)
        m.board(w, d - 0.07, seat - 0.022, seat, 0.03, 0.006, z=0.035)
        for z in (-hd + 0.065, hd - 0.055):
            m.box(w - 0.08, 0.059, 0.02, 0.002, on=seat - 0.08, z=z)
        m.box(0.02, 0.059, (-hd + 0.08, hd - 0.06), 0.002, left=0.03 - hw, on=seat - 0.08,
            mirrored="x")
        with m.moved(turn=rotation_x(-0.045 / (h - seat)), at=(0.0, seat, -hd + 0.065)):
            chair_back(m, p, w, h - seat)
    if p.padded:
        m.bulged((w - 0.05, 0.05, d - 0.12), n=6, edge=0.5, bulge=5.0, at=(0.0, seat + 0.016, 0.03),
            of=p.cloth)
    for s in (-1.0, 1.0) if p.stretchers else ():
        m.square_tube((s * (hw - 0.03), 0.16, hd - 0.045), (s * (hw - 0.035), 0.16, -hd + 0.035),
            0.018, 0.022, of=p.frame)


def chair_back(m: Maker, p: Chair, w: float, up: float) -> None:
    """The parts between the posts of the back, `up` high, before they lean."""
    n = p.bars
    m.box(w - 0.07, 0.07, 0.022, 0.004, on=up - 0.075)
    match p.back:
        case "slats":
            for k in range(n):
                x = (w - 0.1) * (k + 0.5) / n - w / 2 + 0.05
                m.box(0.024, (0.09, up - 0.07), 0.012, 0.002, x=x)
            m.box(w - 0.07, (0.06, 0.095), 0.02, 0.003)
        case "ladder":
            for k in range(n):
                m.box(w - 0.07, 0.05, 0.016, 0.003, on=up * (0.2 + 0.55 * k / n))
        case "panel":
            m.rounded(w - 0.07, (up * 0.16, up - 0.07), 0.024, 0.008, n=1, of=p.panel)
        case "cross":
            for x in (-w / 2 + 0.05, w / 2 - 0.05):
                m.square_tube((x, 0.05, 0.0), (-x, up - 0.06, 0.0), 0.028, 0.014)


def spindle_chair(m: Maker, size: Size, p: Chair) -> None:
    """A chair with a shaped seat, thin rods and a bow behind."""
    w, d, h = size
    hw, hd, seat = w / 2, d / 2, p.seat_m
    m.loft(rings(oval, [(w - 0.01, d - 0.07, seat - 0.03), (w, d - 0.06, seat - 0.02),
        (w, d - 0.06, seat - 0.006), (w - 0.02, d - 0.08, seat)], z=0.03, power=2.6))
    m.legs("tapered", w, d - 0.04, seat - 0.02, 0.034, 0.1, 0.075, of=p.frame)
    for z in (-0.12, 0.14):
        m.rod((-hw + 0.07, hw - 0.07), 0.2, z, 0.008, n=6)
    for t in spaced(-1.0, 1.0, p.bars):
        m.tube([(t * 0.36 * w, seat - 0.015, -hd + 0.09 + 0.05 * t * t),
            (t * 0.44 * w, h - 0.03 - 0.07 * t * t, -hd + 0.015 + 0.04 * t * t)], 0.006, n=6)
    m.tube(bent([(-0.46 * w, seat - 0.01, -hd + 0.15), (-0.5 * w + 0.012, h - 0.12, -hd + 0.06),
        (-0.3 * w, h - 0.012, -hd + 0.015), (0.3 * w, h - 0.012, -hd + 0.015),
        (0.5 * w - 0.012, h - 0.12, -hd + 0.06), (0.46 * w, seat - 0.01, -hd + 0.15)], 0.1, n=4),
        0.012)


def shell_chair(m: Maker, size: Size, p: Chair) -> None:
    """A chair whose seat and back are one sheet, padded or not, on legs or two sleds."""
    w, d, h = size
    hw, hd, seat = w / 2, d / 2, p.seat_m
    if p.legs == "sled":
        for x, material in zip((-hw + 0.05, hw - 0.05), p.leg_materials, strict=True):
            m.tube(bent([(x * 0.8, seat - 0.03, -hd + 0.1), (x, 0.008, -hd + 0.04),
                (x, 0.008, hd - 0.03), (x * 0.8, seat - 0.03, hd - 0.12)], 0.03, n=3), 0.008,
                of=material)
    else:
        m.legs(p.legs, w, d, seat - 0.02, 0.032, 0.13, 0.1, of=p.leg_materials[0])
    is_hard = p.back == "shell"
    sheet = chair_shell(w, d, seat, h, 0.012 if is_hard else 0.05)
    m.add(sheet, of=p.shell if is_hard else p.cloth)


def bent_chair(m: Maker, size: Size, p: Chair) -> None:
    """A chair of two bent tubes without hind legs."""
    w, d, h = size
    hw, hd, seat = w / 2, d / 2, p.seat_m
    with m.of(p.fittings):
        for x in (-hw + 0.015, hw - 0.015):
            m.tube(bent([(x, h - 0.06, -hd + 0.012), (x, seat - 0.02, -hd + 0.07),
                (x, seat - 0.02, hd - 0.012), (x, 0.012, hd - 0.06), (x, 0.012, -hd + 0.05)], 0.06,
                n=4), 0.012)
        m.rod((-hw + 0.015, hw - 0.015), 0.012, -hd + 0.05, 0.012)
    m.rounded(w - 0.04, 0.04, (-hd + 0.08, hd - 0.02), 0.018, n=1, on=seat - 0.03, of=p.pad)
    m.rounded(w - 0.04, (h - seat) * 0.62, 0.032, 0.014, n=1, turn=rotation_x(-0.12),
        at=(0.0, seat + (h - seat) * 0.385, -hd + 0.057), of=p.pad)


@catalogued()
def kitchen_stool(m: Maker, size: Size) -> None:
    """A stool: round or square, of wood, with a pad, of metal."""
    w, d, h = size
    material, frame = (m.pick(m.timber, m.cloth(), glossy("paint", m.paint(), 0.4), m.dark_timber),
        m.pick(m.timber, BLACK_STEEL, WHITE_STEEL, CHROME, m.dark_timber))
    form, legs = (m.pick("round", "square", "saddle", "pad"),
        m.pick("tapered", "round", "hairpin", "square"))
    if legs == "square":
        m.legs("square", w, d, h - 0.02, 0.032, 0.02, of=frame)
    else:
        m.legs(legs, w, d, h - 0.02, 0.034, 0.075 if form in ("round", "pad") else 0.05,
            0.055 if form in ("round", "pad") else 0.034, of=frame)
    if h > 0.55 or m.chance(0.3):
        for s in (-1.0, 1.0):
            m.rod((-w / 2 + 0.03, w / 2 - 0.03), 0.22, s * (d / 2 - 0.035), 0.008, n=6, of=frame)
            m.rod(s * (w / 2 - 0.035), 0.18, (-d / 2 + 0.03, d / 2 - 0.03), 0.008, n=6, of=frame)
    with m.of(material):
        match form:
            case "round":
                m.disc(w, d, h - 0.03, h, 0.006, n=28)
            case "square":
                m.board(w, d, h - 0.03, h, 0.03, 0.005)
            case "saddle":
                m.disc(w, d, h - 0.035, h, 0.012, n=28, power=3.5)
            case "pad":
                m.disc(w, d, h - 0.07, h, 0.03, n=28)


@catalogued()
def hall_bench(m: Maker, size: Size) -> None:
    """A bench for a hall or a bed's foot: boards, a pad, a shelf for shoes, or a box."""
    w, d, h = size
    hw, hd = w / 2, d / 2
    material, form = (m.pick(m.timber, m.dark_timber, glossy("paint", m.paint(), 0.4)),
        m.weighted(0.35, 0.35, 0.3))
    soft = m.cloth()
    match form:
        case 0:  # on legs
            m.legs(m.pick("tapered", "square", "hairpin"), w, d, h - 0.05, 0.045, 0.06,
                of=m.pick(material, BLACK_STEEL))
            m.board(w, d, h - 0.055, h - 0.03, 0.01, 0.004, of=material)
            m.rounded(w, (h - 0.05, h), d, 0.02, of=soft)
        case 1:  # boards, a shelf for shoes
            m.box(0.025, h - 0.03, d - 0.02, 0.003, left=0.02 - w / 2, mirrored="x", of=material)
            m.board(w, d, h - 0.03, h, 0.006, 0.004, of=material)
            for y in (0.08, 0.24):
                m.box(w - 0.09, 0.018, d - 0.04, on=y, of=material)
        case 2:  # a box with fronts
            m.box(w, 0.04, (-hd, hd - 0.05), of=material)
            hollow(m, (-hw, hw), (0.04, h - 0.05), (-hd, hd - 0.05), 0.018, material)
            with m.moved(at=(0.0, 0.0, 0.0005)):
                fronts_of(m, Look("flat", material, material, material,
                    m.pick("knob", "edge", "disc"), m.metal), (-hw, hw), (0.04, h - 0.055),
                    hd - 0.0495, m.pick([("drawer",), ("drawer",)], [("door",), ("door",)],
                    [("flap",)]), False, Inside(-hd + 0.008))
            m.rounded(w, (h - 0.05, h), d, 0.02, of=soft)


@catalogued()
def swivel_chair(m: Maker, size: Size) -> None:
    """A chair that turns, on five arms with castors: a seat, a back of cloth or slats, armrests on some."""
    w, d, h = size
    r, seat = min(w, d) / 2 - 0.02, m.uniform(0.45, 0.5)
    black = plain("office plastic", m.pick((0.05, 0.05, 0.05), (0.05, 0.05, 0.05),
        (0.75, 0.75, 0.75)), 0.5)
    star = m.pick(black, black, CHROME, STEEL)
    cover = m.pick(plain("fabric", (0.07, 0.07, 0.08), 0.95),
        plain("fabric", (0.25, 0.26, 0.28), 0.95), m.cloth())
    for k in range(5):
        a = pi / 2 + 2 * pi * k / 5
        x, z = cos(a), sin(a)
        m.tube([(0.03 * x, 0.1, 0.03 * z), (r * x, 0.07, r * z)], 0.02, end=0.013, of=star)
        for s in (-0.011, 0.011):
            m.tube([(r * x - z * (s - 0.008), 0.028, r * z + x * (s - 0.008)),
                (r * x - z * (s + 0.008), 0.028, r * z + x * (s + 0.008))], 0.028, n=10, of=black)
        m.rod(r * x, (0.05, 0.075), r * z, 0.008, n=6, of=black)
    m.turned([(0.034, 0.07), (0.034, 0.2), (0.022, 0.205), (0.022, seat - 0.08),
        (0.09, seat - 0.075), (0.09, seat - 0.055)], n=14, of=star)
    wide = 0.82 * w
    m.rounded(wide, (seat - 0.06, seat), 0.5, 0.028, z=0.01, of=cover)
    # A bar behind carries the back, which leans.
    m.tube(bent([(0.0, seat - 0.065, -0.1), (0.0, seat - 0.07, -0.25), (0.0, seat + 0.2, -0.29)],
        0.06, n=3), 0.018, of=black)
    tall = h - seat - 0.06
    with m.moved(turn=rotation_x(-0.12), at=(0.0, seat + 0.06, -0.25)):
        match m.weighted(0.5, 0.3, 0.2):
            case 0:
                m.rounded(0.9 * wide, tall, (-0.03, 0.025), 0.025, of=cover)
            case 1:  # a net in a frame
                t = 0.018
                with m.of(black):
                    m.rounded(0.03, tall, 2 * t, 0.012, n=1, left=-0.47 * wide)
                    m.rounded(0.03, tall, 2 * t, 0.012, n=1, left=0.47 * wide - 0.03)
                    m.rounded(0.94 * wide, (tall - 0.03, tall), 2 * t, 0.012, n=1)
                    m.rounded(0.94 * wide, 0.03, 2 * t, 0.012, n=1)
                m.box(0.92 * wide, (0.015, tall - 0.015), 0.006, of=cover)
            case 2:
                for k in range(3):
                    y = tall * (0.1 + 0.3 * k)
                    m.rounded(0.9 * wide, 0.26 * tall, 0.04, 0.018, n=1, on=y, of=cover)
    if m.chance(0.6):
        for s in (-1.0, 1.0):
            x = s * (wide / 2 + 0.015)
            m.tube(bent([(s * wide * 0.3, seat - 0.065, 0.0), (x, seat - 0.06, 0.0),
                (x, seat + 0.2, 0.0)], 0.03, n=3), 0.013, of=black)
            m.rounded(0.064, 0.025, 0.26, 0.011, n=1, x=x, on=seat + 0.19, z=0.01, of=black)
