"""The XML tree of a home -> Plan, every fault named with its file and place; no effects."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from xml.etree.ElementTree import Element

from pbrs_farm.core.checked_json import json_from_bytes
from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.frames import M_FROM_CM
from pbrs_farm.core.joints import JOINTS_PROPERTY, Joint
from pbrs_farm.formats.serialise import value_from_json
from pbrs_farm.read.sweethome3d.home_file.home_xml import (
    Baseboard,
    DoorFrame,
    HomePlan,
    HomeRoom,
    HomeWall,
    Paint,
    PlanCamera,
    PlanLevel,
    PlanLight,
    PlanPicture,
    PlanPiece,
    as_points,
)

Rgb = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Attributes:
    """One element's attributes."""

    file: str
    place: str  # what to call the element in a message
    element: Element
    max_extent_m: float  # bound of lengths and coordinates

    def fail(self, message: str) -> BadHouse:
        """The error that names the file and this element, for the caller to raise."""
        return BadHouse(self.file, self.place, message)

    def text(self, name: str, default: str = "") -> str:
        """The attribute, unconverted."""
        return self.element.get(name, default)

    def optional(self, name: str) -> float | None:
        """A finite number, or None if the attribute is missing or empty."""
        text = self.element.get(name)
        if text is None or not text.strip():
            return None
        try:
            value = float(text)
        except ValueError:
            raise self.fail(f"{name}='{text[:40]}' is not a number") from None
        if not math.isfinite(value):
            raise self.fail(f"{name}='{text[:40]}' is not a finite number")
        return value

    def number(self, name: str, default: float | None = None) -> float:
        """A finite number; without a default the attribute must be there."""
        value = self.optional(name)
        if value is not None:
            return value
        if default is None:
            raise self.fail(f"attribute {name} is missing")
        return default

    def within(self, name: str, default: float, low: float, high: float) -> float:
        """A finite number, drawn into low..high."""
        return min(max(self.number(name, default), low), high)

    def metres(self, name: str, default_m: float | None = None) -> float:
        """A length or coordinate given in centimetres, in metres.

        default: in metres, None = required. Raises BadHouse, naming the element, for an invalid number and
        for one beyond read.max_extent_m.
        """
        value = self.optional_metres(name)
        if value is not None:
            return value
        if default_m is None:
            raise self.fail(f"attribute {name} is missing")
        return default_m

    def optional_metres(self, name: str) -> float | None:
        """As metres, or None if the attribute is missing."""
        value = self.optional(name)
        if value is None:
            return None
        value *= M_FROM_CM
        if abs(value) > self.max_extent_m:
            limit = f"{self.max_extent_m:.0f} m (recipe field read.max_extent_m)"
            raise self.fail(f"{name} is {value:.0f} m, farther than {limit}")
        return value

    def length(self, name: str, default_m: float | None = None) -> float:
        """As metres, and not negative."""
        value = self.metres(name, default_m)
        if value < 0:
            raise self.fail(f"{name} is negative")
        return value

    def flag(self, name: str, default: bool) -> bool:
        """true or false."""
        text = self.element.get(name)
        return default if text is None else text.strip().lower() == "true"

    def numbers(self, name: str, count: int) -> tuple[float, ...] | None:
        """count numbers of at most 1e6 separated by spaces, or None if missing."""
        text = self.element.get(name)
        if text is None:
            return None
        try:
            values = tuple(float(w) for w in text.split())
        except ValueError:
            values = ()
        # NaN fails the comparison, too.
        if len(values) != count or not all(abs(v) <= 1e6 for v in values):
            raise self.fail(f"{name} must be {count} finite numbers")
        return values

    def argb(self, name: str) -> tuple[int, Rgb] | None:
        """Alpha 0..255 and the sRGB-encoded colour in 0..1 of a hex AARRGGBB, or None."""
        text = self.element.get(name)
        if text is None or not text.strip():
            return None
        try:
            value = int(text, 16)
        except ValueError:
            raise self.fail(f"{name}='{text[:40]}' is not a colour AARRGGBB") from None
        if not 0 <= value <= 0xFFFFFFFF:
            raise self.fail(f"{name}='{text[:40]}' is not a colour AARRGGBB")
        # The program keeps colours as Java does: alpha, red, green, blue from the top byte.
        r, g, b = ((value >> shift & 255) / 255 for shift in (16, 8, 0))
        return value >> 24, (r, g, b)


