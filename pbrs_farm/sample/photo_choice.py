"""Choose a home's views among candidates: good, without near-duplicates, together like photographs; no effects.

The views of a home maximise the sum of their scores, minus costs of foreground and framing, minus likeness times
their number times the distance of their mean class shares to those of photographs: first sector by sector, the
best first, then by exchange. That distance is the L1 distance of the views' mean NYU13 pixel shares to those
published for NYUv2's labelled frames (Silberman et al. 2012), without unlabelled pixels.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F32, F64
from pbrs_farm.core.camera import Camera, Intrinsics
from pbrs_farm.core.classes import NYU13_NAMES
from pbrs_farm.core.house import Room
from pbrs_farm.core.recipe import CameraFields
from pbrs_farm.sample.camera_report import Verdict
from pbrs_farm.sample.candidates import Candidates
from pbrs_farm.sample.view_overlap import DepthOf, overlap

# fmt: off
NYUV2_SHARES: Final[Mapping[str, float]] = {
    "wall": 0.235, "furniture": 0.139, "objects": 0.121, "floor": 0.098, "window": 0.051,
    "bed": 0.041, "table": 0.035, "chair": 0.033, "sofa": 0.031, "picture": 0.022,
    "ceiling": 0.013, "books": 0.007,
}
# fmt: on
"""Shares of pixels over NYUv2's 1,449 labelled frames, unlabelled pixels counted."""

_PHOTOGRAPHS: Final[F64] = np.array([NYUV2_SHARES.get(name, 0.0) for name in NYU13_NAMES])
# (14,) the same of the labelled pixels alone.
_OF_LABELLED: Final[F64] = _PHOTOGRAPHS / _PHOTOGRAPHS.sum()
MOST_OVERLAP: Final = 0.8
"""A view that shares more than this with a better one is its near-duplicate."""

_TRIES: Final = 12
"""Candidates of a sector to try, best first, before it gets no view."""

_ROUNDS: Final = 3
"""Maximum exchanges of a view for another one of its sector."""

MOST_WORSE: Final = 0.7
"""Maximum difference to its sector's best score for a view chosen by likeness."""

_LIKELY_BY_SCORE: Final = 8
"""Candidates of a sector, best first, whose scores are worth knowing better whatever they add."""

_Name = tuple[str, int]
"""A candidate's room and number."""


def share_distance(shares: F64) -> F64:
    """(...) L1 distance, 0..2 (no class: 2), of NYU13 shares (..., 14), column 0 ignored, to NYUv2's."""
    labelled = shares[..., 1:]
    total = labelled.sum(-1, keepdims=True)
    part = labelled / np.where(total > 0, total, 1.0)
    return np.where(total[..., 0] > 0, np.abs(part - _OF_LABELLED[1:]).sum(-1), 2.0)


@dataclass(frozen=True, slots=True, eq=False)
class RoomCandidates:
    """A room's candidates with the rule that rejected each, and what the others show.

    verdict: (N,) uint8 of Verdict. score: (N,) float64, -inf where a rule rejected it. nyu13:
    (N, 14) shares of the picture of each class, framing, foreground: (N,) framing_cost and
    foreground_cost of photo_score.py; all 0 where it was not looked at.
    """

    room: Room
    candidates: Candidates
    verdict: NDArray[np.uint8]
    score: F64
    nyu13: F64
    framing: F64
    foreground: F64

    def worth(self, numbers: NDArray[np.intp]) -> F64:
        """(M,) scores of candidates minus the cost of objects close to the lens."""
        return np.asarray(self.score[numbers] - self.foreground[numbers])

    def ranked(self, sector: int) -> NDArray[np.intp]:
        """Indices of a sector's candidates that no rule rejected, best first."""
        mine = (self.candidates.sector == sector) & np.isfinite(self.score)
        which = np.flatnonzero(mine)
        return which[np.argsort(-self.score[which], kind="stable")]


@dataclass(slots=True, eq=False)
class _Sector:
    """A sector that may have views: its candidates, best first, and the numbers of those taken."""

    scored: RoomCandidates  # of its room
    number: int  # in its room
    candidates: NDArray[np.intp]
    taken: list[int] = field(default_factory=list)
    ahead: set[int] = field(default_factory=set)  # numbers that added most when a view was chosen


