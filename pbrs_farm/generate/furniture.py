"""The nouns of a furnished plan: a piece that stands in a room, a storey with its pieces; no effects."""

from __future__ import annotations

import math
from dataclasses import dataclass

from pbrs_farm.core.catalogue import Piece
from pbrs_farm.generate.floor_plan import Plan, Point


@dataclass(frozen=True, slots=True)
class PlacedPiece:
    """A piece where it stands; metres in the plan's (x, z)."""

    piece: Piece
    x: float  # of the middle of its base
    z: float
    elevation: float  # of its base above the floor
    angle_rad: float  # clockwise on the page with z down; at 0 its front looks to +z
    width: float  # along its own x, as it is wanted: the model is scaled to it
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
    """A plan and what stands in its rooms."""

    plan: Plan
    pieces: tuple[PlacedPiece, ...]
