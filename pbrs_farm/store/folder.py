"""A store in a folder: a file per object, written atomically through a temporary name. Effects: files."""

from __future__ import annotations

import contextlib
import errno
import os
import secrets
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Final, TypeVar

from pbrs_farm.core.errors import ObjectMissing, StoreFailed, StoreRefused, StoreUnavailable
from pbrs_farm.operating_system import create_new, flush_folder
from pbrs_farm.regular_files import MAX_DIGEST_BYTES, open_regular, read_regular
from pbrs_farm.store.object_store import Head, check_key, check_prefix

T = TypeVar("T")
TEMPORARY: Final = ".incomplete"  # folder of unfinished files

# errno values, by their meaning for the store.
_FULL: Final = {errno.ENOSPC, errno.EDQUOT}
_UNAVAILABLE: Final = {
    errno.EIO,
    errno.ESTALE,
    errno.ETIMEDOUT,
    errno.EAGAIN,
    errno.EINTR,
    errno.ENETDOWN,
}
_FORBIDDEN: Final = {errno.EACCES, errno.EPERM, errno.EROFS}


class FolderStore:
    """Objects as files below `root`, published by rename, or by hard link for put_if_absent.

    Unfinished files are in `root/.incomplete`, on the same file system, and are never listed.
    fsync: flush the file and its folder before an object counts as written (power loss).
    """

    def __init__(self, root: Path, *, fsync: bool = False) -> None:
        self.root = root.absolute()
        self._fsync = fsync

    @property
    def url(self) -> str:
        return self.root.as_uri()

    def put(self, key: str, data: bytes | memoryview) -> None:
        path = self._path(key)
        try:
            temporary = self._write_temporary(data)
            # Rename over an older file: a reader sees either version whole.
            try:
                _with_parent(path, lambda: temporary.replace(path))
            except OSError:
                _unlink(temporary)
                raise
            self._flush_folder(path.parent)
        except OSError as error:
            raise self.failure(key, error) from error

    def put_if_absent(self, key: str, data: bytes) -> bool:
        path = self._path(key)
        try:
            # Skip the write if the object exists.
            if path.exists():
                return False
            temporary = self._write_temporary(data)
            # The file system decides: of many writers one creates the link.
            try:
                _with_parent(path, lambda: os.link(temporary, path))
            except FileExistsError:
                return False
            finally:
                _unlink(temporary)
            self._flush_folder(path.parent)
        except OSError as error:
            raise self.failure(key, error) from error
        return True

    def get(self, key: str) -> bytes:
        try:
            return read_regular(self._path(key), MAX_DIGEST_BYTES)
        except (FileNotFoundError, NotADirectoryError, IsADirectoryError):
            raise ObjectMissing(key, f"no such object in {self.root}") from None
        except OSError as error:
            raise self.failure(key, error) from error

    def get_range(self, key: str, start: int, n_bytes: int) -> bytes:
        try:
            with open_regular(self._path(key), MAX_DIGEST_BYTES) as file:
                file.seek(start)
                return file.read(n_bytes)
        except (FileNotFoundError, NotADirectoryError, IsADirectoryError):
            raise ObjectMissing(key, f"no such object in {self.root}") from None
        except OSError as error:
            raise self.failure(key, error) from error

    def head(self, key: str) -> Head | None:
        path = self._path(key)
        try:
            if not path.is_file():
                return None
            status = path.stat()
            return Head(n_bytes=status.st_size, modified_s=status.st_mtime)
        except OSError as error:
            raise self.failure(key, error) from error

    def list(self, prefix: str = "") -> Iterator[str]:
        check_prefix(prefix)
        return self._walk(prefix)

    def delete(self, key: str) -> None:
        try:
            self._path(key).unlink()
        except (FileNotFoundError, NotADirectoryError):
            return
        except OSError as error:
            raise self.failure(key, error) from error

    def sweep(self, older_than_s: float = 24 * 3600.0) -> int:
        """Remove files of killed writers older than older_than_s (a day or more); their number."""
        n_removed = 0
        oldest = time.time() - older_than_s  # younger ones may be in use
        for path in (self.root / TEMPORARY).glob("*"):
            if path.stat().st_mtime < oldest:
                _unlink(path)
                n_removed += 1
        return n_removed

    def tidy(self) -> None:
        """Remove the folder of unfinished files if it is empty; the next write makes it again."""
        with contextlib.suppress(OSError):
            (self.root / TEMPORARY).rmdir()

    def _path(self, key: str) -> Path:
        return self.root / check_key(key)

    def _write_temporary(self, data: bytes | memoryview) -> Path:
        temporary = self.root / TEMPORARY / f"{os.getpid()}-{secrets.token_hex(8)}"
        descriptor = _with_parent(temporary, lambda: create_new(temporary))
        try:
            with os.fdopen(descriptor, "wb", buffering=0) as file:
                # An unbuffered write may write only a part.
                view = memoryview(data)
                while view:
                    view = view[file.write(view) :]
                if self._fsync:
                    os.fsync(file.fileno())
        except OSError:
            _unlink(temporary)
            raise
        return temporary

    def _flush_folder(self, folder: Path) -> None:
        # The new name is content of the folder, so flush the folder, too.
        if self._fsync:
            flush_folder(folder)

    def _walk(self, prefix: str) -> Iterator[str]:
        try:
            with os.scandir(self.root / prefix) as entries:
                ordered = sorted(entries, key=lambda entry: entry.name)
        except (FileNotFoundError, NotADirectoryError):
            return  # no such folder: no objects
        except OSError as error:
            raise self.failure(prefix, error) from error
        for entry in ordered:
            if entry.name.startswith("."):
                continue  # unfinished or foreign
            if entry.is_dir():
                yield from self._walk(f"{prefix}{entry.name}/")
            else:
                yield prefix + entry.name

    def failure(self, key: str, error: OSError) -> StoreFailed:
        code = error.errno
        # Classify by the caller's remedy: wait, ask for permission, give up.
        reason = error.strerror or str(error)
        if code in _FULL:
            return StoreUnavailable(key, f"{self.root} is full: {reason}", hint="free disk space")
        if code in _FORBIDDEN:
            return StoreRefused(key, f"{self.root} cannot be written: {reason}")
        if code in _UNAVAILABLE:
            return StoreUnavailable(key, f"{self.root} does not answer: {reason}")
        return StoreFailed(key, f"{self.root}: {reason}")


def _with_parent(path: Path, act: Callable[[], T]) -> T:
    """Call act(); if path's folder is missing, create it and call act() again."""
    try:
        return act()
    except FileNotFoundError:
        path.parent.mkdir(parents=True, exist_ok=True)
        return act()


def _unlink(path: Path) -> None:
    path.unlink(missing_ok=True)
