"""Shoes, bags and suitcases; no effects."""

from __future__ import annotations

from itertools import product

import numpy as np

from pbrs_farm.core.classes import BAG, CLOTHES
from pbrs_farm.core.frames import rotation_y
from pbrs_farm.core.house import Surface
from pbrs_farm.dress.thing_materials import plain
from pbrs_farm.furnishings.things.boxes import tray
from pbrs_farm.furnishings.things.maker import Maker, thing
from pbrs_farm.geometry.bodies import revolve, stretched
from pbrs_farm.geometry.outlines import bent, oval, rect, rings, spaced


# fmt: off
@thing(group="shoes", nyu40=CLOTHES)
def shoes(m: Maker) -> None:
    """A pair of shoes, toes to the front.

    Laced, boots, slippers, sandals, trainers, with heels, one pair of a child's.
    """
    form, size_of = m.integers(0, 9), m.uniform(0.92, 1.08)
    upper = plain("shoe", m.any_colour() if m.chance(0.5) else m.pick((0.14, 0.11, 0.1),
        (0.06, 0.06, 0.065), (0.35, 0.22, 0.13)), 0.6)
    sole = plain("sole", (0.85, 0.84, 0.8) if m.chance(0.5) else (0.1, 0.09, 0.08), 0.8)
    dome = revolve([(0, 0), (0.48, 0), (0.47, 0.3), (0.4, 0.65), (0.25, 0.9), (0, 1)], n=14)
    foot = revolve([(0, 0), (0.5, 0), (0.52, 0.6), (0.5, 1), (0, 1)], n=14)
    q = 0.62 if form == 6 else size_of
    long, wide = 0.27 * q, 0.088 * q
    for side in (-0.065, 0.065):
        turn = rotation_y(m.normal(0, 0.08))
        with m.moved(turn=turn, at=(side, 0, 0)):
            if form != 5:
                m.add(stretched(foot, (wide, 0.03 if form == 4 else 0.018, long)), of=sole)
            y = 0.03 if form == 4 else 0.018
            match form:
                case 0 | 4 | 6 | 8:  # low, with laces
                    m.add(raised_heel(stretched(dome, (wide * 0.97, 0.085 * q, long))),
                        at=(0, y, 0), of=upper)
                    for k in range(4):
                        if form in (4, 8):
                            m.rod((-0.018, 0.018), y + 0.052 * q - 0.006 * k, 0.012 + 0.02 * k,
                                0.0035, n=5, of=sole)
                    if form == 8:
                        m.box(0.04, 0.06, 0.01, 0.002, on=y + 0.03, z=0.007 - long / 2, of=sole)
                case 1 | 2:  # boots
                    m.add(raised_heel(stretched(dome, (wide * 0.97, 0.08 * q, long))), at=(0, y, 0),
                        of=upper)
                    h = 0.15 if form == 1 else 0.32
                    m.loft(rings(oval, [(0.075, 0.1, -0.07, 0.03), (0.078, 0.1, -0.075, 0.5 * h),
                        (0.095, 0.12, -0.075, h), (0.085, 0.11, -0.075, h), (0.07, 0.09, -0.075,
                        0.55 * h)], column="z"), of=upper)
                case 3:  # slippers
                    m.add(stretched(dome, (wide * 0.98, 0.06 * q, 0.16 * q)), at=(0, y, 0.05 * q),
                        of=upper)
                    m.bulged((wide * 0.9, 0.014, long * 0.9), n=5, edge=0.6, bulge=4.0,
                        at=(0, y + 0.004, 0), of=plain("lining", (0.85, 0.82, 0.76), 0.98))
                case 5:  # heels
                    m.loft(rings(oval, [(0.07, 0.13, 0.06, 0.0), (0.075, 0.13, 0.06, 0.012), (0.06,
                        0.11, 0.05, 0.035), (0.03, 0.06, 0.04, 0.04)], column="z"), of=upper)
                    m.tube([(0, 0.02, 0.02), (0, 0.075, -0.085)], 0.022, of=upper)
                    m.tube([(0, 0, -0.1), (0, 0.085, -0.095)], 0.006, n=7, end=0.02, of=upper)
                    m.loft(rings(oval, [(0.05, 0.06, 0.07), (0.055, 0.065, 0.12),
                        (0.049, 0.059, 0.12), (0.044, 0.054, 0.08)], z=-0.09), of=upper)
                case 7:  # sandals
                    m.bulged((wide * 0.92, 0.012, long * 0.94), n=5, edge=0.6, bulge=4.0,
                        at=(0, y + 0.003, 0), of=plain("footbed", (0.55, 0.4, 0.27), 0.9))
                    for z in (-0.01, 0.06):
                        m.tube(bent([(-wide * 0.48, y, z * q), (-wide * 0.4, y + 0.045, z * q),
                            (wide * 0.4, y + 0.045, z * q), (wide * 0.48, y, z * q)], 0.03, n=3),
                            0.009, n=6, of=upper)


