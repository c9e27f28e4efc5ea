"""A House as the bytes of a GLB that any glTF viewer opens, v stored negated; no effects."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, Final

import numpy as np

from pbrs_farm.core.arrays import F32
from pbrs_farm.core.classes import NYU40_NAMES
from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.frames import linear_from_srgb
from pbrs_farm.core.house import USUAL_CUTOFF, House, Item, Material, MaterialKind, Surface, Texture
from pbrs_farm.formats import glb
from pbrs_farm.formats.serialise import json_from_value

# The only pictures glTF knows; others stay in the file but no material shows them.
GLTF_IMAGES: Final = ("image/png", "image/jpeg")

# (u, v up) times this is (u, v down), one texture higher; and back.
V_DOWN: Final[F32] = np.array([1, -1], np.float32)

# OpenGL's numbers: of a sampler's wrapping, of a primitive's mode.
_REPEAT: Final = 10497
_POINTS, _TRIANGLES = 0, 4

_PANE_ALPHA: Final = 0.3  # of glass whose source says opaque


def glb_from_house(house: House) -> bytes:
    """house.glb: a node per item, a primitive per surface with vertices; BadHouse for unsound geometry."""
    writer = glb.GlbWriter()
    meshes: list[dict[str, Any]] = []
    nodes = []
    for index, item in enumerate(house.items):
        node: dict[str, Any] = {"name": item.id, "extras": item_extras(item, index + 1)}
        primitives = [primitive(writer, house, item, s) for s in item.surfaces if len(s.positions)]
        if primitives:
            node["mesh"] = len(meshes)
            meshes.append({"name": item.name or item.id, "primitives": primitives})
        nodes.append(node)
    images, textures = write_textures(writer, house.textures)
    document = gltf_document(house, nodes, range(len(nodes)), meshes, (images, textures))
    extras = {"house": house.id, "textures": [x["bufferView"] for x in textures]}
    return writer.glb(document | {"extras": extras})


def gltf_document(
    house: House,
    nodes: list[dict[str, Any]],
    roots: Iterable[int],
    meshes: list[dict[str, Any]],
    written: tuple[dict[str, int], list[dict[str, Any]]],
) -> dict[str, Any]:
    """The JSON of a file with the materials of a house; roots: nodes of its scene; written: of write_textures."""
    images, textures = written
    # glTF allows no empty list of nodes.
    scene = {"name": house.name} | ({"nodes": [*roots]} if nodes else {})
    return {
        "asset": gltf_asset(house),
        "scene": 0,
        "scenes": [scene],
        "nodes": nodes,
        "meshes": meshes,
        "materials": [gltf_material(m, images) for m in house.materials],
        "images": [image for image in textures if "name" in image],
        "samplers": [{"wrapS": _REPEAT, "wrapT": _REPEAT}] if images else [],
        "textures": [{"source": i, "sampler": 0} for i in range(len(images))],
    }


def gltf_asset(house: House) -> dict[str, Any]:
    """asset of a file made from house: source in "extras", and "copyright" if it names any credit."""
    source = house.source
    asset: dict[str, Any] = {
        "version": "2.0",
        "generator": "pbrs_farm",
        "extras": json_from_value(source),
    }
    line = source.attribution or ", ".join(x for x in (source.author, source.licence) if x)
    return asset | {"copyright": line} if line else asset


def item_extras(item: Item, instance: int) -> dict[str, Any]:
    """extras of an item's node: kind, class, properties; instance: its id in instance.png."""
    return {
        "instance": instance,
        "item": item.id,
        "name": item.name,
        "kind": item.kind.value,
        "nyu40": item.nyu40,
        "class": NYU40_NAMES[item.nyu40],
        "room": item.room_id,
    }


