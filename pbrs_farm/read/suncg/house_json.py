"""SUNCG's house.json -> records, checked (docs/spec/suncg.md sections 1.1-1.6); no effects."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Any, Final

import numpy as np
from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    FailFast,
    Field,
    PlainValidator,
    StrictInt,
    TypeAdapter,
)

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.checked_json import Finite, checked, exactly, json_from_bytes
from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.shown_text import shown

NODE_TYPES: Final = ("Room", "Object", "Ground", "Box")
# What a model or a texture may be called; a file name that stays in its folder.
NAME: Final = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.\-]{0,99}")

_COLOUR: Final = re.compile(r"#[0-9a-fA-F]{6}")
_LAST_ROW: Final = np.array([0.0, 0.0, 0.0, 1.0])
MAX_NODES: Final = 100_000


Number = Annotated[Finite, Field(gt=-1e12, lt=1e12)]


def numbers(n: int, then: Callable[[F64], F64] = np.asarray) -> PlainValidator:
    """In Annotated[F64, ...]: (n,) of a list of n numbers, as `then` makes it."""
    lists = TypeAdapter(Annotated[list[Number], exactly(n)])
    return PlainValidator(lambda value: then(np.array(lists.validate_python(value), np.float64)))


def _flag(value: Any) -> bool:
    """Accept 0/1, "0"/"1", true/false; anything else counts as set."""
    return value not in (0, "0", False, None, "")


def _file_name(value: str) -> str:
    if not NAME.fullmatch(value):
        raise ValueError(f"{value[:60]!r} is no name of a model or a texture")
    return value


def _rgb(value: Any) -> Any:
    if not isinstance(value, str) or not _COLOUR.fullmatch(value):
        raise ValueError(f"{str(value)[:40]!r} is no #rrggbb")
    return tuple(int(value[k : k + 2], 16) / 255 for k in (1, 3, 5))


def affine(column_major: F64) -> F64:
    m = column_major.reshape(4, 4).T
    if (np.abs(m[3] - _LAST_ROW) > 1e-6 + 1e-5 * _LAST_ROW).any():
        raise ValueError("is not affine (column-major)")
    if abs(np.linalg.det(m[:3, :3])) < 1e-12:
        raise ValueError("flattens the model (determinant 0)")
    return m


def _state(value: Any) -> int:
    text = str(int(value) if isinstance(value, bool) else "0" if value is None else value)
    if not re.fullmatch(r"\d{1,3}", text):
        raise ValueError(f"{text[:40]!r} is no state")
    return int(text)


def _bounds(value: Any) -> Any:
    return value if isinstance(value, dict) and {"min", "max"} <= value.keys() else None


FileName = Annotated[str, AfterValidator(_file_name)]
Label = Annotated[str, BeforeValidator(lambda value: str(value)[:60])]
Vector = Annotated[F64, numbers(3)]
Lenient: Final = BeforeValidator(lambda value: value if isinstance(value, list) else [])
_Size = Annotated[Number, Field(ge=0)]


class Given(BaseModel):
    """What an object of SUNCG's JSON says; what else it holds is passed over."""

    model_config = ConfigDict(frozen=True)


class Override(Given):
    """What a node says of the model's material at the same position; None = keep the model's."""

    name: Label = ""
    texture: FileName | None = None
    diffuse: Annotated[tuple[float, float, float], BeforeValidator(_rgb)] | None = None


Overrides = Annotated[tuple[Override, ...], FailFast(), Lenient]


class Bounds(Given):
    """A node's box."""

    min: Vector
    max: Vector


class Node(Given):
    """A node of house.json that is valid."""

    id: str
    level_id: str
    kind: str = Field(alias="type")
    place: str  # where it stands, for messages
    index: int  # its position in the level
    model_id: FileName = Field("", alias="modelId")
    # (4, 4), identity for rooms and grounds
    house_from_model: Annotated[F64, numbers(16, affine)] = Field(np.eye(4), alias="transform")
    bbox: Annotated[Bounds | None, BeforeValidator(_bounds)] = None
    overrides: Overrides = Field((), alias="materials")  # by position in the model's MTL
    # Of a door or curtain, 0 = as modelled.
    state: Annotated[int, BeforeValidator(_state)] = 0
    # As written; the transform decides.
    is_mirrored: Annotated[bool | None, BeforeValidator(_flag)] = Field(None, alias="isMirrored")
    dimensions: Annotated[tuple[_Size, _Size, _Size], exactly(3)] = (0.0, 0.0, 0.0)  # of a Box, m
    # Positions of a room's nodes, and what it is for.
    members: Annotated[tuple[StrictInt, ...], FailFast(), Lenient] = Field((), alias="nodeIndices")
    types: Annotated[tuple[Label, ...], FailFast(), Lenient] = Field((), alias="roomTypes")
    hidden: frozenset[str]  # Floor, Ceiling, Walls