@thing(group="bag", nyu40=BAG, called="shopping_bag")
def bag(m: Maker) -> None:
    """A bag: for shopping, of paper, a tote, a rucksack, a handbag, a sports bag."""
    form, w, h, d, t = (m.integers(0, 7), m.uniform(0.3, 0.4), m.uniform(0.28, 0.38),
        m.uniform(0.1, 0.14), 0.004)
    material, trim = (m.coloured("bag", 0.85), plain("strap",
        m.pick((0.35, 0.22, 0.13), (0.1, 0.1, 0.1)), 0.7))
    match form:
        case 0 | 1:  # for shopping, of cloth or paper
            with m.of(material if form == 0 else plain("paper bag", (0.66, 0.5, 0.33), 0.9)):
                tray(m, w, h, d, t)
                for z in (-d / 2, d / 2 - t):
                    if form == 0:
                        m.box(0.012, 0.11, t, left=-0.075, on=h, against=z, mirrored="x")
                        m.box(0.15, 0.012, t, on=h + 0.11, against=z)
                    else:
                        m.tube(bent([(-0.06, h - 0.01, z + t / 2), (-0.05, h + 0.09, z + t / 2),
                            (0.05, h + 0.09, z + t / 2), (0.06, h - 0.01, z + t / 2)], 0.03, n=3),
                            0.004, n=5)
        case 2:  # a tote of cloth that leans in on itself
            m.loft([(oval(w * 0.8, d * 1.3, n=22, power=3.0), 0),
                (oval(w, d * 1.2, n=22, power=3.0), 0.05), (oval(w, d, n=22, power=2.6), h * 0.7),
                (oval(w * 1.02, d * 0.8, n=22), h), (oval(w * 1.0, d * 0.72, n=22), h),
                (oval(w * 0.96, d * 0.9, n=22, power=2.6), h * 0.65),
                (oval(w * 0.8, d * 1.1, n=22), 0.03)], of=material)
            for z in (-1.0, 1.0):
                m.tube(bent([(-0.07, h - 0.04, z * d * 0.38), (-0.06, h + 0.16, z * d * 0.3),
                    (0.06, h + 0.16, z * d * 0.3), (0.07, h - 0.04, z * d * 0.38)], 0.05, n=3),
                    0.007, n=6, of=trim)
        case 3 | 4:  # a rucksack
            h, w = h * 1.15, w * 0.85
            m.rounded(w, h, 0.16, 0.06, of=material)
            m.rounded(0.72 * w, (0.03, h * 0.5), (0.07, 0.12), 0.03,
                of=material if form == 3 else m.coloured("pocket", 0.85))
            for x in (-1.0, 1.0):
                m.tube(bent([(x * w * 0.22, h * 0.93, -0.075), (x * w * 0.25, h * 0.8, -0.12),
                    (x * w * 0.3, h * 0.3, -0.12), (x * w * 0.36, 0.04, -0.07)], 0.06, n=3), 0.014,
                    n=6, of=trim)
            m.tube(bent([(-0.03, h - 0.02, -0.05), (-0.025, h + 0.04, -0.05),
                (0.025, h + 0.04, -0.05), (0.03, h - 0.02, -0.05)], 0.02, n=3), 0.006, n=6, of=trim)
            if form == 4:
                m.rounded(0.88 * w, (h * 0.6, h + 0.006), 0.112, 0.04, z=0.036, of=material)
            m.box(0.02, (h * 0.44, h * 0.56), (0.118, 0.123), of=trim)
        case 5:  # a handbag
            leather_of = plain("leather", m.pick((0.14, 0.1, 0.09), (0.42, 0.24, 0.14),
                (0.6, 0.4, 0.25), m.any_colour()), 0.5)
            m.loft(rings(rect, [(w * 0.75, d, 0.02, 0), (w * 0.78, d, 0.03, 0.03),
                (w * 0.62, d * 0.35, 0.02, h * 0.62)]), of=leather_of)
            m.tube(bent([(-w * 0.2, h * 0.6, 0), (-w * 0.18, h * 0.95, 0), (w * 0.18, h * 0.95, 0),
                (w * 0.2, h * 0.6, 0)], 0.06, n=4), 0.008, n=7, of=leather_of)
            m.box(0.04, (h * 0.42, h * 0.5), (d * 0.24, d * 0.32), 0.002, of=m.metal)
        case 6:  # a bag for sports
            r = m.uniform(0.11, 0.14)
            m.tube([(-0.22, r, 0), (-0.21, r, 0), (0.21, r, 0), (0.22, r, 0)], r, n=18, of=material)
            for x in (-0.11, 0.11):
                m.rod((x - 0.012, x + 0.012), r, 0, r + 0.003, n=18, of=trim)
            for z in (-0.05, 0.05):
                m.tube(bent([(-0.11, 1.85 * r, z), (-0.08, 2.6 * r, z * 0.4),
                    (0.08, 2.6 * r, z * 0.4), (0.11, 1.85 * r, z)], 0.05, n=3), 0.007, n=6, of=trim)


