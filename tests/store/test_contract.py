"""Every store keeps the same promises; S3 is included if PBRS_S3_ENDPOINT names a gateway."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from mmap import ACCESS_READ, mmap
from pathlib import Path

import pytest

from pbrs_farm.core.errors import ObjectMissing, StoreFailed
from pbrs_farm.store import MemoryStore, Store
from pbrs_farm.store.folder import FolderStore
from tests.inputs.s3_stores import s3_store


@pytest.fixture(params=["memory", "folder", "fsync", pytest.param("s3", marks=pytest.mark.infra)])
def store(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Store]:
    if request.param == "memory":
        yield MemoryStore()
    elif request.param == "s3":
        yield s3_store()
    else:
        yield FolderStore(tmp_path / "store", fsync=request.param == "fsync")


def test_put_bytes_are_returned(store: Store) -> None:
    store.put("houses/h/house.json", b"{}")
    assert store.get("houses/h/house.json") == b"{}"
    head = store.head("houses/h/house.json")
    assert head is not None
    assert head.n_bytes == 2


def test_a_part_of_an_object_can_be_read(store: Store) -> None:
    store.put("a", b"0123456789")
    assert store.get_range("a", 3, 4) == b"3456"
    assert store.get_range("a", 8, 2) == b"89"
    with pytest.raises(ObjectMissing):
        store.get_range("b", 0, 1)


def test_a_later_put_replaces_an_earlier_one(store: Store) -> None:
    store.put("a", b"long first version")
    store.put("a", b"")
    assert store.get("a") == b""


def test_a_mapped_file_is_put_whole(store: Store, tmp_path: Path) -> None:
    with (tmp_path / "large").open("w+b") as file:
        file.write(b"0123456789" * 10_000)
        file.flush()
        with mmap(file.fileno(), 0, access=ACCESS_READ) as pages, memoryview(pages) as view:
            store.put("large", view)
    assert store.get("large") == b"0123456789" * 10_000


def test_put_if_absent_keeps_the_first(store: Store) -> None:
    assert store.put_if_absent("done/a.json", b"first")
    assert not store.put_if_absent("done/a.json", b"second")
    assert store.get("done/a.json") == b"first"


def test_of_racing_creators_exactly_one_wins(store: Store) -> None:
    wins: list[int] = []
    start = threading.Barrier(8)

    def create(number: int) -> None:
        start.wait()
        if store.put_if_absent("race", str(number).encode() * 1000):
            wins.append(number)

    threads = [threading.Thread(target=create, args=(n,)) for n in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(wins) == 1
    assert store.get("race") == str(wins[0]).encode() * 1000


def test_a_missing_object_is_a_distinct_error(store: Store) -> None:
    assert store.head("no/such") is None
    with pytest.raises(ObjectMissing, match="no/such"):
        store.get("no/such")


def test_delete_twice_is_no_error(store: Store) -> None:
    store.put("x/y", b"1")
    store.delete("x/y")
    store.delete("x/y")
    assert store.head("x/y") is None


def test_list_gives_the_keys_below_a_folder(store: Store) -> None:
    for key in ("houses/a/1", "houses/a/b/2", "houses/ab/3", "recipe.json"):
        store.put(key, b".")
    assert sorted(store.list("houses/a/")) == ["houses/a/1", "houses/a/b/2"]
    assert len(list(store.list())) == 4
    assert list(store.list("nothing/here/")) == []


def test_list_goes_past_one_page(store: Store) -> None:
    keys = {f"many/{n:04d}" for n in range(1100)}
    for key in keys:
        store.put(key, b"")
    assert set(store.list("many/")) == keys


@pytest.mark.parametrize(
    "key", ["", "/etc/passwd", "../up", "a/../b", "a//b", "a/", ".hidden", "a\\b", "a\0b", "a\nb"]
)
def test_a_key_that_leaves_the_store_is_refused(store: Store, key: str) -> None:
    for act in (lambda: store.put(key, b""), lambda: store.get(key), lambda: store.delete(key)):
        with pytest.raises(StoreFailed, match="not a valid key"):
            act()


def test_a_prefix_is_a_folder(store: Store) -> None:
    with pytest.raises(StoreFailed, match="ends with"):
        list(store.list("houses/a"))
