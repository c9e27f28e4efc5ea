"""Class and kind for names of other data sets' vocabularies, and items by class and box; no effects.

given_classes.csv, beside this file, has one row per name: source (3dfuture, ai2thor, roomplan, ...),
name, kind, NYU40 class. Other names are classified by furniture_classes. prepare/stand_ins.py furnishes items
without a mesh.
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterator
from functools import cache
from typing import Final, NamedTuple

import numpy as np

from pbrs_farm.core.classes import DOOR, NYU40_NAMES, WINDOW
from pbrs_farm.core.house import BOX_ONLY, FRONT_GIVEN, Box, Item, ItemKind
from pbrs_farm.home.names import parted, words_of
from pbrs_farm.read.common.furniture_classes import class_of_piece, kind_of, rows_of_table
from pbrs_farm.regular_files import text_from_bytes

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


HSSD_TABLES: Final = (
    "objects.csv",
    "semantics/objects.csv",
    "metadata/objects.csv",
    "semantics/hssd-hab_semantics_objects.csv",
)
"""Where HSSD's table of categories may be in a folder of models."""


def hssd_rows(data: bytes) -> Iterator[tuple[str, str, str]]:
    """(id, category, size as written) of HSSD's objects.csv: without a head the id is first, the category 15th."""
    rows = csv.reader(io.StringIO(text_from_bytes(data, "replace")))
    head = [h.strip().lower() for h in next(rows, [])]
    at_id = head.index("id") if "id" in head else 0
    at_category = next((head.index(h) for h in ("main_category", "category") if h in head), 14)
    at_size = next((k for k, h in enumerate(head) if h.endswith("dims")), len(head))
    for row in rows:
        if len(row) > max(at_id, at_category):
            size = row[at_size] if at_size < len(row) else ""
            yield row[at_id].strip(), row[at_category].strip(), size


def _key_of_name(name: str) -> str:
    return " ".join(name.lower().replace("_", " ").split())


@cache
def _classes_by_name() -> dict[tuple[str, str], GivenClass]:
    return {
        (row["source"], _key_of_name(row["name"])): GivenClass(row["kind"], _nyu40(row["nyu40"]))
        for row in rows_of_table("given_classes.csv")
    }


def _nyu40(name: str) -> int:
    if name == "by name":
        return -1
    return NYU40_NAMES.index(name) if name in NYU40_NAMES else 0


_FURNITURE: Final = ("object", "lamp", "plant", "stairs", "person")
_ON_FIXTURES: Final = frozenset({"faucet", "tap"})
"""Parts that the stand-ins of sinks and tubs already include."""
LARGEST_M: Final = 15.0


def box_only_item(
    item_id: str,
    vocabulary: str,
    name: str,
    centre: tuple[float, float, float],
    size: tuple[float, float, float],
    turn_rad: float,
    *,
    is_front_given: bool = False,
    level_id: str = "0",
    room_id: str | None = None,
) -> Item | None:
    """An item without surfaces for a known class and box.

    Returns None if the name's class is not drawn, or the box is invalid: not finite, without a size,
    larger than any furniture.

    vocabulary: the data set of the name (given_classes.csv). centre: of the box, metres, world. size:
    width, height, depth. turn_rad: about +y; at 0 the front faces +z.
    """
    if words_of(_spoken(name)) & _ON_FIXTURES:
        return None
    words_class = given_class(vocabulary, name) or class_by_words(_spoken(name))
    if words_class is not None and words_class.kind == LEFT_OUT:
        return None
    if words_class is not None and words_class.nyu40 < 0:
        words_class = class_by_words(_spoken(name))
    if words_class is not None and words_class.kind not in _FURNITURE:
        return None
    if not all(map(math.isfinite, (*centre, *size, turn_rad))):
        return None
    if min(size) <= 0 or max(size) > LARGEST_M:
        return None
    cos, sin = math.cos(turn_rad), math.sin(turn_rad)
    axes = np.array([[cos, 0, sin], [0, 1, 0], [-sin, 0, cos]])
    tags = (BOX_ONLY, FRONT_GIVEN) if is_front_given else (BOX_ONLY,)
    return Item(
        id=item_id,
        name=_spoken(name),
        kind=words_class.item_kind if words_class else ItemKind.OBJECT,
        level_id=level_id,
        surfaces=(),
        nyu40=words_class.nyu40 if words_class else 40,
        source_class=name,
        room_id=room_id,
        box=Box(np.array(centre, np.float64), np.array(size, np.float64) / 2, axes),
        tags=tags,
    )


def _spoken(name: str) -> str:
    """Split identifiers into words of the vocabulary: TVStand, tv_stand -> TV Stand, tv stand."""
    return parted(name).replace("_", " ").replace("-", " ").strip()
