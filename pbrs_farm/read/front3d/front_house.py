"""A 3D-FRONT house -> House. Effects: reads the file, 3D-FUTURE's models and 3D-FRONT's textures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np
import shapely

from pbrs_farm.core import keys
from pbrs_farm.core.arrays import F64
from pbrs_farm.core.classes import OTHERPROP
from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.frames import is_flattening
from pbrs_farm.core.house import (
    House,
    Item,
    ItemKind,
    LightPart,
    Material,
    MaterialKind,
    Room,
    Source,
    Surface,
)
from pbrs_farm.core.lighting import BULB_RADIUS_M, PowerUnit
from pbrs_farm.core.mesh import area_vectors, face_areas
from pbrs_farm.core.recipe import ReadFields
from pbrs_farm.geometry.plan_surfaces import horizontal
from pbrs_farm.home.given_rooms import NO_ROOM, given_room
from pbrs_farm.home.names import parted
from pbrs_farm.home.room_use import named_kind
from pbrs_farm.read.common.format import GivenFile, data_of
from pbrs_farm.read.common.given_classes import LEFT_OUT, class_by_words, given_class
from pbrs_farm.read.common.house_builder import CLASS_OF_STRUCTURE, HouseBuilder, structure_item
from pbrs_farm.read.common.json_values import MAX_JSON_BYTES, NAME
from pbrs_farm.read.common.model_materials import MAX_TEXTURE_BYTES, ModelMaterials
from pbrs_farm.read.common.notes import Notes
from pbrs_farm.read.common.room_floors import floor_height, floor_polygon
from pbrs_farm.read.common.rooms import check_number, check_unit
from pbrs_farm.read.common.source_files import RootFolder, SourceFiles
from pbrs_farm.read.front3d.front_file import FrontFile, FrontMesh, front_file
from pbrs_farm.read.front3d.front_openings import HOLE_TYPES, holes_with_names
from pbrs_farm.read.front3d.front_pieces import (
    INFO,
    FrontModels,
    files_of_model,
    light_items,
    model_folder,
)
from pbrs_farm.read.front3d.front_walls import (
    MAX_SHEETS,
    WallPiece,
    holes_of,
    pieces_of,
    sheets_of,
    solid_of,
)

_TEXTURES: Final = ("3D-FRONT-texture", "../3D-FRONT-texture", "../../3D-FRONT-texture", "texture")
# Mesh types that the generated solids and repair's slabs replace.
# fmt: off
_MADE: Final = frozenset(
    {"WallInner", "WallOuter", "WallTop", "WallBottom", "SlabTop", "SlabSide", "SlabBottom", *HOLE_TYPES}
)
# fmt: on
_LEAST_ROOM_M2: Final = 0.5  # smaller rooms are shafts
_STOREY_M: Final = 2.7
_LIGHT_BAND_LM: Final = 800.0


def companions_of_front3d(given: GivenFile, files: SourceFiles) -> str:
    """Digest of the models and textures that the reader may open; "" if there are none."""
    path, models = given.path, given.models
    _, data = data_of(given, MAX_JSON_BYTES)
    house = front_file(data, path.name, Notes(path.name, strict=False))
    digests = []
    folder = model_folder(path, models)
    if folder is not None:
        names = [n for jid in sorted({p.jid for p in house.pieces}) for n in files_of_model(jid)]
        digests.append(files.digest(folder, [INFO, *names]))
    textures = _texture_folder(path, models)
    if textures is not None:
        jids = sorted({str(m.get("jid") or "") for m in house.materials.values()})
        names = [f"{j}/texture.png" for j in jids if NAME.fullmatch(j) and ".." not in j]
        digests.append(files.digest(textures, names))
    return keys.digest(*digests) if any(digests) else ""


def read_front3d(given: GivenFile, fields: ReadFields) -> House:
    """Read the house; BadHouse, naming the invalid entry. models: 3D-FUTURE's folder, "" = beside or above."""
    path, models = given.path, given.models
    folder, data = data_of(given, MAX_JSON_BYTES)
    notes = Notes(path.name, strict=fields.strict)
    house = front_file(data, path.name, notes)
    check_number(sum(m.kind == "Floor" for m in house.meshes), path.name)
    n_faces = sum(len(m.faces) for m in house.meshes)
    if n_faces > fields.max_triangles:
        text = f"{n_faces} triangles, more than {fields.max_triangles}"
        raise BadHouse(path.name, "mesh", text, hint="limit: read.max_triangles")
    model_root = model_folder(path, models)
    materials = ModelMaterials(model_root or folder, notes)
    paints = _Paints(house, materials, _texture_folder(path, models), notes)
    structure = _Structure(house, paints, notes)
    rooms, parts = structure.rooms(path.name)
    builder = HouseBuilder(path.name, fields, notes, materials.library)
    builder.set_rooms(rooms)
    holes, walls = structure.walls(path.name)
    pieces = FrontModels(model_root, materials, notes, fields)
    furniture = [
        item
        for k, p in enumerate(house.pieces)
        if (item := pieces.item(p, f"piece_{k}")) is not None
    ]
    if pieces.n_missing:
        text = f"{pieces.n_missing} pieces have no model and are replaced by stand-ins"
        notes.add("missing-model", "furniture", f"{text}; --models DIR names 3D-FUTURE-model")
    items = [*walls, *parts, *structure.trim(), *furniture]
    areas = {r.id: float(shapely.Polygon(r.polygon).area) for r in rooms}
    items += light_items(house.lights, items, areas, {r.id: r.ceiling_y for r in rooms})
    for item in items:
        builder.add(item, _foot(item))
    for hole in holes:
        builder.add_hole(hole)
    source = Source("front3d", path.name, keys.sha256(data), licence="research only")
    return builder.house(path.stem, source, name=house.uid)


