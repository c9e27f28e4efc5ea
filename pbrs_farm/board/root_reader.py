"""Reads the objects of an output root, of bounded size and never outside of it. Effects: the store's.

Whatever a request names comes here as a key: the store refuses a key that could leave the root, and
a link inside a folder that leads out of it is refused here.
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
MAX_PICTURE_BYTES = 256 * 2**20  # of a layer that is shown
PIECE_BYTES = 2**20  # of an object that is handed on as it is read


class RootReader:
    """The store of an output root, to be read."""

    def __init__(self, store: Store) -> None:
        self.store = store
        self._root = real_path(store.root) if isinstance(store, FolderStore) else None

    @property
    def url(self) -> str:
        """Where the root is, without secrets."""
        return self.store.url

    def size(self, key: str) -> int | None:
        """Bytes of the object, None when there is none that may be read."""
        try:
            self._check_inside(key)
            head = self.store.head(key)
        except StoreFailed:
            return None
        return None if head is None else head.n_bytes

    def get(self, key: str, most_bytes: int = MAX_JSON_BYTES) -> bytes:
        """The object's bytes. Raises StoreFailed, ObjectMissing where there is none of that size.

        Bounded, since stored files may come from anybody: give most_bytes where more than JSON is
        read. A key that leads out of the root is refused.
        """
        self._size_within(key, most_bytes)
        return self.store.get(key)

    def has_house(self, house: str) -> bool:
        """Whether the root has a file of a house; where the store does not answer, it may have."""
        if self.size(house_key(house, "house.json")) is not None:
            return True
        try:
            return next(iter(self.store.list(house_key(house, ""))), None) is not None
        except StoreFailed:
            return True

    def pieces(self, key: str, most_bytes: int) -> tuple[int, Iterator[bytes]]:
        """The object's size and its bytes piece by piece. Raises as get.

        The size is asked first; an object that shrinks meanwhile fails while it is being sent.
        """
        n_bytes = self._size_within(key, most_bytes)
        starts = range(0, n_bytes, PIECE_BYTES)
        return n_bytes, (
            self.store.get_range(key, at, min(PIECE_BYTES, n_bytes - at)) for at in starts
        )

    def get_or_none(self, key: str, most_bytes: int = MAX_JSON_BYTES) -> bytes | None:
        """The object's bytes, None where they cannot be had.

        For what a page can do without. It hides a store that does not answer: take `get` where the
        difference matters.
        """
        try:
            return self.get(key, most_bytes)
        except PbrsError:
            return None

    def json_object(self, key: str) -> dict[str, Any]:
        """The JSON object under a key, {} where there is none or it is damaged.

        Fields may be missing or of any type: check each that is used.
        """
        data = self.get_or_none(key)
        try:
            value = json.loads(data) if data is not None else {}
        except (ValueError, RecursionError):
            return {}
        return value if isinstance(value, dict) else {}

    def list(self, prefix: str) -> Iterator[str]:
        """Keys below the folder prefix."""
        return self.store.list(prefix)

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
