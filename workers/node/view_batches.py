"""Group views into batches, one task each: a room's views, with enough work per batch; pure."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

TARGET_S: Final = 120.0  # work in a batch: above the overhead of a task, below an acceptable loss
MAX_S: Final = 300.0  # work in a batch of one room, whose views share loaded data


def batches_from_views(
    views: Sequence[tuple[str, str]], seconds_per_view: float, min_batches: int = 1
) -> tuple[tuple[str, ...], ...]:
    """(view id, room id) in order -> batches of view ids, each of about TARGET_S of work.

    A room's views stay together as long as they take at most MAX_S; small rooms share a batch.
    min_batches: about as many at least, so that a job of few houses keeps every slot busy.
    """
    per_batch = max(1, round(TARGET_S / seconds_per_view))
    most = max(1, math.floor(MAX_S / seconds_per_view))
    # Split jobs of few houses further, or slots would be idle.
    if min_batches > 1:
        per_batch = min(per_batch, math.ceil(len(views) / min_batches)) or 1
        most = min(most, per_batch)
    # Fill batches room by room: a small room joins the one before it while there is room.
    batches: list[list[str]] = []
    for room_views in _views_by_room(views):
        for part in _split_into_batches(room_views, most, per_batch):
            if batches and len(batches[-1]) + len(part) <= per_batch:
                batches[-1] += part
            else:
                batches.append(list(part))
    return tuple(tuple(batch) for batch in batches)


def _views_by_room(views: Sequence[tuple[str, str]]) -> list[list[str]]:
    rooms: dict[str, list[str]] = {}
    for view, room in views:
        rooms.setdefault(room, []).append(view)
    return list(rooms.values())


def _split_into_batches(views: list[str], most: int, per_batch: int) -> list[list[str]]:
    if len(views) <= most:
        return [views]
    return [views[k : k + per_batch] for k in range(0, len(views), per_batch)]
