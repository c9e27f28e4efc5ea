"""Doors and windows -> openings: outlines in SVG, and the solid each cuts from its walls; no effects."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Final

import mapbox_earcut
import numpy as np
import shapely
from svgelements import Arc, Close, CubicBezier, Line, Move, Path, QuadraticBezier

from pbrs_farm.core.arrays import F64, Points2
from pbrs_farm.core.house import Opening, Surface
from pbrs_farm.geometry.plan_surfaces import counter_clockwise
from pbrs_farm.read.sweethome3d.home_file.home_xml import DoorFrame, HomeWall, PlanPiece
from pbrs_farm.read.sweethome3d.home_file.parse_home import FULL_CUT_OUT
from pbrs_farm.read.sweethome3d.piece_models import HomeMaterials
from pbrs_farm.read.sweethome3d.placement import PieceFrame

MARGIN_M = 0.005  # how far a cutter reaches out of the outermost faces of its walls
WALL_REACH_M = 1.0  # before and behind a piece: walls farther off are not cut
MIN_HALF_M = 5e-4  # half a width or height; a smaller piece cuts nothing
PARALLEL_SINE = math.sin(math.radians(20.0))  # largest angle between a wall and the piece it holds


@dataclass(frozen=True, slots=True, eq=False)
class StandingWall:
    """A wall's plan polygon with its bottom and top height."""

    wall: HomeWall
    polygon: shapely.Geometry  # plan, m
    low: float  # world y of its foot
    high: float  # world y of its top
    board: float  # thickness of its baseboards, m


def opening_of(
    piece: PlanPiece,
    frame: PieceFrame,
    walls: list[StandingWall],
    materials: HomeMaterials,
    ids: tuple[str, str, str],
    material: int,
    *,
    is_window: bool,
) -> Opening | None:
    """The opening of a door or window, or None (with a note) outside of walls. ids: of opening, level, item."""
    assert piece.frame is not None
    outlines = _outlines(piece, piece.frame, materials)
    span = _depth_span(frame, piece.frame, walls)
    if span is None:
        materials.notes.add("opening-without-wall", piece.place, "touches no wall: it cuts nothing")
        return None
    # Bring the outlines into the piece's frame and extrude them through the walls.
    flat = [_local_outline(p, piece.frame, frame) for p in outlines]
    cutter = _extruded(flat, span, frame, material)
    low = np.min([p.min(0) for p in flat], axis=0)
    high = np.max([p.max(0) for p in flat], axis=0)
    # Give the opening's quad the outlines' box, halfway through the walls.
    middle = (span[0] + span[1]) / 2
    corners = [[low[0], low[1]], [high[0], low[1]], [high[0], high[1]], [low[0], high[1]]]
    quad = frame.world(np.array([[x, y, middle] for x, y in corners]))
    opening_id, level_id, item_id = ids
    return Opening(opening_id, level_id, item_id, is_window, cutter, quad, frame.axes[:, 2])


def _outlines(piece: PlanPiece, door: DoorFrame, materials: HomeMaterials) -> tuple[Points2, ...]:
    try:
        outlines = polygons_from_path(door.cut_out)
    except ValueError as error:
        materials.notes.add("bad-cut-out", piece.place, f"cutOutShape: {error}; cut as a rectangle")
        outlines = ()
    cut_outs = tuple(
        p for p in outlines if shapely.Polygon(p).is_valid and shapely.Polygon(p).area > 1e-6
    )
    return cut_outs or polygons_from_path(FULL_CUT_OUT)


def _local_outline(outline: Points2, door: DoorFrame, frame: PieceFrame) -> Points2:
    # From the unit square (y down from the top) to the piece's frame, counter-clockwise.
    x = door.wall_left + outline[:, 0] * door.wall_width
    y = door.wall_top + outline[:, 1] * door.wall_height
    local = np.stack([(x - 0.5) * frame.mirror, 0.5 - y], -1) * (2 * frame.half[:2])
    return counter_clockwise(local)


