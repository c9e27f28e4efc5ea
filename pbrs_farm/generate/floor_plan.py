"""Frozen values of a floor plan and its furniture, metres, (x, z) with z down the page; no effects."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum

import numpy as np

from pbrs_farm.core.catalogue import Piece

Point = tuple[float, float]
Rect = tuple[float, float, float, float]  # x0, z0, x1, z1


class RoomType(StrEnum):
    """Type of a room."""

    LIVING = "living"
    KITCHEN = "kitchen"
    BEDROOM = "bedroom"
    OFFICE = "office"  # to work in
    DINING = "dining"
    STUDIO = "studio"  # to live and to sleep in
    BATHROOM = "bathroom"
    WC = "wc"
    HALL = "hall"
    STORE = "store"
    WARDROBE = "wardrobe"
    BALCONY = "balcony"
    STAIRS = "stairs"  # the stairwell: open to the hall, on either storey

    @property
    def is_habitable(self) -> bool:
        """Whether people spend their days or nights there: it needs daylight."""
        return self in (
            RoomType.LIVING,
            RoomType.KITCHEN,
            RoomType.BEDROOM,
            RoomType.OFFICE,
            RoomType.DINING,
            RoomType.STUDIO,
        )

    @property
    def is_wet(self) -> bool:
        """Whether water runs there."""
        return self in (RoomType.KITCHEN, RoomType.BATHROOM, RoomType.WC)

    @property
    def label(self) -> str:
        """Name of the room type on a drawn plan."""
        if self in (RoomType.LIVING, RoomType.STUDIO):
            return "Living room"
        if self in (RoomType.STORE, RoomType.DINING):
            return f"{self.value.capitalize()} room"
        return "WC" if self is RoomType.WC else self.value.capitalize()


class OpeningKind(StrEnum):
    """Kind of an opening in a wall."""

    DOOR = "door"
    ENTRANCE = "entrance"
    PASSAGE = "passage"  # a hole without a leaf
    WINDOW = "window"
    FRENCH_WINDOW = "french_window"


@dataclass(frozen=True, slots=True)
class PlanRoom:
    """A room; its polygon follows the inner faces of its walls."""

    type: RoomType
    name: str
    polygon: tuple[Point, ...]  # anticlockwise with x right and z up, not closed

    @property
    def area(self) -> float:
        """Floor area in square metres."""
        return abs(sum(x0 * z1 - x1 * z0 for (x0, z0), (x1, z1) in _edges(self.polygon))) / 2

    @property
    def bounds(self) -> Rect:
        """The axis-aligned rectangle around it."""
        xs, zs = [p[0] for p in self.polygon], [p[1] for p in self.polygon]
        return min(xs), min(zs), max(xs), max(zs)

    def contains(self, point: Point) -> bool:
        """True if a point (x, z), metres, is inside the room's polygon, by the sides a ray crosses."""
        x, z = point
        crossed = [
            (za > z) != (zb > z) and x < xa + (z - za) / (zb - za) * (xb - xa)
            for (xa, za), (xb, zb) in self.edges
        ]
        return sum(crossed) % 2 == 1

    @property
    def edges(self) -> Iterator[tuple[Point, Point]]:
        """Each side of the polygon, from corner to corner."""
        return _edges(self.polygon)


@dataclass(frozen=True, slots=True)
class PlanWall:
    """A straight wall along the middle line start..end."""

    start: Point
    end: Point
    thickness: float
    is_outer: bool = False
    height: float | None = None  # of a parapet; None = the storey's
    tops: tuple[Point, ...] = field(default=(), repr=False)
    """(metres from its start, height) along its upper edge where that is not level; () = level. Not in
    its repr, from which the colours of plans are drawn."""

    @property
    def length(self) -> float:
        """Of the middle line, metres."""
        return math.hypot(self.end[0] - self.start[0], self.end[1] - self.start[1])

    @property
    def normal(self) -> Point:
        """The unit vector across it, to the right when looking from start to end on the page."""
        (x0, z0), (x1, z1) = self.start, self.end
        return (z0 - z1) / self.length, (x1 - x0) / self.length

    def corners(
        self, *, to_start: bool = True, to_end: bool = True
    ) -> tuple[Point, Point, Point, Point]:
        """Corners (x, z) of the wall's ground, extended by half its thickness at ends that meet another wall."""
        (nx, nz), half = self.normal, self.thickness / 2
        a, b = self.at(-half * to_start), self.at(self.length + half * to_end)
        nx, nz = nx * half, nz * half
        return (
            (a[0] + nx, a[1] + nz),
            (b[0] + nx, b[1] + nz),
            (b[0] - nx, b[1] - nz),
            (a[0] - nx, a[1] - nz),
        )

    def top_over(self, low: float, high: float) -> float:
        """The least height between two places along it, of a wall whose upper edge is not level."""
        places, heights = (np.array(v) for v in zip(*self.tops, strict=True))
        ends = np.interp([low, high], places, heights)
        return float(min(*ends, *heights[(places > low) & (places < high)]))

    def at(self, along: float) -> Point:
        """The point of the middle line, or its extension, `along` metres from its start."""
        t = along / self.length
        (x0, z0), (x1, z1) = self.start, self.end
        return x0 + t * (x1 - x0), z0 + t * (z1 - z0)


