"""Tables of the lab book: filled from reports, unchanged if a figure is missing, listed per page."""

from __future__ import annotations

import json
import re
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest

from benchmarks import lab_tables
from benchmarks.__main__ import BENCHES
from benchmarks.lab_tables import ROWS, TABLES, LabRow, filled, written_tables
from benchmarks.manual_pages import REPO
from pbrs_farm.core.record import read_csv

ROWS_OF_BOOK = read_csv(ROWS, LabRow)
_BLOCK = re.compile(r"<!-- bench:(\w+) -->\n(.*?)<!-- /bench -->", re.DOTALL)
_NAME = re.compile(r"\{([\w.]+)")


def _report(
    folder: Path, bench: str, figures: dict[str, object], commit: str = "abcdef012345"
) -> None:
    machine = {"cores": 2, "cpu": "a Xeon", "load_1min": 0.51}
    text = json.dumps({"figures": figures, "machine": machine, "commit": commit})
    (folder / f"{bench}.json").write_text(text)


@pytest.fixture
def page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A page of a lab book with a table `ours` of two benches."""
    rows = [
        LabRow(table="ours", what="what", cells=("value",), wanted="wanted"),
        LabRow(table="ours", what="a view", cells=("{one.s:.1f} s",), wanted="5 s", bench="one"),
        LabRow(table="ours", what="the same", cells=("{two.same:yes}",), bench="two"),
    ]
    monkeypatch.setattr(lab_tables, "TABLES", {"ours": lab_tables.simple_table(rows)})
    page = tmp_path / "docs/lab/some.md"
    page.parent.mkdir(parents=True)
    page.write_text("# Page\n\n<!-- bench:ours -->\nbefore\n<!-- /bench -->\n\nafter\n")
    return page


def test_a_cell_combines_figures_divisions_and_yes_or_no() -> None:
    figures = {"a.mb": 1234, "a.same": 0, "a.names": "x, y"}
    assert filled("{a.mb:,} of {a.mb/1000:.1f}", figures) == "1,234 of 1.2"
    assert filled("{a.same:yes}; {a.names}", figures) == "no; x, y"
    with pytest.raises(KeyError, match=r"a\.other"):
        filled("{a.other:.1f}", figures)


def test_a_table_is_written_with_command_commit_machine_and_load(
    page: Path, tmp_path: Path
) -> None:
    _report(tmp_path, "one", {"one.s": 6.84})
    _report(tmp_path, "two", {"two.same": 1})
    assert written_tables(tmp_path / "docs", tmp_path) == [f"{page}: ours written"]
    head = "*`python -m benchmarks one two` (abcdef0: 2 cores of a Xeon, load 0.5, 0.5, the bench's own included).*"
    table = (
        "| what | value | wanted |\n|---|---|---|\n| a view | 6.8 s | 5 s |\n| the same | yes |  |"
    )
    text = page.read_text()
    assert (
        text == f"# Page\n\n<!-- bench:ours -->\n\n{table}\n\n{head}\n\n<!-- /bench -->\n\nafter\n"
    )
    written_tables(tmp_path / "docs", tmp_path)
    assert page.read_text() == text


def test_a_table_outside_the_lab_book_links_the_page_of_its_bench(
    page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(lab_tables.TABLES, "one", lab_tables.TABLES["ours"])
    page.with_name("other.md").write_text("<!-- bench:one -->\n<!-- /bench -->\n")
    outside = page.parent.with_name("guide.md")
    outside.write_text("<!-- bench:ours -->\n<!-- /bench -->\n")
    _report(tmp_path, "one", {"one.s": 6.84})
    _report(tmp_path, "two", {"two.same": 1})
    written_tables(tmp_path / "docs", tmp_path)
    assert "commit and machine: the [lab book](lab/other.md)" in outside.read_text()


def test_tables_of_two_commits_are_reported(page: Path, tmp_path: Path) -> None:
    _report(tmp_path, "one", {"one.s": 6.84})
    _report(tmp_path, "two", {"two.same": 1}, "0123456789ab")
    assert "tables are of 2 commits" in written_tables(tmp_path / "docs", tmp_path)[-1]


def test_a_table_without_its_report_or_a_figure_stays_and_is_named(
    page: Path, tmp_path: Path
) -> None:
    before = page.read_text()
    _report(tmp_path, "one", {"one.s": 6.84})
    (said,) = written_tables(tmp_path / "docs", tmp_path)
    assert "ours is unchanged: there is no " in said
    assert said.endswith("(python -m benchmarks one two)")
    _report(tmp_path, "two", {})
    (line,) = written_tables(tmp_path / "docs", tmp_path)
    assert "no figure two.same" in line
    # A bench without figures, or killed while writing, leaves the others' tables unchanged.
    _report(tmp_path, "two", {"two.same": 1})
    _report(tmp_path, "one", {"one.s": None})
    (line,) = written_tables(tmp_path / "docs", tmp_path)
    assert "one, two: a figure that does not fit its row: " in line
    (tmp_path / "one.json").write_text('{"figures": {')
    (line,) = written_tables(tmp_path / "docs", tmp_path)
    assert "one.json is damaged" in line
    assert page.read_text() == before


def test_a_mark_that_is_no_table_is_told(page: Path, tmp_path: Path) -> None:
    page.write_text("<!-- bench:other -->\n<!-- /bench -->\n")
    with pytest.raises(ValueError, match="no table 'other'"):
        written_tables(tmp_path / "docs", tmp_path)


def test_each_simple_table_is_once_in_the_docs_with_its_rows() -> None:
    """The first cells of the table are on the page, whoever wrote it, so that figures elsewhere find them."""
    text = "\n".join(p.read_text("utf-8") for p in (REPO / "docs").rglob("*.md"))
    blocks = _BLOCK.findall(text)
    simple = {row.table for row in ROWS_OF_BOOK}
    assert sorted(name for name, _ in blocks if name in simple) == sorted(simple)
    for name, body in blocks:
        assert name in TABLES
        if name in simple:
            rows = [line.split(" | ") for line in body.splitlines() if line.startswith("| ")]
            table_rows = [row for row in ROWS_OF_BOOK if row.table == name]
            assert [row[0] for row in rows] == [f"| {row.what}" for row in table_rows], name
            assert len({len(row) for row in rows}) == 1, name
            assert "*`python -m benchmarks" in body, name


def _rows_of_benches() -> list[Any]:
    """Each row of the book that a bench writes; the bench "study" imports torch, so its rows are the study's tests."""
    return [
        pytest.param(row, id=row.what, marks=[pytest.mark.study] * (row.bench == "study"))
        for row in ROWS_OF_BOOK
        if row.bench
    ]


@pytest.mark.parametrize("row", _rows_of_benches())
def test_the_figures_of_a_row_are_some_that_its_bench_writes(row: LabRow) -> None:
    """Each is in the module's UNITS; without that table the name or its end is quoted in the module."""
    name = f"benchmarks.{BENCHES[row.bench].module}"
    units = getattr(import_module(name), "UNITS", None)
    source = Path(find_spec(name).origin).read_text("utf-8")
    figures = [figure for cell in row.cells for figure in _NAME.findall(cell)]
    assert figures
    for figure in figures:
        end = figure.partition(".")[2]
        assert figure in units if units else f'"{figure}"' in source or f'"{end}"' in source, figure
