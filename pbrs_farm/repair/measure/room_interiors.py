"""Room interiors for the leak meter: between walls, floor and ceiling; no effects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from pbrs_farm.core.house import Room
from pbrs_farm.repair.structure import plan_geometry as plan
from pbrs_farm.repair.structure.plan_geometry import Shape
from pbrs_farm.repair.structure.planar_surfaces import Cover, PlanarSurface
from pbrs_farm.repair.structure.prisms import Plane, level_plane, polygons_of
from pbrs_farm.repair.structure.walls import Wall

_BESIDE_M = 0.1  # walls farther from a room do not bound it
_SLIVER_M = 0.02  # narrower parts of a room hold no starts
_LOWER_M = 0.05  # a solid ceiling that hangs so far below the nominal height bounds the room
_LEAST_M = 0.1  # above the floor: lower covers are no ceiling
_FAR_M = 1e4  # the half of the plan in which one plane is above another reaches so far


@dataclass(frozen=True, slots=True, eq=False)
class RoomInterior:
    """A part of a room between its floor and one plane of its ceiling."""

    area: Shape  # plan, walls left out
    foot: Shape  # plan, baseboards left out too
    foot_m: float  # height of the baseboards
    low: Plane  # floor
    high: Plane  # ceiling

    @property
    def height(self) -> float:
        """Largest height over the area's corners, metres."""
        corners = shapely.get_coordinates(self.area)
        return float((self.high.at(corners) - self.low.at(corners)).max())


def interiors_of_room(
    room: Room,
    uprights: Sequence[Wall],
    surfaces: Sequence[PlanarSurface],
    solid: Sequence[Cover] = (),
) -> list[RoomInterior]:
    """Volumes between the walls and above the floor, one below each plane of the ceiling.

    uprights: walls and baseboards of all storeys; surfaces: floors and ceilings without thickness, solid:
    the inner faces of those with thickness, including a roof's. Empty if walls cover the whole room.
    Without a ceiling above, the room's nominal height is used.
    """
    outline = plan.polygon_of_room(room.polygon)
    near = [
        # Take the walls at the height of this room, in it or beside it.
        w
        for w in plan.near_to(outline, uprights, lambda w: w.footprint, _BESIDE_M)
        if w.bottom_y < room.ceiling_y - 0.1 and w.high_y > room.floor_y + 0.01
    ]
    walls = plan.union(w.footprint for w in near if not w.is_board)
    boards = [w for w in near if w.is_board]
    area = plan.without(outline, walls)
    foot = plan.union(w.footprint for w in boards)
    foot_m = max(
        (w.high_y - room.floor_y for w in boards if w.footprint.distance(area) < 0.05), default=0.0
    )
    # Part the room below the planes of its ceiling, the rest below its nominal height.
    ceilings = [s for s in surfaces if s.is_ceiling and s.room_id == room.id]
    parts = [(plan.common(area, s.area), s.plane) for s in ceilings]
    rest = plan.without(area, *(s.area for s in ceilings))
    hung = _hung(rest, room, solid)
    # No ray starts where a roof comes down to the floor.
    knee = level_plane(room.floor_y + _LEAST_M)
    parts += [(plan.without(a, _where_above(knee, p, or_equal=True)), p) for a, p in hung]
    parts.append((plan.without(rest, *(a for a, _plane in hung)), level_plane(room.ceiling_y)))
    floor = level_plane(room.floor_y)
    return [
        RoomInterior(p, plan.opened(plan.without(p, foot), _SLIVER_M), foot_m, floor, plane)
        for shape, plane in parts
        for p in polygons_of(plan.opened(shape, _SLIVER_M), min_area_m2=1e-3)
    ]


def _hung(area: Shape, room: Room, covers: Sequence[Cover]) -> list[tuple[Shape, Plane]]:
    """The parts of area under the solid ceilings that hang below the nominal height, the lowest counts."""
    near = []
    for cover in plan.near_to(area, [c for c in covers if c.is_ceiling], lambda c: c.area, 0.0):
        shape = plan.common(area, cover.area)
        if shapely.is_empty(shape):
            continue
        heights = cover.plane.at(shapely.get_coordinates(shape))
        if heights.max() > room.floor_y + _LEAST_M and heights.min() < room.ceiling_y - _LOWER_M:
            near.append((shape, cover.plane))
    parts = []
    for i, (shape, plane) in enumerate(near):
        # Where two roofs meet, each is the ceiling on its own side of the ridge or valley.
        for j, (neighbour, below) in enumerate(near):
            if i == j or shapely.is_empty(shared := plan.common(shape, neighbour)):
                continue
            above = plan.common(shared, _where_above(plane, below, or_equal=j < i))
            shape = plan.without(shape, above)
        parts.append((shape, plane))
    return parts


def _where_above(a: Plane, b: Plane, *, or_equal: bool) -> Shape:
    """Half of the plan where plane a is above plane b: everything or nothing for parallel planes."""
    normal, offset = np.array([a.a - b.a, a.b - b.b]), a.c - b.c
    steep = float(np.linalg.norm(normal))
    if steep < 1e-9:
        is_above = offset > 1e-9 or (or_equal and offset > -1e-9)
        return shapely.box(-_FAR_M, -_FAR_M, _FAR_M, _FAR_M) if is_above else shapely.Polygon()
    # Span the half plane from the line where they meet.
    n = normal / steep
    along, start = np.array([-n[1], n[0]]), -offset / steep * n
    corners = [start - _FAR_M * along, start + _FAR_M * along]
    return shapely.Polygon([*corners, corners[1] + _FAR_M * n, corners[0] + _FAR_M * n])
