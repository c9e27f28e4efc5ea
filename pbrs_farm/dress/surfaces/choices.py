"""What floors, walls, ceilings and skirting boards of a home are made of, by style; no effects.

The shares are suggestions of ours for European homes; each room draws from a stream of its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from pbrs_farm.dress.joinery.scheme import aged
from pbrs_farm.dress.space.room_kinds import RoomKind
from pbrs_farm.dress.style import WOODS, Rgb, Style, mix, rgb
from pbrs_farm.dress.textures.families import Pattern
from pbrs_farm.dress.textures.wallpaper import inks

_T = TypeVar("_T")
_TILED_FLOORS = (RoomKind.BATHROOM, RoomKind.KITCHEN)
WOOD_FLOORS = ("planks", "strip", "laminate", "herringbone", "chevron")
_WHITES = tuple(
    rgb(c) for c in ("f4f3ef", "f2efe8", "efece4", "f5f6f6", "edeae0", "f3ead9", "e9e8e4", "e9e2d3")
)
_SOFT = tuple(
    rgb(c) for c in ("f0dfb4", "eacb95", "e9c4a4", "e3b9a6", "e8cfc6", "d9b7bb", "cfc3d6", "bfc8dc", "b3cbd9", "b8d3d3", "bcd4c2", "c9d6ad", "dcdcb0", "d6cbb6", "c8b8a3", "bdb9b3")
)  # fmt: skip
_TILE_BODIES = tuple(
    rgb(c) for c in ("ecebe7", "e2ded5", "d5cdbf", "c4bdb1", "a9a6a1", "8c8a87", "6a6866", "d9d5cb", "b8a893", "54524f")
)  # fmt: skip
_WALL_TILES = tuple(
    rgb(c) for c in ("f0efec", "f0efec", "eae6dc", "dcd6c8", "d2dbdb", "c3d0cc", "d3c9bb", "c9cdd0", "9fb4b4", "b9a48c")
)  # fmt: skip
_CLAYS = tuple(rgb(c) for c in ("b47553", "a9694a", "bb8462", "a0614a"))
_BRICKS = tuple(rgb(c) for c in ("985f4b", "8c5544", "a56a50", "7c5244"))
_MARBLES = (("edebe6", "8a8786"), ("e6ddcf", "a38b70"), ("34363a", "b9b4ac"), ("dfe1e0", "777c80"))
_DIRT = rgb("b9b5ac")


@dataclass(frozen=True, slots=True)
class Floor:
    """A floor: its pattern and how it is turned against the room's longer side."""

    pattern: Pattern
    turn_rad: float = 0.0


@dataclass(frozen=True, slots=True)
class WallFinish:
    """What a room's walls show."""

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
    """What all rooms of a home share."""

    dry_floors: tuple[Floor, Floor]  # the usual one, and the one of some rooms
    wet_floor: Floor
    ceiling: Pattern
    wall: Rgb  # the paint of most walls
    has_floor_boards: bool  # skirting boards of the floor's wood, not of the doors'
    board_m: float  # height of the boards that are added


def home_finish(rng: np.random.Generator, style: Style) -> HomeFinish:
    """What the home's builder chose."""
    wood = [f for f in style.floors if f in WOOD_FLOORS] or ["planks"]
    usual = _wood_floor(rng, style, wood[0] if rng.random() < 0.6 else _one(rng, wood))
    second = _dry_floor(rng, style, RoomKind.OTHER)
    white = aged(rng, _one(rng, _WHITES))
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
        return Floor(Pattern("concrete", _seed(rng), (_one(rng, (rgb("a3a29e"), rgb("8f8e8b"))),)))
    if kind in _TILED_FLOORS:
        if rng.random() < 0.85:
            return home.wet_floor if rng.random() < 0.4 else _tile_floor(rng, style)
        return home.dry_floors[0]
    if kind is RoomKind.HALL and rng.random() < 0.3:
        return home.wet_floor
    if kind is RoomKind.BEDROOM and rng.random() < 0.25:
        return _carpet(rng, style)
    # Most dry rooms have one floor, laid at once.
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
        return WallFinish(Pattern("plaster", _seed(rng), (_one(rng, _WHITES),)))
    paint = _paint(rng, style, home)
    if kind is RoomKind.BATHROOM:
        return _bathroom_walls(rng, style)
    if kind is RoomKind.KITCHEN:
        if rng.random() < 0.2:
            tiles, height = _wall_tiles(rng, style, 1.5)
            return WallFinish(paint, low=tiles, low_m=height)
        return WallFinish(paint)
    # Paint most rooms; paper, brick and rough plaster by the style.
    draw = rng.random()
    paper_share = 0.38 if style.walls[0] == "wallpaper" else 0.25 if "wallpaper" in style.walls else 0.05  # fmt: skip
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


def _paint(rng: np.random.Generator, style: Style, home: HomeFinish) -> Pattern:
    draw = rng.random()
    if draw < 0.38:
        tint = home.wall
    elif draw < 0.65:
        tint = style.palette[int(rng.integers(2))]
    elif draw < 0.85:
        tint = mix(style.palette[2], (0.95, 0.94, 0.92), float(rng.uniform(0.3, 0.65)))
    else:
        tint = _one(rng, _SOFT)
    return Pattern("paint", _seed(rng, 3), (tint,))


