"""A USD export of Apple's RoomPlan as the value of its JSON export. Effects: reads the file.

A stage of RoomPlan has a group of kind `group` for each wall (Wall0 with its Door0, Window1, Opening0),
for the floors, the sections and each category of objects. A shape is a box or a mesh in its own frame:
x along the wall, y up, z towards the room, the room's side at 0.
"""

from __future__ import annotations

import re
import statistics
from collections import defaultdict
from collections.abc import Iterator
from typing import Any, Final, NamedTuple

import numpy as np
import shapely
from pxr import Usd, UsdGeom

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.errors import BadHouse
from pbrs_farm.read.common.format import GivenFile
from pbrs_farm.read.common.notes import Notes
from pbrs_farm.read.usd.shapes import mesh_shape, solid_shape
from pbrs_farm.read.usd.stage_files import (
    FAULTS,
    StageFolder,
    damaged,
    diagnostics_in,
    opened_stage,
)

_OBJECTS: Final = "Object_grp"
_SECTIONS: Final = "Section_grp"
_NUMBER: Final = re.compile(r"_?\d+$")
_IN_WALLS: Final = {"Door": "doors", "Window": "windows", "Opening": "openings"}
_FILLED: Final = 0.98  # least share of a wall's rectangle that its convex outline covers if level
_PASSAGE_M: Final = (0.5, 1.5)  # least width and height of a hole that is a passage
_FOOT_M: Final = 0.25  # highest foot of a passage above its wall's foot
_LEVEL: Final = (1, 0, 0, 0, 0, 0, 1, 0, 0, -1, 0, 0)  # a floor's axes, by columns


class _Part(NamedTuple):
    """A shape of the stage in metres: axes right, up, out; triangles in that frame from its place."""

    name: str  # without its number
    in_objects: bool
    axes: F64  # (3, 3), a row each
    place: F64  # (3,)
    corners: F64  # (F, 3, 3)

    @property
    def world(self) -> F64:
        """(F, 3, 3) triangles in the world."""
        return np.asarray(self.corners @ self.axes + self.place)

    @property
    def low(self) -> F64:
        """(3,) least coordinates."""
        return np.asarray(self.corners.min((0, 1)))

    @property
    def high(self) -> F64:
        """(3,) largest coordinates."""
        return np.asarray(self.corners.max((0, 1)))


def scan_of_stage(given: GivenFile) -> dict[str, Any]:
    """The walls, doors, windows, openings, floors, objects and sections. Raises BadHouse without a wall."""
    notes = Notes(given.path.name, strict=False)
    folder = StageFolder.of(given.path, given.models)
    with diagnostics_in(folder, notes) as diagnostics:
        stage = opened_stage(folder, notes, diagnostics)
        try:
            parts = list(_parts(stage, given.path.name))
            sections = list(_sections(stage))
        except FAULTS as error:
            raise damaged(given.path, error) from None
    rows: dict[str, list[dict[str, Any]]] = defaultdict(list)
    walls = [p for p in parts if p.name == "Wall"]
    if not walls:
        raise BadHouse(given.path, "", "a scan of RoomPlan without a wall")
    for part in parts:
        if part.in_objects:
            category = part.name[:1].lower() + part.name[1:]
            rows["objects"].append(_row(part, part.low, part.high) | {"category": category})
        elif part.name in _IN_WALLS:
            rows[_IN_WALLS[part.name]].append(_row(part, part.low, part.high))
        elif part.name == "Floor":
            rows["floors"] += _floors(part, walls)
    in_walls = [p for p in parts if p.name in _IN_WALLS and not p.in_objects]
    for wall in walls:
        rows["walls"].append(_wall(wall))
        rows["openings"] += _passages(wall, in_walls)
    return {"objects": [], **rows, "sections": sections}


def _parts(stage: Any, file: str) -> Iterator[_Part]:
    metres = float(UsdGeom.GetStageMetersPerUnit(stage))
    cache = UsdGeom.XformCache(Usd.TimeCode.EarliestTime())
    for prim in Usd.PrimRange(stage.GetPseudoRoot(), Usd.TraverseInstanceProxies()):
        if not prim.IsA(UsdGeom.Gprim):
            continue
        path = str(prim.GetPath())
        time = Usd.TimeCode.EarliestTime()
        is_mesh = prim.IsA(UsdGeom.Mesh)
        shape = mesh_shape(prim, time, file) if is_mesh else solid_shape(prim, time)
        matrix = np.array(cache.GetLocalToWorldTransform(prim)) * [metres, metres, metres, 1]
        part = None if shape is None else _part(path, shape.positions[shape.faces], matrix)
        if part is not None:
            yield part


