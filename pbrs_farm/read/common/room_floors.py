"""Floor polygon and heights of a room from its meshes, whose floors may extend below the walls; no effects."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
import shapely

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.house import Surface, corners_of_surfaces
from pbrs_farm.core.mesh import area_vectors, face_areas, triangle_corners
from pbrs_farm.geometry.doorways import NARROWEST_M, door_line, doorways, parted_at_doorways
from pbrs_farm.geometry.plan_surfaces import polygons_in

# A floor of more triangles is taken by its convex hull, so that time stays bounded.
MAX_OUTLINE_FACES: Final = 20_000

_SAME_HEIGHT_M: Final = 0.02  # faces that differ less in height are one floor
_CRACK_M: Final = 1e-4  # between triangles that should touch
_SLACK_M: Final = 0.002  # tolerance of an outline's corners
_UPRIGHT_UP: Final = 0.3  # |y| of a wall's normal, at most
_LEVEL_UP: Final = 0.7  # least |y| of the normal of a floor or ceiling
_THICKEST_DOOR_M: Final = 0.4  # with its frame
_TRACE_M: Final = 0.005  # half the width of the strip that a planar wall cuts


def floor_height(surfaces: Sequence[Surface]) -> float | None:
    """World y, in metres, of the highest horizontal upward faces of a floor; None without any."""
    corners = _faces_looking(surfaces, 1)
    return None if not len(corners) else float(corners[..., 1].mean(1).max())


def ceiling_height(surfaces: Sequence[Surface]) -> float | None:
    """World y of the lowest downward faces; None without any."""
    corners = _faces_looking(surfaces, -1)
    return None if not len(corners) else float(corners[..., 1].mean(1).min())


def floor_polygon(floor: Sequence[Surface], walls: Sequence[Surface]) -> F64 | None:
    """(N, 2) plan (x, z), counter-clockwise, of the largest piece of floor between the walls; None without area."""
    corners = _faces_looking(floor, 1)
    if not len(corners):
        return None
    # Take the topmost faces as the floor, and its part without walls as walkable.
    y = corners[..., 1].mean(1)
    area = _outline_from_above(corners[y > y.max() - _SAME_HEIGHT_M])
    standing = _faces_looking(walls, 1), _faces_looking(walls, -1)
    between = shapely.difference(area, _outline_from_above(np.concatenate(standing)))
    return polygon_of(between if not between.is_empty else area)


def covered_share(surface: Surface, polygon: F64) -> float:
    """Share 0..1 of a plan polygon (N, 2) that the surface's horizontal faces cover."""
    # A planar ceiling may look either way.
    flat = np.concatenate([_faces_looking([surface], 1), _faces_looking([surface], -1)])
    area: Any = shapely.Polygon(polygon)
    return float(
        shapely.area(shapely.intersection(_outline_from_above(flat), area)) / max(area.area, 1e-9)
    )


def floor_polygons(
    floor: Sequence[Surface],
    walls: Sequence[Surface],
    *,
    min_area_m2: float,
    min_width_m: float,
    doors: Sequence[F64] = (),
) -> list[F64]:
    """Every piece of floor between the walls, planar walls too, that is a room by its size.

    doors: (2, 3) bounds of each, which part rooms however wide they are, also open ones in a gap. Each as floor_polygon gives it, largest first.
    """
    corners = _faces_looking(floor, 1)
    if not len(corners):
        return []
    # Cut closed walls by their footprint, planar walls by a strip along them.
    feet = [_outline_from_above(_faces_looking(walls, sign)) for sign in (1, -1)]
    between = _outline_from_above(corners)
    for taken in (*feet, traces := _traces(walls)):
        between = shapely.difference(between, taken)
    # One room ends at the doorway to the next.
    leaves = [shapely.box(*bounds[0, [0, 2]], *bounds[1, [0, 2]]) for bounds in doors]
    ways = doorways(shapely.union_all([*feet, traces]), doors=leaves)
    ways += [line for bounds in doors if (line := _line_of_door(bounds)) is not None]
    parts = [p for whole in shapely.get_parts(between) for p in parted_at_doorways(whole, ways)]
    pieces = np.array(parts, object)
    # Keep large and wide enough pieces; restore the ground of the strips.
    narrow = shapely.is_empty(_grown(pieces, -min_width_m / 2))
    fit = pieces[(shapely.area(pieces) >= min_area_m2) & ~narrow].tolist()
    fit.sort(key=lambda p: (-p.area, p.bounds))
    polygons = [polygon_of(p) for p in _grown(fit, _TRACE_M)]
    return [p for p in polygons if p is not None]


