"""A recipe that was replaced: markers of the former one do not count as done."""

from __future__ import annotations

from pbrs_farm.core import keys
from pbrs_farm.core.recipe import recipe_from_name
from tests.workers.fake_runner import batches_of
from tests.workers.test_operating import HOUSES, farm
from workers.client.farm_client import Farm, new_spec
from workers.ids import job_key

__all__ = ["farm"]  # a fixture


def finish_all(farm: Farm) -> None:
    """Every marker and manifest that the houses can have."""
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


def test_every_house_begins_anew_and_does_so_after_a_recovery_too(farm: Farm) -> None:
    finish_all(farm)
    first = farm.submit(HOUSES, new_spec(recipe_from_name("preview"))).job_id
    assert done_and_waiting(farm, first) == (3, 0)
    second = farm.submit(HOUSES, new_spec(recipe_from_name("fast")), update=True).job_id
    assert done_and_waiting(farm, second) == (0, 3)
    farm.recover(second)
    assert done_and_waiting(farm, second) == (0, 3)


def test_markers_of_another_version_do_not_count_either(farm: Farm) -> None:
    finish_all(farm)
    spec = new_spec(recipe_from_name("preview"))
    other = spec.model_copy(update={"version": "0.0.9", "job_id": "0123456789ab"})
    farm.store.put(job_key("0123456789ab"), other.model_dump_json().encode())
    assert done_and_waiting(farm, farm.submit(HOUSES, spec).job_id) == (0, 3)
