"""Radiators: on the floor of the catalogue, on walls; no effects."""

from __future__ import annotations

from numpy import pi

from pbrs_farm.core.catalogue import Place
from pbrs_farm.core.classes import OTHERFURNITURE
from pbrs_farm.core.frames import LYING_ALONG_X, rotation_z
from pbrs_farm.core.house import Material
from pbrs_farm.dress.thing_materials import CHROME, RUBBER, WHITE_STEEL, glossy, plain
from pbrs_farm.furnishings.things.catalogued import catalogued
from pbrs_farm.furnishings.things.maker import Maker, Size, thing
from pbrs_farm.geometry.outlines import bent


# fmt: off
@thing(group="radiator", place=Place.WALL)
def towel_radiator(m: Maker) -> None:
    """A ladder of tubes that towels are dried on, in groups with gaps between."""
    w, h = m.uniform(0.42, 0.56), m.uniform(0.9, 1.3)
    with m.of(plain("towel radiator", (0.12, 0.12, 0.13) if m.chance(0.2) else (0.92, 0.92, 0.91),
        0.3)):
        for x in (-(w / 2 - 0.015), w / 2 - 0.015):
            m.cylinder(0.015, 0.0, h, n=12, at=(x, 0.0, 0.06))
            for y in (0.1, h - 0.1):
                m.cylinder(0.008, 0.0, 0.048, n=10, front=(x, y, 0.0))
        # Five tubes, then room for a towel.
        y = 0.05
        while y < h - 0.03:
            for _k in range(5):
                if y < h - 0.02:
                    m.cylinder(0.011, 0.0, w - 0.03, n=10, turn=LYING_ALONG_X,
                        at=(-w / 2 + 0.015, y, 0.068))
                y += 0.04
            y += 0.06


@thing(group="radiator", called="panel_radiator", nyu40=OTHERFURNITURE, place=Place.WALL)
def wall_radiator(m: Maker, width: float, height: float, paint: Material) -> None:
    """A painted panel with ribs, a grille on top and a white valve; hung by two brackets."""
    front, back, half = 0.11, 0.035, width / 2
    n = max(4, round(width / 0.04))
    step = width / n
    with m.of(paint):
        m.box(2 * half, height, (back, front - 0.008))
        # Ribs are pressed into the front, 4 cm apart.
        for k in range(n):
            x = -half + (k + 0.5) * step
            m.box(0.6 * step, (0.02, height - 0.03), (front - 0.008, front), x=x)
        m.box(0.03, (0.1, height - 0.1), (0.0, back), left=0.085 - half, mirrored="x")
    for k in range(max(3, round(width / 0.06))):
        x = -half + 0.03 + k * 0.06
        if x + 0.045 < half:
            m.box(0.045, 0.002, (back + 0.01, front - 0.02), left=x, on=height,
                of=plain("radiator grille", (0.55, 0.55, 0.54), 0.6))
    m.box(0.05, 0.04, (0.05, 0.09), left=half, on=height - 0.07,
        of=plain("radiator valve", (0.9, 0.9, 0.89), 0.4))


@catalogued()
def panel_radiator(m: Maker, size: Size) -> None:
    """A radiator.

    A panel with grooves, a flat one, columns of tubes, a low convector, an upright one.
    """
    w, d, h = size
    hw = w / 2
    material, form = (m.pick(WHITE_STEEL, WHITE_STEEL, glossy("grey", (0.35, 0.36, 0.37), 0.4)),
        m.weighted(0.35, 0.2, 0.3, 0.15))
    z0 = 0.025
    with m.of(material):
        match form:
            case 0:  # with grooves
                m.box(w - 0.008, (0.01, h - 0.02), (z0, d - 0.006), 0.004)
                n = max(6, round(w / 0.05))
                for k in range(n):
                    m.box((-hw + 0.02 + (w - 0.04) * (k + 0.2) / n,
                        -hw + 0.02 + (w - 0.04) * (k + 0.8) / n), (0.03, h - 0.05), (d - 0.008, d),
                        0.003)
                m.box(w, (h - 0.022, h), (z0 - 0.003, d - 0.004), 0.002)
                m.box(0.006, (0.02, h - 0.022), (z0, d - 0.01), left=-w / 2, mirrored="x")
            case 1:  # flat
                m.box(w, h, (z0, d), 0.006)
                for k in range(round(w / 0.03)):
                    m.box(0.01, 0.0015, (z0 + 0.012, d - 0.012),
                        left=-hw + 0.02 + k * (w - 0.04) / round(w / 0.03), on=h - 0.001, of=RUBBER)
            case 2:  # columns of tubes
                n, r = max(6, round(w / 0.075)), 0.016
                for k in range(n):
                    x = -hw + w * (k + 0.5) / n
                    for z in (z0 + r, d - r):
                        m.rod(x, (0.03, h - 0.03), z, r, n=6)
                for y in (0.0, h - 0.05):
                    m.rounded(w, 0.05, (z0, d), 0.02, n=1, on=y)
            case 3:  # flat, with level grooves
                m.box(w, h, (z0, d), 0.004)
                for k in range(7):
                    m.box(w - 0.02, (0.03 + (h - 0.06) * k / 7, 0.03 + (h - 0.06) * (k + 0.7) / 7),
                        0.007, 0.002, against=d - 0.001)
        m.box(0.03, (0.25 * h, 0.7 * h), (0.0, z0 + 0.001), x=-0.3 * w, mirrored="x")
    m.tube(bent([(hw - 0.04, 0.06, z0 + 0.02), (hw - 0.012, 0.06, z0 + 0.02),
        (hw - 0.012, 0.06, 0.002)], 0.01, n=2), 0.008, n=7, of=CHROME)
    m.turned([(0.02, 0.0), (0.022, 0.03), (0.016, 0.05)], n=12, turn=rotation_z(-pi / 2),
        at=(hw - 0.05, 0.09 if form < 2 else h - 0.09, d - 0.022), of=WHITE_STEEL)
