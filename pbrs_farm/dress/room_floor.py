"""A room's floor and walls while furniture is added; state: the furniture added so far."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from pbrs_farm.core.arrays import Bools
from pbrs_farm.core.walkable import CELL_M, FloorGrid
from pbrs_farm.dress.mutable_house import MutableHouse
from pbrs_farm.dress.space import FloorBitmap, HouseSpace, RoomSpace, WallFace
from pbrs_farm.dress.space.flights import flights_of
from pbrs_farm.dress.space.floor_bitmaps import FloorCells, doors_are_joined, with_body
from pbrs_farm.dress.space.wall_faces import CELL_M as WALL_CELL_M
from pbrs_farm.dress.walls.hanging import Hanging
from pbrs_farm.geometry.swept import floor_swept

OUT_M = 0.015  # distance from a wall to a back: skirting boards are between
LOWER_M = 0.1  # height above the floor from which a wall must be free

_MOST_COVERED = 0.58  # greatest share of a floor under furniture
_WALL_SHARE = 0.75  # greatest share of the free wall with furniture before it
_WAYS_KEPT = 0.6  # least share of the walkable floor that stays walkable
_DOOR_MARGIN_M = 0.05
_FRENCH_M = 0.4  # a window whose sill is lower is walked through


@dataclass(frozen=True, slots=True, eq=False)
class FloorSpot:
    """A place for a piece at a wall, with its plan area and the area in front; RoomFloor checks it."""

    face: WallFace
    s: float  # of the piece's centre, along the face
    depth: float  # of the piece, metres
    body: BaseGeometry  # the plan area it takes
    front: BaseGeometry  # and the floor before it


def spot_at(face: WallFace, s: float, width: float, depth: float, before_m: float) -> FloorSpot:
    """The place of a piece, centred at s, OUT_M before a wall face, with before_m of floor in front; metres."""

    def area(z0: float, z1: float) -> BaseGeometry:
        ends = [(s - width / 2, z0), (s + width / 2, z0), (s + width / 2, z1), (s - width / 2, z1)]
        return shapely.Polygon([face.point(x, 0.0, z)[[0, 2]] for x, z in ends])

    end = OUT_M + depth
    return FloorSpot(face, s, depth, area(OUT_M, end), area(end, end + before_m))


@dataclass(slots=True)
class RoomFloor:
    """The free part of a room's floor and walls; state: the furniture added so far.

    floor = RoomFloor.of(house, house_space(house), room)
    spot = spot_at(room.faces[0], 1.2, 0.8, 0.4, before_m=0.6)
    if floor is not None and floor.allows(spot.body, spot.front):
        floor.take(spot.body, spot.front)
    """

    space: HouseSpace
    room: RoomSpace
    faces: Sequence[WallFace]
    bitmap: FloorBitmap
    free: BaseGeometry  # its floor without walls
    kept: BaseGeometry  # areas swept by doors and drawers, and standing areas at doors and windows
    has_ways: bool  # one way joins its doors
    walkable: int  # cells of its largest way, before anything was put
    wall_m: float  # remaining length of wall for furniture
    bodies: list[BaseGeometry] = field(default_factory=list)  # of the added furniture
    fronts: list[BaseGeometry] = field(default_factory=list)  # the floor before it

    @classmethod
    def of(cls, house: MutableHouse, space: HouseSpace, room: RoomSpace) -> RoomFloor | None:
        """The room in the current state of house and space; None without a floor or walls."""
        bitmap = FloorCells(space, room).bitmap()
        if not bitmap.inside.any() or not room.faces:
            return None
        zones = []
        for passage in (*room.doors, *room.windows):
            side = passage.side_of(room.room.id)
            is_walked = not passage.is_window or passage.bottom_y < room.room.floor_y + _FRENCH_M
            if side is not None and is_walked:
                zones.append(passage.before(side))
                zones += [] if passage.is_window else [passage.swing(side)]
        flights = flights_of(house, room.room, room.area)
        zones += [flights.under, flights.before]
        items = [house.items[n] for n in room.items]
        zones.append(floor_swept(items, room.room.floor_y))
        # Measure the wall length with free floor in front.
        faces = Hanging(house, room, "furniture").faces
        low, high = room.room.floor_y + LOWER_M, room.room.floor_y + 0.9
        free_m = sum(len(face.starts(WALL_CELL_M, low, high, 0.5)) for face in faces) * WALL_CELL_M
        return cls(
            space,
            room,
            faces,
            bitmap,
            shapely.difference(room.area, room.walls),
            shapely.union_all(zones).buffer(_DOOR_MARGIN_M),
            doors_are_joined(bitmap, room),
            _largest_way(bitmap),
            _WALL_SHARE * free_m,
        )

    def allows(self, body: BaseGeometry, front: BaseGeometry) -> bool:
        """True if body and front (plan areas) are on free floor, off doors, and every way stays open."""
        is_there = shapely.contains(self.free, body) and not shapely.intersects(self.kept, body)
        if not is_there or any(shapely.intersects(body, area) for area in self.fronts):
            return False
        if any(
            shapely.intersects(area, body) or shapely.intersects(area, front)
            for area in self.bodies
        ):
            return False
        return self._keeps_ways(self._cells(body))

    def take(self, body: BaseGeometry, front: BaseGeometry) -> None:
        """Occupy the place of a piece, its body and front, unchecked."""
        self.bodies.append(body)
        self.fronts.append(front)
        self.bitmap = with_body(self.bitmap, self._cells(body))

    def is_too_full(self, area_m2: float) -> bool:
        """True if area_m2 more of furniture would cover over 58 % of the floor; ask it first."""
        inside, covered = self.bitmap.inside, self.bitmap.occupied & self.bitmap.inside
        covered_m2 = float(covered.sum()) * CELL_M**2 + area_m2
        return covered_m2 > _MOST_COVERED * float(inside.sum()) * CELL_M**2

    def _keeps_ways(self, cells: Bools) -> bool:
        after = with_body(self.bitmap, cells)
        if _largest_way(after) < _WAYS_KEPT * self.walkable:
            return False
        return not self.has_ways or doors_are_joined(after, self.room)

    def _cells(self, area: BaseGeometry) -> Bools:
        x, z = FloorGrid(self.bitmap.origin, self.bitmap.inside.shape).middles
        return np.asarray(shapely.contains_xy(area.buffer(CELL_M / 2), x, z))


def _largest_way(bitmap: FloorBitmap) -> int:
    return int(np.bincount(bitmap.ways.reshape(-1))[1:].max(initial=0))
