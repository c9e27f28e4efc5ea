"""Templates of bedrooms, bathrooms, living rooms and small rooms: what stands where, and how it is drawn."""

from __future__ import annotations

from typing import Final

from pbrs_farm.core.catalogue import Piece, Place
from pbrs_farm.generate.floor_plan import Rect
from pbrs_farm.generate.furnish.pieces import Shelf, backed, slot
from pbrs_farm.generate.furnish.template import Liking, PieceSlot, Stand, Template

_SIDE_M = 0.6  # free beside a bed
_HEAD_GAP = 0.02
_CHOICES = 6  # of a kind, the preferred ones: each is tried at every place
_BED_LIKES = Liking(corner=0.0, door=0.12, window_wall=-0.5)


def double_beds(shelf: Shelf) -> tuple[Template, ...]:
    """Beds for two with their heads at a wall, two nightstands, one, or none; largest first."""
    found = []
    for bed in _beds(shelf, (1.3, 2.1))[:6]:
        for n in (2, 1, 0):
            found.append(_double(bed, shelf, n))
    return tuple(found)


def _double(bed: Piece, shelf: Shelf, n_stands: int) -> Template:
    width, length, _ = bed.size
    slots = [backed(bed, gap=_HEAD_GAP)]
    stands = shelf.of("nightstand", width=(0.3, 0.55))
    if stands:
        w = stands[0].size[0]
        at = (width + w) / 2 + 0.03
        slots += [backed(stands[0], u) for u in (-at, at)[:n_stands]]
    end = _HEAD_GAP + length
    sides = (
        (-width / 2 - _SIDE_M, 0.0, -width / 2, end), (width / 2, 0.0, width / 2 + _SIDE_M, end),
    )  # fmt: skip
    foot = (-width / 2, end, width / 2, end + _SIDE_M)
    return Template(
        f"{n_stands} nightstands", tuple(slots), (*sides, foot),
        tuple((u0, 0.7, u1, end) for u0, _, u1, _ in sides),
        rank=0.5 * n_stands + 0.4 * (width - 1.4), liking=_BED_LIKES,
    )  # fmt: skip


