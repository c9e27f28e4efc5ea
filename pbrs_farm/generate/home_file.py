"""A furnished plan as a Sweet Home 3D file: Home.xml, models, textures; no effects.

Names and units are those of the program: centimetres, angles in radians, x to the right and y
downwards on the plan (https://www.sweethome3d.com, SweetHome3D.dtd of version 7.0).

    NAME.sh3d                       a ZIP; equal arguments give equal bytes
    ├── Home.xml                    <home version wallHeight camera>
    │     <property name value/>        author, licence, credits of models
    │     <environment/>                colours of ground, sky and light
    │     <observerCamera/> <camera/>   initial cameras of the program
    │     <level id elevation height/>  only in a home of two storeys
    │     <doorOrWindow model/>         each opening, with its cut in the wall
    │     <pieceOfFurniture model/>     stairs, then furniture; a lamp is a <light> with <lightSource>s
    │     <wall xStart yStart .../>     paints left and right
    │     <room floorColor ...>         <texture> of its floor, a <point> a corner
    ├── icon.png                    of every piece
    ├── 0/model.obj, 0/model.mtl    each model once, with its pictures
    └── t<digest>.jpg               pictures of floors
"""

from __future__ import annotations

import io
import math
import zipfile
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final
from xml.etree import ElementTree as ET

import numpy as np

from pbrs_farm.core import keys
from pbrs_farm.core.catalogue import Catalogue, Picture, Place, Shape
from pbrs_farm.core.house import MaterialKind
from pbrs_farm.core.joints import JOINTS_PROPERTY
from pbrs_farm.formats.serialise import json_from_value
from pbrs_farm.generate.floor_plan import (
    OpeningKind,
    PlacedPiece,
    Plan,
    PlanOpening,
    PlanRoom,
    PlanWall,
    RoomType,
    Storey,
)
from pbrs_farm.generate.model_file import material_name, obj_file, side_files
from pbrs_farm.generate.opening_models import OpeningDesign, door_form, drawn_design, opening_model
from pbrs_farm.generate.plan_families import FLAT, PlanFamily, plan_families
from pbrs_farm.generate.staircase import SLAB_M, Stair, staircase
from pbrs_farm.images import png_from_array

AUTHOR: Final = "pbrs_farm"
VERSION: Final = "7000"
_ZIP_TIME: Final = (2000, 1, 1, 0, 0, 0)  # of every entry: the same home has the same bytes
_EYE_M: Final = 1.6
_STEP_M: Final = 0.01  # gap in the wall at a step of its upper edge, metres
_FIELD_OF_VIEW_RAD: Final = 1.1
_LAMP_POWER: Final = 0.5
_DOOR_NAMES: Final = {
    OpeningKind.DOOR: "Door",
    OpeningKind.ENTRANCE: "Front door",
    OpeningKind.PASSAGE: "Door frame",
    OpeningKind.WINDOW: "Window",
    OpeningKind.FRENCH_WINDOW: "French window",
}
_FLOOR_GROUPS: Final = {RoomType.KITCHEN: "tiles", RoomType.BATHROOM: "tiles", RoomType.WC: "tiles"}
_DRY_FLOOR: Final = "dry"
_OPEN_WELLS: Final = {"level-0": "ceiling", "level-1": "floor"}
_LEVEL_NAMES: Final = ("Ground floor", "Upper floor")


@dataclass(frozen=True, slots=True)
class Paints:
    """The colours of a home, "RRGGBB"."""

    walls: tuple[str, ...]  # of rooms to live in, one drawn for each
    wet_walls: str
    floor: str
    wet_floor: str
    ceiling: str
    design: OpeningDesign


def drawn_paints(rng: np.random.Generator, family: PlanFamily) -> Paints:
    """RRGGBB paints of a family for walls, doors and windows of one paint, drawn by rng."""
    chosen = [family.walls[i] for i in rng.permutation(len(family.walls))[:3]]
    wood = family.opening_paints[int(rng.integers(len(family.opening_paints)))]
    red, green, blue = (int(wood[k : k + 2], 16) / 255 for k in (0, 2, 4))
    design = drawn_design(rng, (red, green, blue), family.leaves, family.sashes)
    return Paints(tuple(chosen), "EEF1F1", family.floor, "C9C6BF", family.ceiling, design)


