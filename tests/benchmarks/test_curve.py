"""The learning curve tells every point, and what more homes bring at equal views."""

from __future__ import annotations

import json
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest

from benchmarks.study import curve
from benchmarks.study.curve import POINTS, run_words
from benchmarks.study.curve_pictures import Point, curve_page, curve_picture
from pbrs_farm.store.folder import FolderStore
from tests.views.small_roots import fill

JUDGED = [
    Point(10, 100, {"made": (30.0, 32.0), "training": (9.0, 9.2)}),
    Point(40, 100, {"made": (28.0, 28.0), "training": (9.1, 9.0)}),
    Point(20, 200, {"made": (29.0,), "training": (10.0,)}),
]


def test_a_page_has_a_row_a_point_and_the_seeds_spread() -> None:
    page = curve_page(JUDGED, ["Rendering took 60 CPU-seconds a home."])
    assert "| 10 | 100 | 2 | 31.0 ± 1.4 | 9.1 ± 0.1 |" in page
    assert "| 20 | 200 | 1 | 29.0 | 10.0 |" in page
    assert "Equal views, 100: of 10 homes against 40: made 31.0 to 28.0." in page


def test_a_line_joins_the_points_of_fewest_homes_and_others_stand_apart() -> None:
    picture = ET.fromstring(curve_picture(JUDGED))
    names = [child.tag.rpartition("}")[2] for child in picture]
    assert names.count("polyline") == 1
    assert names.count("circle") == 3
    lines = [child.get("points") or "" for child in picture if "points" in child.attrib]
    assert len(lines[0].split()) == 2


def test_every_point_has_equally_many_views_a_home_or_fewer_and_its_roots_are_apart() -> None:
    assert all(views <= 10 * homes for homes, views in POINTS)
    assert run_words("homes_011")[1] == "made:11..20"


@pytest.mark.slow
@pytest.mark.study
def test_points_are_trained_judged_drawn_and_not_made_twice(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("torch")

    def rendered(name: str, _jobs: int) -> str:
        made = tmp_path / name
        if not made.exists():
            fill(FolderStore(made), {f"{name.replace('_', '-')}-00000000": 4}, (40, 32))
            row = {"figures": {"homes": 1, "views": 4}, "cpu_s": 8.0}
            (made / "cost.json").write_text(json.dumps(row))
        return str(made)

    monkeypatch.setattr(curve, "CURVE", tmp_path)
    monkeypatch.setattr(curve, "POINTS", ((10, 4), (20, 4)))
    monkeypatch.setattr(curve, "rendered", rendered)
    small = ["width_px=40", "height_px=32", "batch=2", "steps=2", "threads=1", "judge_every=0"]
    words = ["--seeds", "1", "--set", *small]
    curve.main(words)
    page = (tmp_path / "curve.md").read_text()
    assert "| 10 | 4 | 1 |" in page
    assert "Equal views, 4: of 10 homes against 20: made" in page
    assert "8 CPU-seconds a home" in page
    monkeypatch.setattr(curve, "_command", lambda _words: pytest.fail("made twice"))
    curve.main(words)
