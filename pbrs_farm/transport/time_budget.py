"""How many more samples fit into a time budget. Effects: reads the clock."""

from __future__ import annotations

import time
from typing import Final

_FIRST: Final = 4
"""Samples of the first launch, from which the pace is known."""


class TimeBudget:
    """Counts down a budget in seconds from now; a budget of 0 is no budget at all."""

    def __init__(self, budget_s: float) -> None:
        self.runs = budget_s > 0
        self._now = time.monotonic()
        self._end = self._now + budget_s
        self._pace_s: float | None = None

    def fitting(self, most: int) -> int:
        """Samples of the next launch, at most `most`; 0 when not even one fits any more."""
        if not self.runs:
            return most
        if self._pace_s is None:
            return min(_FIRST, most)
        left = self._end - time.monotonic()
        return max(min(int(left / self._pace_s), most), 0)

    def did(self, n: int) -> None:
        """A launch of n samples has ended: its pace is that of the next."""
        began, self._now = self._now, time.monotonic()
        self._pace_s = (self._now - began) / n
