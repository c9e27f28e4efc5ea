"""Which pieces of the catalogue fit an old place, and at which scale; no effects."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from pbrs_farm.core.catalogue import Piece
from pbrs_farm.core.house import Item
from pbrs_farm.dress.old_place import OldPlace

LEAST_SIDE: Final = 0.75  # least side of the new footprint, as a share of the old one
HEIGHT: Final = 0.15  # greatest difference in height, as a share of the old one
SCALE: Final = (0.8, 1.25)  # models are of their true size
STRETCH: Final = 1.2
ALIKE: Final = 0.93
# fmt: off
MADE_OF_BOARDS: Final = frozenset(
    {"bed", "desk", "nightstand", "tv_stand", "bookcase", "shelves", "wardrobe", "dresser",
     "cabinet", "dining_table", "coffee_table", "fridge", "washer"}
)
# fmt: on

Scale = tuple[float, float, float]  # along a piece's width, height, depth


def scale_of(piece: Piece, place: OldPlace) -> Scale | None:
    """Scale to the old footprint (75 to 100 %, height within 15 %, boards up to STRETCH more); or None."""
    width, depth, height = piece.size
    old_width, old_depth, old_height = place.size
    if min(width, depth, height) <= 0:
        return None
    # Along x, y, z: how much larger the piece may become.
    room = (old_width / width, (1 + HEIGHT) * old_height / height, old_depth / depth)
    least = min(room)
    most = STRETCH * least if piece.group in MADE_OF_BOARDS else least
    across, up, along = (min(r, most) for r in room)
    up = min(up, max(old_height / height, least))
    fits = (
        SCALE[0] <= least
        and max(across, up, along) <= SCALE[1]
        and across * width >= LEAST_SIDE * old_width
        and along * depth >= LEAST_SIDE * old_depth
        and up * height >= (1 - HEIGHT) * old_height
    )
    return (across, up, along) if fits else None


def own_or_all(
    pieces: Sequence[Piece], own: frozenset[str], share: float, rng: np.random.Generator
) -> Sequence[Piece]:
    """Only the user's own pieces, if any, with probability share (drawn only then), else all."""
    mine = [piece for piece in pieces if piece.id in own]
    return mine if mine and rng.random() < share else pieces


def common_scale(piece: Piece, places: Sequence[OldPlace]) -> Scale | None:
    """The scale at which a piece fits every place of a set, of about one size; or None."""
    scales = [scale_of(piece, place) for place in places]
    valid = [s for s in scales if s is not None]
    if len(valid) < len(places):
        return None
    least = (min(s[0] for s in valid), min(s[1] for s in valid), min(s[2] for s in valid))
    is_alike = all(least[k] >= ALIKE * s[k] for s in valid for k in range(3))
    return least if is_alike else None


def is_lit_alike(piece_has_lights: bool, items: Sequence[Item]) -> bool:
    """True if a piece has a light source, where the items that it would replace have a light."""
    return piece_has_lights or not any(item.lights for item in items)
