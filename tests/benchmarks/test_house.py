"""Figures about the code itself: they are gates, so their definitions are fixed here."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

from benchmarks import house
from benchmarks.house import (
    UNITS,
    count_tokens,
    docstrings,
    headings,
    import_cycles,
    long_functions,
    markers,
    shared_names,
    static_figures,
)


def test_the_figures_have_the_names_and_units_that_gates_read(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(house, "PACKAGES", ("workers",))
    figures = static_figures()
    measured = {"house.kinds", "house.coverage", "tests.minutes", "tests.coverage"}
    assert figures.keys() | measured == UNITS.keys()
    gates = (
        "code_lines", "tokens", "tokens_a_line", "long_functions", "shared_names", "glued",
        "docstrings", "cycles", "imports_per_100",
    )  # fmt: skip
    assert {f"house.{name}" for name in gates} <= figures.keys()


def test_comments_newlines_and_indents_are_no_tokens_and_a_docstring_is_one() -> None:
    assert count_tokens('def f():  # why\n    """One.\n\n    Two.\n    """\n\n    return 1\n') == 8


@pytest.mark.parametrize(("n_lines", "is_long"), [(80, False), (81, True)])
def test_a_function_of_more_than_80_lines_is_long(n_lines: int, is_long: bool) -> None:
    text = "class A:\n    def m(self):\n" + (n_lines - 1) * "        ...\n"
    assert long_functions(ast.parse(text)) == ([("m", 2)] if is_long else [])


def test_a_name_is_shared_if_three_files_define_a_function_of_it() -> None:
    text = "def _row(): ...\ndef {}(): ...\nclass A:\n    def _row(self): ..."
    trees = {Path(n): ast.parse(text.format(n)) for n in "abc"}
    assert shared_names(trees) == {"_row": [Path("a"), Path("b"), Path("c")]}
    assert shared_names(dict(list(trees.items())[:2])) == {}


def test_a_heading_is_a_comment_between_blank_lines_but_not_above_a_function() -> None:
    head = "\n".join(f"x{k} = {k}" for k in range(12))
    assert headings(f"{head}\n\n# A chapter.\n# It has two lines.\n\n\ndef f(): ...\n") == [
        (14, "# A chapter.")
    ]
    assert headings(f"{head}\n\n# Why f is as it is.\ndef f(): ...\n") == []


def test_docstrings_of_public_functions_and_methods_count_by_their_lines() -> None:
    text = 'def f():\n    """One."""\ndef _g(): ...\nclass A:\n    def m(self):\n        """One.\n\n        Two.\n        """\n'
    assert list(docstrings(ast.parse(text))) == [("f", False), ("A.m", True)]


def test_modules_that_import_one_another_are_one_cycle() -> None:
    assert import_cycles({"a": {"b"}, "b": {"c"}, "c": {"a"}, "d": {"a"}}) == 1
    assert import_cycles({"a": {"b"}, "b": {"c"}, "c": set()}) == 0


def test_the_markers_of_make_test_are_read_from_the_makefile() -> None:
    assert markers("QUICK").startswith("not long and not slow")
    assert "$(" not in markers("QUICK") + markers("REST")
