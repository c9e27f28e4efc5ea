"""Framed photographs for tables, and candles; no effects."""

from __future__ import annotations

from itertools import product

from numpy import pi

from pbrs_farm.core.classes import PICTURE
from pbrs_farm.core.frames import rotation_x, rotation_y
from pbrs_farm.core.house import Material
from pbrs_farm.dress.style import mix
from pbrs_farm.dress.thing_materials import glass, plain
from pbrs_farm.furnishings.things.maker import Maker, thing
from pbrs_farm.furnishings.things.shapes import Pair
from pbrs_farm.geometry.outlines import bent, rect, ring_path, rings


# fmt: off
@thing(group="picture_frame", nyu40=PICTURE)
def table_frame(m: Maker) -> None:
    """A framed photograph on a table: many frames, one or several pictures."""
    form = m.weighted(0.3, 0.14, 0.12, 0.12, 0.1, 0.1, 0.12)
    w, h = sorted((m.uniform(0.11, 0.24), m.uniform(0.11, 0.24)))
    w, h = (h, w) if m.chance(0.4) else (w, h)
    material = m.pick(plain("frame", m.wood, 0.4), plain("frame", (0.1, 0.1, 0.1), 0.35),
        plain("frame", (0.9, 0.9, 0.88), 0.4), m.metal, m.coloured("frame", 0.4))
    match form:
        case 0 | 1:  # without or with a mat
            leaning_frame(m, w, h, m.uniform(0.01, 0.028), 0.015, material,
                0.0 if form == 0 else 0.03)
        case 2:  # with a mat, deep as a box
            leaning_frame(m, w, h, 0.012, 0.032, material, 0.04)
        case 3:  # two hinged frames, a little open
            with m.moved(turn=rotation_y(0.3), at=(-w * 0.48, 0, 0)):
                frame_of(m, w, h, 0.014, 0.012, material, 0.0)
            with m.moved(turn=rotation_y(-0.3), at=(w * 0.48, 0, 0)):
                frame_of(m, w, h, 0.014, 0.012, material, 0.0)
        case 4:  # round
            r = m.uniform(0.06, 0.1)
            with m.moved(turn=rotation_x(-0.17), at=(0, r, 0)):
                m.tube(ring_path(r, n=28), 0.011, turn=rotation_x(pi / 2), of=material)
                m.cylinder(r * 0.98, 0, 0.004, n=28, front=(0, 0, -0.003), of=plain("mount", (0.9,
                    0.89, 0.85), 0.8))
                photo_head(m, r * 1.1, 0.0015)
            m.box(0.024, r * 1.2, (-0.003, 0), turn=rotation_x(0.42), at=(0, 0, -r * 0.62),
                of=material)
        case 5:  # a picture in a block of glass
            m.box(w, h, 0.024, 0.002, of=glass())
            with m.moved(at=(0, 0, -0.004)):
                photo(m, (-w / 2 + 0.006, 0.006), (w / 2 - 0.006, h - 0.006))
            if m.chance(0.5):
                m.box(0.7 * w, 0.012, 0.06, 0.002, of=material)
        case 6:  # a small canvas on an easel
            with m.moved(turn=rotation_x(-0.2)):
                m.box(w, h, (0, 0.016), on=0.03, of=plain("canvas", (0.9, 0.89, 0.85), 0.9))
                with m.moved(at=(0, 0, 0.0125)):
                    photo(m, (-w / 2 + 0.001, 0.031), (w / 2 - 0.001, 0.029 + h))
                m.box(0.01, h + 0.05, (-0.012, 0), 0.001, x=-0.3 * w, mirrored="x", of=material)
                m.box(0.8 * w, (0.018, 0.03), 0.036, 0.001, z=0.006, of=material)
            m.tube([(0, 0, -h * 0.55), (0, h * 0.8, -h * 0.17)], 0.005, n=6, of=material)


def leaning_frame(m: Maker, w: float, h: float, b: float, t: float, material: Material,
    mat: float) -> None:
    """It leans back by ten degrees on a prop."""
    with m.moved(turn=rotation_x(-0.17)):
        frame_of(m, w, h, b, t, material, mat)
    m.box(0.03, h * 0.62, (-0.003, 0), turn=rotation_x(0.42), at=(0, 0, -h * 0.352), of=material)


