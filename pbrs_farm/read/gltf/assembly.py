"""One glTF document of many assets, OBJ and STL too, for readers of scenes that place files of models. Effects: reads files."""

from __future__ import annotations

import json
import math
import posixpath
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final
from urllib.parse import quote

import numpy as np

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.frames import linear_from_srgb
from pbrs_farm.formats.glb import Gltf
from pbrs_farm.read.common.source_files import RootFolder, SourceFiles, read_mtl
from pbrs_farm.read.gltf.document import files_of_gltf, gltf_document, object_at
from pbrs_farm.read.gltf.scene_writer import SceneWriter, matrix_row
from pbrs_farm.read.mesh.mtl import ObjMaterial, laid
from pbrs_farm.read.mesh.obj import Mesh, parse_obj
from pbrs_farm.read.mesh.stl import parse_stl
from pbrs_farm.regular_files import MAX_SCENE_BYTES

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


_LIGHTS: Final = "KHR_lights_punctual"
# fmt: off
_ARRAYS: Final = ("buffers", "bufferViews", "accessors", "meshes", "materials", "textures", "images",
                  "samplers", "nodes")
# fmt: on


def files_of_asset(folder: RootFolder, name: str, files: SourceFiles) -> set[str]:
    """An asset and the buffers, material libraries and pictures outside it, as names below the folder."""
    data = folder.read(name, max_bytes=MAX_SCENE_BYTES) or b""
    if name.lower().endswith(".stl"):
        return {name}
    if name.lower().endswith(".obj"):
        return {name, *files_of_obj(data, folder, name, files)}
    parent = posixpath.dirname(name)
    return {name, *(folder.name_from(parent, uri) for uri in files_of_gltf(data, name))}


