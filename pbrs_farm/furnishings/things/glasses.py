"""Drinking glasses: a bowl, a stem or foot, and a drink; no effects."""

from __future__ import annotations

from typing import Final

import numpy as np

from pbrs_farm.core.frames import rotation_x, rotation_y
from pbrs_farm.dress import thing_materials as materials
from pbrs_farm.dress.thing_materials import plain
from pbrs_farm.furnishings.things.cups import handle
from pbrs_farm.furnishings.things.forms import formed
from pbrs_farm.furnishings.things.maker import Maker, thing
from pbrs_farm.furnishings.things.profiles import profiles
from pbrs_farm.geometry.bodies import bevelled, vessel
from pbrs_farm.geometry.outlines import Profile, bent, oval, rings

# fmt: off
_WALL_M: Final = 0.002


def _filled(m: Maker, r: float, low: float, tall: float, shape: Profile, share: float) -> None:
    """A drink in a bowl, up to a share of its height."""
    radii, heights = np.array([(0.0, 0.0), *shape]).T
    ys = np.linspace(0.06, share, 5)
    inside = [(float(np.interp(y, heights, radii) * r - _WALL_M - 0.0008),
        float(low + y * tall)) for y in ys]
    inside = [(max(x, 0.001), y + _WALL_M) for x, y in inside]
    drink = plain("drink", m.pick((0.35, 0.03, 0.06), (0.85, 0.75, 0.4), (0.8, 0.45, 0.1),
        (0.45, 0.2, 0.06), (0.9, 0.85, 0.78), (0.75, 0.25, 0.3)), 0.1)
    m.revolve([(0.0, inside[0][1]), *inside, (0.0, inside[-1][1])], of=drink)


def _stemmed(m: Maker) -> None:
    """A bowl on a stem and a foot."""
    bowl = m.pick(*profiles("stemmed").values())
    shape = bowl.profile
    r, tall, stem = (bowl.radius_m * m.uniform(0.92, 1.08), bowl.height_m * m.uniform(0.92, 1.1),
        m.uniform(0.035, 0.09))
    foot = max(0.8 * r, 0.028)
    way = m.integers(0, 4)
    middle = [
        [(0.0045, 0.009), (0.0038, 0.5 * stem), (0.006, stem - 0.004)],  # thin
        [
            (0.006, 0.012),
            (0.0035, 0.3 * stem),
            (0.009, 0.5 * stem),
            (0.0035, 0.7 * stem),
            (0.006, stem - 0.003),
        ],  # a knot
        [(0.014, 0.01), (0.008, 0.5 * stem), (0.01, stem - 0.004)],  # thick
        [
            (0.01, 0.009),
            (0.004, 0.35 * stem),
            (0.004, 0.75 * stem),
            (0.012, stem - 0.002),
        ],  # drawn out of the bowl
    ][way]
    outer = [(x * r, stem + y * tall) for x, y in shape]
    inner = [(x - _WALL_M, y + (_WALL_M if k else 0.0)) for k, (x, y) in enumerate(outer)]
    inner = [(x, min(y, outer[-1][1])) for x, y in inner if x > 0.001]
    m.revolve([(0.0, 0.0), (foot, 0.0), (0.96 * foot, 0.003), *middle, *outer, *inner[::-1],
        (0.0, outer[0][1] + 1.5 * _WALL_M)], n=m.pick(16, 18, 20))
    if m.chance(0.4):
        _filled(m, r, stem, tall, shape, m.uniform(0.35, 0.75))