def _line_of_door(bounds: F64) -> shapely.LineString | None:
    # An open or oblique door defines no line.
    low, high = bounds[:, [0, 2]]
    size, middle = high - low, (low + high) / 2
    across = int(np.argmax(size))
    if size[1 - across] > _THICKEST_DOOR_M or size[across] < NARROWEST_M:
        return None
    return door_line(middle, np.eye(2)[across], float(size[across]))


def foot_of_wall(surfaces: Sequence[Surface]) -> Any:
    """Ground area of a wall seen from above, as a shapely area; of a planar wall a strip."""
    # Its top may slope with a roof: every face counts.
    return shapely.union_all(
        [_outline_from_above(corners_of_surfaces(surfaces)), _traces(surfaces)]
    )


def _grown(areas: Any, by_m: float) -> Any:
    with np.errstate(invalid="ignore", divide="ignore"):  # GEOS sets flags that mean nothing
        return shapely.buffer(areas, by_m, join_style="mitre")


def _traces(walls: Sequence[Surface]) -> Any:
    """Ground of upright faces seen from above, as strips 2 _TRACE_M wide."""
    upright_faces = []
    for surface in walls:
        p = triangle_corners(surface.positions, surface.faces)
        upright = np.abs(area_vectors(p)[:, 1]) < _UPRIGHT_UP * (2 * face_areas(p))
        upright_faces.append(p[upright][:, :, [0, 2]])
    plan = np.concatenate([np.zeros((0, 3, 2)), *upright_faces])[:MAX_OUTLINE_FACES]
    lines: Any = shapely.linestrings(plan)
    return shapely.union_all(shapely.buffer(lines, _TRACE_M, cap_style="square"))


def enclosed_polygon(walls: Sequence[Surface]) -> F64 | None:
    """(N, 2) world (x, z) of the largest area between a room's walls or, if open, their hull; or None."""
    # The area between the walls is the part of their hull that no wall covers.
    footprint = _outline_from_above(
        np.concatenate([_faces_looking(walls, 1), _faces_looking(walls, -1)])
    )
    return polygon_of(shapely.difference(footprint.convex_hull, footprint))


def polygon_of(area: Any) -> F64 | None:
    """The outline of the largest polygon of a shapely area: simple, counter-clockwise, no holes.

    (N, 2) float64, the first corner not repeated; holes are dropped. Slivers go and nearly straight
    corners with them. Pieces of a square centimetre and less are passed over.
    """
    largest = _largest(area, None)
    if largest is None:
        return None
    # Opening removes slivers that a wall's bevel leaves; corners of walls stay where they are.
    opened = _grown(_grown(largest, -_SLACK_M), _SLACK_M)
    simple = shapely.simplify(_largest(opened, largest), _SLACK_M)
    outline = shapely.orient_polygons(shapely.Polygon(simple.exterior))
    return np.asarray(shapely.get_coordinates(outline)[:-1], np.float64)


def _largest(area: Any, otherwise: Any) -> Any:
    return max(polygons_in(area, 1e-4), key=lambda g: (g.area, g.bounds), default=otherwise)


def _faces_looking(surfaces: Sequence[Surface], sign: int) -> F64:
    """(F, 3, 3) corners of the faces that look up (sign 1) or down (-1)."""
    level_faces = [np.zeros((0, 3, 3))]
    for surface in surfaces:
        p = triangle_corners(surface.positions, surface.faces)
        level_faces.append(p[sign * area_vectors(p)[:, 1] > _LEVEL_UP * (2 * face_areas(p))])
    return np.concatenate(level_faces)


def _outline_from_above(corners: F64) -> Any:
    """The union of triangles seen from above, as a shapely area."""
    if not len(corners):
        return shapely.Polygon()
    plan = corners[:, :, [0, 2]]
    if len(plan) > MAX_OUTLINE_FACES:
        return shapely.MultiPoint(plan.reshape(-1, 2)).convex_hull
    # Widen triangles a little before their union, so that cracks between them close.
    triangles: Any = shapely.polygons(plan)
    triangles = triangles[shapely.area(triangles) > 1e-10]
    return _grown(shapely.union_all(_grown(triangles, _CRACK_M)), -_CRACK_M)
