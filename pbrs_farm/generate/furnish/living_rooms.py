"""Templates of living rooms: the lounge round a television, dining tables, shelves. No effects."""

from __future__ import annotations

from pbrs_farm.core.catalogue import Piece
from pbrs_farm.generate.floor_plan import Rect
from pbrs_farm.generate.furnish.pieces import MAX_CHOICES, Shelf, backed, single, slot
from pbrs_farm.generate.furnish.template import Liking, PieceSlot, Stand, Template

_TO_TABLE_M = 0.45  # from a sofa to its table
_BEHIND_CHAIR_M = 0.75  # from the table's edge
_SEAT_M = 0.6  # length of table edge that a seat takes
_BETWEEN_CHAIRS_M = 0.01  # round the corner of a table
_UNDER_TABLE_M = 0.2  # depth of a chair pushed under the table
_LEAST_HEAD_M = 0.75  # width of a table at whose ends somebody sits
_VIEWING_M = (2.0, 2.25, 2.5, 2.8)  # from the screen to the sofa


def lounges(shelf: Shelf, bounds: Rect, area: float) -> tuple[Template, ...]:
    """Television and cabinet at a wall, sofa opposite, table between, up to two armchairs at the sides."""
    stands = _television_stands(shelf)
    sofas = shelf.of("sofa", width=(1.4, 2.4), depth=(0.6, 1.1))
    if not sofas:
        return ()
    # Take the preferred sofa, and a small one for where it does not fit.
    small = sorted(sofas, key=lambda s: s.size[0] * s.size[1])[0]
    tables = shelf.of("coffee_table", width=(0.8, 1.5), depth=(0.4, 0.85), without="child")
    chairs = shelf.of("armchair", width=(0.5, 1.0), depth=(0.5, 1.0))
    sides = bounds[2] - bounds[0], bounds[3] - bounds[1]
    templates = []
    for sofa in dict.fromkeys((sofas[0], sofas[min(1, len(sofas) - 1)], small)):
        for stand in stands[:2] or [[]]:
            depth = max((s.v + s.depth / 2 for s in stand), default=0.0)
            # Stand the sofa's back at the opposite wall where that is the right distance.
            exact = [round(s - depth - sofa.size[1] - 0.04, 3) for s in sides]
            fits = [d for d in exact if 2.0 <= d <= 3.4]
            for distance in (*fits, *_VIEWING_M):
                for n in (2, 1, 0) if area > 15 and chairs else (0,):
                    templates.append(_lounge(stand, sofa, tables[:1], chairs[:1] * n, distance))
    return tuple(templates)


def _television_stands(shelf: Shelf) -> list[list[PieceSlot]]:
    """A television on what carries it, at the wall."""
    low = shelf.of("tv_stand", height=(0.2, 0.75), depth=(0.3, 0.7))[:MAX_CHOICES]
    low += shelf.of("dresser", height=(0.4, 0.7), depth=(0.3, 0.6))[: MAX_CHOICES - len(low)]
    screens = shelf.of("tv", width=(0.7, 1.3))
    stands = []
    for base in low:
        slots = [backed(base)]
        # A screen is neither wider nor deeper than what carries it.
        fitting = [t for t in screens if t.size[0] <= base.size[0] and t.size[1] < base.size[1]]
        if fitting:
            middle = slots[0].v
            slots.append(slot(fitting[0], 0.0, middle, elevation=shelf.top(base)))
        stands.append(slots)
    return stands


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
            offset = max(tw / 2 + _TO_TABLE_M, w / 2 - 0.3) + chair.size[1] / 2
            slots.append(slot(chair, side * offset, middle - 0.1, turns=side))
        near = middle - td / 2
    front = (-0.5, depth + 0.1, 0.5, near - 0.05)
    clear: tuple[Rect, ...] = ((-half, depth, half, depth + distance),)
    return Template(
        f"lounge with {len(chairs)} armchairs",
        tuple(slots),
        clear,
        (front,),
        rank=1.0 + 0.6 * len(chairs) + 0.3 * (w - 1.8),
        liking=Liking(corner=0.0, back=0.9),
    )


