"""SUNCG's house.json -> records, checked (docs/spec/suncg.md sections 1.1-1.6); no effects."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.checked_json import json_from_bytes
from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.shown_text import shown

NODE_TYPES: Final = ("Room", "Object", "Ground", "Box")
# What a model or a texture may be called; a file name that stays in its folder.
NAME: Final = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.\-]{0,99}")

_COLOUR: Final = re.compile(r"#[0-9a-fA-F]{6}")
MAX_NODES: Final = 100_000


@dataclass(frozen=True, slots=True)
class Override:
    """What a node says of the model's material at the same position; None = keep the model's."""

    name: str
    texture: str | None
    diffuse: tuple[float, float, float] | None


@dataclass(frozen=True, slots=True, eq=False)
class Node:
    """A node of house.json that is valid."""

    id: str
    level_id: str
    kind: str
    place: str  # where it stands, for messages
    index: int  # its position in the level
    model_id: str
    house_from_model: F64  # (4, 4), identity for rooms and grounds
    bbox: F64 | None  # (2, 3)
    overrides: tuple[Override, ...]  # by position in the model's MTL
    state: int  # of a door or curtain, 0 = as modelled
    is_mirrored: bool | None  # as written; the transform decides
    dimensions: tuple[float, float, float]  # of a Box, m
    members: tuple[int, ...]  # positions of a room's nodes
    types: tuple[str, ...]  # of a room
    hidden: frozenset[str]  # Floor, Ceiling, Walls


@dataclass(frozen=True, slots=True, eq=False)
class HouseRecord:
    """house.json as read."""

    id: str
    version: str
    world_from_house: F64  # (4, 4) scale and axes
    levels: tuple[tuple[str, tuple[Node, ...]], ...]  # (level id, its nodes)
    unknown: tuple[tuple[str, str], ...] = ()  # (place, type) of valid nodes of no known type


def house_record(data: bytes, file: str) -> HouseRecord:
    """The records of house.json; nodes that are invalid or of no known type are left out.

    Raises BadHouse naming the level and the node where a value does not fit.
    """
    document = json_from_bytes(data, file)
    if not isinstance(document, dict):
        raise BadHouse(file, "", "expected an object; this is no SUNCG house.json")
    reader = JsonReader(file)
    raw_levels = reader.items(document, "levels", "")
    levels: list[tuple[str, tuple[Node, ...]]] = []
    unknown: list[tuple[str, str]] = []
    n_nodes = 0
    for i, level in enumerate(raw_levels):
        place = f"level {i}"
        if not isinstance(level, dict):
            raise BadHouse(file, place, "expected an object")
        if not _flag(level.get("valid", 1)):
            continue
        # Number levels without an id; an id that comes twice would mix two storeys.
        level_id = str(level["id"])[:40] if isinstance(level.get("id"), (str, int)) else str(i)
        if level_id in {known for known, _ in levels}:
            raise BadHouse(file, place, f"second level with the id {level_id!r}")
        raw_nodes = reader.items(level, "nodes", place)
        n_nodes += len(raw_nodes)
        if n_nodes > MAX_NODES:
            raise BadHouse(file, place, f"more than {MAX_NODES} nodes")
        nodes = [reader.node(raw, level_id, i, j) for j, raw in enumerate(raw_nodes)]
        levels.append((level_id, tuple(n for n in nodes if n is not None)))
        unknown += [
            (f"level {i} node {j}", shown(raw.get("type")))
            for j, raw in enumerate(raw_nodes)
            if raw.get("type") not in NODE_TYPES and _flag(raw.get("valid", 1))
        ]
    house_id = document.get("id")
    return HouseRecord(
        id=house_id if isinstance(house_id, str) else "",
        version=str(document.get("version", ""))[:80],
        world_from_house=world_from_house_of(reader, document),
        levels=tuple(levels),
        unknown=tuple(unknown),
    )


def world_from_house_of(reader: JsonReader, document: dict[str, Any]) -> F64:
    """(4, 4) metres, y up, z front <- the file's scaleToMeters, up and front."""
    # Check the scale and the two directions, whose lengths do not matter.
    scale = reader.numbers([document.get("scaleToMeters", 1)], 1, "scaleToMeters")[0]
    if not 1e-6 < scale < 1e6:
        raise BadHouse(reader.file, "scaleToMeters", f"{scale} is no scale")
    up = reader.numbers(document.get("up", [0, 1, 0]), 3, "up")
    front = reader.numbers(document.get("front", [0, 0, 1]), 3, "front")
    norms = np.linalg.norm(up) * np.linalg.norm(front)
    if not 1e-9 < norms < 1e9 or abs(up @ front) > 1e-6 * norms:
        raise BadHouse(reader.file, "up, front", "are not two directions at right angles")
    up, front = up / np.linalg.norm(up), front / np.linalg.norm(front)
    # Make the third axis of the two, so that the frame is right-handed.
    world_from_house = np.eye(4)
    world_from_house[:3, :3] = scale * np.array([np.cross(up, front), up, front])
    return world_from_house


def _flag(value: Any) -> bool:
    """Accept 0/1, "0"/"1", true/false; anything else counts as set."""
    return value not in (0, "0", False, None, "")


