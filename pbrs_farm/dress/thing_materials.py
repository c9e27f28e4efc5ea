"""Materials of generated items; no effects. Equal materials are shared in the house."""

from __future__ import annotations

from typing import Final

import numpy as np

from pbrs_farm.core.house import Material, MaterialKind
from pbrs_farm.dress.style import METALS, Rgb, Style, mix, shade


def plain(name: str, colour: Rgb, roughness: float) -> Material:
    """An opaque material of one colour (sRGB)."""
    return Material(name, diffuse=_printable(colour), roughness=roughness)


def glossy(name: str, colour: Rgb, roughness: float = 0.35) -> Material:
    """A lacquer, enamel or glaze of one colour, which the dress pass `parts` leaves unchanged."""
    return Material(
        f"coated {name}",
        diffuse=_printable(colour),
        specular=(0.4, 0.4, 0.4),
        shininess=round(2.0 / max(roughness, 0.1) ** 4 - 2.0, 1),
        roughness=roughness,
    )


def glass(tint: Rgb = (0.83, 0.91, 0.88), opacity: float = 0.12) -> Material:
    """Thin glass; as it comes, clear: where a wall is seen edge-on its green shows."""
    return Material("glass", MaterialKind.GLASS, tint, (1.0, 1.0, 1.0), 200.0, opacity)


def metal(style: Style) -> Material:
    """The metal of the home's fittings."""
    return _metal(style.metal.name, style.metal.colour, style.metal.roughness)


def any_colour(rng: np.random.Generator, style: Style) -> Rgb:
    """A colour for a small item: of the style, calm or loud, or any at all."""
    # 30 % textiles, 25 % any hue, 15 % each accent, small items, wall
    kind = rng.random()
    if kind < 0.3:
        return style.textiles[int(rng.integers(len(style.textiles)))]
    if kind < 0.45:
        return style.accent
    if kind < 0.6:
        return style.palette[4]
    if kind < 0.75:
        return shade(style.palette[0], float(rng.uniform(0.9, 1.05)))
    hue = rng.random(3)
    return mix((float(hue[0]), float(hue[1]), float(hue[2])), (0.6, 0.58, 0.55), 0.45)


def _printable(colour: Rgb) -> Rgb:
    # Neither quite black nor quite white.
    r, g, b = (round(float(min(max(c, 0.02), 0.95)), 3) for c in colour)
    return (r, g, b)


def _metal(name: str, colour: Rgb, roughness: float) -> Material:
    return Material(
        name, diffuse=(0.03, 0.03, 0.03), specular=colour, shininess=40.0, roughness=roughness
    )


def _known_metal(name: str) -> Material:
    return _metal(name, METALS[name].colour, METALS[name].roughness)


CHROME: Final = _known_metal("chrome")
STEEL: Final = _known_metal("brushed steel")
BLACK_STEEL: Final = _known_metal("black steel")
BRASS: Final = _known_metal("brass")
WHITE_STEEL: Final = glossy("white steel", (0.9, 0.9, 0.89), 0.4)
CERAMIC: Final = glossy("ceramic", (0.93, 0.93, 0.92), 0.12)
ENAMEL: Final = glossy("enamel", (0.92, 0.92, 0.91), 0.2)
WHITE: Final = glossy("white lacquer", (0.92, 0.92, 0.9), 0.35)
BLACK_GLASS: Final = glossy("black glass", (0.02, 0.02, 0.022), 0.08)
RUBBER: Final = plain("black rubber", (0.06, 0.06, 0.06), 0.7)
CAST_IRON: Final = plain("cast black", (0.05, 0.05, 0.052), 0.6)
EARTH: Final = plain("earth", (0.16, 0.11, 0.08), 0.95)
WICKER: Final = plain("wicker", (0.66, 0.52, 0.36), 0.9)
CLEAR: Final = glass()
FROSTED: Final = glass((0.93, 0.96, 0.96), 0.35)
OPAL: Final = Material("opal glass", MaterialKind.BULB)
SILVERED: Final = Material("mirror", MaterialKind.MIRROR, (0.9, 0.9, 0.9))
MIRROR_GLASS: Final = Material("mirror", MaterialKind.MIRROR, specular=(0.9, 0.9, 0.9))
