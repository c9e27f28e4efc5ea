"""Toilets, basins, baths and showers of the generated catalogue; no effects."""

from __future__ import annotations

from itertools import product
from typing import Final

from numpy import pi

from pbrs_farm.core.catalogue import Place
from pbrs_farm.core.classes import BATHTUB, OTHERSTRUCTURE, SINK, TOILET
from pbrs_farm.core.frames import rotation_x, rotation_y
from pbrs_farm.core.house import Material
from pbrs_farm.dress.style import mix
from pbrs_farm.furnishings.things.bodies import (
    bevelled,
    cylinder,
    frustum,
    hoop,
    loft,
    revolve,
    rounded,
    slab,
    tube,
)
from pbrs_farm.furnishings.things.cloth import hanging
from pbrs_farm.furnishings.things.joints import Inside, Look, four_legs, fronts_of, hollow
from pbrs_farm.furnishings.things.maker import Maker, Size, family
from pbrs_farm.furnishings.things.materials import (
    BLACK_STEEL,
    BRASS,
    CERAMIC,
    CHROME,
    CLEAR,
    FROSTED,
    STEEL,
    WHITE,
    WHITE_STEEL,
    glossy,
    plain,
)
from pbrs_farm.furnishings.things.outlines import bent, d_shape, oval, rect, rings

_LID_RAD: Final = pi / 2  # of a toilet, close before its cistern


@family(group="toilet", nyu40=TOILET, place=Place.FLOOR, variants=36,
    size=lambda m: (m.pick(0.36, 0.38, 0.4), m.pick(0.6, 0.64, 0.66, 0.7),
    m.pick(0.76, 0.8, 0.82, 0.86, 1.0)))  # fmt: skip
