"""A plan's rooms with furniture, by seed: a depth-first search over groups of pieces, and ceiling lamps; no effects."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import permutations
from typing import Final

import numpy as np
from shapely.geometry import Polygon, box

from pbrs_farm.core.arrays import Bools
from pbrs_farm.core.catalogue import Catalogue, Piece
from pbrs_farm.generate.floor_plan import PlacedPiece, Plan, Rect, RoomType, ground
from pbrs_farm.generate.furnish.briefs import RoomBrief, UseWithoutType, brief_of
from pbrs_farm.generate.furnish.pieces import Shelf, style_of
from pbrs_farm.generate.furnish.places import Places, places_of
from pbrs_farm.generate.furnish.room_space import FurnishSpace, room_space, with_bodies
from pbrs_farm.generate.furnish.template import PieceGroup, Standing
from pbrs_farm.generate.furnish.walk_bitmap import WalkMap
from pbrs_farm.generate.plan_walls import largest_rectangle

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
    Raises BadInput for an unknown style. generated_home.py checks that the result is complete.
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


_HEAD_M: Final = 1.95  # the lowest point of a lamp
_LARGE_M2: Final = 22.0  # rooms above have two
_LONG: Final = 2.6  # and halls of this aspect
_SHORTEST: Final = 0.35  # minimum scale of a lamp, as a share of its original size
_STEPS: Final = (0.0, 0.2, -0.2, 0.4, -0.4, 0.6, -0.6, 0.9, -0.9)


def ceiling_lamps(
    space: FurnishSpace, type_: RoomType, standing: list[PlacedPiece], shelf: Shelf
) -> list[PlacedPiece]:
    """One lamp in the room's middle, two in large and in long rooms; none where none is to be had."""
    if type_ in (RoomType.BALCONY, RoomType.STAIRS):
        return []
    piece = _choose_lamp(shelf, type_)
    if piece is None:
        return []
    lamp_pieces = []
    for x, z in _middles(space, type_):
        lamp = _hung(piece, x, z, space, standing)
        if lamp is not None:
            lamp_pieces.append(lamp)
    return lamp_pieces


def _choose_lamp(shelf: Shelf, type_: RoomType) -> Piece | None:
    lamps = [p for p in shelf.of("ceiling_lamp") if max(p.size[:2]) > 0.15]
    is_plain = not type_.is_habitable or type_ is RoomType.KITCHEN
    # Low or wide pendant lamps belong in living areas.
    fitting = [p for p in lamps if (p.size[2] < 0.2) == is_plain] or lamps
    if is_plain:
        fitting = [p for p in fitting if "track" not in p.id and "strip" not in p.id] or fitting
    return fitting[0] if fitting else None


def _middles(space: FurnishSpace, type_: RoomType) -> list[tuple[float, float]]:
    """The middle of the room's largest rectangle; two points along it where it is large."""
    rect = largest_rectangle(space.polygon)
    x0, z0, x1, z1 = rect
    w, d = x1 - x0, z1 - z0
    is_long = type_ is RoomType.HALL and max(w, d) > max(_LONG * min(w, d), 3.6)
    if not (is_long or space.area > _LARGE_M2):
        return [((x0 + x1) / 2, (z0 + z1) / 2)]
    if w >= d:
        return [(x0 + w / 4, (z0 + z1) / 2), (x1 - w / 4, (z0 + z1) / 2)]
    return [((x0 + x1) / 2, z0 + d / 4), ((x0 + x1) / 2, z1 - d / 4)]


def _hung(
    piece: Piece, x: float, z: float, space: FurnishSpace, standing: list[PlacedPiece]
) -> PlacedPiece | None:
    w, d, h = piece.size
    # Make it smaller where it would hang in the way.
    scale = min(1.0, (space.height - _HEAD_M) / h)
    scale = max(scale, _SHORTEST)
    w, d, h = w * scale, d * scale, h * scale
    low = space.height - h
    tall = [_ground_polygon(p) for p in standing if p.elevation + p.height > low - 0.05]
    for dx in _STEPS:
        for dz in _STEPS:
            ground = box(x + dx - w / 2, z + dz - d / 2, x + dx + w / 2, z + dz + d / 2)
            free = not any(ground.intersects(t) for t in tall)
            if free and space.polygon.contains(ground):
                return PlacedPiece(
                    piece,
                    round(x + dx, 4),
                    round(z + dz, 4),
                    round(low, 4),
                    0.0,
                    round(w, 4),
                    round(d, 4),
                    round(h, 4),
                    space.number,
                )
    return None


