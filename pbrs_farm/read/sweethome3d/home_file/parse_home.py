"""The XML tree of a home -> Plan; no effects."""

from __future__ import annotations

from collections.abc import Iterator
from xml.etree.ElementTree import Element

from pbrs_farm.core.errors import BadHouse
from pbrs_farm.read.sweethome3d.home_file.home_xml import (
    HomePlan,
    HomeRoom,
    HomeWall,
    PlanCamera,
    PlanLevel,
    as_points,
)
from pbrs_farm.read.sweethome3d.home_file.parse_furniture import parse_piece
from pbrs_farm.read.sweethome3d.home_file.parse_paints import baseboard_of, room_paint, wall_paint
from pbrs_farm.read.sweethome3d.home_file.xml_attributes import Attributes

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
