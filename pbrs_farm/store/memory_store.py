"""A store in this process's memory, for tests and dry runs; its effect is its own state."""

from __future__ import annotations

import threading
from collections.abc import Iterator

from pbrs_farm.core.errors import ObjectMissing
from pbrs_farm.store.object_store import Head, check_key, check_prefix


class MemoryStore:
    """Objects in a dictionary behind a lock; other processes get a copy when it is pickled."""

    def __init__(self) -> None:
        self._objects: dict[str, bytes] = {}  # key -> bytes
        self._lock = threading.Lock()

    def __reduce__(self) -> tuple[object, ...]:
        # Locks cannot be pickled: a copy has a new one.
        with self._lock:
            return (_store_of, (dict(self._objects),))

    @property
    def url(self) -> str:
        return "memory:"

    def put(self, key: str, data: bytes | memoryview) -> None:
        with self._lock:
            self._objects[check_key(key)] = bytes(data)

    def put_if_absent(self, key: str, data: bytes) -> bool:
        with self._lock:
            if check_key(key) in self._objects:
                return False
            self._objects[key] = bytes(data)
            return True

    def get(self, key: str) -> bytes:
        try:
            return self._objects[check_key(key)]
        except KeyError:
            raise ObjectMissing(key, "no such object in memory") from None

    def get_range(self, key: str, start: int, n_bytes: int) -> bytes:
        return self.get(key)[start : start + n_bytes]

    def head(self, key: str) -> Head | None:
        data = self._objects.get(check_key(key))
        return None if data is None else Head(n_bytes=len(data))

    def list(self, prefix: str = "") -> Iterator[str]:
        check_prefix(prefix)
        with self._lock:
            # Copy the keys: the caller may put and delete while it lists.
            found_keys = [key for key in self._objects if key.startswith(prefix)]
        return iter(sorted(found_keys))

    def delete(self, key: str) -> None:
        with self._lock:
            self._objects.pop(check_key(key), None)


def _store_of(objects: dict[str, bytes]) -> MemoryStore:
    store = MemoryStore()
    store._objects = objects
    return store
