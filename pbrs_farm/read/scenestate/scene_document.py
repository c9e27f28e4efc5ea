"""A sceneState's JSON (like SUNCG v2's arch.json) -> its checked architecture and objects; no effects."""

from __future__ import annotations

import base64
import binascii
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any, Final
from urllib.parse import unquote_to_bytes

import numpy as np
from pydantic import BeforeValidator, Field

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.checked_json import Finite, checked
from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.frames import transform_points
from pbrs_farm.read.common.arch_elements import Element, element_of
from pbrs_farm.read.common.json_values import (
    Axes,
    Given,
    Label,
    Lenient,
    affine_of_columns,
    bounded_json,
    number_array,
)
from pbrs_farm.read.common.model_materials import ModelMaterials
from pbrs_farm.read.common.notes import Notes
from pbrs_farm.read.common.source_files import RootFolder
from pbrs_farm.read.suncg.arch_json import MAX_ELEMENTS

MAX_OBJECTS: Final = 20_000
_LEVEL_M: Final = 1e-6  # walls whose points differ less in z are drawn in a plan of x and y
_HINT: Final = "a sceneState has scene.arch.elements"


def _as_list(value: Any) -> Any:
    return [value.get(k) for k in "xyz"] if isinstance(value, dict) else value


_Direction = Annotated[F64, number_array(3), BeforeValidator(_as_list)]
_Scale = Annotated[Finite, Field(gt=1e-6, lt=1e6)]


class _Align(Given):
    up: _Direction | None = None
    front: _Direction | None = None


class AssetTransform(Given):
    """Transform of a source's models before placement."""

    align: _Align = Field(_Align(), alias="alignTo")
    scale: _Scale = Field(1.0, alias="scaleTo")
    centre: Annotated[F64, number_array(3)] | None = Field(None, alias="centerTo")


class _Matrix(Given):
    data: Annotated[F64, number_array(16, affine_of_columns)]


class _Object(Given):
    model: Label = Field(alias="modelId")
    transform: _Matrix


class _Arch(Given):
    elements: Annotated[list[Any], Field(max_length=MAX_ELEMENTS)]
    defaults: Any = None
    up: _Direction | None = None
    front: _Direction | None = None
    scale: _Scale | None = Field(None, alias="scaleToMeters")
    rooms: Annotated[tuple[Any, ...], Lenient] = ()
    materials: Annotated[tuple[Any, ...], Lenient] = ()
    textures: Annotated[tuple[Any, ...], Lenient] = ()
    images: Annotated[tuple[Any, ...], Lenient] = ()


class _Scene(Given):
    id: Any = ""
    up: _Direction | None = None
    front: _Direction | None = None
    unit: _Scale = 1.0
    transforms: dict[str, AssetTransform] = Field({}, alias="assetTransforms")
    arch: _Arch
    objects: Annotated[list[Any], Field(max_length=MAX_OBJECTS)] = Field([], alias="object")


class _Document(Given):
    scene: _Scene


@dataclass(frozen=True, slots=True, eq=False)
class PlacedModel:
    """An object: its model's source and id, and its pose."""

    place: str
    source: str
    model: str
    world_from_scene: F64  # (4, 4) metres, y up <- the scene's own frame and units
    scene_from_model: F64  # (4, 4) the object's matrix, model space after its source's transform
    asset: AssetTransform
    up: F64  # (3,) of the scene, to which models are aligned
    front: F64


@dataclass(frozen=True, slots=True, eq=False)
class SceneElement:
    """An element in the world (metres, y up), with the rooms that list it."""

    id: str
    element: Element
    rooms: tuple[str, ...]


@dataclass(frozen=True, slots=True, eq=False)
class SceneDocument:
    """A sceneState as read."""

    id: str
    elements: tuple[SceneElement, ...]
    room_types: dict[str, tuple[str, ...]]  # by the room's id, in the file's order
    objects: tuple[PlacedModel, ...]
    pictures: dict[str, str]  # name of a texture -> its data URL, "" if missing


