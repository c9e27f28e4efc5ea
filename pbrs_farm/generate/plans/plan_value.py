"""Convert a plan's JSON value to a Plan with walls; errors are one line each; no effects.

Hand-written plans must be correct. In files of other programs, slivers, self-intersecting outlines
and openings without a wall are left out, with a note each.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Final

import numpy as np
import shapely
from pydantic import AfterValidator, BaseModel, BeforeValidator, Field
from shapely.geometry import LineString, Polygon
from shapely.geometry.base import BaseGeometry
from shapely.ops import unary_union

from pbrs_farm.core.checked_json import Finite, checked
from pbrs_farm.core.errors import BadInput
from pbrs_farm.generate.floor_plan import (
    OpeningKind,
    Plan,
    PlanOpening,
    PlanRoom,
    PlanWall,
    RoomType,
)
from pbrs_farm.generate.plan_walls import corners
from pbrs_farm.generate.plans.parsed_plan import LeftOut, largest_part
from pbrs_farm.generate.plans.plan_format import PlanFormat
from pbrs_farm.generate.plans.wall_tops import WallTop, with_tops
from pbrs_farm.generate.plans.walled_rooms import DrawnRoom, walled

MAX_ROOMS: Final = 60
MAX_CORNERS: Final = 20_000  # maximum corners of an outline
_MOST_SIDES: Final = 120  # most sides of an outline after simplification
_TOLERANCES_M: Final = (1e-3, 0.01, 0.02, 0.05, 0.1)  # by which a curve is made of straight walls
_FAR_M: Final = 200.0
_LEAST_M2: Final = 0.5
_LEAST_TALL_M: Final = 0.3  # of an opening
_REACH_M: Final = 0.6  # from an opening to its wall
_SIZES: Final = {
    OpeningKind.DOOR: (0.9, 2.1, 0.0),
    OpeningKind.ENTRANCE: (0.95, 2.1, 0.0),
    OpeningKind.PASSAGE: (0.9, 2.1, 0.0),
    OpeningKind.WINDOW: (1.3, 1.3, 0.9),
    OpeningKind.FRENCH_WINDOW: (1.6, 2.1, 0.1),
}
_USUAL_SIDE_M: Final = (0.7, 30.0)  # root of a room's area; beyond, the file is in another unit


def _in_plan(value: object) -> object:
    # Drop what GeoJSON may have behind the plan's two coordinates: a height.
    if not isinstance(value, list | tuple) or len(value) < 2:
        raise ValueError("expected a point [x, y]")
    return value[:2]


_Metres = Annotated[Finite, Field(ge=-1e5, le=1e5), AfterValidator(lambda value: round(value, 4))]
_Point = Annotated[tuple[_Metres, _Metres], BeforeValidator(_in_plan)]
_Length = Annotated[Finite, Field(ge=0, lt=20)]


class _RoomFields(BaseModel):
    type: RoomType
    name: Any = None
    polygon: list[_Point] = Field(min_length=3, max_length=MAX_CORNERS, fail_fast=True)


class _OpeningFields(BaseModel):
    at: _Point
    kind: Any = None
    entrance: Any = None
    width: Annotated[_Length, Field(ge=0.3)] = 0.9
    height: Annotated[_Length, Field(ge=_LEAST_TALL_M)] = 2.1
    sill: _Length = 0.0


class _WallFields(BaseModel):
    """A wall, column or railing beside the rooms' own walls."""

    start: _Point
    end: _Point
    thickness: Annotated[Finite, Field(ge=0.02, le=2)] = 0.1
    height: Annotated[Finite, Field(ge=0.1, le=6)] | None = None


class _PlanFields(BaseModel):
    rooms: list[Any] = Field(min_length=1, max_length=MAX_ROOMS)
    height: Finite = Field(2.5, ge=2, le=6)
    doors: list[Any] = Field(default_factory=list, max_length=5_000)
    windows: list[Any] = Field(default_factory=list, max_length=5_000)
    walls: list[Any] = Field(default_factory=list, max_length=500)


