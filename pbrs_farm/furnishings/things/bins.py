"""Bins of many forms: for paper, of wire, with pedals and lids; no effects."""

from __future__ import annotations

from itertools import product
from typing import Final

from numpy import pi

from pbrs_farm.core.frames import rotation_y
from pbrs_farm.core.house import Material
from pbrs_farm.dress.style import mix
from pbrs_farm.dress.thing_materials import plain
from pbrs_farm.furnishings.things.boxes import rope_side
from pbrs_farm.furnishings.things.catalogued import catalogued
from pbrs_farm.furnishings.things.forms import formed
from pbrs_farm.furnishings.things.maker import Maker, Size, thing
from pbrs_farm.geometry.outlines import bent, d_shape, oval, polar, rect, rings, scaled

# fmt: off
_FORMS = 17
# width, depth and height of each form, per 2 r, 2 r and `tall`; the pair for sorting has a fixed
# width
_EXTENT: Final = {0: (1.0, 1.0, 1.0), 1: (1.0, 1.0, 1.0), 2: (1.0, 1.0, 1.0), 3: (1.02, 1.25, 1.2),
    4: (1.02, 1.25, 1.2), 5: (0.975, 0.825, 1.42), 6: (1.0, 0.75, 1.0), 7: (1.0, 1.0, 1.0),
    8: (1.0, 1.0, 1.12), 10: (0.91, 0.76, 1.38), 11: (1.01, 0.76, 1.36), 12: (0.97, 0.97, 1.05),
    13: (1.0, 1.0, 1.3), 14: (1.0, 1.0, 1.25), 15: (0.92, 0.66, 1.33), 16: (1.0, 1.0, 1.0)}


@thing(group="bin")
def bin(m: Maker) -> None:
    """A bin: for paper, of wire, with a pedal, a swing lid, square, of wicker, of felt, of slats."""
    bin_of(m, m.integers(0, _FORMS), m.uniform(0.11, 0.15), m.uniform(0.26, 0.36))


def bin_of(m: Maker, form: int, r: float, tall: float) -> None:
    """A bin about 2 r wide. form: 0 to 16; tall: without its lid."""
    material = m.metal if m.chance(0.3) else m.coloured("bin", 0.5)
    formed(m, "bin_of", form, r=r, t=tall, of=material)
    match form:
        case 0 | 1:  # for paper
            m.vessel([(0, 0), (r * 0.85, 0), (r, tall)], 0.003, n=20 if form == 0 else 28,
                of=material)
        case 2:
            wire_bin(m, r, tall)
        case 3 | 4:
            pedal_bin(m, r, tall, form, material)
        case 5:  # a lid that swings
            m.loft(rings(rect, [(1.95 * r, 1.65 * r, 0.04, tall * 1.2 + 0.0002),
                (1.95 * r, 1.65 * r, 0.04, tall * 1.25), (1.5 * r, 1.2 * r, 0.03, tall * 1.42)]),
                of=m.coloured("lid", 0.5))
        case 7:  # of wicker
            rope_side(m, 2 * r, 2 * r, 0.1, tall, 8, plain("wicker",
                mix((0.66, 0.52, 0.36), m.any_colour(), m.pick(0.0, 0.3)), 0.9))
        case 8:  # of felt, with two straps
            m.vessel([(0, 0), (r * 0.98, 0), (r, tall)], 0.006, n=24,
                of=plain("felt", m.pick((0.3, 0.31, 0.33), (0.55, 0.53, 0.5), (0.35, 0.22, 0.13)),
                0.95))
            for x in (-1.0, 1.0):
                m.tube(bent([(x * r * 0.97, tall * 0.9, -0.04), (x * r, tall * 1.12, -0.03),
                    (x * r, tall * 1.12, 0.03), (x * r * 0.97, tall * 0.9, 0.04)], 0.02, n=3),
                    0.005, n=6, of=plain("strap", (0.35, 0.22, 0.13), 0.6))
        case 9:  # two bins for sorted waste
            for x in (-0.115, 0.115):
                m.box(0.22, tall * 1.25, 0.28, 0.008, x=x, of=plain("bin",
                    m.pick((0.3, 0.32, 0.33), (0.9, 0.9, 0.89)), 0.5))
                m.box(0.224, (tall * 1.2502, tall * 1.32), 0.284, 0.006, x=x,
                    of=plain("lid", m.pick((0.2, 0.4, 0.25), (0.2, 0.3, 0.5), (0.75, 0.6, 0.15),
                    (0.25, 0.25, 0.26)), 0.5))
        case 10:  # a lid that opens by a touch, over a tall square body
            m.loft(rings(rect, [(1.82 * r, 1.52 * r, 0.02, tall * 1.3 + 0.0002),
                (1.82 * r, 1.52 * r, 0.02, tall * 1.36), (1.7 * r, 1.4 * r, 0.02, tall * 1.38)],
                n=3), of=plain("lid", m.pick((0.1, 0.1, 0.1), (0.9, 0.9, 0.88)), 0.4))
        case 11:  # a half round bin for a place at the wall
            m.loft([(d_shape(1.9 * r, 1.4 * r, back=-0.7 * r), 0.0),
                (d_shape(2 * r, 1.5 * r, back=-0.75 * r), tall * 1.2)], of=material)
            m.loft(rings(d_shape, [(2.02 * r, 1.52 * r, -0.76 * r, tall * 1.2 + 0.0002), (2.02 * r,
                1.52 * r, -0.76 * r, tall * 1.26), (1.7 * r, 1.2 * r, -0.6 * r, tall * 1.36)],
                column="back"), of=plain("lid", (0.12, 0.12, 0.12), 0.45))
        case 12:  # of slats round a bag
            m.cylinder(0.86 * r, 0.01, tall, n=20, of=plain("bag", (0.86, 0.84, 0.78), 0.95))
            with m.of(m.timber):
                for k in range(16):
                    m.box(0.028, tall * 1.05, 0.008, 0.002, against=0.9 * r,
                        turn=rotation_y(pi / 8 * k))
                for y in (0.1, 0.9):
                    m.hoop(oval(1.8 * r, 1.8 * r, n=20), y * tall, 0.006, n=5)
        case 13:  # a bucket with a handle
            m.tube(bent([(-r, tall * 0.94, 0), (-0.8 * r, tall * 1.3, 0), (0.8 * r, tall * 1.3, 0),
                (r, tall * 0.94, 0)], 0.1, n=5), 0.004, n=6, of=m.metal)
        case 14:  # a ball's form with a hole
            m.revolve(scaled(r, tall * 1.25, [(0, 0), (0.6, 0), (0.95, 0.3), (1, 0.55),
                (0.85, 0.85), (0.6, 1), (0.56, 0.99), (0.8, 0.84), (0.94, 0.55), (0.9, 0.3),
                (0.55, 0.03), (0, 0.03)]), n=30, of=material)
        case 15:
            bag_bin(m, r, tall)
        case 16:  # a drum of folded sheet: facets
            n = m.pick(6, 8, 12)
            m.loft(rings(oval, [(1.6 * r, 1.6 * r, 0), (2 * r, 2 * r, tall),
                (2 * r - 0.008, 2 * r - 0.008, tall), (1.6 * r - 0.008, 1.6 * r - 0.008, 0.006)],
                n=n), sharp=20.0, of=material)


