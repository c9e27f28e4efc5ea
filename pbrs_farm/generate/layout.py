"""A programme becomes rectangles: the brief of the slicing tree, and what of it to relax; no effects."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from pbrs_farm.core.errors import BadInput
from pbrs_farm.generate.plan import RoomType
from pbrs_farm.generate.programme import Programme, RoomWish
from pbrs_farm.generate.slicing import (
    N_TRIES,
    STEP_M,
    Brief,
    Contact,
    IntRect,
    Leaf,
    shared_length,
    solved,
)

_MIN_WIDTH: Final = {
    RoomType.LIVING: 3.2, RoomType.STUDIO: 3.2, RoomType.KITCHEN: 2.1, RoomType.BEDROOM: 2.6,
    RoomType.BATHROOM: 1.55, RoomType.HALL: 1.1, RoomType.WC: 0.9, RoomType.STORE: 0.9,
    RoomType.WARDROBE: 1.4,
}  # fmt: skip
_MAX_ASPECT: Final = {
    RoomType.LIVING: 1.7, RoomType.STUDIO: 1.7, RoomType.KITCHEN: 1.9, RoomType.BEDROOM: 1.6,
    RoomType.BATHROOM: 1.7, RoomType.HALL: 8.0, RoomType.WC: 1.9, RoomType.STORE: 1.8,
    RoomType.WARDROBE: 1.8,
}  # fmt: skip
_STRIP_ASPECT: Final = 2.15  # of a small room along the whole side of another
_DOOR_WALL_M: Final = 1.2  # a door of 0.9 m, 10 cm from the corner, and the walls' thickness
_CUT_FROM: Final = {
    RoomType.WARDROBE: (RoomType.BEDROOM,),
    RoomType.STORE: (RoomType.KITCHEN,),
    RoomType.WC: (RoomType.BATHROOM,),
    RoomType.BATHROOM: (RoomType.BEDROOM,),  # the second one
}  # what a small room's rectangle is cut from
_PATIENCE: Final = 3  # plans that meet the rules but for a small room
_SMALL: Final = {RoomType.STORE, RoomType.WARDROBE, RoomType.WC}
_DAYLIGHT_M: Final = 2.0
_WALL_M: Final = 0.14  # mean thickness of walls


@dataclass(frozen=True, slots=True)
class Layout:
    """Rooms as rectangles on their walls' middle lines, in steps of 5 cm."""

    programme: Programme
    parts: tuple[tuple[IntRect, ...], ...]  # of each room of the programme: one or two
    notch: IntRect | None
    width: int
    depth: int
    lit_sides: tuple[bool, bool, bool, bool]  # left, top, right, bottom


def layout(programme: Programme, rng: np.random.Generator) -> Layout:
    """Rectangles for a programme. What makes it hard is left out step by step: its notch, its
    second arm, its blind sides, its small rooms. Raises BadInput where even that has no plan."""
    for tried in _easier(programme):
        found = _solved_layout(tried, rng)
        if found is not None:
            return found
    raise BadInput(
        "programme", "", f"{len(programme.rooms)} rooms in {programme.area:.0f} m2 have no plan",
        hint="fewer rooms, or areas nearer to those of docs/homes.md",
    )  # fmt: skip


def _easier(programme: Programme) -> list[Programme]:
    plain = replace(programme, notch=0.0, l_shaped=False)
    open_sides = replace(plain, n_blind_sides=0)
    fewer = replace(open_sides, rooms=tuple(r for r in plain.rooms if r.type not in _SMALL))
    return list(dict.fromkeys((programme, plain, open_sides, fewer)))


