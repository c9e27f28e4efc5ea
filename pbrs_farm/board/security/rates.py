"""How often an address may ask: a bucket of tokens each. Effects: reads the clock."""

from __future__ import annotations

import time
from collections import OrderedDict
from collections.abc import Callable
from typing import Final

_MAX_ADDRESSES: Final = 4096  # that are remembered


class Buckets:
    """A bucket per address, filled at a rate; used from one thread."""

    def __init__(
        self, per_s: float, burst: float, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._per_s, self._burst, self._clock = per_s, burst, clock
        self._left: OrderedDict[str, tuple[float, float]] = OrderedDict()  # tokens, at which time

    def takes(self, address: str) -> bool:
        """Whether the address may ask once more now; if so, it has."""
        now = self._clock()
        left, since = self._left.pop(address, (self._burst, now))
        left = min(self._burst, left + (now - since) * self._per_s)
        may = left >= 1
        self._left[address] = (left - 1 if may else left, now)
        while len(self._left) > _MAX_ADDRESSES:
            self._left.popitem(last=False)
        return may
