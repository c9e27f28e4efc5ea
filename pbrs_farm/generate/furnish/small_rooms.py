"""Templates of bathrooms, halls, stores and balconies, and of what fills a wall from side to side. No effects."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from pbrs_farm.core.catalogue import Piece, Place
from pbrs_farm.generate.furnish.pieces import MAX_CHOICES, Shelf, backed, single, slot
from pbrs_farm.generate.furnish.places import BESIDE_M
from pbrs_farm.generate.furnish.template import Liking, Stand, Template


def coats(shelf: Shelf) -> tuple[Template, ...]:
    """Coat racks, narrow wardrobes."""
    racks = shelf.of("clothes_rack", depth=(0.2, 0.6))[:MAX_CHOICES]
    templates = [single(p, before=0.6, rank=0.3) for p in racks]
    slim = shelf.of("wardrobe", depth=(0.3, 0.56), width=(0.8, 1.1), height=(1.4, 2.3))
    return tuple(templates + [single(p, before=0.65) for p in slim[:MAX_CHOICES]])


def consoles(shelf: Shelf) -> tuple[Template, ...]:
    """Hall furniture for keys and shoes: a low chest, narrow shelves, a bench."""
    pieces = shelf.of("dresser", "shelves", depth=(0.2, 0.56), width=(0.4, 1.5), height=(0.4, 1.3))
    templates = [single(p, before=0.6, rank=-0.5 * p.size[1]) for p in pieces[:MAX_CHOICES]]
    benches = shelf.of("stool", width=(0.7, 1.3), height=(0.35, 0.55))
    return tuple(templates + [single(p, before=0.6) for p in benches[:MAX_CHOICES]])


def stores(shelf: Shelf) -> tuple[Template, ...]:
    """Shelves of a store room."""
    pieces = shelf.of("shelves", "bookcase", width=(0.4, 1.1), depth=(0.25, 0.45))
    return tuple(single(p, before=0.5, corner=0.5) for p in pieces[:MAX_CHOICES])


def boxes(shelf: Shelf) -> tuple[Template, ...]:
    """Boxes and baskets on the floor."""
    pieces = [p for p in shelf.of("box", height=(0.25, 0.7)) if p.place == "floor"]
    pieces += shelf.of("basket", width=(0.3, 0.65))
    return tuple(single(p, before=0.0, corner=0.6) for p in pieces[:5])


def outdoor_sets(shelf: Shelf) -> tuple[Template, ...]:
    """A small table with two chairs, or two chairs alone, for a balcony."""
    tables = shelf.of("dining_table", width=(0.5, 0.85), depth=(0.5, 0.85), height=(0.6, 0.8))
    chairs = shelf.of("chair", width=(0.38, 0.65), height=(0.7, 1.0), without="office desk child")
    cafe = [c for c in chairs if "cafe" in c.id.lower() or "plastic" in c.id.lower()]
    chairs = cafe + chairs
    templates = []
    for table in tables[:3]:
        w, d, _ = table.size
        for chair in chairs[:2]:
            left, right = (
                w / 2 + chair.size[1] / 2 - shelf.under_m(chair, table, 0.0, turns, 0.1)
                for turns in (-1, 1)
            )
            v = 0.05 + max(d, chair.size[0]) / 2
            seats = (slot(chair, -left, v, turns=-1), slot(chair, right, v, turns=1))
            templates.append(
                Template(
                    "table and two chairs",
                    (slot(table, 0.0, v), *seats),
                    rank=0.5,
                    liking=Liking(corner=0.4),
                )
            )
    templates += [Template("chair", (backed(c, gap=0.06),)) for c in chairs[:2]]
    return tuple(templates)


_LONGEST_M: Final = 4.4  # maximum length of a filled wall
_STRETCH: Final = (0.85, 1.2)  # what a piece may be narrowed and widened by
_CEILING_M: Final = 2.7  # as high as it goes at most; the room's ceiling makes it lower
_CHOICES: Final = 2  # designs to try at each wall


def fitted_wardrobes(
    shelf: Shelf, stretches: Sequence[float], deepest: float = 0.7
) -> tuple[Template, ...]:
    """A row of doors along each stretch of wall, one behind which clothes hang."""
    return _fitted(shelf, "fitted_wardrobe", stretches, deepest)


def fitted_bookcases(shelf: Shelf, stretches: Sequence[float]) -> tuple[Template, ...]:
    """Shelves along each stretch of wall."""
    return _fitted(shelf, "fitted_bookcase", stretches, 0.45, before=0.5)


def fitted_show_cases(shelf: Shelf, stretches: Sequence[float]) -> tuple[Template, ...]:
    """Doors of glass over cupboards, as long as each stretch of wall, 2.4 m at most."""
    return _fitted(shelf, "fitted_cabinet", stretches, 0.6, longest=2.4)


def _fitted(
    shelf: Shelf,
    group: str,
    stretches: Sequence[float],
    deepest: float,
    *,
    before: float = 0.7,
    longest: float = _LONGEST_M,
) -> tuple[Template, ...]:
    """A piece as long as each stretch (metres) and as high as the room, `before` free; the longest ranks first."""
    pieces = shelf.of(group, depth=(0.1, deepest))
    templates = []
    for width in dict.fromkeys(min(s - 2 * BESIDE_M - 0.004, longest) for s in stretches):
        fits = [p for p in pieces if _STRETCH[0] <= width / p.size[0] <= _STRETCH[1]]
        templates += [_filling(p, width, before) for p in fits[:_CHOICES]]
    return tuple(templates)


def _filling(piece: Piece, width: float, before: float) -> Template:
    size = (width, piece.size[1], max(piece.size[2], _CEILING_M))
    return single(piece, before=before, corner=0.3, rank=0.6 * width, size=size)


_RIM_M: Final = 0.85  # height of the rim of a hanging washbasin
_BESIDE_TOILET_M: Final = 0.18
_GAP: Final = 0.01
_HUNG_GAP: Final = 0.001


def tubs(shelf: Shelf) -> tuple[Template, ...]:
    """Baths and showers in a corner; a bath before a shower where there is room."""
    baths = shelf.of("bathtub", width=(1.4, 1.85), depth=(0.65, 0.85))[:MAX_CHOICES]
    showers = shelf.of("shower", width=(0.7, 1.0), depth=(0.7, 1.2))[:MAX_CHOICES]
    templates = [_cornered(p, 0.4) for p in baths] + [_cornered(p, 0.0) for p in showers]
    # Bathtubs are sold in shorter sizes too.
    templates += [_cornered(p, 0.1, length=1.5) for p in baths if p.size[0] > 1.55]
    small = [_cornered(p, -0.3, length=0.75) for p in showers if p.size[0] > 0.8]
    return tuple(templates + small[:1])


def _cornered(piece: Piece, rank: float, length: float | None = None) -> Template:
    w, d, h = piece.size
    if length is not None:
        d = d * length / w if piece.group == "shower" else d
        w = length
    front = d + _GAP
    return Template(
        piece.group,
        (backed(piece, gap=_GAP, size=(w, d, h)),),
        ((-w / 2, front, w / 2, front + 0.55),),
        ((-w / 2, front + 0.1, w / 2, front + 0.7),),
        Stand.CORNER,
        rank=rank,
    )


def toilets(shelf: Shelf, *, beside: float = _BESIDE_TOILET_M) -> tuple[Template, ...]:
    """Toilets, .60 m free in front."""
    toilet_pieces = shelf.of("toilet", depth=(0.4, 0.85))[:MAX_CHOICES]
    toilet_pieces.sort(key=lambda p: p.size[1] > 0.72)
    return tuple(
        single(p, before=0.6, corner=0.0, gap=_GAP, beside=beside, rank=-0.3 * p.size[1])
        for p in toilet_pieces
    )


def basins(shelf: Shelf, *, small: bool = False, before: float = 0.6) -> tuple[Template, ...]:
    """Templates of washbasins, with pedestals or wall-mounted."""
    widest = 0.62 if small else 1.1
    pieces = shelf.of("washbasin", width=(0.4, widest), depth=(0.3, 0.72))
    if small:
        pieces.sort(key=lambda p: p.size[1])
    templates = []
    for k, piece in enumerate(pieces[:6]):
        hangs = piece.place is Place.WALL
        lift = max(_RIM_M - piece.size[2] * 0.85, 0.3) if hangs else 0.0
        w, d, _ = piece.size
        # Wall-mounted pieces touch their wall.
        slot = backed(piece, gap=_HUNG_GAP if hangs else _GAP, elevation=lift)
        front = d + _GAP
        templates.append(
            Template(
                "washbasin",
                (slot,),
                ((-w / 2, front, w / 2, front + before),),
                ((-w / 2 - 0.1, front + 0.05, w / 2 + 0.1, front + 0.65),),
                rank=0.3 - 0.05 * k if not small else -0.1 * k,
                liking=Liking(corner=0.0),
                stands_off_floor=hangs,
            )
        )
    return tuple(templates)


def washers(shelf: Shelf) -> tuple[Template, ...]:
    """Washing machines."""
    return tuple(
        single(p, before=0.55, corner=0.4, gap=_GAP)
        for p in shelf.of("washer", width=(0.5, 0.7))[:MAX_CHOICES]
    )


def small_things(shelf: Shelf) -> tuple[Template, ...]:
    """Bins, baskets, a bidet, narrow shelves."""
    items = [single(p, before=0.0, corner=0.5) for p in shelf.of("bin", height=(0.2, 0.6))[:2]]
    items += [single(p, before=0.0, corner=0.5) for p in shelf.of("basket", width=(0.3, 0.6))[:2]]
    return tuple(items)


def narrow_shelves(shelf: Shelf) -> tuple[Template, ...]:
    """Shelves that need little room."""
    pieces = shelf.of("shelves", width=(0.3, 0.85), depth=(0.2, 0.45))
    return tuple(single(p, before=0.4, corner=0.4) for p in pieces[:3])