def _solved_layout(programme: Programme, rng: np.random.Generator) -> Layout | None:
    hosts = _hosts(programme)
    # Make a leaf of each room that is no part of another's; two of a room with a second arm.
    leaves, owner = [], []
    for number, wish in enumerate(programme.rooms):
        if number in hosts:
            continue
        guests = tuple(programme.rooms[g] for g, host in hosts.items() if host == number)
        for share in _arms(wish, programme):
            leaves.append(_leaf(wish, share, guests))
            owner.append(number)
    if programme.notch:
        leaves.append(Leaf(programme.notch, 1.5, 2.5, is_corner=True))
    lit = _lit_sides(programme.n_blind_sides, rng)
    contacts = _contacts(programme, owner, hosts)
    n_solved = 0
    hall = owner.index(_first(programme, RoomType.HALL))
    for _ in range(N_TRIES):
        found = solved(tuple(leaves), contacts, hall, lit, rng)
        if found is None:
            continue
        brief, rects = found
        parts: list[tuple[IntRect, ...]] = [
            tuple(r for r, o in zip(rects, owner, strict=False) if o == number)
            for number in range(len(programme.rooms))
        ]
        notch = rects[-1] if programme.notch else None
        uncut = _cut_guests(parts, programme, hosts, brief, notch)
        # Let a small room go rather than look for ever; its host keeps the floor.
        n_solved += 1
        if not uncut or n_solved >= _PATIENCE:
            kept = [i for i in range(len(parts)) if i not in uncut]
            made = replace(programme, rooms=tuple(programme.rooms[i] for i in kept))
            rooms = tuple(parts[i] for i in kept)
            return Layout(made, rooms, notch, brief.width, brief.depth, lit)
    return None


def _hosts(programme: Programme) -> dict[int, int]:
    """Small room -> the room whose rectangle it is cut from: each host has one at most."""
    hosts: dict[int, int] = {}
    for number, wish in enumerate(programme.rooms):
        types = _CUT_FROM.get(wish.type, ())
        if wish.type is RoomType.BATHROOM and _first(programme, RoomType.BATHROOM) == number:
            continue
        free = [
            i
            for i, other in enumerate(programme.rooms)
            if other.type in types and i not in hosts.values() and i not in hosts
        ]
        if free:
            # The largest room can spare most.
            hosts[number] = max(free, key=lambda i: programme.rooms[i].area)
    return hosts


def _first(programme: Programme, type_: RoomType) -> int:
    return next(i for i, wish in enumerate(programme.rooms) if wish.type is type_)


def _cut_guests(
    parts: list[tuple[IntRect, ...]],
    programme: Programme,
    hosts: dict[int, int],
    brief: Brief,
    notch: IntRect | None,
) -> set[int]:
    """Cut each small room from its host's rectangle; those where that breaks a rule of either."""
    uncut: set[int] = set()
    halls, living = parts[_first(programme, RoomType.HALL)], parts[0]
    for guest, host in hosts.items():
        wish, host_wish = programme.rooms[guest], programme.rooms[host]
        whole = parts[host][0]
        found = None
        for inner, rest in _strips(whole, wish):
            if not _fits(inner, wish.type) or not _fits(rest, host_wish.type):
                continue
            # The host keeps its door and its daylight; a WC has a door of its own to the hall.
            door = max(shared_length(rest, h) for h in halls) * STEP_M
            own = max(shared_length(inner, h) for h in halls) * STEP_M
            needs_hall = host_wish.type is not RoomType.KITCHEN
            kitchen = max(shared_length(rest, o) for o in (*halls, *living)) * STEP_M
            if not needs_hall and kitchen < (2.0 if programme.open_kitchen else _DOOR_WALL_M):
                continue
            lit = daylight_length(rest, brief, notch) * STEP_M
            if needs_hall and door < _door(host_wish.type):
                continue
            if wish.type is RoomType.WC and own < _door(RoomType.WC):
                continue
            if host_wish.type.is_habitable and lit < _DAYLIGHT_M:
                continue
            found = inner, rest
            break
        if found is None:
            uncut.add(guest)
            continue
        parts[guest], parts[host] = (found[0],), (found[1],)
    return uncut


def _strips(whole: IntRect, wish: RoomWish) -> list[tuple[IntRect, IntRect]]:
    """(strip, rest) for each side of a rectangle: the strip has the wished area or its least width."""
    x0, z0, x1, z1 = whole
    found = []
    least = _MIN_WIDTH[wish.type] + _WALL_M

    def width(side: float) -> int:
        wide = max(wish.area / (side - _WALL_M) + _WALL_M, least, side / _STRIP_ASPECT)
        return math.ceil(wide / STEP_M)

    across, along = width((z1 - z0) * STEP_M), width((x1 - x0) * STEP_M)
    if across < x1 - x0:
        found += [
            ((x0, z0, x0 + across, z1), (x0 + across, z0, x1, z1)),
            ((x1 - across, z0, x1, z1), (x0, z0, x1 - across, z1)),
        ]
    if along < z1 - z0:
        found += [
            ((x0, z0, x1, z0 + along), (x0, z0 + along, x1, z1)),
            ((x0, z1 - along, x1, z1), (x0, z0, x1, z1 - along)),
        ]
    return found


