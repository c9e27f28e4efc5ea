"""Lamps of the generated catalogue: on floors and tables, from ceilings, on walls; no effects."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated

from numpy import cos, pi, sin

from pbrs_farm.core.frames import rotation_x, rotation_z
from pbrs_farm.core.house import Material
from pbrs_farm.dress.thing_materials import (
    BLACK_STEEL,
    BRASS,
    OPAL,
    RUBBER,
    WHITE_STEEL,
    WICKER,
    glass,
    glossy,
    plain,
)
from pbrs_farm.furnishings.things.catalogued import catalogued
from pbrs_farm.furnishings.things.forms import formed
from pbrs_farm.furnishings.things.maker import Maker, Size
from pbrs_farm.furnishings.things.parameters import Choice, Range
from pbrs_farm.geometry.outlines import bent, d_shape, oval, polar, rings


# fmt: off
def lamp_shade(m: Maker, r0: float, r1: float, y0: float, y1: float, material: Material) -> None:
    """A shade of cloth or card r0 wide below, r1 above, from y0 to y1, its bulb in it."""
    m.revolve([(r0, y0), (r1, y1), (r1 - 0.003, y1), (r0 - 0.003, y0), (r0, y0)], n=28, of=material)
    m.sphere((0.0, (y0 + y1) / 2, 0.0), min(0.035, 0.5 * r1), n=12, of=OPAL)


def shade_spokes(m: Maker, r: float, k1: float, tall: float, h: float, material: Material) -> None:
    """Three wires that carry a shade r wide below, k1 r above, `tall`, its top at h."""
    for k in range(3):
        m.tube([(0.0, h - 0.5 * tall - 0.05, 0.0), polar((r + k1 * r) / 2.1, h - 0.5 * tall,
            2.1 * k)], 0.003, n=5, of=material)


@dataclass(frozen=True, slots=True)
class FloorLamp:
    """Parameters of a lamp on the floor."""

    form: Annotated[str, Choice("pole", "tripod", "column", "ball")]
    body: Material
    shade: Material
    shade_m: Annotated[float, Range(0.1, 0.6)]  # height of the shade
    taper: Annotated[float, Range(0.2, 1.2)]  # upper radius of the shade per lower radius
    column_m: Annotated[float, Range(0.05, 0.18)]  # radius of a column that shines
    corner_m: Annotated[float, Range(0.005, 0.3)]  # radius of the corners of its base


def shade_fabric(m: Maker) -> Material:
    """Draw the cloth of a shade."""
    colours = (0.9, 0.87, 0.8), (0.9, 0.88, 0.85), m.textile(), m.style.accent
    return plain("shade fabric", m.pick(*colours), 0.9)


def draw_floor_lamp(m: Maker, size: Size) -> FloorLamp:
    """Draw a floor lamp's parameters."""
    material = m.pick(m.metal, BLACK_STEEL, BRASS, m.timber, WHITE_STEEL, m.dark_timber)
    fabric = shade_fabric(m)
    form = m.pick("pole", "pole", "pole", "tripod", "tripod", "tripod", "column", "ball")
    p = FloorLamp(form, material, fabric, m.uniform(0.2, 0.32), m.uniform(0.6, 1.0), 0.13, 0.12)
    if form == "column":
        p = replace(p, column_m=m.pick(0.11, 0.13, 0.15), corner_m=m.pick(0.02, 0.12, size[0] / 2))
    return p


