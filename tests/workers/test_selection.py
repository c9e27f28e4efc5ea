"""A job with a reference ends with its selection, equal to that of a local `select`."""

from __future__ import annotations

import json

from pbrs_farm.core.recipe import recipe_from_name
from pbrs_farm.curate import selection_run as selecting
from pbrs_farm.selection.reference_set import bytes_from_reference
from pbrs_farm.store import MemoryStore
from tests.inputs.histogram_records import put_house
from tests.selection.histogram_sets import reference
from workers.client.farm_client import completed, new_spec
from workers.ids import job_key
from workers.job import HouseEntry, lines_from_houses
from workers.node.house_runner import HouseRunner
from workers.runner import TaskRequest

KEY = "jobs/sources/references/r.npz"


def test_a_job_with_a_reference_selects_and_names_the_missing_house() -> None:
    store = MemoryStore()
    put_house(store, "a", 4)
    put_house(store, "b", 3)
    store.put(KEY, bytes_from_reference(reference()))
    names = [HouseEntry(house_id=h) for h in ("a", "b", "c")]
    houses, spec = completed(names, new_spec(recipe_from_name("preview"), reference=KEY))
    store.put(job_key(spec.job_id, "houses.jsonl"), lines_from_houses(houses))
    store.put(job_key(spec.job_id), spec.model_dump_json().encode())
    runner = HouseRunner(store, n_threads=1)
    steps: list[str] = []
    for house, unit, stage in (("a", "-", "reduce"), ("-", "s0", "shard"), ("-", "-", "job")):
        request = TaskRequest(job_id=spec.job_id, house=house, unit=unit, stage=stage)
        runner.run(request, steps.append)
    assert "histograms" in steps
    alone = MemoryStore()
    put_house(alone, "a", 4)
    put_house(alone, "b", 3)
    selecting.select(alone, reference(), spec.recipe.selection, run=spec.job_id)
    of_job, of_local = (
        [json.loads(x) for x in s.get(f"selection/{spec.job_id}.jsonl").splitlines()]
        for s in (store, alone)
    )
    assert of_job == of_local
    assert len(of_job) == 7
    report = json.loads(store.get(job_key(spec.job_id, "report.json")))
    assert report["houses_missing"] == ["c"]
