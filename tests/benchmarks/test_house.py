"""What the figures of the code itself count: their names are gates, so what they mean is fixed here."""

from __future__ import annotations

import ast
from pathlib import Path

from benchmarks.house import (
    UNITS,
    docstrings,
    headings,
    import_cycles,
    shared_names,
    static_figures,
)


def test_the_figures_have_the_names_and_units_that_gates_read() -> None:
    found = static_figures()
    assert found.keys() | {"house.kinds", "house.coverage"} == UNITS.keys()
    gates = ("code_lines", "shared_names", "glued", "docstrings", "cycles", "imports_per_100")
    assert {f"house.{name}" for name in gates} <= found.keys()


def test_a_name_is_shared_where_three_files_define_a_function_of_it() -> None:
    text = "def _row(): ...\ndef {}(): ...\nclass A:\n    def _row(self): ..."
    trees = {Path(n): ast.parse(text.format(n)) for n in "abc"}
    assert shared_names(trees) == {"_row": [Path("a"), Path("b"), Path("c")]}
    assert shared_names(dict(list(trees.items())[:2])) == {}


def test_a_heading_is_a_comment_between_blank_lines_and_one_above_a_function_is_none() -> None:
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
