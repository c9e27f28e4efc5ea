"""Cushions, pillows, folded cloth, poufs; no effects."""

from __future__ import annotations

from itertools import product

from pbrs_farm.core.classes import CLOTHES, PILLOW, TOWEL
from pbrs_farm.core.frames import rotation_y
from pbrs_farm.dress.style import Rgb, mix, shade
from pbrs_farm.dress.thing_materials import plain
from pbrs_farm.furnishings.things.maker import Maker, thing
from pbrs_farm.geometry.outlines import rect, scaled


# fmt: off
@thing(group="pillow", nyu40=PILLOW)
def cushion(m: Maker) -> None:
    """A flat cushion for a sofa or a bed.

    Square, long, round, a roll, with piping, with a button.
    """
    form, edge, colour = m.integers(0, 8), m.pick(0.38, 0.42, 0.46), m.textile()
    colour, thick = m.style.accent if m.chance(0.3) else colour, m.uniform(0.11, 0.15)
    material, trim = (plain("cushion", colour, 0.95), plain("piping",
        m.pick(m.style.accent, shade(colour, 0.7), (0.9, 0.88, 0.84)), 0.95))
    with m.of(material):
        match form:
            case 0 | 1:  # square
                m.bulged((edge, thick, edge), n=12 if form == 0 else 11)
            case 2:  # long
                m.bulged((edge * 1.25, thick, edge * 0.8))
            case 3:  # with piping
                m.bulged((edge, thick, edge), n=9)
                m.hoop(rect(edge * 0.94, edge * 0.94, 0.03, n=2), 0.0, 0.006, n=5, of=trim)
            case 4:  # round, with a button
                # Both sides are drawn in towards the middle, where the button holds them.
                upper = [(0.2, 0), (0.196, 0.02), (0.184, 0.04), (0.162, 0.057), (0.132, 0.066),
                    (0.1, 0.068), (0.066, 0.062), (0.036, 0.05), (0.014, 0.038), (0, 0.034)]
                lower = [(r, -y) for r, y in reversed(upper)]
                m.revolve([*lower, *upper[1:]], n=28)
                m.revolve([(0, 0.032), (0.016, 0.036), (0.013, 0.044), (0, 0.047)], n=12, of=trim)
            case 5:  # a roll
                m.tube([(-edge / 2, 0, 0), (-edge / 2 + 0.01, 0, 0), (edge / 2 - 0.01, 0, 0),
                    (edge / 2, 0, 0)], 0.08, n=18)
            case 6:  # with tassels
                m.bulged((edge, thick, edge), n=8)
                for x, z in product((-1.0, 1.0), (-1.0, 1.0)):
                    m.sphere((x * edge * 0.48, 0, z * edge * 0.48), 0.014, n=8, of=trim)
            case 7:  # with three bands
                m.bulged((edge, thick * 0.9, edge), n=10, edge=0.3, bulge=3.2)
                for x in (-0.22, 0.0, 0.22):
                    m.box(0.016, 0.008, 0.56 * edge, x=x * edge, on=0.445 * thick - 0.004, of=trim)


@thing(group="ottoman")
def pouf(m: Maker) -> None:
    """A round seat of cloth, as high as a knee at most."""
    r, tall = m.uniform(0.2, 0.29), m.uniform(0.28, 0.4)
    m.revolve(scaled(r, tall, [(0, 0), (0.86, 0), (0.97, 0.15), (1, 0.5), (0.96, 0.85),
        (0.84, 0.97), (0.5, 1), (0, 1)]), n=28, of=plain("pouf", m.textile(), 0.95))


@thing(group="pillow", nyu40=PILLOW, called="pillow")
def bed_pillow(m: Maker) -> None:
    """A pillow to sleep on, its long side across the bed."""
    # A long pillow or a square one, white or of a calm colour, washed pale.
    wide, deep = (0.68, 0.46) if m.chance(0.6) else (0.58, 0.58)
    linen = mix((0.91, 0.9, 0.88), m.textile(3), 0.35) if m.chance(0.4) else (0.91, 0.9, 0.88)
    m.bulged((wide, m.uniform(0.12, 0.16), deep), bulge=2.6, of=plain("pillow", linen, 0.95))


def folded(m: Maker, w: float, h: float, d: float, n: int, colour: Rgb, name: str) -> None:
    """N layers of folded cloth on top of each other; h: of one."""
    # Layers have gaps of half a per cent, are turned a little, and have round folds.
    for k in range(n):
        x, z = w / 2 - abs(m.normal(0, 0.004)), d / 2 - abs(m.normal(0, 0.004))
        m.rounded(2 * x, h, 2 * z, 0.48 * h, n=1, turn=rotation_y(m.normal(0, 0.015)),
            at=(m.normal(0, 0.003), k * h * 1.005, m.normal(0, 0.003)),
            of=plain(name, shade(colour, 1.0 - 0.03 * (k % 2)), 0.95))


@thing(group="towel", nyu40=TOWEL)
def folded_towels(m: Maker) -> None:
    """A pile of folded towels."""
    y = 0.0
    for _k in range(m.integers(1, 5)):
        # Most homes own towels of one colour family, bleached to different degrees.
        colour = mix(m.textile(), (0.92, 0.91, 0.89), m.pick(0.0, 0.3, 0.8))
        with m.moved(at=(0, y, 0)):
            folded(m, 0.3, 0.025, 0.2, 2, colour, "towel")
        y += 0.0505


@thing(group="blanket")
def folded_blanket(m: Maker) -> None:
    """A folded blanket or two, some rolled, some with a fringe or a band."""
    colour, n = m.textile(), m.integers(2, 5)
    if m.chance(0.25):  # rolled, with a strap
        r = m.uniform(0.06, 0.09)
        m.rod((-0.21, 0.21), r, 0.0, r, n=m.pick(14, 18), of=plain("blanket", colour, 0.95))
        for x in m.pick((0.0,), (-0.1, 0.1)):
            m.rod((x - 0.012, x + 0.012), r, 0.0, r + 0.002, n=18, of=plain("leather", (0.35, 0.22, 0.13), 0.6))
        return
    folded(m, 0.42, 0.03, 0.32, n, colour, "blanket")
    trim = plain("blanket", shade(colour, m.pick(0.7, 1.25)), 0.95)
    if m.chance(0.4):
        for k in range(m.pick(14, 20)):
            m.box(0.006, 0.003, (0.158, 0.158 + m.uniform(0.03, 0.045)), x=0.02 * (k - 7), on=0.03 * n - 0.018,
                of=trim)
    if m.chance(0.35):
        m.box(0.03, (0.002, 0.03 * n + 0.003), 0.323, 0.001, x=m.uniform(-0.1, 0.1), of=trim)


@thing(group="clothes", nyu40=CLOTHES)
def folded_clothes(m: Maker) -> None:
    """A pile of folded shirts and jumpers."""
    y = 0.0
    for _k in range(m.integers(2, 6)):
        # any tint, mixed with the style so that no pile is conspicuous
        colour, h = (mix(m.colour_within(0.15, 0.85), m.style.textiles[0], 0.4),
            m.uniform(0.02, 0.035))
        with m.moved(at=(0, y, 0)):
            folded(m, 0.28, h, 0.22, 1, colour, "clothes")
        y += h * 1.01
