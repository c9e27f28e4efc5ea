"""A furnished scene as glTF 2.0 (.glb, .gltf) -> House.

Items are nodes whose extras, mapping row or name tell their class. Effect: read_gltf_file reads
the file and what may lie beside it: `<stem>.classes.json` and `<stem>.rooms.json`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Final

import numpy as np
import shapely
from pydantic import BaseModel, Field

from pbrs_farm.core import keys
from pbrs_farm.core.arrays import F64
from pbrs_farm.core.checked_json import Finite, checked, exactly, json_from_bytes
from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.house import House, Item, ItemKind, Level, Room, Source, Surface
from pbrs_farm.core.recipe import ReadFields
from pbrs_farm.formats.glb import Gltf, entry
from pbrs_farm.read.common.notes import Notes
from pbrs_farm.read.common.room_floors import (
    MAX_ROOMS,
    ceiling_height,
    check_number,
    check_rooms,
    coverage,
    floor_height,
    floor_polygons,
    polygon_of,
)
from pbrs_farm.read.common.source_files import RootFolder
from pbrs_farm.read.gltf.document import UNDERSTOOD, Fetch, gltf_document, has_surface, object_at
from pbrs_farm.read.gltf.materials import SceneMaterials
from pbrs_farm.read.gltf.node_classes import Mapping, mapping_from_json
from pbrs_farm.read.gltf.scene_items import items_of_scene
from pbrs_farm.read.suncg.wall_holes import openings
from pbrs_farm.regular_files import MAX_SCENE_BYTES

# Rooms and levels of a glTF scene: from the user's polygon file, else from its floors.
# No effects. The file is JSON: {"rooms": [{"polygon": [[x, z], ...], "floor_y": 0.0, "ceiling_y":
# 2.5, "name": "Kitchen"}]}, metres, plan coordinates of the scene's own axes.


MIN_ROOM_M2: Final = 1.0  # smaller pieces of floor are gaps under doors and walls
MIN_ROOM_WIDTH_M: Final = 0.5
_STOREY_M: Final = 2.5  # height of a room that nothing tells the height of
_SAME_LEVEL_M: Final = 0.5  # floors nearer in height than this are one level
_SLACK_M: Final = 0.3  # a thing may stand so far outside its room's polygon or height
_EDGE_M: Final = 0.1  # walls may stand so far beside the floor
# A ceiling that covers less of a room than this share is the next room's.
_NEXT_ROOM: Final = 0.05


def rooms_from_json(data: bytes, file: str, items: Sequence[Item]) -> list[Room]:
    """The rooms of a polygon file; heights it leaves out are taken from floors and ceilings.

    Raises BadHouse naming the room that is wrong.
    """
    return told_rooms(json_from_bytes(data, file), file, items)


def told_rooms(value: Any, file: str, items: Sequence[Item]) -> list[Room]:
    """The rooms of the JSON value of a polygon file, or of a scene's extras; as rooms_from_json."""
    hint = '{"rooms": [{"polygon": [[x, z], ...]}, ...]}'
    rows = checked(_RoomFile, value, file, error=BadHouse, hint=hint).rooms
    check_number(len(rows), file)
    return [_room(row, file, f"rooms[{i}]", items) for i, row in enumerate(rows)]


_Metres = Annotated[Finite, Field(gt=-1e6, lt=1e6)]


class _GivenRoom(BaseModel):
    polygon: list[Annotated[tuple[_Metres, _Metres], exactly(2)]] = Field(
        min_length=3, max_length=10_000, fail_fast=True
    )
    floor_y: _Metres | None = None
    ceiling_y: _Metres | None = None
    name: Any = ""
    types: Any = None


class _RoomFile(BaseModel):
    rooms: list[_GivenRoom] = Field(min_length=1, fail_fast=True)


def _room(row: _GivenRoom, file: str, place: str, items: Sequence[Item]) -> Room:
    area = shapely.Polygon(row.polygon)
    polygon = polygon_of(area) if area.is_valid else None
    if polygon is None:
        raise BadHouse(file, f"{place}.polygon", "crosses itself or has no area")
    given = {"floor_y": row.floor_y, "ceiling_y": row.ceiling_y}
    words = tuple(str(t)[:60] for t in row.types) if isinstance(row.types, list) else ()
    return _with_heights(polygon, str(row.name)[:60], words, given, items)


