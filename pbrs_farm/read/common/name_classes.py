"""Class from the name of a node, product or material: structure, opening, lamp or piece. No effects."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

from pbrs_farm.core.classes import DOOR, FLOOR, LAMP, NYU40_NAMES, OTHERSTRUCTURE, WINDOW
from pbrs_farm.core.house import ItemKind
from pbrs_farm.home.names import parted, words_of
from pbrs_farm.read.common.furniture_classes import (
    PERSON_WORD,
    PLANT_WORD,
    PieceClass,
    PieceSize,
    class_of_piece,
    is_a_cover_of_ground,
    is_a_default_name,
    is_also_a_material,
    is_far_too_large,
    kind_of,
    plain,
    stands_as_a_tree,
    words_of_list,
)

# Word of a name -> kind, the words of walls first ("wall above the floor" is a wall).
STRUCTURE_WORDS: Final = {
    word: kind
    for kind in (ItemKind.WALL, ItemKind.CEILING, ItemKind.FLOOR, ItemKind.GROUND)
    for word in words_of_list(kind)
}
_LEAST_STRUCTURE_M: Final = 0.2  # a tile of a floor is as large
_ROOMS_AND_CABINETS: Final = frozenset({"closet", "kitchen", "kitchenette", "pantry", "storage"})
_REVIT_NAME: Final = re.compile(r'^M_|:.*:\d+$|[ "-].*:|:.*[ "-]')
_SHORT_FOR_MATERIAL: Final = re.compile(r"(?<![^\W\d_])(?<!bath[ _])mat(?![^\W\d_])", re.IGNORECASE)
UNMAPPED: Final = "unmapped"
"""Tag of an item without any known class."""


@dataclass(frozen=True, slots=True)
class NodeClass:
    """Class and kind of an item."""

    nyu40: int
    kind: ItemKind
    is_tagged: bool  # said by extras or the mapping, not guessed


def class_of_node_name(
    name: str, *, materials: Sequence[str] = (), size: PieceSize | None = None
) -> NodeClass | None:
    """Class from a node's, a product's or a material's name; None if the name has no known word.

    Words for pieces take precedence over those for structure, so that a wall lamp is a lamp; names
    are in the languages of words.csv.

    materials: of the node; exporters append them to its name ("Sink_Chrome_0").
    size: of the node, if known: decides between words of a name, and rejects persons and plants of
    the wrong size.
    """
    if is_a_default_name(name):
        return None
    classes = (_class_of_words(text, size) for text in _likely_names(name, materials))
    return next((node_class for node_class in classes if node_class is not None), None)


def class_of_material_name(name: str, *, size: PieceSize | None = None) -> NodeClass | None:
    """Class from the name of a material, in which "mat" is short for material, except for a bath mat."""
    return class_of_node_name(_SHORT_FOR_MATERIAL.sub("material", parted(name)), size=size)


def _likely_names(name: str, materials: Sequence[str]) -> Iterator[str]:
    """Parts of a name that may be the item's noun, the likeliest first; the whole name comes last."""
    plain_name = _without_material(name, materials)
    # "Kitchen_Sink_0": all parts of a room with the material Sink.
    if plain_name != name and plain_name.lower() not in _ROOMS_AND_CABINETS:
        yield plain_name
    # Revit: "M_Table-Coffee:0610 x 0610mm:143210", family, type and id; a maker follows a dash.
    is_revit = _REVIT_NAME.search(plain_name) is not None
    if is_revit:
        for text in plain_name.split(":"):
            yield text.partition("-")[0]
            yield text
    yield name


def _without_material(name: str, materials: Sequence[str]) -> str:
    """The name less a material's and a number: "Sink_mirror" of "Sink_mirror_mirror_toilet_0"."""
    numbered = re.fullmatch(r"(.+)_\d+", name)
    if numbered is None:
        return name
    bare = _signs_alike(numbered[1])
    for material in sorted(materials, key=len, reverse=True):
        end = "_" + _signs_alike(re.sub(r"\.\d+$", "", material))
        if len(end) > 1 and bare.endswith(end):
            return name[: len(bare) - len(end)]
        # Blender's number of a material comes without its dot.
        end = "_" + _signs_alike(material.replace(".", ""))
        if len(end) > 1 and bare.endswith(end):
            return name[: len(bare) - len(end)]
    return name


def _signs_alike(text: str) -> str:
    return re.sub(r"\W", "_", text).lower()


def _class_of_words(name: str, size: PieceSize | None) -> NodeClass | None:
    piece = _piece(name, size)
    nyu40 = piece.nyu40
    # A refused "floor mat" is not a floor.
    words = words_of(name) - (words_of(piece.phrase) if piece.word == "floor mat" else frozenset())
    is_structure = nyu40 is None or _only_describes(piece, name) or _may_be_wall(nyu40, words)
    if is_structure and not (size and _is_small(size)):
        # Look for structure where the name says nothing more special.
        for word, kind in STRUCTURE_WORDS.items():
            if word in words:
                # The ground outside is labelled floor.
                label = FLOOR if kind is ItemKind.GROUND else NYU40_NAMES.index(kind.value)
                return NodeClass(label, kind, is_tagged=False)
    if piece.word == PLANT_WORD and nyu40 is None:
        # Ground called Grass is no plant, which repair would take out.
        is_ground = size and is_a_cover_of_ground(size.width, size.height, size.depth)
        return NodeClass(FLOOR, ItemKind.GROUND, is_tagged=False) if is_ground else None
    if nyu40 is None:
        return None
    # For names, openings and lamps follow from the class alone.
    is_opening = nyu40 in (DOOR, WINDOW)
    kind = kind_of(piece, nyu40, is_opening=is_opening, is_light=nyu40 == LAMP)
    return NodeClass(nyu40, kind, is_tagged=False)


def _piece(name: str, size: PieceSize | None) -> PieceClass:
    """The class of a name as of a piece; persons and plants of a wrong size keep it, as repair removes them."""
    piece = class_of_piece("", name, "", size)
    if size is None:
        return piece
    if piece.nyu40 is None:
        piece = class_of_piece("", name)
        is_living = piece.word in (PERSON_WORD, PLANT_WORD)
        is_refused = is_living or is_far_too_large(piece.word, size)
    else:
        shape = (size.width, size.height, size.depth)
        is_refused = piece.word == PLANT_WORD and (
            is_also_a_material(piece.phrase) and not stands_as_a_tree(*shape)
        )
    return PieceClass(None, "size", piece.word, piece.phrase) if is_refused else piece


def _only_describes(piece: PieceClass, name: str) -> bool:
    """Whether the word of a plant or a person describes structure: "floor maple", "boy room wall"."""
    if piece.word not in (PERSON_WORD, PLANT_WORD):
        return False
    last = words_of(re.findall(r"[^\W\d_]+", plain(name))[-1])
    return not last.isdisjoint(STRUCTURE_WORDS) or is_also_a_material(piece.phrase)


def _is_small(size: PieceSize) -> bool:
    """Whether it is too small for a wall, a floor or a ceiling: the socket of a ceiling lamp."""
    return max(size.width, size.height, size.depth) < _LEAST_STRUCTURE_M


def _may_be_wall(nyu40: int, words: frozenset[str]) -> bool:
    return nyu40 == OTHERSTRUCTURE and not words & words_of_list("built")