def home_contents(
    storeys: Sequence[Storey],
    catalogue: Catalogue,
    rng: np.random.Generator,
    stair: Stair | None = None,
    *,
    name: str = "home",
    origin: str = "",
) -> HomeContents:
    """Contents of a .sh3d with these storeys, from below, without pieces that lack a model; equal for equal arguments."""
    plan, placed = storeys[0].plan, [p for s in storeys for p in s.pieces]
    contents = HomeContents()
    home = contents.home
    home.attrib |= {
        "version": VERSION,
        "name": f"{name}.sh3d",
        "camera": "topCamera",
        "wallHeight": _cm(plan.height),
    }
    # Select a level, or the program shows a blank plan.
    if len(storeys) > 1:
        home.set("selectedLevel", "level-0")
    _add_properties(home, placed, origin)
    _add_surroundings(home, plan)
    family = plan_families()[plan.family or FLAT]
    paints = drawn_paints(_fork(rng), family)
    # One wood and one tile for the whole home.
    floors = _drawn_floors(catalogue, family, rng)
    levels = _add_levels(home, storeys, stair)
    for storey, level in zip(storeys, levels, strict=True):
        for opening in storey.plan.openings:
            element = _add_opening(home, storey.plan, opening, contents, paints)
            element.attrib |= level
    if stair is not None:
        rise = plan.height + stair.slab_m
        _add_stairs(home, stair, rise, contents, paints).attrib |= levels[0]
    for storey, level in zip(storeys, levels, strict=True):
        for piece in storey.pieces:
            _add_piece(home, piece, catalogue, contents, storey.plan.height, level)
    for storey, level in zip(storeys, levels, strict=True):
        _add_walls(home, storey.plan, paints, level)
    for storey, level in zip(storeys, levels, strict=True):
        _add_rooms(home, storey.plan, paints, floors, contents, level, has_stair=stair is not None)
    return contents


def _fork(rng: np.random.Generator) -> np.random.Generator:
    # The same paints whenever they are asked for: the stream itself stays where it is.
    state = rng.bit_generator.state
    copy = np.random.default_rng()
    copy.bit_generator.state = state
    return copy


class HomeContents:
    """Contents of a home's file: Home.xml as a tree, and the files it references, each model once."""

    def __init__(self) -> None:
        self.home = ET.Element("home")
        self.shapes: dict[str, Shape] = {}
        """The models, by the path of their OBJ."""
        self._files: dict[str, bytes | Shape] = {}
        self._models: dict[str, str] = {}
        self.icon = "icon.png"
        picture = np.full((32, 32, 4), 255, np.uint8)
        picture[4:28, 4:28, :3] = (170, 170, 165)
        self._files[self.icon] = png_from_array(picture)

    def model(self, key: str, shape: Shape) -> str:
        """Path of a shape's model; key: identity of the shape."""
        if key not in self._models:
            folder = str(len(self._models))
            path = f"{folder}/model.obj"
            self._models[key], self._files[path], self.shapes[path] = path, shape, shape
            for name, data in side_files(shape).items():
                self._files[f"{folder}/{name}"] = data
        return self._models[key]

    def picture(self, picture: Picture) -> str:
        """The path of a surface picture."""
        ending = "png" if picture.texture.media_type == "image/png" else "jpg"
        path = f"t{picture.texture.id}.{ending}"
        self._files[path] = picture.texture.data
        return path

    def read(self, name: str) -> bytes | None:
        """The bytes of a content; None for an unknown name."""
        data = self._files.get(name)
        return obj_file(data) if isinstance(data, Shape) else data

    def archive(self) -> bytes:
        """The ZIP with Home.xml first."""
        buffer = io.BytesIO()
        xml = ET.tostring(self.home, encoding="UTF-8", xml_declaration=True)
        with zipfile.ZipFile(buffer, "w") as archive:
            for name in ("Home.xml", *self._files):
                info = zipfile.ZipInfo(name, _ZIP_TIME)
                packed = name.endswith((".png", ".jpg"))
                info.compress_type = zipfile.ZIP_STORED if packed else zipfile.ZIP_DEFLATED
                archive.writestr(info, xml if name == "Home.xml" else self.read(name) or b"")
        return buffer.getvalue()


def _added(parent: ET.Element, tag: str, **attributes: str) -> ET.Element:
    return ET.SubElement(parent, tag, attributes)


def _cm(metres: float) -> str:
    return f"{metres * 100:.2f}".rstrip("0").rstrip(".")


def _add_properties(home: ET.Element, pieces: list[PlacedPiece], origin: str) -> None:
    # Say who made it, and whose models it holds.
    owed = Counter(
        (p.piece.creator or p.piece.library, p.piece.licence)
        for p in pieces
        if p.piece.licence.startswith("CC-BY")
    )
    credits = "; ".join(f"{creator}, {licence}" for creator, licence in sorted(owed))
    rows = {"Author": AUTHOR, "License": "CC-BY 3.0" if owed else "CC0"}
    if origin:
        rows["Made"] = origin
    if credits:
        rows["Models"] = credits
    for key, value in rows.items():
        _added(home, "property", name=key, value=value)