@catalogued(draw=draw_floor_lamp)
def standing_lamp(m: Maker, size: Size, p: FloorLamp) -> None:
    """A lamp on the floor: a shade on a pole or a tripod, a column, or a ball."""
    w, d, h = size
    r, tall = w / 2, p.shade_m
    with m.of(p.body):
        match p.form:
            case "pole":
                top = h - 0.5 * tall - 0.05
                m.turned([(r * 0.72, 0.0), (r * 0.72, 0.014), (0.02, 0.03), (0.011, 0.05),
                    (0.011, top)], n=28)
            case "tripod":
                top, neck = h - 0.5 * tall - 0.04, h - tall
                for k in range(3):
                    a = 2.0944 * k
                    m.tube([polar(0.96 * r, 0.006, a), polar(0.02, neck - 0.06, a)], 0.012,
                        end=0.016)
                m.turned([(0.035, neck - 0.1), (0.035, neck - 0.05), (0.01, neck - 0.03),
                    (0.01, top)])
            case "column":
                q = p.column_m
                m.board(w, d, 0.0, 0.03, p.corner_m, 0.004)
                m.rod(0.0, (0.031, h - 0.02), 0.0, q, n=24, of=OPAL)
                for y in (0.03, 0.36 * h, 0.68 * h, h - 0.022):
                    m.ring((q - 0.002, q + 0.012), (y, y + 0.022), n=24)
            case "ball":
                m.turned([(r, 0.0), (r, 0.012), (0.014, 0.024), (0.01, h - 0.24)], n=28)
                m.sphere((0.0, h - 0.13, 0.0), 0.13, n=20, of=OPAL)
    if p.form in ("pole", "tripod"):
        lamp_shade(m, r, r * p.taper, h - tall, h, p.shade)
        shade_spokes(m, r, p.taper, tall, h, p.body)


@catalogued()
def arc_lamp(m: Maker, size: Size) -> None:
    """A floor lamp that leans over: an arc, or two arms to read by."""
    w, d, h = size
    r, q = w / 2, d / 2
    material, form = m.pick(m.metal, BLACK_STEEL, BRASS, WHITE_STEEL), 2 + m.weighted(0.5, 0.5)
    match form:
        case 2:  # an arc
            m.revolve([(0.0, 0.0), (q, 0.0), (q, 0.03), (0.0, 0.035)], n=26, at=(-r + q, 0.0, 0.0),
                of=m.pick(material, glossy("stone", (0.86, 0.85, 0.82), 0.25)))
            m.tube(bent([(-r + 0.1, 0.02, 0.0), (-r + 0.03, h * 0.7, 0.0), (0.0, h - 0.006, 0.0),
                (r - 0.1, h - 0.08, 0.0), (r - 0.1, h - 0.2, 0.0)], 0.35, n=6), 0.008, of=material)
            with m.moved(at=(r - 0.1, h - 0.34, 0.0)):
                m.revolve([(0.1, 0.0), (0.085, 0.07), (0.04, 0.13), (0.01, 0.15), (0.0, 0.15),
                    (0.0, 0.145), (0.037, 0.126), (0.082, 0.067), (0.097, 0.0), (0.1, 0.0)], n=24,
                    of=material)
                m.sphere((0.0, 0.05, 0.0), 0.03, n=12, of=OPAL)
        case 3:  # a reading lamp: two arms and a small head
            m.turned([(q, 0.0), (q - 0.005, 0.015), (0.012, 0.022), (0.01, 0.62 * h)], n=26,
                at=(-r + q, 0.0, 0.0), of=material)
            with m.of(material):
                m.tube([(-r + q, 0.61 * h, 0.0), (-0.2 * r, h - 0.02, 0.0)], 0.009)
                m.tube([(-0.22 * r, h - 0.014, 0.0), (r - 0.06, h - 0.16, 0.0)], 0.009)
                for x, y in ((-r + q, 0.61 * h), (-0.21 * r, h - 0.018)):
                    m.sphere((x, y, 0.0), 0.018, n=10)
                m.revolve([(0.075, 0.0), (0.04, 0.1), (0.02, 0.13), (0.0, 0.13), (0.0, 0.125),
                    (0.036, 0.095), (0.072, 0.0), (0.075, 0.0)], n=22, turn=rotation_z(0.35),
                    at=(r - 0.1, h - 0.28, 0.0))
            m.sphere((r - 0.085, h - 0.235, 0.0), 0.025, n=10, of=OPAL)


_FEET = ("turned", "ball", "rod", "block", "balls", "tripod", "fluted", "baluster")


