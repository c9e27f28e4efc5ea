"""A Redis of each deployment that we ship keeps acknowledged writes across a restart."""

from __future__ import annotations

import shutil
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
import redis
import yaml
from redis.backoff import NoBackoff
from redis.retry import Retry

from tests.workers.redis_server import free_port

AT_ONCE = Retry(NoBackoff(), 0)
REPO = Path(__file__).parents[2]
Connect = Callable[[], redis.Redis]


def of_kubernetes(folder: Path, port: int) -> list[str]:
    """The command of the manifest's ConfigMap, with its paths in a folder."""
    text = (REPO / "deploy/kubernetes/base/settings.yaml").read_text(encoding="utf-8")
    (files,) = (d["data"] for d in yaml.safe_load_all(text) if d["metadata"]["name"] == "redis")
    for name, content in files.items():
        for path in ("/run/pbrs", "/run/redis", "/etc/redis", "/data"):
            content = content.replace(path, str(folder))
        (folder / name).write_text(content)
    with (folder / "redis.conf").open("a") as conf:
        conf.write(f"port {port}\nbind 127.0.0.1\n")
    return ["sh", str(folder / "start.sh")]


def of_compose(folder: Path, port: int) -> list[str]:
    """The command of the service in docker/compose.yaml, with its paths in a folder."""
    text = (REPO / "docker/compose.yaml").read_text(encoding="utf-8")
    service = yaml.safe_load(text)["services"]["redis"]
    conf = (REPO / "docker/redis.conf").read_text().replace("/data", str(folder))
    (folder / "farm.conf").write_text(f"{conf}\nport {port}\n".replace("0.0.0.0", "127.0.0.1"))
    (line,) = service["command"]
    line = line.replace("$$", "$").replace("/tmp/", f"{folder}/")
    line = line.replace("/run/pbrs", str(folder)).replace("/etc/redis", str(folder))
    return [*service["entrypoint"], line]


SET_UPS = {"kubernetes": (of_kubernetes, "farm"), "compose": (of_compose, "default")}


@contextmanager
def running(command: list[str], connect: Connect) -> Iterator[subprocess.Popen[bytes]]:
    server = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    try:
        give_up = time.monotonic() + 10
        while True:
            try:
                connect().ping()
                break
            except (redis.ConnectionError, redis.BusyLoadingError):
                assert time.monotonic() < give_up, "redis-server did not start"
                time.sleep(0.02)
        yield server
    finally:
        server.terminate()
        server.wait(10)


def write_until_it_ends(client: redis.Redis, acknowledged: set[str]) -> None:
    """Transactions and scripts, like those of the ledger and Celery, while the server answers."""
    for n in range(100_000):
        try:
            with client.pipeline(transaction=True) as pipe:
                pipe.hset(f"multi:{n}", "a", "1")
                pipe.zadd("multi:all", {str(n): n})
                pipe.execute()
            acknowledged.add(f"multi:{n}")
            client.eval("redis.call('SET', KEYS[1], 1) redis.call('SET', KEYS[2], 1)", 2,
                        f"lua:{n}", f"lua:{n}b")  # fmt: skip
            acknowledged |= {f"lua:{n}", f"lua:{n}b"}
        except redis.RedisError:
            return


@pytest.mark.skipif(shutil.which("redis-server") is None, reason="needs redis-server")
@pytest.mark.parametrize("name", SET_UPS)
def test_a_restart_under_load_loses_no_key_and_admits_no_stranger(
    name: str, tmp_path: Path
) -> None:
    make, user = SET_UPS[name]
    for secret in ("redis_password", "keda_password"):
        (tmp_path / secret).write_text(f"{secret} of a test".replace(" ", "-"))
    port = free_port()
    command = make(tmp_path, port)

    def connect() -> redis.Redis:
        return redis.Redis(
            port=port, username=user, password="redis_password-of-a-test", decode_responses=True,
            retry=AT_ONCE,
        )  # fmt: skip

    acknowledged: set[str] = set()
    with running(command, connect) as server:
        load = threading.Thread(target=write_until_it_ends, args=(connect(), acknowledged))
        load.start()
        time.sleep(0.3)
        server.terminate()
        server.wait(10)
        load.join()
    with running(command, connect):
        keys = set(connect().scan_iter(count=10_000))
        assert len(acknowledged) > 30
        assert acknowledged - keys == set()
        for password in (None, "guessed"):
            stranger = redis.Redis(port=port, password=password, retry=AT_ONCE)
            with pytest.raises(redis.AuthenticationError):
                stranger.get("multi:0")


def test_no_set_up_takes_the_rights_of_the_user_that_replays_the_log() -> None:
    for path in ("deploy/kubernetes/base/settings.yaml", "tests/infra/redis_tls.sh"):
        text = (REPO / path).read_text(encoding="utf-8")
        assert text.count("user default off ~* &* +@all") == text.count("user default off") == 1, (
            path
        )
