"""Triangles of house.glb, read without the package's own GLB code, which this checks; no effects."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.check.axes import dot
from pbrs_farm.check.colours import linear_from_srgb, srgb_from_linear
from pbrs_farm.check.finishes import Finishes, mapped_alpha
from pbrs_farm.core.arrays import F32, F64, I64, Bools
from pbrs_farm.core.errors import BadInput
from pbrs_farm.images import decode_texture

Encoded = tuple[str, bytes] | None  # media type and bytes
Pixels = NDArray[np.uint8]  # (H, W, C)
_LEAST_Z = 0.1  # least slope of a map's unit normal: a steeper one is noise of the picture
_DTYPES = {5121: "<u1", 5123: "<u2", 5125: "<u4", 5126: "<f4"}  # glTF component types
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3}  # components of an element
_SHARE = np.arange(256) / 255  # value 0..1 of a byte
_LINEAR = linear_from_srgb(_SHARE)  # linear light of a byte
_SEE_THROUGH = ("glass", "pane")  # kinds of material
_BENT = ("opaque", "mirror", "shade")  # kinds whose normal map has an effect
_MAX_ELEMENTS = 50_000_000  # vertices or triangles: nodes may repeat a mesh many times


@dataclass(frozen=True, slots=True, eq=False)
class Textures:
    """One kind of picture, such as the normal maps, of each material."""

    encoded: tuple[Encoded, ...] = ()
    _decoded: dict[int, Pixels | None] = field(default_factory=dict)

    def of(self, material: int) -> Pixels | None:
        """(H, W, C) pixels of a material's picture; None if it is missing or cannot be decoded."""
        if material not in self._decoded:
            self._decoded[material] = self._decode(material)
        return self._decoded[material]

    def _decode(self, material: int) -> Pixels | None:
        stored = self.encoded[material] if material < len(self.encoded) else None
        if stored is None:
            return None
        try:
            pixels = decode_texture(stored[1], f"material {material}", stored[0])
        except BadInput:
            return None
        return pixels[..., None] if pixels.ndim == 2 else pixels

    def apply(self, material: I64, function: Callable[[int, NDArray[Any], Pixels], None]) -> None:
        """Call function(material, mask of its points, pixels) for each material with a picture among N points."""
        for number in np.unique(material).tolist():
            pixels = self.of(number)
            if pixels is not None:
                function(number, material == number, pixels)


def between_texels(pixels: Pixels, uv: F64, value_of_byte: F64) -> F64:
    """(N, C) values interpolated between the four texels around each uv (N, 2), which repeats; v down."""
    height, width = pixels.shape[:2]
    x, y = uv[:, 0] * width - 0.5, uv[:, 1] * height - 0.5
    values = np.zeros((len(uv), pixels.shape[2]))
    for dx, dy in ((0, 0), (1, 0), (0, 1), (1, 1)):
        column, row = np.floor(x) + dx, np.floor(y) + dy
        weight = (1 - np.abs(x - column)) * (1 - np.abs(y - row))
        texel = value_of_byte[pixels[(row % height).astype(int), (column % width).astype(int)]]
        values += weight[:, None] * texel
    return values


def between_corners(weights: F64, normals: F32, facing: F64) -> F64:
    """(N, 3) unit normals interpolated from the corners' (N, 3, 3), towards facing; facing without normals."""
    mean = np.einsum("nk,nkc->nc", weights, normals.astype(np.float64))
    length = np.linalg.norm(mean, axis=1, keepdims=True)
    smooth = np.where(length > 1e-6, mean / np.maximum(length, 1e-12), facing)
    away = dot(smooth, facing) < 0
    return np.where(away[:, None], -smooth, smooth)


