"""Decoration style of a home: matching tints, wood, metal and cloth; no effects.

One style per home, drawn by `style_for`; a fifth of the rooms has another one (`room_style`).
Colours are sRGB-encoded, 0..1, as `Material.diffuse`. The choices are in style.toml.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Annotated, ClassVar, Final, Literal, TypeVar

import numpy as np
from pydantic import BeforeValidator, ConfigDict, model_validator

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.errors import BadRecipe
from pbrs_farm.core.record import Record, read_toml
from pbrs_farm.core.shown_text import hint_of_choice
from pbrs_farm.home.room_use import RoomKind

_T = TypeVar("_T")
Rgb = tuple[float, float, float]

OUTLIER_SHARE = 0.2  # share of rooms furnished in another taste than the home's


def rgb(code: str) -> Rgb:
    """sRGB-encoded 0..1 of six hexadecimal digits; ValueError for anything else."""
    if len(code) != 6:
        raise ValueError(f"{code!r} is not a colour of six hexadecimal digits")
    r, g, b = (int(code[i : i + 2], 16) / 255 for i in (0, 2, 4))
    return (r, g, b)


def _rgb_if_text(value: object) -> object:
    return rgb(value) if isinstance(value, str) else value


def _rgbs_if_text(value: object) -> object:
    return [rgb(code) for code in value.split()] if isinstance(value, str) else value


# In tables: a colour, several with spaces between them, and five of those.
Colour = Annotated[Rgb, BeforeValidator(_rgb_if_text)]
Colours = Annotated[tuple[Rgb, ...], BeforeValidator(_rgbs_if_text)]
Palette = Annotated[tuple[Rgb, Rgb, Rgb, Rgb, Rgb], BeforeValidator(_rgbs_if_text)]


@dataclass(frozen=True, slots=True)
class Wood:
    """A species of wood as it looks when oiled or varnished: early wood is light, late wood dark."""

    name: str
    light: Colour
    dark: Colour
    figure: float = 0.5  # how strongly the grain shows, 0..1
    __pydantic_config__: ClassVar = ConfigDict(extra="forbid")

    @property
    def mean(self) -> Rgb:
        """The colour from afar."""
        r, g, b = (0.65 * a + 0.35 * c for a, c in zip(self.light, self.dark, strict=True))
        return (r, g, b)


@dataclass(frozen=True, slots=True)
class Metal:
    """A metal or its coating: the colour of its highlight at normal incidence."""

    name: str
    colour: Colour
    roughness: float
    __pydantic_config__: ClassVar = ConfigDict(extra="forbid")


@dataclass(frozen=True, slots=True)
class Style:
    """One home's or room's taste: the sRGB colours, 0..1, of surfaces, furniture, textiles and pictures."""

    name: str
    palette: Palette  # wall, second wall, accent wall, large items, small items
    wood: Wood
    metal: Metal
    textiles: tuple[Rgb, ...]  # seats, curtains, rugs, beds: from calm to loud
    accent: Rgb
    floors: tuple[str, ...] = ("planks", "strip", "laminate", "carpet")  # liked most first
    walls: tuple[str, ...] = ("paint", "wallpaper")
    papers: tuple[str, ...] = ("stripes", "leaves")  # patterns of wallpaper
    covers: tuple[str, ...] = ()  # of COVERS, liked most first
    darkness: float = 0.0  # of wood floors against the species, -1 bleached .. 1 stained


class _Taste(Record):
    # Choices of a style; the first of each is the most common.
    name: str
    palettes: tuple[Palette, ...]
    woods: tuple[str, ...]
    metals: tuple[str, ...]
    textiles: Colours
    accents: Colours
    floors: tuple[str, ...]
    walls: tuple[str, ...] = ("paint", "wallpaper")
    papers: tuple[str, ...] = ("stripes", "leaves", "geometric")
    covers: tuple[str, ...] = ()
    darkness: float = 0.0


class _WoodsFor(Record):
    # Materials besides the home's wood.
    trim: tuple[str, ...]
    front_doors: tuple[str, ...]
    stairs: tuple[str, ...]
    floors: tuple[str, ...]


class WallCover(Record):
    """A wall covering besides paint and wallpaper: a row of style.toml."""

    pattern: str  # of textures/families.py
    walls: Literal[
        "foot", "one", "one or all"
    ]  # of a room: their foot, one wall, one or all of them
    of: Literal["paint", "wood", "brick", "concrete"]
    variants: tuple[str, ...] = ("",)
    low_m: tuple[float, ...] = ()  # heights of a foot for variants without one


class StyleTable(Record):
    # The file style.toml.
    woods_for: _WoodsFor
    covers: dict[str, WallCover]
    covered_rooms: dict[RoomKind, float]
    woods: tuple[Wood, ...]
    metals: tuple[Metal, ...]
    tastes: tuple[_Taste, ...]

    @model_validator(mode="after")
    def _tastes_know_their_woods(self) -> StyleTable:
        valid = {w.name for w in self.woods} | {m.name for m in self.metals}
        used = {name for names in self.woods_for.model_dump().values() for name in names}
        if unknown := used - {w.name for w in self.woods}:
            raise ValueError(f"woods_for: no wood {', '.join(sorted(unknown))}")
        for taste in self.tastes:
            if unknown := {*taste.woods, *taste.metals} - valid:
                raise ValueError(f"{taste.name}: no wood or metal {', '.join(sorted(unknown))}")
            if unknown := {*taste.covers} - {*self.covers}:
                raise ValueError(f"{taste.name}: no cover {', '.join(sorted(unknown))}")
        return self


_FILE: Final = read_toml(Path(__file__).with_name("style.toml"), StyleTable)
WOODS: Final = {wood.name: wood for wood in _FILE.woods}
METALS: Final = {metal.name: metal for metal in _FILE.metals}
WOODS_FOR: Final = _FILE.woods_for
COVERS: Final[Mapping[str, WallCover]] = _FILE.covers
COVERED_ROOMS: Final[Mapping[RoomKind, float]] = _FILE.covered_rooms
_TASTES: Final = _FILE.tastes
COLOURS: Final = read_toml(Path(__file__).with_name("colours.toml"), dict[str, Colours])
"""Commercial colours of items, by name."""
STYLES = tuple(taste.name for taste in _TASTES)


def check_style(name: str) -> None:
    """Raise BadRecipe for the name of a style that does not exist; "" is any style."""
    if name and name not in STYLES:
        raise BadRecipe(f"style: {name}: no such style", hint=hint_of_choice(name, STYLES))


def style_for(rng: np.random.Generator, name: str = "") -> Style:
    """A home's style: of that name, or any; BadRecipe where there is no style of that name."""
    check_style(name)
    # Draw even where the name decides, so that the name changes nothing else.
    index = int(rng.integers(len(_TASTES)))
    taste = _TASTES[STYLES.index(name)] if name else _TASTES[index]
    palette = _usual_first(rng, taste.palettes)
    return Style(
        name=taste.name,
        palette=palette,
        wood=WOODS[_usual_first(rng, taste.woods)],
        metal=METALS[_usual_first(rng, taste.metals)],
        textiles=taste.textiles,
        accent=taste.accents[int(rng.integers(len(taste.accents)))],
        floors=taste.floors,
        walls=taste.walls,
        papers=taste.papers,
        covers=taste.covers,
        darkness=float(np.clip(taste.darkness + rng.normal(0, 0.15), -0.6, 0.6)),
    )


