"""How a home is decorated: tints, wood, metal and cloth that go together; no effects.

One style a home, drawn by `style_for`; a fifth of the rooms has another one (`room_style`).
Colours are sRGB-encoded, 0..1, as `Material.diffuse` is.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pbrs_farm.core.errors import BadRecipe

Rgb = tuple[float, float, float]

OUTLIER_SHARE = 0.2  # of rooms that another taste has furnished


@dataclass(frozen=True, slots=True)
class Wood:
    """A species of wood as it looks when oiled or varnished: early wood is light, late wood dark."""

    name: str
    light: Rgb
    dark: Rgb
    figure: float = 0.5  # how strongly the grain shows, 0..1

    @property
    def mean(self) -> Rgb:
        """The colour from afar."""
        r, g, b = (0.65 * a + 0.35 * c for a, c in zip(self.light, self.dark, strict=True))
        return (r, g, b)


@dataclass(frozen=True, slots=True)
class Metal:
    """A metal or its coating: the colour of its highlight at normal incidence."""

    name: str
    colour: Rgb
    roughness: float


@dataclass(frozen=True, slots=True)
class Style:
    """One home's taste. Surfaces, furniture, textiles and pictures draw their colours from it."""

    name: str
    palette: tuple[Rgb, Rgb, Rgb, Rgb, Rgb]  # wall, second wall, accent wall, large, small things
    wood: Wood
    metal: Metal
    textiles: tuple[Rgb, ...]  # seats, curtains, rugs, beds: from calm to loud
    accent: Rgb
    floors: tuple[str, ...] = ("planks", "strip", "laminate", "carpet")  # liked most first
    walls: tuple[str, ...] = ("paint", "wallpaper")
    papers: tuple[str, ...] = ("stripes", "leaves")  # patterns of wallpaper
    darkness: float = 0.0  # of wood floors against the species, -1 bleached .. 1 stained


def rgb(code: str) -> Rgb:
    """sRGB-encoded 0..1 of six hexadecimal digits."""
    r, g, b = (int(code[i : i + 2], 16) / 255 for i in (0, 2, 4))
    return (r, g, b)


WOODS: dict[str, Wood] = {
    wood.name: wood
    for wood in (
        Wood("oak", rgb("c9a679"), rgb("a57c4f"), 0.6),
        Wood("pale oak", rgb("d8c3a0"), rgb("bb9d75"), 0.45),
        Wood("smoked oak", rgb("86664a"), rgb("5d432e"), 0.6),
        Wood("birch", rgb("e2cfae"), rgb("cdb088"), 0.3),
        Wood("beech", rgb("d9b48c"), rgb("c0946a"), 0.3),
        Wood("maple", rgb("e0c9a3"), rgb("cbac80"), 0.3),
        Wood("ash", rgb("d9c7a8"), rgb("b59a74"), 0.75),
        Wood("pine", rgb("dfbd88"), rgb("bf8c50"), 0.8),
        Wood("cherry", rgb("b9805a"), rgb("94593a"), 0.45),
        Wood("walnut", rgb("8a6547"), rgb("5a3d29"), 0.7),
        Wood("teak", rgb("ad8155"), rgb("83592f"), 0.55),
        Wood("mahogany", rgb("8b4f38"), rgb("63321f"), 0.5),
        Wood("grey oak", rgb("b3a797"), rgb("8e8170"), 0.6),
        Wood("wenge", rgb("5b473b"), rgb("3b2c24"), 0.7),
    )
}

METALS: dict[str, Metal] = {
    metal.name: metal
    for metal in (
        Metal("chrome", (0.77, 0.78, 0.78), 0.12),
        Metal("brushed steel", (0.78, 0.77, 0.75), 0.38),
        Metal("aluminium", (0.96, 0.96, 0.97), 0.42),
        Metal("brass", (0.91, 0.78, 0.42), 0.28),
        Metal("copper", (0.98, 0.82, 0.76), 0.3),
        Metal("bronze", (0.72, 0.57, 0.4), 0.4),
        Metal("black steel", (0.2, 0.2, 0.21), 0.5),
        Metal("white steel", (0.9, 0.9, 0.89), 0.45),
    )
}


@dataclass(frozen=True, slots=True)
class _Taste:
    # What homes of a style draw from; the first of each is the most usual.
    name: str
    palettes: tuple[str, ...]  # five hexadecimal colours each
    woods: tuple[str, ...]
    metals: tuple[str, ...]
    textiles: str
    accents: str
    floors: tuple[str, ...]
    walls: tuple[str, ...] = ("paint", "wallpaper")
    papers: tuple[str, ...] = ("stripes", "leaves", "geometric")
    darkness: float = 0.0


