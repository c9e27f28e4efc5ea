"""Group of a library's piece, by name, category and size. Reads the tables beside it.

groups.csv: words of names and the size range of each group. exceptions.csv: reviewed pieces of
the packages that belong to another group, face another way, or are left out, each with its reason.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Final

from pbrs_farm.core.catalogue import Place
from pbrs_farm.core.classes import NYU40_NAMES
from pbrs_farm.core.house import ItemKind
from pbrs_farm.read.common.furniture_classes import (
    class_of_piece,
    plain,
    rows_of_table,
    words_of_list,
)

Size = tuple[float, float, float]  # width, depth, height in metres

_ASIDE: Final = frozenset(["with", "and", "on", "of", "for", "from", "under", "without", "in"])
_LONGEST_PHRASE: Final = 5  # words
_LAMP: Final = "lamp"


@dataclass(frozen=True, slots=True)
class GroupRule:
    """A row of groups.csv: a group, and what fits it. Lengths in metres."""

    group: str
    place: Place
    nyu40: int
    category: str  # "" = any
    side: tuple[float, float]  # of the longer horizontal side
    height: tuple[float, float]
    words: tuple[str, ...]

    @property
    def kind(self) -> ItemKind:
        """Item kind of this group."""
        if self.place is Place.OPENING:
            return ItemKind.DOOR if self.group == "door" else ItemKind.WINDOW
        if self.group == "plant":
            return ItemKind.PLANT
        return ItemKind.LAMP if NYU40_NAMES[self.nyu40] == _LAMP else ItemKind.OBJECT

    def fits(self, category: str, size: Size) -> bool:
        """True if an item of that size and category may belong to this group.

        category: of the library, "" = unknown, which always fits; size: width, depth, height in metres. On
        a wall the side is the larger of the width and the smaller of depth and height.
        """
        width, depth, height = size
        side = max(width, height if self.place is Place.WALL and height < depth else depth)
        is_of_category = not self.category or self.category in plain(category).split()
        in_range = self.side[0] <= side <= self.side[1]
        return is_of_category and in_range and self.height[0] <= height <= self.height[1]


@dataclass(frozen=True, slots=True)
class PieceVerdict:
    """Result of a review of a piece: its group ("" = left out), its rotation, and the reason."""

    group: str
    turn_deg: float
    reason: str


def group_rule(
    name: str, category: str, size: Size, *, inner: str = "", group: str = ""
) -> GroupRule | None:
    """The rule of the group that a piece belongs to, or None: it is nothing to dress with.

    inner: its id in the library, which is asked where the name says nothing. group: a group or a
    class named by the user, which goes before the words; the size still decides between rules.
    """
    if group:
        named = [r for r in group_rules() if r.group == group] or _rules_of(group)
        return next((r for r in named if r.fits("", size)), named[0] if named else None)
    if words_of_list("outdoors") & set(plain(category).split()):
        return None
    for text in (name, inner):
        rule = _rule_by_words(text, category, size)
        if rule is not None:
            return rule
    # Look up the name's class in the multilingual vocabulary.
    by_word = class_of_piece("", name).nyu40
    return _rule_by_words(NYU40_NAMES[by_word], category, size) if by_word else None


@cache
def group_rules() -> tuple[GroupRule, ...]:
    """The rows of groups.csv in their order."""
    return tuple(
        GroupRule(
            r["group"],
            Place(r["place"]),
            NYU40_NAMES.index(r["nyu40"]),
            r["category"],
            _range(r["side_cm"]),
            _range(r["height_cm"]),
            tuple(r["words"].split("|")),
        )
        for r in rows_of_table("groups.csv", "catalogue")
    )


@cache
def piece_verdicts() -> Mapping[str, PieceVerdict]:
    """Rows of exceptions.csv by piece id (`<library>#<id>`)."""
    return {
        r["id"]: PieceVerdict(r["group"], float(r["turn_deg"] or 0), r["reason"])
        for r in rows_of_table("exceptions.csv", "catalogue")
    }


def _range(text: str) -> tuple[float, float]:
    low, high = text.split("-")
    return float(low) / 100, float(high) / 100


def _words_of_rule(text: str) -> list[str]:
    # Whole words without accents, plurals made singular, "12-oz" parted; numbers are left out.
    words = re.findall(r"[a-z]+|&", plain(text))
    return [w[:-1] if len(w) > 3 and w.endswith("s") and not w.endswith("ss") else w for w in words]


@cache
def _by_phrase() -> Mapping[str, tuple[GroupRule, ...]]:
    rules_of: dict[str, list[GroupRule]] = {}
    for rule in group_rules():
        for phrase in rule.words:
            rules_of.setdefault(" ".join(_words_of_rule(phrase)), []).append(rule)
    return {phrase: tuple(rules) for phrase, rules in rules_of.items()}


def _rules_of(phrase: str) -> list[GroupRule]:
    return list(_by_phrase().get(" ".join(_words_of_rule(phrase)), ()))


def _rule_by_words(text: str, category: str, size: Size) -> GroupRule | None:
    for phrase in _phrases(_words_of_rule(text)):
        for rule in _by_phrase().get(phrase, ()):
            if rule.fits(category, size):
                return rule
    return None


def _phrases(words: list[str]) -> Iterator[str]:
    # The whole name first; then the part before a preposition, its last words first.
    yield " ".join(words)
    aside = next((k for k, w in enumerate(words) if k and w in _ASIDE), len(words))
    for part in (words[:aside], words[aside:]):
        for end in range(len(part), 0, -1):
            for start in range(max(0, end - _LONGEST_PHRASE), end):
                yield " ".join(part[start:end])