def toilet(m: Maker, size: Size) -> None:
    """A toilet.

    A cistern on it, one that stands out of the wall, a box behind it, or a high cistern.
    """
    w, d, h = size
    hw = w / 2
    back = -d / 2
    form = 3 if h > 0.9 else m.weighted(0.45, 0.3, 0.25)
    tank = 0.17 if form != 1 else 0.14
    rim, bw, bd = m.pick(0.39, 0.4, 0.42), min(w, 0.37), d - tank - 0.01
    zc = d / 2 - bd / 2
    power = m.pick(2.0, 2.2, 2.6, 3.2)
    foot = m.weighted(0.5, 0.3, 0.2)
    is_open = m.chance(0.4) and h > rim + bd - 0.02
    # The bowl: foot, flare, rim, and inside down to the water.
    fw, fd = ((0.22, 0.62 * bd), (bw * 0.8, 0.9 * bd), (0.26, 0.75 * bd))[foot]
    fz = zc - (bd - fd) / 2 + 0.02
    m.add(loft([(oval(fw, fd, z=fz, power=power), 0.0),
        (oval(fw * 0.96, fd * 0.96, z=fz, power=power), 0.02), (oval(fw * 0.92 if foot == 0 else fw,
        fd, z=fz, power=power), 0.12), (oval(bw * (0.75 if foot == 0 else 0.9), bd * 0.86, z=zc,
        power=power), 0.26), (oval(bw * 0.97, bd * 0.98, z=zc, power=power), rim - 0.06),
        (oval(bw, bd, z=zc, power=power), rim - 0.012),
        (oval(bw - 0.02, bd - 0.02, z=zc, power=power), rim),
        (oval(bw - 0.09, bd - 0.12, z=zc + 0.01, power=power), rim - 0.004),
        (oval(bw - 0.12, bd - 0.16, z=zc + 0.01, power=power), rim - 0.1),
        (oval(0.12, 0.16, z=zc + 0.02, power=2.0), rim - 0.2)]), of=CERAMIC)  # fmt: skip
    # Between bowl and tank.
    m.add(bevelled((-0.09, 0.1 if foot == 0 else 0.0, back + 0.005), (0.09, rim - 0.05, zc), 0.02),
        of=CERAMIC)  # fmt: skip
    lid = CERAMIC if m.chance(0.8) else m.pick(m.timber, glossy("lid", (0.1, 0.1, 0.1), 0.3),
        glossy("lid", m.any_colour(), 0.3))  # fmt: skip
    with m.of(lid):
        if is_open:
            m.add(hoop(oval(bw - 0.06, bd - 0.09, z=zc + 0.005, power=power), rim + 0.012, 0.022,
                n=6))  # fmt: skip
            m.add(loft(rings(oval, [(bw - 0.01, bd - 0.06, 0.0), (bw, bd - 0.05, 0.004),
                (bw, bd - 0.05, 0.014), (bw - 0.02, bd - 0.07, 0.018)], power=power)),
                turn=rotation_x(-1.65), at=(0.0, rim + bd / 2 - 0.01, back + tank + 0.065))  # fmt: skip
        else:
            m.add(hoop(oval(bw - 0.06, bd - 0.09, z=zc + 0.005, power=power), rim + 0.012, 0.022,
                n=6))  # fmt: skip
            with m.hinged("lid", at=(0.0, rim + 0.032, zc + 0.025 - bd / 2), axis=(-1.0, 0.0, 0.0),
                upper_rad=_LID_RAD):  # fmt: skip
                m.add(loft(rings(oval, [(bw - 0.01, bd - 0.04, rim + 0.0315),
                    (bw, bd - 0.03, rim + 0.0335), (bw, bd - 0.03, rim + 0.043),
                    (bw - 0.05, bd - 0.08, rim + 0.049)], z=zc + 0.01, power=power)))  # fmt: skip
    button = m.pick(CHROME, CHROME, WHITE_STEEL, BLACK_STEEL)
    match form:
        case 0:  # a cistern on the bowl
            r = m.pick(0.02, 0.04, 0.07)
            m.add(rounded((-hw, rim - 0.02, back), (hw, h - 0.035, back + tank), r, n=2),
                of=CERAMIC)  # fmt: skip
            m.add(loft([(rect(w - 0.005, tank + 0.005, r, z=back + tank / 2), h - 0.045),
                (rect(w, tank + 0.008, r, z=back + tank / 2 + 0.001), h - 0.03),
                (rect(w, tank + 0.008, r, z=back + tank / 2 + 0.001), h - 0.012),
                (rect(w - 0.03, tank - 0.02, r, z=back + tank / 2), h - 0.002)]), of=CERAMIC)  # fmt: skip
            if m.chance(0.75):
                m.add(frustum((0.022, h - 0.003), (0.02, h), n=16), at=(0.0, 0.0, back + tank / 2),
                    of=button)  # fmt: skip
            else:
                m.add(tube([(-hw + 0.06, h - 0.09, back + tank - 0.005),
                    (-hw + 0.06, h - 0.09, back + tank + 0.02),
                    (-hw + 0.13, h - 0.1, back + tank + 0.025)], 0.006, n=8), of=button)  # fmt: skip
        case 1:  # a panel of glass or stone with a plate, in front of the pipes
            m.add(bevelled((-hw, 0.0, back), (hw, h, back + tank), 0.004), of=m.pick(WHITE,
                m.timber, glossy("panel", (0.15, 0.15, 0.16), 0.3)))  # fmt: skip
            m.add(bevelled((-0.11, h - 0.2, back + tank), (0.11, h - 0.06, back + tank + 0.01),
                0.002), of=button)  # fmt: skip
            for a, b in ((-0.1, 0.02), (0.028, 0.1)):
                m.add(bevelled((a, h - 0.19, back + tank + 0.01),
                    (b, h - 0.07, back + tank + 0.014), 0.002), of=button)  # fmt: skip
        case 2:  # a round tank of the bowl's own form
            m.add(loft(rings(d_shape, [(w * 0.92, tank, 0.2), (w, tank, rim),
                (w, tank + 0.01, h - 0.03), (w * 0.96, tank, h - 0.005),
                (w * 0.85, tank * 0.85, h - 0.0005)], back=back, share=0.5)), of=CERAMIC)  # fmt: skip
            m.add(frustum((0.025, h - 0.002), (0.023, h), n=16), at=(0.0, 0.0, back + tank / 2),
                of=button)  # fmt: skip
        case 3:  # a high cistern with a chain
            m.add(tube([(0.0, 0.25, back + 0.05), (0.0, h - 0.2, back + 0.05)], 0.022, n=10),
                of=CHROME)  # fmt: skip
            m.add(rounded((-hw, h - 0.28, back), (hw, h - 0.03, back + 0.17), 0.03, n=2),
                of=CERAMIC)  # fmt: skip
            m.add(bevelled((-hw, h - 0.03, back), (hw, h, back + 0.175), 0.006), of=CERAMIC)
            m.add(tube([(hw - 0.03, h - 0.26, back + 0.176), (hw - 0.03, h - 0.6, back + 0.176)],
                0.002, n=5), of=CHROME)  # fmt: skip
            m.add(frustum((0.012, 0.0), (0.007, 0.06), n=10),
                at=(hw - 0.03, h - 0.66, back + 0.176), of=m.timber)  # fmt: skip


