"""Unreferenced objects in a farm's store: found and listed first, removed only on request.

Effects: lists the store, reads manifests and the ledger; `remove` deletes objects. Objects of a loading,
running or paused job, and objects younger than the retention time, are never touched.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from itertools import groupby
from typing import TYPE_CHECKING, Final, Literal

from pbrs_farm.core import keys
from pbrs_farm.core.errors import BadInput
from pbrs_farm.store.object_store import Store, get_or_none
from workers.coordinator.recover import jobs_in
from workers.ids import job_key
from workers.job import houses_from_lines

if TYPE_CHECKING:
    from workers.client.farm_client import Farm

Kind = Literal["logs", "cancelled jobs", "named by no manifest"]
_UNITS: Final = {"d": 86_400.0, "h": 3600.0, "w": 7 * 86_400.0}
_KEEP: Final = re.compile(r"(\d{1,4})([dhw])")
_LIVE: Final = ("loading", "running", "paused")


@dataclass(frozen=True, slots=True)
class Garbage:
    """Objects of one kind."""

    kind: Kind
    found: tuple[str, ...]  # their keys
    n_bytes: int


def keep_from_text(text: str) -> float:
    """Seconds of "30d", "12h", "2w", whole and with a unit; BadInput for any other text."""
    match = _KEEP.fullmatch(text)
    if match is None:
        raise BadInput("--keep", text, "not a time", hint="30d, 12h or 2w")
    return int(match[1]) * _UNITS[match[2]]


def garbage(farm: Farm, keep_s: float, now_s: float) -> list[Garbage]:
    """Removable objects, by kind. now_s: seconds since 1970, by the clock of the store's objects.

    keep_s: minimum age, seconds. Only lists; `remove` deletes. Objects that a live job may need are never
    included: an object without a manifest is kept while a live job works on its house. Lists the whole
    store and queries the age of each candidate.
    """
    store = farm.store
    states = {job: _state_of_job(farm, job) for job in jobs_in(store)}
    is_old = _older_than(store, now_s - keep_s)
    ended = (job for job, state in states.items() if state not in _LIVE)
    logs = (key for job in ended for key in store.list(job_key(job, "logs/")))
    gone = (job for job, state in states.items() if state == "cancelled")
    cancelled = (key for job in gone for key in store.list(f"jobs/{job}/"))
    working = {
        house for job, s in states.items() if s in _LIVE for house in _houses_of_job(store, job)
    }
    groups: list[tuple[Kind, Iterable[str]]] = [
        ("cancelled jobs", cancelled),
        ("logs", logs),
        ("named by no manifest", _unnamed(store, working)),
    ]
    # An object counts once, under the first kind that has it.
    taken: set[str] = set()
    kinds = []
    for kind, candidates in groups:
        old = {k: n for k in candidates if k not in taken and (n := is_old(k)) is not None}
        taken |= old.keys()
        kinds.append(Garbage(kind, tuple(sorted(old)), sum(old.values())))
    return kinds


def remove(farm: Farm, groups: Iterable[Garbage]) -> int:
    """Delete objects of a recent `garbage`, and forget cancelled jobs without any; the number, missing ones too."""
    n = 0
    for kind in groups:
        for key in kind.found:
            farm.store.delete(key)
            n += 1
        if kind.kind == "cancelled jobs":
            for job in {key.split("/")[1] for key in kind.found}:
                # If some of its objects are younger, they and the job's record are kept.
                if next(iter(farm.store.list(f"jobs/{job}/")), None) is None:
                    farm.ledger.forget(job)
    return n


def _state_of_job(farm: Farm, job: str) -> str:
    """The job's state in the ledger; "lost" where the ledger does not know it."""
    view = farm.ledger.view(job)
    return "lost" if view is None else view.state


def _older_than(store: Store, oldest_s: float) -> Callable[[str], int | None]:
    """Key -> its bytes where it was last written before that time, else None."""

    def size(key: str) -> int | None:
        head = store.head(key)
        return None if head is None or head.modified_s >= oldest_s else head.n_bytes

    return size


def _houses_of_job(store: Store, job: str) -> list[str]:
    data = get_or_none(store, job_key(job, "houses.jsonl")) or b""
    return [entry.house_id for entry in houses_from_lines(data)]


def _unnamed(store: Store, working: set[str]) -> Iterator[str]:
    """Objects of houses that no job works on and their own manifest does not name."""
    for root in keys.FOLDERS:
        objects = (key for key in store.list(f"{root}/") if key.count("/") >= 2)
        for house, group in groupby(sorted(objects), key=lambda key: key.split("/")[1]):
            if house in working:
                continue
            manifest = get_or_none(store, keys.house_key(house, keys.MANIFEST))
            named = _keys_in_manifest(manifest) if manifest is not None else set()
            named.add(keys.house_key(house, keys.MANIFEST))
            done = keys.house_key(house, "done/")
            for key in group:
                # Markers of a house with a manifest are what the manifest was made from.
                if key not in named and not (manifest is not None and key.startswith(done)):
                    yield key


def _keys_in_manifest(manifest: bytes) -> set[str]:
    return {str(json.loads(line)["key"]) for line in manifest.splitlines()}