def dining(shelf: Shelf, seats: int, *, at_wall: bool = False) -> tuple[Template, ...]:
    """Tables with chairs for about that many: free in the room, or with one side at a wall."""
    tables = shelf.of("dining_table", height=(0.68, 0.8), width=(0.6, 2.4))
    chairs = shelf.of("chair", height=(0.7, 1.2), width=(0.38, 0.56), without="office desk child")
    if not chairs:
        return ()
    templates = []
    for table in tables:
        w = table.size[0]
        n = _seats(table, at_wall=at_wall)
        if n > seats or n < min(seats, 4) - 2 or (at_wall and w > 1.7):
            continue
        has_heads = not at_wall and n + 2 <= seats and _has_heads(table)
        # Chairs of one side keep their elbows apart.
        share = w / max(n if at_wall else n // 2, 1)
        narrow = [c for c in chairs if c.size[0] <= share - 0.04]
        if not narrow:
            continue
        make = _at_wall if at_wall else _free
        templates.append(make(shelf, table, narrow[0], 0.35 * n))
        if has_heads:
            templates.append(_free(shelf, table, narrow[0], 0.35 * (n + 2), heads=True))
        if len(templates) >= 8:
            break
    return tuple(templates)


def _seats(table: Piece, *, at_wall: bool) -> int:
    w, d = table.size[:2]
    a_side = max(int((w + 0.02) / _SEAT_M), 1)
    if abs(w - d) < 0.15:
        return 2 if at_wall or w < 0.75 else 4
    return min(a_side, 3) if at_wall else 2 * min(a_side, 3)


def _has_heads(table: Piece) -> bool:
    """Whether somebody can sit at either end of a table beside those at its long sides."""
    w, d = table.size[:2]
    return w - d > 0.35 and d > _LEAST_HEAD_M


def _free(
    shelf: Shelf, table: Piece, chair: Piece, rank: float, *, heads: bool = False
) -> Template:
    """A table with chairs at its long sides; heads: and one at either end."""
    w, d, _ = table.size
    n = _seats(table, at_wall=False)
    slots, clear = [slot(table, 0.0, 0.0)], []
    if abs(w - d) < 0.15 and n == 4:
        # One on each side: none goes so far that it meets the one round the corner.
        most = (min(w, d) - chair.size[0]) / 2 - _BETWEEN_CHAIRS_M
        before, behind, left, right = (
            _out(shelf, table, chair, 0.0, turns, most) for turns in (0, 2, -1, 1)
        )
        slots += [
            slot(chair, 0.0, -d / 2 - before),
            slot(chair, 0.0, d / 2 + behind, turns=2),
            slot(chair, -w / 2 - left, 0.0, turns=-1),
            slot(chair, w / 2 + right, 0.0, turns=1),
        ]
        around = (-w / 2 - 0.6, -d / 2 - 0.6, w / 2 + 0.6, d / 2 + 0.6)
        clear = [around]
    else:
        offsets, inner = _chair_offsets(w, n // 2), d / 2
        for u in offsets:
            before, behind = (_out(shelf, table, chair, u, turns) for turns in (0, 2))
            slots += [slot(chair, u, -d / 2 - before), slot(chair, u, d / 2 + behind, turns=2)]
            inner = min(inner, d / 2 + min(before, behind) - chair.size[1] / 2)
        if heads:
            most = _UNDER_TABLE_M
            if inner < chair.size[0] / 2 + _BETWEEN_CHAIRS_M:
                # Chairs at the sides block the chair at the end.
                side = max(map(abs, offsets), default=0.0) + chair.size[0] / 2
                most = w / 2 - side - _BETWEEN_CHAIRS_M
            left, right = (_out(shelf, table, chair, 0.0, turns, most) for turns in (-1, 1))
            slots += [
                slot(chair, -w / 2 - left, 0.0, turns=-1),
                slot(chair, w / 2 + right, 0.0, turns=1),
            ]
        far, end = d / 2 + _BEHIND_CHAIR_M, w / 2 + (_BEHIND_CHAIR_M if heads else 0.3)
        clear = [(-end, -far, end, far)]
    front = (-w / 2 - 0.6, -d / 2 - 0.8, w / 2 + 0.6, d / 2 + 0.8)
    return Template(
        f"table for {n + 2 * heads}",
        tuple(slots),
        tuple(clear),
        (front,),
        Stand.FREE,
        rank=rank,
        liking=Liking(middle=0.1, daylight=0.15),
    )


def _out(
    shelf: Shelf, table: Piece, chair: Piece, u: float, turns: int, most: float = _UNDER_TABLE_M
) -> float:
    """Distance from a table's edge, at u, to the centre of a chair pushed in up to `most` or the first contact."""
    offset = -u if turns == 2 else u
    under = shelf.under_m(chair, table, offset, turns, _UNDER_TABLE_M)
    return chair.size[1] / 2 - min(under, most)


def _at_wall(shelf: Shelf, table: Piece, chair: Piece, rank: float) -> Template:
    w, d, _ = table.size
    slots = [backed(table)]
    n = _seats(table, at_wall=True)
    if abs(w - d) < 0.15:
        # Two who sit face to face.
        v = 0.02 + d / 2
        left, right = (_out(shelf, table, chair, 0.0, turns) for turns in (-1, 1))
        slots += [slot(chair, -w / 2 - left, v, turns=-1), slot(chair, w / 2 + right, v, turns=1)]
        clear: Rect = (-w / 2 - 0.6, 0.0, w / 2 + 0.6, d)
    else:
        slots += [
            slot(chair, u, 0.02 + d + _out(shelf, table, chair, u, 2), turns=2)
            for u in _chair_offsets(w, n)
        ]
        clear = (-w / 2, d, w / 2, d + _BEHIND_CHAIR_M)
    front = (-w / 2 - 0.5, 0.3, w / 2 + 0.5, d + 0.9)
    return Template(
        f"table for {n} at a wall",
        tuple(slots),
        (clear,),
        (front,),
        rank=rank,
        liking=Liking(corner=0.1, daylight=0.15),
    )


def _chair_offsets(width: float, n: int) -> list[float]:
    return [(k - (n - 1) / 2) * width / n for k in range(n)]


def shelves(shelf: Shelf, *, widest: float = 1.8) -> tuple[Template, ...]:
    """Bookcases, one or two side by side, and shelves."""
    templates = []
    for piece in shelf.of("bookcase", "shelves", width=(0.4, widest), height=(0.7, 2.3))[:6]:
        templates.append(single(piece, before=0.5, corner=0.4, rank=0.1))
        w = piece.size[0]
        if 2 * w <= widest and piece.group == "bookcase":
            pair = (backed(piece, -w / 2 - 0.003), backed(piece, w / 2 + 0.003))
            depth = piece.size[1] + 0.02
            templates.append(
                Template(
                    "two bookcases",
                    pair,
                    ((-w, depth, w, depth + 0.5),),
                    ((-w, depth + 0.1, w, depth + 0.6),),
                    rank=0.5,
                    liking=Liking(corner=0.4),
                )
            )
    return tuple(templates)


def dressers(shelf: Shelf, *, deepest: float = 0.6) -> tuple[Template, ...]:
    """Chests and sideboards."""
    pieces = shelf.of("dresser", height=(0.5, 1.2), depth=(0.2, deepest))
    pieces += shelf.of("cabinet", height=(0.5, 2.1), width=(0.3, 1.2), depth=(0.2, deepest))
    return tuple(single(p, before=0.6, rank=0.05 * p.size[0]) for p in pieces[:5])


def armchairs(shelf: Shelf) -> tuple[Template, ...]:
    """An armchair to read in, near a window, a lamp beside it where there is one."""
    lamps = shelf.of("floor_lamp", width=(0.2, 0.5), depth=(0.2, 0.6))
    templates = []
    for chair in shelf.of("armchair", width=(0.5, 1.0))[:3]:
        w, d, _ = chair.size
        clear = ((-w / 2, 0.1 + d, w / 2, d + 0.5),)
        front = ((-w / 2, 0.1 + d, w / 2, d + 0.8),)
        plain = backed(chair, gap=0.1)
        like = Liking(corner=0.1, daylight=0.2)
        if lamps:
            lamp = lamps[0]
            offset = w / 2 + lamp.size[0] / 2 + 0.05
            slots = (plain, slot(lamp, offset, 0.08 + lamp.size[1] / 2))
            templates.append(Template("reading corner", slots, clear, front, rank=0.5, liking=like))
        templates.append(Template("armchair", (plain,), clear, front, liking=like))
    return tuple(templates)


def plants(shelf: Shelf) -> tuple[Template, ...]:
    """Floor plants, in corners and at windows."""
    pots = [
        p for p in shelf.of("plant", width=(0.2, 0.9), height=(0.55, 2.0)) if p.place == "floor"
    ]
    return tuple(single(p, before=0.0, corner=0.6, daylight=0.15, gap=0.04) for p in pots[:4])


def lamps(shelf: Shelf) -> tuple[Template, ...]:
    """Floor lamps."""
    lamp_pieces = shelf.of("floor_lamp", width=(0.2, 0.6))
    return tuple(single(p, before=0.0, corner=0.7, gap=0.05) for p in lamp_pieces[:2])


def pianos(shelf: Shelf) -> tuple[Template, ...]:
    """An upright piano with its bench."""
    templates = []
    benches = [p for p in shelf.of("stool", height=(0.4, 0.6)) if "piano" in p.name.lower()]
    for piano in shelf.of("piano", depth=(0.3, 0.7)):
        d = piano.size[1]
        slots = [backed(piano)]
        slots += [slot(b, 0.0, d + 0.1 + b.size[1] / 2) for b in benches[:1]]
        clear = ((-0.6, d + 0.02, 0.6, d + 0.9),)
        templates.append(Template("piano", tuple(slots), clear, clear, rank=0.3))
    return tuple(templates)
