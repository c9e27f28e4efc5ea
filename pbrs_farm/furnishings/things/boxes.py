"""Boxes, cartons and baskets of many forms; no effects."""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy import cos, pi, sin

from pbrs_farm.core.classes import BOX
from pbrs_farm.core.frames import rotation_x, rotation_y
from pbrs_farm.core.house import Material
from pbrs_farm.dress.style import Rgb, mix, shade
from pbrs_farm.dress.thing_materials import plain
from pbrs_farm.furnishings.things.forms import formed
from pbrs_farm.furnishings.things.maker import Maker, thing
from pbrs_farm.furnishings.things.shapes import row
from pbrs_farm.geometry.outlines import bent, oval, polar, rect, ring_path, rings, scaled


# fmt: off
@thing(group="box", nyu40=BOX)
def storage_box(m: Maker) -> None:
    """A box.

    With a lid, of cloth, a crate, round, a tin, with corners of metal, of slats, two on each other.
    """
    form = m.integers(0, 11)
    w, h, d = m.uniform(0.2, 0.36), m.uniform(0.1, 0.2), m.uniform(0.16, 0.28)
    hw, hd = w / 2, d / 2
    colour = m.any_colour()
    card, grain = plain("box", colour, 0.7), plain("box wood", m.wood, 0.6)
    if form < 2:
        lidded_box(m, w, h, d, card, plain("lid", shade(colour,
            0.9) if form == 0 else m.any_colour(), 0.7))
        if form == 1:
            m.box(0.08, 0.035, 0.002, on=0.35 * h, against=hd, of=m.metal)
            m.box(0.068, 0.025, 0.0005, on=0.35 * h + 0.005, against=hd + 0.0021,
                of=plain("label", (0.92, 0.91, 0.88), 0.8))
    match form:
        case 2:  # of cloth, open, a loop at its front
            m.loft(rings(rect, [(w, d, 0.02, 0), (w + 0.004, d + 0.004, 0.02, h),
                (w - 0.008, d - 0.008, 0.016, h), (w - 0.012, d - 0.012, 0.016, 0.006)], n=3),
                of=plain("cloth", colour, 0.95))
            m.tube(bent([(-0.05, h * 0.6, hd), (-0.045, h * 0.52, hd + 0.025),
                (0.045, h * 0.52, hd + 0.025), (0.05, h * 0.6, hd)], 0.02, n=3), 0.006, n=6,
                of=plain("strap", (0.35, 0.22, 0.13), 0.7))
        case 3:  # a crate of slats
            with m.of(grain):
                m.box(w, 0.01, d)
                for low, high in row(0.012, h + 0.002, 3):
                    slat = (low, high - 0.012)
                    m.box(w, slat, 0.01, 0.001, against=-d / 2, mirrored="z")
                    m.box(0.01, slat, d - 0.0204, 0.001, left=-w / 2, mirrored="x")
                m.box(0.02, (0.01, h), 0.02, left=0.0102 - w / 2, against=0.0102 - d / 2,
                    mirrored="xz")
        case 4:  # round, as for hats
            r = 0.42 * d + 0.03
            m.cylinder(r, 0, h * 0.8, n=28, of=card)
            m.cylinder(r + 0.004, h * 0.8 + 0.0002, h, n=28, of=m.coloured("lid", 0.6))
        case 5:  # a tin with round corners
            m.loft(rings(rect, [(w * 0.8, d * 0.8, 0.03, 0), (w * 0.8, d * 0.8, 0.03, h * 0.8),
                    (w * 0.8 + 0.006, d * 0.8 + 0.006, 0.033, h * 0.8),
                    (w * 0.8 + 0.006, d * 0.8 + 0.006, 0.033, h * 0.95),
                    (w * 0.8 - 0.01, d * 0.8 - 0.01, 0.028, h)]), of=plain("tin", colour, 0.3))
        case 6:  # corners of metal
            lidded_box(m, w, h, d, card, card)
            for x, z in product((-1, 1), (-1, 1)):
                m.box((x * hw - 0.02 if x > 0 else -hw - 0.005,
                    hw + 0.005 if x > 0 else -hw + 0.02), 0.031,
                    (z * hd - 0.02 if z > 0 else -hd - 0.005, hd + 0.005 if z > 0 else -hd + 0.02),
                    0.001, on=h - 0.03, of=m.metal)
        case 7:  # a wooden box with a knob or a hasp
            m.box(0.8 * w, h * 0.6, 0.8 * d, 0.003, of=grain)
            m.box(0.8 * w, (h * 0.6 + 0.001, h * 0.75), 0.8 * d, 0.003, of=grain)
            m.revolve([(0, 0), (0.005, 0), (0.01, 0.008), (0.009, 0.016), (0, 0.018)], n=12,
                front=(0, h * 0.66, d * 0.4), of=m.metal)
        case 8:  # two on each other
            lidded_box(m, w, h * 0.8, d, card, card)
            side, lid = m.coloured("box", 0.7), m.coloured("lid", 0.7)
            with m.moved(at=(0, h * 0.8 + 0.0003, 0), turn=rotation_y(m.uniform(-0.1, 0.1))):
                lidded_box(m, w * 0.8, h * 0.6, d * 0.8, side, lid)
        case 9:
            plastic_box(m, w, h, d, hw, colour)
        case 10:  # a letter box: drawers
            m.box(0.9 * w, h, d, 0.002, of=card)
            for k in range(2):
                m.box(0.86 * w, (0.006 + k * 0.5 * h, (k + 1) * 0.5 * h - 0.006), 0.007, 0.001,
                    against=hd - 0.001, of=plain("drawer", shade(colour, 0.92), 0.7))
                m.revolve([(0, 0), (0.004, 0), (0.008, 0.006), (0, 0.012)], n=10, front=(0,
                    (k + 0.5) * 0.5 * h, hd + 0.0055), of=m.metal)