@dataclass(slots=True)
class Assembly:
    """One glTF document of all assets, each once; state: the assets added so far."""

    file: str  # name of the scene, for messages
    folder: RootFolder
    max_triangles: int
    document: dict[str, Any] = field(default_factory=dict)
    buffers: list[bytes] = field(default_factory=list)
    roots: list[int] = field(default_factory=list)
    assets: dict[str, tuple[list[int], Gltf]] = field(default_factory=dict)

    def fetch(self, name: str) -> bytes | None:
        """The bytes of a picture by its name below the root; None without the file."""
        return self.folder.read(name, max_bytes=MAX_SCENE_BYTES)

    def asset(
        self, name: str, rgba: Sequence[float] | None = None
    ) -> tuple[list[int], Gltf] | None:
        """Root nodes of a glTF, OBJ or STL (in rgba without materials), added if new; None without the file."""
        is_mesh = name.lower().endswith((".obj", ".stl"))
        key = f"{name} {rgba}" if is_mesh else name
        if key in self.assets:
            return self.assets[key]
        data = self.fetch(name)
        if data is None:
            return None
        parent = posixpath.dirname(name)
        if is_mesh:
            gltf, at = gltf_of_mesh(data, self.folder, name, self.max_triangles, rgba), ""
        else:
            gltf = gltf_document(data, name, lambda r: self.fetch(self.folder.name_from(parent, r)))
            at = parent
        self.assets[key] = (self._added(gltf, at), gltf)
        return self.assets[key]

    def added(self, key: str, gltf: Gltf) -> list[int]:
        """Root nodes of a document without pictures, added if its key is new."""
        if key not in self.assets:
            self.assets[key] = (self._added(gltf, ""), gltf)
        return self.assets[key][0]

    def _added(self, gltf: Gltf, at: str) -> list[int]:
        doc = gltf.document
        start = {key: len(self.document.setdefault(key, [])) for key in _ARRAYS}
        doc = {k: doc.get(k, []) for k in _ARRAYS} | {"scenes": doc.get("scenes", [])}
        if not all(isinstance(doc[k], list) for k in doc):
            raise BadHouse(gltf.file, "", "has invalid lists")
        copy = json.loads(json.dumps(doc))
        _shifted(copy, start)
        self._add_lights(gltf, copy["nodes"])
        for image in copy["images"]:
            uri = image.get("uri") if isinstance(image, dict) else None
            if isinstance(uri, str) and not uri.startswith("data:"):
                image["uri"] = self.folder.name_from(at, uri)
        for key in _ARRAYS:
            self.document[key] += copy[key]
        self.buffers += gltf.buffers
        scene = gltf.document.get("scene", 0)
        scenes = copy["scenes"]
        fits = type(scene) is int and 0 <= scene < len(scenes) and isinstance(scenes[scene], dict)
        nodes = scenes[scene].get("nodes", []) if fits else []
        return [n + start["nodes"] for n in nodes if type(n) is int]

    def _add_lights(self, gltf: Gltf, nodes: list[Any]) -> None:
        """Take an asset's lights, and let its nodes name them by their new numbers."""
        own_lights = object_at(object_at(gltf.document, "extensions"), _LIGHTS).get("lights")
        lights = self.document.setdefault("extensions", {_LIGHTS: {"lights": []}})[_LIGHTS][
            "lights"
        ]
        for node in nodes:
            row = (
                object_at(object_at(node, "extensions"), _LIGHTS) if isinstance(node, dict) else {}
            )
            if "light" in row:
                row["light"] = _plus(row["light"], len(lights))
        lights += own_lights if isinstance(own_lights, list) else []

    def place(self, roots: list[int], matrix: F64, name: str, extras: dict[str, Any]) -> None:
        """Put an asset's roots below a new node of the scene."""
        self.roots.append(self.node(roots, matrix, name, extras))

    def node(
        self, children: list[int], matrix: F64, name: str = "", extras: dict[str, Any] | None = None
    ) -> int:
        """The number of a new node, still without a parent, that moves some nodes."""
        row = {"name": name, "matrix": matrix_row(matrix), "children": children}
        nodes = self.document.setdefault("nodes", [])
        nodes.append(row | {"extras": extras or {}})
        return len(nodes) - 1

    def light_node(self, row: dict[str, Any], position: F64, name: str) -> int:
        """The number of a new node, still without a parent, with a light of KHR_lights_punctual."""
        empty: dict[str, Any] = {_LIGHTS: {"lights": []}}
        lights = self.document.setdefault("extensions", empty)[_LIGHTS]["lights"]
        node = {
            "name": name,
            "translation": position.tolist(),
            "extensions": {_LIGHTS: {"light": len(lights)}},
        }
        lights.append(row)
        nodes = self.document.setdefault("nodes", [])
        nodes.append(node)
        return len(nodes) - 1

    def gltf(self) -> Gltf:
        """The whole document."""
        whole = self.document | {
            "asset": {"version": "2.0"},
            "scene": 0,
            "scenes": [{"nodes": self.roots}],
        }
        return Gltf(whole, tuple(self.buffers), self.file)


# Where one entry names another by number -> the list it means.
_NUMBERS: Final = {
    "buffer": "buffers",
    "bufferView": "bufferViews",
    "mesh": "meshes",
    "material": "materials",
    "sampler": "samplers",
    "source": "images",
    "indices": "accessors",
}


def _shifted(copy: dict[str, Any], start: dict[str, int]) -> None:
    """Add to every number that names an entry the number of those before it."""
    for key in _ARRAYS:
        for row in copy[key]:
            _shift(row, start, key)


def _shift(row: Any, start: dict[str, int], where: str) -> None:
    if isinstance(row, list):
        for value in row:
            _shift(value, start, where)
    if not isinstance(row, dict):
        return
    for key, value in row.items():
        if key == "extras":
            continue
        if key == "attributes" and isinstance(value, dict) and "bufferView" not in row:
            row[key] = {k: _plus(v, start["accessors"]) for k, v in value.items()}
        elif key == "children" and isinstance(value, list):
            row[key] = [_plus(v, start["nodes"]) for v in value]
        elif key == "index" and where == "materials":
            row[key] = _plus(value, start["textures"])
        elif key in _NUMBERS and not isinstance(value, (dict, list)):
            row[key] = _plus(value, start[_NUMBERS[key]])
        else:
            _shift(value, start, where)


def _plus(value: Any, by: int) -> Any:
    return value + by if type(value) is int else value
