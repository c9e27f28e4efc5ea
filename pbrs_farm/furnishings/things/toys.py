"""Toys and balls; no effects."""

from __future__ import annotations

from itertools import product
from typing import NamedTuple

from numpy import pi

from pbrs_farm.core.frames import rotation_y, rotation_z
from pbrs_farm.core.house import Material
from pbrs_farm.dress.thing_materials import plain
from pbrs_farm.furnishings.things.maker import Maker, thing
from pbrs_farm.geometry.outlines import bent, oval, rect, rings, scaled


# fmt: off
class Look(NamedTuple):
    """Materials of a toy."""

    body: Material
    second: Material
    third: Material
    grain: Material


@thing(group="toy")
def toy(m: Maker) -> None:
    """A toy.

    A bear, blocks, a train, a car, stacked rings, a robot, a top, a plane, a rocket, a house, a drum, an animal on wheels.
    """
    form, s = m.integers(0, len(_FORMS)), m.uniform(0.85, 1.2)
    body, second, third = (m.coloured("toy", 0.5) for _ in range(3))
    m.name = _FORMS[form].__name__
    _FORMS[form](m, s, Look(body, second, third, plain("toy wood", m.wood, 0.6)))


def bear(m: Maker, s: float, look: Look) -> None:
    """A bear."""
    fur = plain("fur", m.pick((0.5, 0.33, 0.2), (0.75, 0.62, 0.45),
        (0.4, 0.4, 0.42), (0.9, 0.87, 0.8)), 0.98)
    with m.of(fur):
        m.ellipsoid((0.075 * s, 0.085 * s, 0.065 * s), n=14, at=(0, 0.085 * s, 0))
        m.sphere((0, 0.2 * s, 0.01), 0.062 * s, n=14)
        for x in (-1.0, 1.0):
            m.sphere((x * 0.05 * s, 0.25 * s, 0), 0.022 * s, n=10)
            m.ellipsoid((0.03 * s, 0.03 * s, 0.06 * s), n=10, turn=rotation_y(x * 0.4),
                at=(x * 0.055 * s, 0.031 * s, 0.07 * s))
            m.ellipsoid((0.024 * s, 0.055 * s, 0.026 * s), n=10, turn=rotation_z(x * 0.7),
                at=(x * 0.088 * s, 0.12 * s, 0.02 * s))
    m.ellipsoid((0.028 * s, 0.022 * s, 0.022 * s), n=10, at=(0, 0.188 * s, 0.062 * s),
        of=plain("snout", (0.85, 0.75, 0.6), 0.98))
    for x, y, r in ((-0.022, 0.218, 0.007), (0.022, 0.218, 0.007), (0.0, 0.196, 0.009)):
        m.sphere((x * s, y * s, (0.068 if r < 0.008 else 0.083) * s), r * s, n=8,
            of=plain("button", (0.05, 0.04, 0.04), 0.3))