def plastic_box(m: Maker, w: float, h: float, d: float, hw: float, colour: Rgb) -> None:
    """A box of clear plastic with an opaque lid."""
    m.loft(rings(rect, [(w * 0.92, d * 0.92, 0.02, 0), (w, d, 0.025, h * 0.85)]),
        of=plain("frosted plastic", (0.82, 0.84, 0.85), 0.3))
    m.loft(rings(rect, [(w + 0.012, d + 0.012, 0.03, h * 0.85 + 0.0002),
        (w + 0.012, d + 0.012, 0.03, h * 0.85 + 0.02), (w - 0.02, d - 0.02, 0.02,
        h * 0.85 + 0.028)]), of=plain("plastic lid", colour, 0.4))
    for x in (-1.0, 1.0):
        m.box(0.012, (h * 0.7, h * 0.85 + 0.018), 0.06, 0.002, x=x * (hw + 0.004),
            of=plain("plastic lid", colour, 0.4))


def lidded_box(m: Maker, w: float, h: float, d: float, side: Material, lid: Material) -> None:
    """A box with a lid over the upper 22 % of its height, 4 mm wider all round."""
    m.box(w, h * 0.78, d, of=side)
    m.box(w + 0.008, (h * 0.78, h), d + 0.008, of=lid)


