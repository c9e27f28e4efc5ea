"""Chandeliers of the generated catalogue; no effects."""

from __future__ import annotations

from typing import Final

from numpy import cos, pi, sin

from pbrs_farm.core.frames import rotation_y, rotation_z
from pbrs_farm.core.house import Material
from pbrs_farm.dress.thing_materials import (
    BLACK_STEEL,
    BRASS,
    CHROME,
    OPAL,
    WHITE_STEEL,
    glass,
    plain,
)
from pbrs_farm.furnishings.things.catalogued import catalogued
from pbrs_farm.furnishings.things.maker import Maker, Size
from pbrs_farm.geometry.outlines import bent, oval, polar

# fmt: off
# half the width of the light at the end of an arm
_CUP_M: Final = {"candle": 0.034, "ball": 0.05, "shade": 0.065, "bell": 0.055}


def _candle(m: Maker, x: float, y: float, z: float, of: Material) -> None:
    """A drip pan, a candle of card and its bulb: 0.13 m from y up."""
    m.turned([(0.012, 0.0), (0.034, 0.012), (0.032, 0.015), (0.011, 0.008)], n=14, at=(x, y, z),
        of=of)
    m.cylinder(0.01, 0.008, 0.085, n=10, at=(x, y, z), of=plain("candle", (0.9, 0.88, 0.8), 0.6))
    m.revolve([(0.0, 0.0855), (0.008, 0.087), (0.013, 0.1), (0.005, 0.126), (0.0, 0.13)], n=10,
        at=(x, y, z), of=OPAL)


def _cup(m: Maker, x: float, y: float, z: float, of: Material, kind: str) -> None:
    """The light at the end of an arm: a candle, a ball, a shade of cloth or a bell of glass."""
    if kind == "candle":
        _candle(m, x, y, z, of)
        return
    m.frustum((0.02, 0.0), (0.024, 0.022), n=12, at=(x, y, z), of=of)
    match kind:
        case "ball":
            m.sphere((0, 0, 0), 0.05, n=14, at=(x, y + 0.07, z), of=OPAL)
        case "shade":
            m.sphere((0, 0, 0), 0.022, n=8, at=(x, y + 0.05, z), of=OPAL)
            m.revolve([(0.065, 0.025), (0.045, 0.12), (0.043, 0.12), (0.063, 0.025),
                (0.065, 0.025)], n=14, at=(x, y, z), of=plain("shade fabric", (0.88, 0.85, 0.78),
                0.9))
            m.rod(x, (y + 0.03, y + 0.115), z, 0.003, n=5, of=of)
            m.rod((x - 0.046, x + 0.046), y + 0.1, z, 0.002, n=4, of=of)
        case "bell":
            m.sphere((0, 0, 0), 0.022, n=8, at=(x, y + 0.055, z), of=OPAL)
            m.revolve([(0.022, 0.024), (0.045, 0.05), (0.055, 0.12), (0.053, 0.12), (0.043, 0.052),
                (0.022, 0.026), (0.022, 0.024)], at=(x, y, z), of=glass((0.95, 0.96, 0.95), 0.3))


def _hang(m: Maker, low: float, h: float, of: Material) -> None:
    """A rod or a chain from low to the canopy at h."""
    m.turned([(0.025, h - 0.03), (0.06, h - 0.006), (0.06, h)], n=20, of=of)
    if m.chance(0.5):
        m.rod(0.0, (low, h - 0.028), 0.0, 0.006, n=7, of=of)
        return
    n = max(int((h - 0.02 - low) / 0.04), 1)
    step = (h - 0.02 - low) / n
    for k in range(n):
        ring = [(0.009 * cos(t), 0.62 * step * sin(t),
            0.0) for t in (2 * pi * j / 8 for j in range(9))]
        m.tube(ring, 0.0022, n=4, turn=rotation_y(pi / 2 * (k % 2)),
            at=(0.0, low + step * (k + 0.5), 0.0), of=of)


