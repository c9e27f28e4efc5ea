"""What a Home.xml says, as values in metres and radians; no effects.

Plan points are (x, y) of the file = (x, z) of the world. Colours are sRGB-encoded 0..1.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pbrs_farm.core.arrays import Points2

Rgb = tuple[float, float, float]
Matrix3 = tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Picture:
    """A texture on a surface: content name, size of one tile and offsets in metres, angle, scale."""

    image: str
    name: str
    width: float
    height: float
    offset: tuple[float, float] = (0.0, 0.0)
    angle: float = 0.0
    scale: float = 1.0
    is_fitting: bool = False


@dataclass(frozen=True, slots=True)
class Paint:
    """A surface's paint. hidden: drawn not at all. shininess: 0..1, None = as the model has it."""

    colour: Rgb | None = None
    picture: Picture | None = None
    shininess: float | None = None
    is_hidden: bool = False

    @property
    def is_empty(self) -> bool:
        """Says nothing at all."""
        return self.colour is None and self.picture is None and not self.is_hidden


@dataclass(frozen=True, slots=True)
class PlanLevel:
    """A storey; index: its place among all levels, ordered by elevation.

    reach_down: how far its walls reach below its floor (upper storeys: the floor's thickness).
    """

    id: str
    name: str
    elevation: float
    floor_thickness: float
    height: float
    is_visible: bool
    index: int
    reach_down: float = 0.0


@dataclass(frozen=True, slots=True)
class Baseboard:
    """A strip along a wall's foot."""

    is_left: bool
    thickness: float
    height: float
    paint: Paint


@dataclass(frozen=True, slots=True)
class PlanWall:
    """A wall's centre line and paint. height_end: at its end, None = as at its start."""

    id: str
    level: str
    start: tuple[float, float]
    end: tuple[float, float]
    thickness: float
    height: float
    height_end: float | None
    arc: float
    at_start: str
    at_end: str
    left: Paint
    right: Paint
    top: Paint
    baseboards: tuple[Baseboard, ...]


@dataclass(frozen=True, slots=True, eq=False)
class PlanRoom:
    """A room's outline as drawn, (N, 2) metres."""

    place: str
    level: str
    name: str
    points: Points2
    has_floor: bool
    has_ceiling: bool
    floor: Paint
    ceiling: Paint
    is_ceiling_flat: bool


@dataclass(frozen=True, slots=True)
class PlanLight:
    """A light source: position as fractions of the lamp's box, colour, diameter as a fraction."""

    at: tuple[float, float, float]
    colour: Rgb
    diameter: float | None


@dataclass(frozen=True, slots=True)
class DoorFrame:
    """How a door or window sits in its wall; fractions of its width, depth and height."""

    cut_out: str
    wall_width: float
    wall_left: float
    wall_height: float
    wall_top: float
    cuts_both_sides: bool


@dataclass(frozen=True, slots=True)
class PlanPiece:
    """A piece of furniture. centre, elevation: of its box's bottom above the level, metres.

    place: what to call it in a message. group: name of the group that holds it. rotation: 9 numbers row by row or None.
    transformations: (group name, 12 numbers row by row) of movable parts.
    """

    tag: str
    place: str
    level: str
    catalogue_id: str
    name: str
    model: str
    centre: tuple[float, float]
    elevation: float
    angle: float
    pitch: float
    roll: float
    size: tuple[float, float, float]
    height_in_plan: float | None
    is_mirrored: bool
    rotation: Matrix3 | None
    paint: Paint
    materials: tuple[tuple[str, Paint], ...]
    transformations: tuple[tuple[str, Matrix3], ...] = ()
    frame: DoorFrame | None = None
    lights: tuple[PlanLight, ...] = ()
    light_materials: tuple[str, ...] = ()
    power: float = 0.0
    staircase_cut_out: str = ""
    group: str = ""


@dataclass(frozen=True, slots=True)
class PlanCamera:
    """A stored viewpoint; z = eye height as written, yaw and pitch in the program's sense."""

    name: str
    at: tuple[float, float, float]
    yaw: float
    pitch: float
    hfov: float


@dataclass(frozen=True, slots=True)
class Plan:
    """Everything of a home the pipeline uses."""

    name: str
    version: str
    wall_height: float
    properties: dict[str, str]
    levels: tuple[PlanLevel, ...]
    walls: tuple[PlanWall, ...]
    rooms: tuple[PlanRoom, ...]
    pieces: tuple[PlanPiece, ...]
    cameras: tuple[PlanCamera, ...]


def level_of(plan: Plan, level_id: str) -> PlanLevel:
    """The level of that id; the home's only storey for an unknown or empty one."""
    for level in plan.levels:
        if level.id == level_id:
            return level
    return PlanLevel("", "", 0.0, 0.12, plan.wall_height, True, 0)


def as_points(points: list[tuple[float, float]]) -> Points2:
    """(N, 2) float64."""
    return np.array(points, np.float64).reshape(-1, 2)
