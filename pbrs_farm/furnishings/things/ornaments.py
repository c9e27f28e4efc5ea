"""Ornaments; no effects."""

from __future__ import annotations

from itertools import product
from typing import NamedTuple

import numpy as np
from numpy import cos, pi, sin

from pbrs_farm.core.frames import rotation_x, rotation_y, rotation_z
from pbrs_farm.core.house import Material
from pbrs_farm.dress.style import shade
from pbrs_farm.dress.thing_materials import glass, plain
from pbrs_farm.furnishings.things.maker import Maker, thing
from pbrs_farm.geometry.outlines import bent, oval, rect, ring_path, rings, scaled


# fmt: off
class Look(NamedTuple):
    """Materials of an ornament."""

    material: Material
    body: Material  # the same or the wood
    grain: Material


@thing(group="ornament")
def ornament(m: Maker) -> None:
    """An ornament.

    An animal, a house, a globe, a boat, a camera, a stack of pebbles and many more.
    """
    form = m.integers(0, len(_FORMS))
    material = m.metal if m.chance(0.25) else plain("ornament", m.any_colour(), m.uniform(0.2, 0.8))
    grain = plain("ornament wood", m.wood, 0.5)
    body = grain if m.chance(0.4) else material
    m.name = _FORMS[form].__name__
    _FORMS[form](m, m.uniform(0.85, 1.2), Look(material, body, grain))


def bird(m: Maker, s: float, look: Look) -> None:
    """A bird."""
    with m.of(look.body):
        m.ellipsoid((0.035 * s, 0.032 * s, 0.055 * s), n=14, turn=rotation_x(-0.35),
            at=(0, 0.062 * s, 0))
        m.sphere((0, 0.1 * s, 0.038 * s), 0.022 * s, n=12)
        m.revolve([(0, 0), (0.007 * s, 0), (0, 0.024 * s)], n=8, front=(0, 0.1 * s, 0.055 * s))
        m.ellipsoid((0.014 * s, 0.006 * s, 0.045 * s), n=10, turn=rotation_x(0.5),
            at=(0, 0.05 * s, -0.06 * s))
    m.turned([(0.03 * s, 0), (0.028 * s, 0.006), (0.006, 0.01), (0.005, 0.04 * s)], n=14,
        of=m.metal)


def cat(m: Maker, s: float, look: Look) -> None:
    """A cat."""
    with m.of(look.body):
        m.revolve(scaled(s, s, [(0, 0), (0.042, 0), (0.046, 0.02), (0.034, 0.07), (0.02, 0.1),
            (0, 0.105)]))
        m.sphere((0, 0.12 * s, 0.008), 0.028 * s, n=12)
        for x in (-0.016, 0.016):
            m.revolve([(0, 0), (0.011 * s, 0), (0, 0.026 * s)], n=8, at=(x * s, 0.137 * s, 0.005))
        m.tube(bent([(0.03 * s, 0.008, -0.03 * s), (0.07 * s, 0.008, -0.01),
            (0.05 * s, 0.008, 0.04 * s)], 0.03, n=3), 0.008, n=6)


def elephant(m: Maker, s: float, look: Look) -> None:
    """An elephant."""
    with m.of(look.body):
        m.rounded(0.07 * s, (0.045 * s, 0.115 * s), (-0.05 * s, 0.045 * s), 0.03 * s)
        for x, z in product((-0.02, 0.02), (-0.035, 0.03)):
            m.frustum((0.013 * s, 0), (0.012 * s, 0.06 * s), n=10, at=(x * s, 0, z * s))
        m.sphere((0, 0.105 * s, 0.055 * s), 0.028 * s, n=12)
        m.tube(bent([(0, 0.1 * s, 0.075 * s), (0, 0.06 * s, 0.1 * s), (0, 0.035 * s, 0.095 * s)],
            0.02, n=3), 0.009 * s, end=0.005 * s)
        for x in (-1.0, 1.0):
            m.ellipsoid((0.005, 0.025 * s, 0.02 * s), n=10, turn=rotation_y(x * 0.5),
                at=(x * 0.03 * s, 0.11 * s, 0.045 * s))


