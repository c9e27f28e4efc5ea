"""A Redis that refuses for a while, or drops connections, counts as away: one log line, then work resumes."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from kombu.exceptions import OperationalError
from redis._parsers.base import BaseParser
from redis.backoff import NoBackoff
from redis.retry import Retry

from pbrs_farm.store.secret import Secret
from tests.workers.drive import drive
from tests.workers.redis_server import RedisServer
from tests.workers.refusals import REFUSALS, configured, readonly
from tests.workers.stalling_proxy import StallingProxy
from workers.config import FarmConfig
from workers.coordinator.dispatcher import celery_sender
from workers.ledger.redis_connections import PASSING, Connection, passing_prefix
from workers.ledger.redis_ledger import RedisLedger, redis_client
from workers.ledger.task_ledger import LedgerUnavailable
from workers.node.heartbeat import Heartbeat
from workers.queue.celery_app import make_app
from workers.queue.redis_transport import Transport

AT_ONCE = Retry(NoBackoff(), 0)
MESSAGE = ("gl", "0123456789ab", "h0/0/gl", "r")


@pytest.fixture
def server(tmp_path: Path) -> Iterator[RedisServer]:
    server = RedisServer(tmp_path)
    server.start()
    yield server
    server.end()


@pytest.fixture
def farm_config(server: RedisServer) -> FarmConfig:
    return FarmConfig(redis_url=Secret(server.url), store_url="file:///nowhere")


@pytest.fixture
def ledger(farm_config: FarmConfig) -> Iterator[RedisLedger]:
    """A ledger that fails immediately, while a farm's retries for some seconds."""
    ledger = RedisLedger(farm_config)
    ledger.client.set_retry(AT_ONCE)
    yield ledger
    ledger.client.close()


@pytest.mark.parametrize("line", [
    "READONLY You can't write against a read only replica.",
    "READONLY You can't write against a read only replica. script: 3b, on @user_script:1.",
    "ERR Error running script (call to f_3b): @user_script:1: -READONLY You can't write against",
    "EXECABORT Transaction discarded because of: READONLY You can't write against a read only replica.",
    *(f"{prefix} some words" for prefix in PASSING),
])  # fmt: skip
def test_every_temporary_refusal_is_recognised_by_its_prefix(line: str) -> None:
    prefix = passing_prefix(BaseParser.parse_error(line))
    assert prefix in PASSING
    assert prefix in line


@pytest.mark.parametrize("line", [
    "ERR unknown command 'BUSY', with args beginning with: 'OOM' ", "WRONGTYPE Operation against a key",
    "BUSYKEY Target key name already exists.", "BUSYGROUP Consumer Group name already exists",
    "NOSCRIPT No matching script.", "NOAUTH Authentication required.", "NOPERM User has no permissions",
    "MOVED 1 127.0.0.1:1", "ERR the READONLY word", "",
])  # fmt: skip
def test_a_permanent_error_is_no_passing_refusal(line: str) -> None:
    assert passing_prefix(BaseParser.parse_error(line)) == ""


@pytest.mark.parametrize("prefix", REFUSALS)
def test_a_refusal_is_one_line_of_an_absent_ledger_and_passes(
    prefix: str, server: RedisServer, ledger: RedisLedger
) -> None:
    job = drive(ledger, 1).job.job_id
    writes = [lambda: ledger.lead("leader"), lambda: ledger.open(job, 1)]  # a script, a transaction
    if prefix == "NOREPLICAS" and server.client.info()["redis_version"] < "7":
        writes = []  # Redis 6 refuses neither
    with REFUSALS[prefix](server):
        for write in writes:
            with pytest.raises(LedgerUnavailable, match=f"refused: {prefix} ") as caught:
                write()
            assert "\n" not in str(caught.value)
    assert ledger.lead("leader")
    ledger.open(job, 1)
    assert ledger.active_jobs() == [job]


@pytest.mark.parametrize("prefix", REFUSALS)
def test_a_message_that_the_broker_refuses_for_now_ends_no_coordinator(
    prefix: str, server: RedisServer, farm_config: FarmConfig
) -> None:
    send = celery_sender(make_app(farm_config))
    send([MESSAGE])
    with REFUSALS[prefix](server), pytest.raises(LedgerUnavailable, match=f"no message.*{prefix} "):
        send([MESSAGE])
    send([MESSAGE])
    assert server.client.llen("pbrs:gl") == 2


def test_a_worker_does_not_connect_to_a_broker_that_takes_no_writes(
    server: RedisServer, farm_config: FarmConfig
) -> None:
    app = make_app(farm_config)
    refused = app.connection_for_read()
    with readonly(server), pytest.raises(refused.connection_errors, match="READONLY"):
        refused.connect()
    with app.connection_for_read() as broker:
        broker.connect()
        assert broker.connected
    # The key written by the probe lives for a millisecond.
    give_up = time.monotonic() + 10
    while list(server.client.scan_iter()) and time.monotonic() < give_up:
        time.sleep(0.01)
    assert list(server.client.scan_iter()) == []


