"""Ranges of numbers on the command line."""

from __future__ import annotations

import pytest

from pbrs_farm.core.number_ranges import ends_of, range_of, seeds_of


@pytest.mark.parametrize(
    ("word", "ends"),
    [("7", (7, 7)), ("1..20", (1, 20)), ("9..2", (9, 2)), ("0", (0, 0)), ("1..", None), ("..2", None),
     ("", None), ("-1", None), ("1.5", None), ("1..2..3", None), ("٣", None), ("9" * 41, None)],
)  # fmt: skip
def test_a_word_is_a_number_or_two_with_dots_between(word, ends):
    assert range_of(word) == ends


def test_the_ends_of_a_range_are_text_if_they_are_no_whole_numbers():
    assert ends_of("0.5..1.2") == ("0.5", "1.2")
    assert ends_of("0.5") == ("0.5", "0.5")


def test_seeds_are_named_in_order_and_once():
    assert seeds_of("1..3,9,2", least=1, max_seeds=10) == (1, 2, 3, 9)


@pytest.mark.parametrize("words", ["", "x", "0", "4..2", "1..11", "1,", "9" * 10])
def test_an_invalid_range_of_seeds_explains_the_syntax(words):
    with pytest.raises(ValueError, match="expected"):
        seeds_of(words, least=1, max_seeds=10)
