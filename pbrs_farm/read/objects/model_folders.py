"""Lists the single models below a folder, and picks some at random. Effect: lists folders, reads
the catalogue of furniture libraries (.sh3f).

Layouts: ShapeNet's `<synset>/<model id>/models/model_normalized.obj` (or `<model id>/model.obj`),
`<category>/<name>.obj|.glb`, `<category>/<name>/<any>.obj|.glb`, and Sweet Home 3D libraries.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Final

from pbrs_farm.core import keys
from pbrs_farm.core.classes import NYU40_NAMES, OTHERPROP
from pbrs_farm.core.errors import BadInput
from pbrs_farm.read.catalogue.library_files import (
    FURNITURE,
    numbered_entries,
    opened_archive,
    parse_properties,
)
from pbrs_farm.read.common.furniture_classes import nyu40_of, rows_of_table

_MODEL_SUFFIXES: Final = (".obj", ".glb", ".gltf")
_PLAIN_FOLDERS: Final = ("models", "")  # ShapeNet's, that say nothing
_MAX_CATALOGUE_BYTES: Final = 16_000_000  # unpacked


@dataclass(frozen=True, slots=True)
class ObjectModel:
    """One model that can be read."""

    id: str  # unique, fit for a key
    name: str
    category: str  # ShapeNet class or folder
    nyu40: int
    path: Path  # the file, or its library
    root: Path  # where its textures lie
    entry: str = ""  # its name in a library
    size_m: tuple[float, float, float] | None = None  # width, height, depth; None = unscaled
    attribution: str = ""


def find_models(paths: Sequence[Path]) -> list[ObjectModel]:
    """Every model below the paths (folders, model files, .sh3f libraries), in order of id.

    Raises BadInput for a path that does not exist, holds no model or is a damaged library.
    """
    models_by_id: dict[str, ObjectModel] = {}
    for path in paths:
        models = _models_at(path)
        if not models:
            raise BadInput(path, "", "no model found", hint="supported: OBJ, GLB, .sh3f")
        for model in models:
            models_by_id[model.id] = model
    return [models_by_id[name] for name in sorted(models_by_id)]


def pick_models(
    models: Sequence[ObjectModel], categories: Sequence[str], count: int, seed: int
) -> list[ObjectModel]:
    """count models at random (all when there are fewer) of the named categories (all when none).

    A category is a ShapeNet class or synset id, a folder's name or an NYU40 class; BadInput where
    no model has it. The choice depends on seed and ids alone: more models do not reorder the others.
    """
    # Refuse a category that no model has: a slip would give nothing, silently.
    names = [c.strip().lower() for c in categories if c.strip()]
    for category in names:
        if not any(_is_of(model, category) for model in models):
            raise BadInput("models", category, "no model of this category")
    chosen = [m for m in models if not names or any(_is_of(m, c) for c in names)]
    # Sort by a hash of seed and id: a random order, independent of the other models.
    chosen.sort(key=lambda m: hashlib.sha256(f"{seed}/{m.id}".encode()).digest())
    return chosen[:count]


def _is_of(model: ObjectModel, category: str) -> bool:
    synset = {row["synset"]: row["name"] for row in _synsets()}.get(category, category)
    return synset in (model.category.lower(), NYU40_NAMES[model.nyu40])


def _models_at(path: Path) -> list[ObjectModel]:
    if not path.exists():
        raise BadInput(path, "", "no such file or folder")
    if path.suffix.lower() == ".sh3f":
        return _library(path)
    if path.is_file():
        return [_model(path, path.parent)] if path.suffix.lower() in _MODEL_SUFFIXES else []
    models = [
        _model(file, path)
        for file in sorted(path.rglob("*"))
        if file.suffix.lower() in _MODEL_SUFFIXES and file.is_file()
    ]
    for library in sorted(path.rglob("*.sh3f")):
        models += _library(library)
    return models


def _model(file: Path, root: Path) -> ObjectModel:
    """A model file below root: the folders say its category and its name."""
    folders = [part for part in file.relative_to(root).parts[:-1] if part not in _PLAIN_FOLDERS]
    synsets = {row["synset"]: row for row in _synsets()}
    # A synset among the folders makes it ShapeNet: class, then the model's id.
    synset = next((synsets[f] for f in folders if f in synsets), None)
    if synset is not None:
        after = folders[folders.index(synset["synset"]) + 1 :]
        name = after[0] if after else file.stem
        nyu40 = NYU40_NAMES.index(synset["nyu40"])
        return ObjectModel(
            _id(synset["synset"], name),
            name,
            synset["name"],
            nyu40,
            file,
            root,
            attribution="ShapeNet",
        )
    # Elsewhere the first folder is the category, and the rest is the name.
    category = folders[0] if folders else root.name
    label = nyu40_of("", category) or nyu40_of("", file.stem) or OTHERPROP
    name = "/".join([*folders[1:], file.stem])
    return ObjectModel(_id(category, name), file.stem, category, label, file, root)


def _library(path: Path) -> list[ObjectModel]:
    """The pieces of a Sweet Home 3D library whose model is an OBJ in it."""
    archive, _sha256 = opened_archive(path)
    data = archive.read(FURNITURE)
    if data is None:
        raise BadInput(path, "", f"is not a furniture library: no {FURNITURE} in it")
    if len(data) > _MAX_CATALOGUE_BYTES:
        raise BadInput(path, FURNITURE, "the catalogue is too large")
    rows, names = numbered_entries(parse_properties(data)), set(archive.names())
    return [m for row in rows if (m := _model_of_row(path, row, names)) is not None]


def _model_of_row(path: Path, row: dict[str, str], names: set[str]) -> ObjectModel | None:
    entry = row.get("model", "").lstrip("/")
    if entry not in names or not entry.lower().endswith(".obj"):
        return None
    # Sizes are in centimetres; a piece without them is no piece of furniture.
    try:
        width, height, depth = (float(row[key]) * 0.01 for key in ("width", "height", "depth"))
    except (KeyError, ValueError):
        return None
    title = row.get("name", entry)
    return ObjectModel(
        id=_id(path.stem, row.get("id", entry)),
        name=title,
        category=row.get("category", ""),
        nyu40=nyu40_of("", title) or OTHERPROP,
        path=path,
        root=path.parent,
        entry=entry,
        size_m=(width, height, depth) if min(width, height, depth) > 0 else None,
        attribution=row.get("creator", ""),
    )


def _id(category: str, name: str) -> str:
    """`<slugs>-<6 hex>`: readable, and unique for different names."""
    return f"{keys.slug(f'{category} {name}')}-{keys.sha256(f'{category}/{name}'.encode())[:6]}"


@cache
def _synsets() -> tuple[dict[str, str], ...]:
    return tuple(rows_of_table("shapenet-synsets.csv", "objects"))
