"""A farm with fake renderers, and jobs submitted to it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from pbrs_farm.core.recipe import recipe_from_name
from tests.workers.drive import Drive
from workers.client.farm_client import Farm, new_spec
from workers.config import FarmConfig
from workers.job import HouseEntry
from workers.ledger.task_ledger import Fault

HOUSES = [HouseEntry(house_id=f"h{k}", source="{}") for k in range(3)]


@pytest.fixture
def farm(config: FarmConfig, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Farm:
    monkeypatch.setenv("PBRS_TEST_CONTROL", str(tmp_path))
    url = (tmp_path / "store").as_uri()
    return Farm(replace(config, runner="tests.workers.fake_runner:runner", store_url=url))


def submit(farm: Farm) -> Drive:
    job = farm.submit(HOUSES, new_spec(recipe_from_name("preview")))
    return Drive(farm.ledger, farm.spec(job.job_id))


def environment(farm: Farm, monkeypatch: pytest.MonkeyPatch) -> None:
    """Set the environment so that the command line finds the farm."""
    monkeypatch.setenv("PBRS_REDIS_URL", farm.config.redis_url.reveal())
    monkeypatch.setenv("PBRS_STORE", farm.config.store_url)
    monkeypatch.setenv("PBRS_FARM_PREFIX", farm.config.prefix)


def fail(d: Drive, task: str, kind: str = "data") -> str:
    token = d.claim(task).token
    fault = Fault(fault=kind, fingerprint=f"{kind}: x", message="x")  # type: ignore[arg-type]
    return d.ledger.fail(d.job.job_id, task, token, fault, delay_s=0)
