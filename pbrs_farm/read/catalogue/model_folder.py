"""Read folders of OBJ and GLB models as pieces, classified by a table or by the folders' names.

Thousands of models are indexed once: the index is stored under the names, sizes and times of the
folder's files. Effects: reads the models to measure them; reads and writes the store.
"""

from __future__ import annotations

import hashlib
import json
import struct
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, Final

import numpy as np
from pydantic import TypeAdapter

from pbrs_farm.assets.debian import write_whole
from pbrs_farm.core import keys
from pbrs_farm.core.catalogue import Piece, Place, Shape
from pbrs_farm.core.classes import NYU40_NAMES
from pbrs_farm.core.errors import BadInput, PbrsError
from pbrs_farm.core.frames import rotation_y
from pbrs_farm.core.house import House, Note
from pbrs_farm.core.recipe import ReadFields
from pbrs_farm.read.catalogue.library_shapes import MAX_TRIANGLES, fitted_shape
from pbrs_farm.read.catalogue.model_tables import ModelRow, ModelTable, Size, model_table
from pbrs_farm.read.catalogue.piece_groups import GroupRule, group_rule
from pbrs_farm.read.common.notes import Notes
from pbrs_farm.read.objects.model_folders import ObjectModel, find_models
from pbrs_farm.read.objects.single_object import read_object
from pbrs_farm.regular_files import digest_of_regular, open_regular

MOST_MODELS: Final = 50_000  # that one folder may hold: each is read once
INDEX_VERSION: Final = 1  # raised when another piece is made of the same files
_FIELDS: Final = ReadFields(max_model_triangles=MAX_TRIANGLES)
_UNITS: Final = {0.01: "centimetres", 0.001: "millimetres", 0.0254: "inches"}
_MAX_JSON_BYTES: Final = 64_000_000
_MOST_NODES: Final = 20_000  # maximum nodes of a model to visit for its bounds
# fmt: off
_FAULTS: Final = (
    PbrsError, OSError, ValueError, KeyError, TypeError, IndexError, AttributeError, RecursionError,
)
# fmt: on

FolderPiece = tuple[Piece, "partial[Shape | None]"]


@dataclass(frozen=True, slots=True)
class _Indexed:
    """Stored index entry of a model that is a piece."""

    file: str  # below the folder
    quarters: int  # turns by 90 degrees of the model to the piece's front
    piece: Piece


_Index = tuple[str, tuple[_Indexed, ...], tuple[Note, ...]]  # digest, pieces, notes
_INDEX: Final = TypeAdapter(_Index)


def model_folder(
    path: Path, notes: Notes, store: Path | None = None
) -> tuple[str, tuple[FolderPiece, ...]]:
    """(digest of all its files, the pieces) of a folder; a rejected model becomes a note.

    store: a folder to keep the index in. Raises BadInput for a folder without a model, or with more
    than MOST_MODELS.
    """
    files = {f.relative_to(path).as_posix(): f for f in sorted(path.rglob("*")) if f.is_file()}
    stored = store / f"index-{_key_of_folder(path, files)}.json" if store is not None else None
    index = _read_index(stored) if stored is not None else None
    if index is None:
        own_notes = Notes("", strict=False)
        pieces = tuple(index_models(path, own_notes))
        index = _digest_of_folder(files), pieces, own_notes.all()
        if stored is not None:
            with suppress(OSError, ValueError):
                stored.parent.mkdir(parents=True, exist_ok=True)
                write_whole(stored, _INDEX.dump_json(index))
    digest, pieces, noted = index
    for note in noted:
        notes.add(note.kind, note.place, note.text)
    return digest, tuple(_piece_of_model(path, piece, notes) for piece in pieces)


def index_models(path: Path, notes: Notes) -> list[_Indexed]:
    table = model_table(path, notes)
    entries = []
    for model in _models(path, table):
        file = model.path.relative_to(model.root).as_posix()
        entry = _indexed(model, file, table.rows.get(file, ModelRow()), notes)
        if entry is not None:
            entries.append(entry)
    return entries


