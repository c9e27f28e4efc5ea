"""Templates of bathrooms and WCs. No effects."""

from __future__ import annotations

from typing import Final

from pbrs_farm.core.catalogue import Piece, Place
from pbrs_farm.generate.furnish.pieces import MAX_CHOICES, Shelf, backed, single
from pbrs_farm.generate.furnish.template import Liking, Stand, Template

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
