"""Numbers as a command line names them: `7`, `1..20`, `1,4,7..9`. No effects."""

from __future__ import annotations

from typing import Final

_MAX_DIGITS: Final = 40  # of a number; more is no number that anybody means


def ends_of(word: str) -> tuple[str, str]:
    """Both ends of a range as text, unchecked: `1..20` -> ("1", "20"), `7` -> ("7", "7")."""
    first, dots, last = word.partition("..")
    return (first, last) if dots else (first, first)


def range_of(word: str) -> tuple[int, int] | None:
    """Both ends of a range of whole numbers, the first maybe above the last; None for any other word.

    range_of("1..20") == (1, 20)
    range_of("7") == (7, 7)
    range_of("1..") is None
    """
    ends = ends_of(word)
    if not all(end.isascii() and end.isdigit() and len(end) <= _MAX_DIGITS for end in ends):
        return None
    first, last = ends
    return int(first), int(last)


def seeds_of(words: str, *, least: int, max_seeds: int) -> tuple[int, ...]:
    """The seeds that words with commas between name, each once, in their order.

    least: the smallest seed there is. max_seeds: of each range. Raises ValueError, which says what
    was expected.

        seeds_of("1..3,9,2", least=1, max_seeds=100) == (1, 2, 3, 9)
    """
    # A dict keeps the order in which seeds are named.
    seeds: dict[int, None] = {}
    for word in words.split(","):
        ends = range_of(word)
        if ends is None or ends[1] >= 10**9:
            raise ValueError("expected a seed, or seeds")
        low, high = ends
        if not least <= low <= high < low + max_seeds:
            raise ValueError(f"expected 1 to {max_seeds} seeds from {least} on, ascending")
        seeds |= dict.fromkeys(range(low, high + 1))
    return tuple(seeds)
