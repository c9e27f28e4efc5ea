"""Nouns for the items of a view in plain English, counted and listed; no effects."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any, Final

from pbrs_farm.export.chosen_view import ChosenView

# NYU40 classes with uncountable or plural names -> countable nouns.
_COUNTED: Final = {
    "shelves": "set of shelves",
    "blinds": "blind",
    "books": "row of books",
    "clothes": "piece of clothing",
    "floor mat": "rug",
    "paper": "sheet of paper",
    "night stand": "nightstand",
}

# Unspecific classes -> nouns for items whose name does not help.
_VAGUE: Final = {
    "otherprop": "object",
    "otherfurniture": "piece of furniture",
    "otherstructure": "part of the building",
    "none": "",
}
# Classes with members of other common names: class -> word in the item's name -> noun.
_OWN_WORDS: Final = {
    "bag": {word: word for word in ("suitcase", "backpack")},
    "bed": {word: word for word in ("crib", "duvet", "mattress")},
    "box": {word: word for word in ("basket", "crate")},
    "cabinet": {"wardrobe": "wardrobe"},
    "chair": {word: word for word in ("armchair", "bench", "stool", "ottoman", "pouf")},
    "curtain": {"curtains": "set of curtains"},
    "lamp": {word: word for word in ("candle", "candlestick")},
    "television": {"monitor": "monitor"},
    "towel": {"towels": "stack of towels"},
}
_NOUNS_OF_KINDS: Final = {"plant": "plant", "stairs": "staircase", "person": "person"}
_PLAIN_NAME: Final = re.compile(r"[A-Za-z]{2,12}(?: [A-Za-z]{2,12})?")
_PLURALS: Final = {"person": "people", "bookshelf": "bookshelves", "shelf": "shelves"}
# fmt: off
_NUMBERS: Final = (
    "no", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten", "eleven",
    "twelve",
)
# fmt: on


def noun_of(view: ChosenView, row: dict[str, Any]) -> str:
    """Noun for an item; "" for an item without a class.

    row: an instance of the view's facts. Where NYU40's class is unspecific, as otherprop, the noun is the
    item's kind or short name; a bench of the class chair is a bench.
    """
    if view.choice.classes is not None:
        return str(row["own_class_name"])
    name = str(row["class"])
    if name not in _VAGUE:
        words = str(row["name"]).lower().split()
        matches = (noun for word, noun in _OWN_WORDS.get(name, {}).items() if word in words)
        return next(matches, _COUNTED.get(name, name))
    if row["kind"] in _NOUNS_OF_KINDS:
        return _NOUNS_OF_KINDS[row["kind"]]
    # An item of an unspecific class is called by its name if that has one or two words.
    item_name = str(row["name"]).strip(" 0123456789")
    return item_name.lower() if _VAGUE[name] and _PLAIN_NAME.fullmatch(item_name) else _VAGUE[name]


def is_plural(noun: str) -> bool:
    """True if the noun is already a plural, as an item's name may be.

    >>> [is_plural(noun) for noun in ("plates", "glass", "set of shelves")]
    [True, False, False]
    """
    head = noun.partition(" of ")[0]
    return head.endswith("s") and not head.endswith(("ss", "us"))


def plural(noun: str) -> str:
    """Plural of a noun: "chairs", "boxes", "sets of shelves", "people".

    English, for the nouns that captions use; only the last word before "of" changes.
    """
    if is_plural(noun):
        return noun
    head, of, rest = noun.partition(" of ")
    first, space, last = head.rpartition(" ")
    if last in _PLURALS:
        last = _PLURALS[last]
    elif re.search(r"(s|x|ch|sh)$", last):
        last += "es"
    elif re.search(r"[^aeiou]y$", last):
        last = f"{last[:-1]}ies"
    else:
        last += "s"
    return f"{first}{space}{last}{of}{rest}"


def counted(n: int, noun: str) -> str:
    """A number and a noun in words.

    >>> [counted(n, "armchair") for n in (1, 3)]
    ['an armchair', 'three armchairs']
    >>> counted(2, "plates")
    'some plates'
    """
    if is_plural(noun):
        return f"some {noun}"
    if n == 1:
        return f"{'an' if noun[:1].lower() in 'aeiou' else 'a'} {noun}"
    return f"{_NUMBERS[n] if n < len(_NUMBERS) else n} {plural(noun)}"


def listed(words: Sequence[str]) -> str:
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"