@dataclass(frozen=True, slots=True)
class TableLamp:
    """Parameters of a lamp on a table."""

    form: Annotated[str, Choice("shade", "ball", "mushroom")]
    foot: Annotated[str, Choice(*_FEET)]  # below a shade
    body: Material
    shade: Material
    shade_m: Annotated[float, Range(0.08, 0.4)]  # height of the shade
    taper: Annotated[float, Range(0.2, 1.2)]  # upper radius of the shade per lower radius
    foot_m: Annotated[float, Range(0.02, 0.2)]  # radius of the foot


def draw_table_lamp(m: Maker, size: Size) -> TableLamp:
    """Draw a table lamp's parameters."""
    w, _d, h = size
    material = m.pick(m.china(), m.china(), m.metal, BRASS, BLACK_STEEL, m.timber,
        glass((0.8, 0.9, 0.88), 0.25), m.coloured("clay", 0.7))
    fabric = shade_fabric(m)
    form = ("shade", "ball", "mushroom")[m.weighted(0.64, 0.18, 0.18)]
    tall, taper = h * m.uniform(0.38, 0.5), m.uniform(0.55, 1.0)
    p = TableLamp(form, "turned", material, fabric, tall, taper, 0.26 * w)
    if form == "shade":
        p = replace(p, foot=m.pick(*_FEET), foot_m=w / 2 * m.uniform(0.45, 0.62))
    return p


@catalogued(draw=draw_table_lamp)
def shade_lamp(m: Maker, size: Size, p: TableLamp) -> None:
    """A lamp on a table: a shade on a foot of clay, glass, wood or metal, a ball, or a mushroom."""
    w, _d, h = size
    r, tall = w / 2, p.shade_m
    match p.form:
        case "shade":
            middle = h - 0.5 * tall
            with m.of(p.body):
                lamp_foot(m, p.foot, p.foot_m, h - tall)
            m.rod(0.0, (0.3 * (h - tall), middle), 0.0, 0.007, of=m.metal)
            lamp_shade(m, r, r * p.taper, h - tall, h, p.shade)
            for k in range(3):
                rim = polar((r + p.taper * r) / 2.1, middle, 2.1 * k)
                m.tube([(0.0, middle - 0.02, 0.0), rim], 0.002, n=5, of=m.metal)
        case "ball":
            q = min(r, 0.3 * h)
            m.turned([(r, 0.0), (r, 0.012), (r * 0.3, 0.025), (r * 0.25, h - 1.9 * q)], n=24,
                of=p.body)
            m.sphere((0.0, h - q, 0.0), q, n=20, of=OPAL)
        case "mushroom":
            with m.of(p.body):
                m.turned([(r * 0.6, 0.0), (r * 0.55, 0.02), (r * 0.25, 0.1 * h), (r * 0.2, 0.6 * h),
                    (r * 0.3, 0.66 * h)], n=22)
                m.revolve([(r * 0.93, 0.62 * h), (r, 0.63 * h), (r * 0.9, 0.8 * h),
                    (r * 0.6, 0.94 * h), (0.0, h), (0.0, h - 0.004), (r * 0.57, 0.93 * h),
                    (r * 0.87, 0.79 * h), (r * 0.93, 0.62 * h)], n=28)
            m.sphere((0.0, 0.72 * h, 0.0), 0.035, n=12, of=OPAL)


def lamp_foot(m: Maker, kind: str, q: float, f: float) -> None:
    """The foot of a table lamp, of radius q and height f."""
    formed(m, "lamp_foot", kind, f=f, q=q)
    match kind:
        case "ball":
            m.sphere((0.0, q, 0.0), q, n=18)
        case "balls":
            for k in range(3):
                m.sphere((0.0, q * (0.75 + 1.15 * k * 0.8), 0.0), q * (0.75 - 0.12 * k), n=14)
        case "tripod":
            for k in range(3):
                m.tube([polar(q, 0.004, 2.0944 * k), polar(0.01, f, 2.0944 * k)], 0.008, n=7)


