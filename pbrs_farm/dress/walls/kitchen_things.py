"""What hangs over a kitchen's worktop: cupboards, open boxes, a rail with tools; no effects.

Shapes have their back at z = 0 and grow to +z, the middle of the lower edge at the origin.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pbrs_farm.core.classes import CABINET, OTHERPROP, SHELVES
from pbrs_farm.core.house import Material
from pbrs_farm.dress.generated.assembly import Made, Part, any_colour, hung, plain, transformed
from pbrs_farm.dress.generated.turned import slab, turned
from pbrs_farm.dress.style import Style

_BOARD_M = 0.018
_DEPTH_M = 0.32
_ROD_Z_M = 0.045  # of a rail before its wall
_OUT = np.array([[1.0, 0, 0], [0, 0, -1.0], [0, 1.0, 0]])  # turns +y to +z


@dataclass(frozen=True, slots=True)
class Fronts:
    """What a kitchen's cupboards are made of."""

    body: Material
    front: Material
    metal: Material


def wall_cupboard(
    fronts: Fronts, width: float, height: float, n_doors: int, d: float = _DEPTH_M
) -> Made:
    """A closed cupboard with its doors; d: its depth."""
    w = width / 2
    parts: list[Part] = [(slab((-w, 0.0, 0.0), (w, height, d)), fronts.body)]
    step = width / n_doors
    for k in range(n_doors):
        x = -w + k * step
        front = slab((x + 0.002, 0.002, d + 0.0005), (x + step - 0.002, height - 0.002, d + 0.0185))
        parts.append((front, fronts.front))
        # The handle is low, where the door opens.
        at = x + (step - 0.04 if k % 2 == 0 and n_doors > 1 else 0.04)
        parts.append(
            (slab((at - 0.005, 0.04, d + 0.0345), (at + 0.005, 0.2, d + 0.0425)), fronts.metal)
        )
        for y in (0.05, 0.185):
            foot = slab((at - 0.004, y, d + 0.0185), (at + 0.004, y + 0.008, d + 0.0345))
            parts.append((foot, fronts.metal))
    return hung("wall_cupboard", "upper_cabinet", CABINET, parts)


def open_box(fronts: Fronts, width: float, height: float, d: float = _DEPTH_M - 0.04) -> Made:
    """An open cupboard of one to three shelves; d: its depth."""
    w, t = width / 2, _BOARD_M
    parts: list[Part] = [
        (slab((-w, 0.0, 0.0), (-w + t, height, d)), fronts.body),
        (slab((w - t, 0.0, 0.0), (w, height, d)), fronts.body),
        (slab((-w + t, 0.0, 0.0), (w - t, height, 0.006)), fronts.body),
    ]
    n = max(1, round(height / 0.3))
    for y in np.linspace(0.0, height - t, n + 1):
        parts.append((slab((-w + t, float(y), 0.006), (w - t, float(y) + t, d)), fronts.body))
    return hung("open_cupboard", "shelves", SHELVES, parts)


def tool_rail(rng: np.random.Generator, style: Style, steel: Material, width: float) -> Made:
    """A bar on two holders with tools, pans and cups on hooks; the bar hangs above y = 0.3."""
    half, y = width / 2, 0.36
    bar = turned([(0.0, 0.0), (0.006, 0.0), (0.006, width), (0.0, width)], n=12)
    # Lay the bar along x.
    along = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    parts: list[Part] = [(transformed(bar, along, (-half, y, _ROD_Z_M)), steel)]
    for x in (-half + 0.03, half - 0.03):
        parts.append(
            (slab((x - 0.008, y - 0.008, 0.0), (x + 0.008, y + 0.008, _ROD_Z_M - 0.004)), steel)
        )
    x = -half + 0.1
    while x < half - 0.08:
        make = (_ladle, _turner, _pan, _cup)[int(rng.choice(4, p=[0.3, 0.3, 0.22, 0.18]))]
        parts += make(rng, style, steel, x, y - 0.006)
        x += float(rng.uniform(0.1, 0.15)) + (0.1 if make is _pan else 0.0)
    return hung("tool_rail", "kitchen_tool", OTHERPROP, parts)


