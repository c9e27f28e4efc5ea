"""Parse and check a 3D-FRONT house's JSON (metres, y up; only furniture has a placement); no effects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from pbrs_farm.core.arrays import F64, I32
from pbrs_farm.core.checked_json import checked
from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.frames import affine, rotation_of_quaternion
from pbrs_farm.read.common.json_values import bounded_json
from pbrs_farm.read.common.notes import Notes

MAX_ENTRIES: Final = 100_000
_HINT: Final = "a 3D-FRONT house has furniture, mesh and scene"
_FARTHEST_M: Final = 1e6


@dataclass(frozen=True, slots=True, eq=False)
class FrontMesh:
    """A mesh of the structure, world."""

    uid: str
    kind: str  # its type, as written
    points: F64
    faces: I32
    uvs: F64 | None
    material: str
    room: str  # instanceid of its room, "" = none
    place: str


@dataclass(frozen=True, slots=True, eq=False)
class FrontPiece:
    """A piece of furniture where a room's child places it."""

    uid: str
    jid: str
    title: str
    category: str
    size: tuple[float, float, float] | None  # width, height, depth
    world_from_model: F64  # (4, 4)
    scale: F64  # (3,)
    room: str
    place: str


@dataclass(frozen=True, slots=True)
class FrontDoor:
    """A door of extension.door."""

    is_entry: bool
    hinge: str  # innerLeft, innerRight, outerLeft, outerRight
    refs: tuple[str, ...]


@dataclass(frozen=True, slots=True, eq=False)
class FrontLight:
    """A light where a child places it."""

    at: F64
    ref: str
    kelvin: float
    room: str


@dataclass(frozen=True, slots=True)
class FrontRoom:
    """A room of the scene."""

    id: str  # its instanceid
    kind: str
    is_empty: bool


@dataclass(frozen=True, slots=True, eq=False)
class FrontFile:
    """A house as read."""

    uid: str
    meshes: tuple[FrontMesh, ...]
    pieces: tuple[FrontPiece, ...]
    rooms: tuple[FrontRoom, ...]
    doors: tuple[FrontDoor, ...]
    lights: tuple[FrontLight, ...]
    materials: dict[str, dict[str, Any]]


def front_file(data: bytes, file: str, notes: Notes) -> FrontFile:
    """Parse a house, without the models of its pieces; BadHouse, naming the invalid entry."""
    value = checked(dict, bounded_json(data, file), file, error=BadHouse, hint=_HINT)
    scene = value.get("scene")
    if not value.get("mesh") or not isinstance(scene, dict) or not scene.get("room"):
        missing = next(k for k in ("mesh", "scene.room") if k != "mesh" or not value.get("mesh"))
        raise BadHouse(file, missing, "is missing or empty", hint=_HINT)
    rows = {k: _rows_of_key(value, k, file) for k in ("mesh", "furniture", "material", "lights")}
    rooms, children = _parse_front_rooms(scene, file, notes)
    room_of = {str(c["ref"]): room for room, c, _ in reversed(children)}
    meshes = _meshes(rows["mesh"], room_of, file, notes)
    entries: dict[str, dict[str, Any]] = {}
    for row in rows["furniture"]:
        entries.setdefault(str(row.get("uid")), row)
    lamps = {str(row.get("instanceid", "")) for row in rows["lights"]}
    pieces, places = _parse_front_pieces(
        children, entries, {m.uid for m in meshes}, lamps, file, notes
    )
    extension = value.get("extension")
    doors = extension.get("door") if isinstance(extension, dict) else None
    return FrontFile(
        uid=str(value.get("uid", ""))[:80],
        meshes=meshes,
        pieces=pieces,
        rooms=rooms,
        doors=tuple(_door(d) for d in doors if isinstance(d, dict))
        if isinstance(doors, list)
        else (),
        lights=tuple(_parse_front_lights(rows["lights"], places)),
        materials={str(m.get("uid")): m for m in rows["material"]},
    )


