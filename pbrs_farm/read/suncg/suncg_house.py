"""A SUNCG house (v1 or v2) -> House (docs/spec/suncg.md sections 1 and 2). Reads files of the root."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from pbrs_farm.core.checked_json import json_from_bytes
from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.house import MAX_INSTANCES, House, Item, ItemKind, Level, Room, Source, Surface
from pbrs_farm.core.recipe import ReadFields
from pbrs_farm.read.common.arch_elements import Arch
from pbrs_farm.read.common.house_builder import unique_id
from pbrs_farm.read.common.json_values import NAME
from pbrs_farm.read.common.model_materials import ModelCache, ModelMaterials
from pbrs_farm.read.common.notes import Notes
from pbrs_farm.read.common.openings import openings
from pbrs_farm.read.common.room_floors import (
    ceiling_height,
    enclosed_polygon,
    floor_height,
    floor_polygon,
)
from pbrs_farm.read.common.rooms import check_rooms
from pbrs_farm.read.common.source_files import RootFolder, SourceFiles
from pbrs_farm.read.suncg.arch_json import arch_from_json, arch_openings
from pbrs_farm.read.suncg.house_json import HouseRecord, Node, house_record
from pbrs_farm.read.suncg.metadata import (
    CLASS_TABLES,
    LAMP_TABLE,
    LIGHT_TABLE,
    VARIANT_TABLE,
    read_tables,
    table_places,
)
from pbrs_farm.read.suncg.node_items import (
    ReaderContext,
    box_item,
    ground_item,
    object_item,
    room_items,
)

MAX_HOUSE_BYTES: Final = 64_000_000
_HOUSE_ID: Final = re.compile(r"[A-Za-z0-9][A-Za-z0-9_\-]{0,63}")
_ROOM_ID: Final = re.compile(r"\d{1,6}_\d{1,6}")
_STOREY_M: Final = 2.7
_FLOOR_SLAB_M: Final = 0.05


def arch_file(house_id: str) -> str:
    """Name of v2's structure of a house."""
    return f"wall/{house_id}/{house_id}.arch.json"


def suncg_companions(folder: RootFolder, house_id: str, files: SourceFiles) -> Iterator[str]:
    """Names below the root, maybe missing, of the other files of a house; never raises."""
    for table in (*CLASS_TABLES, VARIANT_TABLE, LAMP_TABLE, LIGHT_TABLE):
        yield from table_places(table)
    yield arch_file(house_id)
    # Collect what the house's own JSON files name.
    documents = (f"house/{house_id}/house.json", arch_file(house_id))
    named = [pair for name in documents for pair in _names_in_document(_document(folder, name))]
    models = {value for key, value in named if key == "modelId"}
    folders = [f"room/{house_id}", *(f"object/{model}" for model in sorted(models))]
    # A model's folder holds its meshes in every state; a material library names its pictures.
    for place in folders:
        for name in folder.names(place, (".obj", ".mtl")):
            yield name
            if name.endswith(".mtl"):
                yield from files.pictures(folder, name)
    for texture in {value for key, value in named if key == "texture"}:
        yield from (f"texture/{texture}{suffix}" for suffix in (".png", ".jpg"))


def _document(folder: RootFolder, name: str) -> Any:
    try:
        return json_from_bytes(folder.read(name, max_bytes=MAX_HOUSE_BYTES) or b"{}", name)
    except BadHouse:
        return {}  # the reader reports the fault


def _names_in_document(document: Any) -> Iterator[tuple[str, str]]:
    """(key, value) of every model and texture named anywhere in a JSON document."""
    waiting = [document]
    while waiting:
        value = waiting.pop()
        if isinstance(value, list):
            waiting += value
        elif isinstance(value, dict):
            waiting += value.values()
            for key in ("modelId", "texture"):
                name = value.get(key)
                if isinstance(name, str) and NAME.fullmatch(name):
                    yield key, name


