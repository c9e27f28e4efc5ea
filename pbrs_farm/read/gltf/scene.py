"""A furnished scene as glTF 2.0 (.glb, .gltf) -> House. Effect: read_gltf_file reads files.

An item is a node whose extras, mapping row or name say its class. Beside the scene may lie
`<stem>.classes.json`, which maps names to classes, and `<stem>.rooms.json`, which has the rooms:

    {"rooms": [{"polygon": [[x, z], ...], "floor_y": 0.0, "ceiling_y": 2.5, "name": "Kitchen"}]}
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from posixpath import dirname
from typing import Any, Final

import numpy as np

from pbrs_farm.core import keys
from pbrs_farm.core.arrays import F64
from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.house import House, Item, ItemKind, Source
from pbrs_farm.core.recipe import ReadFields
from pbrs_farm.formats.glb import Gltf, entry
from pbrs_farm.read.common.format import GivenFile, data_of
from pbrs_farm.read.common.house_builder import HouseBuilder
from pbrs_farm.read.common.name_classes import UNMAPPED
from pbrs_farm.read.common.notes import Notes
from pbrs_farm.read.common.openings import openings
from pbrs_farm.read.common.rooms import rooms_from_floors, rooms_from_json, rooms_from_value
from pbrs_farm.read.common.source_files import RootFolder, SourceFiles
from pbrs_farm.read.gltf.document import Fetch, files_of_gltf, gltf_document, note_unread, object_at
from pbrs_farm.read.gltf.materials import SceneMaterials
from pbrs_farm.read.gltf.node_classes import Mapping, mapping_from_json
from pbrs_farm.read.gltf.scene_items import items_of_scene
from pbrs_farm.regular_files import MAX_SCENE_BYTES, read_given

_MOST_SIDE_BYTES: Final = 16 * 2**20
_SMALL_M, _LARGE_M = 0.3, 150.0  # a scene beyond is in other units than metres


@dataclass(frozen=True, slots=True)
class Beside:
    """Files beside a scene."""

    fetch: Fetch = lambda _name: None  # any other file by its relative name
    mapping: bytes | None = None  # JSON, None = no file
    rooms: bytes | None = None  # JSON, None = no file

    @classmethod
    def of(cls, folder: RootFolder, name: str, fetch: Fetch) -> Beside:
        """The mapping and room files beside the file of that name below the folder."""
        sides = (folder.name_from(dirname(name), side) for side in side_files(Path(name)))
        return cls(fetch, *(folder.read(side, max_bytes=_MOST_SIDE_BYTES) for side in sides))


def read_given_gltf(given: GivenFile, fields: ReadFields) -> House:
    """The House of the file, with the mapping and room files beside it; as read_gltf_file."""
    return read_gltf_file(given.path, fields)


def companions_of_gltf(given: GivenFile, files: SourceFiles) -> str:
    """Digest of the mapping and room files, the buffers and the pictures of the scene."""
    path = given.path
    names = [*side_files(path), *files_of_gltf(read_given(path, error=BadHouse), path.name)]
    return files.digest(RootFolder(path.parent), names)


def read_gltf_file(path: Path, fields: ReadFields) -> House:
    """The House of a .glb or .gltf with its mapping and room files; BadHouse names file and place."""
    folder, data = data_of(GivenFile(path), MAX_SCENE_BYTES)
    beside = Beside.of(folder, path.name, lambda name: folder.read(name, max_bytes=MAX_SCENE_BYTES))
    house = read_gltf(data, path.name, fields=fields, beside=beside)
    if len(folder.names_read) > 1:
        return replace(house, source=replace(house.source, sha256=folder.sha256))
    return house


def side_files(path: Path) -> tuple[str, str]:
    """Names of a scene's class mapping and of its room file, both optional."""
    return f"{path.stem}.classes.json", f"{path.stem}.rooms.json"


def read_gltf(data: bytes, name: str, *, fields: ReadFields, beside: Beside | None = None) -> House:
    """The House in the bytes of a scene of that file name; BadHouse also without room and floor."""
    beside = beside or Beside()
    stem = name.rsplit(".", 1)[0]
    notes = Notes(name, strict=fields.strict)
    gltf = gltf_document(data, name, beside.fetch)
    copyright_line = gltf.document["asset"].get("copyright", "")
    source = Source("gltf", name, keys.sha256(data), attribution=str(copyright_line)[:500])
    return house_of_gltf(gltf, source, stem, fields, notes, beside)


def house_of_gltf(
    gltf: Gltf, source: Source, stem: str, fields: ReadFields, notes: Notes, beside: Beside
) -> House:
    """The House of a document. stem: of its file. BadHouse as read_gltf."""
    mapping = Mapping()
    if beside.mapping is not None:
        mapping = mapping_from_json(beside.mapping, f"{stem}.classes.json")
    # Read the scene's content, then cut its floors into rooms.
    materials = SceneMaterials(gltf, beside.fetch, notes)
    items = list(items_of_scene(gltf, mapping, materials, notes, fields))
    note_unread(gltf, notes)
    if beside.rooms is not None:
        house_rooms = rooms_from_json(beside.rooms, f"{stem}.rooms.json", items)
    elif scene_rooms := _rooms_of_scene(gltf):
        house_rooms = rooms_from_value({"rooms": scene_rooms}, source.file, items)
    else:
        house_rooms = rooms_from_floors(items)
    if not house_rooms:
        hint = f"name a node `floor`, map one in {stem}.classes.json, or give {stem}.rooms.json"
        hint = (
            f"{_of_its_size(items, source.kind)}{hint}; `pbrs-farm objects` renders single models"
        )
        raise BadHouse(source.file, "scene", _why_no_floor(items), hint=hint)
    # Sort rooms into levels and items into rooms.
    builder = HouseBuilder(source.file, fields, notes, materials.library)
    builder.set_rooms(house_rooms)
    for item in items:
        extent = _extent(item)
        middle = None if item.kind is ItemKind.WALL else extent.mean(0)
        builder.add(item, float(extent[0, 1]), middle)
    return builder.house(stem, source, openings=openings(items))


def _rooms_of_scene(gltf: Gltf) -> Any:
    """The rooms in the scene's extras, as written by this project's exports."""
    scene = entry(gltf, "scenes", gltf.document.get("scene", 0))
    return object_at(scene, "extras").get("rooms")


def _why_no_floor(items: Sequence[Item]) -> str:
    """Reason why a scene has no floor: it is a scan or a flat of one mesh, or no object is a floor."""
    shapes = [item for item in items if item.n_faces]
    if shapes and all(UNMAPPED in item.tags for item in shapes):
        n = len(shapes)
        parts = "one mesh" if n == 1 else f"{n} objects"
        return f"has no floor: {parts} without a known name, as in a scan; furniture and walls cannot be told apart"
    return "has no floor"


def _of_its_size(items: Sequence[Item], kind: str) -> str:
    """Warning text for a scene that does not have the size of a house, as if exported in centimetres; or ""."""
    bounds = np.array([i.bounds for i in items if i.n_faces]).reshape(-1, 2, 3)
    if not len(bounds):
        return ""
    wide = float((bounds[:, 1].max(0) - bounds[:, 0].min(0)).max())
    is_usual = _SMALL_M < wide < _LARGE_M
    unit = "but glTF is in metres: scale it" if kind == "gltf" else "by its unit: is that right?"
    return "" if is_usual else f"it is {wide:.3g} m large, {unit}; or "


def _extent(item: Item) -> F64:
    """(2, 3) the item's bounds; those of its lights where it has no surfaces."""
    return item.bounds if item.surfaces else np.tile(item.lights[0].position, (2, 1))
