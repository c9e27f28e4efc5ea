"""What the bench of the code itself counts."""

from __future__ import annotations

from benchmarks.house import commented_lines, function_lengths


def test_comments_count_by_line_and_pragmas_do_not() -> None:
    text = 'x = 1  # metres\n# Sum the rest.\n# noqa\ny = 2  # type: ignore\nz = "# no"\n'
    assert commented_lines(text) == 2


def test_a_function_is_as_long_as_its_lines() -> None:
    text = "def a():\n    return 1\n\nclass B:\n    def c(self):\n\n        return 2\n"
    assert sorted(function_lengths(text)) == [2, 3]
