"""The folder store under a full disk, a read-only folder and killed writers."""

from __future__ import annotations

import errno
import os
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from pbrs_farm.core.errors import StoreFailed, StoreUnavailable
from pbrs_farm.store.folder import TEMPORARY, FolderStore


def test_a_full_disk_is_one_line_and_leaves_no_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store = FolderStore(tmp_path)
    store.put("a", b"old")

    def full(*_: object, **__: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(StoreUnavailable, match=r"a: .* is full: No space left") as caught:
        FolderStore(tmp_path, fsync=True).put("a", b"new")
    assert "\n" not in str(caught.value)
    assert store.get("a") == b"old"
    assert list((tmp_path / TEMPORARY).iterdir()) == []


def test_a_truly_full_device_is_reported() -> None:
    with pytest.raises(OSError, match="No space") as caught:
        Path("/dev/full").write_bytes(b"x")
    failure = FolderStore(Path("/data")).failure("k", caught.value)
    assert isinstance(failure, StoreUnavailable)


def test_a_forbidden_folder_is_one_line_and_not_retried(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"")
    with pytest.raises(StoreFailed) as caught:
        FolderStore(tmp_path / "file").put("a", b"1")
    assert not isinstance(caught.value, StoreUnavailable)
    assert "\n" not in str(caught.value)


@contextmanager
def as_nobody() -> Iterator[None]:
    """Act as a user without rights if the tests run as root, who may write anywhere."""
    if os.geteuid() != 0:
        yield
        return
    os.seteuid(65534)
    try:
        yield
    finally:
        os.seteuid(0)


def test_a_read_only_folder_is_reported() -> None:
    with tempfile.TemporaryDirectory(dir="/tmp") as name:
        folder = Path(name)
        FolderStore(folder).put("before", b"1")
        for path in (folder / TEMPORARY, folder):
            path.chmod(0o555)
        with as_nobody(), pytest.raises(StoreFailed, match="cannot be written: Permission denied"):
            FolderStore(folder).put("a", b"1")
        for path in (folder, folder / TEMPORARY):
            path.chmod(0o755)


def test_unfinished_files_are_never_listed_and_swept_when_old(tmp_path: Path) -> None:
    store = FolderStore(tmp_path)
    store.put("a", b"1")
    stale = tmp_path / TEMPORARY / "123-abc"
    stale.write_bytes(b"half")
    assert list(store.list()) == ["a"]
    assert store.sweep() == 0
    os.utime(stale, (time.time() - 1e6,) * 2)
    assert store.sweep() == 1
    assert not stale.exists()


def test_files_take_the_umask_not_a_private_mode(tmp_path: Path) -> None:
    old = os.umask(0o027)
    try:
        FolderStore(tmp_path).put("a", b"1")
    finally:
        os.umask(old)
    assert (tmp_path / "a").stat().st_mode & 0o777 == 0o640


def test_a_tidied_folder_holds_only_its_objects(tmp_path: Path) -> None:
    store = FolderStore(tmp_path)
    store.put("a/b.txt", b"1")
    store.tidy()
    assert [p.name for p in tmp_path.iterdir()] == ["a"]
    # The next write works as before.
    store.put("c.txt", b"2")
    assert store.get("c.txt") == b"2"