def basin_tap(m: Maker, y: float, z: float, material: Material) -> None:
    """A mixer on a basin's rim at y, its spout towards +z.

    A lever, a cube, an arch, or a pillar with two handles.
    """
    form = m.weighted(0.4, 0.2, 0.25, 0.15)
    with m.of(material):
        m.add(frustum((0.026, y), (0.024, y + 0.008), n=18), at=(0.0, 0.0, z))
        match form:
            case 0:  # one lever
                m.add(tube([(0.0, y, z), (0.0, y + 0.11, z)], 0.02, n=14))
                m.add(tube([(0.0, y + 0.07, z), (0.0, y + 0.085, z + 0.12)], 0.012, n=10))
                m.add(tube([(0.0, y + 0.112, z - 0.01), (0.0, y + 0.135, z + 0.07)], 0.007, n=8))
            case 1:  # cubes
                m.add(bevelled((-0.022, y, z - 0.022), (0.022, y + 0.1, z + 0.022), 0.002))
                m.add(bevelled((-0.018, y + 0.065, z), (0.018, y + 0.09, z + 0.13), 0.002))
                m.add(bevelled((-0.016, y + 0.105, z - 0.02), (0.016, y + 0.115, z + 0.06), 0.002))
            case 2:  # an arch
                m.add(tube(bent([(0.0, y, z), (0.0, y + 0.15, z), (0.0, y + 0.15, z + 0.12),
                    (0.0, y + 0.1, z + 0.12)], 0.06, n=6), 0.01, n=10))  # fmt: skip
                m.add(tube([(0.0, y + 0.04, z), (0.07, y + 0.05, z)], 0.006, n=8))
            case 3:  # a pillar with two handles
                m.add(tube(bent([(0.0, y, z), (0.0, y + 0.1, z), (0.0, y + 0.1, z + 0.11),
                    (0.0, y + 0.07, z + 0.11)], 0.03, n=3), 0.012, n=10))  # fmt: skip
                for x in (-0.08, 0.08):
                    m.add(tube([(x, y, z), (x, y + 0.045, z)], 0.013, n=10))
                    m.add(tube([(x - 0.03, y + 0.05, z), (x + 0.03, y + 0.05, z)], 0.007, n=8))
                    m.add(tube([(x, y + 0.05, z - 0.03), (x, y + 0.05, z + 0.03)], 0.007, n=8))