def bent(normals: F64, corners: F64, uv: F64, mapped: F64) -> F64:
    """(N, 3) normals of triangles (N, 3, 3) with uv (N, 3, 2), v down, bent by mapped (N, 3): see `decoded`."""
    e1, e2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    up = uv * [1.0, -1.0]
    a, b = up[:, 1] - up[:, 0], up[:, 2] - up[:, 0]
    area = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    has_uv = np.abs(area) > 1e-6 * ((a**2).sum(1) + (b**2).sum(1))
    side = np.sign(area)[:, None]
    along = (b[:, 1:] * e1 - a[:, 1:] * e2) * side
    # The map is on the front: turn normals of the back there and back.
    front = np.cross(e1, e2)
    turn = np.where(dot(normals, front) < 0, -1.0, 1.0)[:, None]
    normal = turn * normals
    tangent = along - normal * dot(normal, along)[:, None]
    length = np.linalg.norm(tangent, axis=1, keepdims=True)
    tangent = tangent / np.maximum(length, 1e-30)
    across = np.cross(normal, tangent) * side
    out = mapped[:, :1] * tangent + mapped[:, 1:2] * across + mapped[:, 2:] * normal
    out = out / np.maximum(np.linalg.norm(out, axis=1, keepdims=True), 1e-12)
    return np.where(has_uv[:, None] & (length > 1e-20), turn * out, normals)


def decoded(values: F64, scale: float) -> F64:
    """(N, 3) unit normals in tangent space of (N, 3) bytes; black ones are flat."""
    xyz = values * (2 / 255) - 1
    black = (xyz <= -1).all(axis=1)
    xyz[:, :2] *= scale
    xyz[:, 2] = np.maximum(xyz[:, 2], _LEAST_Z * np.maximum(np.hypot(xyz[:, 0], xyz[:, 1]), 1e-6))
    xyz[black] = [0, 0, 1]
    return np.asarray(xyz / np.linalg.norm(xyz, axis=1, keepdims=True))


class BadGlb(ValueError):
    """house.glb cannot be read; the text says why."""


@dataclass(frozen=True, slots=True, eq=False)
class Materials:
    """The M materials of a house.glb."""

    kinds: tuple[str, ...]
    factors: F64  # (M, 3) linear colour
    cutoffs: F64  # (M,) alpha below which there is a hole, 0 = no holes
    normal_scales: F64  # (M,)
    colours: Textures
    normals: Textures
    roughness: Textures

    def colour(self, material: I64, uv: F64, most: float) -> F64:
        """(N, 3) sRGB 0..255 of colour times texture at uv (N, 2), v down, clipped to most (linear)."""
        if not len(self.factors):
            return np.zeros((len(material), 3))
        linear = self.factors[material]

        def multiply(_number: int, points: Bools, pixels: Pixels) -> None:
            linear[points] *= between_texels(pixels[..., :3], uv[points], _LINEAR)

        self.colours.apply(material, multiply)
        return 255 * srgb_from_linear(np.clip(linear, 0.0, most))

    def is_hole(self, material: I64, uv: F64) -> Bools:
        """(N,) True where alpha at uv (N, 2), v down, is below the cutoff of material (N,)."""
        alpha = np.ones(len(material))

        def read(number: int, points: Bools, pixels: Pixels) -> None:
            if self.cutoffs[number] > 0 and pixels.shape[2] == 4:
                alpha[points] = between_texels(pixels[..., 3:], uv[points], _SHARE)[:, 0]

        self.colours.apply(material, read)
        return alpha < self.cutoffs[material]