def _rows_of_key(value: dict[str, Any], key: str, file: str) -> list[dict[str, Any]]:
    rows = value.get(key)
    rows = [] if rows is None else checked(list, rows, file, key, error=BadHouse)
    if len(rows) > MAX_ENTRIES:
        raise BadHouse(file, key, f"{len(rows)} entries, at most {MAX_ENTRIES} are read")
    return [checked(dict, r, file, f"{key}[{k}]", error=BadHouse) for k, r in enumerate(rows)]


def _parse_front_rooms(
    scene: dict[str, Any], file: str, notes: Notes
) -> tuple[tuple[FrontRoom, ...], list[tuple[str, dict[str, Any], str]]]:
    rooms: dict[str, FrontRoom] = {}
    children: list[tuple[str, dict[str, Any], str]] = []
    for k, row in enumerate(_rows_of_key(scene, "room", file)):
        place = f"scene.room[{k}]"
        name = str(row.get("instanceid") or f"room {k}")[:80]
        if name in rooms:
            notes.add("duplicate-id", place, f"two rooms are named {name!r}")
            name = f"{name}.{k}"
        rooms[name] = FrontRoom(name, str(row.get("type", ""))[:60], row.get("empty") in (1, True))
        for j, child in enumerate(_rows_of_key(row, "children", file)):
            if child.get("ref") is not None:
                children.append((name, child, f"{place}.children[{j}]"))
        if len(children) > MAX_ENTRIES:
            raise BadHouse(file, place, f"more than {MAX_ENTRIES} children")
    return tuple(rooms.values()), children


def numbers(value: Any, n: int, file: str, place: str) -> F64:
    """(n,) finite numbers of a list, or all where n is 0; BadHouse, naming the place, also from 1e12 on."""
    try:
        vector = np.array(value if isinstance(value, list) else [None], np.float64)
    except (ValueError, TypeError, OverflowError):
        raise BadHouse(file, place, "is not a list of numbers") from None
    if vector.ndim != 1 or (n and len(vector) != n):
        raise BadHouse(file, place, f"expected {n or 'a flat list of'} numbers")
    if not (np.isfinite(vector) & (np.abs(vector) < 1e12)).all():
        raise BadHouse(file, place, "has a number that is not finite, or too large")
    return vector


def _meshes(
    rows: Sequence[dict[str, Any]], room_of: dict[str, str], file: str, notes: Notes
) -> tuple[FrontMesh, ...]:
    meshes: dict[str, FrontMesh] = {}
    for k, row in enumerate(rows):
        place = f"mesh[{k}]"
        # Published uids have up to 84 characters, so they are kept whole.
        uid = str(row.get("uid") or place)
        flat = numbers(row.get("xyz"), 0, file, f"{place}.xyz")
        index = numbers(row.get("faces"), 0, file, f"{place}.faces")
        if len(flat) % 3 or len(index) % 3:
            raise BadHouse(file, f"{place}.xyz", "is not a list of corners: not three numbers each")
        points, faces = flat.reshape(-1, 3), index.reshape(-1, 3).astype(np.int32)
        if len(faces) and not (faces.min() >= 0 and faces.max() < len(points)):
            raise BadHouse(
                file, f"{place}.faces", f"names a corner beyond the {len(points)} there are"
            )
        if not len(faces):
            continue
        key = uid
        if uid in meshes:
            if np.array_equal(meshes[uid].points[meshes[uid].faces], points[faces]):
                notes.add("duplicate-id", place, f"a copy of mesh {uid[:80]!r}; left out")
                continue
            notes.add("duplicate-id", place, f"two meshes are named {uid[:80]!r}")
            key = f"{uid} ({place})"
        uvs = None
        if row.get("uv"):
            pairs = numbers(row["uv"], 0, file, f"{place}.uv")
            uvs = pairs.reshape(-1, 2) if len(pairs) == 2 * len(points) else None
        meshes[key] = FrontMesh(
            uid,
            str(row.get("type", ""))[:60],
            points,
            faces,
            uvs,
            str(row.get("material", "")),
            room_of.get(uid, ""),
            f"{place} ({str(row.get('type', ''))[:40]})",
        )
    return tuple(meshes.values())


