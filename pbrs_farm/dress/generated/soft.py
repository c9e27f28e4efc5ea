"""Cushions, blankets, towels: closed bodies of cloth; no effects."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pbrs_farm.core.classes import CLOTHES, PAPER, PILLOW, TOWEL
from pbrs_farm.dress.generated.assembly import Made, Part, made, plain, transformed
from pbrs_farm.dress.generated.turned import bulged, turned
from pbrs_farm.dress.style import Rgb, Style, mix, shade


def cushion(rng: np.random.Generator, style: Style) -> Made:
    """A square cushion for a sofa or a bed, lying flat."""
    # Shop sizes, metres; three in ten are of the style's accent colour.
    edge = float(rng.choice([0.38, 0.42, 0.46]))
    colour = style.textiles[int(rng.integers(len(style.textiles)))]
    if rng.random() < 0.3:
        colour = style.accent
    thick = float(rng.uniform(0.11, 0.15))
    material = plain("cushion", colour, 0.95)
    return made("cushion", [(bulged((edge, thick, edge)), material)], group="pillow", nyu40=PILLOW)


def bed_pillow(rng: np.random.Generator, style: Style) -> Made:
    """A pillow to sleep on, its long side across the bed."""
    # A long pillow (0.68 x 0.46 m) or a square one, white or nearly so.
    wide, deep = (0.68, 0.46) if rng.random() < 0.6 else (0.58, 0.58)
    colour: Rgb = (0.91, 0.9, 0.88)
    # Bed linen is of calm colours, washed pale.
    if rng.random() < 0.4:
        colour = mix(colour, style.textiles[int(rng.integers(min(3, len(style.textiles))))], 0.35)
    surface = bulged((wide, float(rng.uniform(0.12, 0.16)), deep), bulge=2.6)
    material = plain("pillow", colour, 0.95)
    return made("pillow", [(surface, material)], group="pillow", nyu40=PILLOW)


def folded(
    rng: np.random.Generator, size: tuple[float, float, float], n: int, colour: Rgb, name: str
) -> list[Part]:
    """n layers of folded cloth (width, one layer's height, depth) on top of each other."""
    parts: list[Part] = []
    w, h, d = size
    for k in range(n):
        layer = bulged((w, h, d), n=5, edge=0.55, bulge=5.0)
        # Leave a gap of half a per cent between layers, and shift each by a few millimetres.
        shift = (float(rng.normal(0, 0.003)), h / 2 + k * h * 1.005, float(rng.normal(0, 0.003)))
        tone = shade(colour, 1.0 - 0.03 * (k % 2))
        parts.append((transformed(layer, np.eye(3), shift), plain(name, tone, 0.95)))
    return parts


def folded_towels(rng: np.random.Generator, style: Style) -> Made:
    """A pile of folded towels."""
    parts: list[Part] = []
    y = 0.0
    for _ in range(int(rng.integers(1, 5))):
        colour = style.textiles[int(rng.integers(len(style.textiles)))]
        # Most homes own towels of one colour family, bleached to different degrees.
        colour = mix(colour, (0.92, 0.91, 0.89), float(rng.choice([0.0, 0.3, 0.8])))
        for surface, material in folded(rng, (0.3, 0.025, 0.2), 2, colour, "towel"):
            parts.append((transformed(surface, np.eye(3), (0, y, 0)), material))
        # Two layers of 25 mm and the gaps between them.
        y += 0.0505
    return made("folded_towels", parts, group="towel", nyu40=TOWEL)


def folded_blanket(rng: np.random.Generator, style: Style) -> Made:
    """A folded blanket."""
    colour = style.textiles[int(rng.integers(len(style.textiles)))]
    parts = folded(rng, (0.42, 0.03, 0.32), int(rng.integers(2, 4)), colour, "blanket")
    return made("folded_blanket", parts, group="blanket")


def folded_clothes(rng: np.random.Generator, style: Style) -> Made:
    """A pile of folded shirts and jumpers."""
    parts: list[Part] = []
    y = 0.0
    for _ in range(int(rng.integers(2, 6))):
        # Any tint, drawn towards the style so that no pile stands out.
        tint = tuple(float(v) for v in rng.uniform(0.15, 0.85, 3))
        colour = mix((tint[0], tint[1], tint[2]), style.textiles[0], 0.4)
        h = float(rng.uniform(0.02, 0.035))
        for surface, material in folded(rng, (0.28, h, 0.22), 1, colour, "clothes"):
            parts.append((transformed(surface, np.eye(3), (0, y, 0)), material))
        y += h * 1.01
    return made("folded_clothes", parts, group="clothes", nyu40=CLOTHES)


def toilet_rolls(rng: np.random.Generator, style: Style) -> Made:
    """One to three rolls of paper on end."""
    parts: list[Part] = []
    white = plain("tissue", (0.93, 0.93, 0.92), 0.95)
    for k in range(int(rng.integers(1, 4))):
        # (radius, height): a tube of 20 mm inner radius, closed onto itself.
        roll = turned([(0.02, 0), (0.054, 0), (0.054, 0.098), (0.02, 0.098), (0.02, 0)], n=18)
        parts.append((transformed(roll, np.eye(3), (0, 0.0985 * k, 0)), white))
    return made("toilet_rolls", parts, group="toilet_paper", nyu40=PAPER)


def kitchen_roll(rng: np.random.Generator, style: Style) -> Made:
    """A roll of kitchen paper."""
    # (radius, height): the paper, and the cardboard core 2 mm above it.
    roll = turned(
        [(0, 0), (0.055, 0), (0.055, 0.23), (0.02, 0.23), (0.02, 0.232), (0, 0.232)], n=18
    )
    part = (replace(roll, name="roll"), plain("tissue", (0.92, 0.92, 0.9), 0.95))
    return made("kitchen_roll", [part], group="kitchen_tool", nyu40=PAPER)
