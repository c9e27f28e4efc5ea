"""Cards, brochures, and sheets on a floor; no effects."""

from __future__ import annotations

from numpy import pi

from pbrs_farm.core.classes import PAPER
from pbrs_farm.core.frames import rotation_x, rotation_y
from pbrs_farm.core.house import Material
from pbrs_farm.dress.thing_materials import plain
from pbrs_farm.furnishings.things.maker import Maker, thing
from pbrs_farm.geometry.bodies import slab

# fmt: off
_INK = plain("print", (0.3, 0.3, 0.32), 0.8)


def white_paper(m: Maker) -> Material:
    """White or cream."""
    return plain("sheet", m.pick((0.93, 0.92, 0.89), (0.92, 0.91, 0.86), (0.94, 0.94, 0.94)), 0.8)


def printed(m: Maker, w: float, h: float, z: float, ground: Material) -> None:
    """A sheet w by h about the origin, 0.4 mm thick from z on: a heading, a picture, lines."""
    m.box(w, h, 0.0004, on=-h / 2, against=z, of=ground)
    top, edge = h / 2 - 0.08 * h, 0.1 * w
    if m.chance(0.5):
        m.add(slab((-w / 2 + edge, top - 0.08 * h, z + 0.0004), (m.uniform(0.0, 0.4) * w, top,
            z + 0.0006)), of=m.pick(_INK, m.coloured("print", 0.7)))
        top -= 0.14 * h
    if m.chance(0.5):
        high = m.uniform(0.25, 0.45) * h
        m.box(w - 2 * edge, (top - high, top), 0.0002, against=z + 0.0004,
            of=m.coloured("print", 0.7))
        top -= high + 0.06 * h
    while top > -h / 2 + 0.12 * h:
        m.add(slab((-w / 2 + edge, top - 0.022 * h, z + 0.0004),
            (m.uniform(0.1, 0.4) * w, top, z + 0.0006)), of=_INK)
        top -= 0.075 * h


@thing(group="papers", nyu40=PAPER)
def standing_card(m: Maker) -> None:
    """One to three open cards or brochures, upright like a book or like a tent."""
    for k in range(m.pick(1, 1, 2, 3)):
        w, h = m.pick((0.105, 0.148), (0.148, 0.105), (0.1, 0.21), (0.148, 0.21), (0.12, 0.17))
        ground = white_paper(m) if m.chance(0.5) else m.coloured("card", 0.5)
        x, turn = 0.0 if k == 0 else 0.17 * k, m.normal(0, 0.25)
        with m.moved(at=(x, 0.0, m.normal(0, 0.015)), turn=rotation_y(turn)):
            if m.chance(0.7):
                half = m.uniform(0.35, 0.75)
                for s in (-1.0, 1.0):
                    with (m.moved(turn=rotation_y(s * half), at=(0.0, 0.0, 0.0)),
                        m.moved(at=(s * (w / 2 + 0.0004), h / 2, 0.0))):
                        printed(m, w, h, 0.0, ground)
            else:
                for turned in (0.0, pi):
                    with (m.moved(turn=rotation_y(turned)), m.moved(turn=rotation_x(-0.28),
                        at=(0.0, 0.0, 0.275 * h)), m.moved(at=(0.0, h / 2, 0.0))):
                        printed(m, w, h, 0.0002, ground)


@thing(group="papers", nyu40=PAPER)
def floor_papers(m: Maker) -> None:
    """A few sheets and leaflets that lie where they fell, one over another."""
    for k in range(m.integers(2, 5)):
        w, h = m.pick((0.21, 0.297), (0.21, 0.297), (0.148, 0.21), (0.1, 0.21))
        ground = white_paper(m) if m.chance(0.6) else m.coloured("leaflet", 0.5)
        with (m.moved(at=(m.normal(0, 0.07), 0.0007 * k, m.normal(0, 0.07)),
            turn=rotation_y(m.uniform(0, 6.28))), m.moved(turn=rotation_x(-pi / 2))):
            printed(m, w, h, 0.0, ground)