def _foot(item: Item) -> float:
    if item.surfaces:
        return float(item.bounds[0, 1]) - (1.0 if item.kind is ItemKind.CEILING else 0.0)
    if item.lights:
        return item.lights[0].position[1] - 1.0
    return 0.0 if item.box is None else float(item.box.corners[:, 1].min())


def _texture_folder(path: Path, models: str) -> RootFolder | None:
    bases = [Path(models), Path(models).parent] if models else []
    places = [b / "3D-FRONT-texture" for b in bases] + [path.parent / t for t in _TEXTURES]
    return next((RootFolder(p) for p in places if p.is_dir()), None)


class _Paints:
    """The materials of the structure by their uid."""

    def __init__(
        self, house: FrontFile, materials: ModelMaterials, folder: RootFolder | None, notes: Notes
    ) -> None:
        self.library = materials.library
        self._house, self._folder, self._notes = house, folder, notes
        self._known: dict[str, int] = {}
        if folder is None and any(m.get("jid") for m in house.materials.values()):
            text = "no 3D-FRONT-texture beside or above the file: surfaces are painted"
            notes.add("missing-texture", "material", text)

    def index(self, uid: str) -> int:
        """The material's index in the house's library."""
        if uid not in self._known:
            self._known[uid] = self.library.index(self._material(uid))
        return self._known[uid]

    def uvs(self, mesh: FrontMesh) -> F64 | None:
        """The mesh's texture coordinates as its material turns and scales them."""
        if mesh.uvs is None:
            return None
        turn = self._house.materials.get(mesh.material, {}).get("UVTransform")
        try:
            matrix = np.array(turn, np.float64).reshape(3, 3)[:2, :2]
        except (ValueError, TypeError):
            return mesh.uvs
        is_sound = bool(np.isfinite(matrix).all()) and not is_flattening(matrix)
        return mesh.uvs @ matrix.T if is_sound else mesh.uvs

    def _material(self, uid: str) -> Material:
        row = self._house.materials.get(uid, {})
        colour = _parse_front_colour(row.get("color"))
        jid = str(row.get("jid") or "")
        loaded = None
        if (
            self._folder is not None
            and NAME.fullmatch(jid)
            and ".." not in jid
            and not row.get("useColor")
        ):
            folder, name = self._folder, f"{jid}/texture.png"
            loaded = self.library.texture(
                f"3D-FRONT-texture/{name}",
                name=name,
                place=f"material {uid[:40]}",
                load=lambda: folder.read(name, max_bytes=MAX_TEXTURE_BYTES),
            )
        if loaded is not None:
            return Material(uid[:60], texture_id=loaded.texture.id, alpha_cutout=loaded.has_holes())
        return Material(uid[:60], diffuse=colour or (1.0, 1.0, 1.0), is_default=colour is None)


