"""Bottles and jars of many forms; no effects."""

from __future__ import annotations

from pbrs_farm.core.frames import LYING_ALONG_Z, rotation_x, rotation_y, rotation_z
from pbrs_farm.core.house import Material
from pbrs_farm.dress.style import shade
from pbrs_farm.dress.things.bodies import (
    bevelled,
    cylinder,
    frustum,
    hoop,
    loft,
    revolve,
    slab,
    sphere,
    stretched,
    tube,
    vessel,
)
from pbrs_farm.dress.things.maker import Maker, thing
from pbrs_farm.dress.things.materials import glass, plain
from pbrs_farm.dress.things.outlines import bent, oval, rect, rings, scaled


@thing(group="bottle")
def bottle(m: Maker) -> None:
    """Bottles of wine, oil, water, beer, spirits, juice, milk, a flask, a thermos, a spray.

    With labels and caps.
    """
    form = m.integers(0, 12)
    r, tall = m.uniform(0.03, 0.041), m.uniform(0.22, 0.32)
    neck, shoulder = 0.013, tall * m.uniform(0.55, 0.68)
    tint = m.pick((0.1, 0.2, 0.08), (0.3, 0.16, 0.06), (0.8, 0.85, 0.85), (0.25, 0.3, 0.1))
    side, cap = (plain("bottle", tint, 0.08), m.pick(m.metal, plain("cap", m.any_colour(), 0.4),
        plain("cork", (0.7, 0.55, 0.38), 0.9)))  # fmt: skip
    paper = plain("label", m.any_colour() if m.chance(0.5) else (0.88, 0.86, 0.78), 0.7)
    match form:
        case 0 | 1:  # wine or oil
            m.add(revolve([(0, 0), (r, 0), (r, shoulder), (r * 0.75, shoulder + 0.03),
                (neck, shoulder + 0.06), (neck, tall - 0.012), (neck + 0.002, tall - 0.012),
                (neck + 0.002, tall), (0, tall)]), of=side)  # fmt: skip
            sleeve(m, r, shoulder * 0.25, shoulder * 0.8, paper)
            if form == 1:
                m.add(frustum((neck + 0.0015, tall - 0.05), (neck + 0.003, tall + 0.001), n=14),
                    of=cap)  # fmt: skip
        case 2:  # straight shoulders: bordeaux, oil
            m.add(revolve([(0, 0), (r * 0.95, 0), (r, 0.004), (r, tall * 0.7),
                (r * 0.9, tall * 0.74), (neck, tall * 0.79), (neck, tall - 0.02), (0, tall - 0.02)],
                n=18), of=side)  # fmt: skip
            m.add(frustum((0.006, tall - 0.0198), (0.004, tall + 0.02), n=8), of=m.metal)
            sleeve(m, r, 0.2 * tall, 0.45 * tall, paper)
        case 3:  # water: waves in its side
            m.add(revolve([(0, 0), (r * 0.9, 0), (r, 0.01), (r, 0.05), (r * 0.93, 0.06), (r, 0.07),
                (r * 0.93, 0.08), (r, 0.09), (r, tall * 0.65), (r * 0.4, tall * 0.88),
                (0.013, tall * 0.9), (0.013, tall * 0.94), (0, tall * 0.94)], n=18),
                of=glass((0.85, 0.93, 0.97), 0.25))  # fmt: skip
            sleeve(m, r, 0.1, tall * 0.58, plain("label", m.any_colour(), 0.5))
            m.add(cylinder(0.015, tall * 0.9402, tall, n=14), of=plain("cap", m.any_colour(), 0.4))
        case 4:  # beer
            m.add(revolve([(0, 0), (0.03, 0), (0.031, 0.12), (0.026, 0.145), (0.013, 0.175),
                (0.012, 0.215), (0.0145, 0.217), (0.0145, 0.23), (0, 0.23)], n=16), of=side)  # fmt: skip
            sleeve(m, 0.031, 0.035, 0.1, paper)
        case 5:  # square, with a stopper
            m.add(loft(rings(rect, [(0.075, 0.075, 0.01, 0), (0.078, 0.078, 0.012, 0.13),
                (0.05, 0.05, 0.014, 0.15), (0.03, 0.03, 0.0145, 0.16), (0.03, 0.03, 0.0145, 0.19)],
                n=3)), of=glass((0.9, 0.85, 0.75), 0.35))  # fmt: skip
            m.add(revolve([(0, 0.1902), (0.02, 0.1902), (0.024, 0.2), (0.018, 0.225), (0, 0.23)],
                n=14), of=glass())  # fmt: skip
            m.add(loft(rings(rect, [(0.068, 0.068, 0.008, 0.004), (0.07, 0.07, 0.01, 0.08)], n=3)),
                of=plain("spirit", (0.5, 0.25, 0.07), 0.1))  # fmt: skip
        case 6:  # juice or milk in a carton with a gable
            m.add(loft(rings(rect, [(0.07, 0.07, 0.002, 0), (0.07, 0.07, 0.002, 0.195),
                (0.07, 0.006, 0.002, 0.23), (0.07, 0.003, 0.0012, 0.25)], n=1), sharp=20.0),
                of=plain("carton", m.any_colour(), 0.5))  # fmt: skip
            m.add(slab((-0.034, 0.05, 0.035), (0.034, 0.15, 0.0356)),
                of=plain("print", (0.93, 0.92, 0.88), 0.5))  # fmt: skip
            m.add(cylinder(0.012, 0, 0.012, n=12), turn=rotation_x(0.7), at=(0, 0.21, 0.019),
                of=plain("cap", m.any_colour(), 0.4))  # fmt: skip
        case 7:  # a thermos
            m.add(revolve([(0, 0), (0.04, 0), (0.042, 0.006), (0.042, 0.2), (0.034, 0.225),
                (0, 0.225)], n=22), of=m.pick(m.metal, plain("flask", m.any_colour(), 0.35)))  # fmt: skip
            m.add(revolve([(0, 0.2252), (0.034, 0.2252), (0.032, 0.27), (0, 0.272)], n=20),
                of=plain("cup", (0.12, 0.12, 0.12), 0.5))  # fmt: skip
            m.add(tube(bent([(0.04, 0.19, 0), (0.075, 0.185, 0), (0.075, 0.06, 0),
                (0.04, 0.055, 0)], 0.02, n=3), 0.006, n=6),
                of=plain("grip", (0.12, 0.12, 0.12), 0.5))  # fmt: skip
        case 8:  # a swing top
            m.add(revolve([(0, 0), (r * 0.95, 0), (r, 0.006), (r, tall * 0.58),
                (r * 0.5, tall * 0.76), (0.014, tall * 0.8), (0.013, tall * 0.94),
                (0, tall * 0.94)], n=18), of=glass((0.85, 0.92, 0.88), 0.25))  # fmt: skip
            m.add(frustum((0.016, tall * 0.9402), (0.013, tall), n=12),
                of=plain("stopper", (0.9, 0.89, 0.86), 0.3))  # fmt: skip
            for x in (-1.0, 1.0):
                m.add(tube([(x * 0.0155, tall * 0.85, 0), (x * 0.018, tall * 0.97, 0)], 0.0012,
                    n=5), of=m.metal)  # fmt: skip
        case 9:  # sauce: squat with a narrow cap
            m.add(loft(rings(oval, [(0.062, 0.045, 0), (0.068, 0.05, 0.01), (0.064, 0.046, 0.1),
                (0.036, 0.032, 0.145), (0.034, 0.03, 0.15)], n=20)), of=plain("bottle",
                m.pick((0.65, 0.09, 0.06), (0.85, 0.65, 0.12), (0.93, 0.92, 0.86),
                (0.25, 0.14, 0.06)), 0.3))  # fmt: skip
            m.add(revolve([(0, 0.1502), (0.0175, 0.1502), (0.016, 0.17), (0.006, 0.175),
                (0.003, 0.2), (0, 0.2)], n=14), of=plain("cap", (0.93, 0.93, 0.92), 0.4))  # fmt: skip
        case 10:  # two that stand together
            for x in (-0.045, 0.045):
                with m.moved(at=(x, 0, 0)):
                    m.add(revolve([(0, 0), (0.032, 0), (0.033, 0.15), (0.026, 0.18), (0.012, 0.2),
                        (0.012, 0.25), (0, 0.25)], n=14), of=plain("bottle",
                        m.pick((0.1, 0.2, 0.08), (0.5, 0.4, 0.1), (0.25, 0.1, 0.06)), 0.1))  # fmt: skip
                    m.add(cylinder(0.014, 0.2502, 0.27, n=12), of=cap)
        case 11:  # a round flask in a bast cover
            m.add(revolve([(0, 0.004), (0.03, 0.004), (0.062, 0.05), (0.055, 0.1), (0.02, 0.15),
                (0.012, 0.18), (0.013, 0.25), (0, 0.25)], n=20),
                of=plain("bottle", (0.1, 0.2, 0.08), 0.08))  # fmt: skip
            m.add(revolve([(0, 0), (0.034, 0), (0.066, 0.05), (0.058, 0.1), (0.053, 0.1),
                (0.061, 0.05), (0.03, 0.003), (0, 0.003)], n=20),
                of=plain("bast", (0.7, 0.58, 0.38), 0.9))  # fmt: skip


