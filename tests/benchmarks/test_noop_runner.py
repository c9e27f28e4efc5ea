"""The benchmark's runner answers for every house that a fast machine's job leaves behind."""

from __future__ import annotations

from benchmarks.farm.noop_runner import NoopRunner
from pbrs_farm.core import keys
from pbrs_farm.core.recipe import recipe_from_name
from pbrs_farm.store import MemoryStore
from workers.client.farm_client import new_spec


def test_a_house_whose_geometry_was_never_run_is_not_begun() -> None:
    store = MemoryStore()
    store.put(keys.marker_key("h00001", "0_gl"), b"{}")
    survey = NoopRunner(store).survey(
        new_spec(recipe_from_name("fast")), "h00001", frozenset({"0_gl"})
    )
    assert survey.batches is None
