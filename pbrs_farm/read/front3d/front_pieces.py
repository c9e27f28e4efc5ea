"""Furniture and lamps of a 3D-FRONT house. Effect: reads 3D-FUTURE's models and model_info.json."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from pbrs_farm.core.arrays import F64, triple
from pbrs_farm.core.classes import LAMP, OTHERPROP
from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.house import Item, ItemKind, LightPart, MaterialKind
from pbrs_farm.core.lighting import BULB_RADIUS_M, PowerUnit
from pbrs_farm.core.mesh import area_vectors
from pbrs_farm.core.recipe import ReadFields
from pbrs_farm.home.lamps import flux_for_floor
from pbrs_farm.read.common.given_classes import (
    GivenClass,
    box_only_item,
    class_by_words,
    given_class,
)
from pbrs_farm.read.common.json_values import NAME
from pbrs_farm.read.common.model_materials import (
    DamagedModel,
    ModelCache,
    ModelMaterials,
    ParsedModel,
)
from pbrs_farm.read.common.notes import Notes
from pbrs_farm.read.common.placed_mesh import assumed_light, oriented_box, placed
from pbrs_farm.read.common.source_files import RootFolder
from pbrs_farm.read.front3d.front_file import FrontLight, FrontPiece
from pbrs_farm.read.front3d.front_openings import is_opening
from pbrs_farm.read.mesh.obj import Mesh

_MAX_INFO_BYTES: Final = 64_000_000
_BESIDE: Final = ("3D-FUTURE-model", "../3D-FUTURE-model", "../../3D-FUTURE-model", ".")
INFO: Final = "model_info.json"
_LUX: Final = 150.0  # illuminance that the listed lights of a room give its floor together
_LEAST_LM, _MOST_LM = 50.0, 3_000.0
_BELOW_M: Final = 0.08  # a light listed inside the ceiling shines below it
_FLAT_M: Final = 0.002
_STRUCTURE: Final = ("wall", "floor", "ceiling")
# Linear colour of a black body, by kelvin.
_KELVIN: Final = (2000.0, 2700.0, 4000.0, 5000.0, 6500.0)
_RGB: Final = ((1, 0.26, 0.01), (1, 0.42, 0.12), (1, 0.66, 0.39), (1, 0.81, 0.64), (1, 0.97, 0.97))


def model_folder(path: Path, models: str) -> RootFolder | None:
    """The folder of 3D-FUTURE's models: the given one, else beside or above the house."""
    if models:
        below = Path(models) / "3D-FUTURE-model"
        return RootFolder(below if below.is_dir() else Path(models))
    return next(
        (
            RootFolder(path.parent / b)
            for b in _BESIDE
            if (path.parent / b / INFO).is_file() or (b != "." and (path.parent / b).is_dir())
        ),
        None,
    )


def files_of_model(jid: str) -> Iterator[str]:
    """Files that reading a model may open."""
    if NAME.fullmatch(jid) and ".." not in jid:
        yield from (f"{jid}/{n}" for n in ("raw_model.obj", "model.mtl", "texture.png"))


class FrontModels:
    """Classes and models of pieces; state: a cache of models, and the missing ones."""

    def __init__(
        self, folder: RootFolder | None, materials: ModelMaterials, notes: Notes, fields: ReadFields
    ) -> None:
        self._folder, self._materials, self._notes = folder, materials, notes
        self._cache = None if folder is None else ModelCache(folder, notes, fields)
        self._info = {} if folder is None else _info(folder)
        self.n_missing = 0

    def item(self, piece: FrontPiece, item_id: str) -> Item | None:
        """The piece as an item, as a box if its model is missing; None if it is not drawn."""
        if is_opening(piece):
            return None
        vocabulary, name, piece_class = self._class(piece)
        if piece_class.kind == "none":
            return None
        model = self._model(piece)
        if model is None:
            return self._box_only(piece, vocabulary, name, piece_class, item_id)
        surfaces = []
        for mesh, slot in zip(model.meshes, model.slots, strict=True):
            mtl = model.mtl[slot] if slot >= 0 else None
            material = self._materials.material(
                mtl, None, place=piece.place, clear=MaterialKind.GLASS
            )
            index = self._materials.library.index(material)
            surface = placed(
                mesh, piece.world_from_model, name=mesh.material or "grey", material=index
            )
            surfaces += [surface] if surface is not None else []
        if not surfaces:
            return self._box_only(piece, vocabulary, name, piece_class, item_id)
        is_trim = piece_class.kind in _STRUCTURE
        kind = ItemKind.OBJECT if is_trim else piece_class.item_kind
        tags = ["mirrored"] if np.linalg.det(piece.world_from_model[:3, :3]) < 0 else []
        item = Item(
            id=item_id,
            name=name.rpartition("/")[2] or "piece",
            kind=kind,
            level_id="0",
            surfaces=tuple(surfaces),
            nyu40=max(piece_class.nyu40, 0),
            source_class=name,
            room_id=piece.room,
            box=oriented_box(model.meshes, piece.world_from_model),
            tags=(*tags, *(["structure"] if is_trim else [])),
        )
        return replace(item, lights=(assumed_light(item),)) if kind is ItemKind.LAMP else item

    def _class(self, piece: FrontPiece) -> tuple[str, str, GivenClass]:
        """(vocabulary, name, class) by category, title, super category, the words of the title."""
        info = self._info.get(piece.jid, {})
        names = [
            ("3dfuture", str(info.get("category") or "")),
            ("3dfuture", piece.category),
            ("3dfront-title", piece.title),
            ("3dfuture-super", str(info.get("super-category") or "")),
        ]
        for vocabulary, name in names:
            name_class = given_class(vocabulary, name) if name else None
            if name_class is not None:
                return vocabulary, name, name_class
        name = piece.title or piece.category
        name_class = class_by_words(name.rpartition("/")[2], name) if name else None
        return "", name or "unknown", name_class or GivenClass("object", OTHERPROP)

    def _model(self, piece: FrontPiece) -> ParsedModel | None:
        if self._cache is None or not NAME.fullmatch(piece.jid) or ".." in piece.jid:
            return None
        try:
            model = self._cache.model(f"{piece.jid}/raw_model.obj", f"{piece.jid}/model.mtl")
        except DamagedModel as error:
            self._notes.add(
                "unreadable-model", piece.place, f"{error.message}; replaced by a stand-in"
            )
            return None
        return None if model is None else _without_shadow(model)

    def _box_only(
        self, piece: FrontPiece, vocabulary: str, name: str, item_class: GivenClass, item_id: str
    ) -> Item | None:
        self.n_missing += 1
        if piece.size is None or item_class.kind in _STRUCTURE:
            return None
        size = np.array(piece.size) * np.abs(piece.scale)
        centre = piece.world_from_model[:3, 3] + np.array([0.0, size[1] / 2, 0.0])
        front = piece.world_from_model[:3, 2] * np.sign(piece.scale[2])
        turn = math.atan2(float(front[0]), float(front[2]))
        return box_only_item(
            item_id,
            vocabulary,
            name,
            triple(centre),
            triple(size),
            turn,
            is_front_given=True,
            room_id=piece.room,
        )