def _tumbler(m: Maker) -> None:
    """A glass without a stem, one or a few."""
    form = m.pick(*profiles("tumbler").values())
    shape = form.profile
    r, tall = form.radius_m * m.uniform(0.92, 1.08), form.height_m * m.uniform(0.92, 1.1)
    base = m.pick(1.0, 1.0, 5.0)
    outer = [(0.0, 0.0), *((x * r, y * tall) for x, y in shape)]
    n = 1 if m.chance(0.75) else m.integers(2, 5)
    for k in range(n):
        step = 2.3 * r
        glass = vessel(outer, _WALL_M * (1.0 if base == 1.0 else 1.4), n=16)
        m.add(glass, at=(step * (k % 2), 0.0, step * (k // 2)))
        # A thick base is a slab of glass inside.
        if base > 1.0:
            m.cylinder(0.8 * shape[0][0] * r, _WALL_M * 1.5, _WALL_M * base,
                at=(step * (k % 2), 0.0, step * (k // 2)))
    if n > 1:
        return
    share = m.uniform(0.4, 0.85)
    has_drink = m.chance(0.45)
    if has_drink:
        _filled(m, r, _WALL_M * base, tall - _WALL_M * base, shape, share)
    extra = m.weighted(0.6, 0.12, 0.12, 0.16)
    if extra == 1:
        m.tube([(-0.3 * r, 0.3 * tall, 0.0), (0.75 * r, 1.0 * tall, 0.0),
            (1.3 * r, 1.35 * tall, 0.004)], 0.003, n=6, of=m.coloured("straw", 0.5))
    elif extra == 2:
        rim = shape[-1][0] * r
        m.cylinder(0.62 * r, 0.0, 0.004, turn=rotation_x(np.pi / 2), at=(rim, tall + 0.12 * r, 0.0),
            of=plain("lemon", m.pick((0.88, 0.78, 0.25), (0.85, 0.5, 0.15), (0.5, 0.65, 0.2)), 0.5))
    elif extra == 3 and has_drink:
        for k in range(m.integers(2, 4)):
            m.add(bevelled((-0.008,) * 3, (0.008,) * 3, 0.002),
                turn=rotation_y(0.7 * k) @ rotation_x(0.5 * k), at=(0.3 * r * np.cos(2.2 * k),
                share * tall, 0.3 * r * np.sin(2.2 * k)))


def _mug(m: Maker) -> None:
    """A beer mug with a handle: plain, a barrel, or with facets."""
    r, tall, form = m.uniform(0.036, 0.042), m.uniform(0.11, 0.15), m.integers(0, 3)
    formed(m, "mug", form, r=r, t=tall)
    if m.chance(0.5):
        m.tube(bent([(r - 0.003, 0.86 * tall, 0), (r + 0.038, 0.86 * tall, 0),
            (r + 0.036, 0.2 * tall, 0), (r - 0.003, 0.2 * tall, 0)], 0.02, n=3), 0.005, n=6)
    else:
        m.add(handle(r, tall))
    if m.chance(0.5):
        m.cylinder(r - 0.0075, 0.0135, 0.72 * tall, n=18, of=plain("drink", (0.82, 0.55, 0.12),
            0.1))
        if m.chance(0.6):
            m.cylinder(r - 0.0075, 0.7202 * tall, 0.86 * tall, n=18,
                of=plain("foam", (0.93, 0.9, 0.82), 0.9))


@thing(group="glass")
def glass(m: Maker) -> None:
    """A drinking glass.

    For wine, sparkling wine, cocktails, water, beer, spirits; a carafe, a cut one; empty or not.
    """
    form = m.weighted(0.4, 0.42, 0.08, 0.05, 0.05)
    m.name = "wine_glass" if form == 0 else "tumbler"
    with m.of(materials.CLEAR):
        match form:
            case 0:
                _stemmed(m)
            case 1:
                _tumbler(m)
            case 2:
                _mug(m)
            case 3:  # a carafe, with a ball on it or without
                m.vessel([(0, 0), (0.045, 0), (0.052, 0.03), (0.045, 0.09), (0.022, 0.15),
                    (0.024, 0.2), (0.032, 0.225)], 0.003, n=20)
                if m.chance(0.4):
                    m.revolve([(0.0, 0.19), (0.017, 0.192), (0.019, 0.228), (0.03, 0.25),
                        (0.022, 0.278), (0.0, 0.285)])
            case 4:  # cut, for whisky
                k = m.pick(6, 8, 10, 12)
                m.loft(rings(oval, [(0.07, 0.07, 0), (0.078, 0.078, 0.085), (0.072, 0.072, 0.085),
                    (0.062, 0.062, 0.02)], n=k), sharp=20.0)
