"""Small machines of a kitchen: for coffee, toast and food, kettles; no effects."""

from __future__ import annotations

from itertools import product
from typing import Final

from numpy import pi, radians

from pbrs_farm.core.classes import OTHERFURNITURE
from pbrs_farm.core.frames import rotation_z
from pbrs_farm.dress.thing_materials import (
    BLACK_GLASS,
    BLACK_STEEL,
    CHROME,
    RUBBER,
    STEEL,
    glass,
    glossy,
    plain,
)
from pbrs_farm.furnishings.things.cups import handle
from pbrs_farm.furnishings.things.joints import clock, pull, shell
from pbrs_farm.furnishings.things.maker import Maker, thing
from pbrs_farm.geometry.bodies import HALF_TURN
from pbrs_farm.geometry.outlines import bent, rect, rings

# fmt: off
_DOOR_RAD: Final = radians(95)


@thing(group="kettle")
def kettle(m: Maker) -> None:
    """A kettle with a lid and a spout."""
    r = 0.085
    side = m.metal if m.chance(0.7) else m.coloured("enamel", 0.2)
    # A body that narrows upwards, its lid and the lid's knob.
    m.revolve([(0, 0), (r, 0), (r, 0.02), (r * 0.75, 0.17), (r * 0.6, 0.185), (0.012, 0.19),
        (0.016, 0.21), (0, 0.213)], of=side)
    # The spout leans forward (+x); the grip is a cup's handle, turned to the back.
    m.frustum((0.02, 0), (0.011, 0.07), n=8, turn=rotation_z(-0.9), at=(0.055, 0.1, 0), of=side)
    m.add(handle(0.068, 0.17), turn=HALF_TURN, of=plain("grip", (0.08, 0.08, 0.08), 0.4))


