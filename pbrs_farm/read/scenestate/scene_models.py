"""The objects of a sceneState: models in <folder>/<id>.glb, else by category and objects.csv. Reads files."""

from __future__ import annotations

import csv
import math
from collections import Counter
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Final

import numpy as np

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.classes import NYU40_NAMES, OTHERPROP
from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.house import Item, ItemKind, Surface
from pbrs_farm.core.recipe import ReadFields
from pbrs_farm.read.common.furniture_classes import rows_of_table
from pbrs_farm.read.common.given_classes import (
    HSSD_TABLES,
    GivenClass,
    box_only_item,
    class_by_words,
    hssd_rows,
)
from pbrs_farm.read.common.json_values import NAME
from pbrs_farm.read.common.material_library import MaterialLibrary
from pbrs_farm.read.common.notes import HARMLESS, Notes
from pbrs_farm.read.common.placed_mesh import assumed_light, mesh_of_surface, oriented_box, placed
from pbrs_farm.read.common.source_files import RootFolder
from pbrs_farm.read.gltf.document import gltf_document
from pbrs_farm.read.gltf.materials import SceneMaterials
from pbrs_farm.read.gltf.node_classes import Mapping
from pbrs_farm.read.gltf.scene_items import items_of_scene
from pbrs_farm.read.mesh.obj import Mesh
from pbrs_farm.read.scenestate.scene_document import PlacedModel
from pbrs_farm.regular_files import MAX_SCENE_BYTES

_MAX_TABLE_BYTES: Final = 64_000_000
_BESIDE: Final = ("", "..", "../..")  # where models and tables lie when no folder is named


@dataclass(frozen=True, slots=True)
class _Row:
    category: str
    size: tuple[float, float, float] | None  # width, height, depth if the table has them


def roots_of(path: Path, models: str) -> list[RootFolder]:
    """The folders in which a scene's models may lie."""
    if models:
        return [RootFolder(Path(models))]
    return [RootFolder(path.parent / step) for step in _BESIDE]


def names_of_model(model: str) -> Iterator[str]:
    """Where the model of an id may lie in a folder."""
    if not NAME.fullmatch(model) or ".." in model:
        return
    for folder in ("", "objects/", "models/", "glb/"):
        yield f"{folder}{model}.glb"
        yield f"{folder}{model[0]}/{model}.glb"
        yield f"{folder}{model}/{model}.glb"


class SceneModels:
    """Reads each model once, in its file's own frame; state: those read so far."""

    def __init__(
        self, roots: list[RootFolder], library: MaterialLibrary, notes: Notes, fields: ReadFields
    ) -> None:
        self._roots, self._library, self._notes, self._fields = roots, library, notes, fields
        self._known: dict[str, tuple[Surface, ...]] = {}
        self._rows = _find_objects_csv(roots)
        self.missing: Counter[str] = Counter()  # ids without a model whose class is not known

    def item(self, one: PlacedModel, item_id: str) -> Item | None:
        """The object as an item; as a box where its model is missing; None where nothing is known."""
        row = self._rows.get(one.model)
        row_class = class_by_words(row.category) if row else None
        surfaces = self._surfaces(one.model, one.place)
        if not surfaces:
            return self._box_only(one, row, row_class, item_id)
        meshes = [mesh_of_surface(s) for s in surfaces]
        world = one.world_from_scene @ one.scene_from_model @ _scene_from_file(one, meshes)
        all_surfaces = [
            placed(m, world, name=s.name, material=s.material)
            for m, s in zip(meshes, surfaces, strict=True)
        ]
        surfaces_kept = tuple(s for s in all_surfaces if s is not None)
        if not surfaces_kept:
            self._notes.add("empty-model", one.place, f"{one.model} has no area; left out")
            return None
        row_class = row_class or GivenClass("object", OTHERPROP)
        kind = ItemKind.OBJECT if row_class.kind in _STRUCTURE else row_class.item_kind
        name = row.category if row else one.model
        item = Item(
            id=item_id,
            name=name.replace("_", " "),
            kind=kind,
            level_id="0",
            surfaces=surfaces_kept,
            nyu40=row_class.nyu40,
            source_class=f"{one.source}.{one.model}",
            box=oriented_box(meshes, world),
            tags=("mirrored",) if np.linalg.det(world[:3, :3]) < 0 else (),
        )
        return replace(item, lights=(assumed_light(item),)) if kind is ItemKind.LAMP else item

    def _box_only(
        self, placed: PlacedModel, row: _Row | None, cls: GivenClass | None, item_id: str
    ) -> Item | None:
        name = NYU40_NAMES[cls.nyu40] if cls and 0 <= cls.nyu40 < len(NYU40_NAMES) else ""
        size = (row.size if row else None) or _usual_sizes().get(name)
        if row is None or size is None:
            self.missing[placed.model] += 1
            return None
        world = placed.world_from_scene @ placed.scene_from_model
        # The scene's axes as a model has them: to the right, up, to the front.
        up, front = (v / np.linalg.norm(v) for v in (placed.up, placed.front))
        columns = world[:3, :3] @ np.stack([np.cross(up, front), up, front], 1)
        unit = float(np.linalg.norm(placed.world_from_scene[:3, 0]))
        scale = np.linalg.norm(columns, axis=0) / unit
        width, height, depth = (float(s * k) for s, k in zip(size, scale, strict=True))
        x, y, z = (float(v) for v in world[:3, 3])
        turn = math.atan2(float(columns[0, 2]), float(columns[2, 2]))
        return box_only_item(
            item_id,
            "hssd",
            row.category,
            (x, y + height / 2, z),
            (width, height, depth),
            turn,
            is_front_given=True,
        )

    def _surfaces(self, model: str, place: str) -> tuple[Surface, ...]:
        if model not in self._known:
            self._known[model] = self._read(model, place)
        return self._known[model]

    def _read(self, model: str, place: str) -> tuple[Surface, ...]:
        for root in self._roots:
            for name in names_of_model(model):
                data = root.read(name, max_bytes=MAX_SCENE_BYTES)
                if data is None:
                    continue
                try:
                    return self._parsed(data, name)
                except BadHouse as error:
                    self._notes.add("unreadable-model", place, f"{error.message}; left out")
                    return ()
        return ()

    def _parsed(self, data: bytes, name: str) -> tuple[Surface, ...]:
        gltf = gltf_document(data, name, lambda _name: None)
        model_notes = Notes(name, strict=False)
        materials = SceneMaterials(gltf, lambda _name: None, model_notes)
        items = list(items_of_scene(gltf, Mapping(), materials, model_notes, self._fields))
        for note in model_notes.all():
            if note.kind not in HARMLESS and note.kind != "outer-side":
                self._notes.add(note.kind, f"{name} {note.place}", note.text)
        numbers = self._library.adopted(materials.library)
        return tuple(replace(s, material=numbers[s.material]) for i in items for s in i.surfaces)


