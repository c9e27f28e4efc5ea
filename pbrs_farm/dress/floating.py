"""Generated items in the air of a home's rooms, for training geometry; no effects.

WMGStereo measured that networks learn depth best from realistic rooms with additional floating
items at random poses. These have no support and touch nothing; they are labelled with their class
and tagged FLOATING.
"""

from __future__ import annotations

from contextlib import closing
from functools import cache
from typing import Final

import numpy as np
import shapely

from pbrs_farm.core.catalogue import Piece, Place
from pbrs_farm.core.house import (
    FLOATING,
    House,
    ItemKind,
    MaterialKind,
    Note,
    Room,
    corners_of_surfaces,
)
from pbrs_farm.dress.content import content
from pbrs_farm.dress.models import Model
from pbrs_farm.dress.mutable_house import MutableHouse
from pbrs_farm.dress.style import style_for
from pbrs_farm.geometry.free_air import FreeAir, mean_shadow_m2, shadow_for_share
from pbrs_farm.geometry.moving import moved_item
from pbrs_farm.home.room_use import MIN_LIVED_IN_M2, is_outdoors

FEW: Final = "floating-few"
"""Kind of the note about a room with fewer floating items than requested."""

_LEAST_M, _MOST_M = 0.15, 1.0  # the longest side of what hangs in the air
_SMALL_SHARE: Final = 0.7  # share of small items; the rest is furniture
_GIVEN_UP: Final = 12  # consecutive items without a place before a room is given up
_LEFT_OUT: Final = (MaterialKind.MIRROR, MaterialKind.BULB, MaterialKind.SHADE)


def with_floating_things(house: House, share: float, seed: int) -> House:
    """Add floating items to each room until they hide about a share of the view.

    share: 0 to below 1 of the picture in an empty room, averaged over positions and directions;
    furniture hides some of them. Rooms outdoors and closets below 2 m2 are skipped. Deterministic to
    the bit.
    """
    air = FreeAir(house.items)
    with closing(MutableHouse(house, seed)) as mutable:
        for room in house.rooms:
            if not is_outdoors(room) and shapely.Polygon(room.polygon).area > MIN_LIVED_IN_M2:
                _fill(mutable, air, room, share)
        return mutable.frozen()


def _fill(house: MutableHouse, air: FreeAir, room: Room, share: float) -> None:
    rng = house.rng("float", room.id)
    target, hidden, n, n_failed = shadow_for_share(room, share), 0.0, 0, 0
    while n_failed < _GIVEN_UP:
        piece, shape = _drawn(rng)
        corners = corners_of_surfaces(shape.surfaces)
        matrix = air.put(room, corners.reshape(-1, 3), rng)
        if matrix is None:
            n_failed += 1
            continue
        n_failed = 0
        item = house.placed(
            piece,
            shape,
            np.zeros(3),
            0.0,
            item_id=f"float-{room.id}-{n}",
            room_id=room.id,
            level_id=room.level_id,
            tags=(FLOATING,),
        )
        item = moved_item(item, matrix)
        house.add(item, "float", piece)
        n += 1
        hidden += mean_shadow_m2(corners_of_surfaces(item.surfaces))
        if hidden >= target:
            return
    text = f"floating items hide {hidden:.1f} of {target:.1f} m2: no more free space"
    house.notes.append(Note(FEW, room.id, text))


def _drawn(rng: np.random.Generator) -> Model:
    """A small item or a piece of furniture; all kinds of a sort are equally likely."""
    while True:
        if rng.random() < _SMALL_SHARE:
            style = style_for(rng)
            names = content().small_things
            piece, shape = content().things[names[int(rng.integers(len(names)))]](rng, style)
        else:
            groups = list(_furniture().values())
            pieces = groups[int(rng.integers(len(groups)))]
            piece = pieces[int(rng.integers(len(pieces)))]
            shape = content().family_shape(piece)
        used = {shape.materials[s.material].kind for s in shape.surfaces}
        if _LEAST_M <= max(piece.size) <= _MOST_M and not used & {*_LEFT_OUT}:
            return piece, shape


@cache
def _furniture() -> dict[str, list[Piece]]:
    """Group -> generated floor furniture without lights, no larger than _MOST_M."""
    pieces_of_group: dict[str, list[Piece]] = {}
    for piece in content().family_pieces():
        if (
            piece.place in (Place.FLOOR, Place.SURFACE)
            and piece.kind is ItemKind.OBJECT
            and _LEAST_M <= max(piece.size) <= _MOST_M
        ):
            pieces_of_group.setdefault(piece.group, []).append(piece)
    return pieces_of_group