def _models(path: Path, table: ModelTable) -> list[ObjectModel]:
    if table.is_whole:
        files = [path / file for file in table.rows]
        models = [ObjectModel(f.stem, f.stem, "", 0, f, path) for f in files]
        if not models:
            raise BadInput(path, "", "no model found", hint="no model of its table exists")
    else:
        models = [m for m in find_models([path]) if not m.entry]
    if len(models) > MOST_MODELS:
        raise BadInput(path, "", f"has {len(models)} models, more than {MOST_MODELS}")
    return models


def _indexed(model: ObjectModel, file: str, row: ModelRow, notes: Notes) -> _Indexed | None:
    place = f"{model.root.name}#{file.rpartition('.')[0]}"
    name = row.name or model.name.replace("_", " ")
    try:
        size = row.size or _measure_model(model)
    except _FAULTS as error:
        notes.add("unusable-model", place, f"{error}: left out")
        return None
    rule, size = _find_rule_and_size(
        name, row, model.category, _turn_size(size, row.quarters), place, notes
    )
    if rule is None:
        return None
    piece = Piece(
        id=place,
        name=name,
        group=rule.group,
        place=rule.place,
        nyu40=rule.nyu40,
        size=size,
        kind=rule.kind,
        library=model.root.name,
        creator=row.creator,
        licence=row.licence,
    )
    return _Indexed(file, row.quarters, piece)


def _find_rule_and_size(
    name: str, row: ModelRow, category: str, size: Size, place: str, notes: Notes
) -> tuple[GroupRule | None, Size]:
    """(the rule, the size in metres) of a piece; None, with a note, where none has that size."""
    if row.group and row.size is not None:
        rule = group_rule(name, "", size, group=row.group)
        if rule is None:
            notes.add("unmapped-class", place, f"no group {row.group!r}: left out")
        return rule, size
    rule = _rule_by_words(name, row, category, size)
    if rule is not None and rule.fits("", size):
        return rule, size
    # Scale a model of another unit to a usual size.
    if row.size is None:
        for unit, words in _UNITS.items():
            width, depth, height = size
            smaller = (width * unit, depth * unit, height * unit)
            smaller_rule = _rule_by_words(name, row, category, smaller)
            if smaller_rule is not None and smaller_rule.fits("", smaller):
                notes.add("other-unit", place, f"is in {words}")
                return smaller_rule, smaller
    if rule is None:
        notes.add("unmapped-class", place, f"no group for {name!r} of {_size_text(size)}: left out")
    else:
        notes.add(
            "wrong-size",
            place,
            f"{_size_text(size)} is the wrong size for {rule.group.replace('_', ' ')}: left out",
        )
    return None, size


def _rule_by_words(name: str, row: ModelRow, category: str, size: Size) -> GroupRule | None:
    """By the table's word, then the folder's, then the name's."""
    if row.group:
        return group_rule(name, "", size, group=row.group)
    if row.label:
        # A data set's category is more specific than the class derived from it.
        words = group_rule(name, "", size)
        if words is not None and (row.label not in NYU40_NAMES or _is_of(words, row.label)):
            return words
        return group_rule(name, "", size, group=row.label) or words
    return group_rule(name, "", size, group=category) or group_rule(name, "", size)


def _is_of(rule: GroupRule, label: str) -> bool:
    return NYU40_NAMES[rule.nyu40] == label


def _size_text(size: Size) -> str:
    return " x ".join(f"{v:.3g}" for v in size) + " m"


def _turn_size(size: Size, quarters: int) -> Size:
    width, depth, height = size
    return (depth, width, height) if quarters % 2 else size


def _measure_model(model: ObjectModel) -> Size:
    bounds = _bounds_of_glb(model.path) if model.path.suffix.lower() == ".glb" else None
    low, high = read_object(model, _FIELDS).items[0].bounds if bounds is None else bounds
    width, height, depth = (float(v) for v in np.maximum(high - low, 1e-4))
    if not all(np.isfinite((width, height, depth))):
        raise ValueError("a coordinate is not finite")
    return width, depth, height


