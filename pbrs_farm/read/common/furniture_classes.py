"""NYU40 class and kind of a piece of furniture, from its catalogue id, name, size and place.

Reads the tables beside this file (classes of the default catalogue; words), nothing else.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache, lru_cache
from importlib.resources import files
from typing import Final

from pbrs_farm.core.classes import NYU40_NAMES, PERSON, WINDOW
from pbrs_farm.core.house import ItemKind
from pbrs_farm.home.names import folded, parted

CLASS_TAG: Final = "class:"
"""Begins the tag of an item that names the rule which decided its class."""

_PRIMITIVES: Final = frozenset(
    {"eTeks#texturableBox", "eTeks#texturableCylinder", "eTeks#texturableTriangle"}
)
_PRIMITIVE_NAMES: Final = frozenset({"box", "cylinder", "triangle", ""})
# What follows these words describes the thing; the thing itself is named before them.
_ASIDES: Final = """with and on of for from under without in mit und auf fur von aus ohne avec et
    sur de du des pour en con para del della di da do dos sem sin senza per met voor van op для
    two three four five six"""
_ASIDE: Final = frozenset(_ASIDES.split())
_MODIFIERS: Final = frozenset({"wall", "kitchen"})  # say where an unknown thing stands
_HEAD_FIRST: Final = frozenset({"fr", "es", "it", "pt"})  # languages that name the thing first
_LONGEST_PHRASE: Final = 4  # words

_PLANT: Final = "plant"
_STAIRS: Final = "stairs"

# Least and largest longer horizontal side, least and largest height, in metres: what is smaller or
# larger is a toy, a tray, a heap or a mistake. A side of 0 is no bound.
_SIZES: Final[Mapping[str, tuple[float, float, float, float]]] = {
    "bathtub": (0.7, 6, 0.1, 1.8),
    "bed": (0.5, 5, 0.05, 3.2),
    "books": (0, 2, 0, 2),
    "bookshelf": (0.15, 10, 0.15, 4.5),
    "cabinet": (0.1, 10, 0.08, 4.5),
    "chair": (0.15, 2.8, 0.12, 2.2),
    "counter": (0.2, 12, 0, 2.2),
    "curtain": (0.1, 15, 0.15, 8),
    "desk": (0.65, 5, 0.3, 2.5),
    "door": (0.3, 8, 0.6, 6),
    "dresser": (0.2, 4, 0.15, 2.6),
    "floor mat": (0.2, 15, 0, 0.2),
    "mirror": (0.02, 8, 0, 5),
    "night stand": (0.15, 1.6, 0.15, 1.4),
    "person": (0.1, 3, 0.2, 2.6),
    "picture": (0.01, 10, 0, 6),
    "pillow": (0.1, 2.5, 0.02, 1.2),
    "refrigerator": (0.25, 3, 0.3, 2.8),
    "sink": (0.08, 4, 0.03, 2.6),
    "sofa": (0.5, 7, 0.15, 2),
    "table": (0.15, 10, 0.12, 1.8),
    "television": (0.12, 4, 0.1, 2.6),
    "toilet": (0.15, 1.4, 0.1, 2),
    "window": (0.1, 15, 0.1, 10),
}
# What stands on floors must be twice the least size where its bottom is at the height of a table
# or a shelf: a doll's bed.
_RAISED_M: Final = (0.6, 1.8)  # above the floor of the level
_LEAST_LAWN_M: Final = 1.0  # shorter side of grass that is ground
_FLATTEST_PLANT: Final = 0.1  # height over shorter side: what is flatter covers the ground
_STANDING: Final = frozenset({"bathtub", "bed", "chair", "desk", "sofa", "table", "toilet"})


@dataclass(frozen=True, slots=True)
class PieceSize:
    """How large a piece is and how high it stands, in metres."""

    width: float
    height: float
    depth: float
    bottom: float = 0.0  # above the floor of its level


@dataclass(frozen=True, slots=True)
class PieceClass:
    """What a piece of furniture is, and why.

    rule: catalogue, name (its last noun), inner-word (another word of the name), group, id; size =
    the words' class does not fit the piece's size or place; none = no word is known.
    """

    nyu40: int | None  # None = no class
    rule: str
    word: str = ""  # of the vocabulary: a class, plant or stairs

    @property
    def tag(self) -> str:
        """For Item.tags."""
        return CLASS_TAG + self.rule


def _rows_of_csv(name: str) -> list[dict[str, str]]:
    text = files("pbrs_farm.read.common").joinpath(name).read_text("utf-8")
    return list(csv.DictReader(text.splitlines()))


@cache
def _classes_of_catalogue_ids() -> Mapping[str, int]:
    return {
        r["catalogId"]: NYU40_NAMES.index(r["class"])
        for r in _rows_of_csv("sweethome3d-classes.csv")
    }


@cache
def _vocabulary() -> Mapping[str, tuple[str, bool]]:
    # Phrase -> class or kind, and whether its language names the thing first.
    # A phrase with "-" before it also ends compound words ("-tisch": Esstisch).
    return {
        plain(phrase): (r["class"], r["language"] in _HEAD_FIRST)
        for r in _rows_of_csv("words.csv")
        for phrase in r["words"].split("|")
    }


def plain(text: str) -> str:
    """Lower case without accents; camelCase parted by spaces."""
    return folded(parted(text))


_LONGEST_NAME: Final = 500  # letters that are looked at


@lru_cache(maxsize=4096)
def _candidates(name: str) -> tuple[tuple[str, bool], ...]:
    return tuple(_found_candidates(name))


def _found_candidates(name: str) -> Iterator[tuple[str, bool]]:
    # The classes or kinds that the words of a name stand for, likeliest first, and whether the
    # word is the name's noun. Words before an aside go first ("lamp with table" is a lamp).
    # A number that stands alone begins one, a number in a word ("chair01") means nothing.
    words = re.findall(r"(?<![^\W_])\d+|[^\W\d_]+", plain(name))
    aside = next((k for k, w in enumerate(words) if k and (w in _ASIDE or w.isdigit())), len(words))
    # A phrase from the first word may hold an aside: "table de nuit".
    for n in range(min(_LONGEST_PHRASE, len(words)), 1, -1):
        whole = _class_of_phrase(" ".join(words[:n]))
        if whole is not None and n > aside:
            yield whole[0], True
    yield from _from_the_noun(words[:aside], is_head=True)
    yield from _from_the_noun(words[aside:], is_head=False)


def _from_the_noun(words: list[str], *, is_head: bool) -> Iterator[tuple[str, bool]]:
    found: list[tuple[str, bool, bool]] = []
    k = len(words)
    # The last known word says what the thing is; more words go before one.
    while k > 0:
        for n in range(min(_LONGEST_PHRASE, k), 0, -1):
            known = _class_of_phrase(" ".join(words[k - n : k]))
            if known is not None and (k == len(words) or words[k - 1] not in _MODIFIERS):
                is_first = known[1] and k == n
                found.append((known[0], is_first or k == len(words), is_first))
                k -= n - 1
                break
        k -= 1
    # A language that names the thing first goes by its first word.
    for label, is_noun, _ in sorted(found, key=lambda f: not f[2]):
        yield label, is_noun and is_head


def _class_of_phrase(phrase: str) -> tuple[str, bool] | None:
    known = _vocabulary()
    singular = phrase[: -2 if phrase.endswith(("shes", "ches", "xes", "sses")) else -1]
    for form in (phrase, singular if phrase.endswith("s") else phrase):
        for entry in (form, "-" + form):
            if entry in known:
                return known[entry]
    # Try the ends of a compound word, longest first.
    for k in range(1, len(phrase) if " " not in phrase else 0):
        if "-" + phrase[k:] in known:
            return known["-" + phrase[k:]]
    return None


def is_a_cover_of_ground(width: float, height: float, depth: float) -> bool:
    """Whether a thing whose name is a plant's lies as grass does: wide and flat, metres."""
    side = min(width, depth)
    return side >= _LEAST_LAWN_M and height <= _FLATTEST_PLANT * side