@catalogued()
def arm_lamp(m: Maker, size: Size) -> None:
    """A lamp on a desk.

    An arm of two parts, a bend, a goose neck; its head a cone, a dome or a tube.
    """
    w, _d, h = size
    r = w / 2
    material = m.pick(m.metal, BRASS, BLACK_STEEL, WHITE_STEEL,
        glossy("enamel", m.any_colour(), 0.35))
    with m.of(material):
        if m.chance(0.7):
            m.turned([(0.075, 0.0), (0.07, 0.02), (0.01, 0.026)], n=22, at=(-r + 0.075, 0.0, 0.0))
        else:
            m.board(0.15, 0.15, 0.0, 0.018, 0.01, 0.003, x=-r + 0.075)
        if m.chance(0.6):
            m.tube([(-r + 0.075, 0.02, 0.0), (-r + 0.03, 0.55 * h, 0.0)], 0.006)
            m.tube([(-r + 0.03, 0.55 * h, 0.0), (0.1 * r, h - 0.012, 0.0)], 0.006)
            for x, y in ((-r + 0.03, 0.55 * h), (0.1 * r, h - 0.012)):
                m.sphere((x, y, 0.0), 0.012, n=8)
            m.tube([(0.1 * r, h - 0.012, 0.0), (r - 0.055, h - 0.07, 0.0)], 0.006)
        else:
            m.tube(bent([(-r + 0.075, 0.015, 0.0), (-r + 0.05, h - 0.007, 0.0),
                (r - 0.05, h - 0.007, 0.0), (r - 0.045, h - 0.08, 0.0)], 0.14, n=6), 0.007)
        with m.moved(at=(r - 0.056, h - 0.15, 0.0)):
            if m.chance(0.6):
                m.revolve([(0.055, 0.0), (0.05, 0.05), (0.02, 0.09), (0.0, 0.09), (0.0, 0.087),
                    (0.018, 0.086), (0.047, 0.048), (0.052, 0.0), (0.055, 0.0)], n=20)
            else:
                m.revolve([(0.035, 0.0), (0.035, 0.08), (0.0, 0.09), (0.0, 0.086), (0.032, 0.078),
                    (0.032, 0.0), (0.035, 0.0)], n=18)
            m.sphere((0.0, 0.032, 0.0), 0.02, n=10, of=OPAL)


@catalogued()
def hanging_lamp(m: Maker, size: Size) -> None:
    """A lamp under the ceiling: flat, or hung from a canopy if it is over 0.2 m high."""
    material = m.pick(m.metal, BLACK_STEEL, BRASS, WHITE_STEEL,
        glossy("enamel", m.style.accent, 0.3), m.timber)
    fabric = shade_fabric(m)
    if size[2] < 0.2:
        flat_lamp(m, size, material, fabric)
    else:
        hung_lamp(m, size, material, fabric)


def flat_lamp(m: Maker, size: Size, material: Material, fabric: Material) -> None:
    """A lamp close to the ceiling: a bowl, a drum, a plate, spots on a bar, or glass in a rim."""
    w, d, h = size
    r = w / 2
    form = m.weighted(0.3, 0.25, 0.15, 0.15, 0.15)
    match form:
        case 0:  # a bowl at the ceiling
            m.cylinder(r, h - 0.025, h, n=32, of=material)
            m.revolve([(0.0, 0.0), (r * 0.5, 0.1 * h), (r * 0.85, 0.4 * h), (r * 0.95, h - 0.026),
                (0.0, h - 0.026)], n=32, of=OPAL)
        case 1:  # a drum of cloth
            m.revolve([(r - 0.004, 0.0), (r, 0.0), (r, h), (0.0, h), (0.0, h - 0.004),
                (r - 0.004, h - 0.004), (r - 0.004, 0.0)], n=32, of=fabric)
            m.cylinder(r - 0.005, 0.015, 0.02, n=32, of=OPAL)
        case 2:  # a square plate
            m.board(w, d, h - 0.03, h, 0.01, 0.002, of=material)
            m.board(w - 0.04, d - 0.04, 0.0, h - 0.031, 0.02, 0.006, of=OPAL)
        case 3:  # a bar with three spots
            m.box(2 * r, (h - 0.03, h), 0.06, 0.002, of=material)
            for x in (-0.7, 0.0, 0.7):
                with m.moved(at=(x * r, 0.0, 0.0), turn=rotation_x(x * 0.5)):
                    m.turned([(0.012, h - 0.03), (0.03, h - 0.045), (0.032, 0.012)], of=material)
                    m.cylinder(0.026, 0.002, 0.0115, of=OPAL)
            m.cylinder(d / 2, h - 0.02, h - 0.001, n=24, of=material)
        case 4:  # a drum of glass in a rim
            m.cylinder(0.06, h - 0.02, h, n=20, of=material)
            m.cylinder(r * 0.9, 0.02, h - 0.021, n=32, of=OPAL)
            m.ring((r * 0.9, r), (0.0, h - 0.01), n=32, of=material)