@thing(group="basket", nyu40=BOX)
def shelf_basket(m: Maker) -> None:
    """A basket for a shelf: plain, woven in courses, of wire, of felt, with handles or a lid."""
    w, h, d = m.uniform(0.22, 0.34), m.uniform(0.13, 0.2), m.uniform(0.18, 0.24)
    hw, hd = w / 2, d / 2
    form = m.integers(0, 8)
    weave = plain("wicker", mix((0.66, 0.52, 0.36), m.style.textiles[0], m.pick(0.0, 0.8)), 0.9)
    felt = plain("felt", m.pick((0.35, 0.36, 0.38), (0.6, 0.58, 0.55), m.any_colour()), 0.95)
    match form:
        case 0:  # plain
            with m.of(weave):
                tray(m, w, h, d, 0.008)
        case 1:  # courses of rope that swell a little
            rope_side(m, w, d, 0.04, h, m.pick(4, 5, 6, 7), weave)
        case 2:  # round, with two grips
            rope_side(m, w * 0.9, w * 0.9, 0.12, h, m.pick(4, 5, 6, 7), weave)
            for x in (-1.0, 1.0):
                m.tube(bent([(x * w * 0.44, h * 0.85, -0.05), (x * w * 0.44, h * 1.2, -0.04),
                    (x * w * 0.44, h * 1.2, 0.04), (x * w * 0.44, h * 0.85, 0.05)], 0.03, n=3),
                    0.007, n=6, of=weave)
        case 3:  # wire
            with m.of(m.metal):
                for y in (0.004, 0.35 * h, 0.68 * h, h - 0.004):
                    m.hoop(rect(w, d, 0.02, n=2), y, 0.0028, n=5)
                for k in range(6):
                    x = (k / 5 - 0.5) * (w - 0.01)
                    m.tube(bent([(x, h, -hd), (x, 0.004, -hd), (x, 0.004, hd), (x, h, hd)], 0.01,
                        n=1), 0.0018, n=5)
        case 4:  # of felt, with labels of leather
            m.loft(rings(rect, [(w, d, 0.03, 0), (w, d, 0.03, h * 0.8), (w, d, 0.03, h),
                (w - 0.01, d - 0.01, 0.025, h), (w - 0.01, d - 0.01, 0.025, 0.006)], n=3), of=felt)
            for x in (-1.0, 1.0):
                m.box(0.006, (h * 0.72, h * 0.86), 0.08, 0.001, x=x * hw,
                    of=plain("leather", (0.35, 0.22, 0.13), 0.6))
        case 5:  # with a lid
            rope_side(m, w, d, 0.03, h * 0.85, m.pick(4, 5, 6), weave)
            m.loft(rings(rect, [(w + 0.012, d + 0.012, 0.03, h * 0.85 + 0.012),
                (w + 0.012, d + 0.012, 0.03, h * 0.98), (w * 0.9, d * 0.85, 0.03, h * 1.02)], n=3),
                of=weave)
        case 6:  # cloth in a frame of wood
            with m.of(plain("wood", m.wood, 0.5)):
                for x, z in product((-hw, hw - 0.014), (-hd, hd - 0.014)):
                    m.box(0.014, h + 0.02, 0.014, 0.001, left=x, against=z)
                m.box(w - 0.028, (h - 0.016, h), 0.014, 0.001, against=-d / 2, mirrored="z")
                m.box(0.014, (h - 0.016, h), d - 0.028, 0.001, left=-w / 2, mirrored="x")
            with m.moved(at=(0, 0.012, 0)), m.of(m.coloured("cloth", 0.95)):
                tray(m, w - 0.03, h - 0.03, d - 0.03, 0.005)
        case 7:  # round, with coloured bands
            m.vessel(scaled(d, h, [(0, 0), (0.4, 0), (0.52, 0.3), (0.55, 0.7), (0.5, 1)]), 0.008,
                n=24, of=weave)
            for t in (0.25, 0.5, 0.75):
                m.tube(ring_path((0.5 + 0.05 * sin(pi * t)) * d, y=t * h, n=24), 0.004, n=5,
                    of=m.coloured("band", 0.9))


def rope_side(m: Maker, w: float, d: float, out: float, h: float, n: int,
    material: Material) -> None:
    """A bottom and courses of rope one above another; out.

    By how much of its width it opens upwards.
    """
    with m.of(material):
        m.loft(rings(oval, [(w * (1 - out), d * (1 - out), 0.001),
            (w * (1 - out), d * (1 - out), 0.009)], n=20, power=4.0))
        for k in range(n):
            g, t = 1 - out + out * (k + 0.5) / n, h / n
            m.hoop(oval(w * g - t, d * g - t, n=16, power=4.0), (k + 0.5) * t, 0.52 * t, n=5)