def basin_bowl(m: Maker, form: int, w: float, d: float, back: float, y: float, deep: float) -> None:
    """A basin from y - deep to y, its back at `back`; form.

    Rectangle, round front, oval, or shell.
    """
    z = back + d / 2
    match form:
        case 0:  # a rectangle
            m.add(loft([(rect(w * 0.8, d * 0.8, 0.05, z=z), y - deep),
                (rect(w * 0.97, d * 0.97, 0.04, z=z), y - 0.3 * deep),
                (rect(w, d, 0.02, z=z), y - 0.02), (rect(w, d, 0.02, z=z), y - 0.004),
                (rect(w - 0.01, d - 0.01, 0.02, z=z), y),
                (rect(w - 0.08, d - 0.15, 0.04, z=z + 0.035), y - 0.002),
                (rect(w - 0.12, d - 0.19, 0.05, z=z + 0.035), y - 0.7 * deep),
                (rect(w * 0.4, d * 0.3, 0.05, z=z + 0.03), y - 0.82 * deep)]), of=CERAMIC)  # fmt: skip
        case 1:  # straight at the back, round in front
            m.add(loft([(d_shape(w * 0.6, d * 0.6, back=back), y - deep),
                (d_shape(w * 0.92, d * 0.94, back=back), y - 0.4 * deep),
                (d_shape(w, d, back=back), y - 0.03), (d_shape(w, d, back=back), y - 0.005),
                (d_shape(w - 0.012, d - 0.006, back=back), y),
                (d_shape(w - 0.09, d - 0.15, back=back + 0.11), y - 0.003),
                (d_shape(w - 0.14, d - 0.19, back=back + 0.12), y - 0.6 * deep),
                (d_shape(w * 0.4, d * 0.3, back=back + 0.18), y - 0.8 * deep)]), of=CERAMIC)  # fmt: skip
        case 2:  # an oval
            m.add(loft(rings(oval, [(w * 0.55, d * 0.55, y - deep),
                (w * 0.95, d * 0.95, y - 0.35 * deep), (w, d, y - 0.012), (w - 0.008, d - 0.008, y),
                (w - 0.03, d - 0.03, y - 0.003), (w * 0.85, d * 0.85, y - 0.5 * deep),
                (w * 0.35, d * 0.35, y - 0.85 * deep)], z=z)), of=CERAMIC)  # fmt: skip
    m.add(cylinder(0.022, y - 0.86 * deep, y - 0.78 * deep, n=14), at=(0.0, 0.0, z + 0.03),
        of=CHROME)  # fmt: skip


@family(group="washbasin", nyu40=SINK, place=Place.FLOOR, called="washbasin_with_cabinet",
    variants=28, size=lambda m: (m.pick(0.5, 0.6, 0.6, 0.7, 0.8, 0.9), m.pick(0.42, 0.45, 0.48),
    m.pick(0.98, 1.0, 1.02)))  # fmt: skip
def vanity(m: Maker, size: Size) -> None:
    """A basin in a cupboard.

    Doors or drawers, on legs, a plinth or the wall, its bowl sunk in or on top.
    """
    w, d, h = size
    hw, hd = w / 2, d / 2
    back, y = -hd, 0.84
    tap, on_top = m.pick(CHROME, CHROME, STEEL, BLACK_STEEL, BRASS), m.chance(0.35)
    look = Look(m.pick("flat", "flat", "shaker", "grooved"),
        m.pick(m.timber, WHITE, glossy("front", m.paint(), 0.35)), WHITE, m.timber,
        m.pick("knob", "bar", "edge", "disc", "square"), m.metal)  # fmt: skip
    top = y - (0.12 if on_top else 0.088)
    legs = m.weighted(0.4, 0.3, 0.3)
    low = m.pick(0.25, 0.3) if legs == 0 else 0.14 if legs == 1 else 0.0
    hollow(m, (-hw + 0.02, hw - 0.02), (low, top), (back, hd - 0.05), 0.016, look.front)
    # What seems to float is held by a strip at the wall.
    match legs:
        case 0:
            m.add(slab((-0.12, 0.0, back), (0.12, low, back + 0.03)), of=look.body)
        case 1:
            with m.moved(at=(0.0, 0.0, -0.02)):
                four_legs(m, m.pick("square", "tapered", "round"), w - 0.04, d - 0.06, low + 0.001,
                    0.035, 0.03, 0.0, m.pick(m.timber, BLACK_STEEL))  # fmt: skip
        case 2:
            m.add(slab((-hw + 0.03, -0.0001, back), (hw - 0.03, 0.08, hd - 0.09)), of=look.body)
    n = 2 if w > 0.62 else 1
    fronts_of(m, look, (-hw + 0.02, hw - 0.02), (low + (0.08 if legs == 2 else 0.0), top - 0.002),
        hd - 0.05, m.pick([("door",)] * n, [("drawer", "drawer")],
        [("drawer",), ("drawer", "drawer")] if n > 1 else [("low", "drawer")]), False,
        Inside(back + 0.008, top=top - (0.02 if on_top else 0.05)))  # fmt: skip
    if on_top:
        m.add(bevelled((-hw, top, back), (hw, top + 0.03, hd), 0.003), of=m.pick(m.timber,
            glossy("stone", (0.85, 0.84, 0.81), 0.3), glossy("stone", (0.2, 0.2, 0.21), 0.3)))  # fmt: skip
        basin_bowl(m, m.pick(2, 2, 0), min(0.42, w - 0.08), min(0.36, d - 0.08),
            back + d - min(0.36, d - 0.08) - 0.02, top + 0.15, 0.119)  # fmt: skip
        basin_tap(m, top + 0.03, back + 0.05, tap)
    else:
        basin_bowl(m, m.pick(0, 0, 1), w, d, back, y, 0.09)
        basin_tap(m, y - 0.003, back + 0.06, tap)
    # All are as high as they say.
    m.add(tube([(0.0, y - 0.1, back + 0.05), (0.0, h, back + 0.05)], 0.004, n=6), of=tap)