def room_style(style: Style, rng: np.random.Generator) -> Style:
    """The home's style, or in a fifth of the rooms another taste with the home's wood and metal."""
    other_style = style_for(rng)
    if rng.random() >= OUTLIER_SHARE:
        return style
    return replace(other_style, metal=style.metal, wood=style.wood)


def shade(colour: Rgb, factor: float) -> Rgb:
    """The colour darker (times factor < 1) or lighter (factor 2 goes half the way to white), sRGB-encoded."""
    if factor <= 1.0:
        r, g, b = (max(c * factor, 0.0) for c in colour)
    else:
        t = 1.0 - 1.0 / factor
        r, g, b = (c + (1.0 - c) * t for c in colour)
    return (r, g, b)


def mix(a: Rgb, b: Rgb, t: float) -> Rgb:
    """The colour between a (t = 0) and b (t = 1), sRGB-encoded."""
    r, g, bl = (x + (y - x) * t for x, y in zip(a, b, strict=True))
    return (r, g, bl)


def _usual_first(rng: np.random.Generator, choices: tuple[_T, ...]) -> _T:
    # The first twice as likely as each of the others; as rng.choice draws, in a tenth of its time.
    return choices[int(_likelihoods(len(choices)).searchsorted(rng.random(), "right"))]


@cache
def _likelihoods(n: int) -> F64:
    weights = np.array([2.0] + [1.0] * (n - 1))
    sums = (weights / weights.sum()).cumsum()
    return np.asarray(sums / sums[-1])
