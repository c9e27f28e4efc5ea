"""The bench of light: its figures' names, its table, and the scenes it can be asked for."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from benchmarks.light import equal_time, table_rows
from benchmarks.light.picture_variance import Comparison, Run, compared

MEASURED = {
    "metropolis_s": 2.0, "path_s": 2.0, "path_spp": 512.0, "path_relmse": 0.5, "path_median": 0.3,
    "metropolis_relmse": 0.1, "metropolis_median": 0.06, "relmse_ratio": 0.2,
    "relmse_ratio_spread": 0.1, "median_ratio": 0.2, "median_ratio_spread": 0.05, "fast_s": 0.2,
    "fast_relmse": 1.0, "fast_times_cheaper": 1.0,
}  # fmt: skip


def comparison(ratio: float, seed: int) -> Comparison:
    """Two runs of six pictures of noise, the squares of whose errors have this ratio."""

    def run(error: float, salt: int) -> Run:
        noise: NDArray[np.float64] = np.random.default_rng((seed, salt)).standard_normal(
            (6, 36, 48)
        )
        return Run(1 + error * noise, 1.0)

    return compared(run(0.1 * ratio**0.5, 1), run(0.1, 2))


def test_homes_are_told_by_the_median_camera() -> None:
    ratios = (0.3, 0.4, 0.5, 0.6, 0.7, 9.0)
    found = equal_time.homes_figures([comparison(r, k) for k, r in enumerate(ratios)])
    assert found["light.homes_ratio"] == pytest.approx(0.55, rel=0.05)
    assert found["light.homes_median_ratio"] == pytest.approx(0.55**0.5, rel=0.05)
    assert 0 < found["light.homes_ratio_spread"] < 0.05


def test_the_table_has_a_cell_for_every_head() -> None:
    head, rule = table_rows.light_head()
    row = table_rows.light_row("door ajar", MEASURED)
    assert head.count("|") == rule.count("|") == row.count("|")
    assert "| 0.20 ± 0.02 |" in row


@pytest.mark.slow
def test_the_report_has_the_names_that_gates_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    reported: dict[str, float] = {}

    def shots(keys: list[str]) -> list[object]:
        return [type("Shot", (), {"key": k, "name": k}) for k in keys]

    def write(_name: str, figures: dict[str, float], units: dict[str, str]) -> None:
        assert figures.keys() == units.keys()
        reported.update(figures)

    monkeypatch.delenv("LIGHT_SCENES", raising=False)
    monkeypatch.setattr(equal_time, "_shots", shots)
    monkeypatch.setattr(equal_time, "measured_shot", lambda _s: (comparison(0.5, 0), MEASURED))
    monkeypatch.setattr(equal_time, "mutation_cost", lambda: 1.5)
    monkeypatch.setattr(equal_time, "compiled_by_another_camera", lambda: 0.0)
    monkeypatch.setattr(equal_time, "write_report", write)
    equal_time.main()
    gated = {"homes_ratio", "door_relmse_ratio", "globe_relmse_ratio", "shade_relmse_ratio"}
    assert {f"light.{name}" for name in gated | {"mutation_cost"}} <= reported.keys()


def test_homes_have_no_figure_when_a_camera_was_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("LIGHT_SCENES", "kitchen")
    with pytest.raises(
        ValueError, match="no scene 'kitchen'; of door, globe, sunlit, shade, 2bedroom"
    ):
        equal_time.main()