@family(group="washbasin", nyu40=SINK, place=Place.FLOOR, called="washbasin", variants=16,
    size=lambda m: (m.pick(0.5, 0.55, 0.6, 0.65), m.pick(0.42, 0.45, 0.5), m.pick(0.97, 1.0)))  # fmt: skip
def pedestal_basin(m: Maker, size: Size) -> None:
    """A basin on a column."""
    w, d, h = size
    back, y = -d / 2, 0.84
    tap, s = m.pick(CHROME, CHROME, BRASS, STEEL), m.uniform(0.9, 1.2)
    basin_bowl(m, m.pick(0, 1, 1), w, d, back, y, m.pick(0.16, 0.18, 0.2))
    column = m.weighted(0.4, 0.3, 0.3)
    with m.of(CERAMIC), m.moved(at=(0.0, 0.0, back + 0.12)):
        match column:
            case 0:  # oval
                m.add(loft(rings(oval, [(0.2 * s, 0.18, 0.0), (0.19 * s, 0.17, 0.02),
                    (0.13 * s, 0.13, 0.14), (0.13 * s, 0.13, 0.5), (0.2 * s, 0.18, y - 0.14)])))  # fmt: skip
            case 1:  # square
                m.add(loft(rings(rect, [(0.2 * s, 0.18, 0.02, 0.0), (0.2 * s, 0.18, 0.02, 0.04),
                    (0.15 * s, 0.14, 0.02, 0.06), (0.16 * s, 0.14, 0.02, 0.5),
                    (0.2 * s, 0.18, 0.02, y - 0.14)])))  # fmt: skip
            case 2:  # turned
                m.add(revolve([(0.0, 0.0), (0.1 * s, 0.0), (0.11 * s, 0.03), (0.07 * s, 0.07),
                    (0.06 * s, 0.4), (0.075 * s, 0.6), (0.1 * s, y - 0.15), (0.0, y - 0.15)], n=22))  # fmt: skip
    basin_tap(m, y - 0.003, back + 0.06, tap)
    m.add(tube([(0.0, y - 0.1, back + 0.05), (0.0, h, back + 0.05)], 0.004, n=6), of=tap)


@family(group="washbasin", nyu40=SINK, place=Place.WALL, called="wall_washbasin", variants=20,
    size=lambda m: (m.pick(0.4, 0.45, 0.5, 0.55, 0.6), m.pick(0.33, 0.38, 0.42, 0.46),
    m.pick(0.5, 0.52)))  # fmt: skip
def wall_basin(m: Maker, size: Size) -> None:
    """A basin that hangs: its waste pipe shows, or is behind a shield."""
    w, d, h = size
    y, tap = h - 0.15, m.pick(CHROME, CHROME, STEEL, BLACK_STEEL, BRASS)
    basin_bowl(m, m.pick(0, 1, 1), w, d, 0.0, y, m.pick(0.12, 0.14, 0.16))
    basin_tap(m, y - 0.003, 0.06, tap)
    if m.chance(0.6):
        m.add(tube(bent([(0.0, y - 0.1, d * 0.5), (0.0, 0.06, d * 0.5), (0.0, 0.06, 0.0)], 0.05,
            n=4), 0.016, n=10), of=CHROME)  # fmt: skip
        m.add(cylinder(0.03, 0.0, 0.13, n=16), at=(0.0, 0.0, d * 0.5), of=CHROME)
    else:
        m.add(loft(rings(d_shape, [(0.14, 0.14, 0.0), (0.2, 0.2, 0.06), (0.24, 0.26, y - 0.1)],
            back=0.0)), of=CERAMIC)  # fmt: skip
    m.add(tube([(0.0, y - 0.1, 0.05), (0.0, h, 0.05)], 0.004, n=6), of=tap)