_TASTES = (
    _Taste(
        "nordic",
        ("f1f0ec e3e4e2 8fa0a3 d6d3cb 4b5a60", "f3f1ec e9e4da a9b3a5 cfd3d2 2f3a40"),
        ("pale oak", "birch", "ash"), ("black steel", "white steel"),
        "d9d5cc b5b8b5 7c8a8e e8dfd0 3f4d57", "d9a441 3f6b73 c9795c",
        ("planks", "strip", "laminate"), papers=("geometric", "leaves", "stripes"), darkness=-0.3,
    ),
    _Taste(
        "warm wood",
        ("f0e6d6 e6d6bf b98a5e d8c3a4 7a4f34", "efe3cf e0c9a8 a4694a cdb08a 6b4a3a"),
        ("oak", "beech", "cherry"), ("brass", "brushed steel"),
        "cdb598 9c7455 b5583c e5d8c2 6d4c3c", "b5472f 5f6b3a c98a2d",
        ("strip", "planks", "carpet"),
    ),
    _Taste(
        "loft",
        ("dddad6 c4c0bb 6b6a6a a89f97 33312f", "e2dfda bdb8b2 8c5a45 8f8a84 2b2b2c"),
        ("smoked oak", "walnut", "grey oak"), ("black steel", "brushed steel"),
        "6e6a66 a39a8f 4a4744 8a5a3c c9c2b8", "b3532d 2f5d62 c7962f",
        ("planks", "laminate", "carpet"), ("paint", "brick", "plaster"),
        ("geometric", "stripes"), darkness=0.2,
    ),
    _Taste(
        "classic",
        ("ece5d3 ddd3bb 7d8b6f c9b58d 5a3a2e", "e9e4da d3cbb8 6f7f8c b8a585 4e2f2a"),
        ("walnut", "mahogany", "cherry"), ("brass", "bronze"),
        "8c2f34 d7c7a0 3d4f3a 27405c b08d57", "8c2f34 2c4a3b b58b3a",
        ("herringbone", "chevron", "strip", "carpet"), ("wallpaper", "paint"),
        ("damask", "stripes", "leaves"), darkness=0.15,
    ),
    _Taste(
        "country",
        ("f2ead8 e5dcc3 a7b89c d9c49a 7b8f98", "f0eadd dfd6c6 9fb2bd cfb88f 8b6f5a"),
        ("pine", "oak", "beech"), ("bronze", "white steel"),
        "c8d0c0 b96a5e e9dfc8 8aa0b0 d8b98a", "b5544c 6a8a72 4f6f8f",
        ("planks", "terracotta", "strip"), ("wallpaper", "paint", "plaster"),
        ("leaves", "stripes", "damask"),
    ),
    _Taste(
        "mediterranean",
        ("f5efe2 ecdcc0 c98b5e e0c49a 3f6f8c", "f3ece0 e8d5b5 5f8a9c d9b384 a3553a"),
        ("pine", "teak", "oak"), ("bronze", "black steel"),
        "e9e0cc 3f6f8c c47a4a d9c9a8 7f8a5a", "2f6690 c4622d 8a8f4a",
        ("terracotta", "tiles", "planks"), ("plaster", "paint"), ("leaves", "geometric"),
    ),
    _Taste(
        "modern white",
        ("f4f4f2 e8e8e6 b9bcbf dcdcda 2e3033", "f5f4f1 e6e3de 9aa3ab d2d0cc 1f2a36"),
        ("maple", "ash", "walnut"), ("chrome", "aluminium"),
        "e4e3e0 8d9196 3a3d42 c4c1bb b8352f", "b8352f 1f6fa0 e0b11e",
        ("laminate", "tiles", "planks"), papers=("geometric", "stripes"),
    ),
    _Taste(
        "mid century",
        ("efe9da e0d3b4 c98f3c 8aa39b 9c4a2c", "eee8dc dccfae 4f7a78 d0a24c 7a3f2a"),
        ("teak", "walnut", "oak"), ("brass", "chrome"),
        "c4822e 4f7a78 a8482c d9cfb8 6b5a40", "c9622b 2f6f70 d1a32a",
        ("strip", "herringbone", "carpet"), ("paint", "wallpaper"),
        ("geometric", "leaves", "stripes"),
    ),
    _Taste(
        "grey modern",
        ("e6e5e3 d2d1cf 7f858a b8b5b0 45484c", "eae8e4 c9cbcb 5f6d74 aaa7a2 3a3f3f"),
        ("grey oak", "pale oak", "ash"), ("brushed steel", "black steel"),
        "9a9b9b 6d7073 c9c6c0 45494e b0a58f", "d0b13f 6f8f8a a85f5f",
        ("laminate", "planks", "carpet"), papers=("geometric", "stripes", "damask"),
    ),
    _Taste(
        "soft pastel",
        ("f4ede7 f0ddd4 b7cdc6 e8d3b9 9aa8c4", "f2efe6 dce5dc d9b3ae e5dcc6 a89cc0"),
        ("birch", "beech", "pale oak"), ("white steel", "copper"),
        "e6c9c4 c3d5d0 f0e4d4 a8b6cf d9a9a0", "d98880 6fa29a e0b878",
        ("planks", "carpet", "laminate"), ("paint", "wallpaper"),
        ("leaves", "stripes", "geometric"), darkness=-0.2,
    ),
    _Taste(
        "bohemian",
        ("f0e8da e3cfae 3f6f6a c98a5a 8a3f4a", "efe6d8 dbc4a2 8f4f3c b99a5f 3a5a6a"),
        ("teak", "oak", "walnut"), ("brass", "copper"),
        "a84432 c98a2e 3f6f6a 6a3f5a e0cfae", "c4472f 2f7a72 d99a2b",
        ("planks", "herringbone", "terracotta"), ("paint", "wallpaper", "brick"),
        ("leaves", "damask", "geometric"),
    ),
    _Taste(
        "dark elegant",
        ("dedad3 b9b3a9 2f4348 8f7f6c 23252a", "d9d6d2 a8a49e 4a3a44 7d6f5f 1f2429"),
        ("wenge", "walnut", "smoked oak"), ("brass", "black steel"),
        "3a4a52 6b5f58 2a3038 a08a68 5a2f3a", "b08d45 7a2f3a 2f5f5a",
        ("herringbone", "chevron", "carpet", "tiles"), ("paint", "wallpaper"),
        ("damask", "geometric", "stripes"), darkness=0.2,
    ),
    _Taste(
        "family home",
        ("f3eee2 eadfc8 a8c0cc e5c98f 6f8a5a", "f2ede4 e4dccb d8b87a b5c4a0 5f7f9c"),
        ("beech", "pine", "oak", "maple"), ("brushed steel", "white steel"),
        "b8a894 7f94a8 c7b58f a85a48 d8d2c4", "d0632f 3f7fa8 7a9a3f",
        ("laminate", "strip", "carpet", "tiles"), ("paint", "wallpaper"),
        ("stripes", "leaves", "geometric", "damask"),
    ),
)  # fmt: skip

