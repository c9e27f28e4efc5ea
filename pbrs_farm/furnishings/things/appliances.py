"""Small machines of a kitchen: for coffee, toast and food, kettles; no effects."""

from __future__ import annotations

from itertools import product
from typing import Final

from numpy import pi, radians

from pbrs_farm.core.classes import OTHERFURNITURE
from pbrs_farm.core.frames import LYING_ALONG_Z, rotation_z
from pbrs_farm.furnishings.things.bodies import (
    HALF_TURN,
    bevelled,
    cylinder,
    frustum,
    loft,
    revolve,
    rounded,
    slab,
    tube,
)
from pbrs_farm.furnishings.things.cups import handle
from pbrs_farm.furnishings.things.joints import shell
from pbrs_farm.furnishings.things.maker import Maker, thing
from pbrs_farm.furnishings.things.materials import (
    BLACK_GLASS,
    BLACK_STEEL,
    CHROME,
    RUBBER,
    STEEL,
    glass,
    glossy,
    plain,
)
from pbrs_farm.furnishings.things.outlines import bent, rect, rings

_DOOR_RAD: Final = radians(95)


@thing(group="kettle")
def kettle(m: Maker) -> None:
    """A kettle with a lid and a spout."""
    r = 0.085
    side = m.metal if m.chance(0.7) else plain("enamel", m.any_colour(), 0.2)
    # A body that narrows upwards, its lid and the lid's knob.
    m.add(revolve([(0, 0), (r, 0), (r, 0.02), (r * 0.75, 0.17), (r * 0.6, 0.185), (0.012, 0.19),
        (0.016, 0.21), (0, 0.213)]), of=side)  # fmt: skip
    # The spout leans forward (+x); the grip is a cup's handle, turned to the back.
    m.add(frustum((0.02, 0), (0.011, 0.07), n=8), turn=rotation_z(-0.9), at=(0.055, 0.1, 0),
        of=side)  # fmt: skip
    m.add(handle(0.068, 0.17), turn=HALF_TURN, of=plain("grip", (0.08, 0.08, 0.08), 0.4))


