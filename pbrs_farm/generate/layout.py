"""A programme becomes rectangles: the brief of the slicing tree, and what of it to relax; no effects."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from pbrs_farm.core.errors import BadInput
from pbrs_farm.generate.floor_plan import RoomType
from pbrs_farm.generate.programme import Programme, RoomWish
from pbrs_farm.generate.slicing import (
    N_MOVES,
    N_TRIES,
    STEP_M,
    Brief,
    Contact,
    IntRect,
    SliceLeaf,
    shared_length,
    solved,
)

# Small rooms cut from the rectangle of a larger one: its guests, each a strip or a corner.


MIN_WIDTH: Final = {
    RoomType.LIVING: 3.2, RoomType.STUDIO: 3.2, RoomType.KITCHEN: 2.1, RoomType.BEDROOM: 2.6,
    RoomType.BATHROOM: 1.55, RoomType.HALL: 1.1, RoomType.WC: 0.9, RoomType.STORE: 0.9,
    RoomType.WARDROBE: 1.4, RoomType.STAIRS: 0.0,
}  # fmt: skip
MAX_ASPECT: Final = {
    RoomType.LIVING: 1.7, RoomType.STUDIO: 1.7, RoomType.KITCHEN: 1.9, RoomType.BEDROOM: 1.6,
    RoomType.BATHROOM: 1.7, RoomType.HALL: 8.0, RoomType.WC: 1.9, RoomType.STORE: 1.8,
    RoomType.WARDROBE: 1.8, RoomType.STAIRS: math.inf,
}  # fmt: skip
DOOR_WALL_M: Final = 1.2  # a door of 0.9 m, 10 cm from the corner, and the walls' thickness
DAYLIGHT_M: Final = 2.0  # of outer wall, at least
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
_STRIP_ASPECT: Final = 2.15  # of a small room along the whole side of another
_CORNER_ASPECTS: Final = (1.3, 1.6, 1.0)
_ARM_M: Final = 1.0  # the narrowest part of a host that its guest leaves

Cut = tuple[IntRect, tuple[IntRect, ...]]  # the guest, and what is left of its host


def hosts_of(programme: Programme) -> dict[int, int]:
    """Small room -> the room it is cut from: each host has one guest at most."""
    hosts: dict[int, int] = {}
    bathrooms = (i for i, wish in enumerate(programme.rooms) if wish.type is RoomType.BATHROOM)
    first = next(bathrooms, -1)
    cut_from = _CUT_FROM if first >= 0 else {**_CUT_FROM, RoomType.WC: _WC_BELOW}
    # What lies beside a certain room is a rectangle of its own.
    wished = {k for room, others in programme.adjacent for k in (room, *others)}
    for number, wish in enumerate(programme.rooms):
        types = cut_from.get(wish.type, ()) if number not in wished else ()
        if wish.type is RoomType.BATHROOM and first == number:
            continue
        free = [
            i
            for i, other in enumerate(programme.rooms)
            if other.type in types and i not in hosts.values() and i not in hosts
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
    """Cut each small room from its host, in place; those where that breaks a rule of either."""
    uncut: set[int] = set()
    for guest, host in hosts.items():
        wish = programme.rooms[guest]
        whole = parts[host][0]
        fitting = (
            (inner, rest)
            for inner, rest in (*_strips(whole, wish), *_corners(whole, wish))
            if _fits(inner, wish.type)
            and any(_fits(r, programme.rooms[host].type) for r in _rectangles(rest, inner))
            and _keeps_rules((inner, rest), parts, programme, (guest, host), brief, notch)
        )
        found = next(fitting, None)
        if found is None:
            uncut.add(guest)
        else:
            parts[guest], parts[host] = (found[0],), found[1]
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
        if _shared(rest, (*halls, *living)) < wide:
            return False
    elif _shared(rest, ways_to(host.type)) < door_m(host.type):
        return False
    # What is left of a living room keeps the way to its kitchen.
    if host.type is RoomType.LIVING:
        kitchen = parts[first_of(programme, RoomType.KITCHEN)]
        ways = rest if programme.open_kitchen else (*rest, *halls)
        if _shared(kitchen, ways) < (2.0 if programme.open_kitchen else DOOR_WALL_M):
            return False
    # A wardrobe is entered from its bedroom, a store of a kitchen from there.
    if _opens_to_hall(wish, host) and _shared((inner,), ways_to(wish.type)) < door_m(wish.type):
        return False
    lit = max(daylight_length(r, brief, notch) for r in rest) * STEP_M
    return not host.type.is_habitable or lit >= daylight_m(host.area)


def _opens_to_hall(wish: RoomWish, host: RoomWish) -> bool:
    is_own = wish.type in (RoomType.WARDROBE, RoomType.BATHROOM)
    return not is_own and host.type is not RoomType.KITCHEN


def hall_wall_m(host: RoomWish, guest: RoomWish | None) -> float:
    """Metres of wall that a room and its guest need at the hall, for their doors."""
    own = door_m(host.type)
    return own + door_m(guest.type) if guest and _opens_to_hall(guest, host) else own


def _shared(rects: tuple[IntRect, ...], others: tuple[IntRect, ...]) -> float:
    return max(shared_length(a, b) for a in rects for b in others) * STEP_M


def _strips(whole: IntRect, wish: RoomWish) -> Iterator[Cut]:
    """A strip along each side of a rectangle: of the wished area or its least width.

    A strip is no more than twice as long as it is wide, and none that would be far too large.
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


