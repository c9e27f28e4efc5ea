"""A replaced recipe: markers of the former one do not count as done."""

from __future__ import annotations

from dataclasses import replace

import pytest

import pbrs_farm
from pbrs_farm.core import keys
from pbrs_farm.core.recipe import recipe_from_name
from pbrs_farm.run import plan
from tests.inputs.submitted_jobs import HOUSES, farm
from tests.workers.drive import Drive
from tests.workers.fake_runner import batches_of
from workers.client.farm_client import Farm, new_spec
from workers.ids import job_key
from workers.job import work_version

__all__ = ["farm"]  # a fixture


def finish_all(farm: Farm) -> None:
    """Write every marker and manifest of the houses."""
    for house in HOUSES:
        name = house.house_id
        views = [view for batch in batches_of(name) for view in batch]
        for step in ("house", "cameras"):
            farm.store.put(keys.marker_key(name, step), b"{}")
        for view in views:
            for step in ("truth", "light"):
                farm.store.put(keys.marker_key(name, step, view), b"{}")
        farm.store.put(keys.house_key(name, "manifest.jsonl"), b"")


def done_and_waiting(farm: Farm, job: str) -> tuple[int, int]:
    view = farm.view(job)
    return int(view.counts.get("houses:done", 0)), view.n_waiting_houses


def test_every_house_begins_again_also_after_a_recovery(farm: Farm) -> None:
    finish_all(farm)
    first = farm.submit(HOUSES, new_spec(recipe_from_name("preview"))).job_id
    assert done_and_waiting(farm, first) == (3, 0)
    second = farm.submit(HOUSES, new_spec(recipe_from_name("fast")), update=True).job_id
    assert done_and_waiting(farm, second) == (0, 3)
    farm.recover(second)
    assert done_and_waiting(farm, second) == (0, 3)


def test_a_job_of_another_version_continues_once_it_is_adopted(farm: Farm) -> None:
    job = farm.submit(HOUSES, new_spec(recipe_from_name("preview"))).job_id
    old_spec = farm.spec(job)
    # As if submitted by another version: its stored files are rebuilt by this one.
    finish_all(farm)
    old = old_spec.model_copy(update={"version": "0.0.9"})
    farm.store.put(job_key(job), old.model_dump_json().encode())
    farm.recover(job)
    (task,) = Drive(farm.ledger, old).dispatch()[:1]
    claim = farm.ledger.claim(job, task, token="t", recipe=old_spec.recipe.digest())
    assert claim.verdict == "version"
    for _ in range(2):
        farm.adopt(job)
        assert farm.spec(job).versions_before == ("0.0.9",)
        assert done_and_waiting(farm, job) == (0, 3)
    d = Drive(farm.ledger, farm.spec(job))
    (task, *_) = d.dispatch()
    assert farm.ledger.claim(job, task, token="t", recipe=old_spec.recipe.digest()).verdict == "run"


def test_the_version_of_a_job_follows_the_steps_and_not_the_package(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    before = work_version()
    monkeypatch.setattr(pbrs_farm, "__version__", "9.9")
    work_version.cache_clear()
    assert work_version() == before
    changed = replace(plan.STEPS["develop"], version=99)
    monkeypatch.setitem(plan.STEPS, "develop", changed)
    work_version.cache_clear()
    assert work_version() != before
    work_version.cache_clear()


def test_markers_of_another_version_do_not_count_either(farm: Farm) -> None:
    finish_all(farm)
    spec = new_spec(recipe_from_name("preview"))
    old_version = spec.model_copy(update={"version": "0.0.9", "job_id": "0123456789ab"})
    farm.store.put(job_key("0123456789ab"), old_version.model_dump_json().encode())
    assert done_and_waiting(farm, farm.submit(HOUSES, spec).job_id) == (0, 3)
