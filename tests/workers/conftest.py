"""One redis-server for the folder's tests; each test has its own key prefix in it."""

from __future__ import annotations

import secrets
from collections.abc import Iterator
from pathlib import Path

import pytest

from pbrs_farm.core.recipe import recipe_from_name
from pbrs_farm.store.secret import Secret
from tests.workers.redis_server import RedisServer
from tests.workers.small_farm import SmallFarm
from workers.config import FarmConfig
from workers.job import JobRules, JobSpec, work_version
from workers.ledger.redis_ledger import RedisLedger

JOB_ID = "0123456789ab"


@pytest.fixture(scope="session")
def redis_server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RedisServer]:
    server = RedisServer(tmp_path_factory.mktemp("redis"))
    server.start()
    yield server
    server.end()


@pytest.fixture
def farm(tmp_path: Path) -> Iterator[SmallFarm]:
    """Real processes around a private Redis; all of them end with the test."""
    (tmp_path / "redis").mkdir()
    server = RedisServer(tmp_path / "redis")
    server.start()
    farm = SmallFarm(tmp_path, server)
    yield farm
    farm.close()
    server.end()


@pytest.fixture
def config(redis_server: RedisServer, tmp_path: Path) -> FarmConfig:
    return FarmConfig(
        redis_url=Secret(redis_server.url),
        store_url=(tmp_path / "store").as_uri(),
        prefix=f"t{secrets.token_hex(3)}:",
        worker="w1",
        scratch=tmp_path,
        lease_s=0.3,
        heartbeat_s=0.05,
        retry_delay_s=0.0,
        window_min=100,
    )


@pytest.fixture
def ledger(config: FarmConfig) -> Iterator[RedisLedger]:
    ledger = RedisLedger(config)
    yield ledger
    ledger.client.close()


def spec(n_houses: int, job_id: str = JOB_ID, **rules: object) -> JobSpec:
    return JobSpec(
        job_id=job_id,
        version=work_version(),
        recipe=recipe_from_name("preview"),
        n_houses=n_houses,
        rules=JobRules.model_validate(rules),
    )
