"""Table clocks; no effects."""

from __future__ import annotations

from itertools import product

from pbrs_farm.core.frames import LYING_ALONG_Z, rotation_x, rotation_z
from pbrs_farm.core.house import Material
from pbrs_farm.dress.thing_materials import glass, plain
from pbrs_farm.furnishings.things.maker import Maker, thing
from pbrs_farm.geometry.outlines import bent, rect, rings


# fmt: off
@thing(group="clock", called="alarm_clock")
def clock(m: Maker) -> None:
    """A table clock: digital, round, with two bells, a wedge, for a mantel, under a glass dome."""
    form = m.integers(0, 13)
    material = m.metal if m.chance(0.35) else m.coloured("clock", 0.4)
    grain = plain("clock wood", m.wood, 0.45)
    match form:
        case 0:  # digital
            m.box(0.14, 0.07, 0.05, 0.004, of=material)
            m.box(0.11, (0.015, 0.055), (0.025, 0.0255), of=plain("display", (0.05, 0.06, 0.05),
                0.1))
        case 1:  # round, on a foot
            with m.moved(at=(0, 0.062, 0)):
                clock_face(m, 0.055, material)
            m.box(0.07, 0.012, 0.04, of=material)
        case 2:  # a clock with two bells on it
            with m.moved(at=(0, 0.07, 0)):
                clock_face(m, 0.055, material)
            with m.of(material):
                for x in (-1.0, 1.0):
                    m.revolve([(0, 0), (0.022, 0), (0.019, 0.012), (0, 0.02)], n=14,
                        turn=rotation_z(-x * 0.6), at=(x * 0.033, 0.126, 0))
                    m.tube([(x * 0.025, 0.03, 0), (x * 0.04, 0.0, 0)], 0.004, n=6)
                m.tube(bent([(-0.03, 0.125, 0), (-0.02, 0.165, 0), (0.02, 0.165, 0), (0.03, 0.125,
                    0)], 0.02, n=3), 0.003, n=6)
        case 3:  # a wedge
            m.loft([(rect(0.16, 0.08, 0.004, n=2), 0), (rect(0.16, 0.03, 0.004, z=-0.022, n=2),
                0.075)], sharp=25.0, of=grain)
            m.box(0.12, (-0.02, 0.02), (0, 0.0006), turn=rotation_x(-0.56), at=(0, 0.038, 0.0168),
                of=plain("display", (0.05, 0.06, 0.05), 0.1))
        case 4:  # for a mantel
            m.box(0.26, 0.02, 0.09, 0.003, of=grain)
            m.loft(rings(rect, [(0.2, 0.07, 0.004, 0.0201), (0.19, 0.066, 0.004, 0.12),
                (0.12, 0.06, 0.004, 0.18), (0.04, 0.05, 0.004, 0.2)], n=2), sharp=25.0, of=grain)
            with m.moved(at=(0, 0.1, 0.022)):
                clock_face(m, 0.05, m.metal)
        case 5:  # a clock under a glass dome
            m.frustum((0.07, 0), (0.068, 0.015), n=24, of=grain)
            m.revolve([(0, 0.0152), (0.06, 0.0152), (0.06, 0.16), (0.04, 0.2), (0, 0.215)], n=22,
                of=glass())
            with m.moved(at=(0, 0.12, 0)):
                clock_face(m, 0.04, m.metal)
            for x in (-0.03, 0.03):
                m.rod(x, (0.014, 0.12), 0, 0.004, of=m.metal)
            m.cylinder(0.022, 0.03, 0.045, n=14, of=m.metal)
        case 6:  # a cube
            m.box(0.07, 0.07, 0.07, 0.003, of=grain)
            m.box(0.05, (0.02, 0.05), (0.035, 0.0355), of=plain("display", (0.1, 0.12, 0.1), 0.1))
        case 7:  # flaps with numbers
            m.box(0.2, 0.085, 0.07, 0.008, of=material)
            for x in (-0.045, 0.045):
                m.box(0.076, (0.012, 0.041), (0.034, 0.04), 0.002, x=x,
                    of=plain("flap", (0.08, 0.08, 0.08), 0.4))
                m.box(0.076, (0.0425, 0.072), (0.034, 0.04), 0.002, x=x,
                    of=plain("flap", (0.08, 0.08, 0.08), 0.4))
        case 8:  # a ball
            m.sphere((0, 0.055, 0), 0.055, n=20, of=material)
            with m.moved(at=(0, 0.058, 0.03)):
                clock_face(m, 0.042, material)
            m.frustum((0.03, 0), (0.022, 0.012), of=grain)
        case 9:
            carriage_clock(m)
        case 10:  # an arch of wood
            m.rod(0, 0.08, (-0.03, 0.03), 0.075, n=24, of=grain)
            m.box(0.15, 0.08, 0.06, 0.002, of=grain)
            with m.moved(at=(0, 0.085, 0.0125)):
                clock_face(m, 0.05, material)
        case 11:
            clock_radio(m, material, grain)
        case 12:  # a slice of stone or glass
            m.box(0.16, 0.11, 0.024, 0.003, of=m.pick(glass((0.85, 0.93, 0.92), 0.35),
                plain("slate", (0.2, 0.21, 0.22), 0.7)))
            with m.moved(at=(0, 0.06, -0.0055)):
                clock_face(m, 0.04, m.metal)
            m.box(0.12, 0.01, 0.08, 0.002, of=m.metal)


