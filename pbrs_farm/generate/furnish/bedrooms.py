"""Templates of bedrooms: beds with nightstands, wardrobes, desks, toys. No effects."""

from __future__ import annotations

from pbrs_farm.core.catalogue import Piece
from pbrs_farm.generate.furnish.pieces import MAX_CHOICES, Shelf, backed, single, slot
from pbrs_farm.generate.furnish.template import Liking, PieceSlot, Stand, Template

_SIDE_M = 0.6  # free beside a bed
_HEAD_GAP = 0.02
_CHOICES = 12  # beds of a home, in the order of its preference
_CHILDS_SHARE = 0.4  # of homes that take a bed made for a child before all others
_SWIVEL_SHARE = 0.02  # of the chairs that turn, those that a home may have
_BED_LIKES = Liking(corner=0.0, door=0.12, window_wall=-0.5)


def double_beds(shelf: Shelf) -> tuple[Template, ...]:
    """Beds for two with their heads at a wall, two nightstands, one, or none; largest first."""
    templates = []
    for bed in _beds(shelf, (1.3, 2.1))[:6]:
        for n in (2, 1, 0):
            templates.append(_double(bed, shelf, n))
    return tuple(templates)


def _double(bed: Piece, shelf: Shelf, n_stands: int) -> Template:
    width, length, _ = bed.size
    slots = [backed(bed, gap=_HEAD_GAP)]
    stands = shelf.of("nightstand", width=(0.3, 0.55))
    if stands:
        w = stands[0].size[0]
        offset = (width + w) / 2 + 0.03
        slots += [backed(stands[0], u) for u in (-offset, offset)[:n_stands]]
    end = _HEAD_GAP + length
    sides = (
        (-width / 2 - _SIDE_M, 0.0, -width / 2, end),
        (width / 2, 0.0, width / 2 + _SIDE_M, end),
    )
    foot = (-width / 2, end, width / 2, end + _SIDE_M)
    return Template(
        f"{n_stands} nightstands",
        tuple(slots),
        (*sides, foot),
        tuple((u0, 0.7, u1, end) for u0, _, u1, _ in sides),
        rank=0.5 * n_stands + 0.4 * (width - 1.4),
        liking=_BED_LIKES,
    )


def single_beds(shelf: Shelf, *, child: bool = False) -> tuple[Template, ...]:
    """Beds for one in a corner, or along a wall; some of a child's have two floors."""
    beds = _beds(shelf, (0.7, 1.16))
    if child:
        liked = [
            b
            for b in beds
            if {"child", "junior", "bunk", "captain"} & _words_of_piece(b)
            and shelf.likes(b, _CHILDS_SHARE)
        ]
        beds = liked + [b for b in beds if b not in liked]
    stands = shelf.of("nightstand", width=(0.3, 0.55))
    templates = []
    for bed in beds[:4]:
        width, length, _ = bed.size
        side = (width / 2, 0.0, width / 2 + _SIDE_M, _HEAD_GAP + length)
        front = (side[0], 0.7, side[2], side[3])
        for stand in [*stands[:1], None]:
            slots: list[PieceSlot] = [backed(bed, gap=_HEAD_GAP)]
            if stand is not None:
                slots.append(backed(stand, (width + stand.size[0]) / 2 + 0.03))
            rank = 0.4 * (stand is not None)
            templates.append(
                Template(
                    "in a corner",
                    tuple(slots),
                    (side,),
                    (front,),
                    Stand.CORNER,
                    rank=rank + 0.3,
                    liking=_BED_LIKES,
                )
            )
        # Turn it: its long side at the wall, its head in the corner.
        along = slot(bed, 0.0, 0.02 + width / 2, turns=-1)
        front = (-length / 2 + 0.3, 0.02 + width, length / 2, 0.02 + width + _SIDE_M)
        templates.append(
            Template(
                "along a wall",
                (along,),
                ((-length / 2, *front[1:]),),
                (front,),
                Stand.CORNER,
                rank=0.2,
                liking=_BED_LIKES,
            )
        )
    return tuple(templates)