STYLES = tuple(taste.name for taste in _TASTES)


def style_for(rng: np.random.Generator, name: str = "") -> Style:
    """A home's style: of that name, or any; BadRecipe where there is no style of that name."""
    if name and name not in STYLES:
        raise BadRecipe(f"there is no style {name!r}: choose one of {', '.join(STYLES)}")
    # Draw even where the name decides, so that the name changes nothing else.
    index = int(rng.integers(len(_TASTES)))
    taste = _TASTES[STYLES.index(name)] if name else _TASTES[index]
    colours = [rgb(code) for code in _usual_first(rng, taste.palettes).split()]
    palette = (colours[0], colours[1], colours[2], colours[3], colours[4])
    accents = [rgb(code) for code in taste.accents.split()]
    return Style(
        name=taste.name,
        palette=palette,
        wood=WOODS[_usual_first(rng, taste.woods)],
        metal=METALS[_usual_first(rng, taste.metals)],
        textiles=tuple(rgb(code) for code in taste.textiles.split()),
        accent=accents[int(rng.integers(len(accents)))],
        floors=taste.floors,
        walls=taste.walls,
        papers=taste.papers,
        darkness=float(np.clip(taste.darkness + rng.normal(0, 0.15), -0.6, 0.6)),
    )


def room_style(style: Style, rng: np.random.Generator) -> Style:
    """The style of one room: the home's, or in a fifth of the rooms another taste's.

    The home's wood and metal stay, because doors and fittings are bought once.
    """
    other = style_for(rng)
    if rng.random() >= OUTLIER_SHARE:
        return style
    return replace(other, metal=style.metal, wood=style.wood)


def shade(colour: Rgb, factor: float) -> Rgb:
    """The colour darker (factor < 1) or lighter (> 1, towards white), sRGB-encoded."""
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


def _usual_first(rng: np.random.Generator, choices: tuple[str, ...]) -> str:
    # The first twice as likely as each of the others.
    weights = np.array([2.0] + [1.0] * (len(choices) - 1))
    return choices[int(rng.choice(len(choices), p=weights / weights.sum()))]
