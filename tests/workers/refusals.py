"""Ways to make a real redis-server refuse for a while, each by its usual cause."""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from typing import Final

import redis

from tests.workers.redis_server import RedisServer


@contextmanager
def readonly(server: RedisServer) -> Iterator[None]:
    """The server is a replica of a master that does not answer."""
    server.client.replicaof("127.0.0.1", "1")
    try:
        yield
    finally:
        server.client.replicaof("NO", "ONE")


@contextmanager
def noreplicas(server: RedisServer) -> Iterator[None]:
    """The server's replicas are away."""
    with configured(server, "min-replicas-to-write", "1"):
        yield


@contextmanager
def oom(server: RedisServer) -> Iterator[None]:
    """The server's memory is full."""
    with configured(server, "maxmemory", "1"):
        yield


@contextmanager
def misconf(server: RedisServer) -> Iterator[None]:
    """The server cannot save: its file's path is a folder."""
    client, folder = server.client, server.folder / "dump.rdb"
    folder.mkdir()
    with configured(server, "save", "3600 1"):
        client.bgsave()
        wait(
            lambda: client.info("persistence")["rdb_last_bgsave_status"] == "err", "it cannot save"
        )
        yield
    folder.rmdir()


@contextmanager
def busy(server: RedisServer) -> Iterator[None]:
    """A script on the server does not end."""
    client = server.client
    with configured(server, "lua-time-limit", "10"):
        script = threading.Thread(target=_endless, args=(server,))
        script.start()
        wait(lambda: _is_busy(client), "a script holds it")
        try:
            yield
        finally:
            client.script_kill()
            script.join()


REFUSALS: Final[dict[str, Callable[[RedisServer], AbstractContextManager[None]]]] = {
    "READONLY": readonly, "NOREPLICAS": noreplicas, "OOM": oom, "MISCONF": misconf,
    "BUSY": busy,
}  # fmt: skip


@contextmanager
def configured(server: RedisServer, name: str, value: str) -> Iterator[None]:
    """The server with a setting, restored afterwards."""
    client = server.client
    before = client.config_get(name)[name]
    client.config_set(name, value)
    try:
        yield
    finally:
        client.config_set(name, before)


def wait(true: Callable[[], bool], what: str, seconds: float = 10.0) -> None:
    give_up = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < give_up, f"not within {seconds} s: {what}"
        time.sleep(0.01)


def _endless(server: RedisServer) -> None:
    with contextlib.suppress(redis.ResponseError):  # it is killed
        redis.Redis(port=server.port, socket_timeout=None).eval("while true do end", 0)


def _is_busy(client: redis.Redis) -> bool:
    try:
        client.ping()
    except redis.ResponseError as error:
        return str(error).startswith("BUSY")
    return False