def _part(path: str, corners: F64, matrix: F64) -> _Part | None:
    """The shape with unit axes, x along it; None for a flattened shape or one that is not finite."""
    rows = matrix[:3, :3]
    lengths = np.linalg.norm(rows, axis=1)
    if not np.isfinite(matrix).all() or not (lengths > 1e-9).all():
        return None
    names = path.split("/")
    in_objects = f"{_OBJECTS}" in names
    axes, corners = rows / lengths[:, None], corners * lengths
    width, _height, depth = np.ptp(corners.reshape(-1, 3), axis=0)
    if depth > width and not in_objects and names[-1][:5] != "Floor":
        # A box of a wall along z: right, up, out are its -z, y, x.
        axes, corners = axes[[2, 1, 0]] * [[-1], [1], [1]], corners[:, :, [2, 1, 0]] * [-1, 1, 1]
    own_name = next((n for n in reversed(names) if _NUMBER.search(n)), names[-1])
    return _Part(_NUMBER.sub("", own_name), in_objects, axes, matrix[3, :3], corners)


def _row(part: _Part, low: F64, high: F64) -> dict[str, Any]:
    """A surface of RoomPlan: its width, height, depth, and the frame of its middle by columns."""
    middle = (low + high) / 2
    if not part.in_objects:
        middle[2] = np.clip(0.0, low[2], high[2])  # the room's side
    place = part.place + middle @ part.axes
    transform = np.zeros((4, 4))
    transform[:3, :3], transform[3] = part.axes, [*place, 1.0]
    return {"dimensions": (high - low).tolist(), "transform": transform.ravel().tolist()}


def _wall(part: _Part) -> dict[str, Any]:
    low, high = _inner_box(part)
    row = _row(part, low, high) | {"completedEdges": [1, 1]}
    outline: Any = shapely.MultiPoint(part.corners[:, :, :2].reshape(-1, 2)).convex_hull
    if outline.area < _FILLED * np.prod((part.high - part.low)[:2]):
        # Its top is sloped.
        middle = ((low + high) / 2)[:2]
        row["polygonCorners"] = (np.array(outline.exterior.coords[:-1]) - middle).tolist()
    return row


def _inner_box(part: _Part) -> tuple[F64, F64]:
    """The corners of a wall without its end beyond the next wall, which it has on one side."""
    low, high = part.low.copy(), part.high.copy()
    half = min(-low[0], high[0])
    if half > 0:
        low[0], high[0] = -half, half
    return low, high


def _passages(wall: _Part, in_walls: list[_Part]) -> Iterator[dict[str, Any]]:
    """Holes down to the floor in a wall's mesh that no door, window or opening fills."""
    low, high = _inner_box(wall)
    filled = shapely.union_all(_areas(wall.corners[:, :, :2]))
    boxes = []
    for part in in_walls:
        local = ((part.world - wall.place) @ wall.axes.T).reshape(-1, 3)
        if np.abs(local[:, 2]).max() < 0.5:
            boxes.append(shapely.box(*local.min(0)[:2], *local.max(0)[:2]))
    holes = shapely.box(low[0], low[1], high[0], high[1]).difference(filled)
    for hole in shapely.get_parts(holes):
        x0, y0, x1, y1 = hole.bounds
        is_hole = x1 - x0 >= _PASSAGE_M[0] and y1 - y0 >= _PASSAGE_M[1] and y0 < low[1] + _FOOT_M
        is_own = hole.area > 0.8 * (x1 - x0) * (y1 - y0)  # no corner below a slope
        if is_hole and is_own and shapely.union_all(boxes).intersection(hole).area < hole.area / 2:
            yield _row(wall, np.array([x0, y0, low[2]]), np.array([x1, y1, high[2]]))


def _floors(part: _Part, walls: list[_Part]) -> Iterator[dict[str, Any]]:
    """The outline of a floor seen from above, a row for each of its pieces between the walls."""
    world = part.world
    # Walls of meshes lie outside the room, and the floor reaches their outer side.
    under_walls = statistics.median(-w.low[2] if w.high[2] < 0.01 else 0.0 for w in walls)
    inside = shapely.union_all(_areas(world[:, :, [0, 2]])).buffer(-under_walls, join_style="mitre")
    for piece in shapely.get_parts(inside):
        corners = [[x, z, 0.0] for x, z in piece.exterior.coords[:-1]]
        place = [0.0, float(world[:, :, 1].max()), 0.0, 1.0]
        transform = [*_LEVEL, *place]
        yield {"dimensions": [1.0, 1.0, 0.0], "transform": transform, "polygonCorners": corners}


def _areas(triangles: F64) -> list[Any]:
    """Triangles (F, 3, 2) as polygons, without those seen from the side."""
    polygons: Any = shapely.polygons(triangles)
    return [p for p in polygons if p.area > 1e-6]


def _sections(stage: Any) -> Iterator[dict[str, Any]]:
    metres = float(UsdGeom.GetStageMetersPerUnit(stage))
    cache = UsdGeom.XformCache(Usd.TimeCode.EarliestTime())
    for prim in stage.Traverse():
        if prim.GetParent().GetName() == _SECTIONS and UsdGeom.Xformable(prim):
            place = np.array(cache.GetLocalToWorldTransform(prim))[3, :3] * metres
            label = _NUMBER.sub("", prim.GetName())
            yield {"label": label, "center": place.tolist()}