def _corners(whole: IntRect, wish: RoomWish) -> Iterator[Cut]:
    """A rectangle in each corner of another, of the wished area: what is left has an L's shape."""
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
                    left = (x0, rest[0], x1, rest[1]), (beside[0], za, beside[1], zb)
                    yield (xa, za, xb, zb), left


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


def _fits(rect: IntRect, type_: RoomType) -> bool:
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


# A programme becomes rectangles.


_BESIDE_M: Final = 0.8  # of wall that rooms which lie beside each other share
_FIXED_TRIES: Final = 4  # times as many for what a user wrote
_STOREY_MOVES: Final = 300
_PATIENCE: Final = 3  # plans that meet the rules but for a small room


@dataclass(frozen=True, slots=True)
class Layout:
    """Rooms as rectangles on their walls' middle lines, in steps of 5 cm."""

    programme: Programme
    parts: tuple[tuple[IntRect, ...], ...]  # of each room of the programme: one or two
    notch: IntRect | None
    width: int
    depth: int
    lit_sides: tuple[bool, bool, bool, bool]  # left, top, right, bottom


@dataclass(frozen=True, slots=True)
class Core:
    """What the storeys of a home share, in steps."""

    width: int  # of the outline
    depth: int
    stairs: IntRect
    landing: IntRect  # before the stairs: a part of the hall
    front: tuple[int, int]  # unit vector (x, z) from the stairs to the landing
    lit_sides: tuple[bool, bool, bool, bool]


def layout(programme: Programme, rng: np.random.Generator, *, is_fixed: bool = False) -> Layout:
    """Rectangles for a programme. What makes it hard is left out step by step: its notch, its
    second arm, its blind sides, its small rooms.

    is_fixed: nothing may be left out, as where a user wrote it. Raises BadInput where there is no
    plan, with the nearest that has one.
    """
    said = f"{len(programme.rooms)} rooms in {programme.area:.0f} m2"
    for left_out, tried in _easier(programme):
        n_tries = N_TRIES * (_FIXED_TRIES if is_fixed else 1)
        found = _solved_layout(tried, rng, is_fixed=is_fixed, n_tries=n_tries)
        if found is None:
            continue
        if is_fixed and left_out:
            raise BadInput(
                "programme", "", f"{said} have no plan with {left_out}", hint="leave it out"
            )
        return found
    raise BadInput(
        "programme", "", f"{said} have no plan",
        hint="fewer rooms, or areas nearer to those of docs/homes.md",
    )  # fmt: skip