def little_house(m: Maker, s: float, look: Look) -> None:
    """A little house."""
    w, h, d = m.uniform(0.045, 0.065), m.uniform(0.07, 0.12), m.uniform(0.04, 0.06)
    m.box(w, h, d, 0.002, of=look.material)
    m.loft(rings(rect, [(w + 0.012, d + 0.01, 0.0005, h), (0.004, d + 0.01, 0.0005,
        h + w * m.uniform(0.6, 1.0))], n=1), sharp=20.0, of=look.body)
    for x, y in product((-0.22, 0.22), (0.62, 0.8)):
        m.box(((x - 0.12) * w, (x + 0.12) * w), ((y - 0.06) * h, (y + 0.06) * h), 0.0008,
            against=d / 2, of=plain("window", (0.9, 0.82, 0.6), 0.5))
    m.box(0.28 * w, (0.001, 0.3 * h), 0.0008, against=d / 2, of=look.grain)


def globe(m: Maker, s: float, look: Look) -> None:
    """A globe."""
    r = m.uniform(0.06, 0.1)
    m.turned([(r * 0.7, 0), (r * 0.66, 0.012), (r * 0.14, 0.025), (r * 0.1, 0.06)], n=18, of=look.grain)
    m.sphere((0, r + 0.07, 0), r, n=20, of=plain("globe", m.pick((0.35, 0.5, 0.62),
        (0.75, 0.68, 0.5), (0.2, 0.3, 0.4)), 0.35))
    with m.moved(turn=rotation_z(0.4), at=(0, r + 0.07, 0)):
        m.tube(bent([(0, -r - 0.01, 0), (0, -r - 0.01, -r - 0.01), (0, r + 0.01, -r - 0.01),
            (0, r + 0.01, 0)], r, n=6), 0.003, n=6, of=m.metal)
        m.rod(0, (-r - 0.012, r + 0.012), 0, 0.0025, n=6, of=m.metal)


def hourglass(m: Maker, s: float, look: Look) -> None:
    """A hourglass."""
    h, r = m.uniform(0.13, 0.2), m.uniform(0.03, 0.04)
    for y in (0.0, h - 0.012):
        m.cylinder(r + 0.012, 0, 0.012, n=18, at=(0, y, 0), of=look.grain)
    m.turned([(r * 0.9, 0.0125), (r, 0.035), (r * 0.8, 0.36 * h), (0.004, 0.5 * h),
        (r * 0.8, 0.64 * h), (r, h - 0.035), (r * 0.9, h - 0.0125)], n=18, of=glass())
    m.revolve([(0, 0.013), (r * 0.86, 0.013), (r * 0.8, 0.03), (0, 0.3 * h)],
        of=plain("sand", (0.8, 0.66, 0.45), 0.9))
    for k in range(3):
        m.rod(cos(2.1 * k) * (r + 0.006), (0.006, h - 0.006), sin(2.1 * k) * (r + 0.006), 0.0035,
            n=6, of=look.grain)


def pyramid(m: Maker, s: float, look: Look) -> None:
    """A pyramid."""
    a = m.uniform(0.05, 0.09)
    if m.chance(0.5):
        m.loft(rings(rect, [(a, a, 0.001, 0), (a * 0.7, a * 0.7, 0.001, a * 2.2),
            (0.004, 0.004, 0.001, a * 2.8)], n=1), sharp=10.0, of=look.body)
    else:
        m.loft(rings(oval, [(a * 1.4, a * 1.4, 0), (0.004, 0.004, a * 1.1)], n=4), sharp=10.0,
            of=look.body)


def ring_sculpture(m: Maker, s: float, look: Look) -> None:
    """A ring sculpture."""
    r = m.uniform(0.06, 0.1)
    m.box(0.1, 0.02, 0.06, 0.002, of=look.grain)
    m.tube(ring_path(r, n=24), m.uniform(0.008, 0.018), turn=rotation_x(pi / 2),
        at=(0, r + 0.028, 0), of=look.material)
    if m.chance(0.5):
        m.tube(ring_path(r * 0.6, n=20), 0.008, turn=rotation_x(pi / 2),
            at=(0.01, r * 0.75 + 0.028, 0.012), of=look.material)


