"""NYU40 class and kind of a piece of furniture by its id, name, size and place. Reads the tables beside it."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cache, lru_cache
from importlib.resources import files
from itertools import pairwise
from typing import Final, NamedTuple

from pbrs_farm.core.classes import NYU40_NAMES, PERSON, WINDOW
from pbrs_farm.core.house import ItemKind
from pbrs_farm.home.names import folded, has_copy_suffix, parted

CLASS_TAG: Final = "class:"
"""Begins the tag of an item that names the rule which decided its class."""

_PRIMITIVES: Final = frozenset(
    {"eTeks#texturableBox", "eTeks#texturableCylinder", "eTeks#texturableTriangle"}
)
_PRIMITIVE_NAMES: Final = frozenset({"box", "cylinder", "triangle", ""})
_MODIFIERS: Final = frozenset({"wall", "kitchen"})  # give the place of an unknown item
_HEAD_FIRST: Final = frozenset({"fr", "es", "it", "pt"})  # languages with the noun first
_LONGEST_PHRASE: Final = 4  # words
# Names that programs give to new primitives, of any size.
_DEFAULT_NAME: Final = re.compile(
    r"(chamfer)?box(_?\d+|\.\d+)|gameobject\d*|skp_camera.*", re.IGNORECASE
)

PERSON_WORD: Final = "person"
PLANT_WORD: Final = "plant"
_STAIRS: Final = "stairs"

# Floor furniture at the height of a table or shelf must have twice the minimum size: otherwise it is a doll's bed.
_RAISED_M: Final = (0.6, 1.8)  # above the floor of the level
_LEAST_LAWN_M: Final = 1.0  # minimum shorter side of a lawn, metres
_FLATTEST_PLANT: Final = 0.1  # minimum height over shorter side; flatter plants cover the ground
_SLIMMEST_CROWN: Final = 0.25  # of the longer side
_OFF_SCALE: Final = 2.0  # of the maximum size, for a file whose scale is a little off
_THINNEST_COPY: Final = 0.2  # minimum thickness over the middle side of a mirrored copy
_STANDING: Final = frozenset({"bathtub", "bed", "chair", "desk", "sofa", "table", "toilet"})


@dataclass(frozen=True, slots=True)
class PieceSize:
    """Size of a piece and height of its base, in metres."""

    width: float
    height: float
    depth: float
    bottom: float = 0.0  # above the floor of its level


@dataclass(frozen=True, slots=True)
class _Candidate:
    """A class or kind suggested by a word of a name."""

    label: str
    is_noun: bool  # whether the word says what the whole name means
    phrase: str = ""
    is_first: bool = False  # the first word, in a language with the noun first


class _Describing(NamedTuple):
    """Which nouns before it a word describes: the leg of a table, beech of a chair."""

    after: frozenset[str]  # labels; "any" is all but persons and plants
    but_not: frozenset[str]  # phrases
    is_material: bool  # alone it names a plant or a material


@dataclass(frozen=True, slots=True)
class PieceClass:
    """Class of a piece of furniture, and the rule that decided it.

    rule: catalogue, name (its last noun), inner-word (another word of the name), group, id; size =
    the words' class does not fit the piece's size or place; none = no known word.
    """

    nyu40: int | None  # None = no class
    rule: str
    word: str = ""  # of the vocabulary: a class, plant or stairs
    phrase: str = ""  # words of the name that say so

    @property
    def tag(self) -> str:
        """For Item.tags."""
        return CLASS_TAG + self.rule


def rows_of_table(name: str, folder: str = "common") -> list[dict[str, str]]:
    """The rows of a CSV of a folder of pbrs_farm.read."""
    text = files(f"pbrs_farm.read.{folder}").joinpath(name).read_text("utf-8")
    return list(csv.DictReader(text.splitlines()))


@cache
def words_of_list(name: str) -> frozenset[str]:
    """The words or phrases of a row of word_lists.csv."""
    words = {row["list"]: row["words"] for row in rows_of_table("word_lists.csv")}
    return frozenset(words[name].split("|"))


@cache
def _sizes() -> Mapping[str, tuple[float, float, float, float]]:
    """Class -> least and most of the longer horizontal side, then of the height, metres.

    Items outside this range are toys, trays, heaps or mistakes. A side of 0 is unbounded.
    """
    sizes: dict[str, tuple[float, float, float, float]] = {}
    for row in rows_of_table("class_sizes.csv"):
        label, *sides = row.values()
        least_side, most_side, least_height, most_height = map(float, sides)
        sizes[label] = (least_side, most_side, least_height, most_height)
    return sizes


@cache
def _classes_of_catalogue_ids() -> Mapping[str, int]:
    return {
        r["catalogId"]: NYU40_NAMES.index(r["class"])
        for r in rows_of_table("sweethome3d-classes.csv")
    }


@cache
def _vocabulary() -> Mapping[str, tuple[str, bool]]:
    # Phrase -> class or kind, and whether its language has the noun first.
    # A phrase with "-" before it also ends compound words ("-tisch": Esstisch).
    return {
        plain(phrase): (r["class"], r["language"] in _HEAD_FIRST)
        for r in rows_of_table("words.csv")
        for phrase in r["words"].split("|")
    }


@cache
def _describing_words() -> Mapping[str, _Describing]:
    rules: dict[str, _Describing] = {}
    for row in rows_of_table("describing_words.csv"):
        after, but_not = (frozenset(row[key].split("|")) for key in ("after", "but not"))
        # One value a row: words of a row do not describe each other.
        rule = _Describing(after, but_not, row["is"] == "material")
        rules |= dict.fromkeys(row["words"].split("|"), rule)
    return rules


def plain(text: str) -> str:
    """Lower case without accents; camelCase parted by spaces."""
    return folded(parted(text))


_LONGEST_NAME: Final = 500  # maximum letters of a name to analyse


def _words_in_order(name: str) -> list[str]:
    """Words and separate numbers, without words for the item's place and numbers inside words ("chair01")."""
    words = re.findall(r"(?<![^\W_])\d+|[^\W\d_]+", plain(name))
    of_rooms = {k for k, (word, after) in enumerate(pairwise(words)) if _is_of_a_room(word, after)}
    return [word for k, word in enumerate(words) if k not in of_rooms]