@dataclass(frozen=True, slots=True, eq=False)
class Triangles:
    """The F triangles of a house, of V vertices."""

    vertices: F32  # (V, 3) metres
    normals: F32  # (V, 3), 0 = none
    uv: F32  # (V, 2) v down, 0 = none
    faces: I64  # (F, 3) indices of vertices
    instance: I64  # (F,) instance id
    material: I64  # (F,) index of materials
    surface: I64  # (F,) number of the primitive among those of its node
    part: I64  # (F,) index of parts
    parts: tuple[str, ...]  # names of moving parts, "" first
    nyu40: dict[int, int]  # instance id -> class
    item: dict[int, str]  # instance id -> id of the item
    loose: dict[int, F32]  # instance id -> (N, 3) all vertices, also those of no triangle
    materials: Materials
    finishes: Finishes = field(default_factory=Finishes)

    def with_finishes(self, rows: Sequence[Mapping[str, Any]]) -> Triangles:
        """The same with the materials' rows of house.json, which hold more of gloss than glTF does."""
        return replace(self, finishes=Finishes(tuple(rows)))

    @property
    def classes(self) -> I64:
        """(I,) classes of all instances, 0 for numbers without one."""
        classes = np.zeros(max(self.nyu40, default=0) + 1, np.int64)
        classes[list(self.nyu40)] = list(self.nyu40.values())
        return classes

    def only(self, instance: int) -> Triangles:
        """The triangles of one item."""
        chosen = self.instance == instance
        used, numbers = np.unique(self.faces[chosen], return_inverse=True)
        arrays = {n: getattr(self, n)[used] for n in ("vertices", "normals", "uv")}
        arrays |= {n: getattr(self, n)[chosen] for n in ("instance", "material", "surface", "part")}
        return replace(self, faces=numbers.reshape(-1, 3).astype(np.int64), **arrays)

    def points_of(self, chosen: Bools) -> F64:
        """(N, 3) corners of some triangles."""
        return np.asarray(self.vertices[self.faces[chosen].reshape(-1)], np.float64)

    def points_of_surfaces(self, instance: int, surfaces: list[int]) -> F64:
        """(N, 3) corners of the triangles of some surfaces of an item."""
        return self.points_of((self.instance == instance) & np.isin(self.surface, surfaces))

    def is_part(self, name: str) -> Bools:
        """(F,) triangles of the parts of a name."""
        number = self.parts.index(name) if name in self.parts else -1
        return np.asarray(self.part == number)

    @property
    def see_through(self) -> Bools:
        """(F,) glass and panes."""
        return self.is_of(*_SEE_THROUGH)

    @property
    def has_holes(self) -> Bools:
        """(F,) triangles whose material may be cut out."""
        return self.of_material(self.materials.cutoffs) > 0

    def is_of(self, *kinds: str) -> Bools:
        """(F,) triangles whose material is of some kinds."""
        return self.of_material(np.array([k in kinds for k in self.materials.kinds], bool))

    def of_material(self, table: NDArray[Any]) -> NDArray[Any]:
        """(F,) the value of a table (M,) for each triangle's material."""
        return table[self.material] if len(self.material) else np.zeros(0, table.dtype)

    def kinds_of(self, face: I64) -> NDArray[Any]:
        """(N,) the kind of each face's material; "" where face is -1."""
        names = np.array([*self.materials.kinds, ""])
        return names[np.where(face >= 0, self.material[face], len(names) - 1)]

    def colour_at(self, face: I64, points: F64, most: float) -> F64:
        """(N, 3) sRGB 0..255 at points (N, 3) on faces (N,); most as of `Materials.colour`."""
        return self.materials.colour(self.material[face], self.uv_at(face, points), most)

    def is_hole(self, face: I64, points: F64) -> Bools:
        """(N,) True where alpha cuts faces (N,) out at points (N, 3) on them."""
        return self.materials.is_hole(self.material[face], self.uv_at(face, points))

    def alpha_at(self, face: I64, points: F64) -> F64:
        """(N,) GGX roughness at points (N, 3) on faces (N,), with maps."""
        material, uv = self.material[face], self.uv_at(face, points)
        alpha = self.finishes.alpha[material]

        def multiply(number: int, chosen: Bools, pixels: Pixels) -> None:
            if self.finishes.is_mapped(number):
                share = between_texels(pixels[..., 1:2], uv[chosen], _SHARE)[:, 0]
                alpha[chosen] = mapped_alpha(alpha[chosen], share)

        self.materials.roughness.apply(material, multiply)
        return alpha

    def shading_normals(self, face: I64, points: F64, facing: F64) -> F64:
        """(N, 3) unit shading normals at points (N, 3) on faces (N,), on the side of facing."""
        corners, uv = self.faces[face], self.uv_at(face, points)
        normals = between_corners(self._weights(face, points), self.normals[corners], facing)

        def bend(number: int, chosen: Bools, pixels: Pixels) -> None:
            if self.materials.kinds[number] in _BENT:
                values = between_texels(pixels[..., :3], uv[chosen], np.arange(256.0))
                mapped = decoded(values, float(self.materials.normal_scales[number]))
                triangles = self.vertices[corners[chosen]].astype(np.float64)
                corner_uv = self.uv[corners[chosen]].astype(np.float64)
                normals[chosen] = bent(normals[chosen], triangles, corner_uv, mapped)

        self.materials.normals.apply(self.material[face], bend)
        return normals

    def uv_at(self, face: I64, points: F64) -> F64:
        """(N, 2) texture coordinates, v down, of points (N, 3) on faces (N,)."""
        weights = self._weights(face, points)
        uv = self.uv[self.faces[face]].astype(np.float64)
        at_point = uv[:, 0] + weights[:, 1:2] * (uv[:, 1] - uv[:, 0])
        return np.asarray(np.nan_to_num(at_point + weights[:, 2:] * (uv[:, 2] - uv[:, 0])))

    def _weights(self, face: I64, points: F64) -> F64:
        """(N, 3) barycentric weights of the corners at points."""
        corners = self.faces[face]
        a, b, c = (self.vertices[corners[:, k]].astype(np.float64) for k in range(3))
        normal = np.cross(b - a, c - a)
        squared = dot(normal, normal)
        with np.errstate(divide="ignore", invalid="ignore"):
            at_b = dot(np.cross(points - a, c - a), normal) / squared
            at_c = dot(np.cross(b - a, points - a), normal) / squared
        return np.stack([1 - at_b - at_c, at_b, at_c], axis=1)