@family(group="bathtub", nyu40=BATHTUB, place=Place.FLOOR, variants=32,
    size=lambda m: (m.pick(1.5, 1.6, 1.7, 1.7, 1.8), m.pick(0.7, 0.75, 0.8),
    m.pick(0.6, 0.62, 0.65)))  # fmt: skip
def bathtub(m: Maker, size: Size) -> None:
    """A bath.

    Built in behind a panel, or free on its own, on feet or a plinth; taps at one end or the long side.
    """
    w, d, h = size
    hw, hd = w / 2, d / 2
    form = m.weighted(0.55, 0.25, 0.2)
    tap = m.pick(CHROME, CHROME, STEEL, BLACK_STEEL, BRASS)
    colour = CERAMIC if m.chance(0.85) else glossy("enamel", m.any_colour(), 0.2)
    side = m.pick(-1.0, 1.0)
    p = m.pick(3.0, 4.0, 6.0, 9.0)
    has_tap = form == 0 or m.chance(0.4)
    # Its height is that of the taps.
    h = h - 0.092 if has_tap else h
    match form:
        case 0:  # built in: an apron of panels, a rim, the hollow
            apron = m.pick(WHITE, WHITE, m.timber, glossy("panel", m.paint(), 0.35))
            m.add(slab((-hw + 0.012, 0.0, -hd + 0.012), (hw - 0.012, 0.12, hd - 0.05)), of=apron)
            for x in (-hw + 0.012, hw - 0.028):
                m.add(bevelled((x, 0.0, -hd + 0.012), (x + 0.016, h - 0.04, hd - 0.05), 0.003),
                    of=apron)  # fmt: skip
            if m.chance(0.5):
                m.add(bevelled((-hw + 0.01, 0.0, hd - 0.05), (hw - 0.01, h - 0.04, hd - 0.012),
                    0.003), of=apron)  # fmt: skip
            else:
                for k in range(m.pick(3, 4, 10)):
                    m.add(bevelled((-hw + 0.01 + k * (w - 0.02) / 10, 0.0, hd - 0.05),
                        (-hw + 0.01 + (k + 1) * (w - 0.02) / 10, h - 0.04, hd - 0.012), 0.003),
                        of=apron)  # fmt: skip
                m.add(slab((-hw + 0.01, 0.0, hd - 0.052), (hw - 0.01, h - 0.04, hd - 0.022)),
                    of=apron)  # fmt: skip
            with m.of(colour):
                bath_hollow(m, w, d, h, p)
        case 1:  # free: a shell that swells
            m.add(loft([(oval(w * 0.72, d * 0.6, n=36, power=p), 0.0),
                (oval(w * 0.84, d * 0.8, n=36, power=p), 0.12),
                (oval(w * 0.96, d * 0.96, n=36, power=p), h - 0.08),
                (oval(w, d, n=36, power=p), h - 0.012),
                (oval(w - 0.012, d - 0.012, n=36, power=p), h),
                (oval(w - 0.06, d - 0.06, n=36, power=p), h - 0.006),
                (oval(w * 0.84, d * 0.8, n=36, power=p), 0.26),
                (oval(w * 0.6, d * 0.5, n=36, power=3.0), 0.15)]), of=colour)  # fmt: skip
        case 2:  # on feet
            m.add(loft(rings(oval, [(w * 0.6, d * 0.5, 0.12), (w * 0.84, d * 0.8, 0.2),
                (w * 0.95, d * 0.94, h - 0.1), (w * 0.96, d * 0.95, h - 0.03), (w, d, h - 0.015),
                (w * 0.985, d * 0.97, h), (w * 0.93, d * 0.87, h - 0.01), (w * 0.84, d * 0.78, 0.3),
                (w * 0.55, d * 0.45, 0.2)], n=36, power=2.6)), of=colour)  # fmt: skip
            claw = m.pick(CHROME, BRASS, BLACK_STEEL, colour)
            for x, z in product((-1.0, 1.0), (-1.0, 1.0)):
                m.add(revolve([(0.0, 0.0), (0.035, 0.0), (0.04, 0.02), (0.024, 0.05), (0.035, 0.1),
                    (0.045, 0.18), (0.0, 0.18)], n=14), at=(x * 0.3 * w, 0.0, z * 0.26 * d),
                    of=claw)  # fmt: skip
    # Its taps: on the rim at one end, or along the back.
    if has_tap:
        with (
            m.of(tap),
            m.moved(
                at=(side * (hw - (0.06 if form == 0 else 0.025)), h - 0.012, 0.0),
                turn=rotation_y(-side * pi / 2),
            ),
        ):
            m.add(tube(bent([(0.0, 0.0, 0.0), (0.0, 0.09, 0.0), (0.0, 0.09, 0.12),
                (0.0, 0.06, 0.12)], 0.03, n=3), 0.014, n=10))  # fmt: skip
            for x in (-0.09, 0.09):
                m.add(tube([(x, 0.0, 0.0), (x, 0.06, 0.0)], 0.02, n=10))
    if form == 0:
        m.add(frustum((0.032, -0.003), (0.03, 0.0), n=16), at=(side * 0.22 * w, h - 0.402, 0.0),
            of=CHROME)  # fmt: skip


