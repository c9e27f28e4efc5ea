"""Doorways between walls that end: gaps that part one room from the next, though no wall does; no effects."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, Final

import numpy as np
import shapely
from shapely.geometry import LineString, Point, Polygon
from shapely.geometry.base import BaseGeometry
from shapely.ops import polygonize, unary_union

from pbrs_farm.core.arrays import F64
from pbrs_farm.geometry.plan_surfaces import polygons_in

NARROWEST_M: Final = 0.5
WIDEST_M: Final = (
    1.3  # of a doorway with one leaf and its frame; wider gaps join two parts of a room
)
_WIDEST_WITH_DOOR_M: Final = 3.0  # of a doorway with leaves in it
_AT_GAP_M: Final = 0.15  # maximum distance of a door from its gap's middle line
LEAST_M2: Final = 1.2  # of what a doorway leads into
_LEAST_WIDTH_M: Final = 0.7
_THICKEST_M: Final = 0.6  # of a wall that ends
_LEAST_LONG_M: Final = 0.3  # of the wall behind its end
_THINNEST_M: Final = 0.004
_ACROSS_M: Final = 0.01  # half the width that a doorway is closed by
_SLIVER_M2: Final = 1e-4  # smaller pieces come of rounding
_OFF_M: Final = 1e-3  # off the end itself
_SQUARE: Final = 0.9  # least cosine between a wall's sides and the way out of its end
_AT_EDGE_M: Final = 0.15  # walls nearer to the edge of a ground are its own
HALF_M: Final = 0.05  # half the thickness that walls without one are given
_JOIN_M: Final = 0.1  # maximum gap between touching walls, metres
_REACH_M: Final = (
    0.02  # extension into the walls at both ends, so that rooms are fully separated, metres
)


def doorways(
    walls: Any, reach_m: float = _REACH_M, doors: Sequence[Polygon] = ()
) -> list[LineString]:
    """A line across each door-sized gap between the end of a wall and the wall facing it.

    walls: their ground area as a shapely geometry, metres. reach_m: extension of each line into the
    walls. doors: ground areas of doors, shut or open; a gap that holds a door may be wider. A gap between two
    wall ends may be returned twice.
    """
    lines = []
    rings = [shapely.get_coordinates(ring) for ring in _rings(walls)]
    if not rings:
        return []
    faces: Any = shapely.linestrings(np.concatenate([np.stack([r[:-1], r[1:]], 1) for r in rings]))
    near = shapely.STRtree(faces)
    for ring in rings:
        for start, way in _ends(ring[:-1]):
            gap = _gap_before(start, way, near, _WIDEST_WITH_DOOR_M if doors else WIDEST_M)
            if gap is not None and (gap <= WIDEST_M or _holds_door(start, way, gap, doors)):
                tip = way * reach_m
                lines.append(LineString([start - tip, start + way * gap + tip]))
    return lines


def door_line(middle: F64, way: F64, width: float) -> LineString:
    """The line that a door about middle (2,) along way closes, into the walls at both its sides."""
    half = way * (width / 2 + _JOIN_M)
    return LineString([middle - half, middle + half])


def parted_at_doorways(piece: Polygon, lines: Iterable[LineString]) -> list[Polygon]:
    """A piece of ground parted by lines with rooms on both sides; smaller rests go to a neighbour."""
    across = [line for line in lines if piece.intersects(line)]
    if not across:
        return [piece]
    faces = polygonize(unary_union([piece.boundary, *across]))
    parts: list[Any] = [f for f in faces if piece.contains(f.representative_point())]
    while small := sorted((p for p in parts if not _is_room(p)), key=lambda p: p.area):
        rest = [p for p in parts if p is not small[0]]
        shared = [p.intersection(small[0]).length for p in rest]
        if not any(shared):
            break
        k = int(np.argmax(shared))
        parts = [p.union(small[0]) if n == k else p for n, p in enumerate(rest)]
    return parts if len(parts) > 1 else [piece]


def ground_between(feet: Sequence[BaseGeometry], lines: Sequence[LineString]) -> list[Polygon]:
    """Pieces of ground that walls (feet) enclose, small gaps and doorways (lines) closed."""
    joined = shapely.union_all(feet).buffer(_JOIN_M / 2, join_style="mitre")
    standing = shapely.union_all([joined.buffer(-_JOIN_M / 2, join_style="mitre"), *feet])
    ways = [*doorways(standing), *lines]
    # The area within the outer edge of walls and doorways, minus the walls.
    closed = shapely.union_all([standing, *(way.buffer(_ACROSS_M) for way in ways)])
    whole = shapely.union_all([Polygon(p.exterior) for p in polygons_in(closed, _SLIVER_M2)])
    pieces = polygons_in(shapely.difference(whole, standing), _SLIVER_M2)
    parts = [part for piece in pieces for part in parted_at_doorways(piece, ways)]
    return sorted(parts, key=lambda p: (p.bounds, p.area))


def _is_room(part: Polygon) -> bool:
    return bool(part.area >= LEAST_M2 and not part.buffer(-_LEAST_WIDTH_M / 2).is_empty)


def _rings(walls: Any) -> list[Any]:
    """Their outlines and holes, the wall to the left of each."""
    polygons: list[Any] = polygons_in(walls)
    simple = [shapely.orient_polygons(p.simplify(_THINNEST_M / 2)) for p in polygons]
    return [ring for p in simple for ring in (p.exterior, *p.interiors)]


def _ends(corners: F64) -> list[tuple[F64, F64]]:
    """(middle, way out) of each side of a ring that is the end of a wall: short, between two long ones."""
    sides = np.roll(corners, -1, 0) - corners
    lengths = np.hypot(*sides.T)
    ways = sides / np.maximum(lengths, 1e-12)[:, None]
    out = np.stack([ways[:, 1], -ways[:, 0]], 1)
    before, after = np.roll(ways, 1, 0), np.roll(ways, -1, 0)
    is_end = (lengths >= _THINNEST_M) & (lengths <= _THICKEST_M)
    is_end &= (np.roll(lengths, 1) >= _LEAST_LONG_M) & (np.roll(lengths, -1) >= _LEAST_LONG_M)
    # A wall end has two left turns of about 90 degrees, with the wall behind it.
    is_end &= ((before * out).sum(1) > _SQUARE) & ((after * out).sum(1) < -_SQUARE)
    return [(corners[k] + sides[k] / 2, out[k]) for k in np.flatnonzero(is_end)]


def _holds_door(start: F64, way: F64, gap: float, doors: Sequence[Polygon]) -> bool:
    line = LineString([start, start + way * gap]).buffer(_AT_GAP_M, cap_style="flat")
    return any(line.intersects(door) for door in doors)


def _gap_before(start: F64, way: F64, faces: shapely.STRtree, widest_m: float) -> float | None:
    """Distance in metres from a wall's end to the face in front of it; None unless door-sized."""
    ahead = LineString([start + way * _OFF_M, start + way * (widest_m + _OFF_M)])
    hit = shapely.intersection(faces.geometries[faces.query(ahead, "intersects")], ahead)
    if not len(hit):
        return None
    gap = float(shapely.distance(hit, Point(start)).min())
    return gap if NARROWEST_M <= gap <= widest_m else None


