"""A .glb or .gltf with its buffers (outside ones by a given function) and placed meshes; no effects."""

from __future__ import annotations

import base64
import binascii
import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, Final
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F64, I32, I64
from pbrs_farm.core.checked_json import json_from_bytes
from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.frames import affine, rotation_of_quaternion
from pbrs_farm.formats.glb import Gltf, accessor_array, entry, gltf_from_glb, view_bytes
from pbrs_farm.read.common.furniture_classes import rows_of_table
from pbrs_farm.read.common.notes import Notes
from pbrs_farm.read.gltf.compressed import draco_arrays
from pbrs_farm.read.mesh.obj import Mesh
from pbrs_farm.read.mesh.texture_wraps import CLAMP, MIRROR, REPEAT

# Returns the bytes of a file beside the scene by relative name, or None if it does not exist.
Fetch = Callable[[str], bytes | None]

MAX_NODES: Final = 200_000  # of the scene; a node may have several instances
MAX_DEPTH: Final = 200  # levels of the node tree
_MOVES: Final = frozenset({"matrix", "rotation", "scale", "translation"})  # keys of a node

# Use of each extension: files may require those that are read; "unseen" ones have no visible
# effect for a reader that ignores them: a fallback is included, or they do not concern the picture.
_USES: Final = {row["name"]: row["use"] for row in rows_of_table("extensions.csv", "gltf")}
_INSTANCING: Final = "EXT_mesh_gpu_instancing"
_TRIANGLES, _STRIP, _FAN = 4, 5, 6  # values of primitive.mode
UNREAD: Final = "unread-part"
_WRAPS: Final = {33071: CLAMP, 33648: MIRROR}  # values of sampler.wrapS

_Row = dict[str, Any]


class MissingFile(BadHouse):
    """A file that a scene names does not exist; recoverable where it is a picture."""


@dataclass(frozen=True, slots=True, eq=False)
class Placed:
    """A node of the scene."""

    index: int  # of the node
    path: tuple[int, ...]  # node indices from the root, its own last
    world_from_node: F64  # (4, 4)


def gltf_document(data: bytes, file: str, fetch: Fetch) -> Gltf:
    """Parse a .glb or .gltf with all buffers; BadHouse for damage or an unsupported required extension."""
    gltf = _parse_gltf(data, file)
    if not isinstance(gltf.document.get("asset"), dict):
        raise BadHouse(file, "asset", "is missing; this is not a glTF file")
    _check_extensions(gltf)
    # Load what the accessors read from.
    buffers = gltf.document.get("buffers", [])
    if not isinstance(buffers, list):
        raise BadHouse(file, "buffers", "expected a list")
    loaded = [_buffer(gltf, i, fetch) for i in range(len(buffers))]
    return _with_instances(Gltf(gltf.document, tuple(loaded), file))


def _with_instances(gltf: Gltf) -> Gltf:
    """The document with a sibling node, of the same name, for each instance of EXT_mesh_gpu_instancing."""
    nodes = gltf.document.get("nodes")
    rows = nodes if isinstance(nodes, list) else []
    if _INSTANCING not in json.dumps(gltf.document.get("extensionsUsed")):
        return gltf
    rows = [dict(row) if isinstance(row, dict) else row for row in rows]
    copies: dict[int, list[int]] = {}
    for k, node in enumerate(list(rows)):
        extension = (
            object_at(object_at(node, "extensions"), _INSTANCING) if isinstance(node, dict) else {}
        )
        if not extension or "mesh" not in node:
            continue
        matrices = _instances(gltf, object_at(extension, "attributes"), f"nodes[{k}]")
        if len(rows) + len(matrices) > MAX_NODES:
            raise BadHouse(gltf.file, f"nodes[{k}]", f"more than {MAX_NODES} nodes")
        parent_from_mesh = parent_from_node(gltf, node, k) @ matrices
        copies[k] = list(range(len(rows), len(rows) + len(matrices)))
        rows += [
            {
                "name": node.get("name", ""),
                "mesh": node["mesh"],
                "matrix": matrix.T.ravel().tolist(),
            }
            | {key: node[key] for key in ("extras",) if key in node}
            for matrix in parent_from_mesh
        ]
        del rows[k]["mesh"]
    scenes = gltf.document.get("scenes")
    holders = [("nodes", row) for row in (scenes if isinstance(scenes, list) else [])]
    holders = [(key, dict(row) if isinstance(row, dict) else row) for key, row in holders]
    for key, row in (*holders, *(("children", row) for row in rows)):
        listed = row.get(key) if isinstance(row, dict) else None
        if isinstance(listed, list):
            row[key] = [
                n for k in listed for n in (k, *(copies.get(k, ()) if type(k) is int else ()))
            ]
    document = gltf.document | {"nodes": rows, "scenes": [row for _, row in holders]}
    return Gltf(document, gltf.buffers, gltf.file)