def rooms_from_floors(items: Sequence[Item]) -> list[Room]:
    """A room for every piece of floor that walls part from the others."""
    walls = _surfaces(items, ItemKind.WALL)
    found: list[Room] = []
    for item in items:
        height = floor_height(item.surfaces) if item.kind is ItemKind.FLOOR else None
        if height is None or len(found) > MAX_ROOMS:  # refused by room_bounds
            continue
        # Let walls part the floor where they stand 1 m above it.
        standing = [w for w in walls if w.positions[:, 1].max() > height + 1.0]
        standing = [w for w in standing if w.positions[:, 1].min() < height + 1.0]
        low, high = item.bounds[:, [0, 2]]
        standing = _within(standing, low - _EDGE_M, high + _EDGE_M)
        pieces = floor_polygons(
            item.surfaces, standing, min_area_m2=MIN_ROOM_M2, min_width_m=MIN_ROOM_WIDTH_M
        )
        given = {"floor_y": height, "ceiling_y": None}
        found += [_with_heights(p, "", (), given, items) for p in pieces]
    return found


def _with_heights(
    polygon: F64,
    name: str,
    types: tuple[str, ...],
    given: dict[str, float | None],
    items: Sequence[Item],
) -> Room:
    """The room with heights of the floor and ceiling that lie over its polygon."""
    # Take the floor's height as given, as the floor below has it, or 0.
    floors = _over(items, ItemKind.FLOOR, polygon)
    floor_y = given["floor_y"]
    low = floor_height(floors) if floor_y is None else floor_y
    low = 0.0 if low is None else low
    # Leave out ceilings that belong to the next room.
    above = [s for s in _over(items, ItemKind.CEILING, polygon) if s.positions[:, 1].min() > low]
    shares = [coverage(s, polygon) for s in above]
    above = [s for s, share in zip(above, shares, strict=True) if share > _NEXT_ROOM]
    ceiling = ceiling_height(above)
    if ceiling is None and above:
        ceiling = min(float(s.positions[:, 1].min()) for s in above)  # planar, looking up
    # Without a ceiling the room is as high as its walls, or a storey.
    walls = [float(s.positions[:, 1].max()) for s in _over(items, ItemKind.WALL, polygon, _EDGE_M)]
    nominal = max((y for y in walls if low + 1.0 < y < low + 10.0), default=low + _STOREY_M)
    high = given["ceiling_y"] or ceiling or nominal
    return Room(
        id="",
        name=name,
        level_id="",
        polygon=polygon,
        floor_y=low,
        ceiling_y=high if high > low + 0.5 else low + _STOREY_M,
        types=types,
        has_floor=bool(floors),
        has_ceiling=sum(shares) > 0.5,
    )


def _surfaces(items: Sequence[Item], kind: ItemKind) -> list[Surface]:
    return [s for item in items if item.kind is kind for s in item.surfaces]


def _over(
    items: Sequence[Item], kind: ItemKind, polygon: F64, slack_m: float = 0.0
) -> list[Surface]:
    """The surfaces of a kind whose bounds meet the polygon's in plan."""
    low, high = polygon.min(0) - slack_m, polygon.max(0) + slack_m
    return _within(_surfaces(items, kind), low, high)


def _within(surfaces: Sequence[Surface], low: F64, high: F64) -> list[Surface]:
    """The surfaces whose plan bounds meet low..high."""
    plans = [(s, s.positions[:, [0, 2]]) for s in surfaces]
    return [s for s, p in plans if (p.max(0) > low).all() and (p.min(0) < high).all()]


def levels_of(rooms: Sequence[Room]) -> tuple[tuple[Level, ...], tuple[Room, ...]]:
    """(levels by floor height, from below; the rooms with their ids `<level>_<room>`)."""
    # Floors within half a metre are one level.
    heights: list[float] = []
    for y in sorted(r.floor_y for r in rooms):
        if not heights or y > heights[-1] + _SAME_LEVEL_M:
            heights.append(y)
    # Number the rooms of each level from 0.
    numbered: list[Room] = []
    count = [0] * len(heights)
    for room in rooms:
        level = int(np.searchsorted(heights, room.floor_y, "right")) - 1
        room_id = f"{level}_{count[level]}"
        count[level] += 1
        name = room.name or f"Room {room_id}"
        numbered.append(replace(room, id=room_id, name=name, level_id=str(level)))
    # A level is as high as its rooms are in the middle.
    levels = []
    for k, height in enumerate(heights):
        here = [r.ceiling_y - r.floor_y for r in numbered if r.level_id == str(k)]
        levels.append(Level(str(k), f"Level {k}", height, float(np.median(here))))
    return tuple(levels), tuple(numbered)


