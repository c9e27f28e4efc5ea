"""A runner that makes no pictures: one small output and one marker a task. For farm_cost.py."""

from __future__ import annotations

import os
import time

from pbrs_farm.core import keys
from pbrs_farm.store import Store, store_from_url
from workers.config import FarmConfig
from workers.ids import GEOMETRY
from workers.job import JobSpec
from workers.runner import OnText, Result, Survey, TaskRequest

# 45,622 houses of 17 or 18 views are the paper's 779,342.
N_HOUSES = 45_622
N_VIEWS = 779_342
PER_BATCH = 5


def views_of(index: int) -> int:
    """Views of the house of that index: they sum up to N_VIEWS over N_HOUSES."""
    return (index + 1) * N_VIEWS // N_HOUSES - index * N_VIEWS // N_HOUSES


def batches_of(house: str) -> tuple[tuple[str, ...], ...]:
    """The batches of a house "h<index>"."""
    views = [f"r{k // 6}_{k % 6}" for k in range(views_of(int(house[1:])))]
    return tuple(tuple(views[k : k + PER_BATCH]) for k in range(0, len(views), PER_BATCH))


def runner(config: FarmConfig, _on_waiting: OnText) -> NoopRunner:
    return NoopRunner(store_from_url(config.store_url, config.store))


class NoopRunner:
    """Writes `<unit>.<stage>` and its marker; sleeps first when PBRS_BENCH_SLEEP says so."""

    def __init__(self, store: Store) -> None:
        self._store = store
        self._sleep_s = float(os.environ.get("PBRS_BENCH_SLEEP", "0"))

    def run(self, request: TaskRequest, _on_step: OnText) -> Result:
        time.sleep(self._sleep_s)
        name = f"{request.unit}_{request.stage}" if request.unit != "-" else request.stage
        if request.house != "-":
            self._store.put(keys.house_key(request.house, f"views/{name}.png"), b"." * 100)
            self._store.put_if_absent(keys.marker_key(request.house, name), b"{}")
        batches = batches_of(request.house) if request.stage == GEOMETRY else ()
        return Result(batches=batches, n_views=len(request.views))

    def survey(self, spec: JobSpec, house: str, done: frozenset[str]) -> Survey:
        """As the real one: a look at the cameras' marker, then names."""
        if "cameras" not in done:
            return Survey()  # the benchmark enters houses whose geometry was never run
        self._store.get(keys.marker_key(house, "cameras"))
        missing = {}
        for number in range(len(batches_of(house))):
            left = [s for s in spec.batch_stages if f"{number}_{s}" not in done]
            missing[str(number)] = left[0] if left else ""
        return Survey(batches_of(house), missing, "reduce" in done)