def _instances(gltf: Gltf, attributes: dict[str, Any], place: str) -> F64:
    """(N, 4, 4) poses of the instances in their node's frame."""
    widths = {"TRANSLATION": 3, "ROTATION": 4, "SCALE": 3}
    arrays = {
        key: _accessor_floats(gltf, attributes[key], width, f"{place}: {key}")
        for key, width in widths.items()
        if key in attributes
    }
    n = max((len(array) for array in arrays.values()), default=0)
    if any(len(array) != n for array in arrays.values()) or n > MAX_NODES:
        raise BadHouse(gltf.file, place, f"has instances of different numbers, or over {MAX_NODES}")
    moved = arrays.get("TRANSLATION", np.zeros((n, 3)))
    turned = arrays.get("ROTATION", np.tile([0.0, 0.0, 0.0, 1.0], (n, 1)))
    sizes = arrays.get("SCALE", np.ones((n, 3)))
    if not (np.abs(np.linalg.norm(turned, axis=1) - 1) < 0.5).all():
        raise BadHouse(gltf.file, f"{place}: ROTATION", "has a row that is not a unit quaternion")
    rows = [
        parent_from_node(gltf, {"translation": t, "rotation": r, "scale": s}, k)
        for k, (t, r, s) in enumerate(
            zip(moved.tolist(), turned.tolist(), sizes.tolist(), strict=True)
        )
    ]
    return np.array(rows).reshape(-1, 4, 4)


def _check_extensions(gltf: Gltf) -> None:
    """Reject what the file says it cannot be read without."""
    required = gltf.document.get("extensionsRequired", [])
    for name in required if isinstance(required, list) else []:
        if not isinstance(name, str) or _USES.get(name) != "read":
            text, hint = f"{str(name)[:60]!r} is not supported", "export again without it"
            raise BadHouse(gltf.file, "extensionsRequired", text, hint=hint)


def _parse_gltf(data: bytes, file: str) -> Gltf:
    # Distinguish the two forms by content, whatever the file's name; anything else by its name.
    is_text = data.lstrip()[:1] == b"{"
    if data[:4] == b"glTF" or (file.lower().endswith(".glb") and not is_text):
        return gltf_from_glb(data, file)
    document = json_from_bytes(data, file)
    return Gltf(document if isinstance(document, dict) else {}, (), file)


def files_of_gltf(data: bytes, file: str) -> list[str]:
    """Relative names of the buffers and pictures outside a .glb or .gltf; [] if it is damaged.

    Without data URIs and addresses of the net. For digests and copies; whether they exist is not
    looked at. They may lead out of the folder: open them through a RootFolder.
    """
    try:
        document = _parse_gltf(data, file).document
    except BadHouse:
        return []
    lists = [document.get(key) for key in ("buffers", "images")]
    entries = [e for entries in lists if isinstance(entries, list) for e in entries]
    uris = [str(e["uri"]) for e in entries if isinstance(e, dict) and "uri" in e]
    return [unquote(uri) for uri in uris if not uri.startswith("data:") and "://" not in uri]


