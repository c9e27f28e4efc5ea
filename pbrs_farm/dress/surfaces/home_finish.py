"""Finishes of a home's floors, walls, ceilings and skirting boards, by style; no effects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from pbrs_farm.dress.content import content
from pbrs_farm.dress.finish_scheme import aged
from pbrs_farm.dress.patterns import SEEDS, Pattern
from pbrs_farm.dress.style import (
    COLOURS,
    COVERED_ROOMS,
    COVERS,
    WOODS,
    WOODS_FOR,
    Rgb,
    Style,
    WallCover,
    mix,
    rgb,
)
from pbrs_farm.home.room_use import RoomKind

_T = TypeVar("_T")
_TILED_FLOORS = (RoomKind.BATHROOM, RoomKind.KITCHEN)
WOOD_FLOORS = ("planks", "strip", "laminate", "herringbone", "chevron")
_MARBLES = tuple(zip(COLOURS["marbles"], COLOURS["marble_veins"], strict=True))
_DIRT = rgb("b9b5ac")
_PRINTED_CARPETS = 0.35  # share of carpets with a pattern
_ALL_WALLS = 0.35  # share of wall coverings on all walls instead of one


@dataclass(frozen=True, slots=True)
class Floor:
    """A floor: its pattern and how it is turned against the room's longer side."""

    pattern: Pattern
    turn_rad: float = 0.0


@dataclass(frozen=True, slots=True)
class WallFinish:
    """Finish of a room's walls."""

    main: Pattern
    accent: Pattern | None = None  # of one wall of the room
    low: Pattern | None = None  # tiles or a dado up to low_m, where main begins
    low_m: float = 0.0

    @property
    def is_tiled(self) -> bool:
        """Whether the walls' foot is of tiles: they have no skirting board."""
        return (self.low or self.main).family in ("tiles", "marble")


@dataclass(frozen=True, slots=True)
class HomeFinish:
    """Finishes shared by all rooms of a home."""

    dry_floors: tuple[Floor, Floor]  # the usual one, and the one of some rooms
    wet_floor: Floor
    ceiling: Pattern
    wall: Rgb  # the paint of most walls
    has_floor_boards: bool  # skirting boards of the floor's wood, not of the doors'
    board_m: float  # height of added boards


def home_finish(rng: np.random.Generator, style: Style) -> HomeFinish:
    """Draw the shared finishes of a home."""
    wood = [f for f in style.floors if f in WOOD_FLOORS] or ["planks"]
    usual = _wood_floor(rng, style, wood[0] if rng.random() < 0.6 else _pick(rng, wood))
    second = _dry_floor(rng, style, RoomKind.OTHER)
    white = aged(rng, _pick(rng, COLOURS["wall_whites"]))
    ceiling = Pattern("smooth plaster", _seed(rng), (white,))
    if rng.random() < 0.06 and style.name in ("country", "warm wood", "nordic"):
        ceiling = replace(_wood_floor(rng, style, "planks").pattern, darkness=-0.4)
    wall = white if rng.random() < 0.45 else style.palette[int(rng.integers(2))]
    return HomeFinish(
        dry_floors=(usual, second),
        wet_floor=_tile_floor(rng, style),
        ceiling=ceiling,
        wall=wall,
        has_floor_boards=bool(rng.random() < 0.25),
        board_m=float(rng.choice([0.06, 0.07, 0.08, 0.10])),
    )


def floor_of(
    rng: np.random.Generator, style: Style, home: HomeFinish, kind: RoomKind
) -> Floor | None:
    """The floor of a room of that kind; None leaves it as the source has it."""
    if kind is RoomKind.OUTDOOR:
        return _outdoor_floor(rng) if rng.random() < 0.8 else None
    if kind is RoomKind.STORE:
        return Floor(Pattern("concrete", _seed(rng), (_pick(rng, COLOURS["concretes"]),)))
    if kind in _TILED_FLOORS:
        if rng.random() < 0.85:
            return home.wet_floor if rng.random() < 0.4 else _tile_floor(rng, style)
        return home.dry_floors[0]
    if kind is RoomKind.HALL and rng.random() < 0.3:
        return home.wet_floor
    if kind is RoomKind.BEDROOM and rng.random() < 0.25:
        return _carpet(rng, style)
    # Most dry rooms share one floor.
    draw = rng.random()
    if draw < 0.65:
        return home.dry_floors[0]
    return home.dry_floors[1] if draw < 0.92 else _dry_floor(rng, style, kind)