def _add_surroundings(home: ET.Element, plan: Plan) -> None:
    _added(
        home,
        "environment",
        groundColor="00A8A8A8",
        skyColor="00CCE4FC",
        lightColor="00D0D0D0",
        ceillingLightColor="00D0D0D0",
    )
    xs = [p for wall in plan.walls for p in (wall.start[0], wall.end[0])]
    zs = [p for wall in plan.walls for p in (wall.start[1], wall.end[1])]
    middle, size = (sum((min(xs), max(xs))) / 2, max(zs)), max(max(xs), max(zs))
    living = max(plan.rooms, key=lambda room: room.area)
    x0, z0, x1, z1 = living.bounds
    for tag, x, z, y, pitch in (
        ("observerCamera", (x0 + x1) / 2, (z0 + z1) / 2, _EYE_M, 0.14),
        ("topCamera", middle[0], middle[1] + size * 0.6, size * 1.1, 0.9),
    ):
        _added(
            home,
            "observerCamera" if tag[0] == "o" else "camera",
            attribute=tag,
            x=_cm(x),
            y=_cm(z),
            z=_cm(y),
            yaw=f"{math.pi:.6f}",
            pitch=f"{pitch:g}",
            fieldOfView=f"{_FIELD_OF_VIEW_RAD:g}",
            lens="PINHOLE",
            time="1700000000000",
        )


def _add_levels(
    home: ET.Element, storeys: Sequence[Storey], stair: Stair | None
) -> list[dict[str, str]]:
    """The attributes that put an element on each storey: none for a home of one."""
    if len(storeys) == 1:
        return [{}]
    slab = stair.slab_m if stair is not None else SLAB_M
    levels, elevation = [], 0.0
    for number, storey in enumerate(storeys):
        name = f"level-{number}"
        _added(
            home,
            "level",
            id=name,
            name=(*_LEVEL_NAMES, f"Floor {number}")[min(number, 2)],
            elevation=_cm(elevation),
            floorThickness=_cm(slab),
            height=_cm(storey.plan.height),
            elevationIndex="0",
        )
        levels.append({"level": name})
        elevation += storey.plan.height + slab
    return levels


def _add_stairs(
    home: ET.Element, stair: Stair, rise: float, contents: HomeContents, paints: Paints
) -> ET.Element:
    shape = staircase(stair, rise, paints.design.colour)
    (x, z), (low, high) = stair.middle, shape.bounds
    width, height, depth = (high - low).tolist()
    return _added(
        home,
        "pieceOfFurniture",
        id=f"pieceOfFurniture-{len(home)}",
        name="Staircase",
        catalogId="pbrs_farm#staircase",
        creator=AUTHOR,
        icon=contents.icon,
        model=contents.model("staircase", shape),
        x=_cm(x),
        y=_cm(z),
        elevation="0",
        angle=f"{stair.angle_rad:.6f}",
        width=_cm(width),
        depth=_cm(depth),
        height=_cm(height),
        movable="false",
        staircaseCutOutShape="M0,0 v1 h1 v-1 z",
    )


def _add_opening(
    home: ET.Element, plan: Plan, opening: PlanOpening, contents: HomeContents, paints: Paints
) -> ET.Element:
    wall = plan.walls[opening.wall]
    rooms = [plan.rooms[k].type for k in (opening.room, opening.other) if k is not None]
    shape = opening_model(opening, wall.thickness, paints.design, rooms)
    low, high = shape.bounds
    angle = _angle_into(plan, opening, wall)
    # The handles protrude more in front, so the box is off the middle of its frame and wall.
    x, z = wall.at(opening.along)
    ahead = float(low[2] + high[2]) / 2
    x, z = x - ahead * math.sin(angle), z + ahead * math.cos(angle)
    # A door turned about has its hinges on the wall's other end.
    key = (
        f"{opening.kind} {opening.width} {opening.height} {wall.thickness} {opening.hinge_at_start}"
        f" {door_form(paints.design, rooms)}"
    )
    element = _added(
        home,
        "doorOrWindow",
        id=f"doorOrWindow-{len(home)}",
        name=_DOOR_NAMES[opening.kind],
        catalogId=f"pbrs_farm#{opening.kind.value}",
        creator=AUTHOR,
        icon=contents.icon,
        model=contents.model(key, shape),
        x=_cm(x),
        y=_cm(z),
        elevation=_cm(opening.sill),
        angle=f"{angle:.6f}",
        width=_cm(opening.width),
        depth=_cm(float(high[2] - low[2])),
        height=_cm(opening.height),
        movable="false",
        wallThickness="1",
        wallDistance="0",
        boundToWall="true",
    )
    _add_joints(element, shape)
    return element