_STRUCTURE: Final = ("wall", "floor", "ceiling", "none", "opening-reveal")


def _scene_from_file(placed: PlacedModel, meshes: list[Mesh]) -> F64:
    """(4, 4) the scene's axes and units <- a GLB's: aligned, scaled, then centred as its source says."""
    up = placed.up if placed.asset.align.up is None else placed.asset.align.up
    front = placed.front if placed.asset.align.front is None else placed.asset.align.front
    lengths = [float(np.linalg.norm(v)) for v in (up, front)]
    matrix = np.eye(4)
    if min(lengths) > 1e-9 and abs(up @ front) < 1e-3 * lengths[0] * lengths[1]:
        up, front = up / lengths[0], front / lengths[1]
        matrix[:3, :3] = np.stack([np.cross(up, front), up, front], 1) / placed.asset.scale
    if placed.asset.centre is not None:
        points = np.concatenate([m.positions for m in meshes]) @ matrix[:3, :3].T
        low, high = points.min(0), points.max(0)
        matrix[:3, 3] = -(low + placed.asset.centre * (high - low))
    return matrix


@cache
def _usual_sizes() -> dict[str, tuple[float, float, float]]:
    """Width, height, depth by class of items without a model and a size, metres."""
    return {
        row["class"]: (float(row["width"]), float(row["height"]), float(row["depth"]))
        for row in rows_of_table("usual_sizes.csv", "scenestate")
    }


def _find_objects_csv(roots: list[RootFolder]) -> dict[str, _Row]:
    """The rows of objects.csv by id."""
    for root in roots:
        for name in HSSD_TABLES:
            try:
                data = root.read(name, max_bytes=_MAX_TABLE_BYTES)
            except BadHouse:
                data = None
            if data is not None:
                return _parse_objects_csv(data)
    return {}


def _parse_objects_csv(data: bytes) -> dict[str, _Row]:
    rows: dict[str, _Row] = {}
    with suppress(csv.Error):
        for uid, category, size in hssd_rows(data):
            if category:
                rows[uid] = _Row(category, _parse_size_cm(size))
    return rows


def _parse_size_cm(text: str) -> tuple[float, float, float] | None:
    """Width, height, depth in metres of centimetres written with commas."""
    try:
        width, depth, height = (float(v) / 100 for v in text.replace("\\", "").split(","))
    except ValueError:
        return None
    fits = all(0.005 < v < 20 for v in (width, depth, height))
    return (width, height, depth) if fits else None
