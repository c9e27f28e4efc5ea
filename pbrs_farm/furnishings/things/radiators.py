"""Radiators: on the floor of the catalogue, on walls; no effects."""

from __future__ import annotations

from numpy import pi

from pbrs_farm.core.catalogue import Place
from pbrs_farm.core.classes import OTHERFURNITURE
from pbrs_farm.core.frames import LYING_ALONG_X, LYING_ALONG_Z, rotation_z
from pbrs_farm.core.house import Material
from pbrs_farm.furnishings.things.bodies import bevelled, cylinder, revolve, rounded, slab, tube
from pbrs_farm.furnishings.things.maker import Maker, Size, family, thing
from pbrs_farm.furnishings.things.materials import CHROME, RUBBER, WHITE_STEEL, glossy, plain
from pbrs_farm.furnishings.things.outlines import bent


@thing(group="radiator", place=Place.WALL)
def towel_radiator(m: Maker) -> None:
    """A ladder of tubes that towels are dried on, in groups with gaps between."""
    w, h = m.uniform(0.42, 0.56), m.uniform(0.9, 1.3)
    with m.of(plain("towel radiator", (0.12, 0.12, 0.13) if m.chance(0.2) else (0.92, 0.92, 0.91),
        0.3)):  # fmt: skip
        for x in (-(w / 2 - 0.015), w / 2 - 0.015):
            m.add(cylinder(0.015, 0.0, h, n=12), at=(x, 0.0, 0.06))
            for y in (0.1, h - 0.1):
                m.add(cylinder(0.008, 0.0, 0.048, n=10), turn=LYING_ALONG_Z, at=(x, y, 0.0))
        # Five tubes, then room for a towel.
        y = 0.05
        while y < h - 0.03:
            for _k in range(5):
                if y < h - 0.02:
                    m.add(cylinder(0.011, 0.0, w - 0.03, n=10), turn=LYING_ALONG_X,
                        at=(-w / 2 + 0.015, y, 0.068))  # fmt: skip
                y += 0.04
            y += 0.06


@thing(group="radiator", called="panel_radiator", nyu40=OTHERFURNITURE, place=Place.WALL)
def wall_radiator(m: Maker, width: float, height: float, paint: Material) -> None:
    """A painted panel with ribs, a grille on top and a white valve; hung by two brackets."""
    front, back, half = 0.11, 0.035, width / 2
    n = max(4, round(width / 0.04))
    step = width / n
    with m.of(paint):
        m.add(slab((-half, 0.0, back), (half, height, front - 0.008)))
        # Ribs are pressed into the front, 4 cm apart.
        for k in range(n):
            x = -half + (k + 0.5) * step
            m.add(slab((x - 0.3 * step, 0.02, front - 0.008),
                (x + 0.3 * step, height - 0.03, front)))  # fmt: skip
        for x in (-half + 0.1, half - 0.1):
            m.add(slab((x - 0.015, 0.1, 0.0), (x + 0.015, height - 0.1, back)))
    for k in range(max(3, round(width / 0.06))):
        x = -half + 0.03 + k * 0.06
        if x + 0.045 < half:
            m.add(slab((x, height, back + 0.01), (x + 0.045, height + 0.002, front - 0.02)),
                of=plain("radiator grille", (0.55, 0.55, 0.54), 0.6))  # fmt: skip
    m.add(slab((half, height - 0.07, 0.05), (half + 0.05, height - 0.03, 0.09)),
        of=plain("radiator valve", (0.9, 0.9, 0.89), 0.4))  # fmt: skip


@family(group="radiator", nyu40=OTHERFURNITURE, place=Place.WALL, called="radiator", variants=28,
    size=lambda m: (m.pick(0.6, 0.8, 1.0, 1.2, 1.4), m.pick(0.07, 0.09, 0.11, 0.13),
    m.pick(0.45, 0.5, 0.6, 0.6)))  # fmt: skip
def panel_radiator(m: Maker, size: Size) -> None:
    """A radiator.

    A panel with grooves, a flat one, columns of tubes, a low convector, an upright one.
    """
    w, d, h = size
    hw = w / 2
    material, form = (m.pick(WHITE_STEEL, WHITE_STEEL, glossy("grey", (0.35, 0.36, 0.37), 0.4)),
        m.weighted(0.35, 0.2, 0.3, 0.15))  # fmt: skip
    z0 = 0.025
    with m.of(material):
        match form:
            case 0:  # with grooves
                m.add(bevelled((-hw + 0.004, 0.01, z0), (hw - 0.004, h - 0.02, d - 0.006), 0.004))
                n = max(6, round(w / 0.05))
                for k in range(n):
                    m.add(bevelled((-hw + 0.02 + (w - 0.04) * (k + 0.2) / n, 0.03, d - 0.008),
                        (-hw + 0.02 + (w - 0.04) * (k + 0.8) / n, h - 0.05, d), 0.003))  # fmt: skip
                m.add(bevelled((-hw, h - 0.022, z0 - 0.003), (hw, h, d - 0.004), 0.002))
                for x in (-hw, hw - 0.006):
                    m.add(slab((x, 0.02, z0), (x + 0.006, h - 0.022, d - 0.01)))
            case 1:  # flat
                m.add(bevelled((-hw, 0.0, z0), (hw, h, d), 0.006))
                for k in range(round(w / 0.03)):
                    m.add(slab((-hw + 0.02 + k * (w - 0.04) / round(w / 0.03), h - 0.001,
                        z0 + 0.012), (-hw + 0.03 + k * (w - 0.04) / round(w / 0.03), h + 0.0005,
                        d - 0.012)), of=RUBBER)  # fmt: skip
            case 2:  # columns of tubes
                n, r = max(6, round(w / 0.075)), 0.016
                for k in range(n):
                    x = -hw + w * (k + 0.5) / n
                    for z in (z0 + r, d - r):
                        m.add(tube([(x, 0.03, z), (x, h - 0.03, z)], r, n=6))
                for y in (0.0, h - 0.05):
                    m.add(rounded((-hw, y, z0), (hw, y + 0.05, d), 0.02, n=1))
            case 3:  # flat, with level grooves
                m.add(bevelled((-hw, 0.0, z0), (hw, h, d), 0.004))
                for k in range(7):
                    m.add(bevelled((-hw + 0.01, 0.03 + (h - 0.06) * k / 7, d - 0.001), (hw - 0.01,
                        0.03 + (h - 0.06) * (k + 0.7) / 7, d + 0.006), 0.002))  # fmt: skip
        for x in (-0.3 * w, 0.3 * w):
            m.add(slab((x - 0.015, 0.25 * h, 0.0), (x + 0.015, 0.7 * h, z0 + 0.001)))
    m.add(tube(bent([(hw - 0.04, 0.06, z0 + 0.02), (hw - 0.012, 0.06, z0 + 0.02),
        (hw - 0.012, 0.06, 0.002)], 0.01, n=2), 0.008, n=7), of=CHROME)  # fmt: skip
    m.add(revolve([(0.0, 0.0), (0.02, 0.0), (0.022, 0.03), (0.016, 0.05), (0.0, 0.05)], n=12),
        turn=rotation_z(-pi / 2), at=(hw - 0.05, 0.09 if form < 2 else h - 0.09, d - 0.022),
        of=WHITE_STEEL)  # fmt: skip