def _add_joints(element: ET.Element, shape: Shape) -> None:
    """The joints of a model in its own frame, for readers that open its doors and drawers."""
    if shape.joints:
        value = keys.canonical_json(json_from_value(shape.joints))
        _added(element, "property", name=JOINTS_PROPERTY, value=value)


def _angle_into(plan: Plan, opening: PlanOpening, wall: PlanWall) -> float:
    """The angle at which an opening's front looks into its room."""
    x, z = wall.at(opening.along)
    nx, nz = wall.normal
    away = wall.thickness / 2 + 0.05
    if not plan.rooms[opening.room].contains((x + nx * away, z + nz * away)):
        nx, nz = -nx, -nz
    angle = math.atan2(-nx, nz)
    return math.pi if angle < 1e-9 - math.pi else angle


def _add_piece(
    home: ET.Element,
    placed: PlacedPiece,
    catalogue: Catalogue,
    contents: HomeContents,
    height: float,
    level: dict[str, str],
) -> None:
    piece = placed.piece
    shape = catalogue.shape(piece)
    if shape is None:
        return
    is_light = bool(shape.lights) or piece.group.endswith("_lamp")
    element = _added(
        home,
        "light" if is_light else "pieceOfFurniture",
        id=f"pieceOfFurniture-{len(home)}",
        name=piece.name,
        catalogId=piece.id,
        creator=piece.creator or piece.library or AUTHOR,
        license=piece.licence,
        icon=contents.icon,
        model=contents.model(piece.id, shape),
        x=_cm(placed.x),
        y=_cm(placed.z),
        angle=f"{placed.angle_rad:.6f}",
        elevation=_cm(min(placed.elevation, height - placed.height)),
        width=_cm(placed.width),
        depth=_cm(placed.depth),
        height=_cm(placed.height),
        **level,
    )
    _add_joints(element, shape)
    if placed.mirrored:
        element.set("modelMirrored", "true")
    if placed.colour:
        element.set("color", f"FF{placed.colour.lstrip('#')}")
    if is_light:
        element.set("power", f"{_LAMP_POWER:g}")
        _add_light_sources(element, shape)
    if piece.place is Place.CEILING:
        element.set("elevation", _cm(height - placed.height))


def _add_light_sources(element: ET.Element, shape: Shape) -> None:
    """The sources as shares of the model's box: x to the right, y from front to back, z up."""
    low, high = shape.bounds
    size = np.maximum(high - low, 1e-6)
    points = [np.asarray(light.position) for light in shape.lights]
    for point in points or [(low + high) / 2]:
        x, y, z = (point - low) / size
        _added(
            element,
            "lightSource",
            x=f"{x:.4f}",
            y=f"{1 - z:.4f}",
            z=f"{y:.4f}",
            color="00FFE8CC",
            diameter=f"{min(0.065 / size[0], 1.0):.4f}",
        )
    for number, material in enumerate(shape.materials):
        if material.kind is MaterialKind.BULB:
            _added(element, "lightSourceMaterial", name=material_name(shape, number))


def _add_walls(home: ET.Element, plan: Plan, paints: Paints, level: dict[str, str]) -> None:
    walls = tuple(part for wall in plan.walls for part in _straight_parts(wall))
    joints = _joints(walls)
    first = len(home.findall("wall"))
    for number, wall in enumerate(walls):
        (x0, z0), (x1, z1) = wall.start, wall.end
        level_top = wall.height or plan.height
        tops = [height for _, height in wall.tops] or [level_top, level_top]
        element = _added(
            home,
            "wall",
            id=f"wall-{first + number}",
            xStart=_cm(x0),
            yStart=_cm(z0),
            xEnd=_cm(x1),
            yEnd=_cm(z1),
            height=_cm(tops[0]),
            thickness=_cm(wall.thickness),
            pattern="hatchUp",
            **level,
        )
        if tops[1] != tops[0]:
            element.set("heightAtEnd", _cm(tops[1]))
        for attribute, end in (("wallAtStart", 0), ("wallAtEnd", 1)):
            if (number, end) in joints:
                element.set(attribute, f"wall-{first + joints[number, end]}")
        for side, outwards in (("leftSideColor", -1), ("rightSideColor", 1)):
            room = _room_beside(plan, wall, outwards)
            element.set(side, f"FF{_wall_colour(plan, room, paints)}")


