"""Procedural surfaces as materials of a house; the content package paints them, in a thread.

Effects: adds materials to the house; JPEGs are encoded through a temporary file.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Final

import numpy as np

from pbrs_farm.core.catalogue import Catalogue
from pbrs_farm.core.frames import linear_from_srgb, srgb_from_linear
from pbrs_farm.core.house import Material, Texture
from pbrs_farm.dress.content import content
from pbrs_farm.dress.mutable_house import MutableHouse
from pbrs_farm.dress.painted_materials import Painted
from pbrs_farm.dress.photographs import photograph_for, photograph_material
from pbrs_farm.dress.style import WOODS, Rgb, Wood
from pbrs_farm.dress.surface_maps import SurfaceMaps, encode_maps

SEEDS: Final = 8
"""Of how many seeds a home draws one: patterns of other homes come again, and are painted once."""

# Families of one tint are painted in few lightnesses and tinted by their material's diffuse colour.
# fmt: off
_TINTED: Final = (
    "paint", "plaster", "smooth plaster", "concrete", "carpet", "loop carpet", "weave", "twill",
    "leather", "painted brick", "upright boards", "level boards", "panels",
)
# fmt: on
_LIGHTNESSES: Final = (0.4, 0.6, 0.75, 0.87, 0.97)


@dataclass(frozen=True, slots=True)
class Pattern:
    """Look of a procedural surface: equal patterns give equal pixels."""

    family: str  # of furnishings/textures/families.py
    seed: int
    tints: tuple[Rgb, ...] = ((0.9, 0.9, 0.9),)  # sRGB-encoded, the main one first
    wood: Wood = WOODS["oak"]  # of wood
    variant: str = ""  # of tiles and wallpaper: how they are laid or printed
    darkness: float = 0.0  # of wood: -1 bleached .. 1 stained
    photograph: str = ""  # id of the picture shown instead, from photographed()


@dataclass(frozen=True, slots=True)
class PatternMaterial:
    """A pattern as a house has it."""

    number: int  # in MutableHouse.materials
    size_m: tuple[float, float]  # of one repeat: uv = metres / size
    mean: Callable[[], Rgb]  # gives the mean linear colour once it is painted

    @property
    def mean_rgb(self) -> Rgb:
        """The mean linear colour; waits until the material is painted."""
        return self.mean()


def pattern_material(house: MutableHouse, pattern: Pattern) -> PatternMaterial:
    """The pattern as a material of the house; equal patterns give the same number.

    A thread paints it meanwhile: reading `mean_rgb` waits for it. Map surfaces in repeats of `size_m`.

        veneer = pattern_material(house, Pattern("grain", seed=7, wood=WOODS["oak"]))
        mapped = box_mapped(surface, axes, veneer.size_m)
        surface = replace(mapped, material=veneer.number)

    KeyError for an unknown family.
    """
    key = f"pattern {pattern!r}"
    cached = house.kept.get(key)
    if isinstance(cached, PatternMaterial):
        return cached
    if pattern.photograph:
        number, size, mean = photograph_material(house, pattern.photograph, pattern.family)
        made_material = PatternMaterial(number, size, lambda: mean)
    else:
        number, painting = house.materials.paint(partial(_paint_pattern, house, pattern))
        made_material = PatternMaterial(
            number, content().pattern_size(pattern), lambda: painting.painted().mean_rgb
        )
    house.kept[key] = made_material
    return made_material


def _paint_pattern(house: MutableHouse, pattern: Pattern) -> Painted:
    """The pattern as a material: taken out of the house's bank, or painted."""
    if pattern.family in _TINTED and len(pattern.tints) == 1:
        return _tinted(house, pattern)
    return house.bank.painted(repr(pattern), partial(_painted, pattern))


def _painted(pattern: Pattern) -> Painted:
    maps = content().maps_of(pattern)
    material, textures = material_from_maps(maps, f"{pattern.family}-{pattern.seed:08x}")
    return Painted(material, textures, maps.mean_rgb)


def _tinted(house: MutableHouse, pattern: Pattern) -> Painted:
    """The pattern painted in a grey lighter than its tint, times the tint's share."""
    tint = pattern.tints[0]
    grey = next((c for c in _LIGHTNESSES if c >= max(tint)), _LIGHTNESSES[-1])
    plain = replace(pattern, tints=((grey, grey, grey),))
    painted = house.bank.painted(repr(plain), partial(_painted, plain))
    part = np.minimum(linear_from_srgb(np.array(tint)) / linear_from_srgb(np.array(grey)), 1.0)
    r, g, b = (round(float(c), 4) for c in srgb_from_linear(part))
    means = [float(m) for m in np.array(painted.mean_rgb) * linear_from_srgb(np.array((r, g, b)))]
    diffuse = replace(painted.material, diffuse=(r, g, b))
    return Painted(diffuse, painted.textures, (means[0], means[1], means[2]))


def photographed(house: MutableHouse, catalogue: Catalogue, pattern: Pattern) -> Pattern:
    """The pattern or, with probability n
    (n + 12), one of n fitting photographs of the catalogue.
    """
    photograph = photograph_for(house, catalogue, pattern.family, pattern.seed)
    return replace(pattern, photograph=photograph) if photograph else pattern


def material_from_maps(maps: SurfaceMaps, name: str) -> tuple[Material, tuple[Texture, ...]]:
    """A material that shows the maps, and the textures it names."""
    colour, rough, normal = encode_maps(maps, name)
    # Keep the Phong lobe that matches, for who reads no roughness.
    alpha = max(maps.mean_roughness, 0.1) ** 2
    gloss = maps.gloss
    material = Material(
        name=name,
        specular=(gloss, gloss, gloss),
        shininess=round(2.0 / alpha**2 - 2.0, 1) if gloss else 0.0,
        texture_id=colour.id,
        roughness=1.0 if rough is not None else round(maps.mean_roughness, 4),
        roughness_texture_id=None if rough is None else rough.id,
        normal_texture_id=None if normal is None else normal.id,
    )
    return material, tuple(t for t in (colour, rough, normal) if t is not None)
