"""Room interiors for the leak meter: between walls, floor and ceiling; no effects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import shapely

from pbrs_farm.core.house import Room
from pbrs_farm.repair.structure import plan_geometry as plan
from pbrs_farm.repair.structure.plan_geometry import Shape
from pbrs_farm.repair.structure.planar_surfaces import PlanarSurface
from pbrs_farm.repair.structure.prisms import Plane, level_plane, polygons_of
from pbrs_farm.repair.structure.walls import Wall

_BESIDE_M = 0.1  # walls farther from a room do not bound it
_SLIVER_M = 0.02  # narrower parts of a room hold no starts


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
    room: Room, uprights: Sequence[Wall], surfaces: Sequence[PlanarSurface]
) -> list[RoomInterior]:
    """Between the walls, above the floor, a part below each plane of the ceiling.

    uprights: walls and baseboards of all storeys; surfaces: floors and ceilings. Empty where walls
    leave nothing of the room. Where no ceiling lies above, the room's nominal height counts.
    """
    outline = plan.polygon_of_room(room.polygon)
    near = [
        # Take the walls that stand at the height of this room, in it or beside it.
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
    parts.append((plan.without(area, *(s.area for s in ceilings)), level_plane(room.ceiling_y)))
    floor = level_plane(room.floor_y)
    return [
        RoomInterior(p, plan.opened(plan.without(p, foot), _SLIVER_M), foot_m, floor, plane)
        for shape, plane in parts
        for p in polygons_of(plan.opened(shape, _SLIVER_M), min_area_m2=1e-3)
    ]
