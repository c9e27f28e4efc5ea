"""Rooms -> Room nouns, floors and ceilings; later rooms win where two overlap; no effects."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import shapely

from pbrs_farm.core.arrays import Points2
from pbrs_farm.core.house import Item, ItemKind, Room, Surface
from pbrs_farm.geometry.doorways import door_line, ground_between
from pbrs_farm.geometry.plan_surfaces import counter_clockwise, horizontal, polygons_in
from pbrs_farm.read.common.structure_items import structure_item
from pbrs_farm.read.sweethome3d.ceiling_heights import CeilingHeights
from pbrs_farm.read.sweethome3d.home_file.home_xml import (
    HomePlan,
    HomeRoom,
    Paint,
    PlanLevel,
    level_of,
)
from pbrs_farm.read.sweethome3d.home_materials import HomeMaterials
from pbrs_farm.read.sweethome3d.wall_outlines import Outline
from pbrs_farm.read.sweethome3d.wall_solids import picture_uvs

MIN_AREA_M2 = 0.01  # smaller rooms are left out
LEAST_ROOM_M2 = 1.0  # a smaller area between walls is a shaft
LEAST_WALL_M = 1.8  # lower walls enclose no room
DOOR_SILL_M = 0.3  # what begins higher is a window
SLIVER_M2 = 1e-4  # smaller pieces come of rounding
MAX_CORNERS = 300  # an outline of more corners is simplified: cost grows with their square


@dataclass(frozen=True, slots=True, eq=False)
class ReadRoom:
    """A room of a visible level with its outline as a simple polygon."""

    id: str
    plan: HomeRoom
    level: PlanLevel
    level_id: str
    outline: shapely.Polygon


def read_rooms(
    plan: HomePlan, materials: HomeMaterials, house_level: dict[str, str]
) -> list[ReadRoom]:
    """The rooms of visible levels, numbered within their level in the file's order.

    house_level: the home's level id -> the house's. An outline that crosses itself is a note, its largest
    part the room; one without area is left out with a note.
    """
    rooms: list[ReadRoom] = []
    counts: dict[str, int] = {}
    for room in plan.rooms:
        level = level_of(plan, room.level)
        if not level.is_visible:
            continue
        outline = _simple(room, materials)
        if outline is None:
            continue
        level_id = house_level[level.id]
        number = counts.get(level_id, 0)
        counts[level_id] = number + 1
        rooms.append(ReadRoom(f"{level_id}_{number}", room, level, level_id, outline))
    return rooms


def rooms_between_walls(plan: HomePlan, outlines: dict[str, Outline]) -> tuple[HomeRoom, ...]:
    """Rooms enclosed by walls of visible levels, up to small gaps and doorways, if no room is drawn."""
    home_rooms: list[HomeRoom] = []
    for level_id in dict.fromkeys(wall.level for wall in plan.walls):
        feet = [
            shapely.make_valid(shapely.Polygon(outlines[wall.id].polygon))
            for wall in plan.walls
            if wall.level == level_id
            and wall.id in outlines
            and max(wall.height, wall.height_end or 0.0) >= LEAST_WALL_M
        ]
        home_rooms += [
            HomeRoom(
                place=f"walls of level {level_id or '0'}",
                level=level_id,
                name="",
                points=_ring(p.exterior),
                has_floor=True,
                has_ceiling=True,
                floor=Paint(),
                ceiling=Paint(),
                is_ceiling_flat=False,
            )
            for p in ground_between(feet, _door_lines(plan, level_id))
            if p.area >= LEAST_ROOM_M2
        ]
    return tuple(home_rooms)


def _door_lines(plan: HomePlan, level_id: str) -> list[shapely.LineString]:
    """The lines across a level that its doors close, and windows down to the floor."""
    return [
        door_line(np.array(p.centre), np.array([np.cos(p.angle), np.sin(p.angle)]), p.size[0])
        for p in plan.pieces
        if p.level == level_id and p.frame is not None and p.elevation < DOOR_SILL_M
    ]


def _simple(room: HomeRoom, materials: HomeMaterials) -> shapely.Polygon | None:
    if len(room.points) < 3:
        materials.notes.add("degenerate-room", room.place, "fewer than three points: left out")
        return None
    polygon = shapely.Polygon(_coarse(room, materials))
    if not polygon.is_valid:
        parts = polygons_in(shapely.make_valid(polygon), SLIVER_M2)
        materials.notes.add(
            "room-crosses-itself", room.place, "its outline crosses itself: largest part kept"
        )
        polygon = max(parts, key=lambda p: p.area) if parts else shapely.Polygon()
        polygon = shapely.Polygon(polygon.exterior) if not polygon.is_empty else polygon
    if polygon.area < MIN_AREA_M2:
        materials.notes.add("degenerate-room", room.place, f"{polygon.area:.4f} m2: left out")
        return None
    return polygon


def _coarse(room: HomeRoom, materials: HomeMaterials) -> Points2:
    """The room's points; of more than MAX_CORNERS those that say most, with a note."""
    points = np.asarray(room.points, np.float64)
    if len(points) <= MAX_CORNERS:
        return points
    # Leave out what moves the outline by less than a step that grows from a millimetre.
    line, step = shapely.LineString(points), 0.001
    while len(points) > MAX_CORNERS:
        points = shapely.get_coordinates(shapely.simplify(line, step, preserve_topology=False))
        step *= 2
    text = f"{len(room.points)} corners, simplified to {len(points)}"
    materials.notes.add("room-simplified", room.place, text)
    return points