@dataclass(frozen=True, slots=True)
class JsonReader:
    """Reads values of one file, so that every rejection names it."""

    file: str

    def items(self, holder: dict[str, Any], key: str, place: str) -> list[Any]:
        """holder[key] as a list, or BadHouse."""
        value = holder.get(key)
        if not isinstance(value, list):
            where = f"{place}, {key}" if place else key
            raise BadHouse(self.file, where, "expected a list; this is no SUNCG house.json")
        return value

    def numbers(self, value: Any, n: int, place: str) -> F64:
        """(n,) finite numbers, or BadHouse."""
        fits = isinstance(value, list) and len(value) == n
        if not fits or not all(
            isinstance(v, (int, float)) and not isinstance(v, bool) for v in value
        ):
            raise BadHouse(self.file, place, f"expected {n} numbers")
        if not all(abs(v) < 1e12 for v in value):  # NaN and infinity fail too
            raise BadHouse(self.file, place, "holds a number that is not finite")
        return np.array(value, np.float64)

    def node(self, raw: Any, level_id: str, i: int, index: int) -> Node | None:
        """The node, or None if it is invalid or of no known type."""
        place = f"level {i} node {index}"
        if not isinstance(raw, dict):
            raise BadHouse(self.file, place, "expected an object")
        kind = raw.get("type")
        if not _flag(raw.get("valid", 1)) or kind not in NODE_TYPES:
            return None
        # Name nodes without an id by their place in the file.
        node_id = raw.get("id")
        node_id = node_id[:60] if isinstance(node_id, str) and node_id else f"{i}_{index}"
        place = f"{place} ({kind} {node_id})"
        hidden = {p for p in ("Floor", "Ceiling", "Walls") if _flag(raw.get(f"hide{p}", 0))}
        return Node(
            id=node_id,
            level_id=level_id,
            kind=kind,
            place=place,
            index=index,
            model_id=self._model_id(raw, kind, place),
            house_from_model=self._matrix(raw, kind, place),
            bbox=self._bbox(raw.get("bbox"), place),
            overrides=self.overrides(raw.get("materials"), place),
            state=self._state(raw.get("state"), place),
            is_mirrored=_flag(raw["isMirrored"]) if "isMirrored" in raw else None,
            dimensions=self._dimensions(raw, kind, place),
            members=self._members(raw.get("nodeIndices"), place),
            types=tuple(str(t)[:60] for t in _list(raw.get("roomTypes"))),
            hidden=frozenset(hidden),
        )

    def _model_id(self, raw: dict[str, Any], kind: str, place: str) -> str:
        if kind == "Box":
            return ""
        model_id = raw.get("modelId")
        if not isinstance(model_id, str) or not NAME.fullmatch(model_id):
            raise BadHouse(self.file, place, f"modelId {str(model_id)[:60]!r} is no model's name")
        return model_id

    def _matrix(self, raw: dict[str, Any], kind: str, place: str) -> F64:
        if kind in ("Room", "Ground") or "transform" not in raw:
            return np.eye(4)
        m = self.numbers(raw["transform"], 16, f"{place}, transform").reshape(4, 4).T
        if not np.allclose(m[3], [0, 0, 0, 1], atol=1e-6):
            raise BadHouse(self.file, f"{place}, transform", "is not affine (column-major)")
        if abs(np.linalg.det(m[:3, :3])) < 1e-12:
            raise BadHouse(self.file, f"{place}, transform", "flattens the model (determinant 0)")
        return np.asarray(m)

    def _bbox(self, raw: Any, place: str) -> F64 | None:
        if not isinstance(raw, dict) or "min" not in raw or "max" not in raw:
            return None
        return np.array([self.numbers(raw[k], 3, f"{place}, bbox.{k}") for k in ("min", "max")])

    def overrides(self, raw: Any, place: str) -> tuple[Override, ...]:
        """The entries of `materials`, none if there are none."""
        entries = _list(raw)
        if not all(isinstance(e, dict) for e in entries):
            raise BadHouse(self.file, f"{place}, materials", "expected a list of objects")
        return tuple(self._override(e, f"{place}, materials[{k}]") for k, e in enumerate(entries))

    def _override(self, entry: dict[str, Any], place: str) -> Override:
        texture, diffuse = entry.get("texture"), entry.get("diffuse")
        rgb = None
        if texture is not None and not (isinstance(texture, str) and NAME.fullmatch(texture)):
            raise BadHouse(self.file, place, f"texture {str(texture)[:60]!r} is no texture's name")
        if diffuse is not None:
            if not isinstance(diffuse, str) or not _COLOUR.fullmatch(diffuse):
                raise BadHouse(self.file, place, f"diffuse {str(diffuse)[:40]!r} is no #rrggbb")
            rgb = (
                int(diffuse[1:3], 16) / 255,
                int(diffuse[3:5], 16) / 255,
                int(diffuse[5:7], 16) / 255,
            )
        return Override(str(entry.get("name", ""))[:60], texture, rgb)

    def _state(self, raw: Any, place: str) -> int:
        text = str(int(raw) if isinstance(raw, bool) else "0" if raw is None else raw)
        if not re.fullmatch(r"\d{1,3}", text):
            raise BadHouse(self.file, f"{place}, state", f"{text[:40]!r} is no state")
        return int(text)

    def _dimensions(self, raw: dict[str, Any], kind: str, place: str) -> tuple[float, float, float]:
        if kind != "Box":
            return (0.0, 0.0, 0.0)
        x, y, z = (float(v) for v in self.numbers(raw.get("dimensions"), 3, f"{place}, dimensions"))
        if min(x, y, z) < 0 or not math.isfinite(x * y * z):
            raise BadHouse(self.file, f"{place}, dimensions", "must not be negative")
        return (x, y, z)

    def _members(self, raw: Any, place: str) -> tuple[int, ...]:
        entries = _list(raw)
        if not all(isinstance(e, int) and not isinstance(e, bool) for e in entries):
            raise BadHouse(self.file, f"{place}, nodeIndices", "expected a list of numbers")
        return tuple(entries)


def _list(value: Any) -> list[Any]:
    return value if isinstance(value, list) else []