def _buffer(gltf: Gltf, index: int, fetch: Fetch) -> bytes:
    buffer = entry(gltf, "buffers", index)
    if "uri" in buffer:
        return uri_bytes(gltf, buffer["uri"], f"buffers[{index}]", fetch)
    # Only the first buffer of a .glb may leave out its uri: it is the binary chunk.
    if index or not gltf.buffers:
        raise BadHouse(gltf.file, f"buffers[{index}]", "has no bytes")
    return gltf.buffers[0]


def uri_bytes(gltf: Gltf, uri: Any, place: str, fetch: Fetch) -> bytes:
    """The bytes of a data URI or a file beside the scene; MissingFile, or BadHouse for an invalid uri."""
    if not isinstance(uri, str):
        raise BadHouse(gltf.file, place, "uri is not text")
    if uri.startswith("data:"):
        head, _, body = uri.partition(",")
        try:
            return base64.b64decode(body, validate=True) if head.endswith(";base64") else b""
        except (binascii.Error, ValueError):
            raise BadHouse(gltf.file, place, "is not valid base64") from None
    if "://" in uri:
        raise BadHouse(gltf.file, place, f"{uri[:80]!r} is a network address, not a file")
    data = fetch(unquote(uri))
    if data is None:
        raise MissingFile(gltf.file, place, f"{uri[:80]!r} does not exist")
    return data


def image_bytes(gltf: Gltf, index: Any, fetch: Fetch) -> bytes:
    """The encoded picture of images[index]; MissingFile, or BadHouse for a wrong document."""
    image = entry(gltf, "images", index)
    if "bufferView" in image:
        return view_bytes(gltf, image["bufferView"])
    return uri_bytes(gltf, image.get("uri"), f"images[{index}]", fetch)


def placed_nodes(gltf: Gltf) -> Iterator[Placed]:
    """Every node of the default scene, parents first; BadHouse for cycles, shears or too many nodes."""
    scene = gltf.document.get("scene", 0)
    roots = _indices(gltf, entry(gltf, "scenes", scene), f"scenes[{scene}]", "nodes")
    # Visit nodes depth first, parents before children, in the file's order.
    stack = [Placed(i, (i,), np.eye(4)) for i in reversed(roots)]
    n = 0
    while stack:
        # Count pending nodes too, so that a broad tree with too many fails early.
        n_known = n + len(stack)
        top, n = stack.pop(), n + 1
        if n_known > MAX_NODES or len(top.path) > MAX_DEPTH:
            text = f"more than {MAX_NODES} nodes or {MAX_DEPTH} levels"
            raise BadHouse(gltf.file, f"nodes[{top.index}]", text)
        node = entry(gltf, "nodes", top.index)
        world = top.world_from_node @ parent_from_node(gltf, node, top.index)
        yield Placed(top.index, top.path, world)
        for child in reversed(_indices(gltf, node, f"nodes[{top.index}]", "children")):
            if child in top.path:
                raise BadHouse(gltf.file, f"nodes[{child}]", "is its own ancestor")
            stack.append(Placed(child, (*top.path, child), world))


def _indices(gltf: Gltf, holder: dict[str, Any], place: str, key: str) -> list[int]:
    value = holder.get(key, [])
    if not isinstance(value, list) or not all(type(v) is int for v in value):
        raise BadHouse(gltf.file, f"{place}.{key}", "expected a list of node numbers")
    if len(value) > MAX_NODES:
        raise BadHouse(gltf.file, f"{place}.{key}", f"more than {MAX_NODES} nodes")
    return value


def parent_from_node(gltf: Gltf, node: dict[str, Any], index: int) -> F64:
    place = f"nodes[{index}]"
    if not _MOVES & node.keys():
        return np.eye(4)
    if "matrix" in node:
        m = numbers(gltf, node["matrix"], 16, f"{place}.matrix").reshape(4, 4).T  # column by column
        if not np.allclose(m[3], [0, 0, 0, 1], atol=1e-6):
            raise BadHouse(gltf.file, f"{place}.matrix", "is not affine (column-major)")
        return np.asarray(m)
    x, y, z, w = numbers(gltf, node.get("rotation", [0, 0, 0, 1]), 4, f"{place}.rotation")
    # Turn the unit quaternion into a rotation, then scale and move (T * R * S).
    length = (x * x + y * y + z * z + w * w) ** 0.5
    if not 0.5 < length < 2:
        raise BadHouse(gltf.file, f"{place}.rotation", "is not a unit quaternion")
    x, y, z, w = x / length, y / length, z / length, w / length
    turn = rotation_of_quaternion(w, x, y, z)
    scale = numbers(gltf, node.get("scale", [1, 1, 1]), 3, f"{place}.scale")
    moved = numbers(gltf, node.get("translation", [0, 0, 0]), 3, f"{place}.translation")
    return affine(turn * scale, moved)