def plan_of_value(
    path: Path, value: Any, left_out: LeftOut | None = None, tops: Sequence[WallTop] = ()
) -> Plan:
    """The plan of a value; faults go to left_out, without it (of a person's plan) they are BadInput."""
    plan = checked(_PlanFields, value, path, hint='{"rooms": [...], "doors": [...]}')
    # Build walls between the drawn rooms; openings are then assigned to walls.
    fields = [checked(_RoomFields, row, path, f"room {k}") for k, row in enumerate(plan.rooms, 1)]
    _check_unit(path, fields)
    drawn = [
        room
        for k, f in enumerate(fields, 1)
        if (room := _room_of_fields(path, f"room {k}", f, left_out))
    ]
    if left_out is None:
        _check_apart(path, drawn)
    else:
        drawn = _apart(drawn, left_out)
    if not drawn:
        raise BadInput(path, "rooms", f"no room of {_LEAST_M2} m2 or more is left")
    walls, rooms = walled(drawn)
    walls = with_tops(walls, tops)
    for room, built in zip(drawn, rooms, strict=True):
        if len(built.polygon) < 3 and left_out is None:
            raise BadInput(path, f"{room.place} ({room.name})", "has no floor beside its walls")
    rooms = tuple(room for room in rooms if len(room.polygon) >= 3)
    builder = _Openings(path, walls, rooms, plan.height, is_of_machine=left_out is not None)
    openings = [(f"door {k}", row, OpeningKind.DOOR) for k, row in enumerate(plan.doors, 1)]
    openings += [(f"window {k}", row, OpeningKind.WINDOW) for k, row in enumerate(plan.windows, 1)]
    for place, row, kind in openings:
        try:
            builder.add(place, row, kind)
        except BadInput as error:
            if left_out is None:
                raise
            left_out.add(f"an opening {error.text}", place)
    more = [_wall_of_row(path, k, row) for k, row in enumerate(plan.walls, 1)]
    return Plan(rooms, (*walls, *more), tuple(builder.found), plan.height)


def _wall_of_row(path: Path, number: int, row: object) -> PlanWall:
    fields = checked(_WallFields, row, path, f"wall {number}")
    if fields.start == fields.end:
        raise BadInput(path, f"wall {number}", "has no length")
    return PlanWall(fields.start, fields.end, fields.thickness, height=fields.height)


def _check_unit(path: Path, rooms: list[_RoomFields]) -> None:
    """Raise BadInput for rooms whose size shows that the unit is not metres."""
    points = np.array([p for room in rooms for p in room.polygon])
    extent = float(np.ptp(points, axis=0).max())
    sides = [float(np.sqrt(abs(Polygon(room.polygon).area))) for room in rooms]
    side = float(np.median(sides))
    low, high = _USUAL_SIDE_M
    looks = next(
        (
            f": looks like {name}"
            for factor, name in ((100, "centimetres"), (1000, "millimetres"))
            if low <= side / factor <= high
        ),
        "",
    )
    if extent > _FAR_M:
        raise BadInput(path, "", f"is over {_FAR_M:g} m wide{looks}", hint="coordinates in metres")
    if side > high and looks:
        raise BadInput(path, "", f"has rooms of {side:.0f} m{looks}", hint="coordinates in metres")
    if 0 < extent < 0.5 and low <= side * 100 <= high:
        text = f"is {extent:.2f} m wide: looks like hundreds of metres, not metres"
        raise BadInput(path, "", text, hint="coordinates in metres, not a hundredth of them")