def test_a_replica_without_its_master_that_gives_no_stale_data_is_away_to_readers(
    server: RedisServer, ledger: RedisLedger
) -> None:
    down = pytest.raises(LedgerUnavailable, match="refused: MASTERDOWN")
    with configured(server, "replica-serve-stale-data", "no"), readonly(server), down:
        ledger.active_jobs()
    assert ledger.active_jobs() == []


def test_a_blocking_read_ends_if_its_server_becomes_a_replica(
    server: RedisServer, ledger: RedisLedger
) -> None:
    lead = threading.Timer(0.3, server.client.replicaof, ("127.0.0.1", "1"))
    lead.start()
    with pytest.raises(LedgerUnavailable, match="refused: UNBLOCKED"):
        ledger.wait(20)
    lead.join()


def test_the_ledger_retries_on_a_new_connection(
    server: RedisServer, farm_config: FarmConfig
) -> None:
    client = redis_client(farm_config)
    before = client.client_id()
    with configured(server, "min-replicas-to-write", "1"):
        end = threading.Timer(0.3, server.client.config_set, ("min-replicas-to-write", "0"))
        end.start()
        assert client.set("key", "1")
        end.join()
    assert client.client_id() != before
    assert isinstance(client.connection_pool.make_connection(), Connection)


def test_dropped_connections_lose_no_call_of_the_ledger_and_no_message(
    server: RedisServer, farm_config: FarmConfig
) -> None:
    ledger, send = RedisLedger(farm_config), celery_sender(make_app(farm_config))
    n_sent = 0
    for _ in range(10):
        assert ledger.lead("leader")
        server.client.client_kill_filter(_type="normal")
        assert ledger.lead("leader")
        server.client.client_kill_filter(_type="normal")
        try:
            send([MESSAGE])
            n_sent += 1
        except LedgerUnavailable:  # unsent tasks stay in the ledger
            pass
        send([MESSAGE])
        n_sent += 1
    assert server.client.llen("pbrs:gl") == n_sent


def test_a_broker_that_goes_away_under_a_batch_of_messages_ends_no_coordinator(
    server: RedisServer, farm_config: FarmConfig
) -> None:
    send = celery_sender(make_app(farm_config))

    def messages() -> Iterator[tuple[str, str, str, str]]:
        yield MESSAGE
        server.end()

    with pytest.raises(LedgerUnavailable, match="the broker accepts no messages"):
        send(messages())
    server.start()
    send([MESSAGE])
    assert server.client.llen("pbrs:gl") == 1


def test_a_worker_is_seen_alive_at_each_try_to_reach_the_broker(
    server: RedisServer, farm_config: FarmConfig, monkeypatch: pytest.MonkeyPatch
) -> None:
    tries: list[float] = []
    monkeypatch.setattr(Transport, "on_try", staticmethod(lambda: tries.append(time.monotonic())))
    refused = make_app(farm_config).connection_for_read()
    with readonly(server), pytest.raises(OperationalError, match="READONLY"):
        refused.ensure_connection(max_retries=1, interval_start=0.1, interval_step=0)
    assert len(tries) > 1


def test_a_heartbeat_does_not_hold_up_a_worker_while_redis_stalls(
    server: RedisServer, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PBRS_FARM_SCRATCH", str(tmp_path))
    with StallingProxy(server.port) as proxy:
        monkeypatch.setenv("PBRS_REDIS_URL", f"{proxy.url}?socket_timeout=0.2")
        step = Heartbeat(None)
        step.beat()
        assert server.client.zcard("pbrs:workers") == 1
        # One timeout and no second try: the probe waits for 120 s.
        n_connections = proxy.n_connections
        proxy.stall(also_new=True)
        step.beat()
        assert proxy.n_connections == n_connections


def test_one_timeout_is_enough_if_all_connections_are_silent(
    server: RedisServer, farm_config: FarmConfig
) -> None:
    with StallingProxy(server.port) as proxy:
        url = Secret(f"{proxy.url}?socket_timeout=0.3")
        ledgers = [RedisLedger(replace(farm_config, redis_url=url)) for _ in range(3)]
        for ledger in ledgers:
            assert ledger.active_jobs() == []
        proxy.stall()
        began = time.monotonic()
        with pytest.raises(LedgerUnavailable, match="Timeout"):
            ledgers[0].active_jobs()
        for ledger in ledgers:
            assert ledger.active_jobs() == []
        assert 0.3 <= time.monotonic() - began < 0.6