def _is_of_a_room(word: str, after: str) -> bool:
    is_owned = after in ("room", "bedroom", "bathroom", "toilet")
    is_owner = is_owned and word in words_of_list("owner of a room")
    return is_owner or (after == "room" and word in words_of_list("thing of a room"))


@lru_cache(maxsize=4096)
def _candidates(name: str) -> tuple[_Candidate, ...]:
    return tuple(_found_candidates(name))


def _found_candidates(name: str) -> Iterator[_Candidate]:
    # Classes or kinds for the words of a name, likeliest first. Words before a preposition come
    # first
    # ("lamp with table" is a lamp), and a separate number begins a new part.
    words, asides = _words_in_order(name), words_of_list("aside")
    aside = next((k for k, w in enumerate(words) if k and (w in asides or w.isdigit())), len(words))
    # A phrase from the first word may hold an aside: "table de nuit".
    for n in range(min(_LONGEST_PHRASE, len(words)), 1, -1):
        whole = _class_of_phrase(" ".join(words[:n]))
        if whole is not None and n > aside:
            yield _Candidate(whole[0], is_noun=True)
    yield from _from_the_noun(words[:aside], is_head=True)
    yield from _from_the_noun(words[aside:], is_head=False)


def _from_the_noun(words: list[str], *, is_head: bool) -> Iterator[_Candidate]:
    candidates: list[_Candidate] = []
    k = len(words)
    # The last known word is the noun; phrases of several words take precedence.
    while k > 0:
        for n in range(min(_LONGEST_PHRASE, k), 0, -1):
            phrase = " ".join(words[k - n : k])
            word_class = None if _is_a_tint(phrase, words, k) else _class_of_phrase(phrase)
            if word_class is not None and (k == len(words) or words[k - 1] not in _MODIFIERS):
                is_first = word_class[1] and k == n
                is_noun = is_head and (is_first or k == len(words))
                candidates.append(_Candidate(word_class[0], is_noun, phrase, is_first))
                k -= n - 1
                break
        k -= 1
    # A word described by the last word precedes it: "table leg", "cabinet door glass".
    noun = 0
    for k in range(1, len(candidates)):
        noun = k if _describes(candidates[noun], candidates[k]) else noun
    if noun:
        candidates.insert(0, replace(candidates.pop(noun), is_noun=candidates[0].is_noun))
    # Languages with the noun first use the first word.
    yield from sorted(candidates, key=lambda c: not c.is_first)


