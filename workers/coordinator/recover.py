"""The ledger rebuilt from storage: the names of the markers, one look at each unfinished house.

Effects: reads the store, writes Redis. Attempts start afresh; tasks that had failed for good and
left a record are tried again.
"""

from __future__ import annotations

import contextlib
import json
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from itertools import groupby, islice
from typing import Final

from pbrs_farm.core import keys
from pbrs_farm.store.laid_out import LaidOutStore
from pbrs_farm.store.object_store import Store, get_or_none
from workers.ids import GEOMETRY, REDUCE, job_key
from workers.job import HouseEntry, JobSpec
from workers.ledger.redis_ledger import RedisLedger
from workers.ledger.task_ledger import HouseState
from workers.runner import StepRunner

_THREADS: Final = 16  # storage is slow but handles many parallel requests
_CHUNK: Final = 1000  # houses in memory at a time


def rebuild(
    ledger: RedisLedger,
    store: Store,
    runner: StepRunner,
    spec: JobSpec,
    houses: list[HouseEntry],
    progress: Callable[[str], None] = lambda _line: None,
) -> None:
    """Enter every house of the job with the progress of its markers. The job must have just been created.

    If markers may be of another recipe or version, every house starts from the beginning: its tasks read
    each marker, and valid ones are not repeated.
    """
    # The markers' names of all houses, then a look at each that has begun.
    are_current = bool(houses) and are_markers_current(store, spec)
    done = done_steps(store, [house.house_id for house in houses]) if are_current else {}
    progress(f"{sum(map(len, done.values()))} markers of {len(done)} houses")
    numbered = iter(enumerate(houses))
    with ThreadPoolExecutor(_THREADS) as pool:
        while chunk := list(islice(numbered, _CHUNK)):
            look = partial(_house_state, runner, spec, done)
            _enter(ledger, spec.job_id, chunk, list(pool.map(look, chunk)))


def lost_jobs(ledger: RedisLedger, store: Store) -> list[str]:
    """Jobs, by id, that the store knows and an empty ledger does not; [] where it holds any job."""
    if ledger.known_jobs():
        return []
    return jobs_in(store)


def jobs_in(store: Store) -> list[str]:
    """The jobs, by id, that a store has a description of."""
    ends = (key.split("/") for key in store.list("jobs/") if key.endswith("/job.json"))
    return sorted(parts[1] for parts in ends if len(parts) == 3)


def are_markers_current(store: Store, spec: JobSpec) -> bool:
    """True if one recipe and version wrote this root, so that a marker's name says its step is done."""
    if store.head(keys.RECIPE_REPLACED) is not None:
        return False
    # Every job that ever ran here left its description.
    rows = (json.loads(store.get(job_key(job))) for job in jobs_in(store))
    return all(r.get("version") == spec.version and not r.get("versions_before") for r in rows)


def done_steps(store: Store, houses: Sequence[str]) -> dict[str, frozenset[str]]:
    """House -> names ("<step>", "<step>.<view>") of its markers, by one listing of a folder, else one each."""
    if isinstance(store, LaidOutStore):
        with ThreadPoolExecutor(_THREADS) as pool:
            pairs = zip(houses, pool.map(partial(_names_of_house, store), houses), strict=True)
            return {house: names for house, names in pairs if names}
    return _names_of_markers(store.list(f"{keys.FOLDERS[0]}/"))


def _names_of_house(store: LaidOutStore, house: str) -> frozenset[str]:
    # A manifest was made from the markers; where views are packed it spares a look into each pack.
    data = get_or_none(store, keys.house_key(house, keys.MANIFEST)) if store.is_packed else None
    # One that cannot be read is no reason to give a house up.
    with contextlib.suppress(ValueError, KeyError, TypeError):
        rows = [json.loads(line) for line in (data or b"").splitlines()]
        placed = [(row["step"], keys.parse_house_key(row["key"])) for row in rows]
        if placed:
            return frozenset(keys.marker_name(step, p.view) for step, p in placed if p)
    return _names_of_markers(store.list(keys.house_key(house, "done/"))).get(house, frozenset())


def _names_of_markers(keys_found: Iterable[str]) -> dict[str, frozenset[str]]:
    # Keys look like houses/<id>/done/<step>[.<view>].json
    names: dict[str, list[str]] = {}
    for key in keys_found:
        parsed = keys.parse_house_key(key)
        if parsed is not None and parsed.step:
            names.setdefault(parsed.house, []).append(keys.marker_name(parsed.step, parsed.view))
    return {house: frozenset(steps) for house, steps in names.items()}


def _house_state(
    runner: StepRunner,
    spec: JobSpec,
    done: dict[str, frozenset[str]],
    numbered: tuple[int, HouseEntry],
) -> HouseState | None:
    """The house as the ledger shall hold it, None when nothing is done."""
    index, house = numbered
    names = done.get(house.house_id)
    survey = runner.survey(spec, house.house_id, names) if names else None
    if survey is None or survey.batches is None:
        return None
    # Each batch is at its first unfinished stage, the house at the stage that its batches allow.
    units: dict[str, tuple[str, str]] = {}
    for unit, stage in survey.missing.items():
        units[unit] = (stage, "l") if stage else (spec.batch_stages[-1], "d")
    are_done = all(letter == "d" for _stage, letter in units.values())
    reduce = (REDUCE, "d" if survey.reduced else "l")
    units["-"] = reduce if survey.reduced or are_done else (GEOMETRY, "d")
    return HouseState(index, house.house_id, survey.reduced, survey.batches, units)


def _enter(
    ledger: RedisLedger,
    job: str,
    chunk: list[tuple[int, HouseEntry]],
    states: list[HouseState | None],
) -> None:
    """In the job's order: runs of fresh houses and of houses with a past, each in one go."""
    # Cut where fresh houses and houses with a past meet.
    rows = [(index, house, state) for (index, house), state in zip(chunk, states, strict=True)]
    for is_fresh, run in groupby(rows, key=lambda row: row[2] is None):
        items = list(run)
        if is_fresh:
            ledger.add_houses(job, items[0][0], [house for _index, house, _house_state in items])
        else:
            ledger.load_houses(job, [state for _i, _h, state in items if state is not None])