def _ground_polygon(piece: PlacedPiece) -> Polygon:
    xs, zs = [p[0] for p in piece.corners], [p[1] for p in piece.corners]
    return box(min(xs), min(zs), max(xs), max(zs))


_ROOTS: Final = 5  # places to try for the first group
_NODES_A_ROOT: Final = 14
_MISSING: Final = 100.0  # penalty for a required group that finds no place
_MISSED: Final = 2.0  # and one that need not


@dataclass(frozen=True, slots=True)
class Arrangement:
    """Furniture of a room with places."""

    standing: tuple[Standing, ...] = ()
    missing: tuple[str, ...] = ()  # required groups without a place
    score: float = -np.inf

    @property
    def bodies(self) -> list[Rect]:
        """Plan rectangles (x0, z0, x1, z1) of all pieces on the floor, metres; wall-mounted ones excluded."""
        return [rect for place in self.standing for rect in place.bodies]

    @property
    def fronts(self) -> list[Rect]:
        """Areas that must be reachable on foot."""
        return [rect for place in self.standing for rect in place.fronts]


@dataclass(slots=True)
class _Search:
    groups: Sequence[PieceGroup]
    places: Sequence[Places]
    walk: WalkMap
    least_share: float
    best: Arrangement = field(default_factory=Arrangement)
    nodes: int = 0
    limit: int = 0

    def descend(
        self,
        level: int,
        alive: list[Bools],
        free: Bools,
        standing: tuple[Standing, ...],
        missing: tuple[str, ...],
        score: float,
    ) -> bool:
        """Place the groups from a level on; True if all of them are placed."""
        if level == len(self.groups):
            if score > self.best.score:
                self.best = Arrangement(standing, missing, score)
            return not missing
        group, places = self.groups[level], self.places[level]
        for place in places.best(alive[level]):
            if self.nodes >= self.limit:
                break
            self.nodes += 1
            after = self.placed(place, free, standing)
            if after is None:
                continue
            remaining = [
                mask if k <= level else self.places[k].free_of(mask, place)
                for k, mask in enumerate(alive)
            ]
            # Prune if a required group has no place any more.
            if any(
                g.is_required and not mask.any() and alive[k].any()
                for k, (g, mask) in enumerate(zip(self.groups, remaining, strict=True))
                if k > level
            ):
                continue
            if self.descend(
                level + 1, remaining, after, (*standing, place), missing, score + place.score
            ):
                return True
        # Go on without it.
        lost = (group.name,) if group.is_required else ()
        price = _MISSING if group.is_required else _MISSED
        whole = self.descend(level + 1, alive, free, standing, (*missing, *lost), score - price)
        return whole and not lost

    def placed(self, place: Standing, free: Bools, standing: tuple[Standing, ...]) -> Bools | None:
        """The free floor after adding a template; None if something becomes unreachable."""
        after = self.walk.with_bodies(free, place.bodies)
        fronts = [rect for s in (*standing, place) for rect in s.fronts]
        region = self.walk.reached(after, fronts)
        if region is None or (self.least_share and self.walk.share(region) < self.least_share):
            return None
        return after


def arranged(
    groups: Sequence[PieceGroup],
    places: Sequence[Places],
    walk: WalkMap,
    *,
    start: Arrangement | None = None,
    roots: int = _ROOTS,
    nodes: int = _NODES_A_ROOT,
    least_share: float = 0.0,
) -> Arrangement:
    """Find the best arrangement of groups, in this order, added to the existing furniture.

    Depth first: each group tries its best places that overlap nothing and keep all required areas
    reachable. roots: places to try for the first group; nodes: maximum nodes to visit per root.
    least_share: minimum share of the floor that stays walkable. Optional groups may be left out.
    """
    before = start or Arrangement(score=0.0)
    alive = [np.ones(p.n, bool) for p in places]
    for place in before.standing:
        alive = [p.free_of(mask, place) for p, mask in zip(places, alive, strict=True)]
    free = walk.with_bodies(walk.free, before.bodies)
    search = _Search(groups, places, walk, least_share)
    if not groups:
        return before
    # Compare what each of the best places of the first group leads to.
    for place in places[0].best(alive[0])[:roots]:
        search.limit = search.nodes + nodes
        after = search.placed(place, free, before.standing)
        search.nodes += 1
        if after is None:
            continue
        masks = [p.free_of(mask, place) for p, mask in zip(places, alive, strict=True)]
        search.descend(
            1, masks, after, (*before.standing, place), before.missing, before.score + place.score
        )
    if search.best.score == -np.inf:
        search.limit = search.nodes + 4 * nodes
        search.descend(0, alive, free, before.standing, before.missing, before.score)
    return search.best