def walls_of(
    rng: np.random.Generator, style: Style, home: HomeFinish, kind: RoomKind
) -> WallFinish | None:
    """The walls of a room of that kind; None leaves them as the source has them."""
    if kind is RoomKind.OUTDOOR:
        return None
    if kind is RoomKind.STORE:
        return WallFinish(Pattern("plaster", _seed(rng), (_pick(rng, COLOURS["wall_whites"]),)))
    paint = _paint_pattern(rng, style, home)
    if kind is RoomKind.BATHROOM:
        return _bathroom_walls(rng, style)
    if kind is RoomKind.KITCHEN:
        if rng.random() < 0.2:
            tiles, height = _wall_tiles(rng, style, 1.5)
            return WallFinish(paint, low=tiles, low_m=height)
        return WallFinish(paint)
    # Paint most rooms; paper, brick and rough plaster by the style.
    draw = rng.random()
    paper_share = (
        0.24 if style.walls[0] == "wallpaper" else 0.15 if "wallpaper" in style.walls else 0.04
    )
    if draw < paper_share:
        paper = _wallpaper(rng, style, paint.tints[0])
        if rng.random() < 0.4:
            return WallFinish(paint, accent=paper)
        return WallFinish(paper)
    if draw < paper_share + 0.05 and "brick" in style.walls:
        return WallFinish(_brick(rng, style))
    if draw < paper_share + 0.20 and "plaster" in style.walls:
        return WallFinish(replace(paint, family="plaster"))
    if draw < paper_share + 0.32:
        return WallFinish(paint, accent=_accent(rng, style))
    if draw < paper_share + 0.36 and kind is RoomKind.HALL:
        dado = Pattern("paint", _seed(rng), (mix(paint.tints[0], style.palette[2], 0.45),))
        return WallFinish(paint, low=dado, low_m=float(rng.choice([0.95, 1.1, 1.25])))
    return WallFinish(paint)


def covered(
    rng: np.random.Generator, style: Style, walls: WallFinish, kind: RoomKind
) -> WallFinish:
    """A room's walls, with cladding or panelling by chance and style; wallpaper only gets a foot."""
    if walls.accent is not None or (walls.is_tiled and walls.low is None):
        return walls
    if not style.covers or rng.random() >= COVERED_ROOMS.get(kind, 0.0):
        return walls
    weights = np.array([1.0 / (k + 1) for k in range(len(style.covers))])
    cover = COVERS[style.covers[int(rng.choice(len(style.covers), p=weights / weights.sum()))]]
    is_bare = walls.main.family == "paint" and walls.low is None
    if not is_bare and cover.walls != "foot":
        return walls
    pattern = _pattern_of_cover(rng, style, cover)
    if cover.walls == "foot":
        high = (
            content().panels_m[pattern.variant][1] if not cover.low_m else _pick(rng, cover.low_m)
        )
        return replace(walls, low=pattern, low_m=high)
    if cover.walls == "one or all" and rng.random() < _ALL_WALLS:
        return replace(walls, main=pattern)
    return replace(walls, accent=pattern)


def _pattern_of_cover(rng: np.random.Generator, style: Style, cover: WallCover) -> Pattern:
    pattern = Pattern(cover.pattern, _seed(rng), variant=_pick(rng, cover.variants))
    match cover.of:
        case "wood":
            wood = style.wood if rng.random() < 0.5 else WOODS[_pick(rng, WOODS_FOR.floors)]
            return replace(pattern, wood=wood, darkness=round(5 * style.darkness) / 5)
        case "brick":
            return replace(pattern, tints=(_pick(rng, COLOURS["bricks"]),))
        case "concrete":
            return replace(pattern, tints=(_pick(rng, COLOURS["concretes"]),))
        case "paint":
            # White more often than a colour.
            names = ("whites", "whites", "whites", "greys", "paints", "darks")
            tint = _pick(rng, COLOURS[_pick(rng, names)])
            return replace(pattern, tints=(tint,))


def _paint_pattern(rng: np.random.Generator, style: Style, home: HomeFinish) -> Pattern:
    draw = rng.random()
    if draw < 0.38:
        tint = home.wall
    elif draw < 0.65:
        tint = style.palette[int(rng.integers(2))]
    elif draw < 0.85:
        tint = mix(style.palette[2], (0.95, 0.94, 0.92), float(rng.uniform(0.3, 0.65)))
    else:
        tint = _pick(rng, COLOURS["soft_tints"])
    return Pattern("paint", _seed(rng, 3), (tint,))


def _accent(rng: np.random.Generator, style: Style) -> Pattern:
    if "brick" in style.walls and rng.random() < 0.5:
        return _brick(rng, style)
    return Pattern("paint", _seed(rng, 3), (style.palette[2],))


def _brick(rng: np.random.Generator, style: Style) -> Pattern:
    if rng.random() < 0.5:
        return Pattern("painted brick", _seed(rng), (mix(style.palette[0], (1, 1, 1), 0.3),))
    return Pattern("brick", _seed(rng), (_pick(rng, COLOURS["bricks"]),))


def _wallpaper(rng: np.random.Generator, style: Style, ground: Rgb) -> Pattern:
    tint, accent = content().wallpaper_inks(rng, ground, mix(style.palette[2], style.accent, 0.25))
    # As many papers are plain as printed.
    papers = content().plain_wallpapers if rng.random() < 0.5 else style.papers
    return Pattern("wallpaper", _seed(rng), (ground, tint, accent), variant=_pick(rng, papers))


