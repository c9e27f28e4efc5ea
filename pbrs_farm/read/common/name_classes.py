"""What the name of a node, a product or a material says that it is: structure, an opening, a lamp, a piece. No effects."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from pbrs_farm.core.classes import DOOR, FLOOR, LAMP, NYU40_NAMES, OTHERSTRUCTURE, WINDOW
from pbrs_farm.core.house import ItemKind
from pbrs_farm.home.names import words_of
from pbrs_farm.read.common.furniture_classes import class_of_piece, kind_of

_WALL_WORDS: Final = "wall wallpaper wand waende tapete mur muro pared parete parede"
_CEILING_WORDS: Final = "ceiling zimmerdecke decke plafond techo soffitto teto"
_FLOOR_WORDS: Final = (
    "floor flooring boden fussboden parquet parkett laminate laminat linoleum sol suelo pavimento"
)
# Word of a name -> kind, the words of walls first ("wall above the floor" is a wall).
STRUCTURE_WORDS: Final = {
    word: kind
    for kind, words in (
        (ItemKind.WALL, _WALL_WORDS),
        (ItemKind.CEILING, _CEILING_WORDS),
        (ItemKind.FLOOR, _FLOOR_WORDS),
        (ItemKind.GROUND, "ground terrain"),
    )
    for word in words.split()
}
UNMAPPED: Final = "unmapped"
"""Tag of an item of which nothing says what it is."""


@dataclass(frozen=True, slots=True)
class NodeClass:
    """Class and kind of an item."""

    nyu40: int
    kind: ItemKind
    is_tagged: bool  # said by extras or the mapping, not guessed


def class_of_node_name(name: str) -> NodeClass | None:
    """What the words of a node's, a product's or a material's name say that it is; None where they say nothing.

    The words of pieces go before those of structure, so that a wall lamp is a lamp; names are in the
    languages of words.csv.
    """
    piece = class_of_piece("", name)
    nyu40 = piece.nyu40
    if nyu40 is None or nyu40 == OTHERSTRUCTURE:
        # Look for structure where the name says nothing more special.
        words = words_of(name)
        for word, kind in STRUCTURE_WORDS.items():
            if word in words:
                # The ground outside is labelled floor.
                label = FLOOR if kind is ItemKind.GROUND else NYU40_NAMES.index(kind.value)
                return NodeClass(label, kind, is_tagged=False)
    if nyu40 is None:
        return None
    # A name tells openings and lamps only by their class.
    is_opening = nyu40 in (DOOR, WINDOW)
    kind = kind_of(piece, nyu40, is_opening=is_opening, is_light=nyu40 == LAMP)
    return NodeClass(nyu40, kind, is_tagged=False)
