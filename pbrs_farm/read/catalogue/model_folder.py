"""Folders of OBJ and GLB models -> pieces; a table or the folders' names say what they are.

`catalogue.csv` beside the models, if there: columns file, and any of name, group, width, depth,
height (cm), creator, licence. Effects: reads the models, to measure them.
"""

from __future__ import annotations

import csv
import hashlib
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Final

import numpy as np

from pbrs_farm.core.catalogue import Piece, Place, Shape
from pbrs_farm.core.errors import BadInput, PbrsError
from pbrs_farm.core.house import House
from pbrs_farm.core.recipe import ReadFields
from pbrs_farm.read.catalogue.library_files import LibraryNotes
from pbrs_farm.read.catalogue.library_shapes import MAX_TRIANGLES, fitted_shape
from pbrs_farm.read.catalogue.piece_groups import GroupRule, Size, group_rule
from pbrs_farm.read.objects.model_folders import ObjectModel, find_models
from pbrs_farm.read.objects.single_object import read_object
from pbrs_farm.regular_files import MAX_TEXT_BYTES, digest_of_regular, fault_of, read_regular

TABLE: Final = "catalogue.csv"
MOST_MODELS: Final = 2000  # that one folder may hold: each is read once
_FIELDS: Final = ReadFields(max_model_triangles=MAX_TRIANGLES)

FolderPiece = tuple[Piece, "partial[Shape | None]"]


def model_folder(path: Path, notes: LibraryNotes) -> tuple[str, tuple[FolderPiece, ...]]:
    """(digest of all its files, the pieces) of a folder; a model without a group becomes a note.

    Raises BadInput for a folder without a model, or with more than MOST_MODELS.
    """
    models = [m for m in find_models([path]) if not m.entry]
    if len(models) > MOST_MODELS:
        raise BadInput(path, "", f"holds {len(models)} models, at most {MOST_MODELS} are read")
    table = _table(path, notes)
    found = []
    for model in models:
        file = model.path.relative_to(model.root).as_posix()
        piece = _piece(model, path.name, file, table.get(file, {}), notes)
        if piece is not None:
            found.append(piece)
    return _digest(path), tuple(found)


def _piece(
    model: ObjectModel, library: str, file: str, row: Mapping[str, str], notes: LibraryNotes
) -> FolderPiece | None:
    piece_id = f"{library}#{file.rpartition('.')[0]}"
    try:
        size = _size_m(row) or _measured(model)
    except (PbrsError, ValueError) as error:
        notes.add("unusable-model", piece_id, f"{error}: left out")
        return None
    name = row.get("name") or model.name.replace("_", " ")
    rule = _rule(name, row.get("group", ""), model.category, size)
    if rule is None:
        notes.add("unmapped-class", piece_id, f"no group for {name!r}: left out")
        return None
    piece = Piece(
        id=piece_id, name=name, group=rule.group, place=rule.place, nyu40=rule.nyu40, size=size,
        kind=rule.kind, library=library, creator=row.get("creator", ""),
        licence=row.get("licence", ""),
    )  # fmt: skip
    return piece, partial(_shape, model, piece, rule.place, notes)


def _rule(name: str, group: str, category: str, size: Size) -> GroupRule | None:
    # The table's word, then the folder's, then the name's.
    if group:
        return group_rule(name, "", size, group=group)
    return group_rule(name, "", size, group=category) or group_rule(name, "", size)


def _size_m(row: Mapping[str, str]) -> Size | None:
    written = [row.get(key) or "" for key in ("width", "depth", "height")]
    if not any(written):
        return None
    width, depth, height = (float(text) / 100 for text in written)
    if not (0 < width < 50 and 0 < depth < 50 and 0 < height < 50):
        raise ValueError("a size is not between 0 and 50 m")
    return width, depth, height


def _measured(model: ObjectModel) -> Size:
    low, high = read_object(model, _FIELDS).items[0].bounds
    width, height, depth = (float(v) for v in np.maximum(high - low, 1e-4))
    return width, depth, height


def _shape(model: ObjectModel, piece: Piece, place: Place, notes: LibraryNotes) -> Shape | None:
    width, depth, height = piece.size
    try:
        house = read_object(replace(model, size_m=(width, height, depth)), _FIELDS)
    except PbrsError as error:
        notes.add("unusable-model", piece.id, error.message)
        return None
    return fitted_shape(_on_base(house, place), place, piece.id, notes)


def _on_base(house: House, place: Place) -> Shape:
    # A single object stands about the origin: lift it on its base, bring its back forward.
    item = house.items[0]
    low, _ = item.bounds
    shift = np.array([0.0, -low[1], -low[2] if place is Place.WALL else 0.0])
    surfaces = tuple(
        replace(s, positions=(s.positions + shift).astype(np.float32)) for s in item.surfaces
    )
    return Shape(surfaces, house.materials, house.textures)


def _table(path: Path, notes: LibraryNotes) -> dict[str, dict[str, str]]:
    file = path / TABLE
    if not file.exists():
        return {}
    try:
        text = read_regular(file, MAX_TEXT_BYTES).decode("utf-8-sig")
        rows = list(csv.DictReader(text.splitlines()))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        why = fault_of(error) if isinstance(error, OSError) else str(error)
        notes.add("damaged-table", TABLE, why)
        return {}
    if rows and "file" not in rows[0]:
        notes.add("damaged-table", TABLE, "has no column `file`")
        return {}
    return {row["file"]: {k: (v or "").strip() for k, v in row.items() if k} for row in rows}


def _digest(path: Path) -> str:
    digest = hashlib.sha256()
    for file in sorted(path.rglob("*")):
        if file.is_file():
            line = f"{file.relative_to(path).as_posix()} {digest_of_regular(file)}\n"
            digest.update(line.encode())
    return digest.hexdigest()