def hung_lamp(m: Maker, size: Size, material: Material, fabric: Material) -> None:
    """A lamp that hangs from a canopy.

    Cones, drums, domes, balls, baskets, rings, clusters, arms, bars and leaves.
    """
    w, d, h = size
    r = w / 2
    form = m.integers(0, 10)
    m.frustum((0.045, h - 0.03), (0.05, h), n=22, of=material)
    low = 0.36 * h
    if form not in (5, 6, 8):
        m.rod(0.0, (low, h - 0.025), 0.0, 0.0035, n=6, of=RUBBER)
    match form:
        case 0:  # a cone of metal
            m.revolve([(r, 0.0), (r * 0.55, 0.2 * h), (0.03, low), (0.0, low), (0.0, low - 0.004),
                (0.027, low - 0.004), (r * 0.55 - 0.004, 0.2 * h - 0.002), (r - 0.003, 0.0),
                (r, 0.0)], n=32, of=material)
            m.sphere((0.0, 0.14 * h, 0.0), 0.036, n=14, of=OPAL)
        case 1:  # a drum of cloth
            m.revolve([(r, 0.0), (r * 0.98, low), (r * 0.98 - 0.003, low), (r - 0.003, 0.0),
                (r, 0.0)], n=32, of=fabric)
            m.sphere((0.0, 0.18 * h, 0.0), 0.045, n=14, of=OPAL)
            for k in range(3):
                m.tube([(0.0, low - 0.004, 0.0), polar(r * 0.975, low - 0.004, 2.1 * k)], 0.0025,
                    n=5, of=material)
        case 2:  # a dome
            m.revolve([(r, 0.0), (r * 0.95, 0.12 * h), (r * 0.7, 0.26 * h), (0.03, low), (0.0, low),
                (0.0, low - 0.004), (0.028, low - 0.005), (r * 0.7 - 0.003, 0.26 * h - 0.004),
                (r * 0.95 - 0.004, 0.12 * h), (r - 0.004, 0.0), (r, 0.0)], n=36, of=material)
            m.sphere((0.0, 0.16 * h, 0.0), 0.045, n=14, of=OPAL)
        case 3:  # a ball of opal, pressed
            m.ellipsoid((r, 0.5 * low, r), n=22, at=(0.0, 0.5 * low, 0.0), of=OPAL)
            m.frustum((0.04, low - 0.006), (0.03, low + 0.02), of=material)
        case 4:
            basket_lamp(m, w, d, r, low, material)
        case 5:  # a ring on three wires
            m.hoop(oval(w - 0.03, d - 0.03, n=40), 0.015, 0.015, n=8, of=material)
            m.hoop(oval(w - 0.07, d - 0.07, n=40), 0.012, 0.0115, of=OPAL)
            for k in range(3):
                m.tube([polar(r - 0.015, 0.02, 2.0944 * k), polar(0.02, h - 0.025, 2.0944 * k)],
                    0.0015, n=5, of=material)
        case 6:
            ball_cluster(m, h, d, r, material)
        case 7:
            arm_chandelier(m, r, low, material)
        case 8:  # a bar with three shades
            m.box(2 * r, (low - 0.02, low), 0.024, 0.002, of=material)
            for x in (-0.5, 0.5):
                m.tube([(x * r, low - 0.002, 0.0), (0.0, h - 0.026, 0.0)], 0.002, n=5, of=material)
            for x in (-0.72, 0.0, 0.72):
                with m.moved(at=(x * r, 0.0, 0.0)):
                    m.rod(0.0, (0.5 * low, low - 0.018), 0.0, 0.003, n=5, of=RUBBER)
                    m.revolve([(0.075, 0.0), (0.06, 0.3 * low), (0.015, 0.55 * low), (0.0,
                        0.55 * low), (0.0, 0.53 * low), (0.013, 0.53 * low), (0.057, 0.3 * low),
                        (0.072, 0.0), (0.075, 0.0)], n=20, of=material)
                    m.sphere((0.0, 0.2 * low, 0.0), 0.03, n=10, of=OPAL)
            m.cylinder(d / 2, h - 0.012, h - 0.001, n=24, of=material)
        case 9:  # leaves of a flower: three plates over each other
            for k in range(3):
                q, y = r * (1.0 - 0.24 * k), 0.1 * low + 0.3 * low * k
                m.revolve([(q, y), (q * 0.6, y + 0.22 * low), (0.02, y + 0.3 * low),
                    (0.02, y + 0.29 * low), (q * 0.6 - 0.002, y + 0.21 * low),
                    (q - 0.003, y - 0.002), (q, y)], n=30, of=material)
            m.sphere((0.0, 0.22 * low, 0.0), 0.04, n=12, of=OPAL)
            m.revolve([(0.0, 0.0), (0.05, 0.005), (0.05, 0.03), (0.0, 0.03)], n=18, of=material)


