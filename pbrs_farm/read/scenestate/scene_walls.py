"""Walls of a sceneState: orientation, and merging of walls listed by two rooms; no effects.

A wall of one room is a slab outward of its line. A wall between two rooms is centred on its line, and
is one wall if both rooms list it, even with different stretches.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, Final

import numpy as np
import shapely

from pbrs_farm.core.arrays import F64
from pbrs_farm.read.common.arch_elements import WALL_DEPTH_M, Element, WallFrame
from pbrs_farm.read.scenestate.scene_document import SceneElement

_BESIDE_M: Final = 0.06  # from a wall's line to the floor beside it
_SAME_M: Final = 0.02  # lines and ends nearer than this are one
_TURN: Final = 0.0175  # lines that differ less in direction are one, radians
_OFF_GRID: Final = 0.0037  # keeps round numbers away from the borders of cells


@dataclass(frozen=True, slots=True, eq=False)
class StandingWall:
    """A wall with its frame: start, axes (along, up, out of its first room), length."""

    id: str
    element: Element
    frame: WallFrame
    rooms: tuple[str, ...]
    is_between: bool  # two rooms


def standing_walls(
    elements: Sequence[SceneElement], floors: Mapping[str, Any]
) -> tuple[list[StandingWall], list[StandingWall]]:
    """(all walls as drawn, with frames; the merged walls). floors: room -> shapely area."""
    tree = shapely.STRtree(list(floors.values()))
    names = list(floors)
    drawn = [w for element in elements if (w := _stand_wall(element, tree, names)) is not None]
    lines: dict[tuple[int, int], list[int]] = defaultdict(list)
    for k, wall in enumerate(drawn):
        if wall.is_between:
            lines[_line_key(wall)].append(k)
    # Merge collinear walls; leave the others unchanged.
    united = {k: pieces for ks in lines.values() if len(ks) > 1 for k, pieces in _united(drawn, ks)}
    standing: list[StandingWall] = []
    for k, wall in enumerate(drawn):
        standing += united.get(k, [wall])
    return drawn, standing


def _stand_wall(element: SceneElement, tree: Any, names: list[str]) -> StandingWall | None:
    e = element.element
    if e.depth_m <= 0:
        e = replace(e, depth_m=WALL_DEPTH_M)
    start, end = e.points[0]
    along = (end - start) * [1, 0, 1]
    length = float(np.linalg.norm(along))
    if length < _SAME_M or e.height_m <= 0:
        return None
    along /= length
    leftward = np.array([along[2], 0.0, -along[0]])
    sides = [_rooms_beside(start, end, sign * leftward, tree, names) for sign in (1, -1)]
    is_own = [bool(set(side) & set(element.rooms)) for side in sides]
    is_between = len(element.rooms) > 1 or all(sides)
    # Outward from the first room that lists it, else from the adjacent floor.
    is_left_in = is_own[0] if is_own[0] != is_own[1] else bool(sides[0]) and not sides[1]
    first = element.rooms[:1]
    if is_between and first and is_own == [True, True]:
        is_left_in = first[0] in sides[0]
    outward = -leftward if is_left_in else leftward
    if is_between:
        start = start - outward * e.depth_m / 2
    up = np.array([0.0, 1.0, 0.0])
    frame = WallFrame(start, np.stack([along, up, outward], 1), length)
    return StandingWall(element.id, e, frame, element.rooms, is_between)


def _rooms_beside(start: F64, end: F64, side: F64, tree: Any, names: list[str]) -> list[str]:
    """The rooms whose floors lie on a side of a wall, at its middle or its quarters."""
    shares = np.array([0.5, 0.25, 0.75])[:, None]
    points = start + shares * (end - start) + _BESIDE_M * side
    for point in points:
        hits = tree.query(shapely.Point(point[0], point[2]), predicate="within")
        if len(hits):
            return [names[k] for k in hits]
    return []


def _line_key(wall: StandingWall) -> tuple[int, int]:
    along, _up, _out = wall.frame.axes.T
    if (along[0], along[2]) < (0.0, 0.0) or (abs(along[0]) < 1e-9 and along[2] < 0):
        along = -along
    normal = np.array([-along[2], along[0]])
    middle = wall.element.points[0].mean(0)[[0, 2]]
    turn = np.arctan2(along[2], along[0])
    return (
        int(np.floor((turn + _OFF_GRID) / _TURN)),
        int(np.floor((float(middle @ normal) + _OFF_GRID) / _SAME_M)),
    )


def _united(
    drawn: Sequence[StandingWall], on_line: Sequence[int]
) -> list[tuple[int, list[StandingWall]]]:
    """For each wall on a line the merged pieces that replace it: those listed by it first."""
    first = drawn[on_line[0]]
    origin, axis = first.frame.start, first.frame.axes[:, 0]
    spans = {k: _span(drawn[k], origin, axis) for k in on_line}
    cuts = sorted(v for span in spans.values() for v in span)
    cuts = [c for i, c in enumerate(cuts) if i == 0 or c - cuts[i - 1] > _SAME_M / 2]
    pieces: dict[int, list[tuple[float, float, tuple[int, ...]]]] = {k: [] for k in on_line}
    for low, high in pairwise(cuts):
        middle = (low + high) / 2
        on_span = tuple(k for k in on_line if spans[k][0] < middle < spans[k][1])
        on_span = tuple(k for k in on_span if _same_height(drawn[k], drawn[on_span[0]]))
        if not on_span:
            continue
        runs = pieces[on_span[0]]
        if runs and runs[-1][2] == on_span and low - runs[-1][1] < _SAME_M:
            runs[-1] = (runs[-1][0], high, on_span)
        else:
            runs.append((low, high, on_span))
    parts = []
    for k in on_line:
        runs = pieces[k]
        # A wall listed by one room only keeps its id and its ends.
        whole = len(runs) == 1 and runs[0][2] == (k,)
        parts.append((k, [drawn[k]] if whole else _cut_at_crossings(drawn, k, runs, origin, axis)))
    return parts


def _span(wall: StandingWall, origin: F64, axis: F64) -> tuple[float, float]:
    ends = (wall.element.points[0] - origin) @ axis
    return float(ends.min()), float(ends.max())


def _same_height(a: StandingWall, b: StandingWall) -> bool:
    low = max(a.frame.start[1], b.frame.start[1])
    high = min(w.frame.start[1] + w.element.height_m for w in (a, b))
    return bool(high - low > 0.5 * min(a.element.height_m, b.element.height_m))


def _cut_at_crossings(
    drawn: Sequence[StandingWall],
    k: int,
    runs: list[tuple[float, float, tuple[int, ...]]],
    origin: F64,
    axis: F64,
) -> list[StandingWall]:
    wall = drawn[k]
    e, axes = wall.element, wall.frame.axes
    cut_walls = []
    for number, (low, high, numbers) in enumerate(runs):
        other_walls = [drawn[j] for j in numbers if j != k]
        # The other room's inside paint is this wall's outside paint.
        back = next((o for o in other_walls if o.frame.axes[:, 2] @ axes[:, 2] < 0), None)
        overrides = e.overrides
        if back is not None and back.element.overrides and e.overrides:
            overrides = (e.overrides[0], back.element.overrides[0])
        # The piece runs the way its wall runs.
        ends = [low, high] if float(axes[:, 0] @ axis) > 0 else [high, low]
        offset = (origin - wall.frame.start) @ axes[:, 0]
        start = wall.frame.start + axes[:, 0] * (offset + ends[0] * float(axes[:, 0] @ axis))
        top = max(w.frame.start[1] + w.element.height_m for w in (wall, *other_walls))
        depth = max(w.element.depth_m for w in (wall, *other_walls))
        start = start + axes[:, 2] * (e.depth_m - depth) / 2
        piece = replace(
            e,
            overrides=overrides,
            height_m=float(top - start[1]),
            depth_m=depth,
            holes=(),
            hole_types=(),
        )
        rooms = tuple(dict.fromkeys(r for w in (wall, *other_walls) for r in w.rooms))
        name = wall.id if number == 0 else f"{wall.id}.{number}"
        cut_walls.append(
            StandingWall(name, piece, WallFrame(start, axes, high - low), rooms, is_between=True)
        )
    return cut_walls