@thing(group="coffee_machine")
def coffee_machine(m: Maker) -> None:
    """A coffee machine: with a jug, for espresso, for capsules, or a pot for the stove."""
    form, s = m.integers(0, 4), m.uniform(0.92, 1.08)
    shell = m.pick(STEEL, BLACK_STEEL, glossy("machine", m.any_colour(), 0.3),
        glossy("machine", (0.06, 0.06, 0.065), 0.3),
        glossy("white lacquer", (0.92, 0.92, 0.9), 0.35))  # fmt: skip
    black = plain("machine black", (0.05, 0.05, 0.052), 0.5)
    match form:
        case 0:  # tank at the back, head over the jug, plate below it
            m.name = "filter_coffee"
            m.add(bevelled((-0.09 * s, 0, -0.11), (0.09 * s, 0.022, 0.1), 0.006), of=shell)
            m.add(bevelled((-0.09 * s, 0.0222, -0.11), (0.09 * s, 0.25 * s, -0.035), 0.008),
                of=shell)  # fmt: skip
            m.add(bevelled((-0.09 * s, 0.2502 * s, -0.11), (0.09 * s, 0.33 * s, 0.1), 0.008),
                of=shell)  # fmt: skip
            m.add(revolve([(0, 0.001), (0.062, 0.001), (0.07, 0.05), (0.068, 0.09), (0.05, 0.135),
                (0.052, 0.15), (0, 0.15)], n=20), at=(0, 0.0222, 0.034),
                of=plain("jug", (0.09, 0.05, 0.03), 0.06))  # fmt: skip
            m.add(tube(bent([(0.04, 0.155, 0.06), (0.085, 0.15, 0.09), (0.09, 0.06, 0.09),
                (0.065, 0.05, 0.065)], 0.02), 0.006, n=6), at=(0, 0.012, 0), of=black)  # fmt: skip
        case 1:  # group head with its handle over a drip tray, a steam pipe beside it
            m.name, w = "espresso_machine", 0.13 * s
            m.add(bevelled((-w, 0.012, -0.15), (w, 0.045, 0.14), 0.005), of=shell)
            m.add(bevelled((-w, 0.0452, -0.15), (w, 0.33, -0.02), 0.01), of=shell)
            m.add(bevelled((-w, 0.24, -0.0198), (w, 0.33, 0.1), 0.01), of=shell)
            m.add(slab((-w + 0.02, 0.0452, 0.0), (w - 0.02, 0.05, 0.13)), of=black)
            m.add(cylinder(0.034, 0, 0.05, n=18), at=(0, 0.1898, 0.05), of=CHROME)
            m.add(tube([(0, 0.2, 0.08), (0, 0.19, 0.19)], 0.012, n=8), of=black)
            m.add(tube(bent([(w - 0.03, 0.2396, 0.06), (w - 0.03, 0.16, 0.065),
                (w - 0.02, 0.1, 0.1)], 0.03), 0.005, n=6), of=CHROME)  # fmt: skip
            for x in (-0.06, 0.0, 0.06):
                m.add(frustum((0.012, 0), (0.011, 0.008), n=12), turn=LYING_ALONG_Z,
                    at=(x, 0.29, 0.1), of=CHROME)  # fmt: skip
            for x, z in product((-w + 0.025, w - 0.025), (-0.12, 0.11)):
                m.add(cylinder(0.015, 0, 0.0125, n=10), at=(x, 0, z), of=black)
        case 2:
            m.name = "capsule_machine"
            m.add(rounded((-0.055 * s, 0.0, -0.17), (0.055 * s, 0.24, 0.0), 0.03, n=3), of=shell)
            m.add(rounded((-0.045 * s, 0.17, -0.02), (0.045 * s, 0.255, 0.1), 0.025, n=3), of=shell)
            m.add(bevelled((-0.05 * s, 0, -0.005), (0.05 * s, 0.03, 0.12), 0.006), of=black)
            m.add(frustum((0.012, 0), (0.016, 0.02), n=12), at=(0, 0.152, 0.06), of=black)
            m.add(tube(bent([(-0.04, 0.262, 0.0), (-0.04, 0.275, 0.09), (0.04, 0.275, 0.09),
                (0.04, 0.262, 0.0)], 0.02), 0.006, n=6), of=CHROME)  # fmt: skip
        case 3:  # eight sides, narrow in the middle
            m.name = "moka_pot"
            m.add(revolve([(0, 0), (0.05 * s, 0), (0.042 * s, 0.075), (0.036 * s, 0.08),
                (0.036 * s, 0.088), (0.05 * s, 0.165), (0.01, 0.178), (0.012, 0.195), (0, 0.197)],
                n=8), of=m.pick(STEEL, CHROME, BLACK_STEEL))  # fmt: skip
            m.add(tube(bent([(0.045 * s, 0.155, 0), (0.1, 0.16, 0), (0.095, 0.09, 0)], 0.02), 0.008,
                n=6), of=black)  # fmt: skip
            m.add(loft(rings(rect, [(0.006, 0.01, 0.002, 0.135), (0.03, 0.02, 0.002, 0.165)], n=1),
                sharp=30.0), at=(-0.05 * s, 0, 0), of=STEEL)  # fmt: skip


@thing(group="toaster")
def toaster(m: Maker) -> None:
    """A toaster for two or four slices, long or square, with a lever and a knob."""
    n, long = m.pick(1, 2, 2), m.uniform(0.25, 0.32)
    d, h = 0.1 + 0.07 * n, m.uniform(0.17, 0.2)
    shell = m.pick(STEEL, CHROME, glossy("toaster", m.any_colour(), 0.25),
        glossy("toaster", (0.07, 0.07, 0.075), 0.3),
        glossy("white lacquer", (0.92, 0.92, 0.9), 0.35))  # fmt: skip
    black = plain("slots", (0.03, 0.03, 0.03), 0.6)
    m.add(rounded((-long / 2, 0.01, -d / 2), (long / 2, h, d / 2), m.pick(0.02, 0.035, 0.045), n=3),
        of=shell)  # fmt: skip
    m.add(bevelled((-long / 2 + 0.03, 0, -d / 2 + 0.03), (long / 2 - 0.03, 0.0104, d / 2 - 0.03),
        0.002), of=black)  # fmt: skip
    for k in range(n):
        m.add(slab((-long / 2 + 0.05, h - 0.001, 0.07 * (k - (n - 1) / 2) - 0.014),
            (long / 2 - 0.05, h + 0.0006, 0.07 * (k - (n - 1) / 2) + 0.014)), of=black)  # fmt: skip
    m.add(bevelled((long / 2 - 0.002, h * 0.62, -0.022), (long / 2 + 0.022, h * 0.72, 0.022),
        0.003), of=black)  # fmt: skip
    m.add(frustum((0.014, 0), (0.012, 0.016), n=14), turn=rotation_z(-pi / 2),
        at=(long / 2 - 0.001, h * 0.35, 0), of=black)  # fmt: skip


