"""House -> shard -> job: manifests merged upward, and what is missing written down.

Effects: the store's. Every object here is rebuilt from those below it, so merging twice is once.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

from pbrs_farm import keys
from pbrs_farm.errors import ObjectMissing
from pbrs_farm.store.interface import Store
from workers.ids import job_key
from workers.job import JobSpec, houses_from_lines
from workers.runner import Tell


def shard_key(job: str, shard: int) -> str:
    """Key of a shard's merged manifest."""
    return job_key(job, f"shards/{shard}.jsonl")


def house_ids(store: Store, spec: JobSpec) -> list[str]:
    """The job's houses in its order."""
    data = store.get(job_key(spec.job_id, "houses.jsonl"))
    return [house.house_id for house in houses_from_lines(data)]


def merge_shard(store: Store, spec: JobSpec, shard: int, tell: Tell) -> None:
    """Write the manifests of a shard's houses as one; houses without one are left out."""
    size = spec.rules.shard_size
    parts = []
    for house in house_ids(store, spec)[shard * size : (shard + 1) * size]:
        tell(f"merge {house}")
        parts.append(_manifest(store, house) or b"")
    store.put(shard_key(spec.job_id, shard), b"".join(parts))


def merge_job(store: Store, spec: JobSpec, tell: Tell) -> None:
    """Write the root's manifest.jsonl and the job's report.json, which says what is missing.

    Rows of other jobs' houses in the same root are kept. Over a job that still runs, houses that
    have no manifest yet are missing, and the report says so.
    """
    houses = house_ids(store, spec)
    own = set(houses)
    rows: dict[str, bytes] = {h: part for h, part in _old_rows(store) if h not in own}
    missing = []
    for house, part in _new_rows(store, spec, houses, tell):
        if part is None:
            missing.append(house)
        else:
            rows[house] = part
    store.put(keys.MANIFEST, b"".join(rows[h] for h in sorted(rows)))
    report: dict[str, Any] = {
        "job": spec.job_id,
        "houses": len(houses),
        "houses_missing": missing,
        "objects": sum(rows[h].count(b"\n") for h in houses if h in rows),
        "failed": sorted(_failed(store, spec.job_id), key=lambda row: str(row["task"])),
    }
    store.put(job_key(spec.job_id, "report.json"), json.dumps(report, indent=1).encode() + b"\n")


def _new_rows(
    store: Store, spec: JobSpec, houses: list[str], tell: Tell
) -> Iterator[tuple[str, bytes | None]]:
    """House -> its manifest, through its shard's where that is there; None when it has none."""
    size = spec.rules.shard_size
    for first in range(0, len(houses), size):
        tell(f"merge shard {first // size}")
        members = houses[first : first + size]
        merged = _get(store, shard_key(spec.job_id, first // size))
        found = dict(_by_house(merged)) if merged is not None else {}
        for house in members:
            yield house, found.get(house) or _manifest(store, house)


def _old_rows(store: Store) -> Iterator[tuple[str, bytes]]:
    yield from _by_house(_get(store, keys.MANIFEST) or b"")


def _by_house(manifest: bytes) -> Iterator[tuple[str, bytes]]:
    rows: dict[str, list[bytes]] = {}
    for line in manifest.splitlines(keepends=True):
        rows.setdefault(str(json.loads(line)["key"]).split("/")[1], []).append(line)
    for house, lines in rows.items():
        yield house, b"".join(lines)


def _manifest(store: Store, house: str) -> bytes | None:
    return _get(store, keys.house_key(house, keys.MANIFEST))


def _failed(store: Store, job: str) -> Iterator[dict[str, Any]]:
    for key in store.list(job_key(job, "failed/")):
        record = json.loads(store.get(key))
        task = key.rpartition("/failed/")[2].removesuffix(".json")
        yield {"task": task, "fault": record["fault"], "message": record["message"]}


def _get(store: Store, key: str) -> bytes | None:
    try:
        return store.get(key)
    except ObjectMissing:
        return None
