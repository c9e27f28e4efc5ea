"""Checkpoints of a view's light: contents, timing, removal."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pbrs_farm.core import keys
from pbrs_farm.core.errors import StoreUnavailable
from pbrs_farm.core.recipe import recipe_from_name
from pbrs_farm.formats.marker import Marker
from pbrs_farm.prepare.source import resolve
from pbrs_farm.raycast.variant import choose_variant
from pbrs_farm.run.house_cache import HouseCache
from pbrs_farm.run.light_checkpoint import LightCheckpoint
from pbrs_farm.run.output_root import finish_house
from pbrs_farm.run.step_cache import Work
from pbrs_farm.run.steps import run_step
from pbrs_farm.store import MemoryStore

KEY = keys.unfinished_key("h", "light", "0_0_0")


class Clock:
    """A clock set by the test."""

    now = 100.0

    def __call__(self) -> float:
        return self.now


def checkpoint(
    store: MemoryStore, clock: Clock, digest: str = "d", told: list[float] | None = None
) -> LightCheckpoint:
    return LightCheckpoint(
        store, KEY, digest, (told if told is not None else []).append, clock=clock
    )


def state(value: float) -> Callable[[], dict[str, Any]]:
    return lambda: {"film": np.full((2, 3), value, np.float32), "spp": np.int64(value)}


def kept_store() -> MemoryStore:
    """A store in which a render has stored two parts after 61 seconds."""
    store, clock = MemoryStore(), Clock()
    under_way = checkpoint(store, clock)
    under_way.keep("direct", 0.1, state(1))
    clock.now += 61
    under_way.keep("chains", 0.5, state(2))
    return store


def test_a_short_render_keeps_nothing() -> None:
    store, clock = MemoryStore(), Clock()
    under_way = checkpoint(store, clock)
    for _ in range(11):
        clock.now += 5
        under_way.keep("path", 0.5, state(1))
    assert list(store.list()) == []


def test_all_parts_are_kept_once_a_minute_has_passed() -> None:
    store, clock = kept_store(), Clock()
    again = checkpoint(store, clock)
    assert again.spent_s == 61
    assert float(again.kept("direct")["film"][0, 0]) == 1
    assert int(again.kept("chains")["spp"]) == 2
    assert again.kept("path") == {}
    # A part finished before the process died is stored with the others again.
    clock.now += 61
    again.keep("chains", 0.9, state(3))
    third = checkpoint(store, clock)
    assert third.spent_s == 122
    assert (int(third.kept("direct")["spp"]), int(third.kept("chains")["spp"])) == (1, 3)


def test_a_checkpoint_of_another_step_is_not_resumed() -> None:
    foreign = checkpoint(kept_store(), Clock(), digest="e")
    assert foreign.kept("chains") == {}
    assert foreign.spent_s == 0


@pytest.mark.parametrize("data", [b"", b"not a file", b"PK\x03\x04 cut off"])
def test_a_damaged_checkpoint_is_ignored(data: bytes) -> None:
    store = MemoryStore()
    store.put(KEY, data)
    assert checkpoint(store, Clock()).kept("chains") == {}


def test_a_full_store_costs_the_checkpoint_but_not_the_render() -> None:
    class Full(MemoryStore):
        def put(self, key: str, data: bytes | memoryview) -> None:
            raise StoreUnavailable(key, "is full")

    store, clock = Full(), Clock()
    under_way = checkpoint(store, clock)
    clock.now += 61
    under_way.keep("path", 0.5, state(1))
    assert list(store.list()) == []


def test_progress_is_reported_every_few_seconds() -> None:
    clock, reports = Clock(), list[float]()
    under_way = checkpoint(MemoryStore(), clock, told=reports)
    for share in (0.1, 0.2, 0.3, 0.4):
        clock.now += 3
        under_way.keep("path", share, state(1))
    assert reports == [0.2, 0.4]


@pytest.mark.long
@pytest.mark.skipif(choose_variant().startswith("scalar"), reason="needs LLVM or CUDA")
def test_a_killed_view_is_resumed_and_leaves_nothing_behind(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    fields = {"image.width_px": "32", "image.height_px": "24", "cameras.cell_m": "1.0"}
    fields |= {"cameras.score_width_px": "64", "cameras.score_height_px": "48"}
    fields |= {"light.spp": "2", "light.noise": "0.01", "light.max_spp": "8"}
    source, recipe = resolve("builtin"), recipe_from_name("preview", fields)
    work = Work(MemoryStore(), recipe, source.house_id, HouseCache(), source=source)
    for step in ("house", "illuminance"):
        run_step(step, work)
    view = run_step("cameras", work).marker.facts["views"][0][0]
    undisturbed = replace(work, view_id=view)
    whole = run_step("light", undisturbed).marker
    store = work.store
    store.delete(keys.marker_key(work.house_id, "light", view))

    # Kill the render at its third report of progress, each right after a write.
    monkeypatch.setattr("pbrs_farm.run.light_checkpoint.KEEP_EVERY_S", 0.0)
    monkeypatch.setattr("pbrs_farm.run.light_checkpoint.TELL_EVERY_S", 0.0)
    reports: list[float] = []

    def tell(share: float) -> None:
        reports.append(share)
        if len(reports) == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_step("light", replace(undisturbed, tell_share=tell))
    unfinished = keys.unfinished_key(work.house_id, "light", view)
    assert store.head(unfinished) is not None

    # Two of four launches are stored: two remain, then none.
    remaining: list[float] = []
    again = run_step("light", replace(undisturbed, tell_share=remaining.append)).marker
    assert len(remaining) == 2
    assert again.files == whole.files
    assert store.head(unfinished) is None


def test_checkpoints_of_done_steps_are_removed_at_the_houses_end() -> None:
    store = kept_store()
    finish_house(store, "h")
    assert store.head(KEY) is not None
    marker = Marker(step="light", house_id="h", view_id="0_0_0", digest="d")
    store.put(keys.marker_key("h", "light", "0_0_0"), marker.json_bytes())
    finish_house(store, "h")
    assert store.head(KEY) is None