@thing(group="bag", nyu40=BAG)
def suitcase(m: Maker) -> None:
    """A suitcase on its wheels."""
    w, h, d = m.uniform(0.38, 0.5), m.uniform(0.52, 0.7), m.uniform(0.2, 0.28)
    hd = d / 2
    usual = m.chance(0.6)
    colour = (m.pick((0.08, 0.08, 0.09), (0.12, 0.16, 0.25),
        (0.3, 0.3, 0.31)) if usual else m.any_colour())
    shell, black = plain("suitcase", colour, 0.45), plain("rubber", (0.05, 0.05, 0.05), 0.7)
    # Ribs along the front, a handle, four wheels.
    with m.of(shell):
        m.box(w, (0.04, h), d)
        for t in spaced(-0.38, 0.38, 5):
            m.box(0.024, (0.07, h - 0.04), 0.006, x=t * w, against=hd)
    for x in (-0.06, 0.05):
        m.box(0.012, 0.035, 0.024, left=x, on=h, of=m.metal)
    m.box(0.122, 0.015, 0.028, x=0.001, on=h + 0.035, of=black)
    for x, z in product((-w / 2 + 0.03, w / 2 - 0.05), (-hd + 0.01, hd - 0.03)):
        m.box(0.02, 0.04, 0.02, left=x, against=z, of=black)


def raised_heel(shoe: Surface) -> Surface:
    """A shoe's dome over the toes, as it rises towards the heel."""
    points = shoe.positions.astype(np.float64)
    points[:, 1] *= np.interp(points[:, 2], [-0.135, -0.02, 0.135], [1.15, 1.0, 0.5])
    return Surface(shoe.name, points.astype(np.float32), shoe.faces, 0, None, shoe.normals)