@dataclass(frozen=True, slots=True)
class PlanOpening:
    """A door or window in a wall."""

    kind: OpeningKind
    wall: int  # index into Plan.walls
    along: float  # of its middle from the wall's start, metres
    width: float
    height: float
    sill: float  # of its lower edge above the floor, metres
    room: int  # index into Plan.rooms: a door swings into it, a window lights it
    other: int | None = None  # the room on the other side; None = outside
    hinge_at_start: bool = True  # a door's hinges are at the end towards the wall's start


@dataclass(frozen=True, slots=True)
class Plan:
    """One storey."""

    rooms: tuple[PlanRoom, ...]
    walls: tuple[PlanWall, ...]
    openings: tuple[PlanOpening, ...]
    height: float  # floor to ceiling, metres
    family: str = ""  # of plans that it is drawn by; none of a plan that a user gave

    def openings_of(self, room: int) -> tuple[PlanOpening, ...]:
        """The doors and windows of a room, from either side."""
        return tuple(o for o in self.openings if room in (o.room, o.other))


def _edges(polygon: tuple[Point, ...]) -> Iterator[tuple[Point, Point]]:
    return zip(polygon, (*polygon[1:], polygon[0]), strict=True)


@dataclass(frozen=True, slots=True)
class PlacedPiece:
    """A piece of furniture with its place; metres in the plan's (x, z)."""

    piece: Piece
    x: float  # of the middle of its base
    z: float
    elevation: float  # of its base above the floor
    angle_rad: float  # clockwise on the page with z down; at 0 its front looks to +z
    width: float  # target width along the piece's x axis; the model is scaled to it
    depth: float
    height: float
    room: int  # index into Plan.rooms
    mirrored: bool = False
    colour: str | None = None  # "#RRGGBB" of the whole piece; None = as modelled

    @property
    def front(self) -> Point:
        """The unit vector (x, z) that its front looks along."""
        return -math.sin(self.angle_rad), math.cos(self.angle_rad)

    @property
    def corners(self) -> tuple[Point, Point, Point, Point]:
        """The corners of its ground, back left first, clockwise on the page."""
        cos, sin = math.cos(self.angle_rad), math.sin(self.angle_rad)
        w, d = self.width / 2, self.depth / 2
        a, b, c, e = (
            (self.x + u * cos - v * sin, self.z + u * sin + v * cos)
            for u, v in ((-w, -d), (w, -d), (w, d), (-w, d))
        )
        return a, b, c, e


@dataclass(frozen=True, slots=True)
class Storey:
    """A plan and the furniture of its rooms."""

    plan: Plan
    pieces: tuple[PlacedPiece, ...]


def ground(piece: PlacedPiece) -> Rect:
    """The rectangle around a piece's corners."""
    xs, zs = [p[0] for p in piece.corners], [p[1] for p in piece.corners]
    return min(xs), min(zs), max(xs), max(zs)


def turned_upright(plan: Plan) -> Plan:
    """The plan turned about its origin by less than 45 degrees, its longest walls upright, to millimetres."""
    return turned_by(plan, upright_angle(plan.rooms))


def upright_angle(rooms: Sequence[PlanRoom]) -> float:
    """Radians, at most 45 degrees, by which to turn rooms so that most of their walls are upright."""
    ways: dict[float, float] = {}
    for (x0, z0), (x1, z1) in (edge for room in rooms for edge in room.edges):
        angle = math.degrees(math.atan2(z1 - z0, x1 - x0)) % 90
        tenth = round(angle, 1) % 90
        ways[tenth] = ways.get(tenth, 0.0) + math.hypot(x1 - x0, z1 - z0)
    main = max(ways, key=lambda angle: (ways[angle], -angle))
    return math.radians(-main if main < 45 else 90 - main)


def turned_by(plan: Plan, angle_rad: float) -> Plan:
    """The plan turned about its origin by an angle from x towards z, corners rounded to millimetres."""
    if angle_rad == 0:
        return plan
    cos, sin = math.cos(angle_rad), math.sin(angle_rad)

    def moved(p: Point) -> Point:
        return round(p[0] * cos - p[1] * sin, 3), round(p[0] * sin + p[1] * cos, 3)

    walls = tuple(replace(w, start=moved(w.start), end=moved(w.end)) for w in plan.walls)
    rooms = tuple(replace(r, polygon=tuple(map(moved, r.polygon))) for r in plan.rooms)
    return replace(plan, walls=walls, rooms=rooms)
