"""SUNCG's house.json -> records, checked (docs/spec/suncg.md sections 1.1-1.6); no effects."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Annotated, Any, Final

import numpy as np
from pydantic import BeforeValidator, FailFast, Field, StrictInt

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.checked_json import checked, exactly, json_from_bytes
from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.shown_text import shown
from pbrs_farm.read.common.json_values import (
    Axes,
    FileName,
    Given,
    Label,
    Lenient,
    Number,
    Overrides,
    Vector,
    affine_of_columns,
    number_array,
)

NODE_TYPES: Final = ("Room", "Object", "Ground", "Box")

MAX_NODES: Final = 100_000


def _flag(value: Any) -> bool:
    """Accept 0/1, "0"/"1", true/false; anything else counts as set."""
    return value not in (0, "0", False, None, "")


def _parse_state(value: Any) -> int:
    text = str(int(value) if isinstance(value, bool) else "0" if value is None else value)
    if not re.fullmatch(r"\d{1,3}", text):
        raise ValueError(f"{text[:40]!r} is not a state")
    return int(text)


def _bounds(value: Any) -> Any:
    return value if isinstance(value, dict) and {"min", "max"} <= value.keys() else None


_Size = Annotated[Number, Field(ge=0)]


class Bounds(Given):
    """A node's box."""

    min: Vector
    max: Vector


class Node(Given):
    """A valid node of house.json."""

    id: str
    level_id: str
    kind: str = Field(alias="type")
    place: str  # location in the file, for messages
    index: int  # its position in the level
    model_id: FileName = Field("", alias="modelId")
    # (4, 4), identity for rooms and grounds
    house_from_model: Annotated[F64, number_array(16, affine_of_columns)] = Field(
        np.eye(4), alias="transform"
    )
    bbox: Annotated[Bounds | None, BeforeValidator(_bounds)] = None
    overrides: Overrides = Field((), alias="materials")  # by position in the model's MTL
    # Of a door or curtain, 0 = as modelled.
    state: Annotated[int, BeforeValidator(_parse_state)] = 0
    # As written; the transform decides.
    is_mirrored: Annotated[bool | None, BeforeValidator(_flag)] = Field(None, alias="isMirrored")
    dimensions: Annotated[tuple[_Size, _Size, _Size], exactly(3)] = (0.0, 0.0, 0.0)  # of a Box, m
    # Indices of a room's nodes, and its types.
    members: Annotated[tuple[StrictInt, ...], FailFast(), Lenient] = Field((), alias="nodeIndices")
    types: Annotated[tuple[Label, ...], FailFast(), Lenient] = Field((), alias="roomTypes")
    hidden: frozenset[str]  # Floor, Ceiling, Walls


# Required fields of each node type, and its ignored fields.
_NEEDED: Final = {k: {"dimensions" if k == "Box" else "modelId": None} for k in NODE_TYPES}
_UNREAD: Final = {"Object": ("dimensions",), "Box": ("modelId",)} | dict.fromkeys(
    ("Room", "Ground"), ("transform", "dimensions")
)


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
    """The records of house.json without invalid nodes; BadHouse, naming level and node of a bad value."""
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
    """The node, the name of its unknown type, or None for an invalid node."""
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
