"""S3 without a network: the fork guard, clear errors, no secrets; and the meaning of URLs."""

from __future__ import annotations

import multiprocessing
import os
import threading
from dataclasses import replace
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import cast

import pytest

from pbrs_farm.core.errors import BadInput, StoreFailed, StoreRefused, StoreUnavailable
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


class _Gateway(BaseHTTPRequestHandler):
    """An S3 gateway of one bucket; it honours If-None-Match or not. State: the objects, of its class."""

    protocol_version = "HTTP/1.1"
    honours = False
    objects: dict[str, bytes]

    def do_PUT(self) -> None:
        data = self.rfile.read(int(self.headers["Content-Length"]))
        is_refused = self.honours and self.headers["If-None-Match"] and self.path in self.objects
        if not is_refused:
            self.objects[self.path] = data
        self.send_response(412 if is_refused else 200)
        self.send_header("ETag", '"1"')
        self.send_header("Content-Length", "0")
        self.end_headers()

    def log_message(self, *_args: object) -> None:
        pass


@pytest.mark.parametrize("honours", [True, False])
def test_a_gateway_that_ignores_conditions_is_refused_by_name(honours: bool) -> None:
    kind = type("Gateway", (_Gateway,), {"honours": honours, "objects": {}})
    server = ThreadingHTTPServer(("127.0.0.1", 0), kind)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    endpoint = f"http://127.0.0.1:{server.server_address[1]}"
    settings = replace(DEAD, s3=replace(DEAD.s3, endpoint=endpoint, retry_timeout_s=5))
    first, second = (store_from_url("s3://bucket/p", settings) for _ in range(2))
    try:
        if honours:
            assert (first.put_if_absent("a", b"1"), second.put_if_absent("a", b"2")) == (
                True,
                False,
            )
            assert second.put_if_absent("b", b"3")
            assert cast("type[_Gateway]", kind).objects == {
                "/bucket/p/a": b"1",
                "/bucket/p/b": b"3",
            }
        else:
            with pytest.raises(StoreRefused, match=f"{endpoint} ignores If-None-Match"):
                first.put_if_absent("a", b"1")
    finally:
        server.shutdown()
        server.server_close()
