"""Values of furnishing: slots, templates and their places; no effects.

A template's frame: u along the wall, v from the wall into the room, both in metres; u turned
clockwise on the page by a quarter is v. Its pieces face +v unless they are turned.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from enum import Enum, auto
from functools import cached_property
from typing import Final

from pbrs_farm.core.catalogue import Piece
from pbrs_farm.generate.floor_plan import PlacedPiece, Point, Rect

_WORKTOP_M: Final = 0.9


class Stand(Enum):
    """Where in a room a template may be placed."""

    WALL = auto()  # its back at a wall
    CORNER = auto()  # at a wall and with one end at the next one
    FREE = auto()  # anywhere, in any of four directions


@dataclass(frozen=True, slots=True)
class WallFrame:
    """A place in the plan: the template's origin and the direction of its u."""

    x: float
    z: float
    dx: float
    dz: float

    def point(self, u: float, v: float) -> Point:
        """The plan's (x, z) of a point of the template."""
        return self.x + u * self.dx - v * self.dz, self.z + u * self.dz + v * self.dx

    def rect(self, rect: Rect) -> Rect:
        """The plan's rectangle of one of the template."""
        a, b = self.point(rect[0], rect[1]), self.point(rect[2], rect[3])
        return min(a[0], b[0]), min(a[1], b[1]), max(a[0], b[0]), max(a[1], b[1])

    @property
    def angle_rad(self) -> float:
        """The angle of a piece that looks along +v."""
        return math.atan2(self.dz, self.dx)


@dataclass(frozen=True, slots=True)
class PieceSlot:
    """A piece in a template."""

    piece: Piece
    u: float  # of the middle of its base
    v: float
    width: float
    depth: float
    height: float
    elevation: float = 0.0
    turns: int = 0  # quarters, clockwise on the page

    @property
    def rect(self) -> Rect:
        """Its ground in the template."""
        w, d = (self.width, self.depth) if self.turns % 2 == 0 else (self.depth, self.width)
        return self.u - w / 2, self.v - d / 2, self.u + w / 2, self.v + d / 2

    @property
    def top(self) -> float:
        """Metres above the floor."""
        return self.elevation + self.height

    @property
    def screen_top(self) -> float:
        """Up to where it hides a window behind it: a sink's tap does not."""
        return min(self.top, _WORKTOP_M) if self.piece.group == "sink" else self.top

    def mirrored(self) -> PieceSlot:
        """On the other side of the template's middle."""
        return replace(self, u=-self.u, turns=-self.turns)

    def placed(self, frame: WallFrame, room: int) -> PlacedPiece:
        """The piece at the template's place."""
        x, z = frame.point(self.u, self.v)
        angle = (frame.angle_rad + self.turns * math.pi / 2) % (2 * math.pi)
        return PlacedPiece(
            self.piece,
            round(x, 4),
            round(z, 4),
            round(self.elevation, 4),
            round(angle, 6),
            round(self.width, 4),
            round(self.depth, 4),
            round(self.height, 4),
            room,
        )


@dataclass(frozen=True, slots=True)
class Liking:
    """Weights of the criteria for a good place."""

    corner: float = 0.3  # one end at a wall
    daylight: float = 0.0  # near a window
    door: float = 0.0  # far from doors
    window_wall: float = 0.0  # below a window
    middle: float = 0.0  # near the room's middle
    back: float = 0.0  # of a free one: its far end at a wall, or a way behind it


@dataclass(frozen=True)
class Template:
    """A rigid group of pieces with the areas that they need free."""

    name: str
    slots: tuple[PieceSlot, ...]
    clear: tuple[Rect, ...] = ()  # in the room, without furniture of others
    fronts: tuple[Rect, ...] = ()  # a way must reach each
    stand: Stand = Stand.WALL
    end: int = -1  # which end of a corner template is at the next wall: -1 the left one
    rank: float = 0.0  # how much better than the group's other templates it is
    liking: Liking = field(default_factory=Liking)
    stands_off_floor: bool = False  # what hangs, though nobody can walk below it

    @cached_property
    def bodies(self) -> tuple[PieceSlot, ...]:
        """The slots that nobody can walk through."""
        return tuple(s for s in self.slots if s.elevation < 0.4 or self.stands_off_floor)

    @cached_property
    def extent(self) -> Rect:
        """The rectangle around its bodies."""
        rects = [slot.rect for slot in self.bodies]
        return (
            min(r[0] for r in rects),
            min(r[1] for r in rects),
            max(r[2] for r in rects),
            max(r[3] for r in rects),
        )

    def mirrored(self) -> Template:
        """Left and right exchanged; the pieces themselves are not."""

        def turned(rects: tuple[Rect, ...]) -> tuple[Rect, ...]:
            return tuple((-u1, v0, -u0, v1) for u0, v0, u1, v1 in rects)

        return replace(
            self,
            slots=tuple(slot.mirrored() for slot in self.slots),
            clear=turned(self.clear),
            fronts=turned(self.fronts),
            end=-self.end,
        )


@dataclass(frozen=True, slots=True)
class PieceGroup:
    """Alternative templates for one purpose; a room gets one of them."""

    name: str
    templates: tuple[Template, ...]
    is_required: bool = True


@dataclass(frozen=True, slots=True)
class Standing:
    """A template with its place."""

    template: Template
    frame: WallFrame
    score: float

    @property
    def bodies(self) -> list[Rect]:
        """Plan rectangles of the pieces on the floor."""
        return [self.frame.rect(slot.rect) for slot in self.template.bodies]

    @property
    def clear(self) -> list[Rect]:
        """Plan rectangles that stay free."""
        return [self.frame.rect(rect) for rect in self.template.clear]

    @property
    def fronts(self) -> list[Rect]:
        """Plan rectangles that a way must reach."""
        return [self.frame.rect(rect) for rect in self.template.fronts]

    def pieces(self, room: int) -> list[PlacedPiece]:
        """Its pieces in the plan."""
        return [slot.placed(self.frame, room) for slot in self.template.slots]