def _fits_its_size(label: str, place: PieceSize | None) -> bool:
    if label == _PLANT and place is not None:
        return not is_a_cover_of_ground(place.width, place.height, place.depth)
    if place is None or label not in _SIZES:
        return True
    long_min, long_max, height_min, height_max = _SIZES[label]
    side = max(place.width, place.depth)
    if label in _STANDING and _RAISED_M[0] < place.bottom < _RAISED_M[1]:
        long_min *= 2
    if label in ("mirror", "picture"):  # it may lie: its longest side counts
        side = max(side, place.height)
    return long_min <= side <= long_max and height_min <= place.height <= height_max


def _by_words(name: str, place: PieceSize | None, rule: str) -> PieceClass:
    # The class of the first candidate that fits the piece; "size" if only misfits are known.
    refused = False
    for label, is_noun in _candidates(name[:_LONGEST_NAME]):
        if not _fits_its_size(label, place):
            refused = True
            continue
        stands_for = {_PLANT: "otherprop", _STAIRS: "otherstructure"}
        found = NYU40_NAMES.index(stands_for.get(label, label))
        return PieceClass(found, rule if is_noun or rule != "name" else "inner-word", label)
    return PieceClass(None, "size" if refused else "none")


def class_of_piece(
    catalogue_id: str, name: str, group: str = "", place: PieceSize | None = None
) -> PieceClass:
    """The class by catalogue id, else by whole words of the name, of the group, of the id.

    A bare box, cylinder or triangle is what its name says, else its group's: people build with
    them. Every class must fit the place, where it is given; a table 5 cm high is none.
    """
    known = _classes_of_catalogue_ids().get(catalogue_id)
    inner = catalogue_id.partition("#")[2]
    if catalogue_id in _PRIMITIVES:
        is_named = name.lower() not in _PRIMITIVE_NAMES
        own = _by_words(name, place, "name") if is_named else PieceClass(None, "none")
        if own.nyu40 is None and own.rule == "none":
            own = _by_words(group, place, "group")
        return own if own.nyu40 is not None else PieceClass(known, "catalogue")
    # The catalogue is the surest, as long as the size agrees.
    if known is not None and _fits_its_size(NYU40_NAMES[known], place):
        word = next((label for label, _ in (*_candidates(inner), *_candidates(name))), "")
        return PieceClass(known, "catalogue", word)
    own = _by_words(name, place, "name")
    if own.nyu40 is not None:
        return own
    by_id = _by_words(inner, place, "id")
    # Say "size" where a class was found and refused, "none" where there was none.
    misfit = known is not None or "size" in (own.rule, by_id.rule)
    return by_id if by_id.nyu40 is not None else PieceClass(None, "size" if misfit else "none")


def nyu40_of(catalogue_id: str, name: str, group: str = "") -> int | None:
    """NYU40 id of a piece whose size is not known; None where nothing says one.

    As class_of_piece, which also says by which rule and checks the class against the size.
    """
    return class_of_piece(catalogue_id, name, group).nyu40


def kind_of(piece: PieceClass, nyu40: int, *, is_opening: bool, is_light: bool) -> ItemKind:
    """What the piece is to the pipeline: the source's own element first, then class, then words.

    nyu40: the class the item gets, which the source's element may have decided.
    """
    if is_opening:
        return ItemKind.WINDOW if nyu40 == WINDOW else ItemKind.DOOR
    if is_light:
        return ItemKind.LAMP
    if nyu40 == PERSON:
        return ItemKind.PERSON
    return {_STAIRS: ItemKind.STAIRS, _PLANT: ItemKind.PLANT}.get(piece.word, ItemKind.OBJECT)
