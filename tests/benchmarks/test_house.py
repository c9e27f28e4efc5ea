"""What the bench of the code itself counts."""

from __future__ import annotations

import ast

from benchmarks.house import (
    import_cycles,
    line_kinds,
    single_importers,
    twice_named,
    untyped_functions,
)


def test_every_line_counts_once_by_what_it_is() -> None:
    text = '"""One.\n\nTwo."""\n\nimport a\nfrom b import (\n    c,\n)\n\n# why\nx = "#"  # how\n'
    kinds = line_kinds(text)
    assert kinds == {
        "lines_of_docstrings": 2,
        "lines_blank": 3,
        "lines_of_imports": 4,
        "lines_of_comments": 1,
        "lines_of_statements": 1,
    }
    assert sum(kinds.values()) == len(text.splitlines())


def test_a_module_with_one_importer_counts_where_both_share_a_folder() -> None:
    imports = {"p.a": {"p.b", "p.c", "q.d"}, "p.b": {"p.c"}, "p.c": set(), "q.d": set()}
    assert single_importers(imports) == ["p.b"]


def test_modules_that_import_one_another_are_one_cycle() -> None:
    assert import_cycles({"a": {"b"}, "b": {"c"}, "c": {"a"}, "d": {"a"}}) == 1
    assert import_cycles({"a": {"b"}, "b": {"c"}, "c": set()}) == 0


def test_classes_of_one_name_in_two_modules_count_once() -> None:
    one, other = ast.parse("class Plan: ...\nclass Wall: ..."), ast.parse("class Plan: ...")
    assert twice_named([one, other]) == ["Plan"]


def test_a_function_without_an_annotation_counts() -> None:
    text = "class A:\n    def f(self, x: int) -> int: ...\n    def g(self, x) -> int: ...\ndef h(): ..."
    assert untyped_functions(ast.parse(text)) == 2
