"""The best view of a sector: coarse pictures first, finalists again at full size; no effects.

A candidate is rescored while its coarse score, plus the error margin of a coarse picture, could beat
the best full score; so the result equals that of scoring all at full size wherever the margin holds.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F32, F64, Bools

# A coarse score may fall short of the full one by this over the coarse picture's width. Measured
# on the built-in home: at 160x120 the difference has a standard deviation of 0.0005 of the
# picture and was 0.0027 at most over 300 candidates; this allows 0.005.
COARSE_MARGIN_PX: Final = 0.8
# An object of this part of the least share in a coarse picture may be large enough in a full one.
COARSE_SLACK: Final = 0.8
_BATCH: Final = 4  # candidates rescored before the best is compared again
Rescore = Callable[[NDArray[np.intp]], tuple[Bools, F64, NDArray[np.uint32]]]
"""Of the candidates of those numbers, at full size: who keeps the rules, scores, item counts."""


@dataclass(frozen=True, slots=True, eq=False)
class Coarse:
    """Coarse pictures of a sector's N candidates."""

    possible: Bools  # (N,) may keep the rules at full size
    score: F64  # (N,)


@dataclass(slots=True, eq=False)
class FullScores:
    """Full-size results so far, by number of the candidate."""

    rescore: Rescore
    kept: dict[int, bool] = field(default_factory=dict)  # it keeps the rules
    score: dict[int, float] = field(default_factory=dict)
    counts: dict[int, NDArray[np.uint32]] = field(default_factory=dict)  # pixels of each item

    def rescore_new(self, candidates: NDArray[np.intp]) -> None:
        """Score these candidates at full size, unless done already."""
        new = np.array([c for c in candidates.tolist() if c not in self.score], np.intp)
        if not len(new):
            return
        keeps, score, rows = self.rescore(new)
        for k, candidate in enumerate(new.tolist()):
            self.kept[candidate] = bool(keeps[k])
            self.score[candidate] = float(score[k])
            self.counts[candidate] = rows[k]

    def keeps(self, candidate: int) -> bool:
        """It was scored at full size, keeps the rules and scores above nothing."""
        return self.kept.get(candidate, False) and self.score[candidate] > 0

    @property
    def ranking(self) -> list[int]:
        """Candidates that keep the rules, best first; equal scores in order of number."""
        candidates = [c for c in self.score if self.keeps(c)]
        return sorted(candidates, key=lambda c: (-self.score[c], c))


def best_first(coarse: Coarse, full: FullScores, *, margin: float | None) -> int | None:
    """The candidate of the best full-size score, or None; margin: of coarse scores, None = trust none."""
    order = np.argsort(-coarse.score, kind="stable")
    if margin is None:
        full.rescore_new(order)
    else:
        # Rescore from the best coarse score down, in batches.
        order = order[coarse.possible[order]]
        for start in range(0, len(order), _BATCH):
            batch = order[start : start + _BATCH]
            ranking = full.ranking
            if ranking:
                # Stop when no coarse score can beat the best full one.
                reach = coarse.score[batch] + margin
                batch = batch[reach >= full.score[ranking[0]]]
                if not len(batch):
                    break
            full.rescore_new(batch)
    ranking = full.ranking
    return ranking[0] if ranking else None


def next_diverse(
    coarse: Coarse, share: F32, chosen: list[int], full: FullScores, min_fraction: float
) -> int | None:
    """The candidate that shows most that the chosen ones do not; None when none is left.

    share: (N, n_objects) part of the coarse picture each object covers. Greedy: first by objects
    newly seen, then by how much more of every object is seen than in the best chosen view.
    """
    # Rank by newly visible objects, then by objects larger than before.
    shown = share[chosen].max(0)
    new_objects = ((share >= min_fraction) & (shown < min_fraction)).sum(1)
    gain = np.maximum(share - shown, 0).sum(1)
    order = np.lexsort((-gain, -new_objects))
    # Take the first that keeps the rules at full size.
    for candidate in order.tolist():
        if candidate in chosen or not coarse.possible[candidate]:
            continue
        full.rescore_new(np.array([candidate]))
        if full.keeps(candidate):
            return int(candidate)
    return None
