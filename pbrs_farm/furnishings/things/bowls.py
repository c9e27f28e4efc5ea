"""Bowls with contents, and pots with plants; no effects."""

from __future__ import annotations

from numpy import cos, pi, sin

from pbrs_farm.dress.thing_materials import plain
from pbrs_farm.furnishings.things.food import apple
from pbrs_farm.furnishings.things.forms import formed
from pbrs_farm.furnishings.things.maker import Maker, thing
from pbrs_farm.geometry.outlines import bent, fluted, oval, polar, rings, scaled


# fmt: off
@thing(group="bowl")
def bowl(m: Maker) -> None:
    """A bowl: on a foot, square, of wood, fluted, of wire, shallow, two of a set; some hold fruit."""
    form, r = m.integers(0, 11), m.uniform(0.08, 0.15)
    tall = r * m.uniform(0.45, 0.7)
    material = plain("wood bowl", m.wood, 0.4) if m.chance(0.3) else m.china()
    with m.of(material):
        formed(m, "bowl", form, r=r, t=tall)
        match form:
            case 4:  # fluted
                k = m.integers(8, 15)
                m.loft(rings(fluted, [(1.0 * r, k, 0.05, 0), (1.6 * r, k, 0.08, tall * 0.45),
                    (2 * r, k, 0.1, tall), (2 * r - 0.01, k, 0.1, tall),
                    (1.5 * r, k, 0.08, tall * 0.45), (0.9 * r, k, 0.05, 0.008)]), sharp=70.0)
            case 7:  # some in each other
                for k in range(m.integers(2, 5)):
                    m.vessel([(0, 0), (r * 0.42, 0), (r * 0.44, 0.006), (r * 0.7, tall * 0.45),
                        (r * 0.82, tall * 0.8)], 0.004, at=(0, 0.018 * k, 0))
            case 10:  # two grips
                for x in (-1.0, 1.0):
                    m.tube(bent([(x * r * 0.97, tall * 0.92, -0.03),
                        (x * (r + 0.03), tall * 0.95, -0.025), (x * (r + 0.03), tall * 0.95, 0.025),
                        (x * r * 0.97, tall * 0.92, 0.03)], 0.015, n=3), 0.006, n=6)
    # Of wire.
    if form == 8:
        with m.of(m.metal):
            for t in (0.0, 0.33, 0.66, 1.0):
                m.hoop(oval(2 * r * (0.45 + 0.55 * t**0.5), 2 * r * (0.45 + 0.55 * t**0.5), n=20),
                    0.003 + t * (tall - 0.003), 0.003 if t in (0.0, 1.0) else 0.0015, n=5)
            for k in range(10):
                m.tube([polar(r * 0.45, 0.003, 0.628 * k), polar(r * 0.83, 0.4 * tall, 0.628 * k),
                    polar(r, tall, 0.628 * k)], 0.0018, n=5)
            m.cylinder(r * 0.45, 0, 0.003, n=18)
    # Apples and oranges in a ring, one on top.
    if r > 0.1 and form in (0, 1, 3, 9, 10) and m.chance(0.7):
        radius, n = min(0.034, r * 0.3), m.integers(3, 6)
        spread = r * 0.7 - radius
        for k in range(n):
            angle = 2 * pi * k / n + m.uniform(-0.15, 0.15)
            apple(m, radius, spread * cos(angle), 0.012 + radius + tall * 0.3, spread * sin(angle))
        apple(m, radius, 0.0, 0.012 + tall * 0.3 + radius * 2.1, 0.0)


@thing(group="vase")
def plant_pot(m: Maker) -> None:
    """A pot with earth in it.

    Tapered, straight, square, on a saucer or legs, ribbed, of zinc, a bowl.
    """
    form, r = m.integers(0, 9), m.uniform(0.06, 0.1)
    tall = r * m.uniform(1.4, 1.9)
    material, soil = (plain("pot", (0.66, 0.36, 0.24) if m.chance(0.4) else m.any_colour(), 0.8),
        plain("earth", (0.16, 0.11, 0.08), 0.95))
    with m.of(material):
        formed(m, "plant_pot", form, r=r, t=tall)
        match form:
            case 5:  # on three legs
                for k in range(3):
                    m.tube([polar(r * 1.0, 0, 2.1 * k), polar(r * 0.75, 0.1, 2.1 * k)], 0.008, n=7,
                        of=plain("leg wood", m.wood, 0.5))
            case 8:  # of zinc, two grips
                m.vessel(scaled(r, tall, [(0, 0), (0.75, 0), (0.97, 0.95), (1.02, 0.95),
                    (1.02, 1)]), 0.003, n=22, of=m.metal)
                for x in (-1.0, 1.0):
                    m.tube(bent([(x * r * 0.93, tall * 0.7, -0.02),
                        (x * (r + 0.02), tall * 0.72, -0.015), (x * (r + 0.02), tall * 0.72, 0.015),
                        (x * r * 0.93, tall * 0.7, 0.02)], 0.01, n=2), 0.003, n=5, of=m.metal)
    y, low = ((0.08 if form == 5 else 0.0) + tall * (0.6 if form == 7 else 0.82),
        0.086 if form == 5 else 0.02)
    m.revolve([(0, low), (0.55 * r, low), (r * 0.78, y), (0, y + 0.004)], n=18, of=soil)