def _hook(steel: Material, x: float, y: float) -> Part:
    # It reaches from the bar down to what hangs.
    return slab(
        (x - 0.0015, y - 0.03, _ROD_Z_M - 0.0015), (x + 0.0015, y + 0.001, _ROD_Z_M + 0.0015)
    ), steel


def _handle(rng: np.random.Generator, style: Style, steel: Material) -> Material:
    dark = plain("handle", (0.08, 0.08, 0.08), 0.5)
    wood = plain(f"handle {style.wood.name}", style.wood.mean, 0.6)
    return (steel, dark, wood)[int(rng.integers(3))]


def _stick(material: Material, x: float, top: float, low: float) -> Part:
    return slab((x - 0.006, low, _ROD_Z_M - 0.003), (x + 0.006, top, _ROD_Z_M + 0.003)), material


def _ladle(
    rng: np.random.Generator, style: Style, steel: Material, x: float, y: float
) -> list[Part]:
    r, low = float(rng.uniform(0.03, 0.042)), y - float(rng.uniform(0.24, 0.3))
    ball = [(0.0, -r), (0.7 * r, -0.7 * r), (r, 0.0), (0.7 * r, 0.7 * r), (0.0, r)]
    bowl = transformed(turned(ball, n=14), np.diag([1.0, 1.0, 0.55]), (x, low, _ROD_Z_M))
    return [
        _hook(steel, x, y),
        _stick(_handle(rng, style, steel), x, y - 0.028, low + 0.6 * r),
        (bowl, steel),
    ]


def _turner(
    rng: np.random.Generator, style: Style, steel: Material, x: float, y: float
) -> list[Part]:
    w, low = float(rng.uniform(0.028, 0.04)), y - float(rng.uniform(0.2, 0.24))
    handle = _handle(rng, style, steel)
    blade = slab((x - w, low - 0.1, _ROD_Z_M - 0.0015), (x + w, low + 0.002, _ROD_Z_M + 0.0015))
    return [
        _hook(steel, x, y),
        _stick(handle, x, y - 0.028, low),
        (blade, handle if rng.random() < 0.5 else steel),
    ]


def _pan(rng: np.random.Generator, style: Style, steel: Material, x: float, y: float) -> list[Part]:
    r, low = float(rng.uniform(0.08, 0.1)), y - 0.13
    black = plain("pan", (0.07, 0.07, 0.075), 0.4)
    profile = [
        (0.0, 0.0),
        (0.85 * r, 0.0),
        (r, 0.035),
        (0.96 * r, 0.035),
        (0.82 * r, 0.005),
        (0.0, 0.005),
    ]
    dish = transformed(turned(profile, n=24), _OUT, (x, low - r, 0.008))
    return [
        _hook(steel, x, y),
        (slab((x - 0.009, low - 0.004, 0.028), (x + 0.009, y - 0.024, 0.046)), black),
        (dish, black if rng.random() < 0.6 else steel),
    ]


def _cup(rng: np.random.Generator, style: Style, steel: Material, x: float, y: float) -> list[Part]:
    r, h = 0.038, 0.085
    colour = plain("hung cup", any_colour(rng, style), 0.25)
    profile = [(0.0, 0.0), (r, 0.0), (r, h), (r - 0.004, h), (r - 0.004, 0.004), (0.0, 0.004)]
    # It hangs by its handle, its mouth to the side.
    body = transformed(
        turned(profile, n=18),
        np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]),
        (x - h / 2, y - 0.03 - 0.018 - r, _ROD_Z_M),
    )
    ear = slab((x - 0.018, y - 0.05, _ROD_Z_M - 0.005), (x + 0.018, y - 0.026, _ROD_Z_M + 0.005))
    return [_hook(steel, x, y), (ear, colour), (body, colour)]
