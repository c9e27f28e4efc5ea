"""Plan polygons: rooms' as shapes, and the triangles of floors, ceilings and roofs over them; no effects."""

from __future__ import annotations

from collections.abc import Sequence

import mapbox_earcut
import numpy as np
import shapely

from pbrs_farm.core.arrays import I32, Points2
from pbrs_farm.core.house import Room, Surface


def signed_area(polygon: Points2) -> float:
    """Area of a polygon (N, 2), positive if counter-clockwise with the second axis up."""
    x, z = polygon[:, 0], polygon[:, 1]
    return float(0.5 * np.sum(x * np.roll(z, -1) - np.roll(x, -1) * z))


def room_shape(room: Room) -> shapely.Geometry:
    """The room's polygon in plan (x, z), made valid; empty for fewer than three corners.

    A polygon that crosses itself may become a MultiPolygon, or a collection: ask shapely for area,
    contains and distances, and do not read its exterior. Unlike `Room.polygon` it is never invalid.
    """
    if len(room.polygon) < 3 or not np.isfinite(room.polygon).all():
        return shapely.Polygon()
    return shapely.make_valid(shapely.Polygon(room.polygon))


def polygons_in(shape: shapely.Geometry, least_m2: float = 0.0) -> list[shapely.Polygon]:
    """The polygons of a plan area above least_m2."""
    return [p for p in shapely.get_parts(shape) if p.geom_type == "Polygon" and p.area > least_m2]


def counter_clockwise(polygon: Points2) -> Points2:
    """polygon (N, 2), reversed if it runs clockwise (with the second axis up)."""
    return polygon if signed_area(polygon) >= 0 else polygon[::-1].copy()


def triangulated(rings: Sequence[Points2]) -> tuple[Points2, I32]:
    """Points (V, 2) and counter-clockwise triangles (F, 3) of an outline and its holes.

    rings: the outline first, then holes, each (N, 2) with either sense and without a repeated end.
    Points are all rings' corners in order; none is added. Self-crossing outlines give triangles
    that do not fill them: make them valid before.
    """
    points = np.concatenate([np.asarray(r, np.float64) for r in rings])
    ends = np.cumsum([len(r) for r in rings]).astype(np.uint32)
    faces = np.asarray(mapbox_earcut.triangulate_float64(points, ends), np.int32).reshape(-1, 3)
    a, b, c = (points[faces[:, k]] for k in range(3))
    # Turn all triangles one way round and drop those without area.
    turn = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    faces[turn < 0] = faces[turn < 0][:, [0, 2, 1]]
    return points, faces[turn != 0]


def horizontal(
    name: str, polygons: Sequence[Sequence[Points2]], y: float, material: int, *, up: bool
) -> Surface:
    """Polygons with holes at height y, facing up or down; uv: (x, -z) metres of floors, (x, z) of ceilings."""
    # Cut each polygon and number its corners after those before it.
    points: list[Points2] = []
    faces: list[I32] = []
    n = 0
    for rings in polygons:
        p, f = triangulated(rings)
        points.append(p)
        faces.append(f + n)
        n += len(p)
    plan = np.concatenate(points) if points else np.zeros((0, 2))
    triangles = np.concatenate(faces) if faces else np.zeros((0, 3), np.int32)
    # Counter-clockwise in plan (x right, z up) faces down: the world's y is x cross z, negated.
    if up:
        triangles = triangles[:, [0, 2, 1]]
    positions = np.stack([plan[:, 0], np.full(len(plan), y), plan[:, 1]], -1)
    uvs = np.stack([plan[:, 0], -plan[:, 1] if up else plan[:, 1]], -1)
    return Surface(
        name,
        positions.astype(np.float32),
        np.ascontiguousarray(triangles, np.int32),
        material,
        uvs.astype(np.float32),
    )


# A polygon with a height at each corner -> the triangles of the ceiling over it.