@thing(group="basket")
def basket(m: Maker) -> None:
    """A basket on the floor.

    Round, deep, with handles, two tones, of rope, full of wood or wool or rolled blankets.
    """
    form, tall, r = m.integers(0, 8), m.uniform(0.18, 0.3), m.uniform(0.14, 0.2)
    weave = plain("wicker", mix((0.62, 0.47, 0.3), m.any_colour(), m.pick(0.0, 0.2, 0.7)), 0.9)
    formed(m, "basket", form, r=r, t=tall, of=weave)
    match form:
        case 1 | 2 | 3:  # of rope
            rope_side(m, 2 * r, (2 if form != 2 else 1.4) * r, 0.1, tall, 7, weave)
            if form != 3:
                for x in (-1.0, 1.0):
                    m.tube(bent([(x * r * 0.93, tall * 0.85, -0.06),
                        (x * r * 0.97, tall * 1.25, -0.05), (x * r * 0.97, tall * 1.25, 0.05),
                        (x * r * 0.93, tall * 0.85, 0.06)], 0.03, n=3), 0.008, n=6, of=weave)
        case 4:  # firewood
            for k in range(6):
                m.tube([((k % 3 - 1) * 0.5 * r, 0.03 + 0.012 * k, (k // 3 - 0.5) * 0.5 * r),
                    ((k % 3 - 1) * 0.62 * r, tall * m.uniform(1.1, 1.5), (k // 3 - 0.5) * 0.7 * r)],
                    m.uniform(0.02, 0.034), n=7, of=plain("log", shade((0.45, 0.32, 0.2),
                    m.uniform(0.7, 1.3)), 0.9))
        case 5:  # wool and needles, or rolled blankets
            for k in range(3):
                m.sphere(polar(0.45 * r, tall * 0.62, 2.1 * k), 0.42 * r, n=12,
                    of=m.coloured("wool", 0.95))
        case 6:  # rolled blankets
            for k in range(3):
                m.tube([polar(0.45 * r, 0.014, 2.1 * k), (0.5 * r * cos(2.1 * k),
                    tall * m.uniform(1.2, 1.6), 0.5 * r * sin(2.1 * k))], 0.36 * r, n=12,
                    of=m.coloured("blanket", 0.95))
        case 7:  # two tones: its lower half painted
            m.vessel(scaled(r, tall, [(0, 0), (0.9, 0), (1, 0.45), (0.99, 0.449)]), 0.01, n=22,
                of=plain("paint", (0.9, 0.89, 0.86), 0.8))
            m.revolve(scaled(r, tall, [(0.99, 0.4495), (1, 0.4495), (1.03, 1), (0.98, 1),
                (0.95, 0.4495), (0.99, 0.4495)]), n=22, of=weave)


@thing(group="box", nyu40=BOX)
def carton(m: Maker) -> None:
    """A cardboard box with tape."""
    w, h, d = m.uniform(0.28, 0.5), m.uniform(0.2, 0.36), m.uniform(0.25, 0.38)
    cardboard(m, w, h, d, 0, 0)


@thing(group="box", nyu40=BOX)
def cartons(m: Maker) -> None:
    """Two or three cardboard boxes on top of each other."""
    y = 0.0
    for _k in range(m.integers(2, 4)):
        w, h, d = m.uniform(0.28, 0.5), m.uniform(0.2, 0.36), m.uniform(0.25, 0.38)
        cardboard(m, w, h, d, y, 0.02)
        # 0.3 mm between two keeps their faces apart.
        y += float(np.float32(h + 0.0005)) + 0.0003


def cardboard(m: Maker, w: float, h: float, d: float, y: float, slip: float) -> None:
    """A box of cardboard with tape, its base at y; slip: maximum offset, metres."""
    board = plain("cardboard", shade((0.66, 0.5, 0.33), m.uniform(0.9, 1.1)), 0.85)
    m.box(w, h, d, at=(m.uniform(-slip, slip) if slip else 0, y, 0), of=board)
    # The tape runs over the top along x and 6 cm down both sides.
    m.box(w + 0.001, 0.0605, 0.05, on=h - 0.06, at=(m.uniform(-slip, slip) if slip else 0, y, 0),
        of=plain("tape", (0.72, 0.6, 0.42), 0.25))


def tray(m: Maker, w: float, h: float, d: float, t: float) -> None:
    """A bottom and four sides of thickness t; front and back fit between left and right."""
    hw, hd = w / 2, d / 2
    m.box(w, t, d)
    m.box(t, (t, h), d, left=-hw)
    m.box((hw - t, hw), (t, h), d)
    m.box(w - 2 * t, (t, h), t, against=-hd)
    m.box(w - 2 * t, (t, h), (hd - t, hd))


@thing(group="box", nyu40=BOX)
def tissue_box(m: Maker) -> None:
    """A box of tissues with one standing out."""
    m.box(0.23, 0.085, 0.12, of=m.coloured("box", 0.6))
    # The tissue is a thin sheet that leans, its foot inside the box.
    m.box(0.09, (-0.005, 0.065), 0.004, name="tissue", turn=rotation_x(0.35), at=(0, 0.08, 0),
        of=plain("tissue", (0.93, 0.93, 0.92), 0.95))


@thing(group="basket")
def laundry_basket(m: Maker) -> None:
    """A tall basket with clothes that show at its rim."""
    tall, r = m.uniform(0.45, 0.62), m.uniform(0.17, 0.22)
    weave = mix((0.68, 0.54, 0.37), m.style.textiles[0], m.pick(0.0, 0.6, 0.9))
    m.vessel(scaled(r, tall, [(0, 0), (0.86, 0), (0.93, 0.3), (1, 0.8), (0.99, 1)]), 0.012, n=24,
        of=plain("wicker", weave, 0.9))
    for _k in range(2):
        m.bulged((1.25 * r, m.uniform(0.08, 0.13), 1.2 * r), n=8, at=(m.uniform(-0.15, 0.15) * r,
            tall - 0.03, m.uniform(-0.15, 0.15) * r), of=m.coloured("cloth", 0.95))