@thing(group="coffee_machine")
def coffee_machine(m: Maker) -> None:
    """A coffee machine: with a jug, for espresso, for capsules, or a pot for the stove."""
    form, s = m.integers(0, 4), m.uniform(0.92, 1.08)
    shell = m.pick(STEEL, BLACK_STEEL, glossy("machine", m.any_colour(), 0.3),
        glossy("machine", (0.06, 0.06, 0.065), 0.3), glossy("white lacquer", (0.92, 0.92, 0.9),
        0.35))
    black = plain("machine black", (0.05, 0.05, 0.052), 0.5)
    match form:
        case 0:  # tank at the back, head over the jug, plate below it
            m.name = "filter_coffee"
            m.box(0.18 * s, 0.022, (-0.11, 0.1), 0.006, of=shell)
            m.box(0.18 * s, (0.0222, 0.25 * s), 0.075, 0.008, against=-0.11, of=shell)
            m.box(0.18 * s, (0.2502 * s, 0.33 * s), (-0.11, 0.1), 0.008, of=shell)
            m.turned([(0.062, 0.001), (0.07, 0.05), (0.068, 0.09), (0.05, 0.135), (0.052, 0.15)],
                n=20, at=(0, 0.0222, 0.034), of=plain("jug", (0.09, 0.05, 0.03), 0.06))
            m.tube(bent([(0.04, 0.155, 0.06), (0.085, 0.15, 0.09), (0.09, 0.06, 0.09),
                (0.065, 0.05, 0.065)], 0.02), 0.006, n=6, at=(0, 0.012, 0), of=black)
        case 1:  # group head with its handle over a drip tray, a steam pipe beside it
            m.name, w = "espresso_machine", 0.13 * s
            m.box(2 * w, (0.012, 0.045), (-0.15, 0.14), 0.005, of=shell)
            m.box(2 * w, (0.0452, 0.33), 0.13, 0.01, against=-0.15, of=shell)
            m.box(2 * w, (0.24, 0.33), 0.1198, 0.01, z=0.0401, of=shell)
            m.box(2 * w - 0.04, (0.0452, 0.05), (0.0, 0.13), of=black)
            m.cylinder(0.034, 0, 0.05, n=18, at=(0, 0.1898, 0.05), of=CHROME)
            m.tube([(0, 0.2, 0.08), (0, 0.19, 0.19)], 0.012, of=black)
            m.tube(bent([(w - 0.03, 0.2396, 0.06), (w - 0.03, 0.16, 0.065), (w - 0.02, 0.1, 0.1)],
                0.03), 0.005, n=6, of=CHROME)
            for x in (-0.06, 0.0, 0.06):
                m.frustum((0.012, 0), (0.011, 0.008), n=12, front=(x, 0.29, 0.1), of=CHROME)
            for x, z in product((-w + 0.025, w - 0.025), (-0.12, 0.11)):
                m.cylinder(0.015, 0, 0.0125, n=10, at=(x, 0, z), of=black)
        case 2:
            m.name = "capsule_machine"
            m.rounded(0.11 * s, 0.24, (-0.17, 0.0), 0.03, n=3, of=shell)
            m.rounded(0.09 * s, (0.17, 0.255), 0.12, 0.025, n=3, z=0.04, of=shell)
            m.box(0.1 * s, 0.03, 0.125, 0.006, z=0.0575, of=black)
            m.frustum((0.012, 0), (0.016, 0.02), n=12, at=(0, 0.152, 0.06), of=black)
            m.tube(bent([(-0.04, 0.262, 0.0), (-0.04, 0.275, 0.09), (0.04, 0.275, 0.09),
                (0.04, 0.262, 0.0)], 0.02), 0.006, n=6, of=CHROME)
        case 3:  # eight sides, narrow in the middle
            m.name = "moka_pot"
            m.revolve([(0, 0), (0.05 * s, 0), (0.042 * s, 0.075), (0.036 * s, 0.08),
                (0.036 * s, 0.088), (0.05 * s, 0.165), (0.01, 0.178), (0.012, 0.195), (0, 0.197)],
                n=8, of=m.pick(STEEL, CHROME, BLACK_STEEL))
            m.tube(bent([(0.045 * s, 0.155, 0), (0.1, 0.16, 0), (0.095, 0.09, 0)], 0.02), 0.008,
                n=6, of=black)
            m.loft(rings(rect, [(0.006, 0.01, 0.002, 0.135), (0.03, 0.02, 0.002, 0.165)], n=1),
                sharp=30.0, at=(-0.05 * s, 0, 0), of=STEEL)


@thing(group="toaster")
def toaster(m: Maker) -> None:
    """A toaster for two or four slices, long or square, with a lever and a knob."""
    n, long = m.pick(1, 2, 2), m.uniform(0.25, 0.32)
    d, h = 0.1 + 0.07 * n, m.uniform(0.17, 0.2)
    shell = m.pick(STEEL, CHROME, glossy("toaster", m.any_colour(), 0.25),
        glossy("toaster", (0.07, 0.07, 0.075), 0.3), glossy("white lacquer", (0.92, 0.92, 0.9),
        0.35))
    black = plain("slots", (0.03, 0.03, 0.03), 0.6)
    m.rounded(long, (0.01, h), d, m.pick(0.02, 0.035, 0.045), n=3, of=shell)
    m.box(long - 0.06, 0.0104, d - 0.06, 0.002, of=black)
    for k in range(n):
        m.box(long - 0.1, 0.0016, 0.028, on=h - 0.001, against=0.07 * k - 0.035 * n + 0.021,
            of=black)
    m.box(0.024, (h * 0.62, h * 0.72), 0.044, 0.003, left=long / 2 - 0.002, of=black)
    m.frustum((0.014, 0), (0.012, 0.016), n=14, turn=rotation_z(-pi / 2),
        at=(long / 2 - 0.001, h * 0.35, 0), of=black)


