"""From a URL to the store it names; no effects before the store is used."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from urllib.parse import unquote, urlsplit

from pbrs_farm.core.errors import BadInput
from pbrs_farm.store.folder import FolderStore
from pbrs_farm.store.object_store import MemoryStore, Store
from pbrs_farm.store.s3 import S3Settings, S3Store


@dataclass(frozen=True, slots=True)
class StoreSettings:
    """How stores behave; the URL says where they are."""

    fsync: bool = False  # of folders
    s3: S3Settings = field(default_factory=S3Settings)


def store_from_url(url: str, settings: StoreSettings | None = None) -> Store:
    """The store at `file:///folder`, `s3://bucket/prefix`, `memory:` or a plain folder.

    Raises BadInput for any other URL, MachineFailed when the s3 extra is not installed.
    """
    settings = settings or StoreSettings()
    parts = urlsplit(url)
    if url == "memory:":
        return MemoryStore()
    if parts.scheme == "file" and parts.netloc in ("", "localhost") and parts.path:
        return FolderStore(Path(unquote(parts.path)), fsync=settings.fsync)
    if parts.scheme == "s3" and parts.netloc and "@" not in parts.netloc:
        return S3Store(parts.netloc, parts.path, settings.s3)
    if not parts.scheme and url:
        return FolderStore(Path(url), fsync=settings.fsync)
    # Do not repeat a URL that may hold a password.
    shown = f"{parts.scheme}:..." if "@" in url else repr(url)
    hint = "file:///folder, s3://bucket/prefix or memory:"
    raise BadInput(shown, "", "not a store", hint=hint)