def single_beds(shelf: Shelf, *, child: bool = False) -> tuple[Template, ...]:
    """Beds for one in a corner, or along a wall; some of a child's have two floors."""
    beds = _beds(shelf, (0.7, 1.16))
    if child:
        liked = [b for b in beds if {"child", "junior", "bunk", "captain"} & _words(b)]
        beds = liked + [b for b in beds if b not in liked]
    stands = shelf.of("nightstand", width=(0.3, 0.55))
    found = []
    for bed in beds[:4]:
        width, length, _ = bed.size
        side = (width / 2, 0.0, width / 2 + _SIDE_M, _HEAD_GAP + length)
        front = (side[0], 0.7, side[2], side[3])
        for stand in [*stands[:1], None]:
            slots: list[PieceSlot] = [backed(bed, gap=_HEAD_GAP)]
            if stand is not None:
                slots.append(backed(stand, (width + stand.size[0]) / 2 + 0.03))
            rank = 0.4 * (stand is not None)
            found.append(
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
        found.append(
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
    return tuple(found)


def _beds(shelf: Shelf, widths: tuple[float, float]) -> list[Piece]:
    beds = shelf.of("bed", width=widths, depth=(1.8, 2.35), height=(0.3, 1.9))
    # Keep large ones for those who like them: order by preference, then by size where it is tight.
    return [*beds[:2], *sorted(beds[2:], key=lambda b: b.size[0] * b.size[1])]


def _words(piece: Piece) -> set[str]:
    return set(piece.name.lower().replace("'", " ").split())


def wardrobes(shelf: Shelf, wanted: float, *, height: float = 2.4) -> tuple[Template, ...]:
    """Rows of one to three wardrobes of a kind, `wanted` metres long at best."""
    pieces = shelf.of("wardrobe", height=(1.4, height - 0.02))
    pieces = pieces or shelf.of("cabinet", height=(1.4, height - 0.02), depth=(0.3, 0.7))
    found = []
    for piece in pieces[:_CHOICES]:
        for n in (1, 2, 3):
            length = n * piece.size[0]
            if length > max(wanted, 1.0) + 0.5:
                continue
            found.append(_row(piece, n, -abs(length - wanted) * 0.6, 0.7))
    return tuple(found)


def _row(piece: Piece, n: int, rank: float, before: float) -> Template:
    w, d, _ = piece.size
    slots = tuple(backed(piece, (k - (n - 1) / 2) * (w + 0.005)) for k in range(n))
    half, front = n * w / 2, d + 0.02
    return Template(
        f"row of {n}", slots, ((-half, front, half, front + before),),
        ((-half + 0.1, front + 0.2, half - 0.1, front + before),),
        rank=rank, liking=Liking(corner=0.5),
    )  # fmt: skip


def desks(shelf: Shelf, *, widest: float = 1.65) -> tuple[Template, ...]:
    """A desk at a wall with its chair, near a window."""
    chairs = shelf.of("chair", height=(0.7, 1.1), width=(0.4, 0.7))
    office = [c for c in chairs if "office" in c.id.lower() or "desk" in c.id.lower()]
    chairs = office + chairs
    found = []
    for desk in shelf.of("desk", width=(0.9, widest), depth=(0.5, 0.95), height=(0.6, 1.1))[:4]:
        w, d, _ = desk.size
        slots = [backed(desk)]
        if chairs:
            slots.append(slot(chairs[0], 0.0, 0.02 + d - 0.12 + chairs[0].size[1] / 2, turns=2))
        room = (-0.4, 0.02 + d, 0.4, 0.02 + d + 0.85)
        found.append(
            Template(
                "desk", tuple(slots), (room,), ((-0.5, d + 0.5, 0.5, d + 1.2),),
                rank=0.3 * (1.2 - abs(w - 1.3)), liking=Liking(corner=0.2, daylight=0.3),
            )
        )  # fmt: skip
    return tuple(found)


def toys(shelf: Shelf) -> tuple[Template, ...]:
    """Large toys and a child's table on the floor."""
    large = [p for p in shelf.of("toy") if max(p.size[:2]) > 0.45 and p.size[2] > 0.3]
    found = [single(p, before=0.3, corner=0.4, rank=0.3) for p in large]
    tables = [p for p in shelf.of("coffee_table") if "child" in p.name.lower()]
    stools = shelf.of("chair", height=(0.3, 0.6))
    if tables and stools:
        w, d, _ = tables[0].size
        seat = stools[0].size[1]
        slots = (
            backed(tables[0]), slot(stools[0], -w / 2 - seat / 2 + 0.08, 0.02 + d / 2, turns=-1),
            slot(stools[0], w / 2 + seat / 2 - 0.08, 0.02 + d / 2, turns=1),
        )  # fmt: skip
        found.append(Template("child's table", slots, rank=0.4))
    return tuple(found)


def single(
    piece: Piece, *, before: float = 0.6, corner: float = 0.3, rank: float = 0.0,
    daylight: float = 0.0, size: tuple[float, float, float] | None = None, gap: float = 0.02,
    elevation: float = 0.0, beside: float = 0.0,
) -> Template:  # fmt: skip
    """One piece with its back at a wall and `before` metres free in front."""
    w, d, _ = size or piece.size
    half, front = w / 2 + beside, d + gap
    clear = ((-half, gap if beside else front, half, front + before),) if before else ()
    reach = ((-w / 2, front + 0.05, w / 2, front + max(before, 0.6)),) if before >= 0.4 else ()
    return Template(
        piece.group, (backed(piece, gap=gap, elevation=elevation, size=size),), clear, reach,
        rank=rank, liking=Liking(corner=corner, daylight=daylight),
    )  # fmt: skip


# Templates of bathrooms and WCs.


_RIM_M: Final = 0.85  # of a washbasin that hangs
_BESIDE_TOILET_M: Final = 0.18
_GAP: Final = 0.01
_HUNG_GAP: Final = 0.001


def tubs(shelf: Shelf) -> tuple[Template, ...]:
    """Baths and showers in a corner; a bath before a shower where there is room."""
    baths = shelf.of("bathtub", width=(1.4, 1.85), depth=(0.65, 0.85))[:_CHOICES]
    showers = shelf.of("shower", width=(0.7, 1.0), depth=(0.7, 1.2))[:_CHOICES]
    found = [_cornered(p, 0.4) for p in baths] + [_cornered(p, 0.0) for p in showers]
    # A bath can be made a little shorter, as they are sold.
    found += [_cornered(p, 0.1, length=1.5) for p in baths if p.size[0] > 1.55]
    small = [_cornered(p, -0.3, length=0.75) for p in showers if p.size[0] > 0.8]
    return tuple(found + small[:1])


def _cornered(piece: Piece, rank: float, length: float | None = None) -> Template:
    w, d, h = piece.size
    if length is not None:
        d = d * length / w if piece.group == "shower" else d
        w = length
    front = d + _GAP
    return Template(
        piece.group, (backed(piece, gap=_GAP, size=(w, d, h)),),
        ((-w / 2, front, w / 2, front + 0.55),), ((-w / 2, front + 0.1, w / 2, front + 0.7),),
        Stand.CORNER, rank=rank,
    )  # fmt: skip


def toilets(shelf: Shelf, *, beside: float = _BESIDE_TOILET_M) -> tuple[Template, ...]:
    """Toilets, .60 m free in front."""
    found = shelf.of("toilet", depth=(0.4, 0.85))[:_CHOICES]
    found.sort(key=lambda p: p.size[1] > 0.72)
    return tuple(
        single(p, before=0.6, corner=0.0, gap=_GAP, beside=beside, rank=-0.3 * p.size[1])
        for p in found
    )


def basins(shelf: Shelf, *, small: bool = False, before: float = 0.6) -> tuple[Template, ...]:
    """Washbasins that stand or hang."""
    widest = 0.62 if small else 1.1
    pieces = shelf.of("washbasin", width=(0.4, widest), depth=(0.3, 0.72))
    if small:
        pieces.sort(key=lambda p: p.size[1])
    found = []
    for k, piece in enumerate(pieces[:6]):
        hangs = piece.place is Place.WALL
        lift = max(_RIM_M - piece.size[2] * 0.85, 0.3) if hangs else 0.0
        w, d, _ = piece.size
        # What hangs touches its wall.
        slot = backed(piece, gap=_HUNG_GAP if hangs else _GAP, elevation=lift)
        front = d + _GAP
        found.append(
            Template(
                "washbasin", (slot,), ((-w / 2, front, w / 2, front + before),),
                ((-w / 2 - 0.1, front + 0.05, w / 2 + 0.1, front + 0.65),),
                rank=0.3 - 0.05 * k if not small else -0.1 * k, liking=Liking(corner=0.0),
                stands_off_floor=hangs,
            )
        )  # fmt: skip
    return tuple(found)


def washers(shelf: Shelf) -> tuple[Template, ...]:
    """Washing machines."""
    return tuple(
        single(p, before=0.55, corner=0.4, gap=_GAP)
        for p in shelf.of("washer", width=(0.5, 0.7))[:_CHOICES]
    )


def small_things(shelf: Shelf) -> tuple[Template, ...]:
    """Bins, baskets, a bidet, narrow shelves."""
    found = [single(p, before=0.0, corner=0.5) for p in shelf.of("bin", height=(0.2, 0.6))[:2]]
    found += [single(p, before=0.0, corner=0.5) for p in shelf.of("basket", width=(0.3, 0.6))[:2]]
    return tuple(found)


def narrow_shelves(shelf: Shelf) -> tuple[Template, ...]:
    """Shelves that need little room."""
    pieces = shelf.of("shelves", width=(0.3, 0.85), depth=(0.2, 0.45))
    return tuple(single(p, before=0.4, corner=0.4) for p in pieces[:3])


# Templates of halls, stores, wardrobe rooms and balconies.


def coats(shelf: Shelf) -> tuple[Template, ...]:
    """Coat racks, narrow wardrobes."""
    racks = shelf.of("clothes_rack", depth=(0.2, 0.6))[:_CHOICES]
    found = [single(p, before=0.6, rank=0.3) for p in racks]
    slim = shelf.of("wardrobe", depth=(0.3, 0.56), width=(0.8, 1.1), height=(1.4, 2.3))
    return tuple(found + [single(p, before=0.65) for p in slim[:_CHOICES]])


def consoles(shelf: Shelf) -> tuple[Template, ...]:
    """What keys and shoes lie on: a low chest, narrow shelves, a bench."""
    pieces = shelf.of("dresser", "shelves", depth=(0.2, 0.56), width=(0.4, 1.5), height=(0.4, 1.3))
    found = [single(p, before=0.6, rank=-0.5 * p.size[1]) for p in pieces[:_CHOICES]]
    benches = shelf.of("stool", width=(0.7, 1.3), height=(0.35, 0.55))
    return tuple(found + [single(p, before=0.6) for p in benches[:_CHOICES]])


def stores(shelf: Shelf) -> tuple[Template, ...]:
    """Shelves of a store room."""
    pieces = shelf.of("shelves", "bookcase", width=(0.4, 1.1), depth=(0.25, 0.45))
    return tuple(single(p, before=0.5, corner=0.5) for p in pieces[:_CHOICES])


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
    found = []
    for table in tables[:3]:
        w, d, _ = table.size
        for chair in chairs[:2]:
            out = w / 2 + chair.size[1] / 2 - 0.1
            v = 0.05 + max(d, chair.size[0]) / 2
            seats = (slot(chair, -out, v, turns=-1), slot(chair, out, v, turns=1))
            found.append(
                Template(
                    "table and two chairs", (slot(table, 0.0, v), *seats), rank=0.5,
                    liking=Liking(corner=0.4),
                )
            )  # fmt: skip
    found += [Template("chair", (backed(c, gap=0.06),)) for c in chairs[:2]]
    return tuple(found)


# Templates of living rooms: the lounge round a television, dining tables, shelves.


_TO_TABLE_M = 0.45  # from a sofa to its table
_BEHIND_CHAIR_M = 0.75  # from the table's edge
_SEAT_M = 0.6  # of table edge
_UNDER_TABLE_M = 0.2  # of a chair
_VIEWING_M = (2.0, 2.25, 2.5, 2.8)  # from the screen to the sofa


def lounges(shelf: Shelf, bounds: Rect, area: float) -> tuple[Template, ...]:
    """Television and stand at a wall, sofa opposite, table between, up to two armchairs beside."""
    stands = _stands(shelf)
    sofas = shelf.of("sofa", width=(1.4, 2.4), depth=(0.6, 1.1))
    if not sofas:
        return ()
    # Take the preferred sofa, and a small one for where it does not fit.
    small = sorted(sofas, key=lambda s: s.size[0] * s.size[1])[0]
    tables = shelf.of("coffee_table", width=(0.8, 1.5), depth=(0.4, 0.85), without="child")
    chairs = shelf.of("armchair", width=(0.5, 1.0), depth=(0.5, 1.0))
    sides = bounds[2] - bounds[0], bounds[3] - bounds[1]
    found = []
    for sofa in dict.fromkeys((sofas[0], sofas[min(1, len(sofas) - 1)], small)):
        for stand in stands[:2] or [[]]:
            depth = max((s.v + s.depth / 2 for s in stand), default=0.0)
            # Stand the sofa's back at the opposite wall where that is the right distance.
            exact = [round(s - depth - sofa.size[1] - 0.04, 3) for s in sides]
            fits = [d for d in exact if 2.0 <= d <= 3.4]
            for distance in (*fits, *_VIEWING_M):
                for n in (2, 1, 0) if area > 15 and chairs else (0,):
                    found.append(_lounge(stand, sofa, tables[:1], chairs[:1] * n, distance))
    return tuple(found)


def _stands(shelf: Shelf) -> list[list[PieceSlot]]:
    """A television on what carries it, at the wall."""
    low = shelf.of("tv_stand", height=(0.2, 0.75), depth=(0.3, 0.7))[:_CHOICES]
    low += shelf.of("dresser", height=(0.4, 0.7), depth=(0.3, 0.6))[: _CHOICES - len(low)]
    screens = shelf.of("tv", width=(0.7, 1.3))
    found = []
    for base in low:
        slots = [backed(base)]
        # A screen is neither wider nor deeper than what carries it.
        fitting = [t for t in screens if t.size[0] <= base.size[0] and t.size[1] < base.size[1]]
        if fitting:
            middle = slots[0].v
            slots.append(slot(fitting[0], 0.0, middle, elevation=shelf.top(base)))
        found.append(slots)
    return found


def _lounge(
    stand: list[PieceSlot], sofa: Piece, tables: list[Piece], chairs: list[Piece], distance: float
) -> Template:
    depth = max((s.v + s.depth / 2 for s in stand), default=0.0)
    w, d, _ = sofa.size
    slots = [*stand, slot(sofa, 0.0, depth + distance + d / 2, turns=2)]
    half = w / 2
    near = depth + distance
    if tables:
        tw, td, _ = tables[0].size
        middle = near - _TO_TABLE_M - td / 2
        slots.append(slot(tables[0], 0.0, middle, turns=2))
        # Armchairs look at each other over the table.
        for side, chair in zip((-1, 1), chairs, strict=False):
            at = max(tw / 2 + _TO_TABLE_M, w / 2 - 0.3) + chair.size[1] / 2
            slots.append(slot(chair, side * at, middle - 0.1, turns=side))
        near = middle - td / 2
    front = (-0.5, depth + 0.1, 0.5, near - 0.05)
    clear: tuple[Rect, ...] = ((-half, depth, half, depth + distance),)
    return Template(
        f"lounge with {len(chairs)} armchairs", tuple(slots), clear, (front,),
        rank=1.0 + 0.6 * len(chairs) + 0.3 * (w - 1.8), liking=Liking(corner=0.0, back=0.9),
    )  # fmt: skip


def dining(shelf: Shelf, seats: int, *, at_wall: bool = False) -> tuple[Template, ...]:
    """Tables with chairs for about that many: free in the room, or with one side at a wall."""
    tables = shelf.of("dining_table", height=(0.68, 0.8), width=(0.6, 2.4))
    chairs = shelf.of("chair", height=(0.7, 1.2), width=(0.38, 0.56), without="office desk child")
    if not chairs:
        return ()
    found = []
    for table in tables:
        w = table.size[0]
        n = _seats(table, at_wall=at_wall)
        if n > seats or n < min(seats, 4) - 2 or (at_wall and w > 1.7):
            continue
        # Chairs of one side keep their elbows apart.
        share = w / max(n if at_wall else n // 2, 1)
        narrow = [c for c in chairs if c.size[0] <= share - 0.04]
        if not narrow:
            continue
        make = _at_wall if at_wall else _free
        found.append(make(table, narrow[0], 0.35 * n))
        if len(found) >= 6:
            break
    return tuple(found)


def _seats(table: Piece, *, at_wall: bool) -> int:
    w, d = table.size[:2]
    a_side = max(int((w + 0.02) / _SEAT_M), 1)
    if abs(w - d) < 0.15:
        return 2 if at_wall or w < 0.75 else 4
    return min(a_side, 3) if at_wall else 2 * min(a_side, 3)


def _free(table: Piece, chair: Piece, rank: float) -> Template:
    w, d, _ = table.size
    n = _seats(table, at_wall=False)
    slots, clear = [slot(table, 0.0, 0.0)], []
    out = chair.size[1] / 2 - _UNDER_TABLE_M
    if abs(w - d) < 0.15 and n == 4:
        # One on each side.
        slots += [
            slot(chair, 0.0, -d / 2 - out), slot(chair, 0.0, d / 2 + out, turns=2),
            slot(chair, -w / 2 - out, 0.0, turns=-1), slot(chair, w / 2 + out, 0.0, turns=1),
        ]  # fmt: skip
        around = (-w / 2 - 0.6, -d / 2 - 0.6, w / 2 + 0.6, d / 2 + 0.6)
        clear = [around]
    else:
        for u in _along(w, n // 2):
            slots += [slot(chair, u, -d / 2 - out), slot(chair, u, d / 2 + out, turns=2)]
        far = d / 2 + _BEHIND_CHAIR_M
        clear = [(-w / 2 - 0.3, -far, w / 2 + 0.3, far)]
    front = (-w / 2 - 0.6, -d / 2 - 0.8, w / 2 + 0.6, d / 2 + 0.8)
    return Template(
        f"table for {n}", tuple(slots), tuple(clear), (front,), Stand.FREE, rank=rank,
        liking=Liking(middle=0.1, daylight=0.15),
    )  # fmt: skip


def _at_wall(table: Piece, chair: Piece, rank: float) -> Template:
    w, d, _ = table.size
    slots = [backed(table)]
    out = chair.size[1] / 2 - _UNDER_TABLE_M
    n = _seats(table, at_wall=True)
    if abs(w - d) < 0.15:
        # Two who sit face to face.
        v = 0.02 + d / 2
        slots += [slot(chair, -w / 2 - out, v, turns=-1), slot(chair, w / 2 + out, v, turns=1)]
        clear: Rect = (-w / 2 - 0.6, 0.0, w / 2 + 0.6, d)
    else:
        slots += [slot(chair, u, 0.02 + d + out, turns=2) for u in _along(w, n)]
        clear = (-w / 2, d, w / 2, d + _BEHIND_CHAIR_M)
    front = (-w / 2 - 0.5, 0.3, w / 2 + 0.5, d + 0.9)
    return Template(
        f"table for {n} at a wall", tuple(slots), (clear,), (front,), rank=rank,
        liking=Liking(corner=0.1, daylight=0.15),
    )  # fmt: skip


def _along(width: float, n: int) -> list[float]:
    return [(k - (n - 1) / 2) * width / n for k in range(n)]


def shelves(shelf: Shelf, *, widest: float = 1.8) -> tuple[Template, ...]:
    """Bookcases, one or two side by side, and shelves."""
    found = []
    for piece in shelf.of("bookcase", "shelves", width=(0.4, widest), height=(0.7, 2.3))[:6]:
        found.append(single(piece, before=0.5, corner=0.4, rank=0.1))
        w = piece.size[0]
        if 2 * w <= widest and piece.group == "bookcase":
            pair = (backed(piece, -w / 2 - 0.003), backed(piece, w / 2 + 0.003))
            depth = piece.size[1] + 0.02
            found.append(
                Template(
                    "two bookcases", pair, ((-w, depth, w, depth + 0.5),),
                    ((-w, depth + 0.1, w, depth + 0.6),), rank=0.5, liking=Liking(corner=0.4),
                )
            )  # fmt: skip
    return tuple(found)


def dressers(shelf: Shelf, *, deepest: float = 0.6) -> tuple[Template, ...]:
    """Chests and sideboards."""
    pieces = shelf.of("dresser", height=(0.5, 1.2), depth=(0.2, deepest))
    pieces += shelf.of("cabinet", height=(0.5, 2.1), width=(0.3, 1.2), depth=(0.2, deepest))
    return tuple(single(p, before=0.6, rank=0.05 * p.size[0]) for p in pieces[:5])


def armchairs(shelf: Shelf) -> tuple[Template, ...]:
    """An armchair to read in, near a window, a lamp beside it where there is one."""
    lamps = shelf.of("floor_lamp", width=(0.2, 0.5), depth=(0.2, 0.6))
    found = []
    for chair in shelf.of("armchair", width=(0.5, 1.0))[:3]:
        w, d, _ = chair.size
        clear = ((-w / 2, 0.1 + d, w / 2, d + 0.5),)
        front = ((-w / 2, 0.1 + d, w / 2, d + 0.8),)
        plain = backed(chair, gap=0.1)
        like = Liking(corner=0.1, daylight=0.2)
        if lamps:
            lamp = lamps[0]
            at = w / 2 + lamp.size[0] / 2 + 0.05
            slots = (plain, slot(lamp, at, 0.08 + lamp.size[1] / 2))
            found.append(Template("reading corner", slots, clear, front, rank=0.5, liking=like))
        found.append(Template("armchair", (plain,), clear, front, liking=like))
    return tuple(found)


def plants(shelf: Shelf) -> tuple[Template, ...]:
    """Plants that stand on the floor, in corners and by windows."""
    pots = [
        p for p in shelf.of("plant", width=(0.2, 0.9), height=(0.55, 2.0)) if p.place == "floor"
    ]
    return tuple(single(p, before=0.0, corner=0.6, daylight=0.15, gap=0.04) for p in pots[:4])


def lamps(shelf: Shelf) -> tuple[Template, ...]:
    """Lamps that stand on the floor."""
    found = shelf.of("floor_lamp", width=(0.2, 0.6))
    return tuple(single(p, before=0.0, corner=0.7, gap=0.05) for p in found[:2])


def pianos(shelf: Shelf) -> tuple[Template, ...]:
    """An upright piano with its bench."""
    found = []
    benches = [p for p in shelf.of("stool", height=(0.4, 0.6)) if "piano" in p.name.lower()]
    for piano in shelf.of("piano", depth=(0.3, 0.7)):
        d = piano.size[1]
        slots = [backed(piano)]
        slots += [slot(b, 0.0, d + 0.1 + b.size[1] / 2) for b in benches[:1]]
        clear = ((-0.6, d + 0.02, 0.6, d + 0.9),)
        found.append(Template("piano", tuple(slots), clear, clear, rank=0.3))
    return tuple(found)
