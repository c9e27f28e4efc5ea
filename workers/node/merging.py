"""House -> shard -> job: merge manifests upward, always anew from below, and report missing parts."""

from __future__ import annotations

import heapq
import json
from collections.abc import Iterator
from mmap import ACCESS_READ, mmap
from tempfile import TemporaryFile
from typing import IO, Any

from pbrs_farm.core import keys
from pbrs_farm.formats.manifest import lines_by_house
from pbrs_farm.run.attributions import dressing_rows, write_attribution_of
from pbrs_farm.store import Store
from pbrs_farm.store.object_store import get_or_none
from workers.ids import job_key, shard_key, task_from_failed_key
from workers.job import JobSpec, stored_houses
from workers.runner import OnText


def house_ids(store: Store, spec: JobSpec) -> list[str]:
    """The job's houses in the order, read from the store, that decides their shards."""
    return [house.house_id for house in stored_houses(store, spec.job_id)]


def merge_shard(store: Store, spec: JobSpec, shard: int, on_step: OnText) -> None:
    """Write the existing manifests of a shard's houses as one; shards count from 0; on_step: called per house."""
    # Read the shard's slice of the job's order.
    size = spec.rules.shard_size
    parts = []
    for house in house_ids(store, spec)[shard * size : (shard + 1) * size]:
        on_step(f"merge {house}")
        parts.append(_manifest_of(store, house) or b"")
    store.put(shard_key(spec.job_id, shard), b"".join(parts))


def merge_job(store: Store, spec: JobSpec, on_step: OnText) -> None:
    """Write the root's manifest.jsonl and the job's report.json, which lists missing parts.

    Rows of other jobs' houses in the same root are kept. For a running job, houses without a manifest are
    reported as missing. Holds a shard's rows in memory, and the root's former manifest if there is one.
    """
    houses = house_ids(store, spec)
    ours = set(houses)
    missing: list[str] = []
    dressed: list[dict[str, str]] = []
    n_objects = 0
    # Merge two streams sorted by house, holding only a shard's rows.
    with TemporaryFile() as file:
        for house, part in _merge_by_house(store, ours, _new_rows(store, spec, houses, on_step)):
            if part is None:
                missing.append(house)
            else:
                file.write(part)
                dressed += dressing_rows(part)
                n_objects += part.count(b"\n") if house in ours else 0  # a row an object
        _put_file(store, keys.MANIFEST, file)
    write_attribution_of(store, dressed)
    # List missing parts and permanent failures.
    report: dict[str, Any] = {
        "job": spec.job_id,
        "houses": len(houses),
        "houses_missing": missing,
        "objects": n_objects,
        "failed": sorted(_failed_tasks(store, spec.job_id), key=lambda row: str(row["task"])),
    }
    store.put(job_key(spec.job_id, "report.json"), json.dumps(report, indent=1).encode() + b"\n")


def _merge_by_house(
    store: Store, houses: set[str], new: Iterator[tuple[str, bytes | None]]
) -> Iterator[tuple[str, bytes | None]]:
    """The job's rows and those of other houses of the root, by house, one house at a time."""
    rows = lines_by_house(get_or_none(store, keys.MANIFEST) or b"")
    old = ((house, part) for house, part in rows if house not in houses)
    return heapq.merge(old, new, key=lambda row: row[0])


def _put_file(store: Store, key: str, file: IO[bytes]) -> None:
    """Put a file's bytes without holding them: pages of the file come and go."""
    file.flush()
    if file.tell() == 0:
        store.put(key, b"")
        return
    with mmap(file.fileno(), 0, access=ACCESS_READ) as pages, memoryview(pages) as view:
        store.put(key, view)


def _new_rows(
    store: Store, spec: JobSpec, houses: list[str], on_step: OnText
) -> Iterator[tuple[str, bytes | None]]:
    """House -> its manifest, from its shard's if it exists; None without a manifest."""
    size = spec.rules.shard_size
    for first in range(0, len(houses), size):
        on_step(f"merge shard {first // size}")
        members = houses[first : first + size]
        # A house finished after the merge of its shard has a separate manifest.
        merged = get_or_none(store, shard_key(spec.job_id, first // size))
        part_of_house = dict(lines_by_house(merged)) if merged is not None else {}
        for house in members:
            yield house, part_of_house.get(house) or _manifest_of(store, house)


def _manifest_of(store: Store, house: str) -> bytes | None:
    return get_or_none(store, keys.house_key(house, keys.MANIFEST))


def _failed_tasks(store: Store, job: str) -> Iterator[dict[str, Any]]:
    for key in store.list(job_key(job, "failed/")):
        record = json.loads(store.get(key))
        task = task_from_failed_key(job, key)
        yield {"task": task, "fault": record["fault"], "message": record["message"]}
