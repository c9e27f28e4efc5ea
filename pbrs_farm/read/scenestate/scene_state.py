"""Read a sceneState file (HSSD-200, Rent3D++, text-to-scene generators) as a House. Effects: reads files.

Walls become slabs, rooms get a floor and a ceiling, holes a door or a window; objects are models of
a folder, or stand-ins by their category.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np
import shapely

from pbrs_farm.core import keys
from pbrs_farm.core.arrays import F64
from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.house import House, Item, ItemKind, Room, Source, Surface
from pbrs_farm.core.recipe import ReadFields
from pbrs_farm.read.common.arch_elements import (
    SLAB_DEPTH_M,
    Arch,
    Element,
    slab_surfaces,
    wall_surfaces,
)
from pbrs_farm.read.common.doors_and_windows import Hole, merge_holes
from pbrs_farm.read.common.format import GivenFile, data_of
from pbrs_farm.read.common.given_classes import HSSD_TABLES
from pbrs_farm.read.common.house_builder import HouseBuilder, structure_item
from pbrs_farm.read.common.json_values import MAX_JSON_BYTES
from pbrs_farm.read.common.notes import Notes
from pbrs_farm.read.common.openings import LEAST_HOLE_M
from pbrs_farm.read.common.room_floors import ceiling_height, floor_height, floor_polygon
from pbrs_farm.read.common.rooms import check_number, check_unit, room_at
from pbrs_farm.read.common.source_files import SourceFiles
from pbrs_farm.read.scenestate.scene_document import (
    ArchMaterials,
    SceneDocument,
    SceneElement,
    scene_document,
)
from pbrs_farm.read.scenestate.scene_models import SceneModels, names_of_model, roots_of
from pbrs_farm.read.scenestate.scene_walls import StandingWall, standing_walls

MAX_WALLS, MAX_SLABS, MAX_HOLES = 3_000, 1_500, 2_000
_AS_IT_STANDS: Final = Arch(np.eye(4), {})
_STOREY_M: Final = 2.7
_ON_FLOOR_M: Final = 0.02  # maximum distance of an object's origin from a support's height, metres
_LEAST_SILL_M: Final = 0.2  # a hole of no type that begins lower is a door's
_AREA_M2: Final = 0.05  # least area of a floor


def companions_of_scenestate(given: GivenFile, files: SourceFiles) -> str:
    """Digest of the models and tables that the reader may open; "" if there are none."""
    path, models = given.path, given.models
    _, data = data_of(given, MAX_JSON_BYTES)
    document = scene_document(data, path.name, Notes(path.name, strict=False))
    ids = {o.model for o in document.objects}
    names = [*HSSD_TABLES, *(n for model in sorted(ids) for n in names_of_model(model))]
    digests = [files.digest(root, names) for root in roots_of(path, models)]
    return keys.digest(*digests) if any(digests) else ""


def read_scenestate(given: GivenFile, fields: ReadFields) -> House:
    """Read the house. Raises BadHouse, naming the invalid element, and for a file without walls and floors."""
    path, models = given.path, given.models
    folder, data = data_of(given, MAX_JSON_BYTES)
    notes = Notes(path.name, strict=fields.strict)
    document = scene_document(data, path.name, notes)
    _check_number(document, path.name)
    materials = ArchMaterials(document.pictures, folder, notes)
    shell = _Shell(document, materials, notes)
    rooms, parts = shell.rooms(path.name)
    builder = HouseBuilder(path.name, fields, notes, materials.library)
    builder.set_rooms(rooms)
    structure = [*shell.walls(), *parts]
    holes = shell.holes(builder.rooms)
    objects, missing = _object_items(document, path, models, shell, notes, fields)
    for item in (*structure, *objects):
        _add_item(item, builder)
    for hole in holes:
        low = hole.centre[1] - hole.size[1] / 2
        builder.add_hole(hole, foot_y=low + 0.1, cut_y=hole.centre[1])
    if missing:
        notes.add("missing-model", "scene.object", missing)
    source = Source("scenestate", path.name, keys.sha256(data))
    return builder.house(path.stem, source, name=document.id)


def _object_items(
    document: SceneDocument,
    path: Path,
    models: str,
    shell: _Shell,
    notes: Notes,
    fields: ReadFields,
) -> tuple[list[Item], str]:
    """The objects, and what to say of those that have neither a model nor a known class."""
    models_read = SceneModels(roots_of(path, models), shell.materials.library, notes, fields)
    items = []
    n_faces = 0
    for k, placed in enumerate(document.objects):
        item = models_read.item(placed, f"object_{k}")
        if item is None:
            continue
        n_faces += item.n_faces
        if n_faces > fields.max_triangles:
            text = f"more than {fields.max_triangles} triangles"
            raise BadHouse(path.name, placed.place, text, hint="limit: read.max_triangles")
        items.append(item)
    if not models_read.missing:
        return items, ""
    n, most = sum(models_read.missing.values()), models_read.missing.most_common(1)[0][0]
    return (
        items,
        f"{n} objects are left out: no model ({most}.glb) and no objects.csv; --models DIR",
    )


def _check_number(document: SceneDocument, file: str) -> None:
    """Raise BadHouse for more walls, slabs or holes than are united in bounded time."""
    n_walls = sum(e.element.kind == "Wall" for e in document.elements)
    n_slabs = len(document.elements) - n_walls
    n_holes = sum(len(e.element.holes) for e in document.elements)
    counts = (
        (n_walls, MAX_WALLS, "walls"),
        (n_slabs, MAX_SLABS, "slabs"),
        (n_holes, MAX_HOLES, "holes"),
    )
    for n, most, noun in counts:
        if n > most:
            raise BadHouse(file, "scene.arch.elements", f"{n} {noun}, at most {most} are read")


def _add_item(item: Item, builder: HouseBuilder) -> None:
    box = item.oriented_box if item.surfaces or item.box else None
    centre = np.zeros(3) if box is None else box.centre
    low = centre[1] if box is None else float(box.corners[:, 1].min())
    foot_y = low + (0.1 if item.kind is not ItemKind.CEILING else -1.0)
    builder.add(item, foot_y, None if item.kind.is_structure else centre)


class _Shell:
    """The architecture while it is built: walls, floors, ceilings, rooms, holes."""

    def __init__(self, document: SceneDocument, materials: ArchMaterials, notes: Notes) -> None:
        self.materials = materials
        self._document = document
        self._notes = notes
        elements = document.elements
        self._slabs = [e for e in elements if e.element.kind in ("Floor", "Ceiling")]
        self._slabs = [self._sunk(e) for e in self._slabs]
        floors = [e for e in self._slabs if e.element.kind == "Floor"]
        self._floors: dict[str, list[SceneElement]] = {}
        for k, e in enumerate(floors):
            names = e.rooms or (f"floor {k}",)
            self._floors.setdefault(names[0], []).append(e)
        areas = {name: _plan_of_floors(some) for name, some in self._floors.items()}
        walls = [e for e in elements if e.element.kind == "Wall"]
        self._drawn, self._standing = standing_walls(walls, areas)

    def _sunk(self, element: SceneElement) -> SceneElement:
        """The slab above its points; below them for a floor with items on the points."""
        e = element.element
        if e.kind != "Floor" or e.depth_m <= 0:
            return element
        low = float(e.points[0][:, 1].min())
        bases = [
            float(o.world_from_scene[1] @ o.scene_from_model[:, 3]) for o in self._document.objects
        ]
        at_top = sum(abs(y - low - e.depth_m) < _ON_FLOOR_M for y in bases)
        at_points = sum(abs(y - low) < _ON_FLOOR_M for y in bases)
        is_down = at_points > at_top or (at_points == at_top and abs(low) < 1e-6)
        if not is_down:
            return element
        points = tuple(ring - [0.0, e.depth_m, 0.0] for ring in e.points)
        return replace(element, element=replace(e, points=points))

    def walls(self) -> list[Item]:
        """An item for each wall."""
        items = []
        for wall in self._standing:
            if surfaces := self._wall_faces(wall):
                only_room = wall.rooms[0] if len(wall.rooms) == 1 else None
                items.append(_part_of_room(wall.id, ItemKind.WALL, surfaces, only_room, wall.rooms))
        return items

    def rooms(self, file: str) -> tuple[list[Room], list[Item]]:
        """The rooms in the file's order, and their floors and ceilings."""
        check_number(len(self._floors), file)
        walls = [(w, s) for w in self._standing for s in self._wall_faces(w)]
        order = [*self._document.room_types, *self._floors]
        rooms: list[Room] = []
        parts: list[Item] = []
        ceilings = [
            (e, shapely.make_valid(shapely.Polygon(e.element.points[0][:, [0, 2]])))
            for e in self._slabs
            if e.element.kind == "Ceiling"
        ]
        for name in dict.fromkeys(order):
            floors = self._floors.get(name)
            if floors is None:
                self._notes.add("empty-room", f"room {name}", "has no floor; left out")
                continue
            built = self._room(name, floors, ceilings, walls)
            if built is not None:
                rooms.append(built[0])
                parts += built[1]
        if not rooms:
            hint = "rooms follow from elements of the type Floor"
            raise BadHouse(file, "scene.arch.elements", "has no floor", hint=hint)
        check_unit(rooms, file, "scene.unit", "metres a unit: 0.01 for centimetres")
        return rooms, parts

    def _wall_faces(self, wall: StandingWall) -> tuple[Surface, ...]:
        return wall_surfaces(_AS_IT_STANDS, wall.element, wall.frame, self.materials)

    def _room(
        self,
        name: str,
        floors: list[SceneElement],
        ceilings: list[tuple[SceneElement, Any]],
        walls: list[tuple[StandingWall, Surface]],
    ) -> tuple[Room, list[Item]] | None:
        parts: list[Item] = []

        def add(item_id: str, kind: ItemKind, element: Element) -> None:
            surfaces = slab_surfaces(_AS_IT_STANDS, element, self.materials)
            if surfaces:
                parts.append(_part_of_room(item_id, kind, surfaces, name))

        for k, floor in enumerate(floors):
            add(f"{floor.id}.{k}" if k else floor.id, ItemKind.FLOOR, floor.element)
        faces = [s for part in parts for s in part.surfaces]
        low = floor_height(faces)
        if low is None:
            self._notes.add("empty-room", f"room {name}", "its floor has no area; left out")
            return None
        plan = np.concatenate([s.positions[:, [0, 2]] for s in faces]).astype(float)
        near = [(w, s) for w, s in walls if _meets_in_plan(s, plan.min(0) - 0.3, plan.max(0) + 0.3)]
        near = [(w, s) for w, s in near if _stands_on(w, low)]
        polygon = floor_polygon(faces, [s for _, s in near])
        if polygon is None or shapely.Polygon(polygon).area < _AREA_M2:
            self._notes.add("empty-room", f"room {name}", "its floor has no area; left out")
            return None
        area = shapely.Polygon(polygon)
        above = [
            e
            for e, shape in ceilings
            if shape.intersection(area).area > 0.3 * area.area
            and float(e.element.points[0][:, 1].min()) > low + 1.0
        ]
        own_ceilings = [e for e in ceilings if name in e[0].rooms]
        tops = sorted(w.frame.start[1] + w.element.height_m for w, _ in near)
        top = float(tops[len(tops) // 2]) if tops else low + _STOREY_M
        for e, _ in own_ceilings:
            add(e.id, ItemKind.CEILING, e.element)
        if not own_ceilings:
            for e in above:
                if not e.rooms:
                    add(f"{e.id}_{name}", ItemKind.CEILING, e.element)
        if not own_ceilings and not above:
            for k, floor in enumerate(floors):
                ceiling = _ceiling_over(floor.element, max(top, low + 1.0))
                add(f"{floor.id}_ceiling{k}", ItemKind.CEILING, ceiling)
        high = ceiling_height([s for p in parts if p.kind is ItemKind.CEILING for s in p.surfaces])
        high = top if high is None else high
        types = self._document.room_types.get(name, ())
        room = Room(
            id=name,
            name=types[0].replace("_", " ") if types else "",
            level_id="",
            polygon=polygon,
            floor_y=low,
            ceiling_y=high if high > low + 0.5 else low + _STOREY_M,
            types=types,
        )
        return room, parts

    def holes(self, rooms: Sequence[Room]) -> list[Hole]:
        """The holes of all walls, clipped to them, each once."""
        holes_found = []
        for wall in self._drawn:
            for k, hole in enumerate(wall.element.holes):
                kind = wall.element.hole_types[k] if k < len(wall.element.hole_types) else ""
                clipped_hole = self._hole(wall, k, hole, kind, rooms)
                holes_found += [clipped_hole] if clipped_hole is not None else []
        return merge_holes(holes_found)

    def _hole(
        self,
        wall: StandingWall,
        k: int,
        hole: tuple[float, float, float, float],
        kind: str,
        rooms: Sequence[Room],
    ) -> Hole | None:
        e, frame = wall.element, wall.frame
        u0, v0 = max(hole[0], 0.0), max(hole[1], 0.0)
        u1, v1 = min(hole[2], frame.length), min(hole[3], e.height_m)
        if u1 - u0 < LEAST_HOLE_M or v1 - v0 < LEAST_HOLE_M:
            self._notes.add("hole-outside", f"{wall.id} hole {k}", "is outside its wall; left out")
            return None
        word = kind.lower()
        is_window = word == "window" if word in ("door", "window") else v0 > _LEAST_SILL_M
        axes = frame.axes * [np.linalg.det(frame.axes), 1, 1]
        centre = frame.start + frame.axes @ [(u0 + u1) / 2, (v0 + v1) / 2, e.depth_m / 2]
        # A door begins at the floor, not below it.
        foot = float(frame.start[1] + v0)
        floor_y = next((r.floor_y for r in rooms if r.id == room_at(rooms, centre)), foot)
        if not is_window and foot < floor_y < foot + 0.3:
            centre = centre + np.array([0.0, (floor_y - foot) / 2, 0.0])
            v0 += floor_y - foot
        return Hole(
            id=f"{wall.id}_{'window' if is_window else 'door'}{k}",
            kind="window" if is_window else "door",
            centre=centre,
            size=(u1 - u0, v1 - v0, e.depth_m),
            axes=axes,
            source_class=kind,
        )


def _part_of_room(
    item_id: str,
    kind: ItemKind,
    surfaces: tuple[Surface, ...],
    room: str | None,
    boundary_of: Sequence[str] = (),
) -> Item:
    name = f"{kind.value} {room or ''}".strip()
    return structure_item(item_id, kind, surfaces, name=name, room_id=room, boundary_of=boundary_of)


def _ceiling_over(floor: Element, top: float) -> Element:
    points = tuple(ring * [1, 0, 1] + [0, top, 0] for ring in floor.points)
    return replace(floor, kind="Ceiling", points=points, overrides=(), depth_m=SLAB_DEPTH_M)


def _plan_of_floors(floors: Sequence[SceneElement]) -> Any:
    rings = [shapely.Polygon(e.element.points[0][:, [0, 2]]) for e in floors]
    return shapely.union_all([shapely.make_valid(r) for r in rings])


def _meets_in_plan(surface: Surface, low: F64, high: F64) -> bool:
    plan = surface.positions[:, [0, 2]]
    return bool((plan.max(0) > low).all() and (plan.min(0) < high).all())


def _stands_on(wall: StandingWall, floor_y: float) -> bool:
    low = float(wall.frame.start[1])
    return low < floor_y + 1.0 < low + wall.element.height_m
