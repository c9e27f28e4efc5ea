"""Open the store of a URL; no effects before the store is used."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Final
from urllib.parse import urlsplit

from pbrs_farm.core.errors import BadInput
from pbrs_farm.operating_system import has_drive, path_of_url
from pbrs_farm.store.folder import FolderStore
from pbrs_farm.store.memory_store import MemoryStore
from pbrs_farm.store.object_store import LAYOUT, Store
from pbrs_farm.store.s3 import S3Settings, S3Store

LAYOUTS: Final = ("files", "packed")


@dataclass(frozen=True, slots=True)
class StoreSettings:
    """Settings of stores, apart from their URL."""

    fsync: bool = False  # of folder stores
    s3: S3Settings = field(default_factory=S3Settings)
    # Layout of new roots: "files" or "packed"; "" packs in S3 only. A root keeps its first layout.
    layout: str = ""

    def __post_init__(self) -> None:
        if self.layout not in ("", *LAYOUTS):
            hint = f"of {', '.join(LAYOUTS)}"
            raise BadInput("PBRS_STORE_LAYOUT", self.layout, "no such layout", hint=hint)


def store_from_url(url: str, settings: StoreSettings | None = None) -> Store:
    """The store at `file:///`, `s3://`, `memory:` or a folder; BadInput, MachineFailed without s3."""
    settings = settings or StoreSettings()
    parts = urlsplit(url)
    if url == "memory:":
        return MemoryStore()
    if parts.scheme == "file" and parts.netloc in ("", "localhost") and parts.path:
        return _folder(path_of_url(parts.path), settings)
    if parts.scheme == "s3" and parts.netloc and "@" not in parts.netloc:
        return _laid_out(S3Store(parts.netloc, parts.path, settings.s3), settings.layout != "files")
    if url and (not parts.scheme or has_drive(url)):
        return _folder(Path(url), settings)
    # Do not repeat a URL that may contain a password.
    shown = f"{parts.scheme}:..." if "@" in url else repr(url)
    hint = "file:///folder, s3://bucket/prefix or memory:"
    raise BadInput(shown, "", "not a store", hint=hint)


def _folder(root: Path, settings: StoreSettings) -> Store:
    """A folder store; a packed root if it is one already (e.g. a copy of a bucket) or is to become one."""
    if root.exists() and not root.is_dir():
        raise BadInput(root, "", "is not a folder")
    store, packs = FolderStore(root, fsync=settings.fsync), settings.layout == "packed"
    return _laid_out(store, packs) if packs or (root / LAYOUT).is_file() else store


def _laid_out(store: Store, packs: bool) -> Store:
    # Lazy import: shards are read without pydantic.
    from pbrs_farm.store.laid_out import LaidOutStore

    return LaidOutStore(store, packs)
