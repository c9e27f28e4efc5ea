"""Small rooms cut from the rectangle of a larger one: its guests, each a strip or a corner. No effects."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Final

from pbrs_farm.generate.floor_plan import RoomType
from pbrs_farm.generate.programme import Programme, RoomWish
from pbrs_farm.generate.slicing_goals import STEP_M, Brief, IntRect, shared_length

# fmt: off
MIN_WIDTH: Final = {
    RoomType.LIVING: 3.2, RoomType.STUDIO: 3.2, RoomType.KITCHEN: 2.1, RoomType.BEDROOM: 2.6,
    RoomType.OFFICE: 2.2, RoomType.DINING: 2.6,
    RoomType.BATHROOM: 1.55, RoomType.HALL: 1.1, RoomType.WC: 0.9, RoomType.STORE: 0.9,
    RoomType.WARDROBE: 1.4, RoomType.STAIRS: 0.0,
}
# fmt: on
# fmt: off
MAX_ASPECT: Final = {
    RoomType.LIVING: 1.7, RoomType.STUDIO: 1.7, RoomType.KITCHEN: 1.9, RoomType.BEDROOM: 1.6,
    RoomType.OFFICE: 1.8, RoomType.DINING: 1.6,
    RoomType.BATHROOM: 1.7, RoomType.HALL: 8.0, RoomType.WC: 1.9, RoomType.STORE: 1.8,
    RoomType.WARDROBE: 1.8, RoomType.STAIRS: math.inf,
}
# fmt: on
DOOR_WALL_M: Final = 1.2  # a door of 0.9 m, 10 cm from the corner, and the walls' thickness
DAYLIGHT_M: Final = 2.0  # least length of outer wall for a room with a window
_FLOOR_A_GLASS_M: Final = 8 * 2.1 / 1.05  # m2 that a metre of French window lights: 8 of its glass
_BESIDE_GLASS_M: Final = 0.96  # the outer walls' halves at its ends, and 35 cm beside it
WALL_M: Final = 0.14  # mean thickness of walls
SMALL: Final = frozenset([RoomType.STORE, RoomType.WARDROBE, RoomType.WC])
_CUT_FROM: Final = {
    RoomType.WARDROBE: (RoomType.BEDROOM,),
    RoomType.STORE: (RoomType.BEDROOM, RoomType.KITCHEN),
    RoomType.WC: (RoomType.BATHROOM, RoomType.BEDROOM),
    RoomType.BATHROOM: (RoomType.BEDROOM,),  # the second one
}  # what a small room is cut from, the preferred type first
_WC_BELOW: Final = (RoomType.LIVING,)  # where the bathrooms are on another storey
_STRIP_ASPECT: Final = 2.15  # largest length by width of a room along a whole side of its host
_CORNER_ASPECTS: Final = (1.3, 1.6, 1.0)
_ARM_M: Final = 1.0  # the narrowest part of a host that its guest leaves

Cut = tuple[IntRect, tuple[IntRect, ...]]  # the guest, and the remainder of its host


def hosts_of(programme: Programme) -> dict[int, int]:
    """Small room -> the room it is cut from: each host has one guest at most.

    Rooms of the types in _CUT_FROM, but for the first bathroom, are not laid out by themselves but
    cut from a larger one. A room that wishes a neighbour is never cut from another.
    """
    hosts: dict[int, int] = {}
    bathrooms = (i for i, wish in enumerate(programme.rooms) if wish.type is RoomType.BATHROOM)
    first = next(bathrooms, -1)
    cut_from = _CUT_FROM if first >= 0 else {**_CUT_FROM, RoomType.WC: _WC_BELOW}
    # A room with required neighbours keeps a separate rectangle.
    wished = {k for room, partners in programme.adjacent for k in (room, *partners)}
    for number, wish in enumerate(programme.rooms):
        types = cut_from.get(wish.type, ()) if number not in wished else ()
        if wish.type is RoomType.BATHROOM and first == number:
            continue
        free = [
            i
            for i, host_wish in enumerate(programme.rooms)
            if host_wish.type in types and i not in hosts.values() and i not in hosts
        ]
        if free:
            # The largest room can spare most.
            rank = {t: -k for k, t in enumerate(types)}
            rooms = programme.rooms
            hosts[number] = max(free, key=lambda i: (rank[rooms[i].type], rooms[i].area))
    return hosts


def first_of(programme: Programme, type_: RoomType) -> int:
    """The number of the first room of a type."""
    return next(i for i, wish in enumerate(programme.rooms) if wish.type is type_)


def cut_guests(
    parts: list[tuple[IntRect, ...]],
    programme: Programme,
    hosts: dict[int, int],
    brief: Brief,
    notch: IntRect | None,
) -> set[int]:
    """Cut each small room from its host's rectangle, in place; returns rooms whose cut breaks a rule.

    parts: the rectangles of each room; a host's shrinks or becomes an L. hosts: small room -> its
    host. notch: a part of the outline without floor. Among valid cuts the one with most daylight and
    the best shapes wins.
    """
    uncut: set[int] = set()
    for guest, host in hosts.items():
        wish = programme.rooms[guest]
        whole = parts[host][0]
        fitting = (
            (inner, rest)
            for inner, rest in (*_strips(whole, wish), *_corner_cuts(whole, wish))
            if _fits_room_type(inner, wish.type)
            and any(
                _fits_room_type(r, programme.rooms[host].type) for r in _rectangles(rest, inner)
            )
            and _keeps_rules((inner, rest), parts, programme, (guest, host), brief, notch)
        )
        cut = next(fitting, None)
        if cut is None:
            uncut.add(guest)
        else:
            parts[guest], parts[host] = (cut[0],), cut[1]
    return uncut


def _keeps_rules(
    cut: Cut,
    parts: list[tuple[IntRect, ...]],
    programme: Programme,
    pair: tuple[int, int],
    brief: Brief,
    notch: IntRect | None,
) -> bool:
    """The host keeps its door and its daylight; a guest that is not the host's own has a door."""
    inner, rest = cut
    wish, host = (programme.rooms[k] for k in pair)
    halls, living = parts[first_of(programme, RoomType.HALL)], parts[0]

    def ways_to(type_: RoomType) -> tuple[IntRect, ...]:
        from_ = programme.entered_from(type_)
        rooms = zip(programme.rooms, parts, strict=True)
        return tuple(rect for room, rects in rooms if room.type in from_ for rect in rects)

    if host.type is RoomType.KITCHEN:
        wide = 2.0 if programme.open_kitchen else DOOR_WALL_M
        if _shared_length(rest, (*halls, *living)) < wide:
            return False
    elif _shared_length(rest, ways_to(host.type)) < door_m(host.type):
        return False
    # The remaining living room keeps its access to the kitchen.
    if host.type is RoomType.LIVING:
        kitchen = parts[first_of(programme, RoomType.KITCHEN)]
        ways = rest if programme.open_kitchen else (*rest, *halls)
        if _shared_length(kitchen, ways) < (2.0 if programme.open_kitchen else DOOR_WALL_M):
            return False
    # A wardrobe is entered from its bedroom, a store of a kitchen from there.
    if _opens_to_hall(wish, host) and _shared_length((inner,), ways_to(wish.type)) < door_m(
        wish.type
    ):
        return False
    lit = max(daylight_length(r, brief, notch) for r in rest) * STEP_M
    return not host.type.is_habitable or lit >= daylight_m(host.area)