def _room_of_fields(
    path: Path, place: str, room: _RoomFields, left_out: LeftOut | None
) -> DrawnRoom | None:
    shape: Polygon | None = Polygon(room.polygon)
    name = str(room.name or room.type.label)[:60]
    if left_out is not None and shape is not None and not shape.is_valid:
        shape = largest_part(shapely.make_valid(shape))
        left_out.add("an outline crosses itself: its largest part is kept", place)
    if left_out is not None and (shape is None or shape.area < _LEAST_M2):
        left_out.add(f"an area below {_LEAST_M2} m2 is a sliver", place)
        return None
    assert shape is not None
    if not shape.is_valid or shape.area < _LEAST_M2:
        why = "crosses itself" if not shape.is_valid else f"has {shape.area:.2f} m2"
        raise BadInput(path, place, f"{why}; simple polygons of {_LEAST_M2} m2 or more work")
    for tolerance in _TOLERANCES_M:
        simple = Polygon(corners(shape.simplify(tolerance)))
        if len(simple.exterior.coords) <= _MOST_SIDES and simple.is_valid and simple.area > 0:
            return DrawnRoom(place, room.type, name, simple)
    n = len(simple.exterior.coords) - 1
    raise BadInput(
        path,
        place,
        f"has {n} corners even when curves of {_TOLERANCES_M[-1]} m are made straight",
        hint=f"{_MOST_SIDES} work",
    )


def _check_apart(path: Path, drawn: list[DrawnRoom]) -> None:
    for i, room in enumerate(drawn):
        for drawn_before in drawn[:i]:
            shared = room.shape.intersection(drawn_before.shape).area
            if shared > 0.05:
                text = f"overlaps {drawn_before.name!r} by {shared:.2f} m2"
                raise BadInput(path, f"{room.place} ({room.name})", text)


def _apart(drawn: list[DrawnRoom], left_out: LeftOut) -> list[DrawnRoom]:
    """The rooms without what they share: the smaller one of two keeps it."""
    order = sorted(range(len(drawn)), key=lambda k: (drawn[k].shape.area, k))
    rest: dict[int, DrawnRoom] = {}
    taken: BaseGeometry = Polygon()
    for k in order:
        room = drawn[k]
        if room.shape.intersection(taken).area > 1e-4:
            shape = largest_part(room.shape.difference(taken))
            if shape is None or shape.area < _LEAST_M2:
                left_out.add("a room is inside others", room.place)
                continue
            if room.shape.area - shape.area > 0.05:
                left_out.add("a room overlaps another, which keeps what they share", room.place)
            if shape.interiors:
                # A room inside a room: the outer one keeps its outline, and the inner one goes.
                inner = [
                    j for j, r in rest.items() if Polygon(shape.exterior).contains(r.shape.centroid)
                ]
                for j in inner:
                    del rest[j]
                    left_out.add("a room is inside another", drawn[j].place)
            room = room._replace(shape=Polygon(corners(Polygon(shape.exterior).simplify(1e-3))))
        rest[k] = room
        taken = unary_union([taken, room.shape])
    return [rest[k] for k in sorted(rest)]