def _info(folder: RootFolder) -> dict[str, dict[str, Any]]:
    try:
        data = folder.read(INFO, max_bytes=_MAX_INFO_BYTES)
        rows = json.loads(data) if data else []
    except (BadHouse, ValueError, RecursionError):
        return {}
    rows = rows if isinstance(rows, list) else []
    return {str(r["model_id"]): r for r in rows if isinstance(r, dict) and "model_id" in r}


def _without_shadow(model: ParsedModel) -> ParsedModel:
    """The model without the flat card that imitates its shadow."""
    if len(model.meshes) < 2:
        return model
    low = min(float(m.positions[:, 1].min()) for m in model.meshes)
    shown = [k for k, m in enumerate(model.meshes) if not _is_card(m, low)]
    if not shown or len(shown) == len(model.meshes):
        return model
    return ParsedModel(
        tuple(model.meshes[k] for k in shown), tuple(model.slots[k] for k in shown), model.mtl
    )


def _is_card(mesh: Mesh, low: float) -> bool:
    if len(mesh.faces) > 4 or float(mesh.positions[:, 1].max()) > low + _FLAT_M:
        return False
    n = area_vectors(mesh.positions[mesh.faces])
    return bool((np.abs(n[:, 1]) > 0.99 * np.linalg.norm(n, axis=1)).all())


def light_items(
    lights: Sequence[FrontLight],
    items: Sequence[Item],
    areas: dict[str, float],
    ceilings: dict[str, float],
) -> list[Item]:
    """An invisible lamp for every listed light without a lamp item.

    areas, ceilings: square metres and height by room. The lights of a room share the flux that gives its
    floor 150 lx; a light inside the ceiling hangs below it, and duplicates are merged.
    """
    lamps = [
        i.oriented_box.centre for i in items if i.kind is ItemKind.LAMP and (i.surfaces or i.box)
    ]
    unlisted: list[FrontLight] = []
    for light in lights:
        near = [p for p in lamps if np.linalg.norm((p - light.at)[[0, 2]]) < 0.3]
        is_listed = any(np.linalg.norm(o.at - light.at) < 0.05 for o in unlisted)
        if light.room in areas and not near and not is_listed:
            unlisted.append(light)
    lamp_items = []
    for k, light in enumerate(unlisted):
        n = sum(o.room == light.room for o in unlisted)
        flux = float(np.clip(flux_for_floor(areas[light.room], _LUX) / n, _LEAST_LM, _MOST_LM))
        position = light.at.copy()
        position[1] = min(position[1], ceilings[light.room] - _BELOW_M)
        rgb = _rgb_of_kelvin(light.kelvin) if light.kelvin else (1.0, 1.0, 1.0)
        part = LightPart(
            triple(position),
            BULB_RADIUS_M,
            flux,
            PowerUnit.LUMEN,
            rgb_linear=rgb,
            is_coloured=bool(light.kelvin),
        )
        lamp_items.append(
            Item(
                f"light_{k}",
                "spotlight",
                ItemKind.LAMP,
                "0",
                (),
                LAMP,
                "lights",
                light.room,
                lights=(part,),
                tags=("made",),
            )
        )
    return lamp_items


def _rgb_of_kelvin(kelvin: float) -> tuple[float, float, float]:
    table: F64 = np.array(_RGB, np.float64)
    rgb = [float(np.interp(kelvin, _KELVIN, table[:, k])) for k in range(3)]
    return triple(np.array(rgb))
