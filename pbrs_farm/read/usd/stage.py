"""An OpenUSD stage (.usd, .usda, .usdc, .usdz) -> House, through the glTF reader. Reads files."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import shapely

from pbrs_farm.core import keys
from pbrs_farm.core.checked_json import json_from_bytes
from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.house import House, Item, Room, Source
from pbrs_farm.core.recipe import ReadFields
from pbrs_farm.home.room_use import named_kind
from pbrs_farm.installation import is_installed, need
from pbrs_farm.read.common.format import GivenFile
from pbrs_farm.read.common.notes import Notes
from pbrs_farm.read.common.source_files import SourceFiles
from pbrs_farm.read.gltf.scene import Beside, house_of_gltf, side_files
from pbrs_farm.regular_files import text_from_bytes

if TYPE_CHECKING:
    from pbrs_farm.read.usd.stage_files import StageFolder

_MOST_JSON_BYTES: Final = 16 * 2**20
ROOMS_ATTRIBUTE: Final = "pbrs:rooms"
"""Of the default prim: JSON of the rooms, as our own exports say them."""


def read_usd(given: GivenFile, fields: ReadFields) -> House:
    """The House of the file. Raises BadHouse naming the place."""
    path, models = given.path, given.models
    need("pxr")
    from pxr import UsdGeom

    from pbrs_farm.read.usd.prims import StageNodes
    from pbrs_farm.read.usd.shaders import Shaders
    from pbrs_farm.read.usd.stage_files import (
        FAULTS,
        StageFolder,
        damaged,
        diagnostics_in,
        opened_stage,
    )

    notes = Notes(path.name, strict=fields.strict)
    folder = StageFolder.of(path, models)
    with diagnostics_in(folder, notes) as diagnostics:
        stage = opened_stage(folder, notes, diagnostics)
        time = _time()
        shaders = Shaders(notes, lambda asset: _material_text(folder, asset), time)
        nodes = StageNodes(stage, path.name, notes, shaders, fields)
        scale = float(UsdGeom.GetStageMetersPerUnit(stage))
        is_z_up = UsdGeom.GetStageUpAxis(stage) == UsdGeom.Tokens.z
        rooms = _given_rooms(stage, folder, path, scale, is_z_up=is_z_up)
        try:
            gltf = nodes.gltf({"rooms": rooms} if rooms else {})
        except FAULTS as error:
            raise damaged(path, error) from None
    sha256 = keys.sha256(path.read_bytes())
    house = house_of_gltf(
        gltf,
        Source("usd", path.name, sha256, attribution=_credit(stage)),
        path.stem,
        fields,
        notes,
        Beside(
            lambda number: shaders.picture(int(number), folder.picture),
            mapping=_read_beside(folder, path, side_files(path)[0]),
        ),
    )
    if rooms:
        return house
    return replace(house, rooms=tuple(_name_by_scope(room, house.items) for room in house.rooms))


def companions_of_usd(given: GivenFile, files: SourceFiles) -> str:
    """Digest of the files that reading opens besides this one; "" if there are none."""
    path, models = given.path, given.models
    if not is_installed("pxr"):
        return ""
    from pbrs_farm.read.usd.stage_files import StageFolder, diagnostics_in, files_of_stage, try_out

    folder = StageFolder.of(path, models)
    notes = Notes(path.name, strict=False)
    beside = [_name_beside_stage(folder, path, name) for name in (*side_files(path), "rooms.json")]
    try:
        try_out(folder)
        with diagnostics_in(folder, notes):  # reading notes its warnings
            names = [name for name, _ in files_of_stage(folder)]
    except BadHouse:
        names = []
    own_name = folder.name_of(str(folder.path))
    return files.digest(folder.root, [n for n in (*names, *beside) if n != own_name])


def _time() -> Any:
    from pxr import Usd

    return Usd.TimeCode.EarliestTime()


def _credit(stage: Any) -> str:
    layer = stage.GetRootLayer()
    data = layer.customLayerData or {}
    return str(data.get("copyright") or "")[:500]


def _material_text(folder: StageFolder, asset: Any) -> str:
    """The text of a material's own file, "" where it is not there."""
    data = folder.picture(asset) if asset is not None and hasattr(asset, "resolvedPath") else None
    return "" if data is None else text_from_bytes(data[: 2**20], "replace")