def _easier(programme: Programme) -> list[tuple[str, Programme]]:
    """(what is left out, the rest), the programme itself first."""
    steps = [("", programme)]
    for left_out, change in (
        ("these rooms adjacent", {"adjacent": ()}),
        ("a court in a side", {"is_court": False}),
        ("a notch or a second arm", {"notch": 0.0, "is_court": False, "l_shaped": False}),
        ("sides without daylight", {"n_blind_sides": 0}),
    ):
        easier = replace(steps[-1][1], **change)
        if easier != steps[-1][1]:
            steps.append((left_out, easier))
    last = steps[-1][1]
    small = [wish for wish in last.rooms if wish.type in SMALL]
    if small:
        rest = tuple(wish for wish in last.rooms if wish not in small)
        steps.append(
            (", ".join(w.type.label for w in small), replace(last, rooms=rest, adjacent=()))
        )
    return steps


def storey_layout(
    programme: Programme, core: Core, n_tries: int, rng: np.random.Generator
) -> Layout | None:
    """Rectangles for one storey of several around their core; None where annealing finds none.

    A storey has few leaves, and many cores have no plan: each is annealed for a short while.
    """
    return _solved_layout(programme, rng, is_fixed=True, core=core, n_tries=n_tries)


def _solved_layout(
    programme: Programme, rng: np.random.Generator, *, is_fixed: bool, core: Core | None = None,
    n_tries: int = N_TRIES,
) -> Layout | None:  # fmt: skip
    hosts = hosts_of(programme)
    # Make a leaf of each room that is no part of another's; two of a room with a second arm.
    leaves, owner = [], []
    for number, wish in enumerate(programme.rooms):
        if number in hosts:
            continue
        guests = tuple(programme.rooms[g] for g, host in hosts.items() if host == number)
        for share in _arms(wish, programme):
            leaf = _leaf(wish, share, guests, programme.family.hall_aspect)
            leaves.append(_around(core, wish.type, leaf, programme) if core else leaf)
            owner.append(number)
    if programme.notch:
        is_court = programme.is_court
        leaves.append(
            SliceLeaf(programme.notch, 1.5, 2.5, is_corner=not is_court, is_court=is_court)
        )
    lit = core.lit_sides if core else lit_sides(programme.n_blind_sides, rng)
    outline, n_moves = ((core.width, core.depth), _STOREY_MOVES) if core else (None, N_MOVES)
    contacts = _contacts(programme, owner, hosts)
    ratios = programme.family.outline_ratio
    n_solved = 0
    hall = owner.index(first_of(programme, RoomType.HALL))
    for _ in range(n_tries):
        found = solved(tuple(leaves), contacts, hall, lit, rng, outline, n_moves, ratios)
        if found is None:
            continue
        brief, rects = found
        parts: list[tuple[IntRect, ...]] = [
            tuple(r for r, o in zip(rects, owner, strict=False) if o == number)
            for number in range(len(programme.rooms))
        ]
        notch = rects[-1] if programme.notch else None
        uncut = cut_guests(parts, programme, hosts, brief, notch)
        # Let a small room go rather than look for ever.
        n_solved += 1
        if not uncut:
            return Layout(programme, tuple(parts), notch, brief.width, brief.depth, lit)
        if n_solved >= _PATIENCE and not is_fixed:
            rooms = tuple(w for i, w in enumerate(programme.rooms) if i not in uncut)
            return _solved_layout(replace(programme, rooms=rooms), rng, is_fixed=False)
    return None


def _arms(wish: RoomWish, programme: Programme) -> tuple[float, ...]:
    l_shaped = wish.type is RoomType.LIVING and programme.l_shaped
    return (0.68, 0.32) if l_shaped else (1.0,)


