"""What a mistyped word may have meant; pure."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import SequenceMatcher, get_close_matches
from typing import Final

_LEAST_LIKENESS: Final = 0.6  # difflib's ratio of letters that two words share
_MOST: Final = 2  # names that are offered
_AS_LIKELY: Final = 0.05  # of likeness: a second name is offered where it is nearly as near


def near_names(word: str, known: Iterable[str]) -> list[str]:
    """The known names most like the word, case apart, the likeliest first; none when none is."""
    plain = {name.lower(): name for name in known}
    word = word[:100].lower()
    found = get_close_matches(word, plain, n=_MOST, cutoff=_LEAST_LIKENESS)
    likeness = [SequenceMatcher(None, name, word).ratio() for name in found]
    return [plain[n] for n, x in zip(found, likeness) if x >= likeness[0] - _AS_LIKELY]


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """ "did you mean A or B?" for the hint of an error; "" when no name is near."""
    return question(near_names(word, known))


def question(names: list[str]) -> str:
    """ "did you mean A or B?" of these names; "" of none."""
    return f"did you mean {' or '.join(names)}?" if names else ""


def hint_of_choice(word: str, known: Iterable[str]) -> str:
    """ "did you mean A? of A, B, C": for a word out of a short list."""
    names = list(known)
    return " ".join(x for x in (did_you_mean(word, names), f"of {', '.join(names)}") if x)