def arch(m: Maker, _s: float, look: Look) -> None:
    """An arch."""
    w = m.uniform(0.1, 0.15)
    for k in range(m.integers(1, 4)):
        m.tube(bent([(-w / 2 + k * 0.022, 0, 0), (-w / 2 + k * 0.022, w - k * 0.022, 0),
            (w / 2 - k * 0.022, w - k * 0.022, 0), (w / 2 - k * 0.022, 0, 0)], w / 2 - k * 0.022,
            n=7), 0.009, of=m.coloured("arch", 0.6))


def wooden_tree(m: Maker, s: float, look: Look) -> None:
    """A wooden tree."""
    h = m.uniform(0.14, 0.26)
    m.rod(0, (0, 0.3 * h), 0, 0.008, of=look.grain)
    m.frustum((0.03, 0), (0.028, 0.008), n=14, of=look.grain)
    for k in range(3):
        m.turned([(0.05 - 0.012 * k, 0.0), (0.03 - 0.008 * k, 0.12 * h), (0.006, 0.28 * h)],
            at=(0, (0.2 + 0.24 * k) * h, 0), of=look.body)


def pebbles(m: Maker, _s: float, look: Look) -> None:
    """A stack of pebbles."""
    y = 0.0
    for k in range(m.integers(3, 6)):
        a, b = 0.05 - 0.008 * k, m.uniform(0.012, 0.019)
        m.ellipsoid((a * m.uniform(0.9, 1.1), b, a * m.uniform(0.7, 0.9)), n=14,
            at=(m.uniform(-0.004, 0.004), y + b, m.uniform(-0.004, 0.004)),
            turn=rotation_y(m.uniform(0, 3)), of=plain("pebble",
            shade((0.5, 0.49, 0.47), m.uniform(0.6, 1.4)), 0.7))
        y += 1.9 * b


def boat(m: Maker, s: float, look: Look) -> None:
    """A boat."""
    m.box(0.1, 0.012, 0.04, 0.002, of=look.grain)
    m.loft(rings(oval, [(0.12 * s, 0.018 * s, 0.013), (0.17 * s, 0.042 * s, 0.035 * s),
        (0.18 * s, 0.044 * s, 0.045 * s)], n=16), of=look.body)
    m.rod(0, (0.04 * s, 0.25 * s), 0, 0.003, n=6, of=look.grain)
    sail = plain("sail", (0.9, 0.88, 0.82), 0.9)
    for x0, x1, top in ((0.006, 0.075, 0.24), (-0.07, -0.006, 0.2)):
        m.loft([([(x0 * s, -0.001), (x0 * s, 0.001), (x1 * s, 0.001), (x1 * s, -0.001)], 0.06 * s),
            ([(-0.001 + (x0 if x0 > 0 else x1) * s, -0.001), (-0.001 + (x0 if x0 > 0 else x1) * s,
            0.001), (0.001 + (x0 if x0 > 0 else x1) * s, 0.001),
            (0.001 + (x0 if x0 > 0 else x1) * s, -0.001)], top * s)], sharp=10.0, of=sail)


def camera(m: Maker, _s: float, look: Look) -> None:
    """A camera."""
    black = plain("camera black", (0.07, 0.07, 0.07), 0.6)
    m.box(0.13, 0.05, 0.032, 0.004, of=black)
    m.box(0.13, (0.05, 0.072), 0.03, 0.004, of=m.metal)
    m.box(0.04, (0.07, 0.085), 0.024, 0.003, of=m.metal)
    m.turned([(0.027, 0), (0.027, 0.02), (0.024, 0.021), (0.024, 0.035), (0.018, 0.036),
        (0.014, 0.028)], n=20, front=(0.005, 0.034, 0.0155), of=black)
    m.cylinder(0.009, 0, 0.007, n=12, at=(-0.045, 0.0715, 0), of=m.metal, mirrored="x")