# What a node of each type must say, and what of it is not read.
_NEEDED: Final = {k: {"dimensions" if k == "Box" else "modelId": None} for k in NODE_TYPES}
_UNREAD: Final = {"Object": ("dimensions",), "Box": ("modelId",)} | dict.fromkeys(
    ("Room", "Ground"), ("transform", "dimensions")
)


class Axes(Given):
    """The scale and the directions of a file, whose lengths do not matter."""

    scale: Annotated[Finite, Field(gt=1e-6, lt=1e6)] = Field(1.0, alias="scaleToMeters")
    up: Vector = np.array([0.0, 1.0, 0.0])
    front: Vector = np.array([0.0, 0.0, 1.0])

    def world_from_house(self, file: str) -> F64:
        """(4, 4) metres, y up, z front <- the file's."""
        norms = np.linalg.norm(self.up) * np.linalg.norm(self.front)
        if not 1e-9 < norms < 1e9 or abs(self.up @ self.front) > 1e-6 * norms:
            raise BadHouse(file, "up, front", "are not two directions at right angles")
        up, front = self.up / np.linalg.norm(self.up), self.front / np.linalg.norm(self.front)
        # Make the third axis of the two, so that the frame is right-handed.
        world_from_house = np.eye(4)
        world_from_house[:3, :3] = self.scale * np.array([np.cross(up, front), up, front])
        return world_from_house


class _House(Axes):
    id: Any = None
    version: Any = ""
    levels: list[Any]


class _Level(Given):
    id: Any = None
    nodes: list[Any]


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
    hint = "a SUNCG house.json has levels, and levels have nodes"
    document = checked(_House, json_from_bytes(data, file), file, error=BadHouse, hint=hint)
    levels: dict[str, tuple[Node, ...]] = {}
    unknown: list[tuple[str, str]] = []
    n_nodes = 0
    for i, raw_level in enumerate(document.levels):
        place = f"level {i}"
        if not _flag(checked(dict, raw_level, file, place, error=BadHouse).get("valid", 1)):
            continue
        level = checked(_Level, raw_level, file, place, error=BadHouse, hint=hint)
        # Number levels without an id; an id that comes twice would mix two storeys.
        level_id = str(level.id)[:40] if isinstance(level.id, (str, int)) else str(i)
        if level_id in levels:
            raise BadHouse(file, place, f"second level with the id {level_id!r}")
        n_nodes += len(level.nodes)
        if n_nodes > MAX_NODES:
            raise BadHouse(file, place, f"more than {MAX_NODES} nodes")
        nodes = []
        for j, raw in enumerate(level.nodes):
            node = _node(file, raw, level_id, i, j)
            if isinstance(node, Node):
                nodes.append(node)
            elif node is not None:
                unknown.append((f"{place} node {j}", node))
        levels[level_id] = tuple(nodes)
    return HouseRecord(
        id=document.id if isinstance(document.id, str) else "",
        version=str(document.version)[:80],
        world_from_house=document.world_from_house(file),
        levels=tuple(levels.items()),
        unknown=tuple(unknown),
    )


def _node(file: str, raw: Any, level_id: str, i: int, index: int) -> Node | str | None:
    """The node, its type where it is none that is known, or None where it is invalid."""
    place = f"level {i} node {index}"
    raw = checked(dict, raw, file, place, error=BadHouse)
    if not _flag(raw.get("valid", 1)):
        return None
    kind = raw.get("type")
    if kind not in NODE_TYPES:
        return shown(kind)
    # Name nodes without an id by their place in the file.
    node_id = raw.get("id")
    node_id = node_id[:60] if isinstance(node_id, str) and node_id else f"{i}_{index}"
    place = f"{place} ({kind} {node_id})"
    hidden = {p for p in ("Floor", "Ceiling", "Walls") if _flag(raw.get(f"hide{p}", 0))}
    read = _NEEDED[kind] | {k: v for k, v in raw.items() if k not in _UNREAD[kind]}
    read |= {"id": node_id, "level_id": level_id, "place": place, "index": index, "hidden": hidden}
    return checked(Node, read, file, place, error=BadHouse)
