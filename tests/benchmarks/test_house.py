"""What the bench of the code itself counts."""

from __future__ import annotations

from benchmarks.house import commented_lines, function_lengths, line_kinds


def test_comments_count_by_line_and_pragmas_do_not() -> None:
    text = 'x = 1  # metres\n# Sum the rest.\n# noqa\ny = 2  # type: ignore\nz = "# no"\n'
    assert commented_lines(text) == 2


def test_a_function_is_as_long_as_its_lines() -> None:
    text = "def a():\n    return 1\n\nclass B:\n    def c(self):\n\n        return 2\n"
    assert sorted(function_lengths(text)) == [2, 3]


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