def arms(m: Maker, r: float, h: float, of: Material) -> None:
    """A turned stem with bent arms, in one tier or two."""
    kind, n = m.pick("candle", "candle", "ball", "shade", "bell"), m.pick(4, 6, 6, 8)
    reach, body = r - _CUP_M[kind], 0.6 * h
    m.revolve([(0.0, 0.0), (0.012, 0.01), (0.028, 0.03), (0.012, 0.055), (0.035, 0.1), (0.05, 0.14),
        (0.02, 0.19), (0.012, 0.25 * h + 0.06), (0.022, 0.3 * h + 0.06), (0.01, body), (0.0, body)],
        n=18, of=of)
    tiers = [(n, reach, 0.1)] + ([(max(n // 2, 3), 0.55 * reach,
        0.3 * h)] if h > 0.6 and n < 8 and m.chance(0.6) else [])
    for count, far, y in tiers:
        for k in range(count):
            a = 2 * pi * (k + 0.5 * (y > 0.11)) / count
            x, z = far * cos(a), far * sin(a)
            m.tube(bent([polar(0.2 * 0.1, y + 0.03, a), (0.45 * x, y - 0.06, 0.45 * z),
                (x, y - 0.03, z), (x, y + 0.05, z)], 0.09, n=3), 0.006, n=6, of=of)
            _cup(m, x, y + 0.048, z, of, kind)
    _hang(m, body - 0.01, h, of)


def wheel(m: Maker, r: float, h: float, of: Material) -> None:
    """A ring, of wood or metal, on three wires, candles round it."""
    q, kind, n = r - 0.05, m.pick("candle", "candle", "ball", "bell"), m.integers(6, 11)
    rim = m.pick(of, m.timber, m.dark_timber)
    m.ring((q - 0.02, q + 0.02), (0.0, 0.045), n=40, of=rim)
    if m.chance(0.5):
        for k in range(2):
            turn = rotation_y(pi / 2 * k)
            m.rod((-q, q), 0.022, 0.0, 0.011, turn=turn, of=rim)
    for k in range(n):
        a = 2 * pi * (k + 0.5) / n
        _cup(m, q * cos(a), 0.0445, q * sin(a), of, kind)
    top = 0.78 * h
    for k in range(3):
        a = 2 * pi * k / 3
        m.tube([polar(q, 0.04, a), (0.0, top, 0.0)], 0.004, n=6, of=of)
    m.sphere((0.0, top, 0.0), 0.018, n=10, of=of)
    _hang(m, top, h, of)


def crystal(m: Maker, r: float, h: float, of: Material) -> None:
    """Rings of glass drops round the bulbs, each ring smaller than that above."""
    drop = glass((0.97, 0.98, 1.0), 0.35)
    n_rings, top = m.integers(2, 5), 0.68 * h
    shape = m.pick("drops", "rods", "beads")
    for j in range(n_rings):
        q = (r - 0.014) * (1.0 - 0.24 * j)
        y = top - 0.05 - (0.5 * top / n_rings) * j
        m.hoop(oval(2 * q, 2 * q, n=30), y, 0.006, n=5, of=of)
        if j == 0:
            for k in range(4):
                a = pi / 2 * k
                m.tube([polar(q, y, a), (0.0, top, 0.0)], 0.004, n=5, of=of)
        else:
            m.rod((-q, q), y, 0.0, 0.004, n=5, of=of)
        n = max(int(2 * pi * q / 0.07), 8)
        long = min(y - 0.006, 0.5 * top / n_rings + 0.06) if j < n_rings - 1 else y - 0.002
        for k in range(n):
            a = 2 * pi * k / n
            position = polar(q, y - long, a)
            if shape == "rods":
                m.cylinder(0.007, 0.0, long - 0.004, n=5, at=position, of=drop)
            elif shape == "beads":
                for i in range(2):
                    m.sphere((0, 0, 0), 0.012, n=5, at=(position[0], y - long * (0.35 + 0.5 * i),
                        position[2]), of=drop)
                m.rod(position[0], (y, y - long * 0.95), position[2], 0.0015, n=3, of=of)
            else:
                m.revolve([(0.0, 0.0), (0.011, 0.22 * long), (0.002, long - 0.004),
                    (0.0, long - 0.004)], n=6, at=position, of=drop)
    m.rod(0.0, (0.45 * top, top + 0.01), 0.0, 0.01, of=of)
    for k in range(4):
        a = pi / 2 * k + 0.4
        m.tube([(0.0, 0.6 * top, 0.0), polar(0.3 * r, 0.6 * top, a)], 0.005, n=6, of=of)
        m.sphere((0, 0, 0), 0.025, n=10, at=polar(0.3 * r, 0.6 * top, a), of=OPAL)
    _hang(m, top, h, of)


def sputnik(m: Maker, r: float, h: float, of: Material) -> None:
    """Straight arms in every direction from a ball, a bulb on each."""
    n, size = m.integers(12, 19), m.pick(0.022, 0.03, 0.04)
    far = r - size
    middle = min(far, 0.42 * h) + size
    high = min(far, middle - size)
    m.sphere((0.0, middle, 0.0), 0.055, of=of)
    for k in range(n):
        # Directions spread evenly over the ball: the spiral of Fibonacci.
        y = 1 - 2 * (k + 0.5) / n
        ring, a = (1 - y * y) ** 0.5, 2.39996 * k
        end = polar(far * ring, middle + high * y, a)
        if y > 0.88:
            continue
        m.tube([(0.0, middle, 0.0), end], 0.005, n=6, of=of)
        m.sphere((0, 0, 0), size, n=10, at=end, of=OPAL)
    _hang(m, middle + 0.05, h, of)


def branches(m: Maker, r: float, h: float, of: Material) -> None:
    """Level bars across each other at several heights, balls at their ends."""
    n, far = m.integers(2, 5), r - 0.05
    ball = m.pick(OPAL, OPAL, glass((0.9, 0.92, 0.9), 0.3))
    for k in range(n):
        y = 0.06 + k * min(0.09, 0.4 * h / n)
        turn = rotation_y(pi * k / n)
        m.rod((-far, far), y, 0.0, 0.006, n=7, turn=turn, of=of)
        for x in (-far, far):
            with m.moved(turn=turn):
                m.frustum((0.012, 0.0), (0.018, 0.02), n=10,
                    turn=rotation_z(pi / 2 if x < 0 else -pi / 2),
                    at=(x - (0.02 if x > 0 else -0.02), y, 0.0), of=of)
                m.sphere((x, y, 0.0), 0.05, n=14, of=ball)
                if ball is not OPAL:
                    m.sphere((x, y, 0.0), 0.02, n=8, of=OPAL)
    top = 0.06 + (n - 1) * min(0.09, 0.4 * h / n)
    m.rod(0.0, (0.03, top + 0.05), 0.0, 0.012, n=10, of=of)
    _hang(m, top + 0.045, h, of)


def lantern(m: Maker, r: float, h: float, of: Material) -> None:
    """A cage of bars round a cluster of candles."""
    n, top, q = m.pick(4, 6, 8), 0.72 * h, r - 0.008
    waist = m.pick(1.0, 0.75, 0.6)
    for y, size in ((0.008, waist), (0.62 * top, 1.0), (top - 0.02, 0.3)):
        m.hoop(oval(2 * q * size, 2 * q * size, n=n, power=2.0), y, 0.007, n=5, of=of)
    for k in range(n):
        a = 2 * pi * (k + 0.5) / n
        way = [polar(waist * q, 0.008, a), polar(q, 0.62 * top, a), polar(0.3 * q, top - 0.02, a),
            (0.0, top, 0.0)]
        m.tube([(float(x), y, float(z)) for x, y, z in way], 0.006, n=6, of=of)
    m.rod(0.0, (0.2 * top, top + 0.005), 0.0, 0.006, n=7, of=of)
    for k in range(m.integers(3, 5)):
        a = 2 * pi * k / 4
        x, z = 0.32 * r * cos(a), 0.32 * r * sin(a)
        m.tube(bent([(0.0, 0.24 * top, 0.0), (0.7 * x, 0.2 * top, 0.7 * z), (x, 0.24 * top, z),
            (x, 0.28 * top, z)], 0.02, n=2), 0.004, n=6, of=of)
        _candle(m, x, 0.275 * top, z, of)
    _hang(m, top, h, of)


def rods(m: Maker, r: float, h: float, of: Material) -> None:
    """Tubes of light in a bundle or a fan of rings."""
    if m.chance(0.5):
        top = 0.6 * h
        for j in range(m.integers(2, 4)):
            q, y = (r - 0.014) * (1.0 - 0.3 * j), 0.014 + 0.17 * j * h
            m.hoop(oval(2 * q, 2 * q, n=40), y, 0.012, n=7, of=of)
            m.hoop(oval(2 * q - 0.018, 2 * q - 0.018, n=40), y - 0.002, 0.009, of=OPAL)
            for k in range(3):
                a = 2 * pi * k / 3 + 0.3 * j
                m.tube([polar(q, y, a), (0.0, top + 0.02, 0.0)], 0.0015, n=4, of=of)
        _hang(m, top, h, of)
        return
    n, top = m.integers(7, 13), 0.66 * h
    m.cylinder(r, top, top + 0.03, n=36, of=of)
    for k in range(n):
        a, share = 2.39996 * k, ((k + 0.5) / n) ** 0.5
        x, z = (r - 0.03) * share * cos(a), (r - 0.03) * share * sin(a)
        low = 0.0 if k == 0 else m.uniform(0.0, 0.45 * top)
        m.cylinder(0.02, low, top - 0.05, n=10, at=(x, 0.0, z), of=OPAL)
        m.cylinder(0.022, top - 0.05, top + 0.002, n=10, at=(x, 0.0, z), of=of)
    _hang(m, top + 0.025, h, of)


_KINDS = (arms, arms, wheel, crystal, sputnik, branches, lantern, rods)


@catalogued()
def chandelier(m: Maker, size: Size) -> None:
    """A chandelier.

    Bent arms in tiers, a wheel, rings of crystal, a star of arms, crossed bars, a cage, rods of light.
    """
    w, _d, h = size
    of = m.pick(BRASS, BRASS, BLACK_STEEL, m.metal, CHROME, WHITE_STEEL)
    m.pick(*_KINDS)(m, w / 2, h, of)
