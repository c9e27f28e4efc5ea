"""Fruit and groceries; no effects."""

from __future__ import annotations

from itertools import product

from numpy import cos, sin

from pbrs_farm.core.frames import rotation_y
from pbrs_farm.core.house import Material
from pbrs_farm.dress.style import shade
from pbrs_farm.dress.thing_materials import glass, plain
from pbrs_farm.furnishings.things.maker import Maker, thing
from pbrs_farm.geometry.outlines import bent, polar


# fmt: off
@thing(group="food", called="food")
def groceries(m: Maker) -> None:
    """Food.

    A loaf, cheese on a board, a cake, a box of cereals, tins, eggs, rolls in a basket, noodles, a pineapple.
    """
    form, grain = m.integers(0, 9), plain("board wood", m.wood, 0.6)
    crust = plain("crust", shade((0.6, 0.36, 0.16), m.uniform(0.8, 1.15)), 0.8)
    match form:
        case 0:  # a loaf, cut
            m.box(0.34, 0.018, 0.2, 0.004, of=grain)
            m.ellipsoid((0.13, 0.06, 0.06), n=16, at=(0, 0.075, 0), of=crust)
            for k in range(3):
                m.tube([(-0.06 + 0.06 * k, 0.131, -0.03), (-0.04 + 0.06 * k, 0.131, 0.03)], 0.005,
                    n=6, of=plain("crumb", (0.85, 0.7, 0.48), 0.9))
        case 1:  # cheese on a board
            m.cylinder(0.14, 0, 0.016, n=28, of=grain)
            m.turned([(0.055, 0.0162), (0.057, 0.03), (0.055, 0.045)], n=22, at=(-0.05, 0, 0.02),
                of=plain("cheese", (0.93, 0.9, 0.8), 0.7))
            m.box((0.02, 0.1), (0.0162, 0.06), 0.06, 0.004, against=-0.07,
                of=plain("cheese", (0.9, 0.75, 0.35), 0.6))
            for k in range(5):
                m.sphere((0.05 + 0.022 * (k % 3), 0.028, 0.04 + 0.02 * (k // 3)), 0.012, n=8,
                    of=plain("grape", m.pick((0.25, 0.08, 0.2), (0.5, 0.6, 0.2)), 0.3))
        case 2:  # a cake on a foot
            m.turned([(0.06, 0), (0.02, 0.02), (0.018, 0.07), (0.13, 0.085), (0.135, 0.092)], n=26,
                of=m.china())
            m.turned([(0.1, 0.0922), (0.102, 0.12), (0.1, 0.15), (0.09, 0.158)], n=26,
                of=plain("icing", m.pick((0.92, 0.9, 0.85), (0.3, 0.17, 0.1), (0.9, 0.7, 0.72)),
                0.5))
            for k in range(8):
                m.sphere(polar(0.078, 0.165, 0.785 * k), 0.012, n=8,
                    of=plain("berry", (0.6, 0.05, 0.1), 0.3))
        case 3:  # boxes of cereals
            for k in range(m.integers(1, 4)):
                h = m.uniform(0.22, 0.31)
                m.box(0.19, h, 0.06, 0.001, turn=rotation_y(m.uniform(-0.1, 0.1)),
                    at=(0, 0, -0.075 * k), of=m.coloured("packet", 0.5))
                if k == 0:
                    m.box(0.14, (0.4 * h, 0.8 * h), (0.03, 0.0306), of=m.coloured("print", 0.5))
        case 4:  # tins
            for k in range(m.integers(2, 6)):
                with m.moved(at=(0.08 * (k % 2), 0.1105 * (k // 4), 0.08 * (k // 2 % 2))):
                    m.revolve([(0, 0), (0.035, 0), (0.037, 0.003), (0.035, 0.006), (0.035, 0.104),
                        (0.037, 0.107), (0.035, 0.11), (0, 0.108)],
                        of=plain("tin", (0.72, 0.72, 0.72), 0.3))
                    m.ring((0.0345, 0.0356), (0.008, 0.102), of=m.coloured("label", 0.5))
        case 5:  # eggs
            m.box(0.15, 0.035, 0.1, 0.006, of=plain("pulp", (0.6, 0.58, 0.54), 0.95))
            for x, z in product((-0.048, 0.0, 0.048), (-0.024, 0.024)):
                m.ellipsoid((0.02, 0.027, 0.02), n=10, at=(x, 0.042, z),
                    of=plain("egg", m.pick((0.85, 0.68, 0.52), (0.92, 0.9, 0.86)), 0.5))
        case 6:  # rolls in a basket
            m.vessel([(0, 0), (0.09, 0), (0.12, 0.03), (0.13, 0.07)], 0.008, n=22,
                of=plain("wicker", (0.62, 0.47, 0.3), 0.9))
            for k in range(5):
                m.ellipsoid((0.045, 0.032, 0.038), n=12, turn=rotation_y(k),
                    at=polar(0.058, 0.058, 1.257 * k), of=crust)
        case 7:  # noodles in a jar
            m.turned([(0.04, 0), (0.042, 0.004), (0.042, 0.28)], n=20, of=glass())
            for k in range(14):
                m.tube([(0.028 * cos(2.4 * k) * (k / 14) ** 0.5, 0.005,
                    0.028 * sin(2.4 * k) * (k / 14) ** 0.5),
                    (0.034 * cos(2.4 * k) * (k / 14) ** 0.5, 0.25,
                    0.034 * sin(2.4 * k) * (k / 14) ** 0.5)], 0.002, n=4,
                    of=plain("noodle", (0.88, 0.74, 0.42), 0.6))
            m.frustum((0.044, 0.2802), (0.042, 0.3), n=20, of=grain)
        case 8:  # a pineapple
            m.ellipsoid((0.055, 0.085, 0.055), n=16, at=(0, 0.08, 0),
                of=plain("pineapple", (0.65, 0.42, 0.12), 0.7))
            for k in range(9):
                m.tube(bent([(0, 0.15, 0), polar(0.02, 0.2, 2.4 * k),
                    polar(0.03 + 0.006 * k, 0.24 - 0.006 * k, 2.4 * k)], 0.03, n=3), 0.007, n=5,
                    end=0.002, of=plain("leaf", (0.2, 0.35, 0.16), 0.7))
            m.cylinder(0.03, 0, 0.004, n=14, of=crust)


def skin(m: Maker) -> Material:
    """Draw the skin of an apple, an orange or a lemon."""
    colour = m.pick((0.72, 0.12, 0.1), (0.85, 0.45, 0.08), (0.88, 0.75, 0.15), (0.45, 0.62, 0.15))
    return plain("fruit", shade(colour, m.uniform(0.85, 1.15)), 0.4)


def apple(m: Maker, radius: float, x: float, y: float, z: float) -> None:
    """An apple or an orange about a point."""
    of = skin(m)
    m.sphere((x, y, z), radius * m.uniform(0.9, 1.05), n=10, name="fruit", of=of)


@thing(group="fruit")
def fruit(m: Maker) -> None:
    """One to three apples, oranges or lemons side by side."""
    x = 0.0
    for _k in range(m.integers(1, 4)):
        radius = m.uniform(0.028, 0.04)
        x += radius
        z = m.uniform(-0.02, 0.02)
        m.sphere((x, radius, z), radius, n=12, name="fruit", of=skin(m))
        x += radius + 0.008
