"""A worker without OpenGL: its pictures are skipped with one note if others remain, else the task fails."""

from __future__ import annotations

from typing import Any

import pytest

from pbrs_farm.core.errors import BadHouse, MachineFailed
from pbrs_farm.core.recipe import recipe_from_name
from pbrs_farm.run.step_cache import Work
from pbrs_farm.store import MemoryStore
from tests.inputs.slot_bench import TASK, Bench, bench
from workers.client.farm_client import completed, new_spec
from workers.house_files import entries_from_arguments
from workers.ids import GL, job_key
from workers.node import house_runner
from workers.node.house_runner import HouseRunner
from workers.runner import Result, TaskRequest

__all__ = ["bench"]


class Steps:
    """Replaces run_step: records the steps, and fails those of OpenGL."""

    def __init__(self, fault: Exception) -> None:
        self.fault, self.seen = fault, list[tuple[str, str | None]]()

    def __call__(self, name: str, work: Work, **_options: Any) -> None:
        self.seen.append((name, work.view_id))
        if name.startswith("opengl"):
            raise self.fault


def labelled(steps: Steps, monkeypatch: pytest.MonkeyPatch, modes: tuple[str, ...]) -> list[Result]:
    """Run two tasks of the stage gl, of two views each, by one runner."""
    monkeypatch.setattr(house_runner, "run_step", steps)
    entries = [entry for entry, _ref in entries_from_arguments(["builtin"])]
    (house,), spec = completed(entries, new_spec(recipe_from_name("preview"), modes=modes))
    store = MemoryStore()
    store.put(job_key(spec.job_id), spec.model_dump_json().encode())
    runner = HouseRunner(store, n_threads=1)
    return [
        runner.run(
            TaskRequest(
                job_id=spec.job_id, house=house.house_id, unit=unit, stage=GL, views=(f"{unit}_a", f"{unit}_b")
            ),
            lambda _step: None,
        )
        for unit in ("0", "1")
    ]  # fmt: skip


def test_labels_continue_and_opengl_is_tried_once(monkeypatch: pytest.MonkeyPatch) -> None:
    steps = Steps(MachineFailed("no headless OpenGL 3.3"))
    results = labelled(steps, monkeypatch, ("opengl_dl", "opengl_il", "mlt_ol"))
    assert steps.seen == [
        ("truth", "0_a"), ("opengl_dl", "0_a"), ("truth", "0_b"), ("truth", "1_a"), ("truth", "1_b"),
    ]  # fmt: skip
    assert [r.n_views for r in results] == [2, 2]
    assert all("no headless OpenGL" in r.left_out for r in results)


def test_a_job_of_only_opengl_is_for_another_worker(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(MachineFailed, match="no headless OpenGL"):
        labelled(Steps(MachineFailed("no headless OpenGL 3.3")), monkeypatch, ("opengl_dl",))


def test_a_fault_of_the_home_remains_a_fault(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(BadHouse):
        labelled(Steps(BadHouse("f", "p", "m")), monkeypatch, ("opengl_dl", "mlt_ol"))


def test_a_slot_logs_its_skipped_modes_once(bench: Bench, caplog: pytest.LogCaptureFixture) -> None:
    bench.next.at(1, "ready")
    for seconds in (2, 4):
        bench.next.at(seconds, "done", batches=[], n_views=0, left_out="no headless OpenGL 3.3")
    bench.run(TASK, "h0/1/gl")
    told = [r.message for r in caplog.records if "skipping pictures" in r.message]
    assert told == ["skipping pictures of OpenGL: no headless OpenGL 3.3"]
    assert set(bench.ledger.finished) == {TASK, "h0/1/gl"}