def _guest_area(guest: RoomWish, host: RoomWish) -> float:
    # A strip along a side of the host is no more than twice as long as it is wide.
    side = math.sqrt(host.area)
    return max(guest.area, side * side / _STRIP_ASPECT) + _WALL_M * side


def _fits(rect: IntRect, type_: RoomType) -> bool:
    sides = sorted(side * STEP_M - _WALL_M for side in (rect[2] - rect[0], rect[3] - rect[1]))
    return sides[0] >= _MIN_WIDTH[type_] and sides[1] <= 1.2 * _MAX_ASPECT[type_] * sides[0]


def _arms(wish: RoomWish, programme: Programme) -> tuple[float, ...]:
    l_shaped = wish.type is RoomType.LIVING and programme.l_shaped
    return (0.68, 0.32) if l_shaped else (1.0,)


def _leaf(wish: RoomWish, share: float, guests: tuple[RoomWish, ...] = ()) -> Leaf:
    area = wish.area * share + sum(_guest_area(g, wish) for g in guests)
    gross = area + 2 * math.sqrt(area) * _WALL_M + _WALL_M**2
    is_arm = share < 0.5
    lit = _DAYLIGHT_M if wish.type.is_habitable and not is_arm else 0.0
    entrance = 1.3 if wish.type is RoomType.HALL else 0.0
    narrow = 2.4 if is_arm else _MIN_WIDTH[wish.type]
    return Leaf(gross, narrow, _MAX_ASPECT[wish.type], outer=lit, any_outer=entrance)


def _contacts(programme: Programme, owner: list[int], hosts: dict[int, int]) -> tuple[Contact, ...]:
    """Which rooms meet: all the hall, the kitchen the living room, wet rooms each other if they can."""

    def leaves_of(*types: RoomType) -> tuple[int, ...]:
        return tuple(i for i, o in enumerate(owner) if programme.rooms[o].type in types)

    halls, living = leaves_of(RoomType.HALL), leaves_of(RoomType.LIVING, RoomType.STUDIO)
    with_wc = {h for g, h in hosts.items() if programme.rooms[g].type is RoomType.WC}
    contacts = []
    for i, o in enumerate(owner):
        type_ = programme.rooms[o].type
        if i and owner[i - 1] == o:
            # Join the arms of one room.
            contacts.append(Contact(i, (i - 1,), 2.2))
        elif type_ is RoomType.KITCHEN:
            wide = 2.0 if programme.open_kitchen else 1.0
            contacts.append(Contact(i, living, wide, is_hard=programme.open_kitchen))
            contacts.append(Contact(i, (*halls, *living), _DOOR_WALL_M))
        elif type_ is not RoomType.HALL:
            # A WC that is cut from a bathroom needs a door of its own beside.
            doors = _door(type_) + (_door(RoomType.WC) if o in with_wc else 0.0)
            contacts.append(Contact(i, halls, doors))
        # Keep pipes short.
        wet = leaves_of(RoomType.KITCHEN, RoomType.BATHROOM, RoomType.WC)
        others = tuple(j for j in wet if j != i)
        if type_ in (RoomType.BATHROOM, RoomType.WC) and others:
            contacts.append(Contact(i, others, 0.9, is_hard=False))
    return tuple(contacts)


def daylight_length(rect: IntRect, where: Brief | Layout, notch: IntRect | None) -> int:
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


def _door(type_: RoomType) -> float:
    # Doors of wet and small rooms are 10 cm narrower.
    return _DOOR_WALL_M - 0.1 * (not type_.is_habitable)


def _lit_sides(n_blind: int, rng: np.random.Generator) -> tuple[bool, bool, bool, bool]:
    blind = set(rng.permutation(4)[:n_blind].tolist())
    return (0 not in blind, 1 not in blind, 2 not in blind, 3 not in blind)