@dataclass
class _Openings:
    """Puts openings into walls; state: those found so far."""

    path: Path
    walls: tuple[PlanWall, ...]
    rooms: tuple[PlanRoom, ...]
    height: float
    is_of_machine: bool

    def __post_init__(self) -> None:
        self.found: list[PlanOpening] = []
        self._lines = [LineString([w.start, w.end]) for w in self.walls]
        self._near = shapely.STRtree(self._lines)
        self._grounds = [Polygon(room.polygon) for room in self.rooms]

    def add(self, place: str, row: object, kind: OpeningKind) -> None:
        """Add a door or window in the wall nearest to where it is said to be. Raises BadInput."""
        fields = checked(_OpeningFields, row, self.path, place)
        if fields.entrance or fields.kind == "entrance":
            kind = OpeningKind.ENTRANCE
        if fields.kind in ("french_window", "passage"):
            kind = OpeningKind(fields.kind)
        usual = dict(zip(("width", "height", "sill"), _SIZES[kind], strict=True))
        width, tall, sill = (
            usual | fields.model_dump(include=set(usual), exclude_unset=True)
        ).values()
        if self.is_of_machine:
            sill = min(sill, self.height - 0.4)
            tall = min(tall, self.height - 0.03 - sill)
        if sill + tall > self.height - 0.02:
            text = f"is higher than the room: {self.height - 0.02 - sill:.2f} m works"
            raise BadInput(self.path, place, text)
        point = shapely.Point(fields.at)
        wall = self._nearest_wall(place, point, width)
        if self.walls[wall].length < width + 0.04:
            text = f"is wider than its wall of {self.walls[wall].length:.2f} m"
            hint = f"{max(self.walls[wall].length - 0.05, 0.3):.2f} m works"
            raise BadInput(self.path, place, text, hint=hint)
        self._put(place, point, wall, kind, (width, tall, sill))

    def _nearest_wall(self, place: str, at: shapely.Point, width: float) -> int:
        near = self._near.query(at.buffer(_REACH_M)).tolist()
        far = {k: self._lines[k].distance(at) for k in near or range(len(self.walls))}
        wall = min(far, key=lambda k: (far[k], k))
        if far[wall] > _REACH_M:
            text = f"is {far[wall]:.1f} m from the nearest wall"
            raise BadInput(self.path, place, text, hint=f"within {_REACH_M} m of one")
        if self.is_of_machine:
            # Among about equally near walls choose a long enough one.
            fits = [k for k in far if self.walls[k].length >= width + 0.04 and far[k] <= _REACH_M]
            best = min(fits, key=lambda k: (far[k], k), default=wall)
            return best if far[best] <= far[wall] + 0.2 else wall
        return wall

    def _put(
        self,
        place: str,
        at: shapely.Point,
        number: int,
        kind: OpeningKind,
        size: tuple[float, float, float],
    ) -> None:
        width, tall, sill = size
        wall = self.walls[number]
        along = self._lines[number].project(at)
        along = min(max(along, width / 2 + 0.02), wall.length - width / 2 - 0.02)
        if wall.tops:
            # Below a sloping edge: as high as the wall is over the whole width.
            tall = min(tall, wall.top_over(along - width / 2, along + width / 2) - 0.03 - sill)
            if tall < _LEAST_TALL_M:
                raise BadInput(self.path, place, "is higher than its wall")
        if self.is_of_machine:
            for prior in self.found:
                if prior.wall == number and abs(prior.along - along) < (prior.width + width) / 2:
                    raise BadInput(self.path, place, "overlaps another in its wall")
        hole = shapely.Point(wall.at(along)).buffer(wall.thickness / 2 + 0.15)
        beside = [k for k, ground in enumerate(self._grounds) if ground.intersects(hole)]
        if not beside:
            raise BadInput(self.path, place, "touches no room")
        # A door swings into the smaller need: out of halls, into rooms.
        beside.sort(key=lambda k: (self.rooms[k].type is RoomType.HALL, -self.rooms[k].area))
        other_room = beside[1] if len(beside) > 1 else None
        is_outer = other_room is None and self.rooms[beside[0]].type is not RoomType.BALCONY
        if self.is_of_machine and kind is OpeningKind.DOOR and is_outer:
            kind = OpeningKind.ENTRANCE
        if self.is_of_machine and wall.height is not None and sill + tall > wall.height:
            raise BadInput(self.path, place, "is in a parapet")
        self.found.append(
            PlanOpening(
                kind,
                number,
                round(along, 4),
                width,
                tall,
                sill,
                beside[0],
                other_room,
                hinge_at_start=along < wall.length / 2,
            )
        )


FORMAT = PlanFormat(
    title="custom plan",
    files=".json or .geojson",
    order=180,
    brings="rooms, doors, windows",
    where="written by hand or by a program",
    licence="yours",
    suffixes=(".geojson",),
    keys=(("features",), ("rooms",)),
)
