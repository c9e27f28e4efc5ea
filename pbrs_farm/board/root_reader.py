"""Objects of an output root, with a limit of size and never outside of it. Effects: reads the store.

The store refuses keys that leave the root; links out of a folder are refused here.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

from pbrs_farm.core.errors import ObjectMissing, PbrsError, StoreFailed
from pbrs_farm.core.keys import house_key
from pbrs_farm.regular_files import real_path
from pbrs_farm.store.folder import FolderStore
from pbrs_farm.store.object_store import Store, check_key

MAX_JSON_BYTES = 64 * 2**20  # of a view.json, house.json, cameras.json
MAX_PICTURE_BYTES = 256 * 2**20  # of a displayed layer
PIECE_BYTES = 2**20  # of a streamed object


class RootReader:
    """The store of an output root for reading."""

    def __init__(self, store: Store) -> None:
        self.store = store
        self._root = real_path(store.root) if isinstance(store, FolderStore) else None

    @property
    def url(self) -> str:
        """URL of the root without secrets."""
        return self.store.url

    def size(self, key: str) -> int | None:
        """Size of an object in bytes, None if it is not readable."""
        try:
            self._check_inside(key)
            head = self.store.head(key)
        except StoreFailed:
            return None
        return None if head is None else head.n_bytes

    def get(self, key: str, most_bytes: int = MAX_JSON_BYTES) -> bytes:
        """Bytes of an object. Raises ObjectMissing, StoreFailed also for more than most_bytes."""
        self._size_within(key, most_bytes)
        return self.store.get(key)

    def has_house(self, house: str) -> bool:
        """True if the root has a file of a house, or if the store does not answer."""
        if self.size(house_key(house, "house.json")) is not None:
            return True
        try:
            return next(iter(self.store.list(house_key(house, ""))), None) is not None
        except StoreFailed:
            return True

    def pieces(self, key: str, most_bytes: int) -> tuple[int, Iterator[bytes]]:
        """Size of an object and its bytes in pieces. Raises as get."""
        n_bytes = self._size_within(key, most_bytes)
        starts = range(0, n_bytes, PIECE_BYTES)
        return n_bytes, (
            self.store.get_range(key, start, min(PIECE_BYTES, n_bytes - start)) for start in starts
        )

    def get_or_none(self, key: str, most_bytes: int = MAX_JSON_BYTES) -> bytes | None:
        """Bytes of an object; None if it is missing or the store fails."""
        try:
            return self.get(key, most_bytes)
        except PbrsError:
            return None

    def json_object(self, key: str) -> dict[str, Any]:
        """The JSON object of a key, {} if it is missing or damaged; fields may have any type."""
        data = self.get_or_none(key)
        try:
            value = json.loads(data) if data is not None else {}
        except (ValueError, RecursionError):
            return {}
        return value if isinstance(value, dict) else {}

    def _size_within(self, key: str, most_bytes: int) -> int:
        self._check_inside(key)
        head = self.store.head(key)
        if head is None:
            raise ObjectMissing(key, "no such object")
        if head.n_bytes > most_bytes:
            text = f"has {head.n_bytes / 1e6:.0f} MB, at most {most_bytes / 1e6:.0f} MB are read"
            raise StoreFailed(key, text)
        return head.n_bytes

    def _check_inside(self, key: str) -> None:
        check_key(key)
        if self._root is not None and not real_path(self._root / key).is_relative_to(self._root):
            raise ObjectMissing(key, "a link that leads out of the folder")
