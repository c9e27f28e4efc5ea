"""Middle lines of walls -> the outlines that they close; no effects."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
import shapely
from shapely.geometry import LineString, Point, Polygon
from shapely.ops import polygonize, unary_union

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.errors import BadInput
from pbrs_farm.geometry.doorways import HALF_M, NARROWEST_M, WIDEST_M, doorways

Line = tuple[tuple[float, float], tuple[float, float]]

MAX_LINES: Final = 600
_MOST_CROSSINGS: Final = 2_000
_SHORTEST_M: Final = 0.15
_JOIN_M: Final = 0.1
_LEAST_M2: Final = 1.0
_BESIDE_M: Final = 0.25  # a room's side may run so far beside its wall's middle
_SAME_SIDE_M: Final = 0.06


def closed_rings(path: Path, lines: Sequence[Line], join_m: float = _JOIN_M) -> list[Polygon]:
    """The rooms that walls close, the largest first, ends within join_m joined; BadInput names the least gap."""
    if len(lines) > MAX_LINES:
        raise BadInput(path, "walls", f"has {len(lines)} walls, at most {MAX_LINES} are read")
    walls = [line for line in lines if math.dist(*line) >= _SHORTEST_M]
    ends = np.array([p for line in walls for p in line], np.float64).reshape(-1, 2)
    if not len(ends) or not np.isfinite(ends).all() or np.abs(ends).max() > 1e9:
        raise BadInput(path, "walls", "has no wall between two places in metres")
    joined = _join_near_ends(ends, join_m).reshape(-1, 2, 2)
    # Draw each wall out by a little, so that ends that stop short of a wall's middle meet it.
    drawn = [_longer(a, b, join_m) for a, b in joined if np.hypot(*(b - a)) > 1e-6]
    if not drawn:
        raise BadInput(path, "walls", "has walls so near each other that no room is between them")
    crossings = len(shapely.STRtree(drawn).query(drawn, "intersects")[0]) // 2
    if crossings > _MOST_CROSSINGS + len(drawn):
        text = f"its {len(drawn)} walls cross {crossings} times: no plan"
        raise BadInput(path, "walls", text)
    middles = [LineString(pair) for pair in joined if (pair[0] != pair[1]).any()]
    # A wall that ends at a doorway goes on behind it.
    standing = unary_union([line.buffer(HALF_M, cap_style="flat") for line in middles])
    noded = unary_union([*drawn, *middles, *doorways(standing, HALF_M + join_m)])
    rooms = [p for p in polygonize(noded) if p.area >= _LEAST_M2]
    if not rooms:
        gap, position = _widest_gap(ends)
        text = f"walls close no room: the widest gap, {gap:.2f} m, is at ({position[0]:.2f}, {position[1]:.2f})"
        raise BadInput(path, "walls", text, hint=f"ends within {join_m:g} m are joined")
    whole = [Polygon(p.exterior) if not p.interiors else p for p in rooms]
    return sorted((Polygon(p.exterior) for p in whole), key=lambda p: -p.area)


def passages_between(
    rooms: Sequence[Polygon], lines: Sequence[Line], openings: Sequence[dict[str, Any]]
) -> list[dict[str, Any]]:
    """Rows of passages: door-sized gaps between two rooms' walls (centre lines) without an opening."""
    walls = [LineString(line) for line in lines if line[0] != line[1]]
    standing = unary_union([wall.buffer(_BESIDE_M, cap_style="flat") for wall in walls])
    opening_points = [Point(o["at"]) for o in openings]
    passages: list[dict[str, Any]] = []
    for k, room in enumerate(rooms):
        for neighbour in rooms[:k]:
            shared = room.buffer(_SAME_SIDE_M).intersection(neighbour.exterior).difference(standing)
            for gap in shapely.get_parts(shapely.line_merge(shared)):
                middle = gap.interpolate(0.5, normalized=True)
                is_door = NARROWEST_M - _JOIN_M <= gap.length <= WIDEST_M + _JOIN_M
                if is_door and not any(p.distance(middle) < gap.length / 2 for p in opening_points):
                    row = {"at": [middle.x, middle.y], "width": gap.length, "kind": "passage"}
                    passages.append(row)
    return passages


def _join_near_ends(ends: F64, join_m: float) -> F64:
    """The ends, each group of those near each other at one place."""
    points = [Point(end) for end in ends]
    first, second = shapely.STRtree(points).query(points, "dwithin", join_m)
    group = np.arange(len(ends))
    # The least number of a neighbour, again and again: groups grow together.
    for _ in range(len(ends)):
        least = group.copy()
        np.minimum.at(least, first, group[second])
        if (least == group).all():
            break
        group = least
    sums = np.zeros((len(ends), 2))
    np.add.at(sums, group, ends)
    counts = np.bincount(group, minlength=len(ends))
    return np.asarray((sums / np.maximum(counts, 1)[:, None])[group])


def _longer(a: F64, b: F64, by: float) -> LineString:
    way = (b - a) / np.hypot(*(b - a)) * by
    return LineString([a - way, b + way])


def _widest_gap(ends: F64) -> tuple[float, F64]:
    """The widest of the gaps from an end to the nearest end of another wall, and where it is."""
    away = np.full(len(ends), np.inf)
    for k in range(len(ends)):
        other_ends = np.delete(ends, [k, k ^ 1], axis=0)
        if len(other_ends):
            away[k] = np.hypot(*(other_ends - ends[k]).T).min()
    finite = np.where(np.isfinite(away), away, 0.0)
    k = int(np.argmax(finite))
    return float(finite[k]), ends[k]
