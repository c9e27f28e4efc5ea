"""Vases; no effects."""

from __future__ import annotations

import numpy as np
from numpy import pi

from pbrs_farm.core.frames import rotation_x
from pbrs_farm.core.house import Surface
from pbrs_farm.dress.thing_materials import glass, plain
from pbrs_farm.furnishings.things.forms import formed
from pbrs_farm.furnishings.things.maker import Maker, thing
from pbrs_farm.geometry.bodies import vessel
from pbrs_farm.geometry.outlines import bent, fluted, oval, polar, ring_path, rings


# fmt: off
@thing(group="vase")
def vase(m: Maker) -> None:
    """A vase of one of many forms, empty or with dry twigs."""
    form, tall, r = m.integers(0, 16), m.uniform(0.15, 0.33), m.uniform(0.045, 0.08)
    material = glass((0.8, 0.9, 0.88), 0.2) if m.chance(0.15) else m.china()
    with m.of(material):
        formed(m, "vase", form, r=r, t=tall)
        match form:
            case 0:  # a drawn-in waist
                m.add(smoothed_vessel(r, r * m.uniform(0.3, 0.8), r * m.uniform(0.35, 0.9),
                    m.uniform(0.25, 0.6), tall))
            case 6:  # fluted
                k = m.integers(9, 16)
                m.loft(rings(fluted, [(1.4 * r, k, 0.06, 0), (1.7 * r, k, 0.06, 0.12 * tall),
                    (2 * r, k, 0.06, 0.45 * tall), (1.3 * r, k, 0.06, 0.85 * tall),
                    (1.5 * r, k, 0.06, tall), (1.5 * r - 0.01, k, 0.06, tall - 0.001),
                    (1.25 * r, k, 0.06, 0.8 * tall)]), sharp=70.0)
            case 7:  # an amphora with two handles
                for s in (-1.0, 1.0):
                    m.tube(bent([(s * r * 0.4, 0.9 * tall, 0.0), (s * r * 1.15, 0.9 * tall, 0.0),
                        (s * r * 0.9, 0.58 * tall, 0.0)], 0.03, n=4), 0.006, n=6)
            case 9:  # facets
                k = m.integers(5, 9)
                m.loft(rings(oval, [(1.2 * r, 1.2 * r, 0), (2.1 * r, 2.1 * r, 0.4 * tall),
                    (1.2 * r, 1.2 * r, tall), (1.2 * r - 0.012, 1.2 * r - 0.012, tall),
                    (1.6 * r, 1.6 * r, 0.4 * tall)], n=k), sharp=15.0)
            case 10:  # a jug
                m.tube(bent([(r * 0.45, 0.88 * tall, 0.0), (r * 1.35, 0.9 * tall, 0.0),
                    (r * 1.25, 0.35 * tall, 0.0), (r * 0.8, 0.3 * tall, 0.0)], 0.04, n=4), 0.008)
            case 13:  # a ring on a foot, its neck on top
                a = 0.36 * tall
                m.tube(ring_path(a, n=24), 0.028, n=10, turn=rotation_x(pi / 2),
                    at=(0.0, a + 0.04, 0.0))
                m.turned([(0.045, 0), (0.042, 0.012), (0.02, 0.03)], n=18)
                m.vessel([(0, 0), (0.02, 0), (0.016, 0.03), (0.024, 0.06)], 0.003,
                    at=(0.0, 2 * a + 0.05, 0.0))
    if form in (1, 3, 8, 15) and m.chance(0.5):
        dry_twigs(m, tall)


def dry_twigs(m: Maker, tall: float) -> None:
    """Dry twigs that lean out of a vase."""
    dry = plain("dry twig", m.pick((0.62, 0.5, 0.34), (0.75, 0.68, 0.52), (0.4, 0.28, 0.2)), 0.9)
    for k in range(m.integers(3, 7)):
        a, lean, top = (2.4 * k + m.uniform(0, 0.5), m.uniform(0.03, 0.09),
            tall * m.uniform(1.4, 2.0))
        m.tube([(0.0, 0.02, 0.0), polar(0.003, 0.7 * tall, a), polar(lean, top, a)], 0.0022, n=5,
            of=dry)
        if m.chance(0.6):
            m.sphere(polar(lean, top, a), 0.011, n=6, of=dry)


def smoothed_vessel(r: float, waist: float, mouth: float, belly: float, tall: float) -> Surface:
    """A vessel through foot, belly, waist and mouth, smoothed by a binomial filter."""
    t = np.linspace(0, 1, 8)
    curve = np.interp(t, [0, belly, 0.85, 1], [r * 0.6, r, waist, mouth])
    curve = np.convolve(np.pad(curve, 1, mode="edge"), [0.25, 0.5, 0.25], "valid")
    outside = [(0.0, 0.0), *((float(a), float(b)) for a, b in zip(curve, t * tall, strict=True))]
    return vessel(outside, 0.004, n=20)
