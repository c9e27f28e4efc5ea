"""Bottles and jars of many forms; no effects."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from pbrs_farm.core.frames import rotation_x, rotation_y, rotation_z
from pbrs_farm.core.house import Material
from pbrs_farm.dress.style import Rgb, shade
from pbrs_farm.dress.thing_materials import glass, plain
from pbrs_farm.furnishings.things.maker import Maker, thing
from pbrs_farm.furnishings.things.profiles import profiles
from pbrs_farm.geometry.bodies import sphere, stretched
from pbrs_farm.geometry.outlines import bent, fluted, oval, rect, rings, scaled

# fmt: off
_LIQUIDS: Final = ((0.35, 0.05, 0.08), (0.75, 0.6, 0.15), (0.4, 0.2, 0.05), (0.8, 0.82, 0.8),
    (0.5, 0.45, 0.12), (0.75, 0.3, 0.2))


@thing(group="bottle")
def bottle(m: Maker) -> None:
    """A bottle.

    Of wine, oil, beer, spirits, milk or water, with a closure and labels; a carton, a flask, a thermos.
    """
    if m.chance(0.8):
        _composed(m)
        return
    cap = m.pick(m.metal, m.coloured("cap", 0.4), plain("cork", (0.7, 0.55, 0.38), 0.9))
    r, tall = m.uniform(0.03, 0.041), m.uniform(0.22, 0.32)
    match m.integers(0, 7):
        case 0:  # water: waves in its side
            m.turned([(r * 0.9, 0), (r, 0.01), (r, 0.05), (r * 0.93, 0.06), (r, 0.07),
                (r * 0.93, 0.08), (r, 0.09), (r, tall * 0.65), (r * 0.4, tall * 0.88),
                (0.013, tall * 0.9), (0.013, tall * 0.94)], n=18,
                of=glass((0.85, 0.93, 0.97), 0.25))
            sleeve(m, r, 0.1, tall * 0.58, m.coloured("label", 0.5))
            m.cylinder(0.015, tall * 0.9402, tall, n=14, of=m.coloured("cap", 0.4))
        case 1:  # square, with a stopper
            m.loft(rings(rect, [(0.075, 0.075, 0.01, 0), (0.078, 0.078, 0.012, 0.13),
                (0.05, 0.05, 0.014, 0.15), (0.03, 0.03, 0.0145, 0.16), (0.03, 0.03, 0.0145, 0.19)],
                n=3), of=glass((0.9, 0.85, 0.75), 0.35))
            m.revolve([(0, 0.1902), (0.02, 0.1902), (0.024, 0.2), (0.018, 0.225), (0, 0.23)], n=14,
                of=glass())
            m.loft(rings(rect, [(0.068, 0.068, 0.008, 0.004), (0.07, 0.07, 0.01, 0.08)], n=3),
                of=plain("spirit", (0.5, 0.25, 0.07), 0.1))
        case 2:  # juice or milk in a carton with a gable
            m.loft(rings(rect, [(0.07, 0.07, 0.002, 0), (0.07, 0.07, 0.002, 0.195),
                (0.07, 0.006, 0.002, 0.23), (0.07, 0.003, 0.0012, 0.25)], n=1), sharp=20.0,
                of=m.coloured("carton", 0.5))
            m.box(0.068, (0.05, 0.15), (0.035, 0.0356), of=plain("print", (0.93, 0.92, 0.88), 0.5))
            m.cylinder(0.012, 0, 0.012, n=12, turn=rotation_x(0.7), at=(0, 0.21, 0.019),
                of=m.coloured("cap", 0.4))
        case 3:  # a thermos
            m.turned([(0.04, 0), (0.042, 0.006), (0.042, 0.2), (0.034, 0.225)], n=22,
                of=m.pick(m.metal, m.coloured("flask", 0.35)))
            m.revolve([(0, 0.2252), (0.034, 0.2252), (0.032, 0.27), (0, 0.272)], n=20,
                of=plain("cup", (0.12, 0.12, 0.12), 0.5))
            m.tube(bent([(0.04, 0.19, 0), (0.075, 0.185, 0), (0.075, 0.06, 0), (0.04, 0.055, 0)],
                0.02, n=3), 0.006, n=6, of=plain("grip", (0.12, 0.12, 0.12), 0.5))
        case 4:  # sauce: squat with a narrow cap
            m.loft(rings(oval, [(0.062, 0.045, 0), (0.068, 0.05, 0.01), (0.064, 0.046, 0.1),
                (0.036, 0.032, 0.145), (0.034, 0.03, 0.15)], n=20),
                of=plain("bottle", m.pick((0.65, 0.09, 0.06), (0.85, 0.65, 0.12),
                (0.93, 0.92, 0.86), (0.25, 0.14, 0.06)), 0.3))
            m.turned([(0.0175, 0.1502), (0.016, 0.17), (0.006, 0.175), (0.003, 0.2)], n=14,
                of=plain("cap", (0.93, 0.93, 0.92), 0.4))
        case 5:  # two side by side
            for x in (-0.045, 0.045):
                with m.moved(at=(x, 0, 0)):
                    m.turned([(0.032, 0), (0.033, 0.15), (0.026, 0.18), (0.012, 0.2),
                        (0.012, 0.25)], n=14, of=plain("bottle", m.pick((0.1, 0.2, 0.08),
                        (0.5, 0.4, 0.1), (0.25, 0.1, 0.06)), 0.1))
                    m.cylinder(0.014, 0.2502, 0.27, n=12, of=cap)
        case 6:  # a round flask in a bast cover
            m.turned([(0.03, 0.004), (0.062, 0.05), (0.055, 0.1), (0.02, 0.15), (0.012, 0.18),
                (0.013, 0.25)], n=20, of=plain("bottle", (0.1, 0.2, 0.08), 0.08))
            m.turned([(0.034, 0), (0.066, 0.05), (0.058, 0.1), (0.053, 0.1), (0.061, 0.05),
                (0.03, 0.003)], n=20, of=plain("bast", (0.7, 0.58, 0.38), 0.9))


def _composed(m: Maker) -> None:
    """A turned or facetted bottle: one of the bodies, a closure, labels or none."""
    body = m.pick(*profiles("bottle").values())
    r, tall = body.radius_m * m.uniform(0.93, 1.07), body.height_m * m.uniform(0.92, 1.08)
    profile = scaled(r, tall, body.profile)
    tint = m.pick((0.1, 0.2, 0.08), (0.3, 0.16, 0.06), (0.8, 0.85, 0.85), (0.25, 0.3, 0.1),
        (0.16, 0.22, 0.34))
    n = m.pick(18, 18, 20)
    is_clear = m.chance(0.35)
    side = glass(tint, 0.3) if is_clear else plain("bottle", tint, 0.08)
    facets = (m.pick(4, 6, 8) if body.name in ("oil", "gin", "whisky", "decanter",
        "flask") and m.chance(0.45) else 0)
    if facets:
        m.loft([(oval(2 * x, 2 * x, n=facets), y) for x, y in profile], sharp=25.0, of=side)
    else:
        m.revolve([(0.0, 0.0), *profile, (0.0, profile[-1][1])], n=n, of=side)
    if is_clear:
        # The liquid ends at the shoulder or below.
        level = m.uniform(0.5, 1.0) * body.label_to * tall
        inner = 0.68 if facets else 0.93
        inside = [(inner * x, max(y, 0.004)) for x, y in profile if y < level]
        last = float(np.interp(level, [y for _, y in profile], [x for x, _ in profile]))
        m.revolve([(0.0, 0.004), *inside[1:], (inner * last, level), (0.0, level)], n=14,
            of=plain("liquid", m.pick(*_LIQUIDS), 0.1))
    _close(m, profile[-1][0], profile[-1][1], tall)
    if not facets:
        _label(m, profile, (body.label_from * tall, body.label_to * tall), n)


def _close(m: Maker, mouth: float, top: float, tall: float) -> None:
    """One of nine closures for a mouth of a radius at a height, or none."""
    y, q = top + 0.0002, mouth
    cap = m.pick(m.metal, m.coloured("cap", 0.4), plain("cap", (0.1, 0.1, 0.1), 0.4))
    cork = plain("cork", (0.7, 0.55, 0.38), 0.9)
    match m.integers(0, 10):
        case 0:  # a cork, partly out of the neck
            m.frustum((0.8 * q, y), (0.86 * q, y + 0.012), n=12, of=cork)
        case 1:  # a stopper of wood on a cork
            m.revolve([(0.0, y), (0.8 * q, y), (0.8 * q, y + 0.004), (1.25 * q, y + 0.005),
                (1.25 * q, y + 0.02), (1.1 * q, y + 0.024), (0.0, y + 0.025)],
                of=m.pick(m.timber, m.dark_timber))
        case 2:  # a screw cap, ribbed
            m.loft(rings(fluted, [(2.4 * q, 12, 0.06, y - 0.014), (2.4 * q, 12, 0.06, y + 0.003)]),
                sharp=70.0, of=cap)
        case 3:  # a crown cap
            m.revolve([(0.0, y - 0.004), (1.3 * q, y - 0.004), (1.08 * q, y + 0.002),
                (0.0, y + 0.003)], n=21, of=cap)
        case 4:  # a capsule of foil down the neck
            low = y - min(0.16 * tall, 0.045)
            m.turned([(1.06 * q + 0.0012, low), (1.04 * q + 0.001, y + 0.001)], n=18, of=cap)
        case 5:  # a pourer
            m.frustum((1.1 * q, y), (0.9 * q, y + 0.008), n=14, of=cork)
            m.tube(bent([(0.0, y + 0.006, 0.0), (0.0, y + 0.03, 0.0), (0.018, y + 0.055, 0.0)],
                0.012, n=3), 0.004, n=7, end=0.0025, of=m.metal)
        case 6:  # a swing top
            m.frustum((1.15 * q, y), (0.9 * q, y + 0.014), n=14,
                of=plain("stopper", (0.9, 0.89, 0.86), 0.3))
            for x in (-1.0, 1.0):
                m.tube([(x * (q + 0.002), y - 0.03, 0), (x * (q + 0.005), y + 0.008, 0)], 0.0012,
                    n=5, of=m.metal)
        case 7:  # a ball of glass
            m.revolve([(0.0, y), (0.8 * q, y), (0.7 * q, y + 0.004), (1.5 * q, y + 0.4 * q),
                (1.9 * q, y + 1.9 * q), (1.3 * q, y + 3.2 * q), (0.0, y + 3.6 * q)], of=glass())
        case 8:  # a pump
            m.frustum((1.25 * q, y - 0.008), (1.1 * q, y + 0.012), of=cap)
            m.rod(0.0, (y + 0.01, y + 0.045), 0.0, 0.004, n=7, of=cap)
            m.box(0.046, 0.0108, 0.02, 0.003, x=0.013, on=y + 0.0452, of=cap)
        case _:  # open
            pass


def _label(m: Maker, profile: Sequence[tuple[float, float]], straight: tuple[float, float],
    n: int) -> None:
    """Labels on a turned body between two heights: a band, a low one, two, one with another on the neck.

    n: sides of the body.
    """
    low, high = straight
    paper = plain("label", m.any_colour() if m.chance(0.5) else (0.88, 0.86, 0.78), 0.7)
    ys, xs = [y for _, y in profile], [x for x, _ in profile]

    def band(a: float, b: float, of: Material) -> None:
        # It follows the side, 0.5 mm proud of it.
        stops = [a, *(y for y in ys if a < y < b), b]
        side = [float(np.interp(y, ys, xs)) for y in stops]
        outer = [(x + 0.0005, y) for x, y in zip(side, stops, strict=True)]
        inner = [(x - 0.001, y) for x, y in zip(side, stops, strict=True)]
        m.revolve([inner[0], *outer, *inner[::-1]], n=n, of=of)

    match m.integers(0, 6):
        case 0 | 1:
            band(low + 0.1 * (high - low), high - m.uniform(0.0, 0.25) * (high - low), paper)
        case 2:
            band(low, low + 0.45 * (high - low), paper)
        case 3:
            middle = (low + high) / 2
            band(low, middle - 0.004, paper)
            band(middle + 0.006, high, m.coloured("band", 0.6))
        case 4:
            band(low, high - 0.3 * (high - low), paper)
            top = profile[-1][1]
            band(top - 0.055, top - 0.035, paper)
        case _:
            pass


def sleeve(m: Maker, r: float, low: float, high: float, paper: Material) -> None:
    """A label round a bottle of radius r, 0.4 mm proud of it."""
    inner, outer = r - 0.001, r + 0.0004
    m.ring((inner, outer), (low, high), of=paper)


@thing(group="kitchen_tool")
def jar(m: Maker) -> None:
    """Jars.

    With a lid, a cork, a swing top, of tin, square, with a label, a set of three, a spice rack, a pot of honey.
    """
    form, r, tall = m.integers(0, 13), m.uniform(0.035, 0.055), m.uniform(0.09, 0.2)
    grain = m.pick((0.35, 0.2, 0.1), (0.85, 0.75, 0.5), (0.9, 0.88, 0.82), (0.6, 0.3, 0.12),
        (0.4, 0.45, 0.2))
    side = m.china() if m.chance(0.5) else plain("filled jar", grain, 0.15)
    lid = plain("wood lid", m.wood, 0.5) if m.chance(0.5) else m.metal
    match form:
        case 0 | 1:  # with a lid
            m.turned([(r * 0.95, 0), (r, 0.006), (r, tall - 0.02), (r * 0.9, tall - 0.012)],
                of=side)
            m.revolve([(0, tall - 0.0118), (r * 0.93, tall - 0.0118), (r * 0.93, tall),
                (0, tall + 0.001)], of=lid)
            if form == 1:
                m.box(0.044, (tall * 0.35, tall * 0.6), 0.0048, against=r - 0.004,
                    of=plain("label", (0.92, 0.91, 0.87), 0.8))
        case 2 | 3:
            stoppered_jar(m, r, tall, form, grain)
        case 4:  # tin
            paint_of = m.coloured("tin", 0.3)
            m.cylinder(r, 0, tall * 0.85, n=22, of=paint_of)
            m.turned([(r + 0.002, tall * 0.8502), (r + 0.002, tall * 0.97), (r * 0.9, tall)], n=22,
                of=m.pick(paint_of, m.metal))
            m.box(0.05, (tall * 0.25, tall * 0.6), 0.0066, against=r - 0.006,
                of=plain("label", (0.92, 0.91, 0.87), 0.6))
        case 5:  # square
            m.loft(rings(rect, [(1.8 * r, 1.8 * r, 0.008, 0), (1.8 * r, 1.8 * r, 0.008,
                tall * 0.85)], n=2), of=side)
            m.loft(rings(rect, [(1.8 * r, 1.8 * r, 0.008, tall * 0.8502),
                (1.8 * r, 1.8 * r, 0.008, tall)], n=2), of=lid)
        case 6:
            jar_set(m, r, tall, side, lid)
        case 7:
            spice_rack(m, lid)
        case 8:  # a pot of honey or jam with a cloth
            m.turned([(0.034, 0), (0.037, 0.008), (0.037, 0.07), (0.03, 0.08)], n=18,
                of=plain("jam", m.pick((0.4, 0.03, 0.06), (0.75, 0.42, 0.06), (0.8, 0.3, 0.05)),
                0.12))
            m.revolve([(0, 0.0802), (0.033, 0.0802), (0.045, 0.072), (0.046, 0.074), (0.034, 0.096),
                (0, 0.097)], n=18, of=m.coloured("cloth", 0.95))
        case 9:  # utensils in a pot
            m.vessel([(0, 0), (0.05, 0), (0.055, 0.14)], 0.004, n=20, of=m.china())
            for k in range(m.integers(3, 7)):
                around = m.moved(turn=rotation_y(1.2 * k + m.uniform(0, 0.4)))
                spoon, black = plain("spoon wood", m.wood, 0.6), plain("grip", (0.1, 0.1, 0.1), 0.5)
                leaning = m.moved(turn=rotation_z(-0.13), at=(0.008, 0.0055, 0))
                with m.of(m.pick(spoon, m.metal, black)), around, leaning:
                    m.rod(0, (0, 0.24), 0, 0.004, n=6)
                    if m.chance(0.6):
                        bowl = stretched(sphere((0, 0, 0), 1.0, n=10), (0.024, 0.036, 0.006))
                        m.add(bowl, at=(0, 0.265, 0))
                    else:
                        m.box(0.052, (0.23, 0.31), 0.004, 0.001)
        case 10:  # a block with knives
            m.loft([(rect(0.1, 0.16, 0.006, n=2), 0), (rect(0.1, 0.14, 0.006, z=-0.03, n=2), 0.2)],
                sharp=25.0, of=plain("block wood", m.wood, 0.5))
            for k in range(5):
                m.box(0.012, (0.195, 0.29), 0.03, 0.003, left=0.02 * k - 0.046,
                    z=0.012 * (k % 2) - 0.035, of=plain("grip", (0.08, 0.08, 0.08), 0.4))
        case 11:  # boards that lean on each other
            for k in range(m.integers(1, 4)):
                with m.moved(turn=rotation_x(-0.12), at=(0.02 * k, 0, 0.026 * k)):
                    m.box((-0.13 + 0.03 * k, 0.13 - 0.02 * k), 0.34 - 0.06 * k, (0, 0.016), 0.004,
                        of=plain("board wood", shade(m.wood, m.uniform(0.75, 1.2)), 0.6))
        case 12:  # a kitchen scale
            paint_of = m.coloured("scale", 0.35)
            m.box(0.18, 0.05, 0.14, 0.012, of=paint_of)
            m.turned([(0.012, 0), (0.012, 0.02), (0.1, 0.03), (0.11, 0.045), (0.107, 0.046),
                (0.09, 0.034)], n=26, at=(0, 0.049, 0), of=m.metal)
            m.frustum((0.035, 0), (0.033, 0.004), n=20, front=(0, 0.025, 0.0695), of=plain("dial",
                (0.93, 0.92, 0.88), 0.4))


def stoppered_jar(m: Maker, r: float, tall: float, form: int, grain: Rgb) -> None:
    """A filled jar of glass with a cork, or with a glass stopper on a wire."""
    m.revolve(scaled(r, tall, [(0, 0), (1, 0), (1, 0.8), (0.8, 0.88), (0.8, 0.92), (0, 0.92)]),
        n=18, of=glass())
    full = tall * m.uniform(0.4, 0.7)
    m.revolve([(0, 0.003), (r - 0.004, 0.003), (r - 0.004, full), (0, full + 0.1 * r)],
        of=plain("grain", grain, 0.9))
    if form == 2:
        m.frustum((r * 0.78, tall * 0.9202), (r * 0.82, tall),
            of=plain("cork", (0.72, 0.57, 0.4), 0.9))
    else:
        m.revolve(scaled(r, tall, [(0, 0.9202), (0.9, 0.9202), (0.85, 0.97), (0, 0.98)]),
            of=glass())
        m.tube(bent([(r * 0.85, tall * 0.86, 0), (r * 1.1, tall * 0.93, 0),
            (r * 0.85, tall * 0.985, 0)], 0.01, n=2), 0.0015, n=5, of=m.metal)
        m.hoop(oval(1.7 * r, 1.7 * r, n=18), tall * 0.87, 0.002, n=5, of=m.metal)


def jar_set(m: Maker, r: float, tall: float, side: Material, lid: Material) -> None:
    """Three jars in a row, each smaller than the one before."""
    for k, s in enumerate((1.0, 0.86, 0.72)):
        with m.moved(at=(k * 2.05 * r, 0, 0)):
            m.turned([(r * 0.95 * s, 0), (r * s, 0.006), (r * s, (tall - 0.02) * s)], of=side)
            m.revolve([(0, (tall - 0.02) * s + 0.0002), (r * s, (tall - 0.02) * s + 0.0002),
                (r * s, tall * s - 0.004), (0.008, tall * s - 0.002), (0.01, tall * s + 0.008),
                (0, tall * s + 0.009)], of=lid)


def spice_rack(m: Maker, lid: Material) -> None:
    """Five spices in a little rack."""
    board_of = plain("rack wood", m.wood, 0.5)
    with m.of(board_of):
        m.box(0.26, 0.008, 0.06)
        m.box(0.008, (0.008, 0.09), 0.06, left=-0.13, mirrored="x")
        m.box(0.244, (0.035, 0.05), (0.024, 0.03))
    for k in range(5):
        with m.moved(at=(-0.1 + 0.05 * k, 0.0082, 0)):
            m.cylinder(0.021, 0, 0.06, n=12, of=plain("spice",
                m.pick((0.5, 0.15, 0.05), (0.3, 0.35, 0.12), (0.75, 0.55, 0.12), (0.15, 0.1, 0.07)),
                0.3))
            m.cylinder(0.021, 0.0602, 0.076, n=12, of=lid)
