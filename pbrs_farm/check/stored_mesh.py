"""house.glb -> triangles with instance, class, material and texture, read here alone; no effects.

Deliberately shares no code with the package's own reader and writer of GLB: it is their check.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.check.finish_checks import Finishes
from pbrs_farm.check.shading_normals import NormalMaps, bent, between_corners, decoded
from pbrs_farm.core.errors import BadInput
from pbrs_farm.images import decode_texture

_DTYPES = {5121: "<u1", 5123: "<u2", 5125: "<u4", 5126: "<f4"}  # glTF component types
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3}  # components of an element
_SHARE = np.arange(256) / 255  # of one, that a byte is; and its linear light
_LINEAR = np.where(_SHARE <= 0.04045, _SHARE / 12.92, ((_SHARE + 0.055) / 1.055) ** 2.4)
_SEE_THROUGH = ("glass", "pane")  # kinds of material
_MAX_ELEMENTS = 50_000_000  # vertices, triangles: nodes may show one mesh many times


class BadGlb(ValueError):
    """house.glb cannot be read; the text says why."""


@dataclass(frozen=True, slots=True, eq=False)
class Colours:
    """The diffuse colours of a house's materials, textures decoded when one is looked up."""

    factors: NDArray[np.float64]  # (M, 3) linear
    pictures: tuple[tuple[str, bytes] | None, ...]  # of each material: media type and bytes
    decoded: dict[int, NDArray[np.uint8] | None]  # of those looked up until now
    cutoffs: NDArray[np.float64]  # (M,) alpha below which there is a hole, 0 = no holes

    def at(
        self, material: NDArray[np.int64], uv: NDArray[np.float64], most: float
    ) -> NDArray[np.float64]:
        """(N, 3) sRGB 0..255: colour times texture at uv (N, 2), v down, held to most in linear.

        material is (N,) int64 indices. Textures are filtered between texels; most is the largest
        linear value, as a picture cannot show more. Zeros where the mesh has no materials.
        """
        if not len(self.factors):
            return np.zeros((len(material), 3))
        linear = self.factors[material]
        for number in np.unique(material):
            pixels = self._picture(int(number))
            if pixels is not None:
                own = material == number
                linear[own] *= _between_texels(pixels[..., :3], uv[own], _LINEAR)
        linear = np.clip(linear, 0.0, most)
        low = linear * 12.92
        return np.asarray(
            255 * np.where(linear <= 0.0031308, low, 1.055 * linear ** (1 / 2.4) - 0.055)
        )

    def is_hole(self, material: NDArray[np.int64], uv: NDArray[np.float64]) -> NDArray[np.bool_]:
        """(N,) whether alpha at uv (N, 2), v down, is below the cutoff of material (N,) there."""
        hole = np.zeros(len(material), bool)
        for number in np.unique(material):
            if self.cutoffs[number] > 0:
                own = material == number
                pixels = self._picture(int(number))
                alpha = np.ones(int(own.sum()))
                if pixels is not None and pixels.shape[2] == 4:
                    alpha = _between_texels(pixels[..., 3:], uv[own], _SHARE)[:, 0]
                hole[own] = alpha < self.cutoffs[number]
        return hole

    def _picture(self, material: int) -> NDArray[np.uint8] | None:
        stored = self.pictures[material]
        if stored is None:
            return None
        if material not in self.decoded:
            try:
                self.decoded[material] = decode_texture(
                    stored[1], f"material {material}", stored[0]
                )
            except BadInput:
                self.decoded[material] = None  # counts as white
        return self.decoded[material]