def triangles_from_glb(data: bytes) -> Triangles:
    """Every triangle of every node of a binary glTF; BadGlb for damaged or unexpected contents."""
    try:
        return _triangles(_Glb(*_chunks(data)))
    except (KeyError, IndexError, TypeError, ValueError, struct.error) as error:
        raise BadGlb(f"cannot be read: {error}") from None


def json_of_glb(data: bytes) -> dict[str, Any]:
    """The JSON of a GLB that `triangles_from_glb` has read."""
    return _chunks(data)[0]


def _chunks(data: bytes) -> tuple[dict[str, Any], bytes]:
    magic, version, length = struct.unpack_from("<4sII", data)
    if magic != b"glTF" or version != 2 or length != len(data):
        raise ValueError("not a whole glTF 2.0 binary")
    # The JSON chunk comes first; the binary one follows behind its own header.
    n_json, _ = struct.unpack_from("<I4s", data, 12)
    document = json.loads(data[20 : 20 + n_json])
    return document, data[20 + n_json + 8 :]


@dataclass(frozen=True, slots=True)
class _Glb:
    """A binary glTF."""

    document: dict[str, Any]
    binary: bytes

    def accessor(self, index: int) -> NDArray[Any]:
        """(N, C) values of an accessor."""
        accessor = self.document["accessors"][index]
        view = self.document["bufferViews"][accessor["bufferView"]]
        start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
        width = _WIDTHS[accessor["type"]]
        dtype, n = _DTYPES[accessor["componentType"]], accessor["count"] * width
        return np.frombuffer(self.binary, dtype, n, start).reshape(-1, width)

    def picture(self, texture: dict[str, Any] | None) -> Encoded:
        """Media type and bytes of a texture's picture; None for no texture."""
        if texture is None:
            return None
        image = self.document["images"][self.document["textures"][texture["index"]]["source"]]
        view = self.document["bufferViews"][image["bufferView"]]
        start = view.get("byteOffset", 0)
        return image["mimeType"], self.binary[start : start + view["byteLength"]]