def scene_document(data: bytes, file: str, notes: Notes) -> SceneDocument:
    """Parse a document into metres; BadHouse, naming the invalid element; unknown types are notes."""
    value = bounded_json(data, file)
    # Some exports nest the scene twice.
    for _ in range(2):
        inner = value.get("scene") if isinstance(value, dict) else None
        if isinstance(inner, dict) and "arch" not in inner and isinstance(inner.get("scene"), dict):
            value = inner
    scene = checked(_Document, value, file, error=BadHouse, hint=_HINT).scene
    arch = scene.arch
    up, front = _scene_axes(scene)
    world = Axes.model_construct(up=up, front=front, scale=scene.unit).world_from_house(file)
    arch_scale = arch.scale or scene.unit
    world_from_arch = Axes.model_construct(up=up, front=front, scale=arch_scale).world_from_house(
        file
    )
    pictures = _Pictures(arch)
    elements, taken = [], set()
    for i, raw in enumerate(arch.elements):
        place = f"scene.arch.elements[{i}]"
        raw = checked(dict, raw, file, place, error=BadHouse)
        element = element_of(file, pictures.resolved(raw), place, arch.defaults)
        if element is None:
            notes.add(
                "unknown-type", place, f"an element of the type {str(raw.get('type'))[:40]!r}"
            )
            continue
        name = str(raw.get("id") or f"e{i}")[:60]
        if name in taken:
            notes.add("duplicate-id", place, f"two elements are named {name!r}")
            name = f"{name}.{i}"
        taken.add(name)
        elements.append(
            SceneElement(
                name, _in_world(element, world_from_arch, arch_scale), _rooms_of_element(raw)
            )
        )
    objects = []
    for k, raw in enumerate(scene.objects):
        place = f"scene.object[{k}]"
        row = checked(_Object, raw, file, place, error=BadHouse)
        source, _, model = row.model.rpartition(".")
        asset = scene.transforms.get(source, AssetTransform())
        objects.append(
            PlacedModel(place, source, model, world, row.transform.data, asset, up, front)
        )
    return SceneDocument(
        str(scene.id)[:80], tuple(elements), _types(arch), tuple(objects), pictures.urls
    )


def _scene_axes(scene: _Scene) -> tuple[F64, F64]:
    """Up and front of the scene: given, else of the architecture, else z up where walls are level in z."""
    up = next((v for v in (scene.up, scene.arch.up) if v is not None), None)
    front = next((v for v in (scene.front, scene.arch.front) if v is not None), None)
    if up is None:
        heights = [_third(p) for raw in scene.arch.elements for p in _points_of_wall(raw)]
        is_z = bool(heights) and np.ptp([h for h in heights if h is not None] or [1, 0]) < _LEVEL_M
        up = np.array([0.0, 0.0, 1.0] if is_z else [0.0, 1.0, 0.0])
    if front is None:
        front = np.array([0.0, 1.0, 0.0] if abs(up[2]) > abs(up[1]) else [0.0, 0.0, 1.0])
    return up, front


def _points_of_wall(raw: Any) -> list[Any]:
    is_wall = isinstance(raw, dict) and raw.get("type") == "Wall"
    points = raw.get("points") if is_wall else None
    return points if isinstance(points, list) else []


def _third(point: Any) -> float | None:
    value = point[2] if isinstance(point, list) and len(point) == 3 else None
    return float(value) if isinstance(value, int | float) else None


def _in_world(e: Element, world_from_arch: F64, scale: float) -> Element:
    points = tuple(transform_points(world_from_arch, ring) for ring in e.points)
    holes = tuple((a * scale, b * scale, c * scale, d * scale) for a, b, c, d in e.holes)
    return replace(
        e, points=points, depth_m=e.depth_m * scale, height_m=e.height_m * scale, holes=holes
    )


