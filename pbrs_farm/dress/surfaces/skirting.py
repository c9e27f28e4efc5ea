"""Skirting boards for sources without any: a mitred strip along a room's walls; no effects."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import mapbox_earcut
import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.classes import WALL
from pbrs_farm.core.house import House, Item, ItemKind, Room, Surface
from pbrs_farm.dress.space.footprints import areal, plan_area

BASEBOARD = "baseboard"
"""Tag that repair knows: the item bounds no room and is joined to nothing."""

_THICK_M = 0.01
_SUNK_M = 0.002  # depth of its back inside the wall, to avoid coplanar faces, metres
_BESIDE_DOOR_M = 0.015
_LEAST_M = 0.04  # shorter pieces are left out
_OVER_OUTLINE_M = 0.04  # walls are looked for so far outside a room's outline


def has_boards(house: House) -> bool:
    """True if the source has skirting boards."""
    return any(BASEBOARD in item.tags for item in house.items)


def wall_plans(house: House) -> tuple[tuple[BaseGeometry, float, float], ...]:
    """The plan area of every wall, and its lowest and highest y; walls without thickness left out."""
    plans = []
    for item in house.items:
        if item.kind is not ItemKind.WALL or not item.n_faces:
            continue
        corners = np.concatenate([s.positions[s.faces] for s in item.surfaces]).astype(np.float64)
        area = plan_area(corners, upright=False)
        low, high = float(corners[..., 1].min()), float(corners[..., 1].max())
        if not area.is_empty and area.area > 1e-4:
            plans.append((area, low, high))
    return tuple(plans)


def skirting_board(
    house: House,
    room: Room,
    area: BaseGeometry,
    walls: Sequence[tuple[BaseGeometry, float, float]],
    height_m: float,
    material: int,
) -> Item | None:
    """The room's board along its walls, with gaps at doors; None if no part remains."""
    reach = area.buffer(_OVER_OUTLINE_M, join_style="mitre")
    near = [
        w
        for w, low, high in walls
        if low < room.floor_y + 0.05 and high > room.floor_y + height_m and w.intersects(reach)
    ]
    if not near:
        return None
    # Take the strip before the walls; a mitred offset gives mitred corners.
    solid = shapely.union_all(near, grid_size=1e-5)
    strip: BaseGeometry = solid.buffer(_THICK_M, join_style="mitre", mitre_limit=2.0)
    strip = strip.difference(solid.buffer(-_SUNK_M, join_style="mitre"))
    strip = strip.intersection(reach).difference(_doors(house, room, height_m))
    surfaces = [
        s
        for p in _pieces_of_strip(strip, solid)
        for s in _prism(p, room.floor_y - _SUNK_M, room.floor_y + height_m, material)
    ]
    if not surfaces:
        return None
    return Item(
        id=f"dress-skirting-{room.id}",
        name=f"Skirting board of {room.name or room.id}",
        kind=ItemKind.WALL,
        level_id=room.level_id,
        surfaces=tuple(surfaces),
        nyu40=WALL,
        source_class=BASEBOARD,
        tags=(BASEBOARD, "dressed:generated#skirting board"),
    )


def _doors(house: House, room: Room, height_m: float) -> BaseGeometry:
    # Plan areas of the openings that reach down to the board.
    areas = []
    for opening in house.openings:
        points = opening.cutter.positions
        if not len(points) or opening.level_id != room.level_id:
            continue
        if float(points[:, 1].min()) > room.floor_y + height_m:
            continue
        hull = shapely.MultiPoint(points[:, [0, 2]].astype(np.float64)).convex_hull
        areas.append(hull.buffer(_THICK_M + _BESIDE_DOOR_M, join_style="mitre"))
    return shapely.union_all(areas)


def _pieces_of_strip(strip: BaseGeometry, solid: BaseGeometry) -> Iterator[shapely.Polygon]:
    for part in shapely.get_parts(areal(shapely.set_precision(strip, 1e-5))):
        # Skip tiny pieces, and pieces inside the wall.
        if part.geom_type != "Polygon" or part.length / 2 < _LEAST_M:
            continue
        if part.difference(solid).area > 0.5 * _THICK_M * _LEAST_M:
            yield part


def _prism(polygon: shapely.Polygon, low_y: float, high_y: float, material: int) -> list[Surface]:
    """A closed upright prism over the polygon: sides with metric uv, top, bottom."""
    rings = [shapely.get_coordinates(r)[:-1] for r in (polygon.exterior, *polygon.interiors)]
    points = np.concatenate(rings)
    ends = np.cumsum([len(r) for r in rings]).astype(np.uint32)
    faces = np.asarray(mapbox_earcut.triangulate_float64(points, ends), np.int64).reshape(-1, 3)
    a, b, c = (points[faces[:, k]] for k in range(3))
    # In plan x right and z towards the viewer a counter-clockwise face looks down.
    turn = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    down = np.where((turn > 0)[:, None], faces, faces[:, ::-1])[turn != 0]
    surfaces = [
        _level_surface("bottom", points, down, low_y, material),
        _level_surface("top", points, down[:, ::-1], high_y, material),
    ]
    for ring in rings:
        # Go round with the solid on the right, seen from above with z down: outlines and holes alike.
        surfaces.append(_band(ring, low_y, high_y, material, is_hole=ring is not rings[0]))
    return surfaces


def _level_surface(name: str, points: F64, faces: np.ndarray, y: float, material: int) -> Surface:
    positions = np.column_stack([points[:, 0], np.full(len(points), y), points[:, 1]])
    return Surface(
        name,
        positions.astype(np.float32),
        np.ascontiguousarray(faces, np.int32),
        material,
        points.astype(np.float32),
    )


def _band(ring: F64, low_y: float, high_y: float, material: int, *, is_hole: bool) -> Surface:
    # Order the ring so that its outside is to the left of the walk, x right and z up.
    ccw = shapely.LinearRing(ring).is_ccw
    if ccw == is_hole:
        ring = ring[::-1]
    start, end = ring, np.roll(ring, -1, 0)
    length = np.linalg.norm(end - start, axis=1)
    walked = np.concatenate([[0.0], np.cumsum(length)])
    corners, uvs = [], []
    for k in range(len(ring)):
        (x0, z0), (x1, z1) = start[k], end[k]
        corners += [(x0, low_y, z0), (x0, high_y, z0), (x1, high_y, z1), (x1, low_y, z1)]
        u0, u1 = walked[k], walked[k + 1]
        uvs += [(u0, 0.0), (u0, high_y - low_y), (u1, high_y - low_y), (u1, 0.0)]
    quads = 4 * np.arange(len(ring))[:, None]
    faces = (quads[:, None] + np.array([[0, 1, 2], [0, 2, 3]])).reshape(-1, 3)
    return Surface(
        "side",
        np.array(corners, np.float32),
        faces.astype(np.int32),
        material,
        np.array(uvs, np.float32),
    )