def _triangles(glb: _Glb) -> Triangles:
    vertices, normals = [np.zeros((0, 3), np.float32)], [np.zeros((0, 3), np.float32)]
    uvs, faces = [np.zeros((0, 2), np.float32)], [np.zeros((0, 3), np.int64)]
    # Instance, material, surface, part and number of faces of each primitive.
    owners: list[tuple[int, int, int, int, int]] = []
    parts = {"": 0}
    nyu40: dict[int, int] = {}
    item: dict[int, str] = {}
    loose: dict[int, list[F32]] = {}
    n_vertices = n_faces = 0
    # Join the primitives of all nodes: those of this package carry no transform.
    for node in glb.document.get("nodes", []):
        instance = int(node["extras"]["instance"])
        nyu40[instance] = int(node["extras"]["nyu40"])
        item[instance] = str(node["extras"].get("item", instance))
        mesh = glb.document["meshes"][node["mesh"]] if "mesh" in node else {"primitives": []}
        for number, primitive in enumerate(mesh["primitives"]):
            attributes = primitive["attributes"]
            points = glb.accessor(attributes["POSITION"])
            loose.setdefault(instance, []).append(points)
            if primitive.get("mode", 4) != 4:
                continue  # not triangles
            for arrays, name, width in ((uvs, "TEXCOORD_0", 2), (normals, "NORMAL", 3)):
                index = attributes.get(name)
                missing = np.zeros((len(points), width), np.float32)
                arrays.append(missing if index is None else glb.accessor(index))
            corners = glb.accessor(primitive["indices"]).reshape(-1, 3)
            vertices.append(points)
            faces.append(corners.astype(np.int64) + n_vertices)
            part = parts.setdefault(str(primitive.get("extras", {}).get("part", "")), len(parts))
            owners.append((instance, int(primitive["material"]), number, part, len(corners)))
            n_vertices += len(points)
            n_faces += len(corners)
            if max(n_vertices, n_faces) > _MAX_ELEMENTS:
                raise ValueError(f"more than {_MAX_ELEMENTS} vertices or triangles")

    # Repeat the owner of each primitive for its faces.
    table = np.array(owners, np.int64).reshape(-1, 5)
    instance_, material, surface, part_ = np.repeat(table[:, :4], table[:, 4], axis=0).T
    return Triangles(
        np.concatenate(vertices), np.concatenate(normals), np.concatenate(uvs), np.concatenate(faces),
        instance_, material, surface, part_, tuple(parts), nyu40, item,
        {instance: np.concatenate(points) for instance, points in loose.items()}, _materials(glb),
    )  # fmt: skip


def _materials(glb: _Glb) -> Materials:
    rows = glb.document.get("materials", [])
    pbr = [row["pbrMetallicRoughness"] for row in rows]
    normals = [row.get("normalTexture") for row in rows]
    scales = [1.0 if texture is None else texture.get("scale", 1.0) for texture in normals]
    cutoffs = []
    for row in rows:
        # Glass with holes, for which glTF has no mode, has its cutoff among its extras.
        is_mask = row.get("alphaMode") == "MASK"
        holder = row if is_mask else row.get("extras", {})
        cutoffs.append(float(holder.get("alphaCutoff", 0.5 if is_mask else 0.0)))
    return Materials(
        tuple(str(row.get("extras", {}).get("kind", "opaque")) for row in rows),
        np.array([p["baseColorFactor"][:3] for p in pbr], np.float64).reshape(-1, 3),
        np.array(cutoffs), np.array(scales, np.float64),
        Textures(tuple(glb.picture(p.get("baseColorTexture")) for p in pbr)),
        Textures(tuple(glb.picture(texture) for texture in normals)),
        Textures(tuple(glb.picture(p.get("metallicRoughnessTexture")) for p in pbr)),
    )  # fmt: skip