def read_suncg(root: Path, house_id: str, fields: ReadFields) -> House:
    """The house ROOT/house/<house_id>/house.json with the rooms, models and tables of its root.

    Recoverable faults (missing models, textures, tables) are the House's notes. Raises BadHouse
    naming file and place for everything else, for the first note when fields.strict, and for a
    root without its `room` archive.
    """
    file = f"house/{house_id}/house.json"
    folder, notes = RootFolder(root), Notes(file, strict=fields.strict)
    record = _record(folder, house_id, file, notes)
    # Read what the nodes name: structure, tables, materials and models, each once.
    arch = _arch(folder, house_id, record)
    context = ReaderContext(
        house=house_id,
        folder=folder,
        tables=read_tables(folder, notes),
        materials=ModelMaterials(folder, notes),
        models=ModelCache(folder, notes, fields),
        notes=notes,
        world_from_house=record.world_from_house,
        arch=arch,
    )
    rooms, items = _contents(context, record, fields, file)
    check_rooms(rooms, file)
    if not rooms:
        raise BadHouse(root, file, "has no room with a floor or walls", hint="nothing to render")
    holes = openings(items) if arch is None else arch_openings(arch, _room_nodes(record), items)
    return House(
        id=house_id,
        name=house_id,
        source=Source("suncg", file, folder.sha256, attribution="SUNCG (Song et al. 2017)"),
        levels=_levels_in_use(record, rooms, items),
        rooms=tuple(rooms),
        items=tuple(items),
        materials=context.materials.library.materials,
        textures=context.materials.library.textures,
        openings=holes,
        notes=notes.all(),
    )


def _record(folder: RootFolder, house_id: str, file: str, notes: Notes) -> HouseRecord:
    """house.json below the root, with notes on irregularities."""
    # Check the id first: it becomes part of paths.
    if not _HOUSE_ID.fullmatch(house_id):
        raise BadHouse(folder.root, "house", f"{house_id[:80]!r} is not a house id")
    data = folder.read(file, max_bytes=MAX_HOUSE_BYTES)
    if data is None:
        hint = "pass ROOT/house/<id> of a SUNCG root"
        raise BadHouse(folder.root, file, "does not exist", hint=hint)
    record = house_record(data, file)
    if record.id and record.id != house_id:
        notes.add("id-differs", "id", f"house.json calls itself {record.id[:64]!r}")
    for place, kind in record.unknown:
        notes.add("unknown-type", place, f"a node of the type {kind!r}; left out")
    return record


def _arch(folder: RootFolder, house_id: str, record: HouseRecord) -> Arch | None:
    """None where the house's rooms have meshes (v1), else v2's structure; BadHouse without both."""
    wants = any(n.kind == "Room" for _, nodes in record.levels for n in nodes)
    if not wants or folder.has_folder(f"room/{house_id}"):
        return None
    name = arch_file(house_id)
    data = folder.read(name, max_bytes=MAX_HOUSE_BYTES)
    if data is not None:
        return arch_from_json(data, name)
    if folder.has_folder("room"):
        text, hint = f"room/{house_id} does not exist", "this house's walls and floors are missing"
    else:
        text = "room/ does not exist: there are no walls, floors and ceilings"
        hint = (
            "SUNCG v1 keeps them in a separate archive, room.zip; unpack it beside house/. "
            f"v2 keeps them in {name}, which does not exist either"
        )
    raise BadHouse(folder.root, f"house/{house_id}/house.json", text, hint=hint)


def _contents(
    context: ReaderContext, record: HouseRecord, fields: ReadFields, file: str
) -> tuple[list[Room], list[Item]]:
    rooms: list[Room] = []
    items: list[Item] = []
    ids: set[str] = set()
    n_faces = 0
    for number, (_, nodes) in enumerate(record.levels):
        # Make ids unique and check the limits as items come up.
        for node, item in _level_contents(context, number, nodes, rooms):
            unique = unique_id(item.id, ids)
            if unique != item.id:
                context.notes.add("duplicate-id", node.place, f"becomes {unique}")
            _check_extent(item, node, fields, file)
            n_faces += item.n_faces
            if n_faces > fields.max_triangles or len(items) >= MAX_INSTANCES:
                text = f"more than {fields.max_triangles} triangles or {MAX_INSTANCES} items"
                raise BadHouse(file, node.place, text, hint="limit: read.max_triangles")
            items.append(replace(item, id=unique))
    # Clear the room of items whose room was left out.
    room_ids = {room.id for room in rooms}
    return rooms, [i if i.room_id in room_ids else replace(i, room_id=None) for i in items]


def _level_contents(
    context: ReaderContext, number: int, nodes: tuple[Node, ...], rooms: list[Room]
) -> Iterator[tuple[Node, Item]]:
    """The items of a level in the order of its nodes; its rooms are added to rooms."""
    # Make the item of each node; a room gives several, and is itself kept.
    room_of_index = _room_of_index(context, number, nodes)
    taken = {room.id for room in rooms}
    for node in nodes:
        room_id = room_of_index.get(node.index)
        item: Item | None = None
        if node.kind == "Room":
            parts = list(room_items(context, node, _room_id_of_node(number, node)))
            room = _room_of_node(context, node, _room_id_of_node(number, node), parts)
            if room is not None and room.id not in taken:
                rooms.append(room)
                taken.add(room.id)
            yield from ((node, part) for part in parts if room is not None)
        elif node.kind == "Object":
            item = object_item(context, node, room_id)
        elif node.kind == "Box":
            item = box_item(context, node, room_id)
        else:
            item = ground_item(context, node)
        if item is not None:
            yield node, item