def primitive(writer: glb.GlbWriter, house: House, item: Item, s: Surface) -> dict[str, Any]:
    """A surface as a primitive; BadHouse if viewers could not open it.

    s: positions, normals and uvs are appended to the writer unchanged, except that v is flipped, since glTF
    counts it from the top. A surface without faces becomes a point cloud, to keep its vertices. BadHouse
    names item and surface for non-finite numbers, invalid vertex indices, and unknown materials.
    """
    place = f"item {item.id}, surface {s.name}"
    for array in (s.positions, s.uvs, s.normals):
        if array is not None and not np.isfinite(array).all():
            raise BadHouse(house.source.file, place, "has a number that is not finite")
    if len(s.faces) and not (s.faces.min() >= 0 and s.faces.max() < len(s.positions)):
        raise BadHouse(house.source.file, place, "a face names a vertex that does not exist")
    if not 0 <= s.material < len(house.materials):
        raise BadHouse(house.source.file, place, f"material {s.material} does not exist")
    attributes = {"POSITION": writer.add_vertices(s.positions, with_bounds=True)}
    if s.normals is not None:
        attributes["NORMAL"] = writer.add_vertices(s.normals)
    if s.uvs is not None:
        attributes["TEXCOORD_0"] = writer.add_vertices(s.uvs * V_DOWN)
    row: dict[str, Any] = {"attributes": attributes, "material": int(s.material)}
    if s.part:
        row["extras"] = {"part": s.part}
    if len(s.faces):
        return row | {"indices": writer.add_faces(s.faces), "mode": _TRIANGLES}
    return row | {"mode": _POINTS}


def write_textures(
    writer: glb.GlbWriter, textures: Mapping[str, Texture]
) -> tuple[dict[str, int], list[dict[str, Any]]]:
    """(texture key -> glTF texture index, an image or a bare buffer view per texture).

    A picture of a kind that glTF does not know (its media type is neither PNG nor JPEG) is kept as
    bytes without an image: our reader finds it again, a viewer shows the plain colour.
    """
    images: dict[str, int] = {}
    rows: list[dict[str, Any]] = []
    for key, texture in textures.items():
        view: dict[str, Any] = {"bufferView": writer.add_bytes(texture.data)}
        if texture.media_type in GLTF_IMAGES:
            images[key] = len(images)
            view |= {"mimeType": texture.media_type, "name": texture.name or texture.id}
        rows.append(view)
    return images, rows


def gltf_material(material: Material, images: dict[str, int]) -> dict[str, Any]:
    """A material, linear as glTF requires, kind in "extras"; images: texture id -> glTF index."""
    alpha, mode = _alpha(material)
    # Say what glTF knows of the material: colour, metal or not, roughness.
    pbr: dict[str, Any] = {
        "baseColorFactor": [*_linear(material.diffuse), alpha],
        "metallicFactor": 1.0 if material.kind is MaterialKind.MIRROR else 0.0,
        "roughnessFactor": _roughness(material),
    }
    if material.texture_id in images:
        pbr["baseColorTexture"] = {"index": images[material.texture_id]}
    if material.roughness_texture_id in images:
        pbr["metallicRoughnessTexture"] = {"index": images[material.roughness_texture_id]}
    row: dict[str, Any] = {
        "name": material.name,
        "pbrMetallicRoughness": pbr,
        "doubleSided": True,
        "alphaMode": mode,
        "extras": {"kind": material.kind.value},
    }
    if material.alpha_cutout and mode == "BLEND":
        # glTF has no word for clear glass with holes.
        row["extras"]["alphaCutoff"] = material.alpha_cutoff
    elif material.alpha_cutout and material.alpha_cutoff != USUAL_CUTOFF:
        row["alphaCutoff"] = material.alpha_cutoff
    if material.normal_texture_id in images:
        normal_map: dict[str, Any] = {"index": images[material.normal_texture_id]}
        scale = float(material.normal_scale)
        row["normalTexture"] = normal_map | ({"scale": scale} if scale != 1 else {})
    if material.kind is MaterialKind.BULB:
        row["emissiveFactor"] = _linear(material.diffuse)
    return row


def _roughness(material: Material) -> float:
    # A mirror is smooth metal; all else is as rough as its source says, or as its Phong lobe.
    if material.kind is MaterialKind.MIRROR:
        return 0.0
    if material.roughness is not None:
        return float(np.clip(material.roughness, 0, 1))
    if material.roughness_texture_id is not None:
        return 1.0
    return float((2.0 / (max(material.shininess, 0.0) + 2.0)) ** 0.25)


def _linear(rgb: tuple[float, float, float]) -> list[float]:
    return [float(c) for c in linear_from_srgb(np.clip(np.array(rgb), 0, 1))]


def _alpha(material: Material) -> tuple[float, str]:
    # glTF's alpha modes: BLEND lets light through, MASK cuts out, OPAQUE ignores alpha.
    alpha = float(np.clip(material.opacity, 0, 1))
    # Glass is blended even where its source says opaque.
    if material.kind in (MaterialKind.GLASS, MaterialKind.PANE):
        return (alpha if alpha < 1 else _PANE_ALPHA), "BLEND"
    if alpha < 1:
        return alpha, "BLEND"
    return 1.0, "MASK" if material.alpha_cutout else "OPAQUE"