def _straight_parts(wall: PlanWall) -> list[PlanWall]:
    """The walls that together are this one, each with a straight upper edge from end to end."""
    if not wall.tops:
        return [wall]
    return [
        replace(wall, start=wall.at(low), end=wall.at(high), tops=((0.0, y0), (high - low, y1)))
        for (low, y0), (high, y1) in pairwise(wall.tops)
        if high - low > _STEP_M
    ]


def _joints(walls: tuple[PlanWall, ...]) -> dict[tuple[int, int], int]:
    """(wall, end) -> the wall it is mitred with: where two ends meet at an angle, alone."""
    ends: dict[tuple[float, float], list[tuple[int, int]]] = {}
    for number, wall in enumerate(walls):
        for end, (x, z) in enumerate((wall.start, wall.end)):
            ends.setdefault((round(x, 4), round(z, 4)), []).append((number, end))
    joints = {}
    for meeting in ends.values():
        # Of three ends at a corner the two of outer walls are mitred.
        pair = [m for m in meeting if walls[m[0]].is_outer] if len(meeting) > 2 else meeting
        if len(pair) == 2 and _turns(walls[pair[0][0]], walls[pair[1][0]]):
            joints[pair[0]], joints[pair[1]] = pair[1][0], pair[0][0]
    return joints


def _turns(wall: PlanWall, other: PlanWall) -> bool:
    """Whether two walls are out of line by more than a degree."""
    (ux, uz), (vx, vz) = wall.normal, other.normal
    return abs(ux * vz - uz * vx) > math.sin(math.radians(1))


def _room_beside(plan: Plan, wall: PlanWall, side: int) -> PlanRoom | None:
    """The room on the left (-1) or right (1) of a wall's middle, looking from start to end."""
    x, z = wall.at(wall.length / 2)
    away = wall.thickness / 2 + 0.05
    nx, nz = wall.normal
    for room in plan.rooms:
        if room.contains((x + side * away * nx, z + side * away * nz)):
            return room
    return None


def _wall_colour(plan: Plan, room: PlanRoom | None, paints: Paints) -> str:
    if room is None:
        return "E4DED2"
    if room.type in _FLOOR_GROUPS:
        return paints.wet_walls
    return paints.walls[plan.rooms.index(room) % len(paints.walls)]


def _drawn_floors(
    catalogue: Catalogue, family: PlanFamily, rng: np.random.Generator
) -> dict[str, Picture]:
    """By use, the picture of every floor of dry rooms and of wet ones."""
    chosen = {}
    for use, group in ((_DRY_FLOOR, family.dry_floor), ("tiles", "tiles")):
        pictures = [p for p in catalogue.pictures if p.group == group]
        if pictures:
            chosen[use] = pictures[int(rng.integers(len(pictures)))]
    return chosen


def _add_rooms(
    home: ET.Element,
    plan: Plan,
    paints: Paints,
    floors: dict[str, Picture],
    contents: HomeContents,
    level: dict[str, str],
    *,
    has_stair: bool,
) -> None:
    first = len(home.findall("room"))
    for number, room in enumerate(plan.rooms):
        is_wet = room.type in _FLOOR_GROUPS
        # Between storeys the stairwell is open: no floor above, no ceiling below.
        is_well = has_stair and room.type is RoomType.STAIRS
        open_at = _OPEN_WELLS.get(level.get("level", "")) if is_well else ""
        has_ceiling = room.type is not RoomType.BALCONY and open_at != "ceiling"
        element = _added(
            home,
            "room",
            id=f"room-{first + number}",
            name=room.name,
            floorVisible=str(open_at != "floor").lower(),
            ceilingVisible=str(has_ceiling).lower(),
            floorColor=f"FF{paints.wet_floor if is_wet else paints.floor}",
            ceilingColor=f"FF{paints.ceiling}",
            areaVisible="true",
            **level,
        )
        picture = floors.get(_FLOOR_GROUPS.get(room.type, _DRY_FLOOR))
        if picture is not None:
            _added(
                element,
                "texture",
                attribute="floorTexture",
                name=picture.texture.name,
                width=_cm(picture.size[0]),
                height=_cm(picture.size[1]),
                image=contents.picture(picture),
            )
        for x, z in room.polygon:
            _added(element, "point", x=_cm(x), y=_cm(z))
