"""S3 without a network: the fork guard, clear errors, no secrets; and the meaning of URLs."""

from __future__ import annotations

import multiprocessing
import os
from pathlib import Path

import pytest

from pbrs_farm.core.errors import BadInput, StoreFailed, StoreUnavailable
from pbrs_farm.store import MemoryStore, StoreSettings, store_from_url
from pbrs_farm.store.folder import FolderStore
from pbrs_farm.store.object_store import content_type
from pbrs_farm.store.s3 import ForkGuard, S3Settings
from pbrs_farm.store.secret import Secret

DEAD = StoreSettings(
    s3=S3Settings(
        endpoint="http://127.0.0.1:9",
        access_key="AKIA",
        secret_key=Secret("verysecret"),
        allow_http=True,
        retry_timeout_s=0.3,
    )
)


def test_a_url_names_its_store(tmp_path: Path) -> None:
    assert isinstance(store_from_url("memory:"), MemoryStore)
    for url in (tmp_path.as_uri(), str(tmp_path)):
        store = store_from_url(url)
        assert isinstance(store, FolderStore)
        assert store.root == tmp_path
    assert store_from_url("s3://b/p/q", DEAD).url == "s3://b/p/q"


@pytest.mark.parametrize("url", ["", "ftp://x/y", "s3://", "file://host/x", "s3://key:word@b/p"])
def test_another_url_is_refused_without_its_secret(url: str) -> None:
    with pytest.raises(BadInput, match="not a store") as caught:
        store_from_url(url)
    assert "word" not in str(caught.value)


def test_an_unreachable_gateway_is_one_line_without_the_secret() -> None:
    with pytest.raises(StoreUnavailable, match="does not answer") as caught:
        store_from_url("s3://b/p", DEAD).put("a", b"1")
    assert "\n" not in str(caught.value)
    assert "verysecret" not in repr(DEAD) + str(caught.value)


def test_a_process_that_may_fork_is_refused() -> None:
    guard = ForkGuard(forbidden_pid=os.getpid())
    with pytest.raises(StoreFailed, match="must not use storage"):
        guard.enter("k")


def _child(queue: multiprocessing.Queue[str]) -> None:
    try:
        store_from_url("s3://b/p", DEAD).put("a", b"1")
    except StoreFailed as error:
        queue.put(str(error))


@pytest.mark.filterwarnings("ignore:.*multi-threaded.*fork:DeprecationWarning")
def test_a_forked_child_of_an_s3_client_raises_and_does_not_hang() -> None:
    with pytest.raises(StoreUnavailable):
        store_from_url("s3://b/p", DEAD).put("a", b"1")
    context = multiprocessing.get_context("fork")
    queue: multiprocessing.Queue[str] = context.Queue()
    child = context.Process(target=_child, args=(queue,))
    child.start()
    assert "obstore would hang" in queue.get(timeout=10)
    child.join(10)
    assert child.exitcode == 0


def test_pictures_and_tables_have_content_types() -> None:
    assert content_type("a/b.exr") == "image/x-exr"
    assert content_type("a/b.png") == "image/png"
    assert content_type("recipe.json") == "application/json"
    assert content_type("weird") == "application/octet-stream"
