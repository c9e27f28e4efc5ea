"""An OBJ with its material libraries, or an STL, as a glTF document. Effects: reads libraries."""

from __future__ import annotations

import math
import posixpath
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any, Final
from urllib.parse import quote

import numpy as np

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.frames import linear_from_srgb
from pbrs_farm.formats.glb import Gltf
from pbrs_farm.read.common.source_files import RootFolder, SourceFiles, read_mtl
from pbrs_farm.read.gltf.scene_writer import SceneWriter, matrix_row
from pbrs_farm.read.mesh.mtl import ObjMaterial, laid
from pbrs_farm.read.mesh.obj import Mesh, parse_obj
from pbrs_farm.read.mesh.stl import parse_stl

_GIVEN: Final = "given"  # name of the material of a model without materials
_MTLLIB: Final = re.compile(rb"^mtllib[ \t]+(.+?)\s*$", re.MULTILINE)


def gltf_of_mesh(
    data: bytes, folder: RootFolder, name: str, max_triangles: int, rgba: Sequence[float] | None
) -> Gltf:
    """One-node document of an OBJ or STL, in rgba (sRGB) without materials; BadHouse as their parsers."""
    meshes: tuple[Mesh, ...]
    if name.lower().endswith(".stl"):
        meshes, mtl = (parse_stl(data, name, max_triangles=max_triangles),), {}
    else:
        model = parse_obj(data, name, max_triangles=max_triangles)
        meshes, mtl = model.meshes, materials_of_obj(model.mtllibs, folder, name)
    if rgba is not None and not mtl:
        red, green, blue, opacity = map(float, rgba)
        mtl = {_GIVEN: ObjMaterial(_GIVEN, (red, green, blue), d=opacity)}
        meshes = tuple(replace(mesh, material=_GIVEN) for mesh in meshes)
    return gltf_of_groups([("", meshes)], mtl, np.eye(4), name)


def files_of_obj(data: bytes, folder: RootFolder, name: str, files: SourceFiles) -> set[str]:
    """Names below the root of an OBJ's material libraries and their pictures."""
    references = [line.decode("utf-8", "replace") for line in _MTLLIB.findall(data)]
    libraries = _libraries(references, folder, name)
    return {*libraries, *(p for library in libraries for p in files.pictures(folder, library))}


def materials_of_obj(
    references: Sequence[str], folder: RootFolder, name: str
) -> dict[str, ObjMaterial]:
    """The materials of all libraries by name, the first of each name; {} without a library."""
    materials: dict[str, ObjMaterial] = {}
    for library in _libraries(references, folder, name):
        for material in read_mtl(folder, library) or ():
            materials.setdefault(material.name, material)
    return materials


def _libraries(references: Sequence[str], folder: RootFolder, name: str) -> list[str]:
    """Names below the root; a line may name several. Without a line, the library of the model's name."""
    parent, stem = posixpath.split(name.rpartition(".")[0])
    libraries = []
    for line in references or [f"{stem}.mtl"]:
        whole = folder.name_from(parent, line)
        is_one = folder.path(whole) is not None
        libraries += [whole] if is_one else [folder.name_from(parent, w) for w in line.split()]
    return list(dict.fromkeys(libraries))


def gltf_of_groups(
    groups: Iterable[tuple[str, Sequence[Mesh]]],
    mtl: Mapping[str, ObjMaterial],
    matrix: F64,
    file: str,
) -> Gltf:
    """The document of groups, each with its name, below a node that turns and scales them."""
    scene = SceneWriter(file)
    images: list[dict[str, str]] = []
    numbers = {name: k for k, name in enumerate(mtl)}
    scene.materials += [_material(m, images) for m in mtl.values()]
    for name, parts in groups:
        primitives = []
        for part in parts:
            mesh = laid(part, mtl.get(part.material))
            uvs = None if mesh.uvs is None else mesh.uvs * (1, -1) + (0, 1)
            attributes = scene.add_attributes(mesh.positions, mesh.normals, uvs)
            number = numbers.get(mesh.material)
            primitives.append(scene.primitive(attributes, mesh.faces.astype(np.int64), number))
        scene.nodes.append({"name": name, "mesh": len(scene.meshes)})
        scene.meshes.append({"primitives": primitives})
    root = len(scene.nodes)
    scene.nodes.append({"children": list(range(root)), "matrix": matrix_row(matrix)})
    textures = [{"source": k} for k in range(len(images))]
    return scene.gltf(root, images=images, textures=textures)


def _material(material: ObjMaterial, images: list[dict[str, str]]) -> dict[str, Any]:
    """A material of glTF; its picture is added to images."""
    colour = linear_from_srgb(np.asarray(material.kd, np.float64)).tolist()
    shading: dict[str, Any] = {
        "baseColorFactor": [*(colour if not material.map_kd else (1.0, 1.0, 1.0)), material.d],
        "metallicFactor": 0.0,
        "roughnessFactor": float(np.clip(math.sqrt(2 / (material.ns + 2)), 0.05, 1.0)),
    }
    if material.map_kd:
        shading["baseColorTexture"] = {"index": len(images)}
        images.append({"uri": quote(material.map_kd)})
    blended = {"alphaMode": "BLEND"} if material.d < 1 else {}
    return {"name": material.name, "pbrMetallicRoughness": shading} | blended
