"""Furniture that overlaps, floats, or is duplicated in place; no effects."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import islice

import numpy as np

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.house import House, Item, ItemKind
from pbrs_farm.repair.repair_report import Floating, FurnitureAudit, Overlap
from pbrs_farm.repair.structure.booleans import common
from pbrs_farm.repair.structure.closed_shells import ClosedShells

_TOUCH_M = 0.02  # boxes nearer than this touch
_SAME_M = 0.001  # maximum difference between boxes at the same place, metres
_MIN_VOLUME_M3 = 1e-4  # a decilitre
_MIN_SHARE = 0.01  # of the smaller piece
_MAX_FACES = 60_000  # beyond it the boolean takes too long
MAX_PIECES = 2_000  # audited; a home has some hundred
MAX_PAIRS = 4_000  # of pieces whose boxes meet, intersected; a home has some hundred


def furniture_audit(house: House) -> FurnitureAudit:
    """Report implausible furniture positions; nothing is changed.

    Overlaps are exact for the closed shells of each piece; open meshes have no volume and are
    skipped, as are pieces of more than 60,000 triangles. Floating: its bounding box, grown by 2 cm,
    touches no other item's. At most 2,000 pieces are audited and 4,000 touching pairs intersected; the
    remainder is counted.
    """
    everything = [i for i in house.items if _is_furniture(i)]
    pieces = everything[:MAX_PIECES]
    boxes = np.array([i.bounds for i in pieces]).reshape(-1, 2, 3)
    pairs = list(islice(_pairs_of_boxes(boxes, -_SAME_M), MAX_PAIRS + 1))
    return FurnitureAudit(
        overlaps=tuple(_find_overlaps(pieces, boxes, pairs[:MAX_PAIRS])),
        floating=tuple(_floating(house, pieces, boxes)),
        duplicates=tuple(islice(_duplicates(pieces, boxes), MAX_PAIRS)),
        n_unaudited=len(everything) - len(pieces),
        n_unmeasured=len(pairs) - len(pairs[:MAX_PAIRS]),
    )


def _is_furniture(item: Item) -> bool:
    fixed = item.kind.is_structure or item.kind in (ItemKind.DOOR, ItemKind.WINDOW)
    return not fixed and item.n_faces > 0


def _pairs_of_boxes(boxes: F64, by_m: float) -> Iterator[tuple[int, int]]:
    """Indices i < j of boxes (N, 2, 3) that meet when grown by by_m together."""
    for i in range(len(boxes)):
        clear = (boxes[i + 1 :, 0] > boxes[i, 1] + by_m) | (boxes[i + 1 :, 1] < boxes[i, 0] - by_m)
        for j in np.flatnonzero(~clear.any(1)):
            yield i, i + 1 + int(j)


def _find_overlaps(
    pieces: Sequence[Item], boxes: F64, pairs: Sequence[tuple[int, int]]
) -> Iterator[Overlap]:
    shells: dict[int, ClosedShells] = {}
    for i, j in pairs:
        # Bound the overlap by the boxes' first, which settles a cup on a table.
        low, high = np.maximum(boxes[i, 0], boxes[j, 0]), np.minimum(boxes[i, 1], boxes[j, 1])
        if np.prod(high - low) <= _MIN_VOLUME_M3:
            continue
        if max(pieces[i].n_faces, pieces[j].n_faces) > _MAX_FACES:
            continue
        for k in (i, j):
            if k not in shells:
                shells[k] = ClosedShells(pieces[k])
        # Intersect the solids near the shared box exactly.
        a, b = (shells[k].within(low, high) for k in (i, j))
        volume = float(common(a, b).volume()) if a is not None and b is not None else 0.0
        if volume <= _MIN_VOLUME_M3:
            continue
        wholes = (shells[k].within(*boxes[k]) for k in (i, j))
        share = volume / max(min(float(w.volume()) for w in wholes if w is not None), 1e-12)
        if share > _MIN_SHARE:
            yield Overlap(
                a=pieces[i].id,
                b=pieces[j].id,
                volume_m3=round(volume, 6),
                share=round(min(share, 1.0), 4),
            )


def _floating(house: House, pieces: Sequence[Item], boxes: F64) -> Iterator[Floating]:
    rest = [i for i in house.items if not _is_furniture(i) and i.n_faces]
    around = np.concatenate([boxes, np.array([i.bounds for i in rest]).reshape(-1, 2, 3)])
    for k, piece in enumerate(pieces):
        is_apart = (around[:, 0] > boxes[k, 1] + _TOUCH_M) | (around[:, 1] < boxes[k, 0] - _TOUCH_M)
        # Pass over what touches another item, and our own ceiling lights.
        touched = ~is_apart.any(1)
        touched[k] = False
        if touched.any() or (piece.lights and "added" in piece.tags):
            continue
        # Measure down to the highest item below.
        below = ~is_apart[:, [0, 2]].any(1) & (around[:, 1, 1] <= boxes[k, 0, 1])
        below[k] = False
        gap = boxes[k, 0, 1] - around[below, 1, 1].max() if below.any() else np.inf
        yield Floating(item_id=piece.id, gap_m=round(float(gap), 4) if np.isfinite(gap) else -1.0)


def _duplicates(pieces: Sequence[Item], boxes: F64) -> Iterator[tuple[str, str]]:
    for i, a in enumerate(pieces):
        # Compare places first: few pieces share one, and of those class and mesh size.
        difference = np.abs(boxes[i + 1 :] - boxes[i]).max((1, 2))
        for j in i + 1 + np.flatnonzero(difference < _SAME_M):
            b = pieces[int(j)]
            if (a.source_class, a.n_faces) == (b.source_class, b.n_faces):
                yield a.id, b.id
