"""Turn a programme into rectangles: the slicing tree's brief, and its relaxations; no effects."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from pbrs_farm.core.errors import BadInput
from pbrs_farm.generate.floor_plan import RoomType
from pbrs_farm.generate.guest_rooms import (
    DOOR_WALL_M,
    MAX_ASPECT,
    MIN_WIDTH,
    SMALL,
    WALL_M,
    cut_guests,
    daylight_m,
    first_of,
    guest_area,
    hall_wall_m,
    hosts_of,
)
from pbrs_farm.generate.programme import Programme, RoomWish
from pbrs_farm.generate.slicing import N_MOVES, N_TRIES, solved
from pbrs_farm.generate.slicing_goals import STEP_M, Contact, IntRect, SliceLeaf

_BESIDE_M: Final = 0.8  # least length of wall that adjacent rooms share
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
    """The part shared by all storeys of a home, in steps."""

    width: int  # of the outline
    depth: int
    stairs: IntRect
    landing: IntRect  # before the stairs: a part of the hall
    front: tuple[int, int]  # unit vector (x, z) from the stairs to the landing
    lit_sides: tuple[bool, bool, bool, bool]


def layout(programme: Programme, rng: np.random.Generator, *, is_fixed: bool = False) -> Layout:
    """Rectangles for a programme. If there is no solution, requirements are dropped one by one: the
    notch, the second arm, the blind sides, the small rooms.

    is_fixed: nothing may be dropped, as for a user's programme. Raises BadInput if there is no plan,
    with the nearest programme that has one.
    """
    size_text = f"{len(programme.rooms)} rooms in {programme.area:.0f} m2"
    for left_out, tried in easier_programmes(programme):
        n_tries = N_TRIES * (_FIXED_TRIES if is_fixed else 1)
        solution = _solved_layout(tried, rng, is_fixed=is_fixed, n_tries=n_tries)
        if solution is None:
            continue
        if is_fixed and left_out:
            raise BadInput(
                "programme", "", f"{size_text} have no plan with {left_out}", hint="leave it out"
            )
        return solution
    raise BadInput(
        "programme",
        "",
        f"{size_text} have no plan",
        hint="fewer rooms, or areas nearer to those of docs/homes.md",
    )


def easier_programmes(programme: Programme) -> list[tuple[str, Programme]]:
    """(dropped rooms, remaining programme), starting with the programme itself."""
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
    """Rectangles for a storey around a core, or None; many cores have no plan, so annealing is short."""
    return _solved_layout(programme, rng, is_fixed=True, core=core, n_tries=n_tries)


def _solved_layout(
    programme: Programme,
    rng: np.random.Generator,
    *,
    is_fixed: bool,
    core: Core | None = None,
    n_tries: int = N_TRIES,
) -> Layout | None:
    hosts = hosts_of(programme)
    # One leaf per room that is no guest of another; two for a room with a second arm.
    leaves, owner = [], []
    for number, wish in enumerate(programme.rooms):
        if number in hosts:
            continue
        guests = tuple(programme.rooms[g] for g, host in hosts.items() if host == number)
        for share in _arms(wish, programme):
            leaf = _leaf_of_wish(wish, share, guests, programme.family.hall_aspect)
            leaves.append(_leaf_around_core(core, wish.type, leaf, programme) if core else leaf)
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
        solution = solved(tuple(leaves), contacts, hall, lit, rng, outline, n_moves, ratios)
        if solution is None:
            continue
        brief, rects = solution
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


def _leaf_of_wish(
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


def _leaf_around_core(
    core: Core, type_: RoomType, leaf: SliceLeaf, programme: Programme
) -> SliceLeaf:
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
            beds = tuple(j for j, leaf_owner in enumerate(owner) if leaf_owner in en_suites[o])
            contacts.append(Contact(i, beds, DOOR_WALL_M))
            if n_bathrooms == 1:
                contacts.append(Contact(i, halls, DOOR_WALL_M, is_hard=False))
        elif type_ not in (RoomType.HALL, RoomType.STAIRS):
            wall = hall_wall_m(programme.rooms[o], guest_of.get(o))
            contacts.append(Contact(i, leaves_of(*programme.entered_from(type_)), wall))
        # Keep pipes short.
        wet = leaves_of(RoomType.KITCHEN, RoomType.BATHROOM, RoomType.WC)
        partners = tuple(j for j in wet if j != i)
        if type_ in (RoomType.BATHROOM, RoomType.WC) and partners:
            contacts.append(Contact(i, partners, 0.9, is_hard=False))
    for room, partners in programme.adjacent:
        near = tuple(i for i, o in enumerate(owner) if o in partners)
        contacts.append(Contact(owner.index(room), near, _BESIDE_M))
    return tuple(contacts)


def lit_sides(n_blind: int, rng: np.random.Generator) -> tuple[bool, bool, bool, bool]:
    """Which sides of an outline have daylight, left, top, right, bottom: all but n by chance."""
    blind = set(rng.permutation(4)[:n_blind].tolist())
    return (0 not in blind, 1 not in blind, 2 not in blind, 3 not in blind)
