"""Houses and views of a finished output folder (docs/formats.md), as plain values. Reads files."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np
from pydantic import TypeAdapter

from pbrs_farm.core import keys
from pbrs_farm.core.arrays import Points2
from pbrs_farm.core.checked_json import checked
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.shot import Shot, room_of_id
from pbrs_farm.core.shown_text import MAX_MESSAGE, shown
from pbrs_farm.regular_files import read_given
from pbrs_farm.store.object_store import LAYOUT


@dataclass(frozen=True, slots=True, eq=False)
class RoomOutline:
    """Floor polygon and height of a room."""

    polygon: Points2  # (N, 2) plan (x, z), metres, N >= 3
    floor_y: float  # world, metres


@dataclass(frozen=True, slots=True)
class OutputHouse:
    """A house of the folder; names and attribution are safe for display."""

    id: str
    name: str
    attribution: str  # the line to carry, or ""
    rooms: dict[str, str] = field(default_factory=dict)  # id -> name
    outlines: dict[str, RoomOutline] = field(default_factory=dict)  # by room id, if known


@dataclass(frozen=True, slots=True)
class ViewEntry:
    """A view of the folder."""

    house: OutputHouse
    id: str
    room_id: str
    room_name: str
    folder: Path
    facts: dict[str, Any] = field(default_factory=dict)  # view.json, {} if not written yet

    @property
    def shot(self) -> Shot:
        """The view's take, frame and camera of a rig."""
        return Shot.of_row(self.id, self.facts)

    def file(self, name: str) -> Path | None:
        """The path of the view's file of that name ("radiance.exr"), or None without one."""
        path = self.folder / name
        return path if path.is_file() else None


def views_of(root: Path) -> tuple[ViewEntry, ...]:
    """Every view below root/houses, then root/objects, by id; BadInput for no or a damaged folder."""
    if (root / LAYOUT).is_file():
        hint = "pbrs-farm pull ROOT --out FOLDER, then use FOLDER"
        raise BadInput(root, LAYOUT, "its views are packed, but files are needed", hint=hint)
    # Homes first, then objects without context.
    roots = [root / name for name in keys.FOLDERS if (root / name).is_dir()]
    if not roots:
        is_there = root.is_dir()
        text = (
            "not an output folder of pbrs-farm: it has no houses" if is_there else "no such folder"
        )
        raise BadInput(root, "", text, hint="give the output folder of a run")
    folders = [folder for below in roots for folder in sorted(below.iterdir())]
    return tuple(view for folder in folders for view in _views(folder))


def _views(folder: Path) -> Iterator[ViewEntry]:
    if not (folder / "views").is_dir():
        return
    house = _house(folder)
    for view in sorted(p for p in (folder / "views").iterdir() if p.is_dir()):
        facts = json_object(view / "view.json")
        room = _room_id(view.name, facts, house)
        yield ViewEntry(house, view.name, room, house.rooms.get(room, room), view, facts)


def _house(folder: Path) -> OutputHouse:
    # Clean each name once, where it is read.
    facts = json_object(folder / "house.json")
    source = facts.get("source") or {}
    rooms = {
        str(room["id"]): shown(room.get("name") or _first(room.get("types")))
        or f"Room {room['id']}"
        for room in facts.get("rooms") or ()
        if "id" in room
    }
    name = shown(facts.get("name") or folder.name)
    credit = shown(source.get("attribution") or "", MAX_MESSAGE)
    return OutputHouse(folder.name, name, credit, rooms, _outlines(facts.get("rooms") or ()))


def _outlines(rooms: Any) -> dict[str, RoomOutline]:
    outlines = {}
    for room in rooms:
        try:
            polygon, floor_y = np.array(room["polygon"], np.float64), float(room["floor_y"])
        except (KeyError, TypeError, ValueError):
            continue
        if polygon.ndim == 2 and polygon.shape[1] == 2 and len(polygon) >= 3:
            outlines[str(room["id"])] = RoomOutline(polygon, floor_y)
    return outlines


def _first(words: Any) -> str:
    return str(words[0]) if isinstance(words, list) and words else ""


def _room_id(view_id: str, facts: dict[str, Any], house: OutputHouse) -> str:
    room = facts.get("room") or facts.get("room_id") or ""
    room = room.get("id", "") if isinstance(room, dict) else room
    if room:
        return str(room)
    return room_of_id(view_id, house.rooms)


def reasons_of(root: Path) -> dict[tuple[str, str], str]:
    """(house id, view id) -> "" or the reason, of the last selection, or {}; BadInput if damaged."""
    run = json_object(root / keys.SELECTION).get("run")
    if not run:
        return {}
    path = root / keys.selection_key(str(run), "jsonl")
    if not path.is_file():
        return {}
    lines = read_given(path).splitlines()
    try:
        # A line per view, an empty reason where it is kept.
        rows = [json.loads(line) for line in lines]
        return {(row["house"], row["view"]): str(row["reason"]) for row in rows}
    except (ValueError, RecursionError, KeyError, TypeError):
        raise BadInput(path, "", "not the lines of a selection") from None


_OBJECT: Final = TypeAdapter(dict[str, Any])


def json_object(path: Path) -> dict[str, Any]:
    """The JSON object in a file; {} if there is no file. Raises BadInput for any other content."""
    return checked(_OBJECT, read_given(path), path) if path.exists() else {}
