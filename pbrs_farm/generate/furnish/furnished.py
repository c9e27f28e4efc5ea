"""A plan's rooms with furniture, by seed; no effects."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from itertools import permutations
from typing import Final

import numpy as np

from pbrs_farm.core.catalogue import Catalogue
from pbrs_farm.generate.floor_plan import PlacedPiece, Plan, Rect, RoomType, ground
from pbrs_farm.generate.furnish.briefs import RoomBrief, UseWithoutType, brief_of
from pbrs_farm.generate.furnish.ceiling_lamps import ceiling_lamps
from pbrs_farm.generate.furnish.pieces import Shelf, style_of
from pbrs_farm.generate.furnish.place_search import Arrangement, arranged
from pbrs_farm.generate.furnish.places import Places, places_of
from pbrs_farm.generate.furnish.room_space import FurnishSpace, room_space, with_bodies
from pbrs_farm.generate.furnish.template import PieceGroup
from pbrs_farm.generate.furnish.walk_bitmap import WalkMap

_ORDER: Final = (RoomType.KITCHEN, RoomType.LIVING, RoomType.STUDIO)  # then the others
_MOST_ORDERS: Final = 6
_ON_FLOOR_M: Final = 0.05


def furnished(
    plan: Plan,
    catalogue: Catalogue,
    rng: np.random.Generator,
    style: str = "",
    *,
    rooms: Collection[int] | None = None,
    standing: Mapping[int, Sequence[Rect]] | None = None,
    uses: Mapping[int, UseWithoutType] | None = None,
    present: Mapping[int, Collection[str]] | None = None,
) -> tuple[PlacedPiece, ...]:
    """Furnish all rooms of a plan, or some of them, by seed.

    rooms: indices to furnish, None = all. standing: room -> rectangles of existing furniture, which
    stay free of new pieces and accessible. uses: room -> brief to use instead of its type's. present:
    room -> names of groups of its brief that it already has and does not get again. Groups that the
    catalogue lacks are left out.
    Raises BadInput for an unknown style. gates.py checks that the result is complete.
    """
    shelf = Shelf(catalogue, rng, style_of(style, rng))
    seeds = rng.integers(2**63, size=len(plan.rooms))
    pieces_of_room: dict[int, list[PlacedPiece]] = {}
    room_numbers = range(len(plan.rooms)) if rooms is None else rooms
    numbers = sorted(room_numbers, key=lambda i: (_rank(plan.rooms[i].type), i))
    for number in numbers:
        room_rng = np.random.default_rng(int(seeds[number]))
        taken = list((standing or {}).get(number, ()))
        space = with_bodies(room_space(plan, number), taken)
        bodies = [
            ground(p) for pieces in pieces_of_room.values() for p in pieces if p.elevation < 0.4
        ]
        brief = brief_of(plan, space, shelf, room_rng, (uses or {}).get(number))
        brief = brief.without((present or {}).get(number, ()))
        placed = arrangement_of(brief, space, [*bodies, *taken], room_rng, n_standing=len(taken))
        # A low ceiling makes tall pieces lower.
        pieces = [
            replace(p, height=min(p.height, round(plan.height - p.elevation - 0.02, 4)))
            for s in placed.standing
            for p in s.pieces(number)
        ]
        pieces += ceiling_lamps(space, plan.rooms[number].type, pieces, shelf)
        pieces_of_room[number] = pieces
    return tuple(p for number in sorted(pieces_of_room) for p in pieces_of_room[number])


def _rank(type_: RoomType) -> int:
    # Furnish an open kitchen before the living room that shares its floor.
    return _ORDER.index(type_) if type_ in _ORDER else len(_ORDER)


def arrangement_of(
    brief: RoomBrief,
    space: FurnishSpace,
    obstacles: list[Rect],
    rng: np.random.Generator,
    *,
    n_standing: int = 0,
) -> Arrangement:
    """Arrange required, then optional groups, then fillers, in another order if the brief's does not fit."""
    walk = WalkMap(space, obstacles)
    groups = [g for g in brief.groups if g.templates or _is_kitchen(g, brief)]
    places = [
        brief.kitchen or places_of(g, space, rng) if not g.templates else places_of(g, space, rng)
        for g in groups
    ]
    best = arranged(groups, places, walk)
    # Try the groups in other orders if a required one does not fit.
    if best.missing:
        best = _other_orders(groups, places, walk, best)
    return _add_fillers(best, brief, space, walk, rng, n_standing)


def _is_kitchen(group: PieceGroup, brief: RoomBrief) -> bool:
    return group.name == "kitchen" and brief.kitchen is not None


def _other_orders(
    groups: list[PieceGroup], places: list[Places], walk: WalkMap, best: Arrangement
) -> Arrangement:
    must = [k for k, g in enumerate(groups) if g.is_required]
    may = [k for k in range(len(groups)) if k not in must]
    for order in list(permutations(must))[:_MOST_ORDERS]:
        row = [*order, *may]
        tried = arranged(
            [groups[k] for k in row], [places[k] for k in row], walk, roots=12, nodes=25
        )
        if tried.score > best.score:
            best = tried
        if not best.missing:
            break
    return best


def _add_fillers(
    start: Arrangement,
    brief: RoomBrief,
    space: FurnishSpace,
    walk: WalkMap,
    rng: np.random.Generator,
    n_standing: int,
) -> Arrangement:
    """Add fillers until the room is as full as people's are, or one could hardly walk."""
    filled = start
    for group in brief.fillers:
        most_pieces = brief.density * space.area
        n = n_standing + sum(
            s.elevation < _ON_FLOOR_M for p in filled.standing for s in p.template.slots
        )
        if n + 0.5 > most_pieces or not group.templates:
            continue
        optional = replace(group, is_required=False)
        tried = arranged(
            [optional],
            [places_of(optional, space, rng)],
            walk,
            start=filled,
            roots=3,
            nodes=0,
            least_share=brief.least_share,
        )
        if len(tried.standing) > len(filled.standing):
            filled = tried
    return filled