def room_nouns(rooms: list[ReadRoom], ceilings: CeilingHeights) -> tuple[Room, ...]:
    """The Room of each; its polygon without what later rooms take, if that leaves one piece."""
    nouns = []
    for k, room in enumerate(rooms):
        taken = [r.outline for r in _later(rooms, k)]
        rest = polygons_in(shapely.difference(room.outline, shapely.union_all(taken)), SLIVER_M2)
        outline = rest[0] if len(rest) == 1 and not rest[0].interiors else room.outline
        polygon = counter_clockwise(_ring(outline.exterior))
        height = ceilings.highest(room.level, polygon, is_flat=room.plan.is_ceiling_flat)
        nouns.append(
            Room(
                id=room.id,
                name=room.plan.name,
                level_id=room.level_id,
                polygon=polygon,
                floor_y=room.level.elevation,
                ceiling_y=room.level.elevation + height,
                types=(room.plan.name,) if room.plan.name else (),
                has_floor=room.plan.has_floor,
                has_ceiling=room.plan.has_ceiling,
            )
        )
    return tuple(nouns)


def _later(rooms: list[ReadRoom], k: int) -> list[ReadRoom]:
    # The rooms of the same level that come after the k-th and touch it.
    after = [r for r in rooms[k + 1 :] if r.level_id == rooms[k].level_id]
    touch = shapely.intersects(rooms[k].outline, [r.outline for r in after])
    return [r for r, touches in zip(after, touch, strict=True) if touches]


def plane_items(
    rooms: list[ReadRoom],
    ceilings: CeilingHeights,
    materials: HomeMaterials,
    floor_cuts: dict[str, shapely.Geometry],
    ceiling_cuts: dict[str, shapely.Geometry],
) -> list[Item]:
    """Floor and ceiling of each room as an item, horizontal or, below a roof, sloped.

    Where rooms overlap, the floor belongs to the later one. floor_cuts, ceiling_cuts: areas of staircases
    by level id.
    """
    items = []
    for k, room in enumerate(rooms):
        later = _later(rooms, k)
        if room.plan.has_floor:
            floors = [r.outline for r in later if r.plan.has_floor]
            items += _floor_items(room, _left_of(room, floors, floor_cuts), materials)
        if room.plan.has_ceiling:
            covers = [r.outline for r in later if r.plan.has_ceiling]
            items += _ceiling(room, _left_of(room, covers, ceiling_cuts), ceilings, materials)
    return items


def _left_of(
    room: ReadRoom, later: list[shapely.Polygon], cuts: dict[str, shapely.Geometry]
) -> list[shapely.Polygon]:
    # The room's outline minus later rooms and the level's staircases.
    taken = [*later, cuts.get(room.level_id, shapely.Polygon())]
    return polygons_in(shapely.difference(room.outline, shapely.union_all(taken)), SLIVER_M2)


def _floor_items(
    room: ReadRoom, parts: list[shapely.Polygon], materials: HomeMaterials
) -> list[Item]:
    if not parts:
        return []
    material = materials.painted(room.plan.floor, "floor", f"{room.plan.place} floor")
    rings = [_rings_of_polygon(p) for p in parts]
    surface = horizontal("floor", rings, room.level.elevation, material, up=True)
    surface = _textured(surface, room.plan.floor)
    return [_item(room, ItemKind.FLOOR, surface)]


def _ceiling(
    room: ReadRoom, parts: list[shapely.Polygon], ceilings: CeilingHeights, materials: HomeMaterials
) -> list[Item]:
    if not parts:
        return []
    material = materials.painted(room.plan.ceiling, "ceiling", f"{room.plan.place} ceiling")
    surface = ceilings.surface(
        room.level,
        [_rings_of_polygon(p) for p in parts],
        material,
        is_flat=room.plan.is_ceiling_flat,
    )
    return [_item(room, ItemKind.CEILING, _textured(surface, room.plan.ceiling))]


def _item(room: ReadRoom, kind: ItemKind, surface: Surface) -> Item:
    return structure_item(
        f"{kind}_{room.id}",
        kind,
        [surface],
        name=f"{kind.capitalize()} of {room.plan.name or 'room ' + room.id}",
        level_id=room.level_id,
        source_class=kind.value,
        room_id=room.id,
    )


def _textured(surface: Surface, paint: Paint) -> Surface:
    if paint.picture is None or surface.uvs is None:
        return surface
    uvs = picture_uvs(surface.uvs.astype(np.float64), paint.picture).astype(np.float32)
    return replace(surface, uvs=uvs)


def _rings_of_polygon(polygon: shapely.Polygon) -> list[Points2]:
    return [_ring(polygon.exterior), *(_ring(r) for r in polygon.interiors)]


def _ring(ring: shapely.LinearRing) -> Points2:
    return np.asarray(shapely.get_coordinates(ring)[:-1], np.float64)