# Of the file, hidden levels included; home.py and room_floors.py say how many are read.
MAX_PIECE_ELEMENTS = 20_000
MAX_WALL_ELEMENTS = 10_000
MAX_ROOM_ELEMENTS = 5_000
MAX_ROOM_POINTS = 100_000
_PIECES = frozenset({"pieceOfFurniture", "doorOrWindow", "light", "shelfUnit"})
FALLBACK_HEIGHT_M = 2.5  # of walls and levels without a height


def parse_plan(root: Element, file: str, max_extent_m: float) -> HomePlan:
    """All used elements of a home, metres and radians; BadHouse, also for coordinates over max_extent_m."""
    home = Attributes(file, "home", root, max_extent_m)
    # Bound the work before any element is read.
    for tag, most in (
        ("wall", MAX_WALL_ELEMENTS),
        ("room", MAX_ROOM_ELEMENTS),
        ("room/point", MAX_ROOM_POINTS),
    ):
        if len(root.findall(tag)) > most:
            raise BadHouse(file, "", f"more than {most} <{tag}> elements")
    wall_height = home.length("wallHeight", FALLBACK_HEIGHT_M)

    def open_(element: Element, place: str) -> Attributes:
        return Attributes(file, place, element, max_extent_m)

    # Read each kind in the file's order, since ids and messages count by it.
    walls = tuple(
        _parse_wall(open_(e, f"wall {e.get('id', f'#{k}')}"), k, wall_height)
        for k, e in enumerate(root.findall("wall"))
    )
    rooms = tuple(
        _parse_room(open_(e, f"room #{k} '{e.get('name', '')}'"))
        for k, e in enumerate(root.findall("room"))
    )
    pieces = tuple(
        parse_piece(open_(e, f"{e.tag} #{k} '{e.get('name', '')}'"), level, group)
        for k, (e, level, group) in enumerate(_furniture_elements(root, file))
        if e.get("visible", "true") != "false"
    )
    cameras = tuple(
        _parse_camera(open_(e, f"camera '{e.get('name', '')}'"), k)
        for k, e in enumerate(
            e for e in root if e.get("attribute") == "storedCamera" and "amera" in e.tag
        )
    )
    return HomePlan(
        name=root.get("name", ""),
        version=root.get("version", ""),
        wall_height=wall_height,
        properties={e.get("name", ""): e.get("value", "") for e in root.findall("property")},
        levels=_parse_levels([open_(e, f"level {e.get('id', '')}") for e in root.findall("level")]),
        walls=walls,
        rooms=rooms,
        pieces=pieces,
        cameras=cameras,
    )


def _furniture_elements(root: Element, file: str) -> Iterator[tuple[Element, str, str]]:
    # Pieces in document order with level and group; a group's pieces have absolute coordinates.
    n = 0
    stack = [(e, "", "") for e in reversed(list(root))]
    while stack:
        element, level, group = stack.pop()
        level = element.get("level", level)
        if element.tag == "furnitureGroup":
            if element.get("visible", "true") != "false":
                inner = element.get("name", group)
                stack += [(e, level, inner) for e in reversed(list(element))]
        elif element.tag in _PIECES:
            n += 1
            if n > MAX_PIECE_ELEMENTS:
                raise BadHouse(file, "", f"more than {MAX_PIECE_ELEMENTS} pieces of furniture")
            yield element, level, group


def _parse_levels(elements: list[Attributes]) -> tuple[PlanLevel, ...]:
    # Sort by height, then by the order that the program keeps for levels of one height.
    rows = [
        (a.metres("elevation", 0.0), a.number("elevationIndex", 0.0), k)
        for k, a in enumerate(elements)
    ]
    lowest = min((f[0] for f in rows), default=0.0)
    levels = []
    for index, (elevation, _, k) in enumerate(sorted(rows)):
        a = elements[k]
        thickness = a.length("floorThickness", 0.12)
        levels.append(
            PlanLevel(
                id=a.text("id"),
                name=a.text("name"),
                elevation=elevation,
                floor_thickness=thickness,
                height=a.length("height", FALLBACK_HEIGHT_M),
                is_visible=a.flag("visible", True) and a.flag("viewable", True),
                index=index,
                reach_down=thickness if elevation > lowest else 0.0,
            )
        )
    return tuple(levels)