def _bounds_of_glb(path: Path) -> Any:
    """(2, 3) box of a GLB from its accessors' bounds (larger under oblique nodes); None without them."""
    with open_regular(path) as stream:
        head = stream.read(20)
        if len(head) < 20 or head[:4] != b"glTF" or head[16:20] != b"JSON":
            return None
        (length,) = struct.unpack_from("<I", head, 12)
        if length > _MAX_JSON_BYTES:
            return None
        scene = json.loads(stream.read(length))
    nodes = scene.get("nodes", [])
    if any({"matrix", "rotation", "skin"} & node.keys() for node in nodes):
        return None
    used = scene.get("extensionsRequired", [])
    if {"KHR_mesh_quantization", "EXT_mesh_gpu_instancing"} & set(used):
        return None
    roots = scene["scenes"][scene.get("scene", 0)]["nodes"]
    corners, waiting = [], [(k, np.zeros(3), np.ones(3)) for k in roots]
    for _ in range(_MOST_NODES):
        if not waiting:
            break
        k, move, scale = waiting.pop()
        node = nodes[k]
        move = move + scale * np.array(node.get("translation", (0, 0, 0)), float)
        scale = scale * np.array(node.get("scale", (1, 1, 1)), float)
        waiting += [(child, move, scale) for child in node.get("children", ())]
        if "mesh" in node:
            for primitive in scene["meshes"][node["mesh"]]["primitives"]:
                accessor = scene["accessors"][primitive["attributes"]["POSITION"]]
                corners += [move + scale * np.array(accessor[end], float) for end in ("min", "max")]
    is_whole = corners and not waiting
    return np.array([np.min(corners, 0), np.max(corners, 0)]) if is_whole else None


def _key_of_folder(path: Path, files: dict[str, Path]) -> str:
    """Cache key from the folder's name and its files' names, sizes and times, which are cheap to query."""
    digest = hashlib.sha256(f"{INDEX_VERSION} {path.name}\n".encode())
    for name, file in files.items():
        status = file.stat()
        line = f"{name} {status.st_size} {status.st_mtime_ns}\n"
        digest.update(line.encode("utf-8", "surrogateescape"))
    return digest.hexdigest()[:32]


def _digest_of_folder(files: dict[str, Path]) -> str:
    digest = hashlib.sha256(f"{INDEX_VERSION}\n".encode())
    for name, file in files.items():
        digest.update(f"{name} {digest_of_regular(file)}\n".encode("utf-8", "surrogateescape"))
    return digest.hexdigest()


def _read_index(file: Path) -> _Index | None:
    """The stored index of a folder; None if it is missing or damaged."""
    try:
        return _INDEX.validate_json(file.read_bytes())
    except (OSError, ValueError):
        return None


def _piece_of_model(path: Path, entry: _Indexed, notes: Notes) -> FolderPiece:
    piece, file = entry.piece, path / entry.file
    model = ObjectModel(keys.slug(file.stem), piece.name, piece.group, piece.nyu40, file, path)
    return piece, partial(_shape, model, piece, entry.quarters, notes)


def _shape(model: ObjectModel, piece: Piece, quarters: int, notes: Notes) -> Shape | None:
    width, depth, height = _turn_size(piece.size, quarters)
    try:
        house = read_object(replace(model, size_m=(width, height, depth)), _FIELDS)
    except PbrsError as error:
        notes.add("unusable-model", piece.id, error.message)
        return None
    return fitted_shape(_on_base(house, piece.place, quarters), piece.place, piece.id, notes)


def _on_base(house: House, place: Place, quarters: int) -> Shape:
    # Move a single object from the origin: turn it, lift it on its base, bring its back forward.
    item = house.items[0]
    turn = np.rint(rotation_y(quarters * np.pi / 2))
    low = np.min([(s.positions @ turn.T).min(0) for s in item.surfaces], 0)
    shift = np.array([0.0, -low[1], -low[2] if place is Place.WALL else 0.0])
    surfaces = tuple(
        replace(
            s,
            positions=(s.positions @ turn.T + shift).astype(np.float32),
            normals=None if s.normals is None else (s.normals @ turn.T).astype(np.float32),
        )
        for s in item.surfaces
    )
    return Shape(surfaces, house.materials, house.textures)