def _is_a_tint(phrase: str, words: list[str], end: int) -> bool:
    """Whether words[..end], a phrase, name a colour or a wood there, not a lamp or a plant."""
    if phrase == "light":
        return end < len(words) and words[end] in words_of_list("tint")
    is_said = phrase == "mat" or is_also_a_material(phrase)  # "wood mat": short for material
    return is_said and not words_of_list("of a material").isdisjoint(words)


def is_also_a_material(phrase: str) -> bool:
    """Whether a plant's word names as often a wood, a pattern or a tint: pine, rose."""
    rule = _describing_words().get(phrase)
    return rule is not None and rule.is_material


def _describes(last: _Candidate, before: _Candidate) -> bool:
    rule = _describing_words().get(last.phrase)
    if rule is None or rule is _describing_words().get(before.phrase):
        return False
    if before.phrase in rule.but_not:
        return False
    if "any" in rule.after:
        return before.label not in (PERSON_WORD, PLANT_WORD)
    return before.label in rule.after


def _class_of_phrase(phrase: str) -> tuple[str, bool] | None:
    vocabulary = _vocabulary()
    singular = phrase[: -2 if phrase.endswith(("shes", "ches", "xes", "sses")) else -1]
    for form in (phrase, singular if phrase.endswith("s") else phrase):
        for entry in (form, "-" + form):
            if entry in vocabulary:
                return vocabulary[entry]
    # Try the ends of a compound word, longest first.
    for k in range(1, len(phrase) if " " not in phrase else 0):
        if "-" + phrase[k:] in vocabulary:
            return vocabulary["-" + phrase[k:]]
    return None


def is_a_default_name(name: str) -> bool:
    """True if a modelling program named an object after its shape: "Box001" of 3ds Max."""
    return _DEFAULT_NAME.fullmatch(name) is not None


def is_a_cover_of_ground(width: float, height: float, depth: float) -> bool:
    """True if a plant's size is that of ground cover: wide and flat, metres."""
    side = min(width, depth)
    return side >= _LEAST_LAWN_M and height <= _FLATTEST_PLANT * side


def stands_as_a_tree(width: float, height: float, depth: float) -> bool:
    """True if an item named after a wood, such as Pine, has the size of a tree; metres."""
    across, along = sorted((width, depth))
    return height > along and across > _SLIMMEST_CROWN * along


def _fits_its_size(label: str, place: PieceSize | None) -> bool:
    if label == PLANT_WORD and place is not None:
        return not is_a_cover_of_ground(place.width, place.height, place.depth)
    if place is None or label not in _sizes():
        return True
    long_min, long_max, height_min, height_max = _sizes()[label]
    side = max(place.width, place.depth)
    if label in _STANDING and _RAISED_M[0] < place.bottom < _RAISED_M[1]:
        long_min *= 2
    if label in ("mirror", "picture"):  # it may lie: its longest side counts
        side = max(side, place.height)
    return long_min <= side <= long_max and height_min <= place.height <= height_max


def is_far_too_large(label: str, place: PieceSize) -> bool:
    """True if an item exceeds twice the maximum size of its class, or a floor mat's height."""
    if label not in _sizes():
        return False
    _, long_max, _, height_max = _sizes()[label]
    slack = 1.0 if label == "floor mat" else _OFF_SCALE
    side = max(place.width, place.depth)
    return place.height > slack * height_max or side > _OFF_SCALE * long_max


def _is_a_bench_alone(label: str, place: PieceSize | None) -> bool:
    """A catalogue's television with its bench, of which only the bench is left: deep, and twice as wide as high."""
    if place is None or label != "television":
        return False
    return place.depth >= place.height and place.width >= 2 * place.height