def _parse_front_pieces(
    children: Sequence[tuple[str, dict[str, Any], str]],
    entries: dict[str, dict[str, Any]],
    meshes: set[str],
    lamps: set[str],
    file: str,
    notes: Notes,
) -> tuple[tuple[FrontPiece, ...], list[tuple[str, F64, str]]]:
    """The placed pieces, and (ref, location, room) of every child that is not a mesh."""
    pieces, places = [], []
    n_missing = n_invalid = n_flat = 0
    for room, child, place in children:
        ref = str(child["ref"])
        if ref in meshes:
            continue
        location = numbers(child.get("pos"), 3, file, f"{place}.pos")
        turn = numbers(child.get("rot", [0, 0, 0, 1]), 4, file, f"{place}.rot")
        scale = numbers(child.get("scale", [1, 1, 1]), 3, file, f"{place}.scale")
        places.append((ref, location, room))
        entry = entries.get(ref)
        if entry is None:
            n_missing += ref.removesuffix("/model") not in lamps  # a light alone is no piece
            continue
        if entry.get("valid") is False:
            n_invalid += 1
            continue
        length = float(np.linalg.norm(turn))
        if length < 1e-6 or np.abs(scale).min() < 0.01 or np.abs(scale).max() > 10:
            n_flat += 1
            continue
        x, y, z, w = turn / length
        world = affine(rotation_of_quaternion(w, x, y, z) * scale, location)
        pieces.append(
            FrontPiece(
                ref,
                str(entry.get("jid") or "")[:100],
                str(entry.get("title") or "")[:100],
                str(entry.get("category") or "")[:100],
                _size_of_entry(entry),
                world,
                scale,
                room,
                place,
            )
        )
    for n, why in (
        (n_missing, "name no entry"),
        (n_invalid, "name an invalid piece"),
        (n_flat, "are flat or huge"),
    ):
        if n:
            notes.add("missing-piece", "scene.room", f"{n} children {why}: left out")
    return tuple(pieces), places


def _size_of_entry(entry: dict[str, Any]) -> tuple[float, float, float] | None:
    """Width, height, depth: `size` has depth before height; `bbox` alone has them in order."""
    for key, order in (("size", (0, 2, 1)), ("bbox", (0, 1, 2))):
        value = entry.get(key)
        while isinstance(value, list) and len(value) == 1:
            value = value[0]
        if isinstance(value, list) and len(value) == 3:
            numbers_ = [v for v in value if isinstance(v, int | float) and 0 < v < 30]
            if len(numbers_) == 3:
                width, height, depth = (float(value[k]) for k in order)
                return width, height, depth
    return None


def _door(row: dict[str, Any]) -> FrontDoor:
    refs = row.get("ref")
    names = refs if isinstance(refs, list) else [refs]
    return FrontDoor(
        row.get("type") == "entryDoor", str(row.get("dir", "")), tuple(str(n) for n in names if n)
    )


def _parse_front_lights(
    rows: Sequence[dict[str, Any]], places: Sequence[tuple[str, F64, str]]
) -> list[FrontLight]:
    by_ref: dict[str, list[tuple[str, F64, str]]] = {}
    for child in places:
        by_ref.setdefault(child[0].removesuffix("/model"), []).append(child)
    front_lights = []
    for row in rows:
        kind = str(row.get("nodeType", ""))
        if "Sun" in kind or row.get("skylightPortal") in (1, True):
            continue  # the sky is the recipe's
        kelvin = row.get("color_temperature")
        warm = float(kelvin) if isinstance(kelvin, int | float) and 1000 <= kelvin <= 20000 else 0.0
        for ref, location, room in by_ref.get(str(row.get("instanceid", "")), ()):
            if np.abs(location).max() < _FARTHEST_M:
                front_lights.append(FrontLight(location, ref, warm, room))
    return front_lights
