"""Class and kind for names of other data sets' vocabularies; no effects.

given_classes.csv, beside this file, has one row per name: source (3dfuture, ai2thor, roomplan, ...),
name, kind, NYU40 class. Other names are classified by furniture_classes.
"""

from __future__ import annotations

import csv
from functools import cache
from importlib.resources import files
from typing import Final, NamedTuple

from pbrs_farm.core.classes import DOOR, NYU40_NAMES, WINDOW
from pbrs_farm.core.house import ItemKind
from pbrs_farm.read.common.furniture_classes import class_of_piece, kind_of

LEFT_OUT: Final = "none"
REVEAL: Final = "opening-reveal"


class GivenClass(NamedTuple):
    """Meaning of a name.

    kind: an ItemKind's value, "opening-reveal" (the jambs of a hole) or "none" (not drawn).
    nyu40: -1 if the words of the item's name decide.
    """

    kind: str
    nyu40: int

    @property
    def item_kind(self) -> ItemKind:
        """The kind as an item has it; jambs are part of their wall."""
        return ItemKind.WALL if self.kind == REVEAL else ItemKind(self.kind)


def given_class(source: str, name: str) -> GivenClass | None:
    """Class of a name, in any case, of a vocabulary such as `hssd`; None if the table has no row."""
    return _classes_by_name().get((source, _key_of_name(name)))


def class_by_words(*names: str) -> GivenClass | None:
    """A guess for vocabularies without a table: the class of the first name (the likeliest) with known words."""
    for name in names:
        piece = class_of_piece("", name)
        if piece.nyu40 is not None:
            is_opening = piece.nyu40 in (DOOR, WINDOW)
            kind = kind_of(piece, piece.nyu40, is_opening=is_opening, is_light=False)
            return GivenClass(kind.value, piece.nyu40)
    return None


def _key_of_name(name: str) -> str:
    return " ".join(name.lower().replace("_", " ").split())


@cache
def _classes_by_name() -> dict[tuple[str, str], GivenClass]:
    text = files("pbrs_farm.read.common").joinpath("given_classes.csv").read_text("utf-8")
    return {
        (row["source"], _key_of_name(row["name"])): GivenClass(row["kind"], _nyu40(row["nyu40"]))
        for row in csv.DictReader(text.splitlines())
    }


def _nyu40(name: str) -> int:
    if name == "by name":
        return -1
    return NYU40_NAMES.index(name) if name in NYU40_NAMES else 0