@dataclass(slots=True, eq=False)
class PhotoChoice:
    """The choice among all candidates of one home.

    lens: of zoom 1, of the size of depth pictures. depth_of: small depth pictures; None: no view is
    compared with another, so that near-duplicates stay. looked_at: cameras and depth pictures that are
    at hand, by room and number.
    """

    fields: CameraFields
    lens: Intrinsics
    depth_of: DepthOf | None
    looked_at: dict[_Name, tuple[Camera, F32]] = field(default_factory=dict)
    _shown: F64 = field(default_factory=lambda: np.zeros(len(NYU13_NAMES)))  # sum over views
    _taken: set[_Name] = field(default_factory=set)
    _are_alike: dict[frozenset[_Name], bool] = field(default_factory=dict)

    def choose(self, rooms: Sequence[RoomCandidates]) -> dict[tuple[str, int], list[int]]:
        """(room id, sector) -> chosen indices, best sectors first; writes the verdicts."""
        sectors = self._filled_sectors(rooms)
        for sector in sectors:
            sector.scored.verdict[sector.taken] = Verdict.WINNER
        return {(sector.scored.room.id, sector.number): sector.taken for sector in sectors}

    def likely(self, rooms: Sequence[RoomCandidates]) -> dict[str, NDArray[np.intp]]:
        """Room id -> indices of the candidates that may be chosen with better scores; writes low verdicts."""
        likely: dict[str, set[int]] = {scored.room.id: set() for scored in rooms}
        for sector in self._filled_sectors(rooms):
            best = sector.scored.ranked(sector.number)[: _LIKELY_BY_SCORE * self.fields.per_sector]
            likely[sector.scored.room.id] |= sector.ahead | set(best.tolist())
        return {room: np.array(sorted(numbers), np.intp) for room, numbers in likely.items()}

    def _filled_sectors(self, rooms: Sequence[RoomCandidates]) -> list[_Sector]:
        """The sectors that have candidates, the one with the best first, each with its views."""
        # Let every sector that has a candidate take its turn, the best first.
        sectors = [
            _Sector(scored, number, ranked)
            for scored in rooms
            for number in range(self.fields.n_sectors)
            if len(ranked := scored.ranked(number))
        ]
        sectors.sort(key=lambda sector: -sector.scored.score[sector.candidates[0]])
        # Choose views for each, compared with those chosen in all rooms so far.
        with_view: set[str] = set()
        for sector in sectors:
            self._leave_out_low_scores(sector, is_first=sector.scored.room.id not in with_view)
            self._fill(sector)
            if sector.taken:
                with_view.add(sector.scored.room.id)
        # Exchange views for others that bring all of them nearer to photographs.
        for _ in range(_ROUNDS if self.fields.likeness > 0 else 0):
            if not sum(self._exchange(sector) for sector in sectors):
                break
        return sectors

    def _leave_out_low_scores(self, sector: _Sector, *, is_first: bool) -> None:
        """Reject candidates below min_score; a room's first view, its best, needs min_room_score alone."""
        f, scored = self.fields, sector.scored
        is_low = scored.score[sector.candidates] < f.min_score
        if is_first and scored.score[sector.candidates[0]] >= f.min_room_score:
            is_low[0] = False
        scored.verdict[sector.candidates[is_low]] = Verdict.BELOW_MIN_SCORE
        sector.candidates = sector.candidates[~is_low]
        # Likeness chooses among the better ones.
        if f.likeness > 0 and len(sector.candidates):
            worth = scored.worth(sector.candidates)
            sector.candidates = sector.candidates[worth >= worth.max() - MOST_WORSE]

    def _fill(self, sector: _Sector) -> None:
        """Take a sector's views, the candidate that adds most first, leaving out near-duplicates."""
        remaining = sector.candidates
        for _ in range(_TRIES * self.fields.per_sector):
            if len(sector.taken) == self.fields.per_sector or not len(remaining):
                return
            # Rank again after each choice: a view's gain depends on those already chosen.
            order = np.argsort(-self._gain(sector.scored, remaining), kind="stable")
            sector.ahead.update(remaining[order[:_TRIES]].tolist())
            number, remaining = int(remaining[order[0]]), np.delete(remaining, order[0])
            if self._is_near_duplicate(sector.scored, number):
                sector.scored.verdict[number] = Verdict.NEAR_DUPLICATE
            else:
                self._take(sector, number)

    def _exchange(self, sector: _Sector) -> bool:
        """Give each view of a sector up for the candidate that then adds most."""
        before = list(sector.taken)
        for number in before:
            self._give_up(sector, number)
            alternatives = np.setdiff1d(sector.candidates, sector.taken)
            gain = self._gain(sector.scored, alternatives)
            # Try the better ones from the best down; a view is no near-duplicate of itself.
            order = alternatives[np.argsort(-gain, kind="stable")][:_TRIES].tolist()
            sector.ahead.update(order)
            better = order[: order.index(number)] if number in order else order
            free = (k for k in better if not self._is_near_duplicate(sector.scored, k))
            self._take(sector, next(free, number))
        return set(before) != set(sector.taken)

    def _gain(self, scored: RoomCandidates, numbers: NDArray[np.intp]) -> F64:
        """(M,) gain of adding each candidate to the chosen views."""
        worth = scored.worth(numbers)
        if self.fields.likeness == 0:
            return worth
        distance = share_distance(self._shown + scored.nyu13[numbers])
        unlike = self.fields.likeness * (len(self._taken) + 1) * distance
        return np.asarray(worth - scored.framing[numbers] - unlike)

    def _take(self, sector: _Sector, number: int) -> None:
        sector.taken.append(number)
        self._taken.add((sector.scored.room.id, number))
        self._shown = self._shown + sector.scored.nyu13[number]

    def _give_up(self, sector: _Sector, number: int) -> None:
        sector.taken.remove(number)
        self._taken.remove((sector.scored.room.id, number))
        self._shown = self._shown - sector.scored.nyu13[number]

    def _is_near_duplicate(self, scored: RoomCandidates, number: int) -> bool:
        if self.depth_of is None:
            return False
        name = scored.room.id, number
        if name not in self.looked_at:
            camera = scored.candidates.cameras(np.array([number]), self.lens)[0]
            self.looked_at[name] = camera, self.depth_of([camera])[0]
        return any(self._is_alike(name, taken) for taken in self._taken)

    def _is_alike(self, name: _Name, other: _Name) -> bool:
        # Every chosen view was compared before; later rounds repeat the same pairs.
        pair = frozenset((name, other))
        if pair not in self._are_alike:
            shared = overlap(*self.looked_at[name], *self.looked_at[other])
            self._are_alike[pair] = shared > MOST_OVERLAP
        return self._are_alike[pair]