def level_of(levels: Sequence[Level], y: float) -> str:
    """The highest level at or below a height, half a metre of slack; else the lowest."""
    below = [x.id for x in levels if x.elevation <= y + _SAME_LEVEL_M]
    return below[-1] if below else levels[0].id


def room_at(rooms: Sequence[Room], point: F64) -> str | None:
    """The room whose polygon and height hold a point (3,) of the world, or None.

    A point in a wall (of a door, a window) belongs to the nearest room on the other side of it.
    """
    x, y, z = point
    here = [r for r in rooms if r.floor_y - _SLACK_M <= y <= r.ceiling_y + _SLACK_M]
    if not here:
        return None
    place: Any = shapely.Point(x, z)
    # Measure to each room's polygon: 0 inside it.
    distance = [float(shapely.Polygon(r.polygon).distance(place)) for r in here]
    nearest = int(np.argmin(distance))
    return here[nearest].id if distance[nearest] <= _SLACK_M else None


# Notes of what a scene holds and no reader here looks at.


UNREAD: Final = "unread-part"

# Extensions without which nothing that is seen is missing: what a reader without them shows is
# there as well (compressed meshes, pictures), or they say nothing of the picture.
_UNSEEN: Final = frozenset({
    "KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_texture_basisu",
    "EXT_texture_avif", "MSFT_texture_dds", "KHR_materials_variants", "KHR_xmp", "KHR_xmp_json_ld",
    "KHR_animation_pointer", "FB_geometry_metadata",
})  # fmt: skip

_Row = dict[str, Any]
_PRIMITIVES: Final[dict[str, Callable[[_Row], bool]]] = {
    "points or lines": lambda row: not has_surface(row),
    "vertex colours": lambda row: "COLOR_0" in object_at(row, "attributes"),
    "morph targets": lambda row: bool(row.get("targets")),
}


def note_unread(gltf: Gltf, notes: Notes) -> None:
    """A note for every extension that is not read, and for what meshes and nodes have of such."""
    used = gltf.document.get("extensionsUsed")
    for name in used if isinstance(used, list) else []:
        if name not in UNDERSTOOD and name not in _UNSEEN:
            notes.add(UNREAD, "extensionsUsed", f"{name} is not read: what it adds is not shown")
    primitives = [_rows(mesh.get("primitives")) for mesh in _rows(gltf.document.get("meshes"))]
    for what, has in _PRIMITIVES.items():
        n = sum(any(map(has, rows)) for rows in primitives)
        if n:
            notes.add(UNREAD, "meshes", f"{n} of {len(primitives)} have {what}, which are not read")
    n = sum("skin" in node for node in _rows(gltf.document.get("nodes")))
    if n:
        notes.add(UNREAD, "nodes", f"{n} have a skin, which is not read: they stand as modelled")


def _rows(value: Any) -> list[_Row]:
    return [row for row in value if isinstance(row, dict)] if isinstance(value, list) else []


# A furnished scene as glTF 2.0 (.glb, .gltf) -> House.


_SMALL_M, _LARGE_M = 0.3, 150.0  # a scene beyond is in other units than metres


@dataclass(frozen=True, slots=True)
class Beside:
    """What lies beside a scene."""

    fetch: Fetch = lambda _name: None  # any other file by its relative name
    mapping: bytes | None = None  # JSON, None = no file
    rooms: bytes | None = None  # JSON, None = no file


def read_gltf_file(path: Path, fields: ReadFields) -> House:
    """The House of a .glb or .gltf file with the mapping and room files beside it.

    Raises BadHouse naming file and place; a name that leads out of the file's folder is rejected.
    """
    folder = RootFolder(path.parent)
    data = folder.read(path.name, max_bytes=MAX_SCENE_BYTES)
    if data is None:
        raise BadHouse(path, "", "no such file")
    mapping, rooms = side_files(path)
    beside = Beside(
        fetch=lambda name: folder.read(name, max_bytes=MAX_SCENE_BYTES),
        mapping=folder.read(mapping, max_bytes=MAX_SCENE_BYTES),
        rooms=folder.read(rooms, max_bytes=MAX_SCENE_BYTES),
    )
    house = read_gltf(data, path.name, fields=fields, beside=beside)
    if folder.n_read > 1:
        return replace(house, source=replace(house.source, sha256=folder.sha256))
    return house


