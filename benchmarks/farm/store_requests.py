"""Requests to the store that a view costs: a real house through the farm's runner.

In the S3 that the environment names (PBRS_S3_ENDPOINT, PBRS_S3_BUCKET), else in a folder that is
laid out as an S3 is. Pictures are small and have few samples: the requests do not depend on them.
PBRS_STORE_LAYOUT=files counts those of a root of files.
"""

from __future__ import annotations

import os
import secrets
import tempfile
from collections import Counter
from collections.abc import Iterator
from typing import Any

from pbrs_farm.core.recipe import recipe_from_name, with_settings
from pbrs_farm.prepare.source import resolve
from pbrs_farm.run.output_root import claim_root
from pbrs_farm.settings import settings_from_environment
from pbrs_farm.store import store_from_url
from pbrs_farm.store.laid_out import LaidOutStore
from pbrs_farm.store.object_store import Head, Store
from workers.client.farm_client import completed, new_spec
from workers.ids import GEOMETRY, GL, JOB, LIGHT, REDUCE, SHARD, job_key
from workers.job import HouseEntry, JobSpec, lines_from_houses
from workers.node.house_runner import HouseRunner
from workers.runner import TaskRequest

N_VIEWS = 12  # all of the builtin home; a home of the paper has 17
STAGES = (GEOMETRY, GL, LIGHT, REDUCE, SHARD, JOB)


class CountedStore:
    """A store that counts its requests: puts, gets (HEAD too), deletes and lists."""

    def __init__(self, store: Store) -> None:
        self._store = store
        self.n: Counter[str] = Counter()
        self.listed: list[str] = []

    @property
    def url(self) -> str:
        return self._store.url

    def put(self, key: str, data: bytes | memoryview) -> None:
        self.n["puts"] += 1
        self._store.put(key, data)

    def put_if_absent(self, key: str, data: bytes) -> bool:
        self.n["puts"] += 1
        return self._store.put_if_absent(key, data)

    def get(self, key: str) -> bytes:
        self.n["gets"] += 1
        return self._store.get(key)

    def get_range(self, key: str, start: int, n_bytes: int) -> bytes:
        self.n["gets"] += 1
        return self._store.get_range(key, start, n_bytes)

    def head(self, key: str) -> Head | None:
        self.n["gets"] += 1
        return self._store.head(key)

    def list(self, prefix: str = "") -> Iterator[str]:
        self.n["lists"] += 1
        self.listed.append(prefix)
        return self._store.list(prefix)

    def delete(self, key: str) -> None:
        self.n["deletes"] += 1
        self._store.delete(key)


def requests_a_view() -> dict[str, Any]:
    """Figures of a house of N_VIEWS views, what the house itself costs among them."""
    with tempfile.TemporaryDirectory(prefix="pbrs-bench-") as folder:
        endpoint = os.environ.get("PBRS_S3_ENDPOINT")
        bucket = os.environ.get("PBRS_S3_BUCKET", "pbrs")
        url = f"s3://{bucket}/bench-{secrets.token_hex(4)}" if endpoint else folder
        store = store_from_url(url, settings_from_environment().store)
        inner = store.inner if isinstance(store, LaidOutStore) else store
        counted = _house(inner, packs=os.environ.get("PBRS_STORE_LAYOUT") != "files")
        for key in [*inner.list()]:
            inner.delete(key)
    n = counted.n
    print(f"   store: {endpoint or 'a folder laid out as S3'}; {dict(n)}", flush=True)
    print(f"   lists: {sorted(set(counted.listed))}", flush=True)
    return {
        "farm.store_puts_a_view": round(n["puts"] / N_VIEWS, 1),
        "farm.store_gets_a_view": round(n["gets"] / N_VIEWS, 1),
        "farm.store_is_s3": float(bool(endpoint)),
    }


def _house(inner: Store, *, packs: bool) -> CountedStore:
    """The counts of a house of the recipe fast, from the first task to the job's last."""
    settings = {"light.spp": 4, "image.width_px": 160, "image.height_px": 120}
    recipe = with_settings(recipe_from_name("fast"), settings)
    source = resolve("builtin")
    entry = HouseEntry(house_id=source.house_id, source=source.model_dump_json())
    houses, spec = completed([entry], new_spec(recipe, n_views=N_VIEWS))
    root = LaidOutStore(inner, packs)
    claim_root(root, recipe, update=False)
    root.put(job_key(spec.job_id, "houses.jsonl"), lines_from_houses(houses))
    root.put(job_key(spec.job_id), spec.model_dump_json().encode())
    counted = CountedStore(inner)
    batches: tuple[tuple[str, ...], ...] = ()
    worker = _worker(counted, packs=packs)
    for stage in STAGES:
        if stage == LIGHT:
            worker = _worker(counted, packs=packs)
        for request in _requests(spec, source.house_id, stage, houses[0].source, batches):
            batches = worker.run(request, lambda _step: None).batches or batches
    return counted


def _worker(counted: CountedStore, *, packs: bool) -> HouseRunner:
    """A worker without loaded homes that has read the layout of the root, which it does once."""
    store, n = LaidOutStore(counted, packs), counted.n
    counted.n = Counter()
    assert store.is_packed == packs
    counted.n = n
    return HouseRunner(store, n_threads=2)


def _requests(
    spec: JobSpec, house: str, stage: str, source: str, batches: tuple[tuple[str, ...], ...]
) -> Iterator[TaskRequest]:
    if stage in (GL, LIGHT):
        for number, views in enumerate(batches):
            yield TaskRequest(
                job_id=spec.job_id, house=house, unit=str(number), stage=stage, views=views
            )
    elif stage == SHARD:
        yield TaskRequest(job_id=spec.job_id, house="-", unit="s0", stage=stage)
    else:
        task_house = "-" if stage == JOB else house
        yield TaskRequest(
            job_id=spec.job_id, house=task_house, unit="-", stage=stage, source=source
        )


if __name__ == "__main__":
    print(requests_a_view())