def _parse_front_colour(value: Any) -> tuple[float, float, float] | None:
    is_rgb = isinstance(value, list) and len(value) >= 3
    if not is_rgb or not all(isinstance(v, int | float) and 0 <= v <= 255 for v in value[:3]):
        return None
    r, g, b = (float(v) / 255 for v in value[:3])
    return r, g, b


class _Structure:
    """Rooms, walls and trim while they are built."""

    def __init__(self, house: FrontFile, paints: _Paints, notes: Notes) -> None:
        self._house, self._paints, self._notes = house, paints, notes
        by_room: dict[str, dict[str, list[FrontMesh]]] = {}
        for mesh in house.meshes:
            by_room.setdefault(mesh.room, {}).setdefault(mesh.kind, []).append(mesh)
        self._by_room = by_room
        self._areas: dict[str, Any] = {}

    def rooms(self, file: str) -> tuple[list[Room], list[Item]]:
        """The rooms that have a floor, and their floors and ceilings."""
        rooms: list[Room] = []
        parts: list[Item] = []
        for front_room in self._house.rooms:
            if given_room("3dfront", front_room.kind) == NO_ROOM:
                continue
            own_meshes = self._by_room.get(front_room.id, {})
            floors = [self._level(m, up=True) for m in own_meshes.get("Floor", [])]
            surfaces = [s for s in floors if s is not None]
            polygon = floor_polygon(surfaces, []) if surfaces else None
            low = floor_height(surfaces)
            if polygon is None or low is None:
                self._notes.add("empty-room", f"room {front_room.id}", "has no floor; left out")
                continue
            ceilings = [self._level(m, up=False) for m in own_meshes.get("Ceiling", [])]
            over = [s for s in ceilings if s is not None]
            tops = [float(m.points[:, 1].max()) for m in own_meshes.get("WallInner", [])]
            high = min((float(s.positions[:, 1].min()) for s in over), default=0.0)
            if high < low + 1.0:
                high = float(np.median(tops)) if tops else low + _STOREY_M
                high = high if high > low + 1.0 else low + _STOREY_M
                material = self._paints.index("")
                over = [horizontal("ceiling", [[polygon]], high, material, up=False)]
            room_id = front_room.id
            for kind, shown in ((ItemKind.FLOOR, surfaces), (ItemKind.CEILING, over)):
                parts.append(structure_item(f"{room_id}_{kind}", kind, shown, room_id=room_id))
            area = shapely.Polygon(polygon)
            self._areas[front_room.id] = area
            if area.area < _LEAST_ROOM_M2:
                text = f"has {area.area:.2f} m2: a shaft, not a room"
                self._notes.add("room-left-out", f"room {front_room.id}", text)
                continue
            word = given_room("3dfront", front_room.kind)
            name = parted(front_room.kind) or "Room"
            if word and named_kind(f"{word} {name}") is not named_kind(word):
                name = f"{word} room"  # a LivingDiningRoom is to live in, whatever else it names
            rooms.append(
                Room(
                    id=front_room.id,
                    name=name,
                    level_id="",
                    polygon=polygon,
                    floor_y=low,
                    ceiling_y=high,
                    types=(word or front_room.kind,) if front_room.kind else (),
                )
            )
        if not rooms:
            n_shafts = len(self._areas)
            text = f"all {n_shafts} rooms are below {_LEAST_ROOM_M2} m2: shafts, not rooms"
            text = text if n_shafts else "no room has a mesh of the type Floor"
            raise BadHouse(file, "scene.room", text)
        check_unit(rooms, file, "mesh", "3D-FRONT is in metres")
        return rooms, parts

    def _level(self, mesh: FrontMesh, *, up: bool) -> Surface | None:
        """The mesh with every face turned up, or down: winding is unreliable."""
        corners = mesh.points[mesh.faces]
        n = area_vectors(corners)[:, 1]
        keep = face_areas(corners) > 1e-8
        faces = np.where(((n > 0) == up)[:, None], mesh.faces, mesh.faces[:, ::-1])[keep]
        if not len(faces):
            return None
        uvs = self._paints.uvs(mesh)
        if uvs is None:
            uvs = mesh.points[:, [0, 2]] * (np.array([1, -1]) if up else 1)
        return Surface(
            mesh.kind,
            mesh.points.astype(np.float32),
            np.ascontiguousarray(faces, np.int32),
            self._paints.index(mesh.material),
            uvs.astype(np.float32),
        )

    def walls(self, file: str) -> tuple[list[Any], list[Item]]:
        """(the holes, the walls as solids)."""
        drawn = [
            replace(m, uvs=self._paints.uvs(m))
            for m in self._house.meshes
            if m.kind in ("WallInner", "WallOuter")
        ]
        if len(drawn) > MAX_SHEETS:
            raise BadHouse(file, "mesh", f"{len(drawn)} walls, at most {MAX_SHEETS} are read")
        inner, outer = sheets_of(drawn, self._areas)
        pieces = pieces_of(inner, outer)
        if not pieces:
            self._notes.add("missing-walls", "mesh", "no mesh of the type WallInner faces a room")
        items = [self._wall(p, pieces, k) for k, p in enumerate(pieces)]
        return holes_with_names(self._house, holes_of(pieces), self._notes), items

    def _wall(self, piece: WallPiece, pieces: Sequence[WallPiece], k: int) -> Item:
        sheet = piece.sheet
        room = self._paints.index(sheet.mesh.material)
        behind = room if piece.back is None else self._paints.index(piece.back.mesh.material)
        return structure_item(
            f"wall_{k}",
            ItemKind.WALL,
            solid_of(piece, pieces, (room, behind, room)),
            source_class="WallInner",
            room_id=sheet.room,
            boundary_of=(sheet.room,),
        )

    def trim(self) -> list[Item]:
        """All other visible meshes: skirting, dropped ceilings, columns, fitted cupboards."""
        items: list[Item] = []
        for mesh in self._house.meshes:
            if mesh.kind in _MADE or (
                mesh.kind in ("Floor", "Ceiling") and mesh.room in self._areas
            ):
                continue
            mesh_class = given_class("3dfront-mesh", mesh.kind) or class_by_words(parted(mesh.kind))
            if mesh_class is not None and mesh_class.kind == LEFT_OUT:
                continue
            index = self._paints.index(mesh.material)
            uvs = self._paints.uvs(mesh)
            uvs = _planar_uvs(mesh.points) if uvs is None else uvs
            is_lamp = mesh_class is not None and mesh_class.kind == "lamp"
            if is_lamp:
                library = self._paints.library
                bulb = replace(library.materials[index], kind=MaterialKind.BULB)
                index = library.index(bulb)
            surface = Surface(
                mesh.kind, mesh.points.astype(np.float32), mesh.faces, index, uvs.astype(np.float32)
            )
            lights: tuple[LightPart, ...] = ()
            if is_lamp:
                x, y, z = (float(v) for v in mesh.points.mean(0))
                lights = (
                    LightPart(
                        (x, y, z), BULB_RADIUS_M, _LIGHT_BAND_LM, PowerUnit.LUMEN, emitting=(0,)
                    ),
                )
            items.append(
                Item(
                    id=f"mesh_{len(items)}",
                    name=parted(mesh.kind).lower() or "mesh",
                    kind=ItemKind.LAMP if is_lamp else ItemKind.OBJECT,
                    level_id="0",
                    surfaces=(surface,),
                    nyu40=OTHERPROP if mesh_class is None else max(mesh_class.nyu40, 0),
                    source_class=mesh.kind,
                    room_id=mesh.room,
                    lights=lights,
                    tags=("structure",)
                    if mesh_class is not None and mesh_class.nyu40 in CLASS_OF_STRUCTURE.values()
                    else (),
                )
            )
        return items


def _planar_uvs(points: F64) -> F64:
    """One metre a repeat on the plane that the mesh fills most."""
    axes = np.sort(np.argsort(np.ptp(points, axis=0))[1:])
    return np.asarray(points[:, axes], np.float64)