def _depth_span(
    frame: PieceFrame, door: DoorFrame, walls: list[StandingWall]
) -> tuple[float, float] | None:
    # Range of its walls along the piece's depth.
    half_x, half_y, half_z = frame.half
    low_y, high_y = frame.origin[1] - half_y, frame.origin[1] + half_y
    if min(half_x, half_y) < MIN_HALF_M:
        return None
    piece = _rectangle_cutout(frame, half_x, max(half_z, MIN_HALF_M))
    strip = _rectangle_cutout(frame, half_x * 0.98, half_z + WALL_REACH_M)
    spans = []
    for standing in walls:
        # Skip walls above or below the piece, and those its plan rectangle does not touch.
        if standing.high < low_y + 0.01 or standing.low > high_y - 0.01:
            continue
        shared = shapely.intersection(piece, standing.polygon)
        smaller = min(piece.area, float(shapely.area(standing.polygon)))
        if shared.is_empty or shared.area < 1e-4 * smaller:
            continue
        z = _depths(shared, frame)
        # Cut through the whole thickness of walls parallel to the piece.
        if _is_along(standing.wall, frame) and door.cuts_both_sides:
            parts = shapely.get_parts(shapely.intersection(strip, standing.polygon))
            near = [p for p in parts if p.intersects(piece)]
            z = np.concatenate([z, *(_depths(p, frame) for p in near)])
        # Add the baseboard, which protrudes from the wall.
        board = standing.board if _is_along(standing.wall, frame) else 0.0
        spans.append((float(z.min()) - board, float(z.max()) + board))
    if not spans:
        return None
    return min(s[0] for s in spans) - MARGIN_M, max(s[1] for s in spans) + MARGIN_M


def _is_along(wall: HomeWall, frame: PieceFrame) -> bool:
    if abs(wall.arc) > 1e-3:
        return True
    direction = np.array(wall.end) - np.array(wall.start)
    direction /= np.linalg.norm(direction)
    across = frame.axes[[0, 2], 2]
    return abs(float(direction @ across)) < PARALLEL_SINE * max(float(np.linalg.norm(across)), 1e-6)


def _rectangle_cutout(frame: PieceFrame, half_x: float, half_z: float) -> shapely.Polygon:
    local = np.array(
        [[-half_x, 0, -half_z], [half_x, 0, -half_z], [half_x, 0, half_z], [-half_x, 0, half_z]]
    )
    return shapely.Polygon(frame.world(local)[:, [0, 2]])


def _depths(shape: shapely.Geometry, frame: PieceFrame) -> F64:
    plan = shapely.get_coordinates(shape)
    return np.asarray((plan - frame.origin[[0, 2]]) @ frame.axes[[0, 2], 2])


def _extruded(
    outlines: list[Points2], span: tuple[float, float], frame: PieceFrame, material: int
) -> Surface:
    # A closed prism along the piece's depth for each outline (counter-clockwise).
    positions, faces, n = [], [], 0
    for outline in outlines:
        count = len(outline)
        back = np.column_stack([outline, np.full(count, span[0])])
        front = np.column_stack([outline, np.full(count, span[1])])
        cap = np.asarray(
            mapbox_earcut.triangulate_float64(outline, np.array([count], np.uint32)), np.int32
        ).reshape(-1, 3)
        a, b, c = (outline[cap[:, k]] for k in range(3))
        turn = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
        # Turn every cap triangle counter-clockwise.
        cap[turn < 0] = cap[turn < 0][:, [0, 2, 1]]
        # Join the two caps by two triangles an edge.
        i = np.arange(count, dtype=np.int32)
        j = np.roll(i, -1)
        sides = np.concatenate(
            [np.stack([i, j, j + count], -1), np.stack([i, j + count, i + count], -1)]
        )
        positions += [back, front]
        faces += [cap[:, [0, 2, 1]] + n, cap + count + n, sides + n]
        n += 2 * count
    world = frame.world(np.concatenate(positions))
    return Surface(
        "cutter", world.astype(np.float32), np.concatenate(faces).astype(np.int32), material
    )


