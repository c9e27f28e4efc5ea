"""What a Home.xml says, as values in metres and radians; no effects.

Plan points are (x, y) of the file = (x, z) of the world. Colours are sRGB-encoded 0..1.
"""

from __future__ import annotations

import posixpath
from dataclasses import dataclass
from xml.etree.ElementTree import Element, ParseError

import numpy as np
from defusedxml.common import DefusedXmlException
from defusedxml.ElementTree import fromstring

from pbrs_farm.core.arrays import Points2
from pbrs_farm.core.errors import BadHouse
from pbrs_farm.read.common.source_files import Layered, Resources, ZipResources
from pbrs_farm.read.sweethome3d.home_file.java_home import RESAVE, root_from_java

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
    """What covers a surface; nothing given = the default."""

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


# A home file's bytes -> its XML tree and the contents it names.
# Nothing in the file is trusted: entity definitions and external entities are rejected
# unexpanded, zip entries are bounded, and no class of a Java stream is loaded
# (java_stream).


MAX_XML_BYTES = 16 * 2**20
MAX_DEPTH = 200  # nested elements


@dataclass(frozen=True, slots=True)
class Container:
    """The root element <home> and whatever holds models and textures."""

    root: Element
    contents: Resources


def open_container(data: bytes, file: str, resources: Resources | None) -> Container:
    """Take a home file apart; resources: the program's own models, for files that refer to them.

    Raises BadHouse for what is neither a zip nor XML, has no Home.xml, or is unsafe.
    """
    if data.startswith(b"PK"):
        archive = ZipResources(data, file)
        xml = archive.read("Home.xml")
        if xml is None:
            # Old versions, and homes saved without XML, hold the program's serialised objects alone.
            java = archive.read("Home")
            if java is None:
                raise BadHouse(file, "", "holds no Home.xml and no Home", hint=RESAVE)
            return Container(root_from_java(java, file), Layered(archive, resources))
        return Container(_parsed(xml, file, "Home.xml"), Layered(archive, resources))
    if data.lstrip(b"\xef\xbb\xbf \t\r\n")[:1] == b"<" or data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return Container(_parsed(data, file, ""), Layered(resources))
    raise BadHouse(file, "", "neither a .sh3d archive (zip) nor a Home.xml", hint=RESAVE)


def needs_program(data: bytes, file: str) -> bool:
    """Whether a home names models or pictures that its file does not hold: the program's own."""
    try:
        root = open_container(data, file, None).root
        held = ZipResources(data, file).names() if data.startswith(b"PK") else ()
        # Models and pictures are all that a home names.
        named = {e.get(key) for e in root.iter() for key in ("model", "image")}
        return not {posixpath.normpath(name) for name in named if name} <= set(held)
    except BadHouse:
        return False  # the reader will say what is wrong with it


def _parsed(xml: bytes, file: str, entry: str) -> Element:
    if len(xml) > MAX_XML_BYTES:
        raise BadHouse(file, entry, f"{len(xml)} bytes of XML, at most {MAX_XML_BYTES} are read")
    try:
        root: Element = fromstring(xml, forbid_dtd=False, forbid_entities=True)
    except DefusedXmlException as error:
        what = type(error).__name__
        raise BadHouse(file, entry, f"XML with entity definitions is refused ({what})") from None
    except ParseError as error:
        raise BadHouse(file, entry, f"XML is not well-formed: {error}", hint=RESAVE) from None
    except (ValueError, LookupError, RecursionError):
        text = "XML cannot be read: unknown encoding, or nested too deeply"
        raise BadHouse(file, entry, text, hint=RESAVE) from None
    if root.tag != "home":
        raise BadHouse(file, entry, f"the root element is <{root.tag[:40]}>, not <home>")
    if _depth(root) > MAX_DEPTH:
        raise BadHouse(file, entry, f"elements nested deeper than {MAX_DEPTH}")
    return root


def _depth(root: Element) -> int:
    # Go down level by level: no recursion that a deep file could exhaust.
    depth, level = 0, [root]
    while level and depth <= MAX_DEPTH:
        depth, level = depth + 1, [child for element in level for child in element]
    return depth