def _wall_tiles(rng: np.random.Generator, style: Style, height_m: float) -> tuple[Pattern, float]:
    """Wall tiles, and the height near height_m that is a whole number of them."""
    laid, tile_m = _pick(
        rng,
        (("20", 0.2), ("20x40", 0.2), ("30x60", 0.3), ("15", 0.15), ("10", 0.1), ("subway", 0.075)),
    )
    tint = _pick(rng, COLOURS["wall_tiles"])
    if rng.random() < 0.12:
        tint = mix(style.palette[2], (0.95, 0.95, 0.94), 0.3)
    grout = mix(tint, _DIRT, 0.55)
    return Pattern("tiles", _seed(rng), (tint, grout), variant=laid), round(
        height_m / tile_m
    ) * tile_m


def _bathroom_walls(rng: np.random.Generator, style: Style) -> WallFinish:
    above = Pattern("paint", _seed(rng, 3), (_pick(rng, COLOURS["wall_whites"]),))
    draw = rng.random()
    if draw < 0.12:
        light, vein = _pick(rng, _MARBLES[:2])
        return WallFinish(Pattern("marble", _seed(rng), (light, vein)))
    if draw < 0.45:
        tiles, _height = _wall_tiles(rng, style, 2.5)
        return WallFinish(tiles)
    tiles, height = _wall_tiles(rng, style, 2.0 if draw < 0.85 else 1.3)
    return WallFinish(above, low=tiles, low_m=height)


def _dry_floor(rng: np.random.Generator, style: Style, kind: RoomKind) -> Floor:
    # The style's floors, liked most first; carpet only where people sleep or sit.
    liked = [f for f in style.floors if f != "carpet" or kind is not RoomKind.HALL]
    weights = np.array([1.0 / (k + 1) for k in range(len(liked))])
    name = liked[int(rng.choice(len(liked), p=weights / weights.sum()))]
    if name == "carpet":
        return _carpet(rng, style)
    if name == "terracotta":
        return Floor(Pattern("terracotta", _seed(rng), (_pick(rng, COLOURS["clays"]),)))
    return _tile_floor(rng, style) if name == "tiles" else _wood_floor(rng, style, name)


def _wood_floor(rng: np.random.Generator, style: Style, name: str) -> Floor:
    # Floors are seldom of the furniture's own wood.
    wood = style.wood if rng.random() < 0.45 else WOODS[_pick(rng, WOODS_FOR.floors)]
    pattern = Pattern(name, _seed(rng), wood=wood, darkness=round(5 * style.darkness) / 5)
    return Floor(pattern, np.pi / 4 if name == "herringbone" else 0.0)


def _carpet(rng: np.random.Generator, style: Style) -> Floor:
    tint = mix(style.textiles[int(rng.integers(2))], rgb("a89c8a"), 0.45)
    if rng.random() < _PRINTED_CARPETS:
        second = style.textiles[int(rng.integers(len(style.textiles)))]
        tints = (tint, mix(tint, second, 0.75), mix(style.accent, tint, 0.3))
        return Floor(
            Pattern("printed carpet", _seed(rng), tints, variant=_pick(rng, content().wallpapers))
        )
    return Floor(Pattern(_pick(rng, ("carpet", "carpet", "loop carpet")), _seed(rng), (tint,)))


def _tile_floor(rng: np.random.Generator, style: Style) -> Floor:
    draw = rng.random()
    turn = np.pi / 4 if rng.random() < 0.12 else 0.0
    if draw < 0.08:
        light, vein = _pick(rng, _MARBLES)
        return Floor(Pattern("marble", _seed(rng), (light, vein)), turn)
    if draw < 0.16 or (style.floors[0] == "terracotta" and draw < 0.4):
        return Floor(Pattern("terracotta", _seed(rng), (_pick(rng, COLOURS["clays"]),)), turn)
    if draw < 0.25:
        dark = _pick(rng, COLOURS["checkers"])
        tints = (rgb("e6e3db"), dark, mix(dark, _DIRT, 0.5))
        return Floor(
            Pattern(
                "tiles", _seed(rng), tints, variant=_pick(rng, ("15", "20", "30")) + "-checker"
            ),
            turn,
        )
    body = _pick(rng, COLOURS["floor_tiles"])
    stone = "-stone" if rng.random() < 0.55 else ""
    laid = _pick(rng, ("30", "30", "45", "60", "30x60"))
    return Floor(
        Pattern("tiles", _seed(rng), (body, mix(body, _DIRT, 0.6)), variant=laid + stone), turn
    )


def _outdoor_floor(rng: np.random.Generator) -> Floor:
    draw = rng.random()
    if draw < 0.35:
        return Floor(Pattern("planks", _seed(rng), wood=WOODS["teak"], darkness=0.1))
    if draw < 0.6:
        return Floor(Pattern("terracotta", _seed(rng), (_pick(rng, COLOURS["clays"]),)))
    body = _pick(rng, COLOURS["floor_tiles"][2:8])
    return Floor(Pattern("tiles", _seed(rng), (body, mix(body, _DIRT, 0.6)), variant="45-stone"))


def _pick(rng: np.random.Generator, choices: Sequence[_T]) -> _T:
    return choices[int(rng.integers(len(choices)))]


def _seed(rng: np.random.Generator, most: int = SEEDS) -> int:
    # Fewer seeds where pictures hardly differ: equal ones are made once.
    return int(rng.integers(most))
