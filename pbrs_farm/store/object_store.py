"""The interface of a store, whole objects under keys, and the allowed keys; no effects."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Final, Protocol, runtime_checkable

from pbrs_farm.core.errors import ObjectMissing, StoreFailed

# No leading dot, no slash, no character special to a shell or a URL.
_SEGMENT: Final = re.compile(r"[A-Za-z0-9_\-+=@,~ ()\[\]!][A-Za-z0-9_.\-+=@,~ ()\[\]!]*")
_MAX_KEY: Final = 900  # characters; S3 takes 1024 bytes with the prefix
_MAX_SEGMENT: Final = 200  # characters; file systems take 255 bytes
LAYOUT: Final = "layout.json"  # marks a packed output root (store/laid_out.py)
CONTENT_TYPES: Final = {
    "png": "image/png",
    "exr": "image/x-exr",
    "jpg": "image/jpeg",
    "json": "application/json",
    "jsonl": "application/x-ndjson",
    "html": "text/html; charset=utf-8",
    "txt": "text/plain; charset=utf-8",
    "glb": "model/gltf-binary",
    "parquet": "application/vnd.apache.parquet",
}


@dataclass(frozen=True, slots=True)
class Head:
    """Properties of an object, without its content."""

    n_bytes: int
    modified_s: float = 0.0  # since 1970, by the store's clock; 0 if it has none


class Store(Protocol):
    """Whole objects under keys. A reader sees a complete object or none.

    Every method raises StoreFailed with the key, and StoreUnavailable (worth another try) when
    the store did not answer. Keys are relative, "/" between segments, never "..".
    """

    @property
    def url(self) -> str:
        """Address for messages, without secrets; S3 stores of different endpoints may share it."""
        ...

    def put(self, key: str, data: bytes | memoryview) -> None:
        """Write the object whole, over an older one. Markers go through `put_if_absent`."""
        ...

    def put_if_absent(self, key: str, data: bytes) -> bool:
        """Write the object unless it exists; returns True if this call wrote it.

        Of many concurrent writers exactly one gets True, so the result can decide which one continues.
        """
        ...

    def get(self, key: str) -> bytes:
        """The object's whole content; ObjectMissing without one. See `get_range` and `get_or_none`."""
        ...

    def get_range(self, key: str, start: int, n_bytes: int) -> bytes:
        """n_bytes of the object from byte start, or fewer at its end; ObjectMissing without an object."""
        ...

    def head(self, key: str) -> Head | None:
        """Size of the object, None if it is missing: one small request. `get_or_none` replaces head and get."""
        ...

    def list(self, prefix: str = "") -> Iterator[str]:
        """Keys of all objects below the folder `prefix` ("" or "a/b/"), at any depth, in no defined order.

        Raises StoreFailed immediately for a prefix that does not end with "/". Objects put or deleted meanwhile
        may be listed or not.
        """
        ...

    def delete(self, key: str) -> None:
        """Remove the object, if it exists. To delete a folder, list it and delete its keys."""
        ...


def get_or_none(store: Store, key: str) -> bytes | None:
    """The object's bytes, None if it is missing: one request, not two. Raises StoreFailed as `get`."""
    try:
        return store.get(key)
    except ObjectMissing:
        return None


@runtime_checkable
class PackingStore(Store, Protocol):
    """A store with its own way to put a step's results."""

    def put_done(self, key: str, marker: bytes, files: Mapping[str, bytes]) -> None:
        """As the function put_done, for stores where the files of several steps share one object."""
        ...

    def replace_marker(self, key: str, marker: bytes) -> None:
        """As the function replace_marker."""
        ...


def put_done(store: Store, key: str, marker: bytes, files: Mapping[str, bytes]) -> None:
    """Put a step's files, and then its marker under `key`, if-absent.

    files: whole key -> bytes, written first, so that a reader who sees the marker finds them. An existing
    marker stays, but the files are written again. A PackingStore may hold the results back until the last
    step of its group is put.
    """
    if isinstance(store, PackingStore):
        store.put_done(key, marker, files)
        return
    for file, data in files.items():
        store.put(file, data)
    store.put_if_absent(key, marker)


def replace_marker(store: Store, key: str, marker: bytes) -> None:
    """Replace the marker of a step in one write. A PackingStore drops the step's files with it."""
    if isinstance(store, PackingStore):
        store.replace_marker(key, marker)
    else:
        store.put(key, marker)


def check_key(key: str) -> str:
    """Return the key; raises StoreFailed if it could name anything outside the store.

    Refused: empty segments, `..`, a leading dot or slash, characters special to a shell or a URL, and
    lengths above the limits of S3 or a file system.
    """
    segments = key.split("/")
    # Refuse empty segments, "." and "..", as well as names too long for S3 or a disk.
    if not key or len(key) > _MAX_KEY or any(not _is_segment(s) for s in segments):
        raise StoreFailed(repr(key[:120]), "not a valid key: relative, no '..', no leading dot")
    return key


def check_prefix(prefix: str) -> str:
    """Return the prefix, "" or a folder with a trailing slash; StoreFailed for any other, or an invalid segment."""
    if prefix and not prefix.endswith("/"):
        raise StoreFailed(prefix, "a prefix to list ends with '/'")
    if prefix:
        check_key(prefix[:-1])
    return prefix


def content_type(key: str) -> str:
    """The MIME type by the key's suffix; application/octet-stream for an unknown one."""
    return CONTENT_TYPES.get(key.rpartition(".")[2], "application/octet-stream")


def _is_segment(segment: str) -> bool:
    return len(segment) <= _MAX_SEGMENT and _SEGMENT.fullmatch(segment) is not None