def numbers(gltf: Gltf, value: Any, n: int, place: str) -> F64:
    """(n,) float64 of a list of n finite numbers; else BadHouse at place, such as `materials[2]: colour`."""
    fits = isinstance(value, list) and len(value) == n
    if not fits or not all(type(v) in (int, float) and abs(v) < 1e12 for v in value):
        raise BadHouse(gltf.file, place, f"expected {n} finite numbers")
    return np.array(value, np.float64)


def object_at(holder: dict[str, Any], key: str) -> dict[str, Any]:
    """The JSON object under a key of another object; {} if it is absent or of another type."""
    value = holder.get(key)
    return value if isinstance(value, dict) else {}


def specular_glossiness(fields_json: dict[str, Any]) -> dict[str, Any]:
    """KHR_materials_pbrSpecularGlossiness of a material, {} if absent or if metallic values exist too."""
    glossy = object_at(object_at(fields_json, "extensions"), "KHR_materials_pbrSpecularGlossiness")
    return {} if object_at(fields_json, "pbrMetallicRoughness") else glossy


def texture_slots(gltf: Gltf, material: int | None) -> dict[str, dict[str, Any]]:
    """The supported textures of a material by glTF key; the first sets the texture coordinates of all."""
    if material is None:
        return {}
    fields_json = entry(gltf, "materials", material)
    pbr, glossy = object_at(fields_json, "pbrMetallicRoughness"), specular_glossiness(fields_json)
    infos = {
        "baseColorTexture": pbr.get("baseColorTexture"),
        "diffuseTexture": glossy.get("diffuseTexture"),
        "normalTexture": fields_json.get("normalTexture"),
        "metallicRoughnessTexture": pbr.get("metallicRoughnessTexture"),
        "specularGlossinessTexture": glossy.get("specularGlossinessTexture"),
    }
    return {key: info for key, info in infos.items() if isinstance(info, dict)}


def texture_layout(gltf: Gltf, info: dict[str, Any]) -> tuple[Any, ...]:
    """Placement of a texture on a surface: set of texture coordinates, transform, wraps."""
    turn = object_at(info, "extensions").get("KHR_texture_transform")
    return texture_set(info), turn, texture_wraps(gltf, info)


def texture_wraps(gltf: Gltf, info: dict[str, Any]) -> tuple[str, str]:
    """How a texture goes on beyond its edges, along u and v: words of `mesh/texture_wraps.py`."""
    texture = entry(gltf, "textures", info.get("index"))
    sampler = entry(gltf, "samplers", texture["sampler"]) if "sampler" in texture else {}
    along_u, along_v = (
        next((mode for n, mode in _WRAPS.items() if n == sampler.get(key)), REPEAT)
        for key in ("wrapS", "wrapT")
    )
    return along_u, along_v


def texture_set(info: dict[str, Any]) -> Any:
    """Set of texture coordinates of a texture; its transform may override it."""
    turn = object_at(object_at(info, "extensions"), "KHR_texture_transform")
    return turn.get("texCoord", info.get("texCoord", 0))