def _opens_to_hall(wish: RoomWish, host: RoomWish) -> bool:
    is_own = wish.type in (RoomType.WARDROBE, RoomType.BATHROOM)
    return not is_own and host.type is not RoomType.KITCHEN


def hall_wall_m(host: RoomWish, guest: RoomWish | None) -> float:
    """Metres of wall that a room and its guest need at the hall, for their doors."""
    own_m = door_m(host.type)
    return own_m + door_m(guest.type) if guest and _opens_to_hall(guest, host) else own_m


def _shared_length(rects: tuple[IntRect, ...], others: tuple[IntRect, ...]) -> float:
    return max(shared_length(a, b) for a in rects for b in others) * STEP_M


def _strips(whole: IntRect, wish: RoomWish) -> Iterator[Cut]:
    """A strip along each side of a rectangle, with the required area or minimum width.

    Strips are at most twice as long as wide; strips that would be far too large are skipped.
    """
    x0, z0, x1, z1 = whole
    least = MIN_WIDTH[wish.type] + WALL_M

    def width(side: float) -> int:
        wide = max(wish.area / (side - WALL_M) + WALL_M, least, side / _STRIP_ASPECT)
        is_large = (wide - WALL_M) * (side - WALL_M) > 1.4 * wish.area
        return 10**6 if is_large else math.ceil(wide / STEP_M)

    across, along = width((z1 - z0) * STEP_M), width((x1 - x0) * STEP_M)
    if across < x1 - x0:
        yield (x0, z0, x0 + across, z1), ((x0 + across, z0, x1, z1),)
        yield (x1 - across, z0, x1, z1), ((x0, z0, x1 - across, z1),)
    if along < z1 - z0:
        yield (x0, z0, x1, z0 + along), ((x0, z0 + along, x1, z1),)
        yield (x0, z1 - along, x1, z1), ((x0, z0, x1, z1 - along),)