def _accent(rng: np.random.Generator, style: Style) -> Pattern:
    if "brick" in style.walls and rng.random() < 0.5:
        return _brick(rng, style)
    return Pattern("paint", _seed(rng, 3), (style.palette[2],))


def _brick(rng: np.random.Generator, style: Style) -> Pattern:
    if rng.random() < 0.5:
        return Pattern("painted brick", _seed(rng), (mix(style.palette[0], (1, 1, 1), 0.3),))
    return Pattern("brick", _seed(rng), (_one(rng, _BRICKS),))


def _wallpaper(rng: np.random.Generator, style: Style, ground: Rgb) -> Pattern:
    tint, accent = inks(rng, ground, mix(style.palette[2], style.accent, 0.25))
    return Pattern("wallpaper", _seed(rng), (ground, tint, accent), variant=_one(rng, style.papers))


def _wall_tiles(rng: np.random.Generator, style: Style, height_m: float) -> tuple[Pattern, float]:
    """Wall tiles, and the height near height_m that is a whole number of them."""
    laid, tile_m = _one(rng, (("20", 0.2), ("20x40", 0.2), ("30x60", 0.3), ("15", 0.15), ("10", 0.1), ("subway", 0.075)))  # fmt: skip
    tint = _one(rng, _WALL_TILES)
    if rng.random() < 0.12:
        tint = mix(style.palette[2], (0.95, 0.95, 0.94), 0.3)
    grout = mix(tint, _DIRT, 0.55)
    return Pattern("tiles", _seed(rng), (tint, grout), variant=laid), round(height_m / tile_m) * tile_m  # fmt: skip


def _bathroom_walls(rng: np.random.Generator, style: Style) -> WallFinish:
    above = Pattern("paint", _seed(rng, 3), (_one(rng, _WHITES),))
    draw = rng.random()
    if draw < 0.12:
        light, vein = _one(rng, _MARBLES[:2])
        return WallFinish(Pattern("marble", _seed(rng), (rgb(light), rgb(vein))))
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
        return Floor(Pattern("terracotta", _seed(rng), (_one(rng, _CLAYS),)))
    return _tile_floor(rng, style) if name == "tiles" else _wood_floor(rng, style, name)


def _wood_floor(rng: np.random.Generator, style: Style, name: str) -> Floor:
    # Floors are seldom of the furniture's own wood.
    wood = style.wood if rng.random() < 0.45 else WOODS[_one(rng, ("oak", "pale oak", "oak", "ash", "beech", "walnut", "smoked oak", "grey oak", "pine"))]  # fmt: skip
    pattern = Pattern(name, _seed(rng), wood=wood, darkness=round(style.darkness, 3))
    return Floor(pattern, np.pi / 4 if name == "herringbone" else 0.0)


def _carpet(rng: np.random.Generator, style: Style) -> Floor:
    tint = mix(style.textiles[int(rng.integers(2))], rgb("a89c8a"), 0.45)
    return Floor(Pattern(_one(rng, ("carpet", "carpet", "loop carpet")), _seed(rng), (tint,)))


def _tile_floor(rng: np.random.Generator, style: Style) -> Floor:
    draw = rng.random()
    turn = np.pi / 4 if rng.random() < 0.12 else 0.0
    if draw < 0.08:
        light, vein = _one(rng, _MARBLES)
        return Floor(Pattern("marble", _seed(rng), (rgb(light), rgb(vein))), turn)
    if draw < 0.16 or (style.floors[0] == "terracotta" and draw < 0.4):
        return Floor(Pattern("terracotta", _seed(rng), (_one(rng, _CLAYS),)), turn)
    if draw < 0.25:
        dark = _one(rng, (rgb("3a3a3b"), rgb("6d4436"), rgb("4a5a5c"), rgb("8c8a84")))
        tints = (rgb("e6e3db"), dark, mix(dark, _DIRT, 0.5))
        return Floor(Pattern("tiles", _seed(rng), tints, variant=_one(rng, ("15", "20", "30")) + "-checker"), turn)  # fmt: skip
    body = _one(rng, _TILE_BODIES)
    stone = "-stone" if rng.random() < 0.55 else ""
    laid = _one(rng, ("30", "30", "45", "60", "30x60"))
    return Floor(Pattern("tiles", _seed(rng), (body, mix(body, _DIRT, 0.6)), variant=laid + stone), turn)  # fmt: skip


def _outdoor_floor(rng: np.random.Generator) -> Floor:
    draw = rng.random()
    if draw < 0.35:
        return Floor(Pattern("planks", _seed(rng), wood=WOODS["teak"], darkness=0.1))
    if draw < 0.6:
        return Floor(Pattern("terracotta", _seed(rng), (_one(rng, _CLAYS),)))
    body = _one(rng, _TILE_BODIES[2:8])
    return Floor(Pattern("tiles", _seed(rng), (body, mix(body, _DIRT, 0.6)), variant="45-stone"))


def _one(rng: np.random.Generator, choices: Sequence[_T]) -> _T:
    return choices[int(rng.integers(len(choices)))]


def _seed(rng: np.random.Generator, most: int = 2**31) -> int:
    # Few seeds where pictures hardly differ: equal ones are made once.
    return int(rng.integers(most))