def meshes_of(gltf: Gltf, index: Any, *, max_triangles: int) -> list[tuple[int | None, Mesh]]:
    """(material or None, mesh) of every primitive with triangles; BadHouse for damage and over max_triangles."""
    primitives = entry(gltf, "meshes", index).get("primitives")
    if not isinstance(primitives, list) or not all(isinstance(p, dict) for p in primitives):
        raise BadHouse(gltf.file, f"meshes[{index}].primitives", "expected a list of objects")
    meshes: list[tuple[int | None, Mesh]] = []
    n_triangles = 0
    for k, primitive in enumerate(primitives):
        place = f"meshes[{index}].primitives[{k}]"
        if not has_surface(primitive):
            continue
        triangles = _mesh_of_primitive(gltf, primitive, place)
        if triangles is not None:
            n_triangles += len(triangles.faces)
            meshes.append((primitive.get("material"), triangles))
        if n_triangles > max_triangles:
            text = f"more than {max_triangles} triangles"
            raise BadHouse(gltf.file, place, text, hint="limit: read.max_model_triangles")
    return meshes


def has_surface(primitive: dict[str, Any]) -> bool:
    """Whether a primitive is made of triangles: points and lines have no surface."""
    return primitive.get("mode", _TRIANGLES) in (_TRIANGLES, _STRIP, _FAN)


def _mesh_of_primitive(gltf: Gltf, primitive: dict[str, Any], place: str) -> Mesh | None:
    attributes = primitive.get("attributes")
    if not isinstance(attributes, dict) or "POSITION" not in attributes:
        raise BadHouse(gltf.file, place, "has no positions", hint="or they are compressed")
    draco = draco_arrays(gltf, primitive, place)
    numbers_of = draco.attributes if draco else {}
    positions = _accessor_floats(
        gltf, attributes["POSITION"], 3, f"{place}.POSITION", numbers_of.get("POSITION")
    )
    faces = _faces(gltf, primitive, len(positions), place, draco.order if draco else None)
    if not len(faces):
        return None
    # Take the texture coordinates that the leading picture uses.
    leading = next(iter(texture_slots(gltf, primitive.get("material")).values()), {})
    name, uvs = f"TEXCOORD_{texture_set(leading)}", None
    if name in attributes:
        uvs = _accessor_floats(gltf, attributes[name], 2, f"{place}.TEXCOORD", numbers_of.get(name))
        uvs = _transformed(gltf, uvs, leading, place) * [1, -1] + [0, 1]  # v up
    normals = np.zeros_like(
        positions
    )  # zero means flat shading, as glTF specifies for missing normals
    if "NORMAL" in attributes:
        normals = _accessor_floats(
            gltf, attributes["NORMAL"], 3, f"{place}.NORMAL", numbers_of.get("NORMAL")
        )
    colours = None
    if "COLOR_0" in attributes:
        colours = _vertex_colours(gltf, attributes["COLOR_0"], place, numbers_of.get("COLOR_0"))
    # One value per vertex, or none.
    for array in (uvs, normals, colours):
        if array is not None and len(array) != len(positions):
            raise BadHouse(gltf.file, place, "has attributes of different lengths")
    return Mesh("", "", positions, faces, uvs, normals, colours)


def _vertex_colours(
    gltf: Gltf, accessor: Any, place: str, decoded: NDArray[Any] | None
) -> F64 | None:
    """(V, 3) linear colours of vertices, without their alpha; None if all are white."""
    raw = accessor_array(gltf, accessor) if decoded is None else decoded
    width = 4 if raw.shape[1] == 4 else 3
    rgb = _accessor_floats(gltf, accessor, width, f"{place}.COLOR_0", decoded)[:, :3]
    return None if (rgb >= 1).all() else np.clip(rgb, 0, 1)


def _accessor_floats(
    gltf: Gltf, accessor: Any, width: int, place: str, decoded: NDArray[Any] | None = None
) -> F64:
    raw = accessor_array(gltf, accessor) if decoded is None else decoded
    if raw.shape[1] != width:
        raise BadHouse(gltf.file, place, f"expected {width} components, got {raw.shape[1]}")
    # A signalling NaN sets a flag in the cast; non-finite values are rejected below.
    with np.errstate(invalid="ignore"):
        values = raw.astype(np.float64)
    if raw.dtype.kind in "iu" and entry(gltf, "accessors", accessor).get("normalized") is True:
        # Normalised integers are fractions of their type's range (glTF 2.0, section 3.6.2.2).
        values = np.maximum(values / np.iinfo(raw.dtype).max, -1.0)
    if not (np.abs(values) < 1e9).all():
        raise BadHouse(gltf.file, place, "has a number that is not finite")
    return values