def toy_blocks(m: Maker, s: float, look: Look) -> None:
    """Toy blocks."""
    for k in range(m.integers(4, 9)):
        m.box(0.04, 0.04, 0.04, 0.003, turn=rotation_y(m.uniform(-0.6, 0.6)),
            at=(0.05 * (k % 3), 0.0404 * (k // 3), m.uniform(-0.004, 0.004)),
            of=m.pick(look.body, look.second, look.third, look.grain))


def toy_train(m: Maker, s: float, look: Look) -> None:
    """A toy train."""
    for k in range(m.integers(2, 4)):
        with m.moved(at=(0, 0, -0.115 * k)):
            m.box(0.06, (0.016, 0.034), 0.096, 0.004, of=m.pick(look.body, look.grain))
            for x, z in product((-0.031, 0.031), (-0.03, 0.03)):
                m.rod((x - 0.005, x + 0.005), 0.016, z, 0.016, n=12, of=look.third)
            if k == 0:
                m.rod(0, 0.055, (-0.02, 0.045), 0.022, n=14, of=look.second)
                m.box(0.056, (0.0345, 0.095), 0.032, 0.004, against=-0.047, of=look.body)
                m.frustum((0.009, 0.07), (0.012, 0.1), n=10, at=(0, 0, 0.028), of=look.third)
            else:
                m.box(0.054, (0.0345, 0.07), 0.084, 0.004, of=m.pick(look.second, look.third, look.body))


def toy_car(m: Maker, s: float, look: Look) -> None:
    """A toy car."""
    m.box(0.08 * s, (0.018, 0.05 * s), 0.18 * s, 0.01, of=look.body)
    m.loft([(rect(0.074 * s, 0.1 * s, 0.01, z=-0.01), 0.0502 * s),
        (rect(0.06 * s, 0.07 * s, 0.01, z=-0.012), 0.082 * s)], of=m.pick(look.body, look.second))
    for x, z in product((-0.04, 0.04), (-0.055, 0.055)):
        m.rod(((x - 0.008) * s, (x + 0.008) * s), 0.02, z * s, 0.02, n=14,
            of=plain("tyre", (0.06, 0.06, 0.06), 0.8))
    for x in (-0.025, 0.025):
        m.sphere((x * s, 0.036 * s, 0.089 * s), 0.008, n=8, of=plain("lamp", (0.95, 0.9, 0.7), 0.2))


def stacking_rings(m: Maker, s: float, look: Look) -> None:
    """Stacking rings."""
    m.revolve([(0, 0), (0.06, 0), (0.058, 0.012), (0.012, 0.014), (0.01, 0.15 * s), (0, 0.16 * s)],
        n=18, of=look.grain)
    for k in range(5):
        m.hoop(oval(0.085 - 0.011 * k, 0.085 - 0.011 * k, n=18), 0.03 + 0.0255 * s * k, 0.0125 * s,
            n=7, of=m.pick(look.body, look.second, look.third))


def robot(m: Maker, s: float, look: Look) -> None:
    """A robot."""
    with m.of(look.body):
        m.box(0.08, (0.07, 0.15), 0.05, 0.004)
        m.box(0.03, 0.07, 0.055, 0.004, left=-0.037, z=0.0025, mirrored="x")
        m.box(0.02, (0.08, 0.145), 0.024, 0.003, left=-0.062, mirrored="x")
    m.box(0.06, (0.156, 0.205), 0.05, 0.004, of=look.second)
    for x in (-0.013, 0.013):
        m.cylinder(0.008, 0, 0.004, n=10, front=(x, 0.185, 0.025), of=look.third)
    m.rod(0, (0.2, 0.235), 0, 0.003, n=6, of=look.third)
    m.sphere((0, 0.237, 0), 0.007, n=8, of=look.third)
    m.box(0.024, (0.14, 0.157), 0.024, 0.002, of=look.third)
    m.box(0.05, (0.095, 0.13), (0.0245, 0.028), 0.001, of=look.second)


def plane(m: Maker, s: float, look: Look) -> None:
    """A plane."""
    m.tube([(0, 0.04, -0.1), (0, 0.045, 0.09)], 0.012, n=12, end=0.024, of=look.body)
    m.box(0.26, (0.042, 0.05), (0.0, 0.055), 0.003, of=look.second)
    m.box(0.1, (0.042, 0.048), 0.03, 0.002, against=-0.1, of=look.second)
    m.box(0.006, (0.045, 0.09), 0.035, 0.001, against=-0.105, of=look.third)
    m.revolve([(0, 0), (0.01, 0), (0, 0.018)], n=10, front=(0, 0.045, 0.089), of=look.third)
    m.box(0.12, (0.041, 0.049), (0.095, 0.099), 0.001, turn=rotation_z(0.3), at=(0.013, 0, 0),
        of=look.grain)
    for x in (-0.035, 0.035):
        m.rod((x - 0.006, x + 0.006), 0.014, 0.04, 0.014, n=10, of=look.third)
    for x in (-0.035, 0.035):
        m.tube([(x, 0.014, 0.04), (x * 0.5, 0.045, 0.035)], 0.003, n=5, of=look.grain)


def rocket(m: Maker, s: float, look: Look) -> None:
    """A rocket."""
    m.revolve([(0, 0.02), (0.03, 0.02), (0.04, 0.08), (0.038, 0.15), (0.02, 0.2), (0, 0.225)], n=18,
        of=look.body)
    m.revolve([(0.037, 0.148), (0.0385, 0.148), (0.021, 0.2), (0, 0.228), (0, 0.224),
        (0.018, 0.199), (0.037, 0.148)], n=18, of=look.second)
    for k in range(3):
        m.loft([([(0.02, -0.003), (0.02, 0.003), (0.07, 0.003), (0.07, -0.003)], 0.0),
            ([(0.02, -0.003), (0.02, 0.003), (0.045, 0.003), (0.045, -0.003)], 0.08)], sharp=10.0,
            turn=rotation_y(2.0944 * k), of=look.third)
    m.cylinder(0.013, 0, 0.004, n=12, front=(0, 0.12, 0.0375), of=plain("window", (0.6, 0.8, 0.9),
        0.2))


def doll_house(m: Maker, s: float, look: Look) -> None:
    """A doll house."""
    w, h, d = m.uniform(0.22, 0.3), m.uniform(0.2, 0.28), 0.14
    with m.of(m.pick(look.grain, plain("toy white", (0.92, 0.91, 0.88), 0.5))):
        m.box(w, h, 0.006, against=-d / 2)
        m.box(0.008, h, (-d / 2 + 0.006, d / 2), left=-w / 2, mirrored="x")
        for y in (0.0, h / 2):
            m.box(w - 0.016, 0.008, (-d / 2 + 0.006, d / 2), on=y)
        m.box(0.008, (0.008, h / 2), (-d / 2 + 0.006, d / 2))
    m.loft(rings(rect, [(w + 0.03, d + 0.02, 0.001, h + 0.0002), (0.01, d + 0.02, 0.001, h + 0.1)],
        n=1), sharp=20.0, of=look.body)


def drum(m: Maker, s: float, look: Look) -> None:
    """A drum."""
    r, h = m.uniform(0.07, 0.11), m.uniform(0.09, 0.14)
    m.cylinder(r, 0, h, n=26, of=look.body)
    for y in (0.01, h - 0.006):
        m.hoop(oval(2 * r, 2 * r, n=24), y, 0.007, of=look.second)
    for k in range(2):
        m.tube([(-0.1, h + 0.009, -0.02 + 0.04 * k), (0.11, h + 0.012, 0.02 - 0.01 * k)], 0.004,
            n=6, of=look.grain)


def pull_animal(m: Maker, s: float, look: Look) -> None:
    """A pull animal."""
    with m.of(look.grain):
        m.box(0.06, (0.02, 0.032), 0.16, 0.003)
        for x, z in product((-0.036, 0.036), (-0.055, 0.055)):
            m.rod((x - 0.006, x + 0.006), 0.02, z, 0.02, n=14)
    with m.of(look.body):
        m.rounded(0.044, (0.05, 0.1), (-0.06, 0.05), 0.02)
        for z in (-0.045, 0.035):
            m.box(0.04, (0.0322, 0.07), 0.024, 0.003, z=z)
        m.rounded(0.04, (0.085, 0.13), (0.035, 0.09), 0.018)
    for x in (-1.0, 1.0):
        m.ellipsoid((0.005, 0.022, 0.013), n=8, at=(x * 0.022, 0.115, 0.05), of=look.second)
    m.tube(bent([(0, 0.026, 0.08), (0.01, 0.012, 0.13), (0.05, 0.006, 0.16), (0.02, 0.006, 0.21)],
        0.04, n=4), 0.003, n=5, of=look.third)


def puzzle_box(m: Maker, s: float, look: Look) -> None:
    """A puzzle box."""
    m.box(0.3, 0.05, 0.22, 0.001, of=look.body)
    m.box(0.28, (0.05, 0.0506), 0.2, of=look.second)
    m.box(0.18, (0.0507, 0.0511), 0.06, of=look.third)
    if m.chance(0.5):
        m.box(0.26, (0.0513, 0.09), 0.19, 0.001, of=look.third)


def dinosaur(m: Maker, s: float, look: Look) -> None:
    """A dinosaur."""
    with m.of(look.body):
        m.rounded(0.06, (0.04, 0.1), 0.1, 0.028)
        m.tube(bent([(0, 0.075, 0.04), (0, 0.1, 0.09), (0, 0.19, 0.1), (0, 0.2, 0.14)], 0.04, n=4),
            0.022, end=0.014)
        m.tube(bent([(0, 0.075, -0.04), (0, 0.05, -0.1), (0, 0.02, -0.17)], 0.05, n=4), 0.024,
            end=0.004)
        for x, z in product((-0.02, 0.02), (-0.033, 0.033)):
            m.tube([(x * 1.2, 0, z), (x, 0.06, z)], 0.011, end=0.014)
        for k in range(5):
            m.revolve([(0, 0), (0.01, 0), (0, 0.024)], n=6, at=(0,
                0.096 - 0.002 * (k - 2) * (k - 2), -0.04 + 0.02 * k), of=look.second)


_FORMS = (bear, toy_blocks, toy_train, toy_car, stacking_rings, robot, plane, rocket, doll_house, drum,
    pull_animal, puzzle_box, dinosaur)


@thing(group="ball")
def ball(m: Maker) -> None:
    """A ball: plain, of two colours, with rings, with seams."""
    form, r = m.integers(0, 4), m.uniform(0.05, 0.115)
    body, second = (m.coloured("ball", 0.45), plain("ball",
        m.pick((0.9, 0.9, 0.88), (0.08, 0.08, 0.09), m.any_colour()), 0.45))
    match form:
        case 0:  # plain
            m.sphere((0, r, 0), r, n=18, of=body)
        case 1:
            m.name = "ball_of_two_colours"
            m.revolve(scaled(r, r, [(0, 0), (0.38, 0.08), (0.71, 0.3), (0.93, 0.63), (1, 1),
                (0, 1)]), n=22, of=body)
            m.revolve(scaled(r, r, [(0, 1), (1, 1), (0.93, 1.37), (0.71, 1.7), (0.38, 1.92),
                (0, 2)]), n=22, of=second)
        case 2:
            m.name = "ringed_ball"
            m.sphere((0, r, 0), r, n=18, of=body)
            for y in (0.62, 1.0, 1.38):
                m.hoop(oval(2 * r * (1 - (1 - y) * (1 - y)) ** 0.5,
                    2 * r * (1 - (1 - y) * (1 - y)) ** 0.5, n=22), y * r, 0.03 * r, n=5, of=second)
        case 3:
            m.name = "basket_ball"
            m.sphere((0, r, 0), r, n=18, of=body)
            for a in (0.0, pi / 2):
                m.hoop(oval(2 * r, 2 * r, n=24), 0.0, 0.012 * r, n=5,
                    turn=rotation_y(a) @ rotation_z(pi / 2), at=(0, r, 0), of=second)