def basket_lamp(m: Maker, w: float, d: float, r: float, low: float, material: Material) -> None:
    """A basket of hoops round a bulb."""
    for k in range(7):
        m.hoop(oval(w * sin(0.35 + 2.4 * k / 6) - 0.014, d * sin(0.35 + 2.4 * k / 6) - 0.014, n=24),
            0.007 + (low - 0.014) * k / 6, 0.006, n=5, of=m.pick(WICKER, WICKER, material))
    for k in range(10):
        m.tube(bent([polar(0.04, low - 0.004, 0.628 * k), polar(r - 0.01, 0.5 * low, 0.628 * k),
            polar(0.3 * r, 0.006, 0.628 * k)], 0.3, n=5), 0.003, n=4, of=WICKER)
    m.sphere((0.0, 0.55 * low, 0.0), 0.045, n=14, of=OPAL)


def ball_cluster(m: Maker, h: float, d: float, r: float, material: Material) -> None:
    """A cluster of small balls at different heights."""
    n = m.integers(4, 7)  # three would fill five sixths of the width alone
    for k in range(n):
        a, y = 2 * pi * k / n, 0.0 if k == 0 else h * m.uniform(0.0, 0.35)
        x, z, q = (r - 0.06) * cos(a), (d / 2 - 0.06) * sin(a), 0.06
        m.tube([(x, y + 2 * q - 0.004, z), (x, h - 0.1, z), polar(0.02, h - 0.026, a)], 0.003, n=5,
            of=RUBBER)
        m.sphere((x, y + q, z), q, n=14, of=OPAL)
        m.frustum((0.018, 0.0), (0.014, 0.03), n=12, at=(x, y + 2 * q - 0.008, z), of=material)