def sleeve(m: Maker, r: float, low: float, high: float, paper: Material) -> None:
    """A label round a bottle of radius r, 0.4 mm proud of it."""
    inner, outer = r - 0.001, r + 0.0004
    m.add(revolve([(inner, low), (outer, low), (outer, high), (inner, high), (inner, low)]),
        of=paper)  # fmt: skip


@thing(group="kitchen_tool")
def jar(m: Maker) -> None:
    """Jars.

    With a lid, a cork, a swing top, of tin, square, with a label, a set of three, a spice rack, a pot of honey.
    """
    form, r, tall = m.integers(0, 13), m.uniform(0.035, 0.055), m.uniform(0.09, 0.2)
    grain = m.pick((0.35, 0.2, 0.1), (0.85, 0.75, 0.5), (0.9, 0.88, 0.82), (0.6, 0.3, 0.12),
        (0.4, 0.45, 0.2))  # fmt: skip
    side = m.china() if m.chance(0.5) else plain("filled jar", grain, 0.15)
    lid = plain("wood lid", m.wood, 0.5) if m.chance(0.5) else m.metal
    match form:
        case 0 | 1:  # with a lid
            m.add(revolve([(0, 0), (r * 0.95, 0), (r, 0.006), (r, tall - 0.02),
                (r * 0.9, tall - 0.012), (0, tall - 0.012)]), of=side)  # fmt: skip
            m.add(revolve([(0, tall - 0.0118), (r * 0.93, tall - 0.0118), (r * 0.93, tall),
                (0, tall + 0.001)]), of=lid)  # fmt: skip
            if form == 1:
                m.add(slab((-0.022, tall * 0.35, r - 0.004), (0.022, tall * 0.6, r + 0.0008)),
                    of=plain("label", (0.92, 0.91, 0.87), 0.8))  # fmt: skip
        case 2 | 3:  # glass with what is in it, and a cork
            m.add(revolve(scaled(r, tall, [(0, 0), (1, 0), (1, 0.8), (0.8, 0.88), (0.8, 0.92),
                (0, 0.92)]), n=18), of=glass())  # fmt: skip
            m.add(revolve([(0, 0.003), (r - 0.004, 0.003), (r - 0.004, tall * m.uniform(0.4, 0.7)),
                (0, tall * 0.6)], n=16), of=plain("grain", grain, 0.9))  # fmt: skip
            if form == 2:
                m.add(frustum((r * 0.78, tall * 0.9202), (r * 0.82, tall), n=16),
                    of=plain("cork", (0.72, 0.57, 0.4), 0.9))  # fmt: skip
            else:
                m.add(revolve(scaled(r, tall,
                    [(0, 0.9202), (0.9, 0.9202), (0.85, 0.97), (0, 0.98)]), n=16), of=glass())  # fmt: skip
                m.add(tube(bent([(r * 0.85, tall * 0.86, 0), (r * 1.1, tall * 0.93, 0),
                    (r * 0.85, tall * 0.985, 0)], 0.01, n=2), 0.0015, n=5), of=m.metal)  # fmt: skip
                m.add(hoop(oval(1.7 * r, 1.7 * r, n=18), tall * 0.87, 0.002, n=5), of=m.metal)
        case 4:  # tin
            paint_of = plain("tin", m.any_colour(), 0.3)
            m.add(cylinder(r, 0, tall * 0.85, n=22), of=paint_of)
            m.add(revolve([(0, tall * 0.8502), (r + 0.002, tall * 0.8502), (r + 0.002, tall * 0.97),
                (r * 0.9, tall), (0, tall)], n=22), of=m.pick(paint_of, m.metal))  # fmt: skip
            m.add(slab((-0.025, tall * 0.25, r - 0.006), (0.025, tall * 0.6, r + 0.0006)),
                of=plain("label", (0.92, 0.91, 0.87), 0.6))  # fmt: skip
        case 5:  # square
            m.add(loft(rings(rect, [(1.8 * r, 1.8 * r, 0.008, 0),
                (1.8 * r, 1.8 * r, 0.008, tall * 0.85)], n=2)), of=side)  # fmt: skip
            m.add(loft(rings(rect, [(1.8 * r, 1.8 * r, 0.008, tall * 0.8502),
                (1.8 * r, 1.8 * r, 0.008, tall)], n=2)), of=lid)  # fmt: skip
        case 6:  # a set in a row
            for k, s in enumerate((1.0, 0.86, 0.72)):
                with m.moved(at=(k * 2.05 * r, 0, 0)):
                    m.add(revolve([(0, 0), (r * 0.95 * s, 0), (r * s, 0.006),
                        (r * s, (tall - 0.02) * s), (0, (tall - 0.02) * s)], n=16), of=side)  # fmt: skip
                    m.add(revolve([(0, (tall - 0.02) * s + 0.0002),
                        (r * s, (tall - 0.02) * s + 0.0002), (r * s, tall * s - 0.004),
                        (0.008, tall * s - 0.002), (0.01, tall * s + 0.008), (0, tall * s + 0.009)],
                        n=16), of=lid)  # fmt: skip
        case 7:  # spices in a little rack
            board_of = plain("rack wood", m.wood, 0.5)
            with m.of(board_of):
                m.add(slab((-0.13, 0, -0.03), (0.13, 0.008, 0.03)))
                for x in (-0.13, 0.122):
                    m.add(slab((x, 0.008, -0.03), (x + 0.008, 0.09, 0.03)))
                m.add(slab((-0.122, 0.035, 0.024), (0.122, 0.05, 0.03)))
            for k in range(5):
                with m.moved(at=(-0.1 + 0.05 * k, 0.0082, 0)):
                    m.add(cylinder(0.021, 0, 0.06, n=12), of=plain("spice",
                        m.pick((0.5, 0.15, 0.05), (0.3, 0.35, 0.12), (0.75, 0.55, 0.12),
                        (0.15, 0.1, 0.07)), 0.3))  # fmt: skip
                    m.add(cylinder(0.021, 0.0602, 0.076, n=12), of=lid)
        case 8:  # a pot of honey or jam with a cloth
            m.add(revolve([(0, 0), (0.034, 0), (0.037, 0.008), (0.037, 0.07), (0.03, 0.08),
                (0, 0.08)], n=18), of=plain("jam", m.pick((0.4, 0.03, 0.06), (0.75, 0.42, 0.06),
                (0.8, 0.3, 0.05)), 0.12))  # fmt: skip
            m.add(revolve([(0, 0.0802), (0.033, 0.0802), (0.045, 0.072), (0.046, 0.074),
                (0.034, 0.096), (0, 0.097)], n=18), of=plain("cloth", m.any_colour(), 0.95))  # fmt: skip
        case 9:  # utensils in a pot
            m.add(vessel([(0, 0), (0.05, 0), (0.055, 0.14)], 0.004, n=20), of=m.china())
            for k in range(m.integers(3, 7)):
                around = m.moved(turn=rotation_y(1.2 * k + m.uniform(0, 0.4)))
                spoon, black = plain("spoon wood", m.wood, 0.6), plain("grip", (0.1, 0.1, 0.1), 0.5)
                leaning = m.moved(turn=rotation_z(-0.13), at=(0.008, 0.0055, 0))
                with m.of(m.pick(spoon, m.metal, black)), around, leaning:
                    m.add(tube([(0, 0, 0), (0, 0.24, 0)], 0.004, n=6))
                    if m.chance(0.6):
                        bowl = stretched(sphere((0, 0, 0), 1.0, n=10), (0.024, 0.036, 0.006))
                        m.add(bowl, at=(0, 0.265, 0))
                    else:
                        m.add(bevelled((-0.026, 0.23, -0.002), (0.026, 0.31, 0.002), 0.001))
        case 10:  # a block with knives
            m.add(loft([(rect(0.1, 0.16, 0.006, n=2), 0),
                (rect(0.1, 0.14, 0.006, z=-0.03, n=2), 0.2)], sharp=25.0),
                of=plain("block wood", m.wood, 0.5))  # fmt: skip
            for k in range(5):
                m.add(bevelled((-0.04 + 0.02 * k - 0.006, 0.195, -0.05 + 0.012 * (k % 2)),
                    (-0.04 + 0.02 * k + 0.006, 0.29, -0.02 + 0.012 * (k % 2)), 0.003),
                    of=plain("grip", (0.08, 0.08, 0.08), 0.4))  # fmt: skip
        case 11:  # boards that lean on each other
            for k in range(m.integers(1, 4)):
                with m.moved(turn=rotation_x(-0.12), at=(0.02 * k, 0, 0.026 * k)):
                    m.add(bevelled((-0.13 + 0.03 * k, 0, 0),
                        (0.13 - 0.02 * k, 0.34 - 0.06 * k, 0.016), 0.004), of=plain("board wood",
                        shade(m.wood, m.uniform(0.75, 1.2)), 0.6))  # fmt: skip
        case 12:  # a kitchen scale
            paint_of = plain("scale", m.any_colour(), 0.35)
            m.add(bevelled((-0.09, 0, -0.07), (0.09, 0.05, 0.07), 0.012), of=paint_of)
            m.add(revolve([(0, 0), (0.012, 0), (0.012, 0.02), (0.1, 0.03), (0.11, 0.045),
                (0.107, 0.046), (0.09, 0.034), (0, 0.034)], n=26), at=(0, 0.049, 0), of=m.metal)  # fmt: skip
            m.add(frustum((0.035, 0), (0.033, 0.004), n=20), turn=LYING_ALONG_Z,
                at=(0, 0.025, 0.0695), of=plain("dial", (0.93, 0.92, 0.88), 0.4))  # fmt: skip
