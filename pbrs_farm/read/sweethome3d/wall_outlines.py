"""Plan outlines of walls: straight or arc, mitred with their neighbours. No effects."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import shapely

from pbrs_farm.core.arrays import Points2
from pbrs_farm.read.sweethome3d.home_file.home_xml import HomeWall

ARC_STEP_RAD = math.radians(5.0)  # angle of each straight piece of an arc
MITRE_LIMIT = 2.0  # farthest a mitred corner may move, in wall thicknesses
MIN_LENGTH_M = 1e-4  # least length and thickness of a wall


@dataclass(frozen=True, slots=True, eq=False)
class Outline:
    """A wall's two sides in plan, from its start to its end."""

    left: Points2  # (N, 2)
    right: Points2  # (N, 2)
    along: np.ndarray[tuple[int], np.dtype[np.float64]]  # (N,) 0 at the start, 1 at the end

    @property
    def polygon(self) -> Points2:
        """(2N, 2) around the wall."""
        return np.concatenate([self.left, self.right[::-1]])


def outlines_of(walls: tuple[HomeWall, ...]) -> dict[str, Outline]:
    """Mitred outline of each wall by id; walls without length or thickness are omitted."""
    bare = {w.id: _unjoined(w) for w in walls if _has_size(w)}
    order = {w.id: k for k, w in enumerate(walls)}
    by_id = {w.id: w for w in walls}
    joined = {}
    for wall_id, outline in bare.items():
        wall = by_id[wall_id]
        left, right = outline.left.copy(), outline.right.copy()
        for at_start, other_id in ((True, wall.at_start), (False, wall.at_end)):
            neighbour = by_id.get(other_id)
            if neighbour is None or other_id not in bare or other_id == wall_id:
                continue
            _join(wall, neighbour, at_start, (left, right), bare, order)
        # Take the mitred outline where it is a simple polygon.
        mitred = Outline(left, right, outline.along)
        joined[wall_id] = mitred if _is_sound(mitred, outline) else outline
    return joined


def _is_sound(mitred: Outline, bare: Outline) -> bool:
    # Mitres of a wall shorter than its neighbours are thick can cross each other.
    a, b = shapely.Polygon(mitred.polygon), shapely.Polygon(bare.polygon)
    return bool(a.is_valid and (a.exterior.is_ccw == b.exterior.is_ccw or not b.is_valid))


def _has_size(wall: HomeWall) -> bool:
    return math.dist(wall.start, wall.end) > MIN_LENGTH_M and wall.thickness > MIN_LENGTH_M


def _unjoined(wall: HomeWall) -> Outline:
    start, end = np.array(wall.start), np.array(wall.end)
    half = wall.thickness / 2
    if abs(wall.arc) > 1e-3 and abs(wall.arc) < 2 * math.pi - 1e-3:
        return _arc(wall, start, end, half)
    # Offset the centre line by half the thickness to either side.
    along = (end - start) / np.linalg.norm(end - start)
    offset = np.array([along[1], -along[0]]) * half
    line = np.stack([start, end])
    return Outline(line + offset, line - offset, np.array([0.0, 1.0]))


def _arc(wall: HomeWall, start: Points2, end: Points2, half: float) -> Outline:
    # Find the circle's centre from the chord and the angle it spans.
    chord = end - start
    centre = (start + end) / 2 + np.array([-chord[1], chord[0]]) / (2 * math.tan(wall.arc / 2))
    # Walk the arc in equal steps, and put the sides inside and outside of it.
    n = max(2, math.ceil(abs(wall.arc) / ARC_STEP_RAD))
    along = np.linspace(0.0, 1.0, n + 1)
    first = math.atan2(start[1] - centre[1], start[0] - centre[0])
    angles = first + wall.arc * along
    outward = np.stack([np.cos(angles), np.sin(angles)], -1)
    radius = float(np.linalg.norm(start - centre))
    # Turning clockwise on the plan (positive extent) keeps the centre on the right.
    sign = 1.0 if wall.arc > 0 else -1.0
    left_side = centre + outward * max(0.0, radius + sign * half)
    right = centre + outward * max(0.0, radius - sign * half)
    return Outline(left_side, right, along)


def _join(
    wall: HomeWall,
    other: HomeWall,
    at_start: bool,
    sides: tuple[Points2, Points2],
    bare: dict[str, Outline],
    order: dict[str, int],
) -> None:
    # Replace the wall's two points at one end by the crossings of the side lines.
    other_at_start = _joins_at_start(wall, other, at_start)
    if other_at_start is None:
        return
    limit = MITRE_LIMIT * max(wall.thickness, other.thickness)
    mine, theirs = bare[wall.id], bare[other.id]
    end, inner = (0, 1) if at_start else (-1, -2)
    other_end, beyond = (0, 1) if other_at_start else (-1, -2)
    # Two walls that both start (or both end) at the joint run against each other.
    swapped = at_start == other_at_start
    pairs = (
        (sides[0], mine.left, theirs.right if swapped else theirs.left),
        (sides[1], mine.right, theirs.left if swapped else theirs.right),
    )
    for target, line, facing in pairs:
        # Cross the earlier wall's line with the later one's: both walls get the same bits.
        a, b = (line[end], line[inner]), (facing[other_end], facing[beyond])
        crossing = _crossing(*b, *a) if order[wall.id] > order[other.id] else _crossing(*a, *b)
        # Move the corner to the crossing unless the mitre would be too long.
        if crossing is not None and math.dist(crossing, line[end]) < limit:
            target[end] = crossing


def _joins_at_start(wall: HomeWall, other: HomeWall, at_start: bool) -> bool | None:
    # Which end of the other wall meets this one; by its own links, else by the nearer end.
    back_start, back_end = other.at_start == wall.id, other.at_end == wall.id
    if back_start != back_end:
        return back_start
    if not back_start:
        return None
    point = wall.start if at_start else wall.end
    return math.dist(other.start, point) <= math.dist(other.end, point)


def _crossing(p0: Points2, p1: Points2, q0: Points2, q1: Points2) -> Points2 | None:
    # Where two lines meet, None if they are parallel to within 1e-6 or so.
    d, e = p1 - p0, q1 - q0
    turn = d[0] * e[1] - d[1] * e[0]
    if abs(turn) <= 1e-5 * float(np.linalg.norm(d) * np.linalg.norm(e)):
        return None
    w = q0 - p0
    t = (w[0] * e[1] - w[1] * e[0]) / turn
    return np.asarray(p0 + t * d)