def _between_texels(
    pixels: NDArray[np.uint8], uv: NDArray[np.float64], value_of_byte: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(N, C) values between the four texels about each uv (N, 2), which repeats; v down."""
    height, width = pixels.shape[:2]
    x, y = uv[:, 0] * width - 0.5, uv[:, 1] * height - 0.5
    found = np.zeros((len(uv), pixels.shape[2]))
    for dx, dy in ((0, 0), (1, 0), (0, 1), (1, 1)):
        column, row = np.floor(x) + dx, np.floor(y) + dy
        weight = (1 - np.abs(x - column)) * (1 - np.abs(y - row))
        texel = value_of_byte[pixels[(row % height).astype(int), (column % width).astype(int)]]
        found += weight[:, None] * texel
    return found


@dataclass(frozen=True, slots=True, eq=False)
class Triangles:
    """The F triangles of a house."""

    vertices: NDArray[np.float32]  # (V, 3) metres
    faces: NDArray[np.int64]  # (F, 3) indices of vertices
    instance: NDArray[np.int64]  # (F,) instance id
    material: NDArray[np.int64]  # (F,) index of the GLB's materials
    nyu40: dict[int, int]  # instance id -> class as the GLB says
    see_through: NDArray[np.bool_]  # (F,) glass and panes
    item: dict[int, str]  # instance id -> id of the item
    uv: NDArray[np.float32]  # (V, 2) v down; 0 where there are none
    colours: Colours
    loose: dict[
        int, NDArray[np.float32]
    ]  # instance id -> (N, 3) vertices, also those of no triangle

    # (F,) number of the triangle's primitive among those of its node, as surfaces with vertices are
    surface: NDArray[np.int64]

    parts: tuple[str, ...]  # names of parts that move, "" first
    part: NDArray[np.int64]  # (F,) index of parts

    def points_of_surfaces(self, instance: int, surfaces: list[int]) -> NDArray[np.float64]:
        """(N, 3) corners of the triangles of some surfaces of an item."""
        own = (self.instance == instance) & np.isin(self.surface, surfaces)
        return np.asarray(self.vertices[self.faces[own].reshape(-1)], np.float64)

    kinds: tuple[str, ...]  # of each material
    normals: NDArray[np.float32]  # (V, 3) of the corners; 0 where there are none
    maps: NormalMaps
    rough_maps: tuple[tuple[str, bytes] | None, ...] = ()  # of each material
    finishes: Finishes = field(default_factory=lambda: Finishes((), ()))

    def with_finishes(self, rows: Sequence[Mapping[str, Any]]) -> Triangles:
        """The same with the materials' rows of house.json, which say more of gloss than glTF does."""
        return replace(self, finishes=Finishes(tuple(rows), self.rough_maps))

    def alpha_at(self, face: NDArray[np.int64], points: NDArray[np.float64]) -> NDArray[np.float64]:
        """(N,) GGX roughness at points (N, 3) on faces (N,), with maps."""
        material = self.material[face]
        alpha = self.finishes.alpha()[material]
        at = self.uv_at(face, points)
        for number in np.unique(material):
            green = self.finishes.green(int(number))
            if green is not None:
                own = material == number
                share = _between_texels(green, at[own], _SHARE)[:, 0]
                alpha[own] = np.maximum(alpha[own] * share**2, 0.05)
        return alpha

    def shading_normals(
        self, face: NDArray[np.int64], points: NDArray[np.float64], facing: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """(N, 3) unit normals that light follows at points (N, 3) on faces (N,), on the side of facing."""
        corners = self.faces[face]
        weights = self._weights(face, points)
        seen = between_corners(weights, self.normals[corners], facing)
        at = self.uv_at(face, points)
        for number in np.unique(self.material[face]):
            pixels = self.maps.of(int(number))
            if pixels is None:
                continue
            own = self.material[face] == number
            values = _between_texels(pixels[..., :3], at[own], np.arange(256.0))
            mapped = decoded(values, float(self.maps.scales[number]))
            triangles = self.vertices[corners[own]].astype(np.float64)
            uv = self.uv[corners[own]].astype(np.float64)
            seen[own] = bent(seen[own], triangles, uv, mapped)
        return seen

    def kinds_of(self, face: NDArray[np.int64]) -> NDArray[Any]:
        """(N,) the kind of each face's material; "" where face is -1."""
        names = np.array([*self.kinds, ""])
        return names[np.where(face >= 0, self.material[face], len(self.kinds))]

    @property
    def has_holes(self) -> NDArray[np.bool_]:
        """(F,) whether the material may be cut out."""
        if not len(self.material):
            return np.zeros(0, bool)
        return np.asarray(self.colours.cutoffs[self.material] > 0)

    def uv_at(self, face: NDArray[np.int64], points: NDArray[np.float64]) -> NDArray[np.float64]:
        """(N, 2) texture coordinates, v down, of points (N, 3) on faces (N,)."""
        weights = self._weights(face, points)
        uv = self.uv[self.faces[face]].astype(np.float64)
        at = uv[:, 0] + weights[:, 1:2] * (uv[:, 1] - uv[:, 0])
        return np.asarray(np.nan_to_num(at + weights[:, 2:] * (uv[:, 2] - uv[:, 0])))

    def _weights(self, face: NDArray[np.int64], points: NDArray[np.float64]) -> NDArray[np.float64]:
        """(N, 3) weights of the corners at points: the areas over against them."""
        corners = self.faces[face]
        a, b, c = (self.vertices[corners[:, k]].astype(np.float64) for k in range(3))
        normal = np.cross(b - a, c - a)
        squared = np.einsum("ni,ni->n", normal, normal)
        with np.errstate(divide="ignore", invalid="ignore"):
            at_b = np.einsum("ni,ni->n", np.cross(points - a, c - a), normal) / squared
            at_c = np.einsum("ni,ni->n", np.cross(b - a, points - a), normal) / squared
        return np.stack([1 - at_b - at_c, at_b, at_c], axis=1)

    def is_hole(self, face: NDArray[np.int64], points: NDArray[np.float64]) -> NDArray[np.bool_]:
        """(N,) whether alpha leaves nothing of faces (N,) at points (N, 3) on them."""
        return self.colours.is_hole(self.material[face], self.uv_at(face, points))


def triangles_from_glb(data: bytes) -> Triangles:
    """Every triangle of every node; raises BadGlb.

    Of the binary glTF that `house.glb` is, read apart from the exporter. BadGlb for anything that
    cannot be followed: damaged chunks, indices that point nowhere, other types.
    """
    try:
        return _triangles(*_chunks(data))
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


def _accessor(document: dict[str, Any], binary: bytes, index: int) -> NDArray[Any]:
    accessor = document["accessors"][index]
    view = document["bufferViews"][accessor["bufferView"]]
    start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
    width = _WIDTHS[accessor["type"]]
    flat = np.frombuffer(
        binary, _DTYPES[accessor["componentType"]], accessor["count"] * width, start
    )
    return flat.reshape(-1, width)


def _triangles(document: dict[str, Any], binary: bytes) -> Triangles:
    vertices = [np.zeros((0, 3), np.float32)]
    faces = [np.zeros((0, 3), np.int64)]
    # Instance, material, surface, number of faces, part.
    owners: list[tuple[int, int, int, int, int]] = []
    parts = {"": 0}
    nyu40: dict[int, int] = {}
    item: dict[int, str] = {}
    uvs = [np.zeros((0, 2), np.float32)]
    normals = [np.zeros((0, 3), np.float32)]
    loose: dict[int, list[NDArray[np.float32]]] = {}
    n_vertices = n_faces = 0
    # Join the primitives of all nodes: those of this package carry no transform.
    for node in document.get("nodes", []):
        instance = int(node["extras"]["instance"])
        nyu40[instance] = int(node["extras"]["nyu40"])
        item[instance] = str(node["extras"].get("item", instance))
        mesh = document["meshes"][node["mesh"]] if "mesh" in node else {"primitives": []}
        for number, primitive in enumerate(mesh["primitives"]):
            attributes = primitive["attributes"]
            points = _accessor(document, binary, attributes["POSITION"])
            loose.setdefault(instance, []).append(points)
            if primitive.get("mode", 4) != 4:
                continue  # not triangles
            none = np.zeros((len(points), 2), np.float32)
            uv = attributes.get("TEXCOORD_0")
            uvs.append(none if uv is None else _accessor(document, binary, uv))
            normal = attributes.get("NORMAL")
            flat = np.zeros((len(points), 3), np.float32)
            normals.append(flat if normal is None else _accessor(document, binary, normal))
            corners = _accessor(document, binary, primitive["indices"]).reshape(-1, 3)
            vertices.append(points)
            faces.append(corners.astype(np.int64) + n_vertices)
            part = parts.setdefault(str(primitive.get("extras", {}).get("part", "")), len(parts))
            owners.append((instance, int(primitive["material"]), number, len(corners), part))
            n_vertices += len(points)
            n_faces += len(corners)
            if max(n_vertices, n_faces) > _MAX_ELEMENTS:
                raise ValueError(f"more than {_MAX_ELEMENTS} vertices or triangles")

    # Repeat each primitive's instance and material for its faces.
    table = np.array(owners, np.int64).reshape(-1, 5)
    material = np.repeat(table[:, 1], table[:, 3])
    kinds = [m.get("extras", {}).get("kind", "opaque") for m in document.get("materials", [])]
    clear = np.array([k in _SEE_THROUGH for k in kinds], bool)
    return Triangles(
        np.concatenate(vertices),
        np.concatenate(faces),
        np.repeat(table[:, 0], table[:, 3]),
        material,
        nyu40,
        clear[material] if len(material) else np.zeros(0, bool),
        item,
        np.concatenate(uvs),
        _colours(document, binary),
        {instance: np.concatenate(points) for instance, points in loose.items()},
        np.repeat(table[:, 2], table[:, 3]),
        tuple(parts),
        np.repeat(table[:, 4], table[:, 3]),
        tuple(str(k) for k in kinds),
        np.concatenate(normals),
        _normal_maps(document, binary, tuple(str(k) for k in kinds)),
        tuple(
            _picture(document, binary, m["pbrMetallicRoughness"].get("metallicRoughnessTexture"))
            for m in document.get("materials", [])
        ),
    )


def _picture(
    document: dict[str, Any], binary: bytes, texture: dict[str, Any] | None
) -> tuple[str, bytes] | None:
    """Media type and bytes of a material's picture, by its texture's source."""
    if texture is None:
        return None
    image = document["images"][document["textures"][texture["index"]]["source"]]
    view = document["bufferViews"][image["bufferView"]]
    start = view.get("byteOffset", 0)
    return image["mimeType"], binary[start : start + view["byteLength"]]


def _normal_maps(document: dict[str, Any], binary: bytes, kinds: tuple[str, ...]) -> NormalMaps:
    rows = [m.get("normalTexture") for m in document.get("materials", [])]
    scales = np.array([1.0 if row is None else row.get("scale", 1.0) for row in rows], np.float64)
    return NormalMaps(tuple(_picture(document, binary, row) for row in rows), scales, kinds)


def _colours(document: dict[str, Any], binary: bytes) -> Colours:
    factors, pictures, cutoffs = [], [], []
    for material in document.get("materials", []):
        pbr = material["pbrMetallicRoughness"]
        factors.append(pbr["baseColorFactor"][:3])
        pictures.append(_picture(document, binary, pbr.get("baseColorTexture")))
        # Glass with holes, for which glTF has no mode, has its cutoff among its extras.
        given = material if material.get("alphaMode") == "MASK" else material.get("extras", {})
        cutoffs.append(float(given.get("alphaCutoff", 0.5 if given is material else 0.0)))
    return Colours(
        np.array(factors, np.float64).reshape(-1, 3), tuple(pictures), {}, np.array(cutoffs)
    )