def carriage_clock(m: Maker) -> None:
    """A carriage clock with a grip."""
    with m.of(m.metal):
        m.box(0.09, 0.015, 0.08, 0.003)
        m.box(0.09, (0.115, 0.13), 0.08, 0.003)
        for x, z in product((-0.039, 0.039), (-0.034, 0.034)):
            m.rod(x, (0.012, 0.118), z, 0.005)
        m.tube(bent([(-0.03, 0.128, 0), (-0.03, 0.165, 0), (0.03, 0.165, 0), (0.03, 0.128, 0)],
            0.015, n=3), 0.004, n=6)
    m.box(0.068, (0.015, 0.115), (-0.03, 0.026), 0.002, of=plain("case", (0.9, 0.88, 0.82), 0.4))
    with m.moved(at=(0, 0.068, 0.0075)):
        clock_face(m, 0.03, m.metal)


def clock_radio(m: Maker, material: Material, grain: Material) -> None:
    """A radio with a clock in its display."""
    m.box(0.24, (0.004, 0.11), 0.1, 0.01, of=m.pick(grain, material))
    m.box((-0.11, 0.02), (0.02, 0.1), (0.049, 0.053), 0.002,
        of=plain("grille", (0.2, 0.2, 0.21), 0.9))
    m.box((0.035, 0.11), (0.06, 0.1), (0.05, 0.0506), of=plain("display", (0.05, 0.06, 0.05), 0.1))
    m.revolve([(0, 0), (0.016, 0), (0.014, 0.012), (0, 0.013)], front=(0.072, 0.035, 0.0495),
        of=m.metal)
    for x, z in product((-0.1, 0.1), (-0.035, 0.035)):
        m.rod(x, (0, 0.006), z, 0.008, of=plain("foot", (0.1, 0.1, 0.1), 0.8))


def clock_face(m: Maker, r: float, material: Material) -> None:
    """A case, a dial and two hands, facing +z about the origin."""
    m.turned([(r * 0.9, -0.02), (r, 0), (r * 0.9, 0.02), (r * 0.85, 0.021)], n=24,
        turn=LYING_ALONG_Z, of=material)
    m.revolve([(0, 0.0211), (r * 0.8, 0.0211), (0, 0.022)], n=24, turn=LYING_ALONG_Z,
        of=plain("dial", m.pick((0.93, 0.93, 0.9), (0.9, 0.86, 0.76), (0.1, 0.1, 0.1)), 0.5))
    for long in (0.45, 0.7):
        m.box(0.003, (-0.005, long * r), (0.0222, 0.0228), turn=rotation_z(m.uniform(0, 6)),
            of=plain("hand", (0.3, 0.1, 0.08) if m.chance(0.2) else (0.25, 0.25, 0.26), 0.4))
