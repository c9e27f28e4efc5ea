"""One model without context -> a House of one item, centred on the origin. Effects: reads the
model's file and its textures; unpacks a library's model into a temporary folder.
"""

from __future__ import annotations

import posixpath
import tempfile
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.house import Box, House, Item, ItemKind, Level, MaterialKind, Source, Surface
from pbrs_farm.core.mesh import unit_vectors
from pbrs_farm.core.recipe import ReadFields
from pbrs_farm.read.common.material_library import MaterialLibrary
from pbrs_farm.read.common.model_materials import ModelCache, ModelMaterials
from pbrs_farm.read.common.notes import Notes
from pbrs_farm.read.common.placed_mesh import placed
from pbrs_farm.read.common.source_files import RootFolder, SourceFiles
from pbrs_farm.read.gltf.document import files_of_gltf, gltf_document, note_unread
from pbrs_farm.read.gltf.materials import SceneMaterials
from pbrs_farm.read.gltf.node_classes import Mapping
from pbrs_farm.read.gltf.scene_items import items_of_scene
from pbrs_farm.read.objects.model_folders import ObjectModel
from pbrs_farm.regular_files import MAX_SCENE_BYTES, fault_of, open_regular

_MAX_UNPACKED_BYTES: Final = 500_000_000


def read_object(model: ObjectModel, fields: ReadFields) -> House:
    """The House of one model: one item, no room, no floor, its box's centre in the origin.

    y is up, as in the file; a library's piece has its catalogue's size. Raises BadHouse for a
    file that cannot be read, has no triangle or is larger than the fields allow. Lamps' light
    sources are left out: the sky alone lights an object (paper section 4.1).
    """
    file = model.entry or model.path.name
    notes = Notes(file, strict=fields.strict)
    surfaces, library, sha256 = model_surfaces(model, notes, fields)
    # Centre the model on the origin, at its catalogue's size.
    surfaces = _centred(surfaces, model.size_m)
    points = np.concatenate([s.positions for s in surfaces])
    if not np.isfinite(points).all():
        raise BadHouse(file, "", "a coordinate is not finite")
    item = Item(
        id=model.id,
        name=model.name,
        kind=ItemKind.OBJECT,
        level_id="0",
        surfaces=tuple(surfaces),
        nyu40=model.nyu40,
        source_class=model.category,
        box=Box(np.zeros(3), np.ptp(points, axis=0).astype(np.float64) / 2, np.eye(3)),
    )
    if item.n_faces > fields.max_model_triangles:
        raise BadHouse(file, "", f"has {item.n_faces} triangles", hint="read.max_model_triangles")
    return House(
        id=model.id,
        name=model.name,
        source=Source("object", file, sha256, attribution=model.attribution),
        levels=(Level("0", "", 0.0, 1.0),),
        rooms=(),
        items=(item,),
        materials=library.materials,
        textures=library.textures,
        notes=notes.all(),
    )


def model_surfaces(
    model: ObjectModel, notes: Notes, fields: ReadFields
) -> tuple[list[Surface], MaterialLibrary, str]:
    """A model's surfaces in its own frame, their materials, the digest of its files; BadHouse if unusable."""
    with _folder_of(model) as (folder, name):
        if name.lower().endswith(".obj"):
            surfaces, library = _obj(folder, name, notes, fields)
        else:
            surfaces, library = _gltf(folder, name, notes, fields)
        sha256 = folder.sha256
    if not surfaces:
        raise BadHouse(model.entry or model.path.name, "", "has no triangle")
    return surfaces, library, sha256


def object_companions(model: ObjectModel, files: SourceFiles) -> Iterator[str]:
    """Names below the root, maybe missing, of the other files of a model, up to any damage in it."""
    if model.entry:
        return  # in a furniture library, which is one file
    folder, name = RootFolder(model.root), model.path.relative_to(model.root).as_posix()
    try:
        if name.lower().endswith(".obj"):
            library = material_library(folder, name)
            yield from (library, *files.pictures(folder, library))
        else:
            data = folder.read(name, max_bytes=MAX_SCENE_BYTES) or b""
            for reference in files_of_gltf(data, name):
                yield folder.name_from(posixpath.dirname(name), reference)
    except BadHouse:
        return  # the reader reports the fault


