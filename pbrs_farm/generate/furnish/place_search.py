"""Depth-first search over groups of pieces until all are placed and accessible. No effects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from pbrs_farm.core.arrays import Bools
from pbrs_farm.generate.floor_plan import Rect
from pbrs_farm.generate.furnish.places import Places
from pbrs_farm.generate.furnish.template import PieceGroup, Standing
from pbrs_farm.generate.furnish.walk_bitmap import WalkMap

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