def bath_hollow(m: Maker, w: float, d: float, h: float, p: float) -> None:
    """The rim and hollow of a bath of w by d: rectangles outside, an oval of that power inside."""
    m.add(loft([(oval(w - 0.1, d - 0.1, n=36, power=6.0), 0.1),
        (oval(w - 0.03, d - 0.03, n=36, power=14.0), h - 0.05),
        (oval(w, d, n=36, power=40.0), h - 0.04), (oval(w, d, n=36, power=40.0), h - 0.004),
        (oval(w - 0.006, d - 0.006, n=36, power=40.0), h),
        (oval(w - 0.15, d - 0.14, n=36, power=p), h - 0.002),
        (oval(w - 0.24, d - 0.2, n=36, power=p), h - 0.25),
        (oval(w - 0.5, d - 0.34, n=36, power=3.0), h - 0.405)]))  # fmt: skip


@family(group="shower", nyu40=OTHERSTRUCTURE, place=Place.FLOOR, variants=28,
    size=lambda m: (m.pick(0.8, 0.9, 0.9, 1.0), m.pick(0.8, 0.8, 0.9, 1.0),
    m.pick(1.95, 2.0, 2.05)))  # fmt: skip
def shower(m: Maker, size: Size) -> None:
    """A shower in a corner.

    A tray, panes with or without frames, a door or a curtain, a rail with its head.
    """
    w, d, h = size
    hw, hd = w / 2, d / 2
    fittings = m.pick(CHROME, CHROME, BLACK_STEEL, WHITE_STEEL, STEEL)
    pane = m.pick(CLEAR, CLEAR, FROSTED)
    tray = m.pick(0.04, 0.06, 0.14)
    m.add(loft(rings(rect, [(w, d, 0.02, 0.0), (w, d, 0.02, tray - 0.004),
        (w - 0.008, d - 0.008, 0.018, tray), (w - 0.1, d - 0.1, 0.03, tray - 0.002),
        (w - 0.14, d - 0.14, 0.03, tray - 0.022)])), of=m.pick(CERAMIC, CERAMIC,
        glossy("tray", (0.2, 0.2, 0.21), 0.5)))  # fmt: skip
    m.add(cylinder(0.045, tray - 0.022, tray - 0.018, n=18), of=CHROME)
    form = m.weighted(0.35, 0.3, 0.35)
    top = h - 0.002
    if form < 2:
        # Panes on the left and right, a door in the front.
        for x in (-hw + 0.012, hw - 0.012):
            m.add(slab((x - 0.004, tray, -hd + 0.01), (x + 0.004, top, hd - 0.02)), of=pane)
            for z in (-hd + 0.002, hd - 0.024):
                m.add(bevelled((x - 0.012, tray, z), (x + 0.012, top, z + 0.022), 0.002),
                    of=fittings)  # fmt: skip
            if form == 0:
                m.add(bevelled((x - 0.012, top - 0.022, -hd + 0.02), (x + 0.012, h, hd - 0.02),
                    0.002), of=fittings)  # fmt: skip
        cut = m.pick(0.0, 0.0, 0.15) * w
        for a, b, z in ((-hw + 0.02, cut + 0.01, hd - 0.008), (cut - 0.01, hw - 0.02, hd - 0.02)):
            m.add(slab((a, tray + 0.01, z - 0.004), (b, top, z + 0.003)), of=pane)
            if form == 0:
                for x in (a, b - 0.018):
                    m.add(bevelled((x, tray + 0.005, z - 0.008), (x + 0.018, top, z + 0.006),
                        0.002), of=fittings)  # fmt: skip
        m.add(bevelled((-hw, h - 0.03, hd - 0.03), (hw, h, hd), 0.002), of=fittings)
        if form == 0:
            m.add(bevelled((-hw, tray - 0.002, hd - 0.03), (hw, tray + 0.02, hd), 0.002),
                of=fittings)  # fmt: skip
        m.add(tube(bent([(cut - 0.05, 0.9, hd - 0.004), (cut - 0.05, 0.9, hd + 0.016),
            (cut - 0.05, 1.25, hd + 0.016), (cut - 0.05, 1.25, hd - 0.004)], 0.01, n=2), 0.007,
            n=8), of=fittings)  # fmt: skip
    else:
        # A curtain that hangs from a rail round two sides.
        m.add(tube(bent([(-hw + 0.012, h - 0.03, -hd), (-hw + 0.012, h - 0.03, hd - 0.012),
            (hw - 0.012, h - 0.03, hd - 0.012), (hw - 0.012, h - 0.03, -hd)], 0.08, n=4), 0.011,
            n=8), of=fittings)  # fmt: skip
        weave = plain("curtain fabric", mix(m.any_colour(), (0.93, 0.93, 0.92),
            m.pick(0.3, 0.8, 0.95)), 0.7)  # fmt: skip
        wide = m.uniform(0.35, 0.7) * w
        m.add(hanging(wide, h - tray - 0.07, 0.05, 0.003, m.pick(5.0, 6.0, 7.0)),
            at=(-hw + 0.07 + wide / 2, tray + 0.03, hd - 0.03), of=weave)  # fmt: skip
        if m.chance(0.7):
            m.add(hanging(0.55 * d, h - tray - 0.07, 0.045, 0.003, 6.0), turn=rotation_y(pi / 2),
                at=(hw - 0.03, tray + 0.03, 0.1 * d), of=weave)  # fmt: skip
        for x in (-hw, hw):
            m.add(slab((x - 0.002 if x > 0 else x, h - 0.06, -hd),
                (x if x > 0 else x + 0.002, h, -hd + 0.05)), of=fittings)  # fmt: skip
    # The rail on the back wall: head, hose, mixer.
    with m.of(fittings):
        x, z = m.pick(0.0, -0.2, 0.2) * w, -hd + 0.045
        if m.chance(0.5):
            m.add(tube(bent([(x, 1.0, z), (x, h - 0.12, z), (x, h - 0.12, z + 0.36),
                (x, h - 0.15, z + 0.36)], 0.05, n=4), 0.011, n=10))  # fmt: skip
            m.add(revolve([(0.0, 0.0), (0.11, 0.0), (0.11, 0.008), (0.02, 0.02), (0.0, 0.02)],
                n=24), at=(x, h - 0.17, z + 0.36))  # fmt: skip
        else:
            m.add(tube([(x, 1.05, z), (x, h - 0.2, z)], 0.01, n=10))
            m.add(tube([(x, h - 0.28, z + 0.005), (x, h - 0.2, z + 0.09)], 0.011, n=10))
            m.add(revolve([(0.0, 0.0), (0.045, 0.004), (0.045, 0.014), (0.012, 0.03), (0.0, 0.03)],
                n=18), turn=rotation_x(-0.7), at=(x, h - 0.215, z + 0.09))  # fmt: skip
            m.add(tube(bent([(x, h - 0.29, z + 0.01), (x + 0.05, 0.8, z + 0.03),
                (x + 0.09, 0.75, z + 0.02), (x + 0.08, 1.05, z)], 0.1, n=5), 0.006, n=6))  # fmt: skip
        m.add(tube([(x - 0.1, 1.05, z), (x + 0.1, 1.05, z)], 0.02, n=12))
        for e in (-0.075, 0.075):
            m.add(tube([(x + e, 1.05, -hd), (x + e, 1.05, z)], 0.014, n=8))
