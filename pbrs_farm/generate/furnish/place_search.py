"""Depth first over groups of pieces: the best places of each, until all stand and one can walk. No effects."""

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

_ROOTS: Final = 5  # places of the first group that are compared
_NODES_A_ROOT: Final = 14
_MISSING: Final = 100.0  # penalty for a required group that finds no place
_MISSED: Final = 2.0  # and one that need not


@dataclass(frozen=True, slots=True)
class Arrangement:
    """What stands in a room."""

    standing: tuple[Standing, ...] = ()
    missing: tuple[str, ...] = ()  # groups that must stand
    score: float = -np.inf

    @property
    def bodies(self) -> list[Rect]:
        """Of everything that stands on the floor.

        Plan rectangles (x0, z0, x1, z1), metres; what hangs above the floor is not among them.
        """
        return [rect for place in self.standing for rect in place.bodies]

    @property
    def fronts(self) -> list[Rect]:
        """What a way must reach."""
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
        self, level: int, alive: list[Bools], free: Bools, standing: tuple[Standing, ...],
        missing: tuple[str, ...], score: float,
    ) -> bool:  # fmt: skip
        """Place the groups from a level on; True when all of them stand."""
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
            left = [
                mask if k <= level else self.places[k].free_of(mask, place)
                for k, mask in enumerate(alive)
            ]
            # Do not go on where a group that must stand cannot any more.
            if any(
                g.is_required and not mask.any() and alive[k].any()
                for k, (g, mask) in enumerate(zip(self.groups, left, strict=True))
                if k > level
            ):
                continue
            if self.descend(
                level + 1, left, after, (*standing, place), missing, score + place.score
            ):
                return True
        # Go on without it.
        lost = (group.name,) if group.is_required else ()
        price = _MISSING if group.is_required else _MISSED
        whole = self.descend(level + 1, alive, free, standing, (*missing, *lost), score - price)
        return whole and not lost

    def placed(self, place: Standing, free: Bools, standing: tuple[Standing, ...]) -> Bools | None:
        """The free floor with one more template, if one can still walk to everything."""
        after = self.walk.with_bodies(free, place.bodies)
        fronts = [rect for s in (*standing, place) for rect in s.fronts]
        region = self.walk.reached(after, fronts)
        if region is None or (self.least_share and self.walk.share(region) < self.least_share):
            return None
        return after


def arranged(
    groups: Sequence[PieceGroup], places: Sequence[Places], walk: WalkMap, *,
    start: Arrangement | None = None, roots: int = _ROOTS, nodes: int = _NODES_A_ROOT,
    least_share: float = 0.0,
) -> Arrangement:  # fmt: skip
    """The best arrangement found of groups, in this order, added to what stands already.

    Depth first: at each group the best places that overlap nothing and leave a way to all that must be
    reached. roots: places of the first group that are tried; nodes: bound on
    what is looked at for each of them. least_share: of the floor that must stay walkable. A group that is not required may be left out.
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
        left = [p.free_of(mask, place) for p, mask in zip(places, alive, strict=True)]
        search.descend(
            1, left, after, (*before.standing, place), before.missing, before.score + place.score
        )
    if search.best.score == -np.inf:
        search.limit = search.nodes + 4 * nodes
        search.descend(0, alive, free, before.standing, before.missing, before.score)
    return search.best