def _rooms_of_element(raw: dict[str, Any]) -> tuple[str, ...]:
    room_ids = raw.get("roomId")
    names = room_ids if isinstance(room_ids, list) else [room_ids]
    return tuple(dict.fromkeys(str(name)[:60] for name in names if name not in (None, "")))


def _types(arch: _Arch) -> dict[str, tuple[str, ...]]:
    words_of_id: dict[str, tuple[str, ...]] = {}
    for row in arch.rooms:
        if isinstance(row, dict) and row.get("id") is not None:
            types = row.get("types")
            words = tuple(str(t)[:60] for t in types[:8]) if isinstance(types, list) else ()
            words_of_id[str(row["id"])[:60]] = words
    return words_of_id


class _Pictures:
    """The materials of an arch: an element's own, or by id through textures to images."""

    def __init__(self, arch: _Arch) -> None:
        self._materials, self._textures, self._images = (
            _by_id(rows) for rows in (arch.materials, arch.textures, arch.images)
        )
        self._names: dict[str, str] = {}  # texture id -> its name here
        self.urls: dict[str, str] = {}

    def resolved(self, raw: dict[str, Any]) -> dict[str, Any]:
        """The element with materials as arch.json has them, and its roomId as a text."""
        extra = {"extraHeight": raw["extra_height"]} if "extra_height" in raw else {}
        rows = raw.get("materials")
        materials = [self._material(row) for row in rows] if isinstance(rows, list) else []
        if len(materials) > 1 and str(materials[0]["name"]).lower() in ("outside", "surface2"):
            materials.reverse()
        # A thickness of 0 means not given.
        read = {k: v for k, v in raw.items() if not (k == "depth" and v in (0, None))}
        return read | extra | {"materials": materials, "roomId": "", "id": str(raw.get("id", ""))}

    def _material(self, row: Any) -> dict[str, Any]:
        row = row if isinstance(row, dict) else {}
        base = self._materials.get(str(row.get("materialId", "")), {})
        texture = _first(row, ("texture",)) or _first(base, ("texture", "map"))
        colour = row.get("diffuse") or base.get("diffuse") or base.get("color")
        material = {"name": str(row.get("name", ""))}
        if isinstance(colour, str) and colour.startswith("#"):
            material["diffuse"] = colour
        if texture or ("materialId" in row and not colour):
            material["texture"] = self._name(texture or str(row["materialId"]))
            material.pop("diffuse", None)
        return material

    def _name(self, texture: str) -> str:
        if texture not in self._names:
            self._names[texture] = f"picture_{len(self._names)}"
            image = _first(self._textures.get(texture, {}), ("imageId", "image")) or texture
            url = _first(self._images.get(image, {}), ("content", "url"))
            self.urls[self._names[texture]] = url
        return self._names[texture]


def _by_id(rows: Sequence[Any]) -> dict[str, dict[str, Any]]:
    rows_of_id: dict[str, dict[str, Any]] = {}
    for row in rows:
        if isinstance(row, dict) and (name := _first(row, ("id", "uuid", "name"))):
            rows_of_id.setdefault(name, row)
    return rows_of_id


def _first(row: dict[str, Any], names: tuple[str, ...]) -> str:
    return next((str(row[n]) for n in names if isinstance(row.get(n), str | int)), "")


class ArchMaterials(ModelMaterials):
    """The materials of the architecture, whose pictures the file itself holds."""

    def __init__(self, pictures: dict[str, str], folder: RootFolder, notes: Notes) -> None:
        super().__init__(folder, notes)
        self._pictures = pictures

    def _override_texture(self, name: str) -> str:
        return name

    def _picture(self, name: str) -> bytes | None:
        return _bytes_of(self._pictures.get(name, ""))


def _bytes_of(url: str) -> bytes | None:
    """The picture in a data URL; None for an empty one."""
    head, comma, body = url.partition(",")
    if not comma or not head.startswith("data:"):
        return None
    plain = unquote_to_bytes(body)
    try:
        return base64.b64decode(plain, validate=True) if head.endswith(";base64") else plain
    except (binascii.Error, ValueError):
        return b""
