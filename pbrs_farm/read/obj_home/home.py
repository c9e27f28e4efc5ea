"""An OBJ with named groups -> House. Effects: reads the file, its materials and pictures.

Groups are brought to the reader of glTF as nodes. An OBJ has neither a unit nor an up axis: both
follow from the height of the walls and the thinnest side of the floors.
"""

from __future__ import annotations

import math
import re
from typing import Final

import numpy as np

from pbrs_farm.core import keys
from pbrs_farm.core.arrays import F64
from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.house import House, ItemKind, Source
from pbrs_farm.core.recipe import ReadFields
from pbrs_farm.read.common.format import GivenFile, data_of
from pbrs_farm.read.common.name_classes import class_of_node_name
from pbrs_farm.read.common.notes import Notes
from pbrs_farm.read.common.source_files import SourceFiles
from pbrs_farm.read.gltf.assembly import files_of_obj, gltf_of_groups, materials_of_obj
from pbrs_farm.read.gltf.scene import Beside, house_of_gltf
from pbrs_farm.read.mesh.obj import Mesh, parse_obj
from pbrs_farm.regular_files import MAX_SCENE_BYTES

_UNITS: Final = {"m": 1.0, "cm": 0.01, "in": 0.0254, "ft": 0.3048, "mm": 0.001}
_UNIT_COMMENT: Final = re.compile(rb"^#.*units?\s*[=:]\s*(\w+)", re.MULTILINE | re.IGNORECASE)
_WORDS: Final = {"meter": "m", "metre": "m", "centimeter": "cm", "centimetre": "cm", "millimeter": "mm",
                 "millimetre": "mm", "inch": "in", "inche": "in", "foot": "ft", "feet": "ft"}  # fmt: skip
_USUAL_WALL_M: Final = 2.6  # height
_FILLERS: Final = re.compile(r"\b(mesh|group|model|component|default|obj|object)(_?\d+)?\b", re.I)


def read_obj_home(given: GivenFile, fields: ReadFields) -> House:
    """The House of the file. Raises BadHouse naming the place, and for a model without named groups."""
    path = given.path
    folder, data = data_of(given, MAX_SCENE_BYTES)
    notes = Notes(path.name, strict=fields.strict)
    model = parse_obj(data, path.name, max_triangles=fields.max_triangles)
    groups: dict[str, list[Mesh]] = {}
    for mesh in model.meshes:
        groups.setdefault(mesh.group, []).append(mesh)
    kinds = {name: _kind_of_group(name) for name in groups}
    if not {ItemKind.WALL, ItemKind.FLOOR} <= set(kinds.values()):
        hint = "a home has groups named floor, wall, sofa ...;"
        hint += f" `pbrs-farm objects {path} --out DIR` renders single models"
        raise BadHouse(
            str(path), "", "is a model, not a home: no groups named floor and wall", hint=hint
        )
    mtl = materials_of_obj(model.mtllibs, folder, path.name)
    walls = [m for name, ms in groups.items() if kinds[name] is ItemKind.WALL for m in ms]
    floors = [m for name, ms in groups.items() if kinds[name] is ItemKind.FLOOR for m in ms]
    matrix, guess = _world_from_file(data, walls, floors)
    if guess:
        notes.add("assumed-unit", path.name, guess)
    # Words that modelling programs add are left out of names.
    named = [(_FILLERS.sub(" ", name).strip() or name, ms) for name, ms in groups.items()]
    source = Source("obj-home", path.name, keys.sha256(data))
    return house_of_gltf(
        gltf_of_groups(named, mtl, matrix, path.name),
        source,
        path.stem,
        fields,
        notes,
        Beside(lambda name: folder.read(name, max_bytes=MAX_SCENE_BYTES)),
    )


def companions_of_obj_home(given: GivenFile, files: SourceFiles) -> str:
    """Digest of the material libraries and their pictures; "" if there are none."""
    folder, data = data_of(given, MAX_SCENE_BYTES)
    return files.digest(folder, files_of_obj(data, folder, given.path.name, files))


def _kind_of_group(name: str) -> ItemKind | None:
    named = class_of_node_name(_FILLERS.sub(" ", name))
    return named.kind if named else None


def _world_from_file(data: bytes, walls: list[Mesh], floors: list[Mesh]) -> tuple[F64, str]:
    """(4, 4) to metres with y up, and a sentence about the unit if the file states none."""
    # Floors are flat across the up axis.
    _, flat_y, flat_z = np.sum([np.ptp(m.positions, axis=0) for m in floors], axis=0)
    up = 2 if flat_z < flat_y else 1
    height = max(max(float(np.ptp(m.positions, axis=0)[up]) for m in walls), 1e-9)
    comment = _UNIT_COMMENT.search(data[:4096])
    word = comment[1].decode("ascii", "replace").lower() if comment else ""
    unit, guess = _WORDS.get(word.removesuffix("s"), word), ""
    if unit not in _UNITS:
        unit = min(_UNITS, key=lambda u: abs(math.log(height * _UNITS[u] / _USUAL_WALL_M)))
        guess = f"states no unit; walls {height:.3g} high are read in {unit}"
    matrix = np.diag([_UNITS[unit]] * 3 + [1.0])
    if up == 2:
        matrix[:3, :3] = matrix[:3, :3] @ [[1, 0, 0], [0, 0, 1], [0, -1, 0]]
    return matrix, guess