@thing(group="microwave", nyu40=OTHERFURNITURE)
def microwave(m: Maker) -> None:
    """A microwave oven: its door with a window, hinged at the left; keys or knobs on the right."""
    w, d, h = m.uniform(0.44, 0.52), m.uniform(0.33, 0.4), m.uniform(0.255, 0.3)
    hw = w / 2
    case = m.pick(glossy("white lacquer", (0.92, 0.92, 0.9), 0.35), STEEL, BLACK_STEEL,
        glossy("microwave", (0.06, 0.06, 0.065), 0.3))  # fmt: skip
    panel, front = m.uniform(0.09, 0.12), d / 2
    # Its works behind the panel; beside them a space with a plate that turns.
    edge, face = hw - panel, front - 0.022
    m.add(bevelled((edge, 0.012, -d / 2), (hw, h, face), 0.004), of=case)
    shell(m, (-hw, edge), (0.012, h), (-d / 2, face), 0.018, case)
    middle = (edge - hw) / 2
    plate_r = min(edge + hw, d) / 2 - 0.035
    m.add(cylinder(plate_r, 0.034, 0.04, n=28), at=(middle, 0, face - plate_r - 0.014),
        of=glass((0.9, 0.95, 0.95), 0.2))  # fmt: skip
    m.add(bevelled((edge + 0.0015, 0.014, front - 0.0218), (hw, h - 0.002, front), 0.004),
        of=m.pick(case, BLACK_GLASS))  # fmt: skip
    with m.hinged("door", at=(-hw, 0.014, front), axis=(0.0, -1.0, 0.0), upper_rad=_DOOR_RAD):
        m.add(bevelled((-hw, 0.014, front - 0.0218), (edge - 0.0015, h - 0.002, front), 0.004),
            of=case)  # fmt: skip
        m.add(slab((-hw + 0.035, 0.05, front), (edge - 0.045, h - 0.045, front + 0.0008)),
            of=BLACK_GLASS)  # fmt: skip
        if m.chance(0.6):
            m.add(tube(bent([(edge - 0.022, 0.05, front - 0.002), (edge - 0.022, 0.05, front + 0.03),
                (edge - 0.022, h - 0.045, front + 0.03),
                (edge - 0.022, h - 0.045, front - 0.002)], 0.012), 0.006, n=6),
                of=m.pick(CHROME, case))  # fmt: skip
    x, keys = hw - panel / 2, plain("keys", (0.7, 0.7, 0.7), 0.5)
    m.add(slab((x - 0.03, h - 0.075, front), (x + 0.03, h - 0.045, front + 0.0008)),
        of=plain("clock", (0.02, 0.06, 0.05), 0.1))  # fmt: skip
    for y in (h * 0.26, h * 0.5):
        if m.chance(0.5):
            m.add(frustum((0.02, 0), (0.017, 0.018), n=16), turn=LYING_ALONG_Z,
                at=(x, y, front - 0.001), of=m.pick(CHROME, keys))  # fmt: skip
        else:
            for i, k in product(range(3), range(4)):
                m.add(slab((x - 0.03 + 0.022 * i, 0.045 + 0.03 * k, front), (x - 0.014 + 0.022 * i,
                    0.065 + 0.03 * k, front + 0.0012)), of=keys)  # fmt: skip
    for a, b in product((-hw + 0.05, hw - 0.05), (-d / 2 + 0.04, front - 0.06)):
        m.add(cylinder(0.014, 0, 0.0125, n=10), at=(a, 0, b), of=RUBBER)