def _leaf(
    wish: RoomWish, share: float, guests: tuple[RoomWish, ...], hall_aspect: float
) -> SliceLeaf:
    area = wish.area * share + sum(guest_area(g, wish) for g in guests)
    # A hall is long: walls take more of it.
    half_round = 2.6 if wish.type is RoomType.HALL else 2.0
    gross = area + half_round * math.sqrt(area) * WALL_M + WALL_M**2
    is_arm = share < 0.5
    lit = daylight_m(wish.area) if wish.type.is_habitable and not is_arm else 0.0
    entrance = 1.3 if wish.type is RoomType.HALL else 0.0
    narrow = 2.4 if is_arm else MIN_WIDTH[wish.type]
    aspect = hall_aspect if wish.type is RoomType.HALL else MAX_ASPECT[wish.type]
    return SliceLeaf(gross, narrow, aspect, outer=lit, any_outer=entrance)


def _around(core: Core, type_: RoomType, leaf: SliceLeaf, programme: Programme) -> SliceLeaf:
    """The leaf of a storey of several: the stairs where they are, the hall before them."""
    if type_ is RoomType.STAIRS:
        x0, z0, x1, z1 = core.stairs
        return SliceLeaf((x1 - x0) * (z1 - z0) * STEP_M**2, 0.0, pinned=core.stairs)
    if type_ is RoomType.HALL:
        entrance = 0.0 if programme.is_upper else leaf.any_outer
        return replace(leaf, holds=core.landing, any_outer=entrance)
    return leaf


def _contacts(programme: Programme, owner: list[int], hosts: dict[int, int]) -> tuple[Contact, ...]:
    """Which rooms meet: all those they are entered from, the kitchen the living room, wet rooms each other if they can."""

    def leaves_of(*types: RoomType) -> tuple[int, ...]:
        return tuple(i for i, o in enumerate(owner) if programme.rooms[o].type in types)

    halls, living = leaves_of(RoomType.HALL), leaves_of(RoomType.LIVING, RoomType.STUDIO)
    guest_of = {host: programme.rooms[guest] for guest, host in hosts.items()}
    en_suites = programme.en_suites
    n_bathrooms = sum(wish.type is RoomType.BATHROOM for wish in programme.rooms)
    contacts = []
    for i, o in enumerate(owner):
        type_ = programme.rooms[o].type
        if i and owner[i - 1] == o:
            # Join the arms of one room.
            contacts.append(Contact(i, (i - 1,), 2.2))
        elif type_ is RoomType.KITCHEN:
            wide = 2.0 if programme.open_kitchen else 1.0
            contacts.append(Contact(i, living, wide, is_hard=programme.open_kitchen))
            contacts.append(Contact(i, (*halls, *living), DOOR_WALL_M))
        elif o in en_suites:
            # Its door is its bedroom's; guests reach the only one from the hall, where they can.
            beds = tuple(j for j, other in enumerate(owner) if other in en_suites[o])
            contacts.append(Contact(i, beds, DOOR_WALL_M))
            if n_bathrooms == 1:
                contacts.append(Contact(i, halls, DOOR_WALL_M, is_hard=False))
        elif type_ not in (RoomType.HALL, RoomType.STAIRS):
            wall = hall_wall_m(programme.rooms[o], guest_of.get(o))
            contacts.append(Contact(i, leaves_of(*programme.entered_from(type_)), wall))
        # Keep pipes short.
        wet = leaves_of(RoomType.KITCHEN, RoomType.BATHROOM, RoomType.WC)
        others = tuple(j for j in wet if j != i)
        if type_ in (RoomType.BATHROOM, RoomType.WC) and others:
            contacts.append(Contact(i, others, 0.9, is_hard=False))
    for room, others in programme.adjacent:
        near = tuple(i for i, o in enumerate(owner) if o in others)
        contacts.append(Contact(owner.index(room), near, _BESIDE_M))
    return tuple(contacts)


def lit_sides(n_blind: int, rng: np.random.Generator) -> tuple[bool, bool, bool, bool]:
    """Which sides of an outline have daylight, left, top, right, bottom: all but n by chance."""
    blind = set(rng.permutation(4)[:n_blind].tolist())
    return (0 not in blind, 1 not in blind, 2 not in blind, 3 not in blind)
