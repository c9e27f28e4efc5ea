"""A half-turn staircase, base centred, both flights starting at its front +z, metres; no effects."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from shapely.geometry import Polygon

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.catalogue import Shape
from pbrs_farm.core.house import Material
from pbrs_farm.generate.floor_plan import Plan, Point, Rect, RoomType
from pbrs_farm.generate.plan_walls import largest_rectangle
from pbrs_farm.geometry.solids import Triple, box_quads, boxes_surface, quads_surface

SLAB_M: Final = 0.26  # from the lower ceiling to the upper floor
HIGHEST_RISER_M: Final = 0.185
RAIL_M: Final = 0.95  # above the upper floor
_TREAD_M: Final = 0.04  # thickness of a tread
_POST_M: Final = 0.035
_APART_M: Final = 0.11  # from post to post
_WOOD: Final = (0.62, 0.45, 0.29)


@dataclass(frozen=True, slots=True)
class Stair:
    """Place of a staircase in the plan of its lower storey."""

    rect: Rect  # free in both storeys
    front: Point  # unit vector (x, z) from the stairs into both halls
    slab_m: float  # from the lower ceiling to the upper floor
    foot_is_right: bool  # which half of the front one goes up, seen from the hall

    @property
    def middle(self) -> Point:
        """Of its ground."""
        x0, z0, x1, z1 = self.rect
        return (x0 + x1) / 2, (z0 + z1) / 2

    @property
    def size(self) -> Point:
        """Its width along the front and its depth, metres."""
        w, d = self.rect[2] - self.rect[0], self.rect[3] - self.rect[1]
        return (w, d) if self.front[0] == 0 else (d, w)

    @property
    def angle_rad(self) -> float:
        """The angle of a piece that looks along its front."""
        return math.atan2(-self.front[0], self.front[1]) % (2 * math.pi)


def stair_between(
    lower: Plan, upper: Plan, front: Point, slab_m: float, *, foot_is_right: bool
) -> Stair:
    """The staircase in the STAIRS of two plans above each other, with slab_m metres between."""
    wells = [next(r for r in p.rooms if r.type is RoomType.STAIRS) for p in (lower, upper)]
    free = Polygon(wells[0].polygon).intersection(Polygon(wells[1].polygon))
    assert isinstance(free, Polygon)
    return Stair(largest_rectangle(free), front, slab_m, foot_is_right)


def n_risers(rise: float) -> int:
    """Number of steps: even, none higher than 18.5 cm."""
    return 2 * math.ceil(rise / HIGHEST_RISER_M / 2)


def staircase(stair: Stair, rise: float, paint: Triple) -> Shape:
    """The shape of a staircase up to `rise` metres; paint: sRGB of its risers and railing."""
    w, d = stair.size
    side = 1.0 if stair.foot_is_right else -1.0
    # Lay a flight's treads from the front edge to the landing; the landing is a tread of both.
    n = n_risers(rise) // 2
    riser, landing = rise / (2 * n), max(w / 2, 0.9)
    going = (d - landing) / (n - 1)
    steps = [_step_boxes((0.0, -d / 2), (w, landing), n * riser)]
    for k in range(1, n):
        up, down = d / 2 - k * going, -d / 2 + landing + (k - 1) * going
        steps.append(_step_boxes((side * w / 4, up), (w / 2, going), k * riser))
        steps.append(_step_boxes((-side * w / 4, down), (w / 2, going), (n + k) * riser))
    # The edge of the upper floor, and a railing where one would fall down on the first flight.
    boards = [box for box, _ in steps]
    boards.append(((-w / 2, rise - stair.slab_m, d / 2 - 0.02), (w / 2, rise, d / 2)))
    flight = [(-d / 2 + landing + (k - 0.5) * going, (n + k) * riser) for k in range(1, n)]
    rails = _level_rail(side, w, d, rise) + _sloped_posts(side, flight)
    slope = _sloped_rail(side, flight, riser / going)
    wood = Material("treads", diffuse=_WOOD, specular=(0.2, 0.2, 0.2), shininess=30.0)
    painted = Material("stairs", diffuse=paint, specular=(0.2, 0.2, 0.2), shininess=30.0)
    surfaces = (
        boxes_surface("risers", boards, 0),
        boxes_surface("treads", [tread for _, tread in steps], 1),
        boxes_surface("railing", rails, 0),
        quads_surface("handrail", slope, 1),
    )
    return Shape(surfaces, (painted, wood))


_Box = tuple[Triple, Triple]  # low and high corner


def _step_boxes(at: Point, size: Point, top: float) -> tuple[_Box, _Box]:
    """(the block below, the tread) of a step; at: the middle of its width, its least z."""
    (x, z), (w, d) = at, size
    block = ((x - w / 2, 0.0, z), (x + w / 2, top - _TREAD_M, z + d))
    return block, ((x - w / 2, top - _TREAD_M, z), (x + w / 2, top, z + d))


def _level_rail(side: float, w: float, d: float, rise: float) -> list[_Box]:
    """Posts and a rail on the edge of the upper floor, over the foot of the stairs."""
    low, high = sorted((side * _POST_M, side * w / 2))
    z0, z1 = d / 2 - 0.02 - _POST_M, d / 2 - 0.02
    n = max(round((high - low) / _APART_M), 2)
    post_positions = np.linspace(low + _POST_M / 2, high - _POST_M / 2, n + 1)
    posts: list[_Box] = [
        ((x - 0.01, rise - 0.1, z0 + 0.008), (x + 0.01, rise + RAIL_M - 0.04, z1 - 0.008))
        for x in post_positions.tolist()
    ]
    return [
        *posts,
        ((low, rise + RAIL_M - 0.04, z0), (high, rise + RAIL_M, z1)),
        ((low, rise - 0.1, z0), (high, rise - 0.04, z1)),
    ]


def _sloped_posts(side: float, flight: list[tuple[float, float]]) -> list[_Box]:
    # One on each tread of the second flight, on the side of the first.
    x = -side * 0.03
    return [
        ((x - 0.01, top, z - 0.01), (x + 0.01, top + RAIL_M - 0.1, z + 0.01)) for z, top in flight
    ]


def _sloped_rail(side: float, flight: list[tuple[float, float]], slope: float) -> F64:
    """A handrail on those posts, parallel to the flight."""
    (z0, y0), (z1, y1) = flight[0], flight[-1]
    length = math.hypot(z1 - z0, y1 - y0) + 0.1
    angle = math.atan(slope)
    # Columns: across, up, along the slope.
    axes = np.array(
        [[1, 0, 0], [0, math.cos(angle), math.sin(angle)], [0, -math.sin(angle), math.cos(angle)]]
    )
    centre = np.array([-side * 0.03, (y0 + y1) / 2 + RAIL_M - 0.09, (z0 + z1) / 2])
    return box_quads(centre, np.array([0.022, 0.025, length / 2]), axes)
