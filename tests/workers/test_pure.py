"""The parts of the farm that only compute: batches, rates, faults, limits, texts."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pbrs_farm.core.errors import (
    BadHouse,
    BadInput,
    MachineFailed,
    ObjectMissing,
    StoreFailed,
    StoreRefused,
    StoreUnavailable,
)
from pbrs_farm.core.recipe import recipe_from_name
from pbrs_farm.run.processes.limits import machine_mb, memory_share_mb
from pbrs_farm.store import MemoryStore
from tests.workers.conftest import spec
from workers.client.estimate import estimate, seconds_per_view
from workers.client.farm_client import completed, new_spec
from workers.client.text import duration_text
from workers.config import FarmConfig, Limits
from workers.coordinator.progress_rates import Rates, quantile_s, stage_views
from workers.house_files import entries_from_arguments, is_left_in_place
from workers.ids import check_job_id, job_key, queue_of, stages_of_queue, task_from_text
from workers.job import HouseEntry
from workers.ledger.task_ledger import JobView
from workers.node.faults import class_of, fingerprint, without_numbers
from workers.node.house_runner import HouseRunner, steps_of_stage
from workers.node.view_batches import batches_from_views
from workers.runner import Request


@given(
    st.lists(st.tuples(st.integers(0, 4), st.integers(0, 99)), unique=True, max_size=40),
    st.floats(0.5, 1000),
)
def test_batches_hold_every_view_once_and_no_batch_is_too_long(
    pairs: list[tuple[int, int]], seconds: float
) -> None:
    views = [(f"r{room}_{k}", f"r{room}") for room, k in pairs]
    batches = batches_from_views(views, seconds)
    assert sorted(v for g in batches for v in g) == sorted(v for v, _room in views)
    assert all(len(g) == 1 or len(g) * seconds <= 300 + 1e-6 for g in batches)


def test_a_rooms_views_stay_together() -> None:
    views = [(f"a{k}", "a") for k in range(6)] + [(f"b{k}", "b") for k in range(6)]
    assert [len(g) for g in batches_from_views(views, 30.0)] == [6, 6]


def test_a_small_job_is_cut_into_enough_batches_for_the_slots() -> None:
    views = [(f"a{k}", "a") for k in range(10)]
    assert [len(g) for g in batches_from_views(views, 1.5)] == [10]
    assert [len(g) for g in batches_from_views(views, 1.5, 8)] == [2] * 5
    assert [len(g) for g in batches_from_views(views, 1.5, 100)] == [1] * 10
    assert batches_from_views([], 1.5, 8) == ()


@pytest.mark.parametrize(
    "text", ["", "a/b", "a/b/c", "a/0/gl/x", "../x/gl", "a/0/rm -rf", "a\n/0/gl", "a/0/gl\n"]
)
def test_a_task_that_is_none_is_refused(text: str) -> None:
    with pytest.raises(BadInput, match="not a task"):
        task_from_text(text)


def test_ids_read_back() -> None:
    assert str(task_from_text("studio-1a2b/3/light")) == "studio-1a2b/3/light"
    assert str(task_from_text("-/s3/shard")) == "-/s3/shard"
    with pytest.raises(BadInput):
        check_job_id("../../etc")


def test_every_stage_has_a_queue_and_back() -> None:
    for stage in ("geometry", "gl", "light", "reduce", "shard", "job"):
        for gpu in (False, True):
            assert stage in stages_of_queue(queue_of(stage, gpu=gpu))
    assert queue_of("light", gpu=True) == "light.gpu"


def test_the_last_stage_of_a_batch_writes_the_view() -> None:
    both = spec(1)
    assert steps_of_stage(both, "gl") == ("truth", "opengl_dl", "opengl_il")
    assert steps_of_stage(both, "light")[-1] == "view"
    only_gl = both.model_copy(update={"modes": ("opengl_dl",), "batch_stages": ("gl",)})
    assert steps_of_stage(only_gl, "gl") == ("truth", "opengl_dl", "view")


@pytest.mark.parametrize(
    ("error", "kind"),
    [
        (BadHouse("f", "p", "m"), "data"),
        (StoreUnavailable("k", "m"), "storage"),
        (StoreRefused("k", "m"), "storage"),
        (StoreFailed("k", "a damaged marker must not stop the farm"), "bug"),
        (ObjectMissing("k", "m"), "bug"),
        (MachineFailed("m"), "machine"),
        (MemoryError(), "resource"),
        (KeyError("x"), "bug"),
    ],
)
def test_errors_have_their_class(error: Exception, kind: str) -> None:
    assert class_of(error) == kind


def test_faults_alike_have_one_fingerprint() -> None:
    one, other = ValueError("view 12 at 0x7f00 in /a/b.png"), ValueError("view 7 at 0x10 in /c.png")
    assert fingerprint(one) == fingerprint(other)
    assert fingerprint(one) != fingerprint(KeyError("view 12"))
    assert len(without_numbers("x" * 1000)) == 160


def test_rates_and_time_left_follow_the_counts() -> None:
    fields = {"n_houses": "10", "stages": "gl,light", "shard_size": "500"}

    def view(done: int, rates: dict[str, float]) -> JobView:
        counts = {"done:geometry": 4.0, "batches": 8.0, "done:gl": float(done), "took:gl:3": 5.0}
        return JobView("j", fields, counts, rates, 0)

    rates = Rates()
    rates.update(view(0, {}), 0.0)
    now = rates.update(view(20, {}), 10.0)
    assert now["gl"] == pytest.approx(2.0)
    gl = next(s for s in stage_views(view(4, now), {"gl": 2}) if s.stage == "gl")
    assert gl.total == 20  # 8 batches of 4 houses, 2 a house for the 6 to come
    assert gl.eta_s == pytest.approx(16 / 2.0)
    assert gl.p50_s == 8.0


def test_houses_given_up_and_stages_unknown_expect_nothing() -> None:
    fields = {"n_houses": "2", "stages": "gl,light", "shard_size": "500", "state": "running"}
    start = {s.stage: s for s in stage_views(JobView("j", fields, {}, {}, 0), {})}
    assert (start["gl"].total, start["gl"].eta_s) == (0, None)
    counts = {"done:geometry": 1.0, "geometry:f": 1.0, "batches": 3.0, "done:gl": 3.0, "done:light": 3.0,
              "houses:quarantined": 1.0, "done:reduce": 1.0}  # fmt: skip
    end = {s.stage: s for s in stage_views(JobView("j", fields, counts, {}, 0), {})}
    assert [end[s].total for s in ("geometry", "gl", "light", "reduce")] == [2, 3, 3, 1]
    assert all(end[s].eta_s == 0.0 for s in ("geometry", "gl", "light", "reduce"))


def test_a_quantile_is_the_upper_end_of_its_bucket() -> None:
    assert quantile_s({0: 5, 3: 5}, 0.5) == 1.0
    assert quantile_s({0: 5, 3: 5}, 0.9) == 8.0
    assert quantile_s({}, 0.5) == 0.0


def test_memory_is_the_containers_when_it_has_a_limit(tmp_path: Path) -> None:
    limit = tmp_path / "memory.max"
    limit.write_text("1073741824\n")
    assert machine_mb((limit,)) == 1024
    limit.write_text("max\n")
    assert machine_mb((limit,)) == machine_mb(())
    assert memory_share_mb(2) == pytest.approx(memory_share_mb(1) / 2)


def test_an_estimate_grows_with_the_job() -> None:
    small = estimate(spec(10), 2)
    large = estimate(spec(1000), 2)
    assert float(large["slot_hours"]) == pytest.approx(100 * float(small["slot_hours"]), rel=0.05)
    assert seconds_per_view(recipe_from_name("fast")) > seconds_per_view(
        recipe_from_name("preview")
    )


def test_a_job_is_the_same_job_in_any_order_and_another_with_another_recipe() -> None:
    houses = [HouseEntry(house_id=h, sha256=h * 8) for h in "abc"]
    preview = new_spec(recipe_from_name("preview"))
    one = completed(houses, preview)[1].job_id
    assert completed(houses[::-1], preview)[1].job_id == one
    assert completed(houses, new_spec(recipe_from_name("fast")))[1].job_id != one
    changed = [*houses[:2], HouseEntry(house_id="c", sha256="changed")]
    assert completed(changed, preview)[1].job_id != one
    with pytest.raises(BadInput, match="named twice"):
        completed([*houses, houses[0]], preview)
    with pytest.raises(BadInput, match="no house"):
        completed([], preview)


def test_every_setting_stands_in_the_docs() -> None:
    docs = (Path(__file__).parents[2] / "docs/farm.md").read_text()
    elsewhere = {"redis_url", "store_url", "store", "limits"}
    names = {f"_{f.name.upper()}" for f in fields(FarmConfig) if f.name not in elsewhere}
    names |= {f"_{f.name.upper()}" for f in fields(Limits)}
    assert sorted(n for n in names if f"{n}`" not in docs) == []


def test_durations_read_well() -> None:
    told = [duration_text(s) for s in (None, 0.5, 42, 600, 7200, 200_000)]
    assert told == ["-", "0.5s", "42s", "10m", "2.0h", "2.3d"]


def test_a_worker_that_does_not_see_a_suncg_folder_is_itself_at_fault(tmp_path: Path) -> None:
    house = tmp_path / "root/house/0a1b"
    house.mkdir(parents=True)
    (house / "house.json").write_text("{}")
    ((entry, ref),) = entries_from_arguments([str(house)])
    assert is_left_in_place(ref)
    store = MemoryStore()
    _houses, job = completed([entry], new_spec(recipe_from_name("preview")))
    store.put(job_key(job.job_id), job.model_dump_json().encode())
    request = Request(
        job_id=job.job_id, house=entry.house_id, unit="-", stage="geometry", source=entry.source
    )
    (house / "house.json").rename(tmp_path / "moved.json")
    house.rmdir()
    with pytest.raises(MachineFailed, match=r"does not see .*0a1b") as caught:
        HouseRunner(store, n_threads=1).run(request, lambda _step: None)
    assert class_of(caught.value) == "machine"


def test_a_folder_that_is_no_house_says_what_would_be_one(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match=r"holds no house\.json"):
        entries_from_arguments([str(tmp_path)])
    (tmp_path / "house").mkdir()
    with pytest.raises(BadInput, match="--houses LIST"):
        entries_from_arguments([str(tmp_path)])
