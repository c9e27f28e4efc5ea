"""Cups, and the handles that cups and glasses have; no effects."""

from __future__ import annotations

import numpy as np

from pbrs_farm.core.frames import rotation_y
from pbrs_farm.core.house import Surface
from pbrs_farm.dress import thing_materials as materials
from pbrs_farm.dress.thing_materials import plain
from pbrs_farm.furnishings.things.forms import formed
from pbrs_farm.furnishings.things.maker import Maker, thing
from pbrs_farm.geometry.bodies import smooth
from pbrs_farm.geometry.outlines import bent, oval, rings


# fmt: off
@thing(group="cup")
def cup(m: Maker) -> None:
    """A mug, a tea cup on its saucer, a small or tall one, of enamel, with facets, without a handle."""
    form, tall, r, glaze = (m.integers(0, 13), m.uniform(0.078, 0.102), m.uniform(0.036, 0.044),
        m.china())
    with m.of(glaze):
        formed(m, "cup", form, r=r, t=tall)
        match form:
            case 0 | 1:  # a mug
                foot = r * m.uniform(0.65, 1.0)
                # Curved from its foot, on a ring, like a barrel.
                m.vessel([(0, 0), *m.pick(
                    [(foot, 0), (foot + 0.3 * (r - foot), 0.012), (r, 0.4 * tall), (r, tall)],
                    [(0.8 * r, 0), (0.78 * r, 0.004), (r, 0.01), (r, tall)],
                    [(0.85 * r, 0), (r, 0.3 * tall), (1.04 * r, 0.55 * tall), (r, 0.8 * tall),
                        (0.94 * r, tall)])], 0.003, of=glaze)
                m.add(handle(0.97 * r, tall))
            case 2:  # a tea cup on its saucer
                m.tube(bent([(r * 1.0, 0.058, 0), (r * 1.6, 0.06, 0), (r * 1.5, 0.03, 0),
                    (r * 0.85, 0.028, 0)], 0.015, n=3), 0.003, n=6)
                m.turned([(0.04, 0), (0.075, 0.011), (0.074, 0.0125), (0.04, 0.006), (0.03, 0.012)],
                    n=24)
            case 3:  # for espresso, on its saucer
                m.tube(bent([(0.027, 0.052, 0), (0.047, 0.054, 0), (0.045, 0.026, 0),
                    (0.026, 0.026, 0)], 0.012, n=3), 0.003, n=6)
                m.revolve([(0, 0), (0.03, 0), (0.055, 0.008), (0.054, 0.0095), (0.03, 0.005),
                    (0, 0.008)], n=22)
            case 4:  # a tall one
                m.tube(bent([(0.037, 0.11, 0), (0.068, 0.11, 0), (0.066, 0.035, 0),
                    (0.034, 0.035, 0)], 0.02, n=3), 0.004, n=6)
            case 7:  # facets
                k = m.integers(6, 10)
                m.loft(rings(oval, [(1.6 * r, 1.6 * r, 0), (2 * r, 2 * r, 0.03),
                    (2 * r, 2 * r, tall), (2 * r - 0.008, 2 * r - 0.008, tall),
                    (2 * r - 0.01, 2 * r - 0.01, 0.008)], n=k), sharp=20.0)
                m.add(handle(0.92 * r, tall))
            case 8:  # round
                m.add(handle(r * 1.12, 0.09))
            case 9:  # a groove, an angular handle
                m.tube(bent([(r - 0.002, tall * 0.85, 0), (r + 0.03, tall * 0.85, 0),
                    (r + 0.03, tall * 0.3, 0), (r - 0.002, tall * 0.3, 0)], 0.006, n=2), 0.0045,
                    n=6)
            case 10:  # two on each other
                for k in range(2):
                    with m.moved(at=(0, 0.05 * k, 0)):
                        m.vessel([(0, 0), (0.026, 0), (0.032, 0.03), (0.036, 0.075)], 0.003, n=18)
                        m.add(handle(0.033, 0.075), turn=rotation_y(0.4 * k))
    match form:
        case 6:  # enamel with a dark rim
            coat = plain("enamel", m.pick((0.92, 0.91, 0.88), (0.2, 0.32, 0.45), (0.5, 0.16, 0.13)),
                0.2)
            m.vessel([(0, 0), (r * 0.95, 0), (r, 0.008), (r, tall * 0.9)], 0.002, n=20, of=coat)
            m.hoop(oval(2 * r, 2 * r, n=20), tall * 0.9, 0.002, n=5,
                of=plain("rim", (0.08, 0.1, 0.2), 0.3))
            m.tube(bent([(r - 0.001, tall * 0.78, 0), (r + 0.032, tall * 0.78, 0),
                (r + 0.028, tall * 0.22, 0), (r - 0.001, tall * 0.22, 0)], 0.015, n=3), 0.003, n=6,
                of=coat)
        case 11:  # for the way: a lid and a sleeve
            m.frustum((0.029, 0), (0.038, 0.13), n=20, of=m.coloured("cup", 0.5))
            m.revolve([(0.0325, 0.045), (0.0335, 0.045), (0.037, 0.095), (0.0355, 0.095),
                (0.0325, 0.045)], n=20, of=plain("sleeve", (0.35, 0.24, 0.16), 0.8))
            m.turned([(0.04, 0.1302), (0.04, 0.138), (0.034, 0.145)], n=20,
                of=plain("cup lid", (0.12, 0.12, 0.12), 0.4))
        case 12:  # of glass, tea in it
            m.vessel([(0, 0), (r * 0.9, 0), (r * 0.95, tall)], 0.0025, n=20, of=materials.CLEAR)
            m.frustum((r * 0.86, 0.004), (r * 0.88, tall * 0.75), n=18,
                of=plain("tea", m.pick((0.35, 0.16, 0.06), (0.12, 0.07, 0.04), (0.75, 0.6, 0.42)),
                0.15))
            m.add(handle(r * 0.93, tall), of=materials.CLEAR)


def handle(radius: float, tall: float) -> Surface:
    """A cup's: a bent strip of six pieces, 8 mm wide, its ends inside the cup's side."""
    t = np.linspace(-0.5, 0.5, 7) * np.pi
    reach, half = 0.026, tall * 0.3
    # The strip's middle line (radius, height): half an ellipse beside the cup.
    middle = np.stack([radius - 0.002 + reach * np.cos(t), tall * 0.52 + half * np.sin(t)], -1)
    outward = np.stack([np.cos(t), np.sin(t)], -1)
    points = []
    # Four corners a station, (depth across the strip, side along z), metres.
    for along, out in zip(middle, outward, strict=True):
        for depth, side in ((-0.003, -0.004), (0.003, -0.004), (0.003, 0.004), (-0.003, 0.004)):
            x, y = along + out * depth
            points.append((x, y, side))
    # The caps at both ends, then two triangles a side between neighbouring stations.
    faces = [(0, 1, 2), (0, 2, 3), (24, 26, 25), (24, 27, 26)]
    for k in range(6):
        for j in range(4):
            a, b = 4 * k + j, 4 * k + (j + 1) % 4
            faces += [(a, b + 4, b), (a, a + 4, b + 4)]
    return smooth("handle", np.array(points), np.array(faces, np.int32))