def rooms_by_walls(ground: Polygon, lines: Sequence[LineString]) -> list[Polygon]:
    """The rooms into which walls without thickness part a ground, closed at doorways; [] = they part none.

    lines: middle lines of walls in metres, which may end a little before each other or the ground's edge.
    What is too small for a room, between two faces of one wall, is left to the wall.
    """
    inner = ground.buffer(-_AT_EDGE_M)
    within = [part for line in lines for part in shapely.get_parts(line.intersection(inner))]
    if not within or not ground.is_valid:
        return []
    edge = ground.exterior.buffer(HALF_M, join_style="mitre")
    standing = unary_union([edge, *(line.buffer(HALF_M, cap_style="flat") for line in within)])
    # Walls meet that end a little before each other.
    standing = standing.buffer(_JOIN_M, join_style="mitre").buffer(-_JOIN_M, join_style="mitre")
    ways = doorways(standing)
    free = [p for p in shapely.get_parts(ground.difference(standing)) if _is_room(p)]
    rooms = [room for piece in free for room in parted_at_doorways(piece, ways)]
    # To the middle of their walls, and no farther than the doorway.
    grown = [
        r.buffer(HALF_M, join_style="mitre")
        .intersection(ground)
        .difference(unary_union([neighbour for neighbour in rooms if neighbour is not r]))
        for r in rooms
    ]
    whole: list[Any] = [max(shapely.get_parts(r), key=lambda p: p.area) for r in grown]
    return whole if len(whole) > 1 else []
