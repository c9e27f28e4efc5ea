"""Toilets, basins, baths and showers of the generated catalogue; no effects."""

from __future__ import annotations

from itertools import pairwise, product
from typing import Final

from numpy import pi

from pbrs_farm.core.frames import rotation_x, rotation_y
from pbrs_farm.core.house import Material
from pbrs_farm.dress.style import mix
from pbrs_farm.dress.thing_materials import (
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
from pbrs_farm.furnishings.things.catalogued import catalogued
from pbrs_farm.furnishings.things.cloth import hanging
from pbrs_farm.furnishings.things.forms import formed
from pbrs_farm.furnishings.things.joints import Inside, Look, fronts_of, hollow
from pbrs_farm.furnishings.things.maker import Maker, Size
from pbrs_farm.geometry.outlines import bent, d_shape, oval, rect, rings

# fmt: off
_LID_RAD: Final = pi / 2  # of a toilet, close before its cistern


@catalogued()
def toilet(m: Maker, size: Size) -> None:
    """A toilet.

    Cistern on it, before the wall, in a box behind it, or high on the wall.
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
    m.loft([(oval(fw, fd, z=fz, power=power), 0.0), (oval(fw * 0.96, fd * 0.96, z=fz, power=power),
        0.02), (oval(fw * 0.92 if foot == 0 else fw, fd, z=fz, power=power), 0.12),
        (oval(bw * (0.75 if foot == 0 else 0.9), bd * 0.86, z=zc, power=power), 0.26),
        (oval(bw * 0.97, bd * 0.98, z=zc, power=power), rim - 0.06),
        (oval(bw, bd, z=zc, power=power), rim - 0.012), (oval(bw - 0.02, bd - 0.02, z=zc,
        power=power), rim), (oval(bw - 0.09, bd - 0.12, z=zc + 0.01, power=power), rim - 0.004),
        (oval(bw - 0.12, bd - 0.16, z=zc + 0.01, power=power), rim - 0.1),
        (oval(0.12, 0.16, z=zc + 0.02, power=2.0), rim - 0.2)], of=CERAMIC)
    # Between bowl and tank.
    m.box(0.18, (0.1 if foot == 0 else 0.0, rim - 0.05), (back + 0.005, zc), 0.02, of=CERAMIC)
    lid = (CERAMIC if m.chance(0.8) else m.pick(m.timber, glossy("lid", (0.1, 0.1, 0.1), 0.3),
        glossy("lid", m.any_colour(), 0.3)))
    with m.of(lid):
        m.hoop(oval(bw - 0.06, bd - 0.09, z=zc + 0.005, power=power), rim + 0.012, 0.022)
        if is_open:
            m.loft(rings(oval, [(bw - 0.01, bd - 0.06, 0.0), (bw, bd - 0.05, 0.004),
                (bw, bd - 0.05, 0.014), (bw - 0.02, bd - 0.07, 0.018)], power=power),
                turn=rotation_x(-1.65), at=(0.0, rim + bd / 2 - 0.01, back + tank + 0.065))
        else:
            with m.hinged("lid", at=(0.0, rim + 0.032, zc + 0.025 - bd / 2), axis=(-1.0, 0.0, 0.0),
                upper_rad=_LID_RAD):
                m.loft(rings(oval, [(bw - 0.01, bd - 0.04, rim + 0.0315),
                    (bw, bd - 0.03, rim + 0.0335), (bw, bd - 0.03, rim + 0.043),
                    (bw - 0.05, bd - 0.08, rim + 0.049)], z=zc + 0.01, power=power))
    button = m.pick(CHROME, CHROME, WHITE_STEEL, BLACK_STEEL)
    match form:
        case 0:  # a cistern on the bowl
            r = m.pick(0.02, 0.04, 0.07)
            m.rounded(w, (rim - 0.02, h - 0.035), tank, r, against=back, of=CERAMIC)
            m.loft(rings(rect, [(w - 0.005, tank + 0.005, r, back + tank / 2, h - 0.045), (w,
                tank + 0.008, r, back + tank / 2 + 0.001, h - 0.03), (w, tank + 0.008, r,
                back + tank / 2 + 0.001, h - 0.012), (w - 0.03, tank - 0.02, r, back + tank / 2,
                h - 0.002)], column="z"), of=CERAMIC)
            if m.chance(0.75):
                m.frustum((0.022, h - 0.003), (0.02, h), at=(0.0, 0.0, back + tank / 2), of=button)
            else:
                m.tube([(-hw + 0.06, h - 0.09, back + tank - 0.005),
                    (-hw + 0.06, h - 0.09, back + tank + 0.02), (-hw + 0.13, h - 0.1,
                    back + tank + 0.025)], 0.006, of=button)
        case 1:  # a panel of glass or stone with a plate, in front of the pipes
            m.box(w, h, tank, 0.004, against=back, of=m.pick(WHITE, m.timber,
                glossy("panel", (0.15, 0.15, 0.16), 0.3)))
            m.box(0.22, 0.14, 0.01, 0.002, on=h - 0.2, against=back + tank, of=button)
            for a, b in ((-0.1, 0.02), (0.028, 0.1)):
                m.box((a, b), 0.12, 0.004, 0.002, on=h - 0.19, against=back + tank + 0.01,
                    of=button)
        case 2:  # a round tank of the bowl's own form
            m.loft(rings(d_shape, [(w * 0.92, tank, 0.2), (w, tank, rim),
                (w, tank + 0.01, h - 0.03), (w * 0.96, tank, h - 0.005),
                (w * 0.85, tank * 0.85, h - 0.0005)], back=back, share=0.5), of=CERAMIC)
            m.frustum((0.025, h - 0.002), (0.023, h), at=(0.0, 0.0, back + tank / 2), of=button)
        case 3:  # a high cistern with a chain
            m.rod(0.0, (0.25, h - 0.2), back + 0.05, 0.022, n=10, of=CHROME)
            m.rounded(w, 0.25, 0.17, 0.03, on=h - 0.28, against=back, of=CERAMIC)
            m.box(w, (h - 0.03, h), 0.175, 0.006, against=back, of=CERAMIC)
            m.rod(hw - 0.03, (h - 0.26, h - 0.6), back + 0.176, 0.002, n=5, of=CHROME)
            m.frustum((0.012, 0.0), (0.007, 0.06), n=10, at=(hw - 0.03, h - 0.66, back + 0.176),
                of=m.timber)


def basin_tap(m: Maker, y: float, z: float, material: Material) -> None:
    """A mixer on a basin's rim at y, its spout towards +z.

    A lever, a cube, an arch, or a pillar with two handles.
    """
    form = m.weighted(0.4, 0.2, 0.25, 0.15)
    with m.of(material):
        m.frustum((0.026, y), (0.024, y + 0.008), n=18, at=(0.0, 0.0, z))
        match form:
            case 0:  # one lever
                m.rod(0.0, (y, y + 0.11), z, 0.02, n=14)
                m.tube([(0.0, y + 0.07, z), (0.0, y + 0.085, z + 0.12)], 0.012, n=10)
                m.tube([(0.0, y + 0.112, z - 0.01), (0.0, y + 0.135, z + 0.07)], 0.007)
            case 1:  # cubes
                m.box(0.044, 0.1, 0.044, 0.002, on=y, z=z)
                m.box(0.036, 0.025, 0.13, 0.002, on=y + 0.065, against=z)
                m.box(0.032, 0.01, 0.08, 0.002, on=y + 0.105, against=z - 0.02)
            case 2:  # an arch
                m.tube(bent([(0.0, y, z), (0.0, y + 0.15, z), (0.0, y + 0.15, z + 0.12),
                    (0.0, y + 0.1, z + 0.12)], 0.06, n=6), 0.01, n=10)
                m.tube([(0.0, y + 0.04, z), (0.07, y + 0.05, z)], 0.006)
            case 3:  # a pillar with two handles
                m.tube(bent([(0.0, y, z), (0.0, y + 0.1, z), (0.0, y + 0.1, z + 0.11),
                    (0.0, y + 0.07, z + 0.11)], 0.03, n=3), 0.012, n=10)
                for x in (-0.08, 0.08):
                    m.rod(x, (y, y + 0.045), z, 0.013, n=10)
                    m.rod((x - 0.03, x + 0.03), y + 0.05, z, 0.007)
                    m.rod(x, y + 0.05, (z - 0.03, z + 0.03), 0.007)


def basin_bowl(m: Maker, form: int, w: float, d: float, back: float, y: float, deep: float) -> None:
    """A basin from y - deep to y, its back at `back`; form.

    Rectangle, round front, oval, or shell.
    """
    z = back + d / 2
    match form:
        case 0:  # a rectangle
            m.loft(rings(rect, [(w * 0.8, d * 0.8, 0.05, z, y - deep), (w * 0.97, d * 0.97, 0.04, z,
                y - 0.3 * deep), (w, d, 0.02, z, y - 0.02), (w, d, 0.02, z, y - 0.004), (w - 0.01,
                d - 0.01, 0.02, z, y), (w - 0.08, d - 0.15, 0.04, z + 0.035, y - 0.002), (w - 0.12,
                d - 0.19, 0.05, z + 0.035, y - 0.7 * deep), (w * 0.4, d * 0.3, 0.05, z + 0.03,
                y - 0.82 * deep)], column="z"), of=CERAMIC)
        case 1:  # straight at the back, round in front
            m.loft(rings(d_shape, [(w * 0.6, d * 0.6, back, y - deep), (w * 0.92, d * 0.94, back,
                y - 0.4 * deep), (w, d, back, y - 0.03), (w, d, back, y - 0.005), (w - 0.012,
                d - 0.006, back, y), (w - 0.09, d - 0.15, back + 0.11, y - 0.003), (w - 0.14,
                d - 0.19, back + 0.12, y - 0.6 * deep), (w * 0.4, d * 0.3, back + 0.18,
                y - 0.8 * deep)], column="back"), of=CERAMIC)
        case 2:  # an oval
            m.loft(rings(oval, [(w * 0.55, d * 0.55, y - deep),
                (w * 0.95, d * 0.95, y - 0.35 * deep), (w, d, y - 0.012), (w - 0.008, d - 0.008, y),
                (w - 0.03, d - 0.03, y - 0.003), (w * 0.85, d * 0.85, y - 0.5 * deep),
                (w * 0.35, d * 0.35, y - 0.85 * deep)], z=z), of=CERAMIC)
    m.cylinder(0.022, y - 0.86 * deep, y - 0.78 * deep, n=14, at=(0.0, 0.0, z + 0.03), of=CHROME)


@catalogued()
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
        m.pick("knob", "bar", "edge", "disc", "square"), m.metal)
    top = y - (0.12 if on_top else 0.088)
    legs = m.weighted(0.4, 0.3, 0.3)
    low = m.pick(0.25, 0.3) if legs == 0 else 0.14 if legs == 1 else 0.0
    hollow(m, (-hw + 0.02, hw - 0.02), (low, top), (back, hd - 0.05), 0.016, look.front)
    # A strip at the wall holds a floating bowl.
    match legs:
        case 0:
            m.box(0.24, low, 0.03, against=back, of=look.body)
        case 1:
            with m.moved(at=(0.0, 0.0, -0.02)):
                m.legs(m.pick("square", "tapered", "round"), w - 0.04, d - 0.06, low + 0.001, 0.035,
                    0.03, of=m.pick(m.timber, BLACK_STEEL))
        case 2:
            m.box(w - 0.06, (-0.0001, 0.08), (back, hd - 0.09), of=look.body)
    n = 2 if w > 0.62 else 1
    fronts_of(m, look, (-hw + 0.02, hw - 0.02), (low + (0.08 if legs == 2 else 0.0), top - 0.002),
        hd - 0.05, m.pick([("door",)] * n, [("drawer", "drawer")],
        [("drawer",), ("drawer", "drawer")] if n > 1 else [("low", "drawer")]), False,
        Inside(back + 0.008, top=top - (0.02 if on_top else 0.05)))
    if on_top:
        m.box(w, 0.03, (back, hd), 0.003, on=top, of=m.pick(m.timber,
            glossy("stone", (0.85, 0.84, 0.81), 0.3), glossy("stone", (0.2, 0.2, 0.21), 0.3)))
        basin_bowl(m, m.pick(2, 2, 0), min(0.42, w - 0.08), min(0.36, d - 0.08),
            back + d - min(0.36, d - 0.08) - 0.02, top + 0.15, 0.119)
        basin_tap(m, top + 0.03, back + 0.05, tap)
    else:
        basin_bowl(m, m.pick(0, 0, 1), w, d, back, y, 0.09)
        basin_tap(m, y - 0.003, back + 0.06, tap)
    # All are as high as they say.
    m.rod(0.0, (y - 0.1, h), back + 0.05, 0.004, n=6, of=tap)


@catalogued()
def pedestal_basin(m: Maker, size: Size) -> None:
    """A basin on a column."""
    w, d, h = size
    back, y = -d / 2, 0.84
    tap, s = m.pick(CHROME, CHROME, BRASS, STEEL), m.uniform(0.9, 1.2)
    basin_bowl(m, m.pick(0, 1, 1), w, d, back, y, m.pick(0.16, 0.18, 0.2))
    column = m.weighted(0.4, 0.3, 0.3)
    with m.of(CERAMIC), m.moved(at=(0.0, 0.0, back + 0.12)):
        formed(m, "pedestal_basin", column, s=s, y=y)
    basin_tap(m, y - 0.003, back + 0.06, tap)
    m.rod(0.0, (y - 0.1, h), back + 0.05, 0.004, n=6, of=tap)


@catalogued()
def wall_basin(m: Maker, size: Size) -> None:
    """A basin that hangs: its waste pipe shows, or is behind a shield."""
    w, d, h = size
    y, tap = h - 0.15, m.pick(CHROME, CHROME, STEEL, BLACK_STEEL, BRASS)
    basin_bowl(m, m.pick(0, 1, 1), w, d, 0.0, y, m.pick(0.12, 0.14, 0.16))
    basin_tap(m, y - 0.003, 0.06, tap)
    if m.chance(0.6):
        m.tube(bent([(0.0, y - 0.1, d * 0.5), (0.0, 0.06, d * 0.5), (0.0, 0.06, 0.0)], 0.05, n=4),
            0.016, n=10, of=CHROME)
        m.cylinder(0.03, 0.0, 0.13, at=(0.0, 0.0, d * 0.5), of=CHROME)
    else:
        m.loft(rings(d_shape, [(0.14, 0.14, 0.0), (0.2, 0.2, 0.06), (0.24, 0.26, y - 0.1)],
            back=0.0), of=CERAMIC)
    m.rod(0.0, (y - 0.1, h), 0.05, 0.004, n=6, of=tap)


@catalogued()
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
            m.box(w - 0.024, 0.12, (-hd + 0.012, hd - 0.05), of=apron)
            m.box(0.016, h - 0.04, (-hd + 0.012, hd - 0.05), 0.003, left=0.012 - w / 2,
                mirrored="x", of=apron)
            if m.chance(0.5):
                m.box(w - 0.02, h - 0.04, 0.038, 0.003, against=hd - 0.05, of=apron)
            else:
                seams = [-hw + 0.01 + k * (w - 0.02) / 10 for k in range(m.pick(3, 4, 10) + 1)]
                for board in pairwise(seams):
                    m.box(board, h - 0.04, 0.038, 0.003, against=hd - 0.05, of=apron)
                m.box(w - 0.02, h - 0.04, 0.03, against=hd - 0.052, of=apron)
            with m.of(colour):
                bath_hollow(m, w, d, h, p)
        case 1:  # free: a shell that swells
            m.loft(rings(oval, [(w * 0.72, d * 0.6, p, 0.0), (w * 0.84, d * 0.8, p, 0.12),
                (w * 0.96, d * 0.96, p, h - 0.08), (w, d, p, h - 0.012), (w - 0.012, d - 0.012, p,
                h), (w - 0.06, d - 0.06, p, h - 0.006), (w * 0.84, d * 0.8, p, 0.26), (w * 0.6,
                d * 0.5, 3.0, 0.15)], column="power", n=36), of=colour)
        case 2:  # on feet
            m.loft(rings(oval, [(w * 0.6, d * 0.5, 0.12), (w * 0.84, d * 0.8, 0.2),
                (w * 0.95, d * 0.94, h - 0.1), (w * 0.96, d * 0.95, h - 0.03), (w, d, h - 0.015),
                (w * 0.985, d * 0.97, h), (w * 0.93, d * 0.87, h - 0.01), (w * 0.84, d * 0.78, 0.3),
                (w * 0.55, d * 0.45, 0.2)], n=36, power=2.6), of=colour)
            claw = m.pick(CHROME, BRASS, BLACK_STEEL, colour)
            for x, z in product((-1.0, 1.0), (-1.0, 1.0)):
                m.turned([(0.035, 0.0), (0.04, 0.02), (0.024, 0.05), (0.035, 0.1), (0.045, 0.18)],
                    n=14, at=(x * 0.3 * w, 0.0, z * 0.26 * d), of=claw)
    # Its taps: on the rim at one end, or along the back.
    if has_tap:
        with (m.of(tap), m.moved(at=(side * (hw - (0.06 if form == 0 else 0.025)), h - 0.012, 0.0),
            turn=rotation_y(-side * pi / 2))):
            m.tube(bent([(0.0, 0.0, 0.0), (0.0, 0.09, 0.0), (0.0, 0.09, 0.12), (0.0, 0.06, 0.12)],
                0.03, n=3), 0.014, n=10)
            for x in (-0.09, 0.09):
                m.rod(x, (0.0, 0.06), 0.0, 0.02, n=10)
    if form == 0:
        m.frustum((0.032, -0.003), (0.03, 0.0), at=(side * 0.22 * w, h - 0.402, 0.0), of=CHROME)


def bath_hollow(m: Maker, w: float, d: float, h: float, p: float) -> None:
    """The rim and hollow of a bath of w by d: rectangles outside, an oval of that power inside."""
    m.loft(rings(oval, [(w - 0.1, d - 0.1, 6.0, 0.1), (w - 0.03, d - 0.03, 14.0, h - 0.05), (w, d,
        40.0, h - 0.04), (w, d, 40.0, h - 0.004), (w - 0.006, d - 0.006, 40.0, h), (w - 0.15,
        d - 0.14, p, h - 0.002), (w - 0.24, d - 0.2, p, h - 0.25), (w - 0.5, d - 0.34, 3.0,
        h - 0.405)], column="power", n=36))


@catalogued()
def shower(m: Maker, size: Size) -> None:
    """A shower in a corner.

    A tray, panes with or without frames, a door or a curtain, a rail with its head.
    """
    w, d, h = size
    hw, hd = w / 2, d / 2
    fittings = m.pick(CHROME, CHROME, BLACK_STEEL, WHITE_STEEL, STEEL)
    pane = m.pick(CLEAR, CLEAR, FROSTED)
    tray = m.pick(0.04, 0.06, 0.14)
    m.loft(rings(rect, [(w, d, 0.02, 0.0), (w, d, 0.02, tray - 0.004),
        (w - 0.008, d - 0.008, 0.018, tray), (w - 0.1, d - 0.1, 0.03, tray - 0.002),
        (w - 0.14, d - 0.14, 0.03, tray - 0.022)]), of=m.pick(CERAMIC, CERAMIC,
        glossy("tray", (0.2, 0.2, 0.21), 0.5)))
    m.cylinder(0.045, tray - 0.022, tray - 0.018, n=18, of=CHROME)
    form = m.weighted(0.35, 0.3, 0.35)
    top = h - 0.002
    if form < 2:
        # Panes on the left and right, a door in the front.
        for x in (-hw + 0.012, hw - 0.012):
            m.box(0.008, (tray, top), (-hd + 0.01, hd - 0.02), x=x, of=pane)
            m.box(0.024, (tray, top), 0.022, 0.002, x=x, against=0.002 - d / 2, mirrored="z",
                of=fittings)
            if form == 0:
                m.box(0.024, (top - 0.022, h), d - 0.04, 0.002, x=x, of=fittings)
        cut = m.pick(0.0, 0.0, 0.15) * w
        for a, b, z in ((-hw + 0.02, cut + 0.01, hd - 0.008), (cut - 0.01, hw - 0.02, hd - 0.02)):
            m.box((a, b), (tray + 0.01, top), 0.007, against=z - 0.004, of=pane)
            if form == 0:
                for x in (a, b - 0.018):
                    m.box(0.018, (tray + 0.005, top), 0.014, 0.002, left=x, against=z - 0.008,
                        of=fittings)
        m.box(w, (h - 0.03, h), (hd - 0.03, hd), 0.002, of=fittings)
        if form == 0:
            m.box(w, 0.022, (hd - 0.03, hd), 0.002, on=tray - 0.002, of=fittings)
        m.tube(bent([(cut - 0.05, 0.9, hd - 0.004), (cut - 0.05, 0.9, hd + 0.016),
            (cut - 0.05, 1.25, hd + 0.016), (cut - 0.05, 1.25, hd - 0.004)], 0.01, n=2), 0.007,
            of=fittings)
    else:
        # A curtain that hangs from a rail round two sides.
        m.tube(bent([(-hw + 0.012, h - 0.03, -hd), (-hw + 0.012, h - 0.03, hd - 0.012),
            (hw - 0.012, h - 0.03, hd - 0.012), (hw - 0.012, h - 0.03, -hd)], 0.08, n=4), 0.011,
            of=fittings)
        weave = plain("curtain fabric", mix(m.any_colour(), (0.93, 0.93, 0.92),
            m.pick(0.3, 0.8, 0.95)), 0.7)
        wide = m.uniform(0.35, 0.7) * w
        m.add(hanging(wide, h - tray - 0.07, 0.05, 0.003, m.pick(5.0, 6.0, 7.0)),
            at=(-hw + 0.07 + wide / 2, tray + 0.03, hd - 0.03), of=weave)
        if m.chance(0.7):
            m.add(hanging(0.55 * d, h - tray - 0.07, 0.045, 0.003, 6.0), turn=rotation_y(pi / 2),
                at=(hw - 0.03, tray + 0.03, 0.1 * d), of=weave)
        for x in (-hw, hw):
            m.box((x - 0.002 if x > 0 else x, x if x > 0 else x + 0.002), (h - 0.06, h), 0.05,
                against=-hd, of=fittings)
    # The rail on the back wall: head, hose, mixer.
    with m.of(fittings):
        x, z = m.pick(0.0, -0.2, 0.2) * w, -hd + 0.045
        if m.chance(0.5):
            m.tube(bent([(x, 1.0, z), (x, h - 0.12, z), (x, h - 0.12, z + 0.36),
                (x, h - 0.15, z + 0.36)], 0.05, n=4), 0.011, n=10)
            m.turned([(0.11, 0.0), (0.11, 0.008), (0.02, 0.02)], n=24, at=(x, h - 0.17, z + 0.36))
        else:
            m.rod(x, (1.05, h - 0.2), z, 0.01, n=10)
            m.tube([(x, h - 0.28, z + 0.005), (x, h - 0.2, z + 0.09)], 0.011, n=10)
            m.revolve([(0.0, 0.0), (0.045, 0.004), (0.045, 0.014), (0.012, 0.03), (0.0, 0.03)],
                n=18, turn=rotation_x(-0.7), at=(x, h - 0.215, z + 0.09))
            m.tube(bent([(x, h - 0.29, z + 0.01), (x + 0.05, 0.8, z + 0.03),
                (x + 0.09, 0.75, z + 0.02), (x + 0.08, 1.05, z)], 0.1, n=5), 0.006, n=6)
        m.rod((x - 0.1, x + 0.1), 1.05, z, 0.02, n=12)
        for e in (-0.075, 0.075):
            m.rod(x + e, 1.05, (-hd, z), 0.014)