def _beds(shelf: Shelf, widths: tuple[float, float]) -> list[Piece]:
    beds = shelf.of("bed", width=widths, depth=(1.8, 2.35), height=(0.3, 1.9))
    # Where it is too tight for the two that the home likes best, take the smallest of the next ones, not
    # of all: that would be the same bed in every home.
    return [*beds[:2], *sorted(beds[2:_CHOICES], key=lambda b: b.size[0] * b.size[1])]


def _words_of_piece(piece: Piece) -> set[str]:
    return set(piece.name.lower().replace("'", " ").split())


def wardrobes(shelf: Shelf, wanted: float, *, height: float = 2.4) -> tuple[Template, ...]:
    """Rows of one to three wardrobes of a kind, `wanted` metres long at best."""
    pieces = shelf.of("wardrobe", height=(1.4, height - 0.02))
    pieces = pieces or shelf.of("cabinet", height=(1.4, height - 0.02), depth=(0.3, 0.7))
    templates = []
    for piece in pieces[:MAX_CHOICES]:
        for n in (1, 2, 3):
            length = n * piece.size[0]
            if length > max(wanted, 1.0) + 0.5:
                continue
            templates.append(_row_of_wardrobes(piece, n, -abs(length - wanted) * 0.6, 0.7))
    return tuple(templates)


def _row_of_wardrobes(piece: Piece, n: int, rank: float, before: float) -> Template:
    w, d, _ = piece.size
    slots = tuple(backed(piece, (k - (n - 1) / 2) * (w + 0.005)) for k in range(n))
    half, front = n * w / 2, d + 0.02
    return Template(
        f"row of {n}",
        slots,
        ((-half, front, half, front + before),),
        ((-half + 0.1, front + 0.2, half - 0.1, front + before),),
        rank=rank,
        liking=Liking(corner=0.5),
    )


def desks(shelf: Shelf, *, widest: float = 1.65) -> tuple[Template, ...]:
    """A desk at a wall with its chair, near a window."""
    chairs = shelf.of("chair", height=(0.7, 1.1), width=(0.4, 0.7))
    office = [c for c in chairs if "office" in c.id.lower() or "desk" in c.id.lower()]
    office = [c for c in shelf.of("office_chair") if shelf.likes(c, _SWIVEL_SHARE)] + office
    chairs = office + chairs
    templates = []
    for desk in shelf.of("desk", width=(0.9, widest), depth=(0.5, 0.95), height=(0.6, 1.1))[:4]:
        w, d, _ = desk.size
        slots = [backed(desk)]
        if chairs:
            out = chairs[0].size[1] / 2 - shelf.under_m(chairs[0], desk, 0.0, 2, 0.12)
            slots.append(slot(chairs[0], 0.0, 0.02 + d + out, turns=2))
        room = (-0.4, 0.02 + d, 0.4, 0.02 + d + 0.85)
        templates.append(
            Template(
                "desk",
                tuple(slots),
                (room,),
                ((-0.5, d + 0.5, 0.5, d + 1.2),),
                rank=0.3 * (1.2 - abs(w - 1.3)),
                liking=Liking(corner=0.2, daylight=0.3),
            )
        )
    return tuple(templates)


def toys(shelf: Shelf) -> tuple[Template, ...]:
    """Large toys and a child's table on the floor."""
    large = [p for p in shelf.of("toy") if max(p.size[:2]) > 0.45 and p.size[2] > 0.3]
    templates = [single(p, before=0.3, corner=0.4, rank=0.3) for p in large]
    tables = [p for p in shelf.of("coffee_table") if "child" in p.name.lower()]
    stools = shelf.of("chair", height=(0.3, 0.6))
    if tables and stools:
        w, d, _ = tables[0].size
        seat = stools[0].size[1]
        slots = (
            backed(tables[0]),
            slot(stools[0], -w / 2 - seat / 2 + 0.08, 0.02 + d / 2, turns=-1),
            slot(stools[0], w / 2 + seat / 2 - 0.08, 0.02 + d / 2, turns=1),
        )
        templates.append(Template("child's table", slots, rank=0.4))
    return tuple(templates)
