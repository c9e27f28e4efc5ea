"""The bench of ImageNet's start: its figures and table, and that it stops when its seconds are over."""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import Any

import pytest

from benchmarks.study import start_curve, study_figures, trainings

pytestmark = pytest.mark.study


def _row(init: str, views: int, seed: int, groups: dict[str, float]) -> dict[str, Any]:
    """A training whose mean angle is that of its homes, half of its pixels floor."""
    mean = sum(groups.values()) / len(groups)
    parts = {
        "network": {"up": mean - 5, "oblique": mean + 5},
        "mean normal": {"up": 40.0, "oblique": 50.0},
    }
    figures = {"network": {"mean_deg": mean}, "mean normal": {"mean_deg": 45.0}}
    judged = {
        "n_views": 6, "figures": figures, "parts": parts, "shares": {"up": 0.5, "oblique": 0.5},
        "groups": groups,
    }  # fmt: skip
    return {
        "run": f"{init}_{views}views_seed{seed}", "init": init, "views": views, "seed": seed,
        "steps": 30, "batch": 4, "homes": 3, "baseline": "mean normal", "training_deg": 20.0,
        "judged": {"made": judged},
    }  # fmt: skip


ROWS = [
    _row("none", 100, 0, {"a": 40.0, "b": 42.0}), _row("imagenet", 100, 0, {"a": 37.0, "b": 37.0}),
    _row("none", 100, 1, {"a": 42.0, "b": 44.0}), _row("imagenet", 100, 1, {"a": 39.0, "b": 39.0}),
    _row("none", 400, 0, {"a": 30.0, "b": 30.0}),
]  # fmt: skip


def test_the_gain_is_of_equal_seeds_and_its_interval_over_homes() -> None:
    figures = start_curve.start_figures(ROWS)
    # Home a gains 3 with either seed, home b 5; at 400 views one start is lacking.
    assert figures["study.init_gain_100"] == pytest.approx(4)
    assert (figures["study.init_gain_100_low"], figures["study.init_gain_100_high"]) == (3, 5)
    assert "study.init_gain_400" not in figures
    assert figures["study.curve_views"] == 400


def test_the_bench_tells_the_gain_of_the_most_views_from_where_it_is_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(study_figures, "START", tmp_path)
    assert study_figures._init_gain() == {}
    assert "start_curve render" in capsys.readouterr().err
    rows = [row for row in ROWS if row["views"] == 100]
    (tmp_path / "results.json").write_text(json.dumps({"rows": rows}))
    figures = study_figures._init_gain()
    assert figures == {
        "study.curve_views": 100, "study.init_gain": pytest.approx(4),
        "study.init_gain_low": 3, "study.init_gain_high": 5,
    }  # fmt: skip
    assert figures.keys() <= study_figures.UNITS.keys()
    # From one start alone nothing is said of a gain.
    (tmp_path / "results.json").write_text(json.dumps({"rows": ROWS}))
    assert study_figures._init_gain() == {"study.curve_views": 400}


def test_the_table_has_a_row_a_start_and_what_knows_no_picture() -> None:
    table = start_curve.start_table(ROWS)
    rows = [
        [cell.strip() for cell in line.split("|")[1:-1]]
        for line in table.splitlines()
        if line.startswith("|")
    ]
    assert rows[0] == ["views", "homes", "start", "seeds", "training", "mean", "up", "oblique"]
    assert rows[2] == ["100", "3", "imagenet", "2", "20.0", "38.00 ± 1.41", "33.0", "43.0"]
    assert rows[-2][2:] == ["mean normal", "-", "-", "45.00", "40.0", "50.0"]
    assert rows[-1][-2:] == ["50 %", "50 %"]


def test_the_program_is_ended_at_the_deadline(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(trainings, "_GRACE_S", 0.0)
    began = time.monotonic()
    assert trainings.run_program(["doctor"], began, tmp_path / "doctor.log") == 1
    assert trainings.run_program(["--version"], None, tmp_path / "logs/said.log") == 0
    assert (tmp_path / "logs/said.log").read_text().strip()


def test_what_is_judged_is_read_back(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(start_curve, "START", tmp_path)
    assert start_curve._tell(None) == "nothing is judged yet"
    row = ROWS[0]
    report = {
        "run": {"plan": {"steps": 30, "batch": 4}, "homes": {"train": ["x", "y", "z"]}},
        "trained": {"baseline_name": "mean normal", "network": {"train": {"mean_deg": 20.0}}},
        "evaluations": [{"on": "made", **row["judged"]["made"]}],
    }
    folder = tmp_path / "runs" / row["run"] / "evaluation"
    folder.mkdir(parents=True)
    (folder / "evaluation.json").write_text(json.dumps(report))
    assert "| none" in start_curve._tell(None)
    assert json.loads((tmp_path / "results.json").read_text())["rows"] == [row]