def trophy(m: Maker, s: float, look: Look) -> None:
    """A trophy."""
    m.box(0.07, 0.035, 0.07, 0.003, of=plain("stone", (0.1, 0.1, 0.1), 0.3))
    m.vessel([(0, 0.036), (0.026, 0.036), (0.01, 0.05), (0.008, 0.08 * s), (0.03, 0.1 * s),
        (0.045, 0.14 * s), (0.05, 0.18 * s)], 0.002, n=18, of=m.metal)
    for x in (-1.0, 1.0):
        m.tube(bent([(x * 0.045, 0.17 * s, 0), (x * 0.08, 0.17 * s, 0), (x * 0.075, 0.11 * s, 0),
            (x * 0.034, 0.105 * s, 0)], 0.02, n=3), 0.0035, n=6, of=m.metal)


def bust(m: Maker, s: float, look: Look) -> None:
    """A bust of a person."""
    m.box(0.08, 0.025, 0.07, 0.003, of=look.grain)
    with m.of(look.material):
        m.loft(rings(oval, [(0.05, 0.045, 0.0, 0.0255), (0.12, 0.07, 0.0, 0.06), (0.1, 0.06, 0.0,
            0.085), (0.045, 0.045, 0.0, 0.105), (0.042, 0.045, 0.004, 0.13)], column="z"))
        m.ellipsoid((0.034, 0.046, 0.04), n=16, at=(0, 0.165, 0.006))
        m.ellipsoid((0.006, 0.012, 0.009), n=8, at=(0, 0.163, 0.045))
        m.ellipsoid((0.036, 0.034, 0.038), n=12, at=(0, 0.182, -0.004))


def treasure_chest(m: Maker, s: float, look: Look) -> None:
    """A treasure chest."""
    w, h, d = m.uniform(0.12, 0.18), m.uniform(0.05, 0.08), m.uniform(0.08, 0.11)
    m.box(w, h, d, 0.002, of=look.body)
    m.rod((-w / 2, w / 2), h, 0, d / 2, n=20, of=look.body, name="lid")
    for x in (-0.3, 0.3):
        m.box(((x - 0.04) * w, (x + 0.04) * w), (-0.0005, h), d + 0.003, 0.001, of=m.metal)
    m.box(0.024, 0.028, 0.004, 0.001, on=h - 0.02, against=d / 2, of=m.metal)


def cube_puzzle(m: Maker, _s: float, look: Look) -> None:
    """A cube puzzle."""
    for x, y, z in product((-1, 0, 1), (-1, 0, 1), (-1, 0, 1)):
        m.box(0.0182, 0.0186, 0.0182, 0.0015, x=0.019 * x, on=0.0285 + y * 0.019 - 0.0095,
            z=0.019 * z, of=m.pick(plain("red", (0.72, 0.1, 0.1), 0.4),
            plain("blue", (0.1, 0.25, 0.6), 0.4), plain("yellow", (0.85, 0.75, 0.15), 0.4),
            plain("green", (0.1, 0.5, 0.25), 0.4), plain("pale", (0.9, 0.9, 0.9), 0.4)))


def snow_globe(m: Maker, s: float, look: Look) -> None:
    """A snow globe."""
    m.turned([(0.04, 0), (0.036, 0.02), (0.03, 0.025)], n=20, of=look.body)
    m.revolve([(0, 0.0252), (0.024, 0.0252), (0.04, 0.045), (0.042, 0.062), (0.034, 0.088),
        (0.018, 0.1), (0, 0.103)], n=20, of=glass())
    m.revolve([(0, 0.0254), (0.022, 0.0254), (0.03, 0.038), (0, 0.043)], n=14,
        of=plain("snow", (0.93, 0.93, 0.93), 0.9))
    m.revolve([(0, 0.04), (0.014, 0.042), (0, 0.08)], n=10, of=plain("fir", (0.1, 0.3, 0.18), 0.8))


def bead_string(m: Maker, s: float, look: Look) -> None:
    """A bead string."""
    n, r = m.integers(14, 20), m.uniform(0.009, 0.012)
    for k in range(n):
        m.sphere((cos(2 * pi * k / n) * n * r * 0.33, r, sin(2 * pi * k / n) * n * r * 0.33), r,
            n=8, of=look.body)