def frame_of(m: Maker, w: float, h: float, b: float, t: float, material: Material,
    mat: float) -> None:
    """A frame of moulding b wide and t thick round a photograph; mat: how wide its mat is."""
    hw = w / 2
    m.frame((-hw, hw), (0.0, h), b, (0, t), 0.0015, of=material)
    if mat > 0:
        m.box(w - 2 * b, (b, h - b), (0.002, 0.0045), of=plain("mat", (0.92, 0.91, 0.88), 0.9))
    edge = b + min(mat, 0.2 * (min(w, h) - 2 * b))
    with m.moved(at=(0, 0, 0.0006 if mat > 0 else 0.0)):
        photo(m, (-hw + edge, edge), (hw - edge, h - edge))


def photo(m: Maker, low: Pair, high: Pair) -> None:
    """A photograph.

    A landscape, somebody, two people, or a wall with a window; panes before each other.
    """
    if m.chance(0.4):
        photograph(m, low, high)
    else:
        w, h = high[0] - low[0], high[1] - low[1]
        x, y, b = (low[0] + high[0]) / 2, low[1], 0.06 * min(w, h)
        m.box((low[0], high[0]), (low[1], high[1]), (0.004, 0.005),
            of=plain("mount", (0.92, 0.91, 0.88), 0.8))
        m.box((low[0] + b, high[0] - b), (low[1] + b, high[1] - b), (0.0052, 0.0056),
            of=plain("photo", mix(m.colour_within(0.2, 0.85), (0.6, 0.58, 0.55), 0.5), 0.3))
        n = 1 if w < 1.2 * h else 2
        for k in range(n):
            c, r = x + (k - (n - 1) / 2) * 0.32 * w, 0.15 * min(w, h)
            m.box(3 * r, (y + b, y + 0.38 * h), (0.0057, 0.006), x=c,
                of=plain("photo", mix(m.colour_within(0.05, 0.8), (0.4, 0.38, 0.36), 0.4), 0.3))
            m.cylinder(r, 0, 0.0004, n=14, front=(c, y + 0.38 * h + 0.9 * r, 0.0061),
                of=plain("photo", m.pick((0.85, 0.66, 0.54), (0.6, 0.42, 0.3), (0.35, 0.23, 0.16)),
                0.3))


def photo_head(m: Maker, w: float, z: float) -> None:
    """A head and its hair, w of the picture across, before z."""
    m.cylinder(0.42 * w, 0, 0.0004, n=20, front=(0, 0, z), of=plain("photo",
        mix(m.colour_within(0.2, 0.85), (0.6, 0.58, 0.55), 0.5), 0.3))
    m.cylinder(0.15 * w, 0, 0.0004, n=14, front=(0, 0.05 * w, z + 0.0008), of=plain("photo", (0.75,
        0.56, 0.44), 0.3))
    m.box(0.4 * w, w / 5, 0.0003, on=-0.3 * w, against=z + 0.0008,
        of=plain("photo", m.colour_within(0.1, 0.7), 0.3))


