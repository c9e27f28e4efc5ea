"""Things that a source describes by class and box alone; no effects. prepare/stand_ins.py furnishes them."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from pbrs_farm.core.house import BOX_ONLY, FRONT_GIVEN, Box, Item, ItemKind
from pbrs_farm.home.names import parted, words_of
from pbrs_farm.read.common.given_classes import LEFT_OUT, class_by_words, given_class

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