def _room_id_of_node(number: int, node: Node) -> str:
    return node.id if _ROOM_ID.fullmatch(node.id) else f"{number}_{node.index}"


def _room_nodes(record: HouseRecord) -> Iterator[tuple[Node, str]]:
    for number, (_, nodes) in enumerate(record.levels):
        yield from ((node, _room_id_of_node(number, node)) for node in nodes if node.kind == "Room")


def _room_of_index(context: ReaderContext, number: int, nodes: tuple[Node, ...]) -> dict[int, str]:
    """The room of every node that one lists; the first wins, rooms are never inside rooms."""
    kinds = {node.index: node.kind for node in nodes}
    rooms: dict[int, str] = {}
    for node in nodes:
        for index in node.members if node.kind == "Room" else ():
            if kinds.get(index) == "Room":
                context.notes.add(
                    "room-in-room", node.place, f"lists node {index}, a room; ignored"
                )
            elif index in kinds:
                rooms.setdefault(index, _room_id_of_node(number, node))
    return rooms


def _check_extent(item: Item, node: Node, fields: ReadFields, file: str) -> None:
    # Refuse numbers that are not finite, too: the comparison is false for them.
    farthest = float(np.abs(item.bounds).max())
    if not farthest <= fields.max_extent_m:
        text = f"is {farthest:.6g} m from the origin; at most {fields.max_extent_m:g} m"
        raise BadHouse(file, node.place, text, hint="limit: read.max_extent_m")


def _room_of_node(
    context: ReaderContext, node: Node, room_id: str, parts: list[Item]
) -> Room | None:
    # Sort the room's surfaces by what they are.
    floor, ceiling, walls = (
        _surfaces_of_parts(parts, kind)
        for kind in (ItemKind.FLOOR, ItemKind.CEILING, ItemKind.WALL)
    )
    # The plan between the walls: of the floor, else of the space the walls enclose.
    polygon = floor_polygon(floor, walls)
    if polygon is None:
        polygon = enclosed_polygon(walls)
    if polygon is None:
        context.notes.add("empty-room", node.place, "has neither floor nor walls; left out")
        return None
    # Take the heights of floor and ceiling, else of the room's box.
    bounds = np.concatenate([p.bounds for p in parts])
    floor_y, ceiling_y = floor_height(floor), ceiling_height(ceiling)
    low = float(bounds[:, 1].min()) if floor_y is None else floor_y
    high = float(bounds[:, 1].max()) if ceiling_y is None else ceiling_y
    return Room(
        id=room_id,
        name=node.types[0].replace("_", " ") if node.types else f"Room {room_id}",
        level_id=node.level_id,
        polygon=polygon,
        floor_y=low,
        ceiling_y=high if high > low + 0.5 else low + _STOREY_M,
        types=node.types,
        has_floor=bool(floor),
        has_ceiling=bool(ceiling),
    )


def _surfaces_of_parts(parts: Iterable[Item], kind: ItemKind) -> list[Surface]:
    return [s for p in parts if p.kind is kind for s in p.surfaces]


def _levels_in_use(record: HouseRecord, rooms: list[Room], items: list[Item]) -> tuple[Level, ...]:
    """The levels that hold something."""
    used = {room.level_id for room in rooms} | {item.level_id for item in items}
    return tuple(
        _level(level_id, rooms, items) for level_id, _ in record.levels if level_id in used
    )


def _level(level_id: str, rooms: list[Room], items: list[Item]) -> Level:
    # Measure by the level's rooms, else by the lowest of its items.
    level_rooms = [r for r in rooms if r.level_id == level_id]
    if level_rooms:
        elevation = min(r.floor_y for r in level_rooms)
        height = float(np.median([r.ceiling_y - r.floor_y for r in level_rooms]))
        return Level(level_id, f"Level {level_id}", elevation, height, _FLOOR_SLAB_M)
    lows = [float(i.bounds[0, 1]) for i in items if i.level_id == level_id]
    return Level(level_id, f"Level {level_id}", min(lows, default=0.0), _STOREY_M, _FLOOR_SLAB_M)