@thing(group="candle")
def candle(m: Maker) -> None:
    """Candles.

    Pillars, a taper in its stick, tea lights, in a jar, in a lantern, on three arms, a ball.
    """
    form = m.weighted(0.24, 0.16, 0.14, 0.14, 0.12, 0.08, 0.12)
    wax = plain("wax", mix((0.92, 0.88, 0.78), m.style.accent, m.pick(0.0, 0.0, 0.8)), 0.45)
    stick = m.pick(m.metal, m.coloured("stick", 0.4), plain("stick wood", m.wood, 0.5))
    match form:
        case 0:  # pillars
            x = 0.0
            for _ in range(m.integers(1, 4)):
                r, tall = m.uniform(0.025, 0.04), m.uniform(0.06, 0.18)
                x += r
                with m.moved(at=(x, 0, m.uniform(-0.015, 0.015))):
                    pillar(m, r, tall, wax)
                x += r + 0.012
        case 1:  # tapers in their sticks
            x = 0.0
            for _ in range(m.integers(1, 4)):
                h = m.uniform(0.06, 0.2)
                with m.moved(at=(x, 0, m.uniform(-0.02, 0.02))):
                    m.turned([(0.035, 0), (0.033, 0.006), (0.008, 0.012), (0.007, h - 0.02),
                        (0.015, h - 0.015), (0.015, h)], of=stick)
                    m.revolve([(0, 0), (0.011, 0), (0.008, 0.19), (0, 0.2)], n=12,
                        at=(0, h + 0.0002, 0), of=wax)
                x += 0.085
        case 2:  # tea lights
            for k in range(m.integers(2, 6)):
                with m.moved(at=(0.075 * k, 0, m.uniform(-0.025, 0.025))):
                    m.vessel([(0, 0), (0.026, 0), (0.03, 0.05)], 0.003,
                        of=glass(m.any_colour(), 0.35))
                    m.cylinder(0.019, 0.004, 0.018, n=14, of=wax)
        case 3:  # in a jar
            r, h = m.uniform(0.035, 0.05), m.uniform(0.07, 0.11)
            m.vessel([(0, 0), (r, 0), (r, h)], 0.003, n=20, of=glass(m.any_colour(), 0.45))
            m.cylinder(r - 0.004, 0.005, 0.7 * h, n=18, of=wax)
            if m.chance(0.5):
                m.cylinder(r * 1.02, h + 0.0002, h + 0.012, n=20, of=plain("lid wood", m.wood, 0.5))
            else:
                m.box(1.2 * r, (0.2 * h, 0.65 * h), 0.0046, against=r - 0.004,
                    of=plain("label", (0.92, 0.9, 0.85), 0.8))
        case 4:  # in a lantern
            w, h = m.uniform(0.1, 0.15), m.uniform(0.18, 0.3)
            with m.of(stick):
                m.box(w, 0.012, w, 0.002)
                m.box(w, (h - 0.012, h), w, 0.002)
                for x, z in product((-1, 1), (-1, 1)):
                    m.box(0.01, (0.012, h - 0.012), 0.01, 0.001, x=x * (w / 2 - 0.006),
                        z=z * (w / 2 - 0.006))
                m.loft(rings(rect, [(w * 0.8, w * 0.8, 0.002, h),
                    (w * 0.2, w * 0.2, 0.002, h + 0.3 * w)], n=1), sharp=20.0)
                m.tube(ring_path(0.02, n=14), 0.0025, n=6, turn=rotation_x(pi / 2),
                    at=(0, h + 0.3 * w + 0.018, 0))
            with m.moved(at=(0, 0.0122, 0)):
                pillar(m, 0.03, 0.45 * h, wax)
        case 5:  # on three arms
            h = m.uniform(0.14, 0.2)
            with m.of(stick):
                m.turned([(0.05, 0), (0.048, 0.008), (0.01, 0.018), (0.008, h), (0.016, h + 0.01)],
                    n=18)
                for x in (-1.0, 1.0):
                    m.tube(bent([(0, 0.55 * h, 0), (x * 0.09, 0.5 * h, 0), (x * 0.09, 0.9 * h, 0)],
                        0.04, n=4), 0.006)
            for x, y in ((0.0, 1.0), (-0.09, 0.9), (0.09, 0.9)):
                m.revolve([(0, 0), (0.011, 0), (0.009, 0.14), (0, 0.15)], n=10,
                    at=(x, y * h + (0.0105 if x == 0.0 else 0.0), 0), of=wax)
        case 6:  # a ball on a dish
            m.turned([(0.05, 0), (0.065, 0.01), (0.062, 0.012), (0.045, 0.005)], n=20, of=stick)
            if m.chance(0.5):
                m.sphere((0, 0.047, 0), 0.042, of=wax)
            else:
                m.box(0.07, (0.0052, 0.08), 0.07, 0.004, of=wax)


def pillar(m: Maker, r: float, tall: float, wax: Material) -> None:
    """A candle with its wick."""
    # The rim is 4 mm above the hollow of the wick.
    m.revolve([(0, 0), (r, 0), (r, tall - 0.004), (r - 0.004, tall), (0, tall - 0.004)], of=wax)
    m.frustum((0.0015, tall - 0.005), (0.001, tall + 0.008), n=5,
        of=plain("wick", (0.1, 0.1, 0.1), 0.9))


def photograph(m: Maker, low: Pair, high: Pair) -> None:
    """A mount with sky and land as flat panes, a little in front of each other."""
    (x0, y0), (x1, y1) = low, high
    b = 0.12 * min(x1 - x0, y1 - y0)
    horizon = y0 + b + (y1 - y0 - 2 * b) * m.uniform(0.3, 0.6)
    sky, land = m.colour_within(0.45, 0.9), m.colour_within(0.1, 0.6)

    def add_pane(x0: float, y0: float, x1: float, y1: float, z: float, of: Material) -> None:
        m.box((x0, x1), (y0, y1), 0.001, against=z, of=of)

    add_pane(x0, y0, x1, y1, 0.004, plain("mount", (0.92, 0.91, 0.88), 0.8))
    add_pane(x0 + b, horizon, x1 - b, y1 - b, 0.0052, plain("photo", sky, 0.3))
    add_pane(x0 + b, y0 + b, x1 - b, horizon, 0.0052, plain("photo", land, 0.3))