def metronome(m: Maker, s: float, look: Look) -> None:
    """A metronome."""
    m.loft(rings(rect, [(0.11, 0.1, 0.004, 0), (0.11, 0.1, 0.004, 0.012),
        (0.1, 0.09, 0.003, 0.0125), (0.05, 0.045, 0.003, 0.2), (0.03, 0.025, 0.003, 0.22)], n=1),
        sharp=25.0, of=look.grain)
    m.tube([(0, 0.05, 0.046), (m.uniform(-0.02, 0.02), 0.19, 0.034)], 0.0018, n=5, of=m.metal)
    m.box(0.018, (0.12, 0.14), (0.036, 0.044), 0.001, of=m.metal)


def toy_car_model(m: Maker, s: float, look: Look) -> None:
    """A toy car model."""
    m.box(0.06, (0.012, 0.036), 0.14, 0.008, of=look.material)
    m.loft([(rect(0.056, 0.085, 0.008, z=-0.005), 0.0361),
        (rect(0.046, 0.055, 0.008, z=-0.008), 0.06)], of=look.material)
    for x, z in product((-0.029, 0.029), (-0.045, 0.045)):
        m.rod((x - 0.006, x + 0.006), 0.014, z, 0.014, n=14,
            of=plain("tyre", (0.06, 0.06, 0.06), 0.8))


def horse(m: Maker, s: float, look: Look) -> None:
    """A horse."""
    with m.of(look.body):
        m.rounded(0.044 * s, (0.08 * s, 0.125 * s), (-0.06 * s, 0.05 * s), 0.02 * s)
        for x, z in product((-0.013, 0.013), (-0.048, 0.04)):
            m.rod(x * s, (0, 0.09 * s), z * s, 0.006 * s, end=0.011 * s)
        m.tube([(0, 0.105 * s, 0.04 * s), (0, 0.175 * s, 0.075 * s)], 0.02 * s, n=10, end=0.013 * s)
        m.tube([(0, 0.178 * s, 0.065 * s), (0, 0.155 * s, 0.115 * s)], 0.015 * s, n=10,
            end=0.009 * s)
        m.tube(bent([(0, 0.115 * s, -0.055 * s), (0, 0.11 * s, -0.08 * s),
            (0, 0.05 * s, -0.085 * s)], 0.02, n=3), 0.006 * s, n=6)
        m.revolve([(0, 0), (0.005, 0), (0, 0.018)], n=6, at=(-0.008, 0.182 * s, 0.07 * s),
            mirrored="x")


def blocks(m: Maker, s: float, look: Look) -> None:
    """A stack of blocks."""
    y = 0.0
    for _ in range(m.integers(2, 5)):
        w, h, d = m.uniform(0.04, 0.09), m.uniform(0.02, 0.06), m.uniform(0.03, 0.06)
        m.box(w, h, d, 0.003, on=y, turn=rotation_y(m.uniform(-0.3, 0.3)),
            of=m.pick(look.grain, look.material, m.coloured("ornament", 0.5)))
        y += h + 0.0002


def sculpture(m: Maker, _s: float, look: Look) -> None:
    """Bodies turned about one axis, each smaller than the one below it."""
    m.name = ""  # it is no figure
    n, y, profile = m.integers(2, 5), 0.0, [(0.0, 0.0)]
    r = m.uniform(0.035, 0.055)
    for _ in range(n):
        # Each is part of a sine's arch.
        tall = r * m.uniform(0.8, 1.9)
        for t in (0.0, 0.25, 0.5, 0.75, 1.0):
            profile.append((max(r * np.sin(np.pi * (0.12 + 0.76 * t)), 0.004), y + tall * t))
        y, r = y + tall, r * m.uniform(0.6, 0.9)
    profile.append((0.0, y))
    profile[1] = (profile[1][0] + 0.01, 0.0)
    m.revolve(profile, n=14, of=look.material)


_FORMS = (sculpture, bird, cat, elephant, little_house, globe, hourglass, pyramid, ring_sculpture, arch,
    wooden_tree, pebbles, boat, camera, trophy, bust, treasure_chest, cube_puzzle, snow_globe,
    bead_string, metronome, toy_car_model, horse, blocks)
