"""Bottles, soap, brushes: what stands by a basin; no effects."""

from __future__ import annotations

import numpy as np

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.frames import rotation_y
from pbrs_farm.dress.generated.assembly import Made, Part, any_colour, made, plain, transformed
from pbrs_farm.dress.generated.tableware import china
from pbrs_farm.dress.generated.turned import bulged, slab, turned, vessel
from pbrs_farm.dress.style import Rgb, Style


def toiletries(rng: np.random.Generator, style: Style) -> Made:
    """One to four bottles of shampoo, cream and scent."""
    parts: list[Part] = []
    x = 0.0
    for _ in range(int(rng.integers(1, 5))):
        # Bottles stand in a row along x, 8 mm apart; x is the row's end so far.
        r, tall = float(rng.uniform(0.018, 0.036)), float(rng.uniform(0.06, 0.21))
        x += r
        at = (x, 0.0, float(rng.uniform(-0.02, 0.02)))
        # Profiles are (radius, height); the cap begins just above, so no faces coincide.
        body = turned(
            [
                (0, 0),
                (r, 0),
                (r, tall * 0.78),
                (r * 0.5, tall * 0.84),
                (r * 0.5, tall * 0.84),
                (0, tall * 0.84),
            ],
            n=14,
        )
        cap = turned(
            [(0, tall * 0.8402), (r * 0.55, tall * 0.8402), (r * 0.55, tall), (0, tall)], n=12
        )
        white: Rgb = (0.9, 0.9, 0.88)
        parts.append(
            (transformed(body, np.eye(3), at), plain("bottle", any_colour(rng, style), 0.3))
        )
        parts.append(
            (
                transformed(cap, np.eye(3), at),
                plain("cap", white if rng.random() < 0.6 else (0.1, 0.1, 0.1), 0.35),
            )
        )
        x += r + 0.008
    return made("toiletries", parts, group="bath_small")


def soap_dispenser(rng: np.random.Generator, style: Style) -> Made:
    """A soap dispenser with a pump."""
    r, tall = 0.034, 0.13
    # (radius, height): the bottle, then the stem and the nose of its pump above it, 0.2 mm apart.
    body = turned(
        [(0, 0), (r, 0), (r, tall), (0.014, tall + 0.012), (0.014, tall + 0.02), (0, tall + 0.02)]
    )
    stem = turned(
        [(0, tall + 0.0202), (0.005, tall + 0.0202), (0.005, tall + 0.045), (0, tall + 0.045)], n=8
    )
    nose = slab((-0.008, tall + 0.0452, -0.008), (0.008, tall + 0.055, 0.045))
    pump = plain("pump", (0.75, 0.75, 0.75), 0.2)
    return made(
        "soap_dispenser",
        [(body, china(rng, style)), (stem, pump), (nose, pump)],
        group="bath_small",
    )


def brush_cup(rng: np.random.Generator, style: Style) -> Made:
    """A cup with toothbrushes."""
    cup = vessel([(0, 0), (0.035, 0), (0.037, 0.1)], 0.003)
    parts: list[Part] = [(cup, china(rng, style))]
    for k in range(int(rng.integers(1, 4))):
        # Lean each brush outwards by 0.16 rad, then turn it 120 degrees on from the one before.
        tilt = 0.16
        c, s = np.cos(tilt), np.sin(tilt)
        lean: F64 = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1.0]])
        stick = slab((-0.004, 0, -0.003), (0.004, 0.17, 0.003))
        head = slab((-0.006, 0.17, -0.004), (0.006, 0.19, 0.01))
        turn = rotation_y(float(2.1 * k + rng.uniform(0, 0.5)))
        tint = tuple(float(v) for v in rng.uniform(0.2, 0.9, 3))
        for part in (stick, head):
            moved = transformed(transformed(part, lean, (0.004, 0.0045, 0)), turn)
            parts.append((moved, plain("brush", (tint[0], tint[1], tint[2]), 0.4)))
    return made("brush_cup", parts, group="bath_small")


def soap_bar(rng: np.random.Generator, style: Style) -> Made:
    """A bar of soap on a dish."""
    # (radius, height): a shallow dish, its rim 15 mm high and its floor 5 mm thick.
    dish = turned(
        [(0, 0), (0.04, 0), (0.058, 0.014), (0.055, 0.015), (0.038, 0.005), (0, 0.005)], n=18
    )
    bar = transformed(
        bulged((0.08, 0.026, 0.052), n=6, edge=0.5, bulge=4.0), np.eye(3), (0, 0.0185, 0)
    )
    soap: Rgb = ((0.9, 0.86, 0.74), (0.75, 0.85, 0.72), (0.88, 0.74, 0.74))[int(rng.integers(3))]
    return made(
        "soap_bar", [(dish, china(rng, style)), (bar, plain("soap", soap, 0.4))], group="bath_small"
    )


def spray_bottle(rng: np.random.Generator, style: Style) -> Made:
    """A spray bottle of cleaner."""
    # (radius, height) of the bottle; head and trigger are boxes that point along +z.
    body = turned([(0, 0), (0.038, 0), (0.038, 0.14), (0.014, 0.19), (0.014, 0.2), (0, 0.2)], n=14)
    head = slab((-0.012, 0.2002, -0.025), (0.012, 0.232, 0.05))
    trigger = slab((-0.005, 0.15, 0.03), (0.005, 0.2001, 0.038))
    white = plain("spray head", (0.9, 0.9, 0.9), 0.4)
    return made(
        "spray_bottle",
        [(body, plain("bottle", any_colour(rng, style), 0.25)), (head, white), (trigger, white)],
        group="bath_small",
    )


def sponge(rng: np.random.Generator, style: Style) -> Made:
    """A kitchen sponge."""
    # Foam below, 22 mm, and the scouring layer, 9 mm, on it.
    low = slab((-0.045, 0, -0.03), (0.045, 0.022, 0.03))
    top = slab((-0.045, 0.022, -0.03), (0.045, 0.031, 0.03))
    return made(
        "sponge",
        [
            (low, plain("sponge", (0.88, 0.76, 0.25), 0.95)),
            (top, plain("scour", (0.15, 0.35, 0.2), 0.95)),
        ],
        group="bath_small",
    )