def _name_beside_stage(folder: StageFolder, path: Path, name: str) -> str:
    """The name below the root of a file beside the stage."""
    own_name = folder.name_of(str(folder.path)) or path.name
    return str(Path(own_name).with_name(name))


def _read_beside(folder: StageFolder, path: Path, name: str) -> bytes | None:
    return folder.root.read(_name_beside_stage(folder, path, name), max_bytes=_MOST_JSON_BYTES)


def _given_rooms(
    stage: Any, folder: StageFolder, path: Path, scale: float, *, is_z_up: bool
) -> list[dict[str, Any]]:
    """Rooms in the form of a glTF scene's room file; [] if no source has any."""
    prim = stage.GetDefaultPrim()
    text = prim.GetAttribute(ROOMS_ATTRIBUTE).Get() if prim else None
    if text:
        value = json_from_bytes(str(text).encode(), path.name)
        return value if isinstance(value, list) else []
    name = side_files(path)[1]
    if (data := _read_beside(folder, path, name)) is not None:
        value = json_from_bytes(data, name)
        rooms = value.get("rooms") if isinstance(value, dict) else None
        if not isinstance(rooms, list):
            raise BadHouse(name, "rooms", 'expected {"rooms": [{"polygon": [[x, z], ...]}]}')
        return rooms
    if (data := _read_beside(folder, path, "rooms.json")) is None:
        return []
    value = json_from_bytes(data, "rooms.json")
    rows = value.get("rooms") if isinstance(value, dict) else value
    if not isinstance(rows, list):
        raise BadHouse(
            "rooms.json", "", 'expected [{"room_type": "...", "polygon": [[x, y], ...]}]'
        )
    return [_of_stage(row, f"[{i}]", scale, is_z_up=is_z_up) for i, row in enumerate(rows)]


def _of_stage(row: Any, place: str, scale: float, *, is_z_up: bool) -> dict[str, Any]:
    """A room in the stage's plan and unit, as a glTF room: x, z in metres."""
    polygon = row.get("polygon") if isinstance(row, dict) else None
    try:
        points = np.array([[float(c) for c in p][:2] for p in polygon or ()], np.float64)
        points = points.reshape(-1, 2) * scale * ([1, -1] if is_z_up else [1, 1])
    except (TypeError, ValueError):
        points = np.zeros((0, 2))
    if len(points) < 3 or not np.isfinite(points).all():
        raise BadHouse("rooms.json", f"{place}.polygon", "expected three or more points")
    word = str(row.get("room_type") or row.get("name") or "")
    return {"name": word, "types": [word] if word else [], "polygon": points.tolist()}


def _name_by_scope(room: Room, items: Sequence[Item]) -> Room:
    """The room, named after the USD scope that holds most of its items."""
    area: Any = shapely.Polygon(room.polygon)
    votes: Counter[str] = Counter()
    for item in items:
        if item.room_id != room.id and not item.kind.is_structure:
            continue
        if not item.surfaces or not _stands_in(item, room, area):
            continue
        for word in item.id.split("/")[1:-1]:
            if named_kind(word) is not None:
                votes[word] += 1
    return replace(room, name=votes.most_common(1)[0][0].replace("_", " ")) if votes else room


def _stands_in(item: Item, room: Room, area: Any) -> bool:
    low, high = item.bounds
    middle = (low + high) / 2
    fits = high[1] > room.floor_y - 0.3 and low[1] < room.ceiling_y
    return bool(fits and area.contains(shapely.Point(middle[0], middle[2])))
