"""NYU40 class and kind of a piece of furniture, from its catalogue id, else from its name's words.

Reads the tables beside this file (classes of the default catalogue; words), nothing else.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from typing import Final

from pbrs_farm.core.classes import NYU40_NAMES
from pbrs_farm.core.house import ItemKind

_PRIMITIVES: Final = frozenset(
    {"eTeks#texturableBox", "eTeks#texturableCylinder", "eTeks#texturableTriangle"}
)
_PRIMITIVE_NAMES: Final = frozenset({"box", "cylinder", "triangle", ""})
# What follows these words describes the thing; the thing itself is named before them.
_ASIDE: Final = frozenset({"with", "and", "on", "of", "for", "from", "under", "without", "in"})

_PLANT: Final = "plant"
_STAIRS: Final = "stairs"


def _rows(name: str) -> list[dict[str, str]]:
    text = files("pbrs_farm.read.common").joinpath(name).read_text("utf-8")
    return list(csv.DictReader(text.splitlines()))


@cache
def _catalogue() -> Mapping[str, int]:
    return {r["catalogId"]: NYU40_NAMES.index(r["class"]) for r in _rows("sweethome3d-classes.csv")}


@cache
def _vocabulary() -> Mapping[str, str]:
    return {phrase: r["class"] for r in _rows("words.csv") for phrase in r["words"].split("|")}


def words_of(text: str) -> frozenset[str]:
    """Lower-case words of a name; camelCase and digits part words; a plural adds its singular."""
    words = re.findall(r"[a-z]+", _parted(text))
    return frozenset(words) | {w[:-1] for w in words if len(w) > 3 and w.endswith("s")}


def _parted(name: str) -> str:
    return re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name).lower()


def _class_of(name: str) -> str | None:
    # The class or kind that the name's last known word (or two) before an aside stands for.
    # Look before an aside first ("lamp with table" is a lamp), then behind it.
    words = re.findall(r"\d+|[^\W\d_]+", _parted(name))
    aside = next((k for k, w in enumerate(words) if k and (w in _ASIDE or w.isdigit())), len(words))
    return _last_known(words[:aside]) or _last_known(words[aside:])


def _last_known(words: list[str]) -> str | None:
    known = _vocabulary()
    # The last known word says what the thing is; two words go before one.
    for k in range(len(words) - 1, -1, -1):
        for phrase in (" ".join(words[k - 1 : k + 1]) if k else "", words[k]):
            singular = phrase[: -2 if phrase.endswith(("shes", "ches", "xes", "sses")) else -1]
            for form in (phrase, singular if phrase.endswith("s") else phrase):
                if form in known:
                    return known[form]
    return None


def _label_of(name: str) -> int | None:
    found = _class_of(name)
    if found is None:
        return None
    stands_for = {_PLANT: "otherprop", _STAIRS: "otherstructure"}
    return NYU40_NAMES.index(stands_for.get(found, found))


def nyu40_of(catalogue_id: str, name: str, group: str = "") -> int | None:
    """NYU40 id by catalogue id, else by the words of the name, else of the id; None = unmapped.

    A bare box, cylinder or triangle is what its name says, or its group's: people build with them.
    """
    known = _catalogue().get(catalogue_id)
    if catalogue_id in _PRIMITIVES:
        own = name if name.lower() not in _PRIMITIVE_NAMES else group
        return _label_of(own) or known
    if known is not None:
        return known
    return _label_of(name) or _label_of(catalogue_id.partition("#")[2])


def kind_of(
    catalogue_id: str, name: str, nyu40: int, *, is_opening: bool, is_light: bool
) -> ItemKind:
    """What the piece is to the pipeline: the source's own element first, then class, then words."""
    if is_opening:
        return ItemKind.WINDOW if nyu40 == NYU40_NAMES.index("window") else ItemKind.DOOR
    if is_light:
        return ItemKind.LAMP
    if nyu40 == NYU40_NAMES.index("person"):
        return ItemKind.PERSON
    found = _class_of(name) or _class_of(catalogue_id.partition("#")[2])
    if catalogue_id in _catalogue():
        found = _class_of(catalogue_id.partition("#")[2]) or found
    if found == _STAIRS:
        return ItemKind.STAIRS
    if found == _PLANT:
        return ItemKind.PLANT
    return ItemKind.OBJECT