MAX_TEXT: Final = 100_000  # characters
MAX_POINTS: Final = 20_000
MAX_CLOSES: Final = 1_000  # The library looks back for the start of a sub-path at every close

MAX_COORDINATE: Final = 1e6
CURVE_STEPS: Final = 16  # straight pieces of a curve
SVG_ARC_STEP_RAD: Final = math.radians(7.5)

# Kind of a curve, its control point that T or S reflects, and of which one of the curve before.
_SMOOTH: Final = ((QuadraticBezier, "control", "control"), (CubicBezier, "control1", "control2"))
# The library passes over letters it does not know: only these make a path.
_PATH: Final = re.compile(r"[\s,]*[Mm][MmLlHhVvCcSsQqTtAaZzEe0-9.,+\-\s]*")
_TRAILING_POINT: Final = re.compile(r"(?<=\d)\.(?!\d)")  # "1." is SVG, but not the library's


def polygons_from_path(text: str) -> tuple[Points2, ...]:
    """The path's closed sub-paths as polygons (N >= 3, 2); ValueError if invalid, too long or too large."""
    segments = _segments(text)
    # Bound the number of points before any is computed.
    if sum(_n_steps(s) for s in segments) > MAX_POINTS:
        raise ValueError(f"path of more than {MAX_POINTS} points")
    outlines: list[list[tuple[float, float]]] = []
    for before, segment in pairwise([None, *segments]):
        # Begin a sub-path at every move, and where drawing goes on after a close.
        if isinstance(segment, Move) or isinstance(before, Close):
            outlines.append([_xy(segment.end if isinstance(segment, Move) else segment.start)])
        n = _n_steps(segment)
        outlines[-1] += [_xy(segment.point(k / n)) for k in range(1, n)]
        outlines[-1].append(_xy(segment.end))
    polygons = [np.array(_without_repeats(outline), np.float64) for outline in outlines]
    if any(not (np.abs(polygon) <= MAX_COORDINATE).all() for polygon in polygons):
        raise ValueError(f"path with a coordinate beyond {MAX_COORDINATE:.0e}")
    return tuple(p for p in polygons if len(p) >= 3)


def _segments(text: str) -> list[Any]:
    """The path as absolute moves, lines, curves, arcs and closes."""
    if len(text) > MAX_TEXT:
        raise ValueError(f"path of {len(text)} characters, at most {MAX_TEXT} are read")
    if text.lower().count("z") > MAX_CLOSES:
        raise ValueError(f"path of more than {MAX_CLOSES} closes")
    if _PATH.fullmatch(text) is None:
        raise ValueError("no path: it starts with M and holds SVG's commands and numbers")
    try:
        segments = list(Path(_TRAILING_POINT.sub("", text)))
    except (ValueError, ArithmeticError, IndexError, TypeError):
        raise ValueError("no path: a command lacks numbers") from None
    # T reflects the control point of quadratic curves only, S that of cubic ones (SVG 1.1, 8.3.7).
    for before, segment in pairwise(segments):
        for kind, control, last in _SMOOTH:
            if isinstance(segment, kind) and segment.smooth:
                is_same = isinstance(before, kind)
                point = getattr(before, last) if is_same else segment.start
                setattr(segment, control, point.reflected_across(segment.start))
    return segments


def _n_steps(segment: Any) -> int:
    """Points that a segment adds: of arcs by their angle, of curves a fixed number."""
    if isinstance(segment, Arc):
        return max(1, math.ceil(abs(float(segment.sweep)) / SVG_ARC_STEP_RAD))
    return 1 if isinstance(segment, Move | Line | Close) else CURVE_STEPS


def _xy(point: Any) -> tuple[float, float]:
    return float(point.x), float(point.y)


def _without_repeats(points: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """The points without those that repeat the one before, the last and first too."""
    distinct: list[tuple[float, float]] = []
    for p in points:
        if not distinct or math.dist(p, distinct[-1]) > 1e-9:
            distinct.append(p)
    while len(distinct) > 1 and math.dist(distinct[0], distinct[-1]) <= 1e-9:
        distinct.pop()
    return distinct
