"""Garbage in a store is listed, and removed only on request."""

from __future__ import annotations

import json
import time
from dataclasses import replace
from pathlib import Path

import pytest

from pbrs_farm.cli import main
from pbrs_farm.core import keys
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.recipe import recipe_from_name
from tests.workers.conftest import config, redis_server
from workers.client.farm_client import Farm, new_spec
from workers.client.garbage import garbage, keep_from_text, remove
from workers.config import FarmConfig
from workers.ids import log_key
from workers.job import HouseEntry

__all__ = ["config", "redis_server"]  # fixtures of the workers' tests


@pytest.fixture
def farm(config: FarmConfig, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Farm:
    monkeypatch.setenv("PBRS_TEST_CONTROL", str(tmp_path))
    url = (tmp_path / "store").as_uri()
    return Farm(replace(config, runner="tests.workers.fake_runner:runner", store_url=url))


def submitted(farm: Farm, *houses: str) -> str:
    entries = [HouseEntry(house_id=h, source="{}") for h in houses]
    return farm.submit(entries, new_spec(recipe_from_name("preview"))).job_id


def put_house(farm: Farm, house: str, *, finished: bool) -> None:
    key = keys.house_key(house, "house.json")
    farm.store.put(key, b"{}")
    farm.store.put(keys.marker_key(house, "house"), b"{}")
    farm.store.put(keys.view_key(house, "0_0", "left.png"), b"left by a former recipe")
    if finished:
        row = json.dumps({"key": key, "sha256": ""}) + "\n"
        farm.store.put(keys.house_key(house, keys.MANIFEST), row.encode())


def found_of(farm: Farm, keep_s: float = 0.0) -> dict[str, set[str]]:
    in_an_hour = time.time() + 3600
    return {g.kind: set(g.found) for g in garbage(farm, keep_s, in_an_hour)}


def test_unreferenced_objects_logs_and_cancelled_jobs_are_garbage(farm: Farm) -> None:
    cancelled = submitted(farm, "a")
    farm.store.put(log_key(cancelled, "a/0/gl", 1), b"log")
    farm.cancel(cancelled)
    put_house(farm, "a", finished=False)
    put_house(farm, "b", finished=True)
    listed = found_of(farm)
    assert listed["logs"] == set()  # logs go with their job
    assert {key.split("/")[1] for key in listed["cancelled jobs"]} == {cancelled}
    unreferenced = {keys.view_key("b", "0_0", "left.png")}
    assert listed["named by no manifest"] == unreferenced | set(farm.store.list("houses/a/"))
    remove(farm, garbage(farm, 0.0, time.time() + 3600))
    assert sorted(farm.store.list("houses/")) == [
        "houses/b/done/house.json", "houses/b/house.json", "houses/b/manifest.jsonl",
    ]  # fmt: skip
    assert farm.ledger.known_jobs() == []


def test_a_job_that_runs_keeps_all_it_has(farm: Farm) -> None:
    job = submitted(farm, "a")
    farm.store.put(log_key(job, "a/0/gl", 1), b"log")
    put_house(farm, "a", finished=False)
    assert not any(found_of(farm).values())
    farm.pause(job)
    assert not any(found_of(farm).values())


def test_objects_younger_than_the_retention_stay(farm: Farm) -> None:
    put_house(farm, "a", finished=False)
    assert found_of(farm, keep_s=2 * 3600.0)["named by no manifest"] == set()
    assert len(found_of(farm, keep_s=1800.0)["named by no manifest"]) == 3


def test_times_are_days_hours_and_weeks() -> None:
    assert [keep_from_text(t) for t in ("30d", "12h", "2w")] == [2_592_000, 43_200, 1_209_600]
    for text in ("", "30", "d", "1y", "-1d", "1.5d"):
        with pytest.raises(BadInput, match="not a time"):
            keep_from_text(text)


def test_a_folder_without_jobs_needs_no_redis(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("PBRS_REDIS_URL", "redis://127.0.0.1:1/0")
    files = tmp_path / "out/houses/a"
    files.mkdir(parents=True)
    (files / "left.png").write_bytes(b"left")
    words = ["gc", "--store", str(tmp_path / "out"), "--keep", "0h"]
    assert main(words) == 0
    assert "houses/a/left.png" in capsys.readouterr().out
    assert main([*words, "--yes"]) == 0
    assert not (files / "left.png").exists()
    (tmp_path / "out/jobs/j").mkdir(parents=True)
    (tmp_path / "out/jobs/j/job.json").write_bytes(b"{}")
    assert main(words) == 1
    assert "no Redis" in capsys.readouterr().err