def wire_bin(m: Maker, r: float, tall: float) -> None:
    """A bin of wire."""
    with m.of(m.metal):
        m.cylinder(r * 0.85, 0, 0.004, n=20)
        for t in (0.3, 0.65, 1.0):
            m.hoop(oval(2 * r * (0.85 + 0.15 * t), 2 * r * (0.85 + 0.15 * t), n=22), t * tall,
                0.003, n=5)
        for k in range(22):
            m.tube([polar(0.84 * r, 0.002, 0.2856 * k), polar(r, tall, 0.2856 * k)], 0.0015, n=4)


def pedal_bin(m: Maker, r: float, tall: float, form: int, material: Material) -> None:
    """A bin with a pedal; form 3 has a lid like its body."""
    h = tall * 1.2
    m.turned([(r * 0.98, 0.012), (r, 0.02), (r, h * 0.86)], n=26, of=material)
    m.cylinder(r * 1.02, 0, 0.0118, n=26, of=plain("bin foot", (0.08, 0.08, 0.08), 0.6))
    m.revolve(scaled(r, h, [(0, 0.8602), (1.02, 0.8602), (1.02, 0.89), (0.8, 0.97), (0, 1)]), n=26,
        of=material if form == 3 else plain("lid", (0.1, 0.1, 0.1), 0.5))
    m.box(0.06, (0.004, 0.018), (r * 0.9, r + 0.05), 0.003, of=plain("pedal", (0.1, 0.1, 0.1), 0.5))
    m.box(0.08, (h * 0.82, h * 0.9), (-r - 0.015, -r * 0.9), 0.003,
        of=plain("hinge", (0.1, 0.1, 0.1), 0.5))


def bag_bin(m: Maker, r: float, tall: float) -> None:
    """A bag in a frame on crossed legs."""
    with m.of(m.pick(m.timber, m.metal)):
        for z, s in product((-0.5, 0.5), (-1.0, 1.0)):
            m.tube([(-s * 0.85 * r, 0.008, z * r), (s * 0.85 * r, tall * 1.3, z * r)], 0.008, n=7)
        for x in (-0.85, 0.85):
            m.rod(x * r, tall * 1.3, (-0.6 * r, 0.6 * r), 0.009, n=7)
    m.loft(rings(rect, [(1.0 * r, 0.8 * r, 0.03, 0.18 * tall),
        (1.62 * r, 0.92 * r, 0.04, tall * 1.28)], n=3), of=m.coloured("bag", 0.95))


def _drawn_size(m: Maker) -> Size:
    w, d, h = m.pick(*_EXTENT.values())
    r, tall = m.uniform(0.11, 0.15), m.uniform(0.26, 0.36)
    return 2 * r * w, 2 * r * d, tall * h


@catalogued(size=_drawn_size)
def standing_bin(m: Maker, size: Size) -> None:
    """A bin of the catalogue, in a form with the same ratio of depth to width."""
    w, d, h = size
    fitting = [(form, w / extent[0] / 2, h / extent[2]) for form,
        extent in _EXTENT.items() if abs(extent[1] / extent[0] - d / w) < 0.02]
    bin_of(m, *m.pick(*fitting))
