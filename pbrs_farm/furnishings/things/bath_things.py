"""Bathroom items: bottles, brushes, soap, sponges, rolls of paper; no effects."""

from __future__ import annotations

from pbrs_farm.core.classes import PAPER
from pbrs_farm.core.frames import rotation_y, rotation_z
from pbrs_farm.dress.thing_materials import plain
from pbrs_farm.furnishings.things.forms import formed
from pbrs_farm.furnishings.things.maker import Maker, thing
from pbrs_farm.geometry.outlines import oval, rings, scaled


# fmt: off
@thing(group="bath_small")
def toiletries(m: Maker) -> None:
    """One to four bottles, tubes, jars and cans of shampoo, cream and scent."""
    x = 0.0
    for _k in range(m.integers(1, 5)):
        form, r, tall = m.integers(0, 7), m.uniform(0.018, 0.036), m.uniform(0.08, 0.21)
        side, cap = (m.coloured("bottle", 0.3), plain("cap",
            (0.9, 0.9, 0.88) if m.chance(0.6) else (0.1, 0.1, 0.1), 0.35))
        x += r
        with m.moved(at=(x, 0.0, m.uniform(-0.02, 0.02))):
            formed(m, "toiletries", form, r=r, t=tall, of=side)
            match form:
                case 0 | 1:  # the cap begins just above the bottle, so that no faces coincide
                    m.cylinder(r * 0.55, tall * 0.8402, tall, n=12, of=cap)
                case 2:  # a tube on its cap
                    m.cylinder(r * 0.8, 0, 0.022, n=14, of=cap)
                    m.loft(rings(oval, [(2 * r, 2 * r, 0.0222), (2 * r, 1.6 * r, tall * 0.5),
                        (2 * r, 0.008, tall * 0.8), (2 * r, 0.004, tall * 0.9)], n=16), of=side)
                case 3:  # with a pump
                    m.turned([(r * 0.4, tall * 0.7802), (r * 0.4, tall * 0.84),
                        (0.004, tall * 0.84), (0.004, tall * 0.95)], n=12, of=cap)
                    m.box(0.014, (tall * 0.95, tall), 0.042, 0.002, z=0.014, of=cap)
                case 4:  # a jar of cream
                    m.cylinder(r, 0, 0.03, n=18, of=side)
                    m.cylinder(r * 1.02, 0.0302, 0.046, n=18, of=cap)
                case 5:  # a can
                    m.revolve(scaled(r, tall, [(0, 0.8602), (0.72, 0.8602), (0.68, 1.04),
                        (0, 1.05)]), of=cap)
                case 6:  # scent in square glass
                    m.box(1.8 * r, tall * 0.5, 1.2 * r, 0.004, of=plain("scent",
                        m.pick((0.85, 0.7, 0.45), (0.75, 0.8, 0.85), (0.85, 0.65, 0.68)), 0.08))
                    m.cylinder(r * 0.4, tall * 0.5002, tall * 0.68, n=14, of=m.pick(m.metal, cap))
        x += r + 0.008


@thing(group="bath_small")
def soap_dispenser(m: Maker) -> None:
    """A soap dispenser with a pump."""
    r, tall = 0.034, 0.13
    pump = plain("pump", (0.75, 0.75, 0.75), 0.2)
    # The bottle, then the stem and the nose of its pump above it, 0.2 mm apart.
    m.turned([(r, 0), (r, tall), (0.014, tall + 0.012), (0.014, tall + 0.02)], of=m.china())
    m.cylinder(0.005, tall + 0.0202, tall + 0.045, n=8, of=pump)
    m.box(0.016, 0.0098, 0.053, on=tall + 0.0452, z=0.0185, of=pump)


@thing(group="bath_small")
def brush_cup(m: Maker) -> None:
    """A cup with toothbrushes."""
    m.vessel([(0, 0), (0.035, 0), (0.037, 0.1)], 0.003, of=m.china())
    # Each brush leans outwards and is turned 120 degrees on from the one before.
    for k in range(m.integers(1, 4)):
        turn = rotation_y(2.1 * k + m.uniform(0, 0.5))
        brush = plain("brush", m.colour_within(0.2, 0.9), 0.4)
        with (m.of(brush), m.moved(turn=turn), m.moved(turn=rotation_z(-0.16),
            at=(0.004, 0.0045, 0))):
            m.box(0.008, 0.17, 0.006)
            m.box(0.012, (0.17, 0.19), 0.014, z=0.003)


@thing(group="bath_small")
def soap_bar(m: Maker) -> None:
    """A bar of soap on a dish."""
    soap = m.pick((0.9, 0.86, 0.74), (0.75, 0.85, 0.72), (0.88, 0.74, 0.74))
    # A shallow dish, its rim 15 mm high and its floor 5 mm thick.
    m.turned([(0.04, 0), (0.058, 0.014), (0.055, 0.015), (0.038, 0.005)], n=18, of=m.china())
    m.bulged((0.08, 0.026, 0.052), n=6, edge=0.5, bulge=4.0, at=(0, 0.0185, 0),
        of=plain("soap", soap, 0.4))


@thing(group="bath_small")
def spray_bottle(m: Maker) -> None:
    """A spray bottle of cleaner."""
    m.turned([(0.038, 0), (0.038, 0.14), (0.014, 0.19), (0.014, 0.2)], n=14,
        of=m.coloured("bottle", 0.25))
    # Head and trigger point along +z.
    with m.of(plain("spray head", (0.9, 0.9, 0.9), 0.4)):
        m.box(0.024, (0.2002, 0.232), 0.075, z=0.0125)
        m.box(0.01, (0.15, 0.2001), (0.03, 0.038))


@thing(group="bath_small")
def sponge(m: Maker) -> None:
    """A kitchen sponge: foam below, 22 mm, and the scouring layer, 9 mm, on it."""
    m.box(0.09, 0.022, 0.06, of=plain("sponge", (0.88, 0.76, 0.25), 0.95))
    m.box(0.09, (0.022, 0.031), 0.06, of=plain("scour", (0.15, 0.35, 0.2), 0.95))


@thing(group="toilet_paper", nyu40=PAPER)
def toilet_rolls(m: Maker) -> None:
    """One to three rolls of paper on end."""
    # A tube of 20 mm inner radius, closed onto itself.
    for k in range(m.integers(1, 4)):
        m.ring((0.02, 0.054), (0, 0.098), n=18, at=(0, 0.0985 * k, 0), of=plain("tissue", (0.93,
            0.93, 0.92), 0.95))
