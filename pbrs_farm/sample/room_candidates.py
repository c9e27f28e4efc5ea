"""What a room's candidates of the preset `photo` show and score; no effects."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.house import Room
from pbrs_farm.sample.candidates import Candidates


@dataclass(frozen=True, slots=True, eq=False)
class RoomCandidates:
    """A room's candidates with the rule that rejected each, and what the others show.

    verdict: (N,) uint8 of Verdict. score: (N,) float64, -inf where a rule rejected it. nyu13:
    (N, 14) shares of the picture of each class, framing: (N,) framing_cost of photo_score.py; both
    0 where it was not looked at.
    """

    room: Room
    candidates: Candidates
    verdict: NDArray[np.uint8]
    score: F64
    nyu13: F64
    framing: F64

    def ranked(self, sector: int) -> NDArray[np.intp]:
        """Numbers of a sector's candidates that no rule rejected, best first."""
        mine = (self.candidates.sector == sector) & np.isfinite(self.score)
        which = np.flatnonzero(mine)
        return which[np.argsort(-self.score[which], kind="stable")]
