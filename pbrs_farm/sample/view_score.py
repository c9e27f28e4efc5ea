"""From pixels per item to a view's score: which items count, and how (paper section 3.1); no effects."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F64, I64
from pbrs_farm.core.house import House, ItemKind, Room
from pbrs_farm.core.recipe import CameraFields


@dataclass(frozen=True, slots=True, eq=False)
class Scored:
    """Scores of N views."""

    n_objects: I64  # (N,) objects large enough
    score: F64  # (N,) 0 = no score


def object_columns(house: House) -> NDArray[np.intp]:
    """Instance ids of the paper's objects, doors and windows too: all but wall, ceiling, floor, ground."""
    ids = [i + 1 for i, item in enumerate(house.items) if not item.kind.is_structure]
    return np.array(ids, np.intp)


def released_columns(house: House, room: Room) -> NDArray[np.intp]:
    """Instance ids that the published sampler counts: this room's but stairs, columns and boxes."""
    # An item's instance id is its place in the list plus 1; 0 is nothing.
    ids = [
        i + 1
        for i, item in enumerate(house.items)
        if item.room_id == room.id
        and not item.kind.is_structure
        and item.kind is not ItemKind.STAIRS
        and not {"box", "structure"} & set(item.tags)
    ]
    return np.array(ids, np.intp)


def paper_score(
    counts: NDArray[np.uint32], columns: NDArray[np.intp], min_fraction: float
) -> Scored:
    """Paper section 3.1: share of the picture covered by objects, and how many are at least min_fraction."""
    pixels = counts.sum(1, dtype=np.int64)
    objects = counts[:, columns]
    n_objects = (objects >= min_fraction * pixels[:, None]).sum(1)
    return Scored(n_objects, objects.sum(1, dtype=np.int64) / np.maximum(pixels, 1))


def overfill(counts: NDArray[np.uint32], columns: NDArray[np.intp], fields: CameraFields) -> F64:
    """(N,) excess, above 0 rejects, of an item's share of counts over max_item_ or max_wall_fraction."""
    # Compare the largest object and the largest wall with what each may cover.
    pixels = np.maximum(counts.sum(1, dtype=np.int64), 1)
    structure = np.delete(
        counts, np.append(columns, 0), axis=1
    )  # walls, floors, ceilings, the ground
    object_share = counts[:, columns].max(1, initial=0) / pixels
    wall_share = structure.max(1, initial=0) / pixels
    over_object = object_share - fields.max_item_fraction
    return np.asarray(np.maximum(over_object, wall_share - fields.max_wall_fraction))


def released_score(
    counts: NDArray[np.uint32], columns: NDArray[np.intp], fields: CameraFields
) -> Scored:
    """Score of the published sampler: the sum of ln(n // least), an integer division.

    least = floor(min_object_fraction * pixels). Objects need strictly more than it, and a view needs
    min_objects of them (4: its code asks for more than 3), else it scores 0.
    """
    pixels = int(counts[0].sum()) if len(counts) else 0
    least = max(1, int(fields.min_object_fraction * pixels))
    objects = counts[:, columns].astype(np.int64)
    counted = objects > least  # strictly more
    # Sum the logarithms of whole multiples of the least count.
    score = np.log(np.where(counted, objects // least, 1)).sum(1)
    n_objects = counted.sum(1)
    return Scored(n_objects, np.where(n_objects >= fields.min_objects, score, 0.0))