def _corner_cuts(whole: IntRect, wish: RoomWish) -> Iterator[Cut]:
    """A rectangle of the required area in each corner of another, leaving an L."""
    if wish.type not in SMALL:
        return
    x0, z0, x1, z1 = whole
    least, arm = MIN_WIDTH[wish.type], math.ceil((_ARM_M + WALL_M) / STEP_M)
    for aspect in _CORNER_ASPECTS:
        short = max(math.sqrt(wish.area / aspect), least)
        sides = [math.ceil((s + WALL_M) / STEP_M) for s in (short, wish.area / short)]
        for w, d in (sides, sides[::-1]):
            if w > x1 - x0 - arm or d > z1 - z0 - arm:
                continue
            for xa, xb in ((x0, x0 + w), (x1 - w, x1)):
                beside = (xb, x1) if xa == x0 else (x0, xa)
                for za, zb in ((z0, z0 + d), (z1 - d, z1)):
                    rest = (zb, z1) if za == z0 else (z0, za)
                    rest_of_whole = (x0, rest[0], x1, rest[1]), (beside[0], za, beside[1], zb)
                    yield (xa, za, xb, zb), rest_of_whole


def _rectangles(rest: tuple[IntRect, ...], inner: IntRect) -> Iterator[IntRect]:
    """The largest rectangles in what a guest leaves: along its long side, and beside it."""
    yield rest[0]
    if len(rest) > 1:
        xa, _, xb, _ = rest[1]
        yield xa, min(rest[0][1], inner[1]), xb, max(rest[0][3], inner[3])


def guest_area(guest: RoomWish, host: RoomWish) -> float:
    """Square metres that a host needs for its guest and the walls between."""
    if guest.type in SMALL:
        return guest.area + 2 * math.sqrt(guest.area) * WALL_M
    side = math.sqrt(host.area)
    return max(guest.area, side * side / _STRIP_ASPECT) + WALL_M * side


def _fits_room_type(rect: IntRect, type_: RoomType) -> bool:
    sides = sorted(side * STEP_M - WALL_M for side in (rect[2] - rect[0], rect[3] - rect[1]))
    return sides[0] >= MIN_WIDTH[type_] and sides[1] <= 1.2 * MAX_ASPECT[type_] * sides[0]


def door_m(type_: RoomType) -> float:
    """Metres of wall that a door of such a room needs: of wet and small rooms 10 cm less."""
    return DOOR_WALL_M - 0.1 * (not type_.is_habitable)


def daylight_m(area: float) -> float:
    """Metres of one outer wall that give a floor of that area its glass, a French window alone."""
    return max(DAYLIGHT_M, area / _FLOOR_A_GLASS_M + _BESIDE_GLASS_M)


def daylight_length(rect: IntRect, where: Brief, notch: IntRect | None) -> int:
    """Steps of the longest side of a rectangle through which daylight comes."""
    x0, z0, x1, z1 = rect
    left, top, right, bottom = where.lit_sides
    return max(
        (z1 - z0) * (x0 == 0 and left),
        (x1 - x0) * (z0 == 0 and top),
        (z1 - z0) * (x1 == where.width and right),
        (x1 - x0) * (z1 == where.depth and bottom),
        shared_length(rect, notch) if notch else 0,
    )
