"""Upper edges of walls that are not level, below a roof: from a file's lines to a plan's walls; no effects."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np
import shapely
from shapely.geometry import LineString, Polygon

from pbrs_farm.core.arrays import F64
from pbrs_farm.generate.floor_plan import PlanWall

SLOPED_M: Final = 0.1  # edges that rise or fall by less are level: scans are no better
_BESIDE_M: Final = 0.45  # maximum distance between a built wall and its line in the file, metres
_HAIR_M: Final = 1e-6
_STRAIGHT_M: Final = 1e-3
_ALONG: Final = 0.98  # cosine of the angle between the two


class WallTop(NamedTuple):
    """A wall's upper edge: plan places along its line, metres, and heights above the floor there."""

    places: tuple[tuple[float, float], ...]
    heights: tuple[float, ...]

    @property
    def is_sloped(self) -> bool:
        """Whether it rises or falls."""
        return max(self.heights) - min(self.heights) > SLOPED_M

    def moved(self, dx: float, dz: float) -> WallTop:
        """The edge so far to the right and down the page."""
        return self._replace(places=tuple((x + dx, z + dz) for x, z in self.places))


def upper_edge(corners: Polygon) -> list[tuple[float, float]]:
    """(x, y) of the upper edge of a wall's outline, x along the wall; a step is two points at one x."""
    ring = shapely.get_coordinates(corners.exterior)
    low, high = float(ring[:, 0].min()), float(ring[:, 0].max())
    points: list[tuple[float, float]] = []
    for x in np.unique(ring[:, 0].round(4)).tolist():
        # A hair to either side of a corner: the edge may step there.
        for beside in (x - _HAIR_M, x + _HAIR_M):
            if low < beside < high and (y := _height_at(ring, beside)) is not None:
                points.append((x, round(y, 4)))
    return _without_straight(points)


def _without_straight(edge: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """The edge without points that its neighbours' line goes through."""
    edge_kept = list(edge[:1])
    for point, after in itertools.pairwise(edge[1:]):
        if LineString([edge_kept[-1], after]).distance(shapely.Point(point)) > _STRAIGHT_M:
            edge_kept.append(point)
    return [*edge_kept, *edge[1:][-1:]]


def _height_at(ring: F64, x: float) -> float | None:
    a, b = ring[:-1], ring[1:]
    spans = (a[:, 0] - x) * (b[:, 0] - x) < 0
    if not spans.any():
        return None
    a, b = a[spans], b[spans]
    t = (x - a[:, 0]) / (b[:, 0] - a[:, 0])
    return float((a[:, 1] + t * (b[:, 1] - a[:, 1])).max())


def with_tops(walls: Sequence[PlanWall], tops: Sequence[WallTop]) -> tuple[PlanWall, ...]:
    """The walls, but for parapets, with the upper edges of their lines, else of the nearest at each end."""
    if not tops:
        return tuple(walls)
    lines = [LineString(top.places) for top in tops]
    return tuple(
        wall if wall.height is not None else replace(wall, tops=_tops_of(wall, tops, lines))
        for wall in walls
    )


def _tops_of(
    wall: PlanWall, tops: Sequence[WallTop], lines: Sequence[LineString]
) -> tuple[tuple[float, float], ...]:
    spans = [_span_beside(wall, line) for line in lines]
    best = max(range(len(tops)), key=lambda k: spans[k])
    if spans[best] <= 0:
        ends = [shapely.Point(wall.start), shapely.Point(wall.end)]
        nearest = [_nearest_height(end, tops, lines) for end in ends]
        return (0.0, nearest[0]), (wall.length, nearest[1])
    way = np.subtract(wall.end, wall.start) / wall.length
    along = (np.array(tops[best].places) - np.array(wall.start)) @ way
    heights = np.array(tops[best].heights)
    if along[-1] < along[0]:
        along, heights = along[::-1], heights[::-1]
    # Its ends as high as the edge ends, and every bend between.
    inner = [
        (float(t), float(h))
        for t, h in zip(along, heights, strict=True)
        if 0.01 < t < wall.length - 0.01
    ]
    first, last = (float(np.interp(t, along, heights)) for t in (0.0, wall.length))
    return tuple(_without_straight([(0.0, first), *inner, (wall.length, last)]))


def _span_beside(wall: PlanWall, line: LineString) -> float:
    """Metres of the wall that lie along a line of the file; 0 = it follows another one."""
    a, b = (np.array(line.coords[k]) for k in (0, -1))
    way = np.subtract(wall.end, wall.start) / wall.length
    length = float(np.hypot(*(b - a)))
    if length < 1e-6 or abs((b - a) @ way) < _ALONG * length:
        return 0.0
    ground = LineString([wall.start, wall.end])
    if ground.distance(line) > _BESIDE_M:
        return 0.0
    ends = sorted((p - np.array(wall.start)) @ way for p in (a, b))
    return float(max(min(ends[1], wall.length) - max(ends[0], 0.0), 0.0))


def _nearest_height(
    place: shapely.Point, tops: Sequence[WallTop], lines: Sequence[LineString]
) -> float:
    k = min(range(len(tops)), key=lambda k: lines[k].distance(place))
    far = lines[k].project(place)
    steps = np.hypot(*np.diff(np.array(tops[k].places), axis=0).T)
    return float(np.interp(far, np.concatenate([[0.0], np.cumsum(steps)]), tops[k].heights))
