"""A runner that writes small files instead of pictures, and fails as control files command.

Outputs depend on ids only, like those of the real steps. Every start is appended to `control/starts`, so that
a test can find repeated tasks. Control files: crash.<house>, hang.<house>, bug.<house>,
data.<house>, full (storage is full), away (storage does not answer), slow (seconds per view).
"""

from __future__ import annotations

import errno
import os
import time
from collections.abc import Iterator
from pathlib import Path

from pbrs_farm.core import keys
from pbrs_farm.core.errors import BadHouse, StoreUnavailable
from pbrs_farm.store import Head, Store, store_from_url
from pbrs_farm.store.laid_out import LaidOutStore
from pbrs_farm.store.object_store import put_done
from pbrs_farm.store.retrying import RetryingStore
from workers.config import FarmConfig
from workers.job import JobSpec
from workers.runner import OnText, Result, Survey, TaskRequest


def control_folder() -> Path:
    return Path(os.environ["PBRS_TEST_CONTROL"])


def runner(config: FarmConfig, on_waiting: OnText) -> FakeRunner:
    store = store_from_url(config.store_url, config.store)

    def with_patience(inner: Store) -> Store:
        unhealthy = UnhealthyStore(inner, control_folder())
        return RetryingStore(unhealthy, config.storage_patience_s, on_waiting)

    # As in the real runner, retries are below the layout.
    if isinstance(store, LaidOutStore):
        return FakeRunner(store.around(with_patience), control_folder())
    return FakeRunner(with_patience(store), control_folder())


class UnhealthyStore:
    """The store, unless a control file says it is away or full."""

    def __init__(self, store: Store, control: Path) -> None:
        self._store = store
        self._control = control

    @property
    def url(self) -> str:
        return self._store.url

    def put(self, key: str, data: bytes) -> None:
        self._check(key, writing=True)
        self._store.put(key, data)

    def put_if_absent(self, key: str, data: bytes) -> bool:
        self._check(key, writing=True)
        return self._store.put_if_absent(key, data)

    def get(self, key: str) -> bytes:
        self._check(key)
        return self._store.get(key)

    def get_range(self, key: str, start: int, n_bytes: int) -> bytes:
        self._check(key)
        return self._store.get_range(key, start, n_bytes)

    def head(self, key: str) -> Head | None:
        self._check(key)
        return self._store.head(key)

    def list(self, prefix: str = "") -> Iterator[str]:
        self._check(prefix)
        return self._store.list(prefix)

    def delete(self, key: str) -> None:
        self._check(key, writing=True)
        self._store.delete(key)

    def _check(self, key: str, *, writing: bool = False) -> None:
        if (self._control / "away").exists():
            raise StoreUnavailable(key, "does not answer")
        if writing and (self._control / "full").exists():
            raise StoreUnavailable(key, f"is full: {os.strerror(errno.ENOSPC)}")


def batches_of(house: str) -> tuple[tuple[str, ...], ...]:
    """Two or three batches of two views, by the house's name."""
    return tuple((f"r{g}_0", f"r{g}_1") for g in range(2 + len(house) % 2))


class FakeRunner:
    """house, cameras; truth per view in gl, light per view in light; a manifest in reduce."""

    def __init__(self, store: Store, control: Path) -> None:
        self._store = store
        self._control = control

    def run(self, request: TaskRequest, on_step: OnText) -> Result:
        with (self._control / "starts").open("a") as file:
            file.write(f"{request.house}/{request.unit}/{request.stage}\n")
        self._misbehave(request)
        if request.stage == "geometry":
            for step in ("house", "cameras"):
                self._step(request.house, step, None, on_step)
            return Result(batches=batches_of(request.house))
        if request.stage in ("gl", "light"):
            for view in request.views:
                step = {"gl": "truth", "light": "light"}[request.stage]
                self._step(request.house, step, view, on_step)
        elif request.stage == "reduce":
            listed = sorted(self._store.list(keys.house_key(request.house, "views/")))
            self._store.put(keys.house_key(request.house, "manifest.jsonl"), repr(listed).encode())
        elif request.stage == "job":
            listed = sorted(k for k in self._store.list("houses/") if k.endswith("manifest.jsonl"))
            self._store.put("manifest.jsonl", repr(listed).encode())
        return Result(n_views=len(request.views))

    def survey(self, spec: JobSpec, house: str, done: frozenset[str]) -> Survey:
        if not done.issuperset({"house", "cameras"}):
            return Survey()
        missing = {}
        for number, views in enumerate(batches_of(house)):
            stages = {"gl": "truth", "light": "light"}
            unfinished = [
                s for s in spec.batch_stages if any(f"{stages[s]}.{v}" not in done for v in views)
            ]
            missing[str(number)] = unfinished[0] if unfinished else ""
        reduced = not any(missing.values()) and (
            self._store.head(keys.house_key(house, "manifest.jsonl")) is not None
        )
        return Survey(batches_of(house), missing, reduced)

    def _step(self, house: str, step: str, view: str | None, on_step: OnText) -> None:
        on_step(f"{step} {view}")
        marker = keys.marker_key(house, step, view)
        if self._store.head(marker) is not None:
            return
        self._work()
        key = keys.view_key(house, view, f"{step}.png") if view else keys.house_key(house, step)
        outputs = {key: f"{house} {step} {view}".encode() * 10}
        put_done(self._store, marker, keys.digest(house, step, view).encode(), outputs)

    def _work(self) -> None:
        slow = self._control / "slow"
        if slow.exists():
            time.sleep(float(slow.read_text() or 0))

    def _misbehave(self, request: TaskRequest) -> None:
        def is_asked(what: str) -> bool:
            return (self._control / f"{what}.{request.house}").exists() and request.stage == "gl"

        if is_asked("crash"):
            print("about to crash", flush=True)  # noqa: T201
            os.abort()
        if is_asked("hang"):
            time.sleep(3600)
        if is_asked("bug"):
            raise ValueError(f"something odd with {request.house}")
        if is_asked("data"):
            raise BadHouse(request.house, "wall w3", "two walls in one place")
