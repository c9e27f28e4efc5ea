"""A store that waits for another one to come back. Effects: those of the store it wraps."""

from __future__ import annotations

import random
import time
from collections.abc import Callable, Iterator
from typing import TypeVar

from pbrs_farm.core.errors import StoreUnavailable
from pbrs_farm.store.interface import Head, Store

T = TypeVar("T")


class PatientStore:
    """Tries a call again, with jitter, while the inner store is unavailable.

    So a finished picture is held in memory through an outage instead of being rendered again.
    patience_s: then StoreUnavailable is raised.  on_wait: told the reason before each pause.
    """

    def __init__(
        self, store: Store, patience_s: float, on_wait: Callable[[str], None] = lambda _reason: None
    ) -> None:
        self._store = store
        self._patience_s = patience_s
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

    def head(self, key: str) -> Head | None:
        return self._call(lambda: self._store.head(key))

    def list(self, prefix: str = "") -> Iterator[str]:
        return iter(self._call(lambda: [*self._store.list(prefix)]))

    def delete(self, key: str) -> None:
        self._call(lambda: self._store.delete(key))

    def _call(self, act: Callable[[], T]) -> T:
        give_up = time.monotonic() + self._patience_s
        n_tries = 0
        while True:
            try:
                return act()
            except StoreUnavailable as error:
                pause_s = random.uniform(0.5, 1.0) * min(10.0, 0.2 * 2**n_tries)
                if time.monotonic() + pause_s > give_up:
                    raise
                self._on_wait(str(error))
                time.sleep(pause_s)
                n_tries += 1