def side_files(path: Path) -> tuple[str, str]:
    """Names of a scene's class mapping and of its room file, both optional."""
    return f"{path.stem}.classes.json", f"{path.stem}.rooms.json"


def read_gltf(data: bytes, name: str, *, fields: ReadFields, beside: Beside | None = None) -> House:
    """The House in the bytes of a scene; name: its file name.

    Raises BadHouse naming the place, and when no room is given and no floor is found.
    """
    beside = beside or Beside()
    stem = name.rsplit(".", 1)[0]
    notes = Notes(name, strict=fields.strict)
    mapping = Mapping()
    if beside.mapping is not None:
        mapping = mapping_from_json(beside.mapping, f"{stem}.classes.json")
    # Read what is in the scene, then cut its floors into rooms.
    gltf = gltf_document(data, name, beside.fetch)
    copyright_line = gltf.document["asset"].get("copyright", "")
    source = Source("gltf", name, keys.sha256(data), attribution=str(copyright_line)[:500])
    return house_of_gltf(
        gltf, source, stem, fields, notes, mapping=mapping, fetch=beside.fetch, rooms=beside.rooms
    )


def house_of_gltf(
    gltf: Gltf,
    source: Source,
    stem: str,
    fields: ReadFields,
    notes: Notes,
    *,
    mapping: Mapping,
    fetch: Fetch,
    rooms: bytes | None = None,
) -> House:
    """The House that a document shows. stem: the name of its file without suffix.

    rooms: the bytes of its room file. Raises BadHouse as read_gltf does.
    """
    name, told = source.file, rooms
    materials = SceneMaterials(gltf, fetch, notes)
    items = list(items_of_scene(gltf, mapping, materials, notes, fields))
    note_unread(gltf, notes)
    if told is not None:
        found = rooms_from_json(told, f"{stem}.rooms.json", items)
    elif own := _rooms_of_scene(gltf):
        found = told_rooms({"rooms": own}, name, items)
    else:
        found = rooms_from_floors(items)
    if not found:
        hint = f"name a node `floor`, map one in {stem}.classes.json, or give {stem}.rooms.json"
        hint = (
            f"{_of_its_size(items, source.kind)}{hint}; `pbrs-farm objects` renders single models"
        )
        raise BadHouse(name, "scene", "has no floor", hint=hint)
    # Sort rooms into levels and items into rooms.
    levels, numbered = levels_of(found)
    check_rooms(numbered, name)
    items = [_placed(item, levels, numbered) for item in items]
    return House(
        id=keys.house_id(stem, source.sha256),
        name=stem,
        source=source,
        levels=levels,
        rooms=numbered,
        items=tuple(items),
        materials=materials.library.materials,
        textures=materials.library.textures,
        openings=openings(items),
        notes=notes.all(),
    )


def _rooms_of_scene(gltf: Gltf) -> Any:
    """What the scene's extras say of rooms, as our own exports do."""
    scene = entry(gltf, "scenes", gltf.document.get("scene", 0))
    return object_at(scene, "extras").get("rooms")


def _of_its_size(items: Sequence[Item], kind: str) -> str:
    """What to say of a scene that is no size of a house, as one exported in centimetres; or ""."""
    bounds = np.array([i.bounds for i in items if i.n_faces]).reshape(-1, 2, 3)
    if not len(bounds):
        return ""
    wide = float((bounds[:, 1].max(0) - bounds[:, 0].min(0)).max())
    is_usual = _SMALL_M < wide < _LARGE_M
    unit = "but glTF is in metres: scale it" if kind == "gltf" else "by its unit: is that right?"
    return "" if is_usual else f"it is {wide:.3g} m large, {unit}; or "


def _placed(item: Item, levels: tuple[Level, ...], rooms: tuple[Room, ...]) -> Item:
    """The item with its level, and its room unless it is a wall."""
    extent = _extent(item)
    room_id = None if item.kind is ItemKind.WALL else room_at(rooms, extent.mean(0))
    return replace(item, level_id=level_of(levels, float(extent[0, 1])), room_id=room_id)


def _extent(item: Item) -> F64:
    """(2, 3) the item's bounds; those of its lights where it has no surfaces."""
    return item.bounds if item.surfaces else np.tile(item.lights[0].position, (2, 1))