def _is_a_mirrored_copy(
    candidates: tuple[_Candidate, ...], name: str, place: PieceSize | None
) -> bool:
    """True if "mirror" at the end of a name is the suffix of a modelling program: "Chair_mirror.001"."""
    is_last = re.search(r"mirror[\W\d_]*$", name, re.IGNORECASE) is not None
    if not (is_last and candidates and candidates[0].phrase == "mirror"):
        return False
    owner = next((c.label for c in candidates if c.label != "mirror"), None)
    if owner is None or owner not in words_of_list("owner of a mirror") or has_copy_suffix(name):
        return owner is not None
    if place is None:
        return False
    thinnest, middle, _ = sorted((place.width, place.height, place.depth))
    return thinnest > _THINNEST_COPY * middle


def _by_words(name: str, place: PieceSize | None, rule: str) -> PieceClass:
    # The class of the first candidate that fits the piece; "size" if only misfits are known.
    refused = False
    candidates = _candidates(name[:_LONGEST_NAME])
    for candidate in candidates[_is_a_mirrored_copy(candidates, name, place) :]:
        label, is_noun = candidate.label, candidate.is_noun
        if not _fits_its_size(label, place):
            refused = True
            continue
        stands_for = {PLANT_WORD: "otherprop", _STAIRS: "otherstructure"}
        nyu40 = NYU40_NAMES.index(stands_for.get(label, label))
        by = rule if is_noun or rule != "name" else "inner-word"
        return PieceClass(nyu40, by, label, candidate.phrase)
    return PieceClass(None, "size" if refused else "none")


def class_of_piece(
    catalogue_id: str, name: str, group: str = "", place: PieceSize | None = None
) -> PieceClass:
    """Class by catalogue id, else by whole words of the name, of the group, of the id.

    A bare box, cylinder or triangle is classified by name, else by group: people build furniture from
    them. The class must fit the place, if given; a table 5 cm high is rejected.
    """
    listed = _classes_of_catalogue_ids().get(catalogue_id)
    inner = catalogue_id.partition("#")[2]
    if catalogue_id in _PRIMITIVES:
        is_named = name.lower() not in _PRIMITIVE_NAMES
        name_class = _by_words(name, place, "name") if is_named else PieceClass(None, "none")
        if name_class.nyu40 is None and name_class.rule == "none":
            name_class = _by_words(group, place, "group")
        return name_class if name_class.nyu40 is not None else PieceClass(listed, "catalogue")
    # The catalogue is the surest, as long as the size agrees.
    is_fit = listed is not None and _fits_its_size(NYU40_NAMES[listed], place)
    if listed is not None and is_fit and not _is_a_bench_alone(NYU40_NAMES[listed], place):
        word = next((c.label for c in (*_candidates(inner), *_candidates(name))), "")
        return PieceClass(listed, "catalogue", word)
    name_class = _by_words(name, place, "name")
    if name_class.nyu40 is not None:
        return name_class
    by_id = _by_words(inner, place, "id")
    # Say "size" where a class was found and refused, "none" where there was none.
    misfit = listed is not None or "size" in (name_class.rule, by_id.rule)
    return by_id if by_id.nyu40 is not None else PieceClass(None, "size" if misfit else "none")


def nyu40_of(catalogue_id: str, name: str, group: str = "") -> int | None:
    """NYU40 id of a piece of unknown size, by the rules of class_of_piece; None if none applies."""
    return class_of_piece(catalogue_id, name, group).nyu40


def kind_of(piece: PieceClass, nyu40: int, *, is_opening: bool, is_light: bool) -> ItemKind:
    """Item kind of a piece: by the source's own element first, then its final class, then words."""
    if is_opening:
        return ItemKind.WINDOW if nyu40 == WINDOW else ItemKind.DOOR
    if is_light:
        return ItemKind.LAMP
    if nyu40 == PERSON:
        return ItemKind.PERSON
    return {_STAIRS: ItemKind.STAIRS, PLANT_WORD: ItemKind.PLANT}.get(piece.word, ItemKind.OBJECT)