@thing(group="microwave", nyu40=OTHERFURNITURE)
def microwave(m: Maker) -> None:
    """A microwave oven: its door with a window, hinged at the left; keys or knobs on the right."""
    w, d, h = m.uniform(0.44, 0.52), m.uniform(0.33, 0.4), m.uniform(0.255, 0.3)
    hw = w / 2
    case = m.pick(glossy("white lacquer", (0.92, 0.92, 0.9), 0.35), STEEL, BLACK_STEEL,
        glossy("microwave", (0.06, 0.06, 0.065), 0.3))
    panel, front = m.uniform(0.09, 0.12), d / 2
    # Its works behind the panel; beside them a space with a plate that turns.
    edge, face = hw - panel, front - 0.022
    m.box((edge, hw), (0.012, h), (-d / 2, face), 0.004, of=case)
    shell(m, (-hw, edge), (0.012, h), (-d / 2, face), 0.018, case)
    middle = (edge - hw) / 2
    plate_r = min(edge + hw, d) / 2 - 0.035
    m.cylinder(plate_r, 0.034, 0.04, n=28, at=(middle, 0, face - plate_r - 0.014),
        of=glass((0.9, 0.95, 0.95), 0.2))
    m.box((edge + 0.0015, hw), (0.014, h - 0.002), (front - 0.0218, front), 0.004,
        of=m.pick(case, BLACK_GLASS))
    grip = m.pick("bar", "bow", "square", "button", "button")
    black = plain("machine black", (0.04, 0.04, 0.042), 0.5)
    with m.hinged("door", at=(-hw, 0.014, front), axis=(0.0, -1.0, 0.0), upper_rad=_DOOR_RAD):
        m.box((-hw, edge - 0.0015), (0.014, h - 0.002), (front - 0.0218, front), 0.004, of=case)
        # A window of dark glass in a rim, with the mesh behind it as a darker field.
        across, up = (-hw + 0.03, edge - (0.03 if grip == "button" else 0.05)), (0.045, h - 0.04)
        m.box(across, up, 0.0008, 0.0003, against=front, of=BLACK_GLASS)
        m.frame(across, up, 0.007, 0.0022, 0.0008, against=front, of=m.pick(case, black, CHROME))
        m.box((across[0] + 0.03, across[1] - 0.03), (up[0] + 0.025, up[1] - 0.025), 0.0003,
            against=front + 0.0008, of=plain("mesh", (0.12, 0.12, 0.12), 0.35))
        if grip != "button":
            pull(m, grip, edge - 0.022, h / 2, front - 0.0005, False, h - 0.1, m.pick(CHROME, case))
        m.box(0.035, 0.004, 0.0006, x=sum(across) / 2, on=h - 0.026, against=front, of=CHROME)
    x, keys = hw - panel / 2, plain("keys", (0.7, 0.7, 0.7), 0.5)
    clock(m, x, h - 0.05, front)
    low = 0.06 if grip == "button" else 0.03
    if grip == "button":
        m.box(panel - 0.03, 0.022, 0.003, 0.001, x=x, on=0.026, against=front, of=keys)
    if m.chance(0.45):
        for y in (h * 0.34, h * 0.58):
            m.turned([(0.021, 0), (0.019, 0.016), (0.016, 0.018)], n=20, front=(x, y,
                front - 0.001), of=m.pick(CHROME, keys, black))
            m.box(0.003, 0.016, 0.0006, x=x, on=y + 0.001, against=front + 0.0168, of=RUBBER)
    else:
        for i, k in product(range(3), range(m.pick(4, 5))):
            m.box(0.018, 0.014, 0.0016, x=x + 0.023 * (i - 1), on=low + 0.0225 * k,
                against=front, of=keys)
    for k in range(6):  # air
        m.box(0.0006, 0.003, 0.09, x=hw, on=0.6 * h + 0.009 * k, z=-0.1 * d, of=black)
    for a, b in product((-hw + 0.05, hw - 0.05), (-d / 2 + 0.04, front - 0.06)):
        m.cylinder(0.014, 0, 0.0125, n=10, at=(a, 0, b), of=RUBBER)