def _faces(
    gltf: Gltf, primitive: dict[str, Any], n: int, place: str, decoded: I64 | None = None
) -> I32:
    if decoded is not None:
        order = decoded
        if len(order) and not 0 <= order.min() <= order.max() < n:
            raise BadHouse(gltf.file, place, "a face names a vertex that does not exist")
        # Draco's are triangles, whatever was drawn as a strip.
        return order.reshape(-1, 3).astype(np.int32)
    if "indices" in primitive:
        raw = accessor_array(gltf, primitive["indices"])
        if raw.shape[1] != 1 or raw.dtype.kind != "u":
            raise BadHouse(gltf.file, f"{place}.indices", "are not vertex numbers")
        order = raw[:, 0].astype(np.int64)
        if len(order) and order.max() >= n:
            raise BadHouse(gltf.file, place, "a face names a vertex that does not exist")
    else:
        order = np.arange(n)  # the vertices as they come
    mode = primitive.get("mode", _TRIANGLES)
    if mode == _TRIANGLES:
        if len(order) % 3:
            raise BadHouse(gltf.file, place, f"{len(order)} corners are not triangles")
        return order.reshape(-1, 3).astype(np.int32)
    # Number the triangles of a fan or a strip; a strip turns every second one over.
    k = np.arange(max(len(order) - 2, 0))
    odd = k % 2
    fan, strip = (np.zeros_like(k), k + 1, k + 2), (k, k + 1 + odd, k + 2 - odd)
    corners = np.stack([order[i] for i in (fan if mode == _FAN else strip)], 1)
    return corners.reshape(-1, 3).astype(np.int32)


def _transformed(gltf: Gltf, uvs: F64, info: dict[str, Any], place: str) -> F64:
    """uvs after KHR_texture_transform: translation x rotation x scale, v still down."""
    turn = object_at(info, "extensions").get("KHR_texture_transform")
    if not isinstance(turn, dict):
        return uvs
    offset = numbers(gltf, turn.get("offset", [0, 0]), 2, f"{place}: texture offset")
    scale = numbers(gltf, turn.get("scale", [1, 1]), 2, f"{place}: texture scale")
    (angle,) = numbers(gltf, [turn.get("rotation", 0)], 1, f"{place}: texture rotation")
    c, s = np.cos(angle), np.sin(angle)
    # Rotate about uv (0, 0), where the picture is top left.
    rotation = np.array([[c, s], [-s, c]])
    return np.asarray((uvs * scale) @ rotation.T + offset)


_PRIMITIVES: Final[dict[str, Callable[[_Row], bool]]] = {
    "points or lines": lambda row: not has_surface(row),
    "morph targets": lambda row: bool(row.get("targets")),
}


def note_unread(gltf: Gltf, notes: Notes) -> None:
    """Note, once per file, each unread extension that affects the picture and what uses it."""
    used = gltf.document.get("extensionsUsed")
    for name in used if isinstance(used, list) else []:
        if not isinstance(name, str) or name not in _USES:
            notes.add(UNREAD, "extensionsUsed", f"{name} is not supported: its content is missing")
    primitives = [
        _object_rows(mesh.get("primitives")) for mesh in _object_rows(gltf.document.get("meshes"))
    ]
    for part, has in _PRIMITIVES.items():
        n = sum(any(map(has, rows)) for rows in primitives)
        if n:
            notes.add(UNREAD, "meshes", f"{n} of {len(primitives)} have {part}, which are not read")
    n = sum("skin" in node for node in _object_rows(gltf.document.get("nodes")))
    if n:
        notes.add(UNREAD, "nodes", f"{n} have a skin, which is not read: shown as modelled")


def _object_rows(value: Any) -> list[_Row]:
    return [row for row in value if isinstance(row, dict)] if isinstance(value, list) else []
