"""What stands on floors: laundry baskets, suitcases, poufs, stools; no effects."""

from __future__ import annotations

import numpy as np

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.catalogue import Place
from pbrs_farm.core.classes import BAG, CHAIR
from pbrs_farm.core.house import Surface
from pbrs_farm.dress.generated.assembly import (
    Made,
    Part,
    any_colour,
    made,
    metal,
    plain,
    transformed,
)
from pbrs_farm.dress.generated.turned import bulged, slab, smooth, turned, vessel
from pbrs_farm.dress.style import Rgb, Style, mix


def laundry_basket(rng: np.random.Generator, style: Style) -> Made:
    """A tall basket with clothes that show at its rim."""
    tall, r = float(rng.uniform(0.45, 0.62)), float(rng.uniform(0.17, 0.22))
    weave = mix((0.68, 0.54, 0.37), style.textiles[0], float(rng.choice([0.0, 0.6, 0.9])))
    outside = [(0, 0), (r * 0.86, 0), (r * 0.93, tall * 0.3), (r, tall * 0.8), (r * 0.99, tall)]
    parts: list[Part] = [(vessel(outside, 0.012, n=24), plain("wicker", weave, 0.9))]
    for _ in range(2):
        heap = bulged((1.25 * r, float(rng.uniform(0.08, 0.13)), 1.2 * r), n=8)
        at = (float(rng.uniform(-0.15, 0.15)) * r, tall - 0.03, float(rng.uniform(-0.15, 0.15)) * r)
        parts.append(
            (transformed(heap, np.eye(3), at), plain("cloth", any_colour(rng, style), 0.95))
        )
    return made("laundry_basket", parts, group="basket")


def suitcase(rng: np.random.Generator, style: Style) -> Made:
    """A suitcase that stands on its wheels."""
    w, h, d = (float(v) for v in rng.uniform((0.38, 0.52, 0.2), (0.5, 0.7, 0.28)))
    usual: tuple[Rgb, ...] = ((0.08, 0.08, 0.09), (0.12, 0.16, 0.25), (0.3, 0.3, 0.31))
    colour = usual[int(rng.integers(3))] if rng.random() < 0.6 else any_colour(rng, style)
    shell, black = plain("suitcase", colour, 0.45), plain("rubber", (0.05, 0.05, 0.05), 0.7)
    parts: list[Part] = [(slab((-w / 2, 0.04, -d / 2), (w / 2, h, d / 2)), shell)]
    # Ribs along the front, a handle, four wheels.
    for x in np.linspace(-0.38, 0.38, 5) * w:
        rib = slab((x - 0.012, 0.07, d / 2), (x + 0.012, h - 0.04, d / 2 + 0.006))
        parts.append((rib, shell))
    for x in (-0.06, 0.05):
        parts.append((slab((x, h, -0.012), (x + 0.012, h + 0.035, 0.012)), metal(style)))
    parts.append((slab((-0.06, h + 0.035, -0.014), (0.062, h + 0.05, 0.014)), black))
    for x in (-w / 2 + 0.03, w / 2 - 0.05):
        for z in (-d / 2 + 0.01, d / 2 - 0.03):
            parts.append((slab((x, 0.0, z), (x + 0.02, 0.04, z + 0.02)), black))
    return made("suitcase", parts, group="bag", nyu40=BAG)


def pouf(rng: np.random.Generator, style: Style) -> Made:
    """A round seat of cloth, as high as a knee at most."""
    r, tall = float(rng.uniform(0.2, 0.29)), float(rng.uniform(0.28, 0.4))
    colour = style.textiles[int(rng.integers(len(style.textiles)))]
    profile = [
        (0, 0), (r * 0.86, 0), (r * 0.97, tall * 0.15), (r, tall * 0.5), (r * 0.96, tall * 0.85),
        (r * 0.84, tall * 0.97), (r * 0.5, tall), (0, tall),
    ]  # fmt: skip
    return made("pouf", [(turned(profile, n=28), plain("pouf", colour, 0.95))], group="ottoman")


def stool(rng: np.random.Generator, style: Style) -> Made:
    """A round seat of wood on three or four legs that lean outwards."""
    r, tall = float(rng.uniform(0.15, 0.19)), float(rng.uniform(0.42, 0.5))
    white = plain("stool white", (0.88, 0.88, 0.86), 0.4)
    wood = plain(f"stool {style.wood.name}", style.wood.mean, 0.45)
    seat = turned(
        [(0, 0), (r - 0.006, 0), (r, 0.008), (r, 0.022), (r - 0.006, 0.03), (0, 0.03)], n=28
    )
    parts: list[Part] = [(transformed(seat, np.eye(3), (0, tall - 0.03, 0)), wood)]
    leg, n = turned([(0, 0), (0.013, 0), (0.018, 1.0), (0, 1.0)], n=12), int(rng.integers(3, 5))
    under = white if rng.random() < 0.3 else wood
    # Shear each leg outwards, so that its foot stays level.
    for k in range(n):
        a = 2 * np.pi * (k + 0.5) / n
        lean = np.array([np.cos(a), 0.0, np.sin(a)])
        foot, top = lean * (r - 0.005), lean * (r - 0.07)
        shear = np.eye(3)
        shear[:, 1] = top - foot + [0, tall - 0.028, 0]
        parts.append((_sheared(leg, shear, foot), under))
    return made("stool", parts, group="stool", nyu40=CHAIR, place=Place.FLOOR)


def _sheared(surface: Surface, matrix: F64, offset: F64) -> Surface:
    points = surface.positions.astype(np.float64) @ matrix.T + offset
    return smooth(surface.name, points, surface.faces)
