"""The file that every bench writes, out/bench/<name>.json, and the names of benches."""

from __future__ import annotations

import json
from importlib.util import find_spec
from pathlib import Path

import pytest

from benchmarks import __main__ as benches
from benchmarks import figures
from benchmarks.__main__ import BENCHES, Bench, main


def test_a_report_holds_figures_units_machine_versions_and_commit(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(figures, "FOLDER", tmp_path / "bench")
    path = figures.write_report("some", {"some.s": 1.5, "some.n": 3}, {"some.s": "s", "some.n": ""})
    report = json.loads(path.read_text(encoding="utf-8"))
    assert path == tmp_path / "bench/some.json"
    assert report["figures"] == {"some.s": 1.5, "some.n": 3}
    assert report["units"] == {"some.s": "s", "some.n": ""}
    assert report["machine"]["cores"] >= 1
    assert {"cpu", "memory_gb", "system", "load_1min"} <= report["machine"].keys()
    assert {"python", "numpy", "mitsuba"} <= report["versions"].keys()
    assert report.keys() == {"figures", "units", "machine", "versions", "commit"}
    assert "some.s  1.5 s" in capsys.readouterr().out


def test_a_figure_without_a_unit_is_refused_and_nothing_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(figures, "FOLDER", tmp_path / "bench")
    with pytest.raises(ValueError, match=r"figures without a unit: some\.n"):
        figures.write_report("some", {"some.n": 3}, {})
    assert not (tmp_path / "bench").exists()


@pytest.mark.parametrize("name", BENCHES)
def test_every_bench_has_its_module_and_its_claim(name: str) -> None:
    assert find_spec(f"benchmarks.{BENCHES[name].module}") is not None
    assert BENCHES[name].claim


def test_all_benches_of_the_lab_book_take_at_most_an_hour() -> None:
    assert sum(bench.minutes for bench in BENCHES.values() if bench.in_all) <= 60


def test_all_runs_every_bench_then_writes_the_tables(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(figures, "FOLDER", tmp_path)
    modules = {"first": "figures", "second": "memory", "not_in_all": "memory"}
    some = {name: Bench(module, "a claim", 1, in_all=name != "not_in_all") for name, module in modules.items()}  # fmt: skip
    calls: list[str] = []
    monkeypatch.setattr(benches, "BENCHES", some)
    monkeypatch.setattr("benchmarks.figures.main", lambda: calls.append("first"), raising=False)
    monkeypatch.setattr("benchmarks.lab_tables.main", lambda: calls.append("tables"))
    assert main(["all"]) == 1  # memory has no main()
    assert calls == ["first", "tables"]
    report = json.loads((tmp_path / "bench_all.json").read_text(encoding="utf-8"))["figures"]
    assert report["bench_all.failed"] == ["second"]
    assert report["bench_all.minutes"] == 0.0


def test_an_unknown_bench_is_rejected_by_name(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["nothing"]) == 2
    assert "no bench 'nothing'; of demo" in capsys.readouterr().err
    assert main(["--list"]) == 0
    assert capsys.readouterr().out.split() == [*BENCHES]
