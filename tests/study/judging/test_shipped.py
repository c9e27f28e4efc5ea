"""The recipe of the weights that ship: the best seed of a task, and words that the program knows."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from benchmarks.study import shipped

pytestmark = pytest.mark.study


def _report(figure: str, value: float) -> dict[str, Any]:
    other = {"on": "drawn", "figures": {"network": {figure: -value}}}
    return {"evaluations": [other, {"on": "made", "figures": {"network": {figure: value}}}]}


@pytest.mark.parametrize(
    ("task", "figure", "best"),
    [
        ("normals", "mean_deg", "low"),
        ("segmentation", "mean_iou", "high"),
        ("depth", "abs_rel", "low"),
    ],
)
def test_the_best_seed_is_the_one_with_the_best_figure_on_generated_homes(
    task: str, figure: str, best: str
) -> None:
    reports = {Path("low"): _report(figure, 0.2), Path("high"): _report(figure, 0.9)}
    assert shipped.best_run(task, reports) == Path(best)


def test_weights_that_a_constant_beats_somewhere_are_not_installed() -> None:
    rows = {"made": (0.23, 0.34), "photos": (0.44, 0.37)}
    report = {
        "evaluations": [
            {"on": on, "figures": {"network": {"abs_rel": net}, "mean depth": {"abs_rel": mean}}}
            for on, (net, mean) in rows.items()
        ]
    }
    assert shipped.lost_places("depth", report, "mean depth") == ["photos"]


def test_an_unknown_task_is_rejected_by_name(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        shipped.main(["train", "colours"])
    assert "no task 'colours'; expected normals, segmentation" in capsys.readouterr().err


def test_training_before_rendering_says_so(tmp_path: Path) -> None:
    with pytest.raises(Exception, match="homes"):
        shipped.held_out_homes(tmp_path / "homes")
