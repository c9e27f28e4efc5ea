"""Walls and baseboards -> items: closed, uncut solids, mitred with their neighbours; no effects."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import shapely

from pbrs_farm.core.arrays import F64, Points2
from pbrs_farm.core.classes import WALL
from pbrs_farm.core.house import Item, ItemKind, Surface
from pbrs_farm.geometry.solids import wall_prism
from pbrs_farm.read.sweethome3d.home_file.home_xml import (
    Baseboard,
    HomePlan,
    HomeWall,
    Paint,
    PlanLevel,
    PlanPicture,
    level_of,
)
from pbrs_farm.read.sweethome3d.piece_models import HomeMaterials

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


SUNK_M = 0.002  # Depth of a baseboard's back inside its wall, to avoid coplanar faces


def wall_items(
    plan: HomePlan,
    outlines: dict[str, Outline],
    materials: HomeMaterials,
    house_level: dict[str, str],
) -> list[Item]:
    """An item for each visible wall, closed, mitred, without holes, each followed by its baseboards."""
    items: list[Item] = []
    widened = outlines_of(tuple(_with_baseboards(w) for w in plan.walls))
    for wall in plan.walls:
        level = level_of(plan, wall.level)
        if not level.is_visible:
            continue
        outline = outlines.get(wall.id)
        place = f"wall {wall.id}"
        if outline is None:
            materials.notes.add("degenerate-wall", place, "no length or no thickness: left out")
            continue
        if max(wall.height, wall.height_end or 0.0) <= 1e-3:
            materials.notes.add("degenerate-wall", place, "no height: left out")
            continue
        level_id = house_level[level.id]
        items.append(_wall_item(wall, outline, level, materials, level_id))
        for board in wall.baseboards:
            sides = (outline, widened[wall.id])
            item = _baseboard_item(wall, board, sides, level, materials, level_id)
            if item is not None:
                items.append(item)
    return items


def top_heights(wall: HomeWall, points: F64, along: F64) -> F64:
    """(N,) heights above the level of a wall's top, planar or, of an arc, along it, over plan points."""
    low, high = wall.height, wall.height if wall.height_end is None else wall.height_end
    if wall.height_end is None or abs(wall.arc) > 1e-3:
        return np.asarray(low + (high - low) * along)
    start, end = np.array(wall.start), np.array(wall.end)
    direction = end - start
    t = (points - start) @ direction / float(direction @ direction)
    return np.asarray(np.maximum(low + (high - low) * t, 0.0))


def _wall_item(
    wall: HomeWall, outline: Outline, level: PlanLevel, materials: HomeMaterials, level_id: str
) -> Item:
    place = f"wall {wall.id}"
    sides = (
        materials.painted(wall.left, "wall", f"{place} left"),
        materials.painted(wall.right, "wall", f"{place} right"),
        materials.painted(wall.right if wall.left.is_empty else wall.left, "wall", place),
    )
    # Extend the wall down through the floor slab.
    foot = level.elevation - level.reach_down
    left_top = level.elevation + top_heights(wall, outline.left, outline.along)
    right_top = level.elevation + top_heights(wall, outline.right, outline.along)
    surfaces = wall_prism(
        outline.left,
        outline.right,
        foot,
        np.maximum(left_top, foot + 1e-3),
        np.maximum(right_top, foot + 1e-3),
        sides,
        top=materials.painted(wall.top, "wall top", f"{place} top"),
    )
    painted = tuple(
        _textured(s, paint, level.elevation)
        for s, paint in zip(surfaces, (wall.left, wall.right, *[Paint()] * 4), strict=True)
    )
    return Item(
        id=f"wall_{wall.id}",
        name=f"Wall {wall.id}",
        kind=ItemKind.WALL,
        level_id=level_id,
        surfaces=painted,
        nyu40=WALL,
        source_class="wall",
        tags=("arc",) if abs(wall.arc) > 1e-3 else (),
    )


def _baseboard_item(
    wall: HomeWall,
    board: Baseboard,
    outlines: tuple[Outline, Outline],
    level: PlanLevel,
    materials: HomeMaterials,
    level_id: str,
) -> Item | None:
    side = "left" if board.is_left else "right"
    line, front = (o.left if board.is_left else o.right for o in outlines)
    back = line - SUNK_M * (_outward(line) if board.is_left else -_outward(line))
    # End the board below the lowest top of the wall.
    height = min(board.height, float(top_heights(wall, line, outlines[0].along).min()))
    if height <= 1e-3:
        return None
    # A board without paint takes its side's.
    paint = board.paint
    if paint.is_empty:
        paint = wall.left if board.is_left else wall.right
    material = materials.painted(paint, "baseboard", f"wall {wall.id} {side} baseboard")
    top = np.full(len(line), level.elevation + height)
    near, far = (front, back) if board.is_left else (back, front)
    surfaces = wall_prism(near, far, level.elevation, top, top, (material,) * 3)
    return Item(
        id=f"wall_{wall.id}_{side}_baseboard",
        name=f"Baseboard of wall {wall.id}, {side}",
        kind=ItemKind.WALL,
        level_id=level_id,
        surfaces=tuple(_textured(s, paint, level.elevation) for s in surfaces),
        nyu40=WALL,
        source_class="baseboard",
        tags=("baseboard", f"baseboard_of:wall_{wall.id}"),
    )


def _with_baseboards(wall: HomeWall) -> HomeWall:
    # The wall thickened by its baseboards, whose mitred outline is the boards' front.
    most = max((b.thickness for b in wall.baseboards), default=0.0)
    return replace(wall, thickness=wall.thickness + 2 * most)


def _outward(line: F64) -> F64:
    # Unit vectors to the left of a polyline (plan with y down), mitred at its inner points.
    step = np.diff(line, axis=0)
    step = step / np.maximum(np.linalg.norm(step, axis=1, keepdims=True), 1e-12)
    normal = np.stack([step[:, 1], -step[:, 0]], -1)
    mean = np.concatenate([normal[:1], normal[:-1] + normal[1:], normal[-1:]])
    # Lengthen the mitre, so that the offset lines keep their distance.
    mean[1:-1] /= np.maximum((mean[1:-1] * normal[1:]).sum(1, keepdims=True), 1e-6)
    return np.asarray(mean)


def _textured(surface: Surface, paint: Paint, floor_y: float) -> Surface:
    picture = paint.picture
    if picture is None or surface.uvs is None:
        return surface
    metres = surface.uvs.astype(np.float64)
    # Measure v from the level's floor: textures of neighbouring walls meet.
    metres[:, 1] = surface.positions[:, 1] - floor_y
    return replace(surface, uvs=picture_uvs(metres, picture).astype(np.float32))


def picture_uvs(metres: F64, picture: PlanPicture) -> F64:
    """(N, 2) texture coordinates of points given in metres along a surface (right, up)."""
    c, s = np.cos(picture.angle), np.sin(picture.angle)
    # Turn, scale to the picture's size, then move by its offset.
    turned = metres @ np.array([[c, -s], [s, c]])
    size = np.array([picture.width, picture.height]) * picture.scale
    return np.asarray(turned / size - np.array(picture.offset))