def _parse_wall(a: Attributes, number: int, wall_height: float) -> HomeWall:
    boards = [b for e in a.element.findall("baseboard") if (b := baseboard_of(a, e)) is not None]
    return HomeWall(
        id=a.text("id", f"#{number}"),
        level=a.text("level"),
        start=(a.metres("xStart"), a.metres("yStart")),
        end=(a.metres("xEnd"), a.metres("yEnd")),
        thickness=a.length("thickness", 0.1),
        height=a.length("height", wall_height),
        height_end=a.optional_metres("heightAtEnd"),
        arc=a.number("arcExtent", 0.0),
        at_start=a.text("wallAtStart"),
        at_end=a.text("wallAtEnd"),
        left=wall_paint(a, "left"),
        right=wall_paint(a, "right"),
        top=wall_paint(a, "top"),
        baseboards=tuple(boards),
    )


def _parse_room(a: Attributes) -> HomeRoom:
    points = [
        Attributes(a.file, f"{a.place} point #{k}", e, a.max_extent_m)
        for k, e in enumerate(a.element.findall("point"))
    ]
    return HomeRoom(
        place=a.place,
        level=a.text("level"),
        name=a.text("name"),
        points=as_points([(p.metres("x"), p.metres("y")) for p in points]),
        has_floor=a.flag("floorVisible", True),
        has_ceiling=a.flag("ceilingVisible", True),
        floor=room_paint(a, "floor"),
        ceiling=room_paint(a, "ceiling"),
        is_ceiling_flat=a.flag("ceilingFlat", False),
    )


def _parse_camera(a: Attributes, number: int) -> PlanCamera:
    return PlanCamera(
        name=a.text("name", f"camera {number}"),
        at=(a.metres("x"), a.metres("y"), a.metres("z")),
        yaw=a.number("yaw", 0.0),
        pitch=a.number("pitch", 0.0),
        hfov=min(max(a.number("fieldOfView", 1.1), 0.05), 3.0),
    )


FULL_CUT_OUT = "M0,0 v1 h1 v-1 z"  # the unit square: the whole opening


def parse_piece(a: Attributes, level: str, group: str = "") -> PlanPiece:
    """A piece by its XML element, of a level (its own or its group's) and a group or ""; BadHouse."""
    element = a.element
    return PlanPiece(
        tag=element.tag,
        place=a.place,
        level=level,
        catalogue_id=a.text("catalogId"),
        name=a.text("name"),
        model=a.text("model"),
        centre=(a.metres("x"), a.metres("y")),
        elevation=a.metres("elevation", 0.0),
        angle=a.number("angle", 0.0),
        pitch=a.number("pitch", 0.0),
        roll=a.number("roll", 0.0),
        size=(a.length("width"), a.length("depth"), a.length("height")),
        height_in_plan=a.optional_metres("heightInPlan"),
        is_mirrored=a.flag("modelMirrored", False),
        rotation=a.numbers("modelRotation", 9),
        paint=piece_paint(a),
        materials=_materials(a),
        transformations=_transformations(a),
        frame=_parse_door_frame(a) if _is_opening(a) else None,
        lights=_parse_lights(a) if element.tag == "light" else (),
        light_materials=tuple(e.get("name", "") for e in element.findall("lightSourceMaterial")),
        power=a.within("power", 0.5, 0.0, 10.0) if element.tag == "light" else 0.0,
        staircase_cut_out=a.text("staircaseCutOutShape"),
        group=group,
        joints=_joints(a),
    )


def _is_opening(a: Attributes) -> bool:
    return a.element.tag == "doorOrWindow" or a.flag("doorOrWindow", False)


def _materials(a: Attributes) -> tuple[tuple[str, Paint], ...]:
    materials = []
    for element in a.element.findall("material"):
        name = element.get("name", "")
        inner = Attributes(a.file, f"{a.place} material '{name}'", element, a.max_extent_m)
        materials.append((name, piece_paint(inner)))
    return tuple(materials)


def _transformations(a: Attributes) -> tuple[tuple[str, tuple[float, ...]], ...]:
    transformations = []
    for element in a.element.findall("transformation"):
        name = element.get("name", "")
        inner = Attributes(a.file, f"{a.place} transformation '{name}'", element, a.max_extent_m)
        matrix = inner.numbers("matrix", 12)
        if matrix is not None:
            transformations.append((name, matrix))
    return tuple(transformations)


def _joints(a: Attributes) -> tuple[Joint, ...]:
    for element in a.element.findall("property"):
        if element.get("name") == JOINTS_PROPERTY:
            place = f"{a.file}, {a.place}, {JOINTS_PROPERTY}"
            data = json_from_bytes(element.get("value", "").encode("utf-8", "replace"), place)
            joints = value_from_json(tuple[Joint, ...], data, place)
            for joint in joints:
                if not _is_unit(joint.axis) or joint.lower > joint.upper:
                    raise BadHouse(place, joint.part[:60], "its axis or its limits are none")
            return joints
    return ()


