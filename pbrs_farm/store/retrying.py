"""A store that retries while the store it wraps is unavailable. Effects: those of the wrapped store."""

from __future__ import annotations

import random
import time
from collections.abc import Callable, Iterator
from typing import TypeVar

from pbrs_farm.core.errors import StoreUnavailable
from pbrs_farm.store.object_store import Head, Store

T = TypeVar("T")  # result of the call

_FIRST_PAUSE_S = 0.2  # maximum; each further pause is twice as long


def retry(
    call: Callable[[int], T],
    timeout_s: float,
    *,
    jitter: tuple[float, float] = (0.0, 1.0),
    max_pause_s: float = 8.0,
    on_wait: Callable[[str], None] = lambda _reason: None,
) -> T:
    """Repeat call(number of earlier tries) while StoreUnavailable, for timeout_s, pauses growing with jitter."""
    # Try until success, another error, or a pause that would end after the deadline.
    deadline, n_tries = time.monotonic() + timeout_s, 0
    while True:
        try:
            return call(n_tries)
        except StoreUnavailable as error:
            pause_s = random.uniform(*jitter) * min(max_pause_s, _FIRST_PAUSE_S * 2**n_tries)
            if time.monotonic() + pause_s > deadline:
                raise
            on_wait(str(error))
        time.sleep(pause_s)
        n_tries += 1


class RetryingStore:
    """Retries each call for timeout_s while the inner store is unavailable; on_wait: called before a pause."""

    def __init__(
        self, store: Store, timeout_s: float, on_wait: Callable[[str], None] = lambda _reason: None
    ) -> None:
        self._store = store
        self._timeout_s = timeout_s  # of one call, its tries and pauses together
        self._on_wait = on_wait

    @property
    def url(self) -> str:
        return self._store.url

    def put(self, key: str, data: bytes | memoryview) -> None:
        self._call(lambda: self._store.put(key, data))

    def put_if_absent(self, key: str, data: bytes) -> bool:
        return self._call(lambda: self._store.put_if_absent(key, data))

    def get(self, key: str) -> bytes:
        return self._call(lambda: self._store.get(key))

    def get_range(self, key: str, start: int, n_bytes: int) -> bytes:
        return self._call(lambda: self._store.get_range(key, start, n_bytes))

    def head(self, key: str) -> Head | None:
        return self._call(lambda: self._store.head(key))

    def list(self, prefix: str = "") -> Iterator[str]:
        # List everything within the retry: a lazy iterator could fail outside it.
        return iter(self._call(lambda: [*self._store.list(prefix)]))

    def delete(self, key: str) -> None:
        self._call(lambda: self._store.delete(key))

    def _call(self, act: Callable[[], T]) -> T:
        # Pause for at least half: many renderers wait for the same store.
        return retry(
            lambda _n: act(),
            self._timeout_s,
            jitter=(0.5, 1.0),
            max_pause_s=10.0,
            on_wait=self._on_wait,
        )
