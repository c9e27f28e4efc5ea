"""Rows of houses and views for the index. Effects: reads the store."""

from __future__ import annotations

import json
import math
from bisect import bisect_right
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import groupby
from typing import Any, Final

from pbrs_farm.board.index.stored_houses import view_keys
from pbrs_farm.board.root_reader import RootReader
from pbrs_farm.core import keys
from pbrs_farm.core.errors import PbrsError
from pbrs_farm.core.layers import LAYERS
from pbrs_farm.core.shot import room_of_id
from pbrs_farm.core.shown_text import MAX_MESSAGE, shown

LAYER_BIT: Final = {layer.name: 1 << k for k, layer in enumerate(LAYERS)}
_BIT_OF_FILE: Final = {layer.file: 1 << k for k, layer in enumerate(LAYERS)}
_MAX_WARNINGS: Final = 8  # maximum number per view


SIZES: Final = (0.1, 1.0, 5.0, 20.0)
"""Limits of bins: per cent of the picture."""
DISTANCES: Final = (1.0, 2.0, 3.0, 5.0)
"""Limits of bins: metres from the camera to the middle of an item."""


@dataclass(frozen=True, slots=True)
class ViewRow:
    """A view in the index."""

    id: str
    room: str  # printable name
    layers: int  # bit k: the file of LAYERS[k] exists
    classes: int  # bit k: NYU40 class k is in view
    warnings: tuple[str, ...]
    score: float = 0.0  # of the camera's choice, larger is better
    n_objects: int = 0  # instances in view
    lux: float | None = None  # of the room's floor by all light; None if not measured
    items: tuple[int, ...] = ()  # numbers of instances by the bins of SIZES, then of DISTANCES


@dataclass(frozen=True, slots=True)
class HouseRow:
    """A house in the index."""

    id: str
    name: str
    credit: str  # required credit line, or ""
    n_rooms: int
    views: tuple[ViewRow, ...]


def read_house(reader: RootReader, house: str) -> HouseRow:
    """A house and its views from the store, without damaged parts."""
    facts = reader.json_object(keys.house_key(house, "house.json"))
    source = facts.get("source")
    credit = source.get("attribution") if isinstance(source, dict) else ""
    rooms = _room_names(facts.get("rooms"))
    # Files of a view have keys below views/<view>/.
    prefix = keys.house_key(house, "views/")
    named = (key.removeprefix(prefix).partition("/") for key in view_keys(reader, house))
    views = [
        _view_row(reader, house, view, {file for _view, _slash, file in group}, rooms)
        for view, group in groupby(sorted(p for p in named if p[2]), key=lambda p: p[0])
    ]
    name = shown(facts.get("name") or house)
    return HouseRow(house, name, shown(credit or "", MAX_MESSAGE), len(rooms), tuple(views))


def _room_names(rooms: Any) -> dict[str, str]:
    """Room id -> name, or else type, or else id."""
    names: dict[str, str] = {}
    for room in rooms if isinstance(rooms, list) else ():
        if isinstance(room, dict) and "id" in room:
            types = room.get("types")
            kind = types[0] if isinstance(types, list) and types else ""
            names[str(room["id"])] = shown(room.get("name") or kind) or f"Room {room['id']}"
    return names


def _view_row(
    reader: RootReader, house: str, view: str, files: set[str], rooms: Mapping[str, str]
) -> ViewRow:
    facts: dict[str, Any] = {}
    if "view.json" in files:
        facts = reader.json_object(keys.view_key(house, view, "view.json"))
    room = str(facts.get("room") or room_of_id(view, rooms))
    warnings = facts.get("warnings")
    texts = [shown(w, MAX_MESSAGE) for w in warnings] if isinstance(warnings, list) else []
    return ViewRow(
        id=view,
        room=rooms.get(room) or shown(room) or "?",
        layers=sum(_BIT_OF_FILE.get(file, 0) for file in files),
        classes=_class_bits(facts.get("instances")),
        warnings=tuple(texts[:_MAX_WARNINGS]),
        score=finite(facts.get("score")),
        n_objects=len(instances) if isinstance(instances := facts.get("instances"), list) else 0,
        lux=_lux(facts),
        items=_items(facts),
    )


def finite(value: Any) -> float:
    """A finite number of a stored file; 0 for any other value."""
    is_number = isinstance(value, int | float) and math.isfinite(value)
    return float(value) if is_number else 0.0


def _lux(facts: dict[str, Any]) -> float | None:
    modes = facts.get("modes")
    light = modes.get("light") if isinstance(modes, dict) else None
    by_group = light.get("floor_lux") if isinstance(light, dict) else None
    return sum(map(finite, by_group.values())) if isinstance(by_group, dict) else None


def _items(facts: Mapping[str, Any]) -> tuple[int, ...]:
    rows = facts.get("instances")
    sizes, distances = [0] * (len(SIZES) + 1), [0] * (len(DISTANCES) + 1)
    for row in rows if isinstance(rows, list) else ():
        if not isinstance(row, dict):
            continue
        sizes[bisect_right(SIZES, 100 * finite(row.get("fraction")))] += 1
        try:
            eye = [float(line[3]) for line in facts["world_from_camera_opencv"][:3]]
            metres = math.dist(eye, row["box3d"]["centre"])
        except (KeyError, IndexError, TypeError, ValueError):
            continue
        distances[bisect_right(DISTANCES, metres)] += 1
    return (*sizes, *distances)


def _class_bits(instances: Any) -> int:
    bits = 0
    for row in instances if isinstance(instances, list) else ():
        nyu40 = row.get("nyu40") if isinstance(row, dict) else None
        if isinstance(nyu40, int) and 0 <= nyu40 <= 40:
            bits |= 1 << nyu40
    return bits


def verdicts(reader: RootReader) -> dict[tuple[str, str], str]:
    """(house, view) -> reason of the last selection, "" for kept; {} if it is missing or damaged."""
    run = reader.json_object(keys.SELECTION).get("run")
    if not run:
        return {}
    try:
        data = reader.get(keys.selection_key(str(run), "jsonl"), 4 * 2**30)
        rows = [json.loads(line) for line in data.splitlines()]
        return {(str(r["house"]), str(r["view"])): shown(r["reason"]) for r in rows}
    except (PbrsError, ValueError, RecursionError, KeyError, TypeError):
        return {}


def selection_fingerprint(reader: RootReader) -> str:
    """Digest of the last selection, "" without one."""
    data = reader.get_or_none(keys.SELECTION)
    return "" if data is None else keys.sha256(data)
