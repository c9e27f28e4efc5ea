"""Views into groups that are one task each: a room's views, so many that the work is worth it; pure."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

TARGET_S: Final = 120.0
MAX_S: Final = 300.0


def groups_from_views(
    views: Sequence[tuple[str, str]], seconds_per_view: float, min_groups: int = 1
) -> tuple[tuple[str, ...], ...]:
    """(view id, room id) in order -> groups of view ids, each of about TARGET_S of work.

    A room's views stay together as long as they take at most MAX_S; small rooms share a group.
    min_groups: about as many at least, so that a job of few houses keeps every slot busy.
    """
    per_group = max(1, round(TARGET_S / seconds_per_view))
    most = max(1, math.floor(MAX_S / seconds_per_view))
    if min_groups > 1:
        per_group = min(per_group, math.ceil(len(views) / min_groups)) or 1
        most = min(most, per_group)
    groups: list[list[str]] = []
    for room_views in _rooms(views):
        for part in _parts(room_views, most, per_group):
            if groups and len(groups[-1]) + len(part) <= per_group:
                groups[-1] += part
            else:
                groups.append(list(part))
    return tuple(tuple(group) for group in groups)


def _rooms(views: Sequence[tuple[str, str]]) -> list[list[str]]:
    rooms: dict[str, list[str]] = {}
    for view, room in views:
        rooms.setdefault(room, []).append(view)
    return list(rooms.values())


def _parts(views: list[str], most: int, per_group: int) -> list[list[str]]:
    if len(views) <= most:
        return [views]
    return [views[k : k + per_group] for k in range(0, len(views), per_group)]
