"""Values of a Home.xml in metres, radians and sRGB 0..1; its (x, y) is the world's (x, z). No effects."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pbrs_farm.core.arrays import Points2
from pbrs_farm.core.joints import Joint

Rgb = tuple[float, float, float]
Matrix3 = tuple[float, ...]


@dataclass(frozen=True, slots=True)
class PlanPicture:
    """A texture on a surface, as the home lays it."""

    image: str  # content name
    name: str
    width: float  # of one tile, m
    height: float  # of one tile, m
    offset: tuple[float, float] = (0.0, 0.0)  # in tiles
    angle: float = 0.0  # radians
    scale: float = 1.0
    is_fitting: bool = False  # one tile fills the surface


@dataclass(frozen=True, slots=True)
class Paint:
    """Finish of a surface; empty = the default."""

    colour: Rgb | None = None  # sRGB-encoded
    picture: PlanPicture | None = None
    shininess: float | None = None  # 0..1, None = as the model has it
    is_hidden: bool = False  # not drawn at all

    @property
    def is_empty(self) -> bool:
        """Says nothing at all."""
        return self.colour is None and self.picture is None and not self.is_hidden


@dataclass(frozen=True, slots=True)
class PlanLevel:
    """A storey; walls of upper storeys reach down by the floor's thickness."""

    id: str
    name: str
    elevation: float  # of the floor, m
    floor_thickness: float  # m
    height: float  # of walls, m
    is_visible: bool
    index: int  # among all levels, by elevation
    reach_down: float = 0.0  # of walls below the floor, m


@dataclass(frozen=True, slots=True)
class Baseboard:
    """A strip along a wall's foot."""

    is_left: bool  # of the wall's two sides
    thickness: float  # m
    height: float  # m
    paint: Paint


@dataclass(frozen=True, slots=True)
class HomeWall:
    """A wall's centre line and paint."""

    id: str
    level: str  # id
    start: tuple[float, float]  # of the centre line, (x, z) m
    end: tuple[float, float]  # (x, z) m
    thickness: float
    height: float
    height_end: float | None  # None = as at the start
    arc: float  # radians the wall spans, 0 = straight
    at_start: str  # id of the wall it joins there
    at_end: str  # id of the wall it joins there
    left: Paint  # walking from start to end
    right: Paint
    top: Paint  # paint of the upper face
    baseboards: tuple[Baseboard, ...]


@dataclass(frozen=True, slots=True, eq=False)
class HomeRoom:
    """A room's outline and paint."""

    place: str  # what messages call it
    level: str
    name: str
    points: Points2  # (N, 2) m, as drawn
    has_floor: bool
    has_ceiling: bool
    floor: Paint
    ceiling: Paint
    is_ceiling_flat: bool  # under sloped walls, too


@dataclass(frozen=True, slots=True)
class PlanLight:
    """A light source of a lamp."""

    at: tuple[float, float, float]  # fractions from the left front bottom corner
    colour: Rgb  # sRGB-encoded
    diameter: float | None  # fraction of the lamp's width


@dataclass(frozen=True, slots=True)
class DoorFrame:
    """How a door or window sits in its wall; fractions of its width, depth and height."""

    cut_out: str  # SVG path in the unit square, y down
    wall_width: float  # of the opening
    wall_left: float  # from the box's left
    wall_height: float  # of the opening
    wall_top: float  # from the box's top
    cuts_both_sides: bool


@dataclass(frozen=True, slots=True)
class PlanPiece:
    """A piece of furniture as the home places it."""

    tag: str  # XML element
    place: str  # what messages call it
    level: str
    catalogue_id: str
    name: str
    model: str  # content name
    centre: tuple[float, float]  # (x, z) m
    elevation: float  # of the bottom above the level, m
    angle: float  # about y, radians
    pitch: float  # about x
    roll: float  # about z
    size: tuple[float, float, float]  # width, depth, height, m
    height_in_plan: float | None
    is_mirrored: bool
    rotation: Matrix3 | None  # of the model in its box
    paint: Paint
    materials: tuple[tuple[str, Paint], ...]  # overrides by the model's name
    transformations: tuple[tuple[str, Matrix3], ...] = ()
    frame: DoorFrame | None = None
    lights: tuple[PlanLight, ...] = ()
    light_materials: tuple[str, ...] = ()  # that emit
    power: float = 0.0  # 0..1, 0 = off
    staircase_cut_out: str = ""  # SVG path
    group: str = ""  # name of the group that holds it
    joints: tuple[Joint, ...] = ()  # in the model's frame, if the file has them


@dataclass(frozen=True, slots=True)
class PlanCamera:
    """A stored viewpoint; z = eye height as written, yaw and pitch in the program's sense."""

    name: str
    at: tuple[float, float, float]
    yaw: float
    pitch: float
    hfov: float


@dataclass(frozen=True, slots=True)
class HomePlan:
    """Everything of a home the pipeline uses."""

    name: str
    version: str
    wall_height: float
    properties: dict[str, str]
    levels: tuple[PlanLevel, ...]
    walls: tuple[HomeWall, ...]
    rooms: tuple[HomeRoom, ...]
    pieces: tuple[PlanPiece, ...]
    cameras: tuple[PlanCamera, ...]


def level_of(plan: HomePlan, level_id: str) -> PlanLevel:
    """The level of that id; the home's only storey for an unknown or empty one."""
    for level in plan.levels:
        if level.id == level_id:
            return level
    return PlanLevel("", "", 0.0, 0.12, plan.wall_height, True, 0)


def as_points(points: list[tuple[float, float]]) -> Points2:
    """(N, 2) float64."""
    return np.array(points, np.float64).reshape(-1, 2)
