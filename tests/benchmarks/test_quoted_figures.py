"""A figure on a page outside the lab book is a number of the lab book's line that it names."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks.manual_pages import REPO, manual_pages
from benchmarks.quoted_figures import faults_of_pages, stale
from benchmarks.renderers.cycles import HOMES
from benchmarks.renderers.cycles_tables import compare_lines, cycles_lines

LAB = """# Lab book: views

## A run
| what | value |
|---|---|
| a `fast` view of 640x480 | 6.8 s (6.5 to 7.9 s at load 2) |
| furniture | 118.6 MB |

A home of 118 views takes 0.83 of it.

## On a GPU
| a `fast` view of 640x480 | 1.3 s |
"""
FAST = "<!-- figure: views.md#a-run: a `fast` view -->"


@pytest.fixture
def lab(tmp_path: Path) -> Path:
    (tmp_path / "views.md").write_text(LAB)
    return tmp_path


def test_every_figure_of_every_page_is_in_the_lab_book() -> None:
    assert len(manual_pages(REPO)) > 70
    assert faults_of_pages() == []


@pytest.mark.parametrize(
    "line",
    [
        f"| a view | 6.8 s {FAST} |",
        f"| a view | 6 to 8 s {FAST} |",
        f"some 7 seconds, `--time-budget 30 s` {FAST}",
        "120 MB of furniture <!-- figure: views.md: furniture -->",
        "0.8 of it, at 118 views <!-- figure: views.md#a-run: A home of -->",
        "on a GPU 1.3 s <!-- figure: views.md#on-a-gpu: a `fast` view -->",
        "a step of 5 cm, 20 times, a share of 30 %, 640x480, version 5.0.1",
        "```sh\nsleep 30 s\n```",
        "a limit of 45 s",
    ],
)
def test_figures_of_the_lab_book_and_unmeasured_numbers_are_no_fault(lab: Path, line: str) -> None:
    assert list(stale(line, {"45 s"}, lab)) == []


@pytest.mark.parametrize(
    ("line", "told"),
    [
        ("a view takes 6.8 s", "'6.8 s'"),
        ("2,755 views/h", "'2,755 views/h'"),
        ("5 % more CPU", "'5 %'"),
        ("twice, or 2.5 times the time", "'2.5 times the'"),
        (f"| a view | 6.9 s {FAST} |", "'6.9 s'"),
        (f"| a view | 6 to 9 s {FAST} |", "'6 to 9 s'"),
        (f"| a view | 1.3 s {FAST} |", "'1.3 s'"),
        ("130 MB <!-- figure: views.md: furniture -->", "'130 MB'"),
        ("0.9 of it <!-- figure: views.md: A home of -->", "'0.9'"),
        ("83 % of it <!-- figure: views.md: A home of -->", "'83 %'"),
        ("of a chair <!-- figure: views.md: chair -->", "no row or line 'chair'"),
        ("of a sofa <!-- figure: sofas.md: sofa -->", "docs/lab/sofas.md has no row"),
    ],
)
def test_a_figure_missing_in_the_lab_book_is_reported_with_its_line(
    lab: Path, line: str, told: str
) -> None:
    ((number, text),) = stale(f"# Page\n\n{line}\n", set(), lab)
    assert number == 3
    assert told in text


def test_the_table_of_other_renderers_names_rows_of_the_lab_book_that_have_its_figures(
    tmp_path: Path,
) -> None:
    figures = {"light.cycles_luminance_apart": 0.012}
    for end, value in (("", 4.25), ("_median", 3.5), ("_metropolis", 18.0)):
        for quantile, times in (("", 1.0), ("_q1", 0.5), ("_q3", 2.0)):
            figures[f"light.vs_cycles{end}{quantile}"] = times * value
    for view in (f"{home.lower()}_{k}" for home in HOMES for k in (0, 1)):
        of_view = {"ours": 0.1, "theirs": 0.4, "ratio": 4.0, "ratio_median": 2.5,
                   "ratio_metropolis": 7.0, "luminance": 0.99, "portals": 1.0}  # fmt: skip
        figures |= {f"light.cycles_{view}_{name}": value for name, value in of_view.items()}
    (tmp_path / "light.md").write_text("\n".join(["## Against Cycles", *cycles_lines(figures)]))
    lines = compare_lines(figures)
    assert sum("<!-- figure: " in line for line in lines) == 4
    assert "4.2 (2.1 to 8.5)" in lines[2]
    assert list(stale("\n".join(lines), set(), tmp_path)) == []