@contextmanager
def _folder_of(model: ObjectModel) -> Iterator[tuple[RootFolder, str]]:
    """The folder that holds the model, and the model's name in it."""
    if not model.entry:
        yield RootFolder(model.root), model.path.relative_to(model.root).as_posix()
        return
    with tempfile.TemporaryDirectory(prefix="pbrs-object-") as scratch:
        place = posixpath.dirname(model.entry)
        try:
            with open_regular(model.path) as file, zipfile.ZipFile(file) as archive:
                # Unpack the model's folder alone: its materials and pictures lie beside it.
                members = [i for i in archive.infolist() if posixpath.dirname(i.filename) == place]
                if sum(i.file_size for i in members) > _MAX_UNPACKED_BYTES:
                    raise BadHouse(model.path, model.entry, "is too large unpacked")
                for member in members:
                    archive.extract(member, scratch)
        except OSError as error:
            raise BadHouse(model.path, model.entry, fault_of(error)) from None
        except (zipfile.BadZipFile, zlib.error, EOFError, ValueError, RuntimeError):
            raise BadHouse(model.path, model.entry, "cannot be unpacked: damaged") from None
        yield RootFolder(Path(scratch)), model.entry


def _obj(
    folder: RootFolder, name: str, notes: Notes, fields: ReadFields
) -> tuple[list[Surface], MaterialLibrary]:
    materials = ModelMaterials(folder, notes)
    model = ModelCache(folder, notes, fields).model(name, material_library(folder, name))
    if model is None:
        raise BadHouse(folder.root, name, "no such file")
    surfaces = []
    for mesh, slot in zip(model.meshes, model.slots, strict=True):
        mtl = model.mtl[slot] if slot >= 0 else None
        material = materials.material(mtl, None, place=name, clear=MaterialKind.GLASS)
        index = materials.library.index(material)
        surface = placed(mesh, np.eye(4), name=mesh.material, material=index)
        if surface is not None:
            surfaces.append(surface)
    return surfaces, materials.library


def material_library(folder: RootFolder, name: str) -> str:
    """The first mtllib of an OBJ (names may have spaces) below the folder, `<stem>.mtl` without one."""
    data = folder.read(name, max_bytes=MAX_SCENE_BYTES) or b""
    reference = posixpath.splitext(posixpath.basename(name))[0] + ".mtl"
    start = data.find(b"mtllib ")
    if start >= 0:
        reference = data[start + 7 :].split(b"\n", 1)[0].decode("utf-8", "replace").strip()
    return folder.name_from(posixpath.dirname(name), reference)


def _gltf(
    folder: RootFolder, name: str, notes: Notes, fields: ReadFields
) -> tuple[list[Surface], MaterialLibrary]:
    data = folder.read(name, max_bytes=MAX_SCENE_BYTES)
    if data is None:
        raise BadHouse(folder.root, name, "no such file")

    def fetch(reference: str) -> bytes | None:
        inside = folder.name_from(posixpath.dirname(name), reference)
        return folder.read(inside, max_bytes=MAX_SCENE_BYTES)

    gltf = gltf_document(data, name, fetch)
    materials = SceneMaterials(gltf, fetch, notes)
    note_unread(gltf, notes)
    items = items_of_scene(gltf, Mapping(), materials, notes, fields)
    return [surface for item in items for surface in item.surfaces], materials.library


def _centred(surfaces: list[Surface], size_m: tuple[float, float, float] | None) -> list[Surface]:
    """The surfaces moved so that their common box is centred on the origin, and scaled to size."""
    points = np.concatenate([s.positions for s in surfaces]).astype(np.float64)
    # Scale each axis to the size wanted; a flat axis keeps its extent.
    low, high = points.min(0), points.max(0)
    extent = np.where(high - low > 1e-9, high - low, 1.0)
    scale = np.ones(3) if size_m is None else np.asarray(size_m) / extent
    return [_move_and_scale(surface, (low + high) / 2, scale) for surface in surfaces]


def _move_and_scale(surface: Surface, origin: F64, scale: F64) -> Surface:
    normals = surface.normals
    if normals is not None:
        # By the inverse transpose.
        normals = unit_vectors(normals / scale).astype(np.float32)
    positions = ((surface.positions - origin) * scale).astype(np.float32)
    return replace(surface, positions=positions, normals=normals)
