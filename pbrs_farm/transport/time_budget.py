"""Time budgets: how many more samples fit. Effects: reads the clock."""

from __future__ import annotations

import math
import time
from typing import Final

_FIRST_SPP: Final = 4  # samples of the first launch, which measures the pace


class TimeBudget:
    """A budget of seconds that counts down from its making on; 0 sets no limit.

    Ask `n_that_fit` before each launch and call `record` after it: the pace of one launch
    decides how many samples the next may have. The first launch has few samples, to measure
    the pace, and always fits.

        budget = TimeBudget(60.0)
        while spp < goal and (n := budget.n_that_fit(goal - spp)):
            render(n)
            budget.record(n)

    spent_s: seconds of the budget that an earlier, killed run of the same render used.
    """

    def __init__(self, budget_s: float, spent_s: float = 0.0) -> None:
        self.is_limited = budget_s > 0
        self._budget_s = budget_s
        self._last = time.monotonic()
        self._end = self._last + budget_s - spent_s
        self._s_per_sample: float | None = None  # of the last launch

    @property
    def share(self) -> float:
        """Spent share of the budget; 0 without a limit."""
        if not self.is_limited:
            return 0.0
        return 1 - max(self._end - time.monotonic(), 0.0) / self._budget_s

    @property
    def left_s(self) -> float:
        """Remaining seconds; infinite without a limit."""
        return self._end - time.monotonic() if self.is_limited else math.inf

    def n_that_fit(self, most: int) -> int:
        """Samples of the next launch, at most `most`; 0 when none fits any more."""
        if not self.is_limited:
            return most
        if self._s_per_sample is None:
            return min(_FIRST_SPP, most)
        left_s = self._end - time.monotonic()
        return max(min(int(left_s / self._s_per_sample), most), 0)

    def record(self, n: int) -> None:
        """Take the time since the last launch for n samples as the pace of the next."""
        began, self._last = self._last, time.monotonic()
        self._s_per_sample = (self._last - began) / n