def _is_unit(axis: tuple[float, float, float]) -> bool:
    return abs(sum(v * v for v in axis) - 1.0) < 1e-6


def _parse_door_frame(a: Attributes) -> DoorFrame:
    return DoorFrame(
        cut_out=a.text("cutOutShape", FULL_CUT_OUT),
        wall_width=a.within("wallWidth", 1.0, -1.0, 2.0),
        wall_left=a.within("wallLeft", 0.0, -1.0, 2.0),
        wall_height=a.within("wallHeight", 1.0, -1.0, 2.0),
        wall_top=a.within("wallTop", 0.0, -1.0, 2.0),
        cuts_both_sides=a.flag("wallCutOutOnBothSides", False),
    )


def _fraction(a: Attributes, name: str) -> float:
    return a.within(name, 0.5, -10.0, 10.0)


def _parse_lights(a: Attributes) -> tuple[PlanLight, ...]:
    lights = []
    for k, element in enumerate(a.element.findall("lightSource")):
        inner = Attributes(a.file, f"{a.place} lightSource #{k}", element, a.max_extent_m)
        colour = inner.argb("color")
        lights.append(
            PlanLight(
                (_fraction(inner, "x"), _fraction(inner, "y"), _fraction(inner, "z")),
                (1.0, 1.0, 1.0) if colour is None else colour[1],
                None if inner.optional("diameter") is None else inner.within("diameter", 0, 0, 2),
            )
        )
    return tuple(lights)


def wall_paint(a: Attributes, side: str) -> Paint:
    """The paint of a wall's "left" or "right" side, or of its "top"."""
    if side == "top":
        return _paint_of(a, "topColor", None, None)
    return _paint_of(a, f"{side}SideColor", f"{side}SideTexture", f"{side}SideShininess")


def room_paint(a: Attributes, part: str) -> Paint:
    """The paint of a room's "floor" or "ceiling"."""
    return _paint_of(a, f"{part}Color", f"{part}Texture", f"{part}Shininess")


def piece_paint(a: Attributes) -> Paint:
    """The paint that overrides a whole piece, or one of its materials."""
    paint = _paint_of(a, "color", "", "shininess")
    alpha = a.argb("color")
    # A material of alpha 0 is how the program hides a part.
    is_hidden = a.element.tag == "material" and alpha is not None and alpha[0] == 0
    return Paint(paint.colour, paint.picture, paint.shininess, is_hidden)


def _paint_of(a: Attributes, colour: str, texture: str | None, shininess: str | None) -> Paint:
    argb = a.argb(colour)
    picture = None
    if texture is not None:
        # A texture of a wall or room names its side, a piece's need not; the last one counts.
        for element in a.element.findall("texture"):
            if not texture or element.get("attribute") == texture:
                picture = picture_of(a, element)
    shine = a.optional(shininess) if shininess else None
    return Paint(None if argb is None else argb[1], picture, shine)


def picture_of(parent: Attributes, element: Element) -> PlanPicture:
    """A <texture> element; sizes that make no sense count as one metre."""
    name = element.get("name", "")
    a = Attributes(parent.file, f"{parent.place} texture '{name}'", element, parent.max_extent_m)
    width, height = a.metres("width", 1.0), a.metres("height", 1.0)
    scale = a.number("scale", 1.0)
    return PlanPicture(
        image=a.text("image"),
        name=name,
        width=width if width > 1e-4 else 1.0,
        height=height if height > 1e-4 else 1.0,
        offset=(a.number("xOffset", 0.0) % 1.0, a.number("yOffset", 0.0) % 1.0),
        angle=a.number("angle", 0.0),
        scale=scale if scale > 1e-4 else 1.0,
        is_fitting=a.flag("fittingArea", False),
    )


def baseboard_of(wall: Attributes, element: Element) -> Baseboard | None:
    """A <baseboard> of a wall, or None if it has no size."""
    side = element.get("attribute", "")
    a = Attributes(wall.file, f"{wall.place} {side}", element, wall.max_extent_m)
    thickness, height = a.length("thickness", 0.0), a.length("height", 0.0)
    if thickness <= 0 or height <= 0:
        return None
    return Baseboard(
        is_left=side.startswith("left"),
        thickness=thickness,
        height=height,
        paint=_paint_of(a, "color", "", None),
    )
