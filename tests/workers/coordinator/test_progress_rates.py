from __future__ import annotations

import pytest

from workers.client.text import duration_text
from workers.coordinator.progress_rates import Rates, quantile_s, stage_views
from workers.ledger.task_ledger import JobView


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
    assert gl.total == 20  # 8 batches of 4 houses, plus 2 for each of the 6 houses to come
    assert gl.eta_s == pytest.approx(16 / 2.0)
    assert gl.p50_s == 8.0


def test_abandoned_houses_and_unknown_stages_add_no_time() -> None:
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


def test_durations_read_well() -> None:
    texts = [duration_text(s) for s in (None, 0.5, 42, 600, 7200, 200_000)]
    assert texts == ["-", "0.5s", "42s", "10m", "2.0h", "2.3d"]
