"""Real Redis, real Celery, real renderer processes: a job runs to its end, and ends in order."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.workers.redis_server import RedisServer
from tests.workers.small_farm import SmallFarm


@pytest.fixture
def farm(tmp_path: Path) -> Iterator[SmallFarm]:
    (tmp_path / "redis").mkdir()
    server = RedisServer(tmp_path / "redis")
    server.start()
    farm = SmallFarm(tmp_path, server)
    yield farm
    farm.close()
    server.end()


def test_a_job_ends_with_the_same_objects_as_a_single_run(farm: SmallFarm) -> None:
    farm.coordinator()
    farm.worker("w1", slots=2)
    farm.submit(8)
    farm.wait_done()
    farm.check_complete(n_repeats=0)
    assert farm.farm.submit(*_again(farm)).was == "done"


def _again(farm: SmallFarm) -> tuple[list[object], object]:
    from pbrs_farm.recipe import recipe_from_name
    from workers.client import new_spec
    from workers.job import HouseEntry

    houses = [HouseEntry(house_id=h) for h in farm.houses]
    return houses, new_spec(recipe_from_name("preview"), rules={"shard_size": 5})
