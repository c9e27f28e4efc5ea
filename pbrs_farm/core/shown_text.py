"""Clean foreign strings before they are shown or drawn; no effects.

Names, files, places and messages pass through here on their way to a console, a report, a picture or an
error: one line stays one line, no control character reaches the screen, and 100 kB are cut.
"""

from __future__ import annotations

import unicodedata
from collections.abc import Iterable
from difflib import SequenceMatcher, get_close_matches
from typing import Final

MAX_NAME: Final = 80
"""Maximum length of a name (a room, an item, an entry)."""

MAX_PLACE: Final = 120
"""Characters of a place inside a file, or of a path's end."""

MAX_MESSAGE: Final = 600
"""Characters of a whole message."""

MANY_NAMES: Final = 16
"""A list of more names is shown only where no near one is known."""

_MAX_MARKS: Final = 3  # combining marks on one letter: more run over the lines above and below
_JOINERS: Final = "\u200c\u200d\ufe0f"  # format characters that scripts and pictographs need
_UNSAFE: Final = frozenset({"Cc", "Cf", "Cs", "Co", "Cn", "Zl", "Zp"})
"""Categories that steer a terminal, turn the direction of text, end a line, or are no character."""


def shown(text: object, most: int = MAX_NAME) -> str:
    """One printable line of at most `most` characters: others become spaces, long text loses its middle."""
    plain = str(text)
    # Cut first, so that a name of megabytes costs nothing; cleaning makes no text longer.
    if len(plain) > most:
        n_end = most // 4
        plain = f"{plain[: most - n_end - 3]}...{plain[len(plain) - n_end :]}"
    return _cleaned(plain).strip()


def printable(text: str) -> str:
    """Text of many lines in which control characters became spaces; line ends and length stay."""
    return "\n".join(_cleaned(line) for line in text.split("\n"))


def escaped(json_text: str) -> str:
    """JSON with the characters that `shown` removes, but line ends, escaped (as \\uXXXX): nothing is lost."""
    if json_text.isascii():
        return json_text
    return "".join(_escape(c) if _is_unsafe(c) and c != "\n" else c for c in json_text)


def _cleaned(line: str) -> str:
    if line.isascii() and line.isprintable():
        return line
    characters, n_marks = [], 0
    for c in line:
        n_marks = n_marks + 1 if unicodedata.combining(c) else 0
        if n_marks <= _MAX_MARKS:
            characters.append(" " if _is_unsafe(c) else c)
    return "".join(characters)


def _is_unsafe(c: str) -> bool:
    return unicodedata.category(c) in _UNSAFE and c not in _JOINERS


def _escape(c: str) -> str:
    units = c.encode("utf-16-be", "surrogatepass")
    return "".join(f"\\u{units[i : i + 2].hex()}" for i in range(0, len(units), 2))


_LEAST_LIKENESS: Final = 0.6  # difflib's ratio of letters that two words share
_MOST: Final = 2  # maximum number of suggestions
_AS_LIKELY: Final = 0.05  # of likeness: a second name is offered where it is nearly as near


def near_names(word: str, known: Iterable[str]) -> list[str]:
    """The known names most like the word's first 100 characters in any case, the likeliest first."""
    plain = {name.lower(): name for name in known}
    word = word[:100].lower()
    matches = get_close_matches(word, plain, n=_MOST, cutoff=_LEAST_LIKENESS)
    likeness = [SequenceMatcher(None, name, word).ratio() for name in matches]
    return [plain[n] for n, x in zip(matches, likeness) if x >= likeness[0] - _AS_LIKELY]


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """ "did you mean A or B?" for the hint of an error; "" when no name is near."""
    return question(near_names(word, known))


def question(names: list[str]) -> str:
    """ "did you mean A or B?" of these names; "" for no name."""
    return f"did you mean {' or '.join(names)}?" if names else ""


def hint_of_choice(word: str, known: Iterable[str]) -> str:
    """ "did you mean A? of A, B, C"; of a long list only the near names, where there are some."""
    names = list(known)
    near, all_names = did_you_mean(word, names), f"of {', '.join(names)}"
    return near if near and len(names) > MANY_NAMES else f"{near} {all_names}".strip()