def arm_chandelier(m: Maker, r: float, low: float, material: Material) -> None:
    """Arms that bend upwards, a bulb on each."""
    n = m.integers(3, 7)
    m.sphere((0.0, 0.4 * low, 0.0), 0.03, n=12, of=material)
    m.rod(0.0, (0.4 * low, low + 0.02), 0.0, 0.008, of=material)
    for k in range(n):
        a = 2 * pi * k / n
        m.tube(bent([(0.0, 0.4 * low, 0.0), polar(0.5 * r, 0.02, a), polar(r - 0.03, 0.1 * low, a),
            polar(r - 0.03, 0.45 * low, a)], 0.08, n=4), 0.006, n=7, of=material)
        m.frustum((0.022, 0.45 * low), (0.026, 0.5 * low), n=12, at=polar(r - 0.03, 0.0, a),
            of=material)
        m.revolve([(0.0, 0.505 * low), (0.014, 0.505 * low), (0.02, 0.65 * low), (0.0, 0.85 * low)],
            n=12, at=polar(r - 0.03, 0.0, a), of=OPAL)
    m.revolve([(0.0, 0.0), (0.012, 0.006), (0.0, 0.3 * low)], n=10, of=material)


@catalogued()
def sconce(m: Maker, size: Size) -> None:
    """A lamp on a wall.

    A shade on an arm, a ball, a box that shines up and down, a half bowl, a disc.
    """
    w, d, h = size
    hw = w / 2
    material, form = (m.pick(m.metal, BLACK_STEEL, BRASS, WHITE_STEEL, m.timber),
        m.weighted(0.3, 0.2, 0.2, 0.15, 0.15))
    fabric = plain("shade fabric", m.pick((0.9, 0.87, 0.8), (0.9, 0.88, 0.85), m.textile()), 0.9)
    match form:
        case 0:  # a shade on an arm
            r = min(w, d) / 2 - 0.002
            m.box(0.07, 0.1, (0.0, 0.015), 0.002, of=material)
            m.tube(bent([(0.0, 0.05, 0.01), (0.0, 0.03, d - r), (0.0, 0.4 * h, d - r)], 0.03, n=3),
                0.006, of=material)
            m.revolve([(r, 0.35 * h), (r * 0.75, h), (r * 0.75 - 0.003, h), (r - 0.003, 0.35 * h),
                (r, 0.35 * h)], n=24, at=(0.0, 0.0, d - r), of=fabric)
            for k in range(3):
                m.tube([(0.0, 0.4 * h, d - r), polar(r * 0.96, 0.4 * h, 2.1 * k, z=d - r)], 0.002,
                    n=5, of=material)
            m.sphere((0.0, 0.55 * h, d - r), 0.026, n=10, of=OPAL)
            m.box(w, (0.04, 0.06), (0.0, 0.008), 0.002, of=material)
        case 1:  # a ball on an arm
            r = min(0.4 * h, d / 2 - 0.01, hw)
            if w < h:
                m.revolve([(0.0, 0.0), (hw, 0.0), (hw, 0.012), (0.0, 0.018)], n=24, front=(0.0,
                    h - hw, 0.0), of=material)
            m.box(w, h, (0.0, 0.01), 0.003, of=material)
            m.rod(0.0, h / 2, (0.01, d - r), 0.012, of=material)
            m.sphere((0.0, h / 2, d - r), r, n=18, of=OPAL)
        case 2:  # a box that shines up and down
            m.box(w, (0.012, h - 0.012), (0.0, d), 0.003, of=material)
            for y in (0.0, h - 0.0115):
                m.box(w - 0.04, 0.0115, (0.02, d - 0.02), on=y, of=OPAL)
        case 3:  # a half bowl
            m.loft(rings(d_shape, [(w * 0.3, d * 0.4, 0.0, 0.0), (w * 0.8, d * 0.8, 0.0, 0.4 * h),
                (w, d, 0.0, h), (w - 0.01, d - 0.006, 0.003, h), (w * 0.7, d * 0.7, 0.006,
                0.45 * h)], column="back"), of=material)
            m.sphere((0.0, 0.7 * h, d * 0.42), 0.025, n=10, of=OPAL)
        case 4:  # a lit panel
            m.box(w, h, (0.0, 0.03), 0.004, of=material)
            m.board(w * 0.9, d - 0.0305, 0.05 * h, 0.95 * h, 0.012, 0.004,
                z=(d - 0.0305) / 2 + 0.0302, of=OPAL)
