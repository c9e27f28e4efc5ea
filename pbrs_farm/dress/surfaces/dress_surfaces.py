"""The pass `surfaces`: gives every room of the house its floor, walls, ceiling and skirting boards."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.catalogue import Catalogue
from pbrs_farm.core.frames import srgb_from_linear
from pbrs_farm.core.house import Item, ItemKind, Surface
from pbrs_farm.dress.finish_scheme import FinishScheme, finish_scheme
from pbrs_farm.dress.mutable_house import MutableHouse
from pbrs_farm.dress.patterns import Pattern, PatternMaterial, pattern_material, photographed
from pbrs_farm.dress.space.house_space import RoomSpace, house_space
from pbrs_farm.dress.style import Style, room_style
from pbrs_farm.dress.surface_finishes import (
    Finish,
    is_plain,
    item_with_finish,
    number_of_finish,
    with_finish,
)
from pbrs_farm.dress.surfaces.home_finish import (
    WOOD_FLOORS,
    Floor,
    HomeFinish,
    WallFinish,
    covered,
    floor_of,
    home_finish,
    walls_of,
)
from pbrs_farm.dress.surfaces.sided_walls import RoomFinder, SidedWall, sided_wall
from pbrs_farm.dress.surfaces.skirting import BASEBOARD, has_boards, skirting_board, wall_plans
from pbrs_farm.dress.surfaces.wall_materials import REVEAL, RestOfWall, RoomWalls, painted_wall
from pbrs_farm.home.room_use import RoomKind

PASS = "surfaces"
_KEPT_SHARE = 0.1  # share of photographed floors and walls kept


def room_frame(area: BaseGeometry) -> tuple[F64, F64]:
    """(2,) a corner in plan and (2, 2) unit rows of the least rectangle, sense fixed; or the world's axes."""
    if area.is_empty:
        return np.zeros(2), np.eye(2)
    box = shapely.get_coordinates(shapely.minimum_rotated_rectangle(area))[:4]
    if len(box) < 4:
        return np.zeros(2), np.eye(2)
    sides = box[[1, 2]] - box[[0, 1]]
    lengths = np.linalg.norm(sides, axis=1)
    along = sides[int(lengths.argmax())] / max(float(lengths.max()), 1e-9)
    # Settle which way round, so that the frame does not depend on where the outline begins.
    if along[0] < -1e-9 or (abs(along[0]) < 1e-9 and along[1] < 0):
        along = -along
    across = np.array([-along[1], along[0]])
    axes = np.stack([along, across])
    return np.asarray(axes.T @ (box @ axes.T).min(0)), axes


def laid(item: Item, material: PatternMaterial, area: BaseGeometry, turn_rad: float) -> Item:
    """The floor or ceiling with that material; u along the room's longer side, then turned."""
    origin, axes = room_frame(area)
    c, s = np.cos(turn_rad), np.sin(turn_rad)
    turned = np.array([[c, s], [-s, c]]) @ axes
    return replace(item, surfaces=tuple(_laid(f, material, origin, turned) for f in item.surfaces))


def _laid(surface: Surface, material: PatternMaterial, origin: F64, axes: F64) -> Surface:
    plan = surface.positions[:, [0, 2]].astype(np.float64) - origin
    u, v = (plan @ axes[k] / material.size_m[k] for k in (0, 1))
    # Seen from above x runs right and z towards the viewer: v grows away, against z.
    uvs = np.stack([u, -v], -1).astype(np.float32)
    return replace(surface, uvs=uvs, material=material.number)


@dataclass(frozen=True, slots=True)
class _RoomFinish:
    # Finishes of one room; None keeps the source's.
    space: RoomSpace
    floor: Floor | None
    walls: WallFinish | None


def dress_surfaces(house: MutableHouse, catalogue: Catalogue, style: Style, share: float) -> None:
    """Give a share of the rooms floors, walls and ceilings of the style, and skirting boards."""
    rooms = house_space(house).rooms
    home = home_finish(house.rng(PASS, "home"), style)
    finishes = [_room_finish(house, catalogue, style, home, room, share) for room in rooms]
    _lay_floors(house, home, finishes)
    scheme = finish_scheme(house, style)
    _paint_walls(house, scheme, finishes)
    _set_boards(house, home, scheme, finishes)


def _room_finish(
    house: MutableHouse,
    catalogue: Catalogue,
    style: Style,
    home: HomeFinish,
    room: RoomSpace,
    share: float,
) -> _RoomFinish:
    # Separate streams: draws of one room do not affect another.
    rng = house.rng(PASS, room.room.id)
    taste = room_style(style, rng)
    floor = floor_of(house.rng(PASS, room.room.id, "floor"), taste, home, room.kind)
    walls = walls_of(house.rng(PASS, room.room.id, "walls"), taste, home, room.kind)
    if walls is not None:
        walls = covered(house.rng(PASS, room.room.id, "cover"), taste, walls, room.kind)
    if rng.random() >= share:
        return _RoomFinish(room, None, None)
    # Now and then a photographed floor stays.
    if rng.random() < _KEPT_SHARE and _is_photographed(house, f"floor_{room.room.id}"):
        floor = None
    # Libraries may have photographs of the drawn kind.
    if floor is not None:
        floor = replace(floor, pattern=photographed(house, catalogue, floor.pattern))
    if walls is not None:
        main, accent, low = (
            None if p is None else photographed(house, catalogue, p)
            for p in (walls.main, walls.accent, walls.low)
        )
        walls = replace(walls, main=main or walls.main, accent=accent, low=low)
    return _RoomFinish(room, floor, walls)


def _is_photographed(house: MutableHouse, item_id: str) -> bool:
    return any(
        house.materials[s.material].texture_id is not None
        for item in house.items
        if item.id == item_id
        for s in item.surfaces
    )


def _lay_floors(house: MutableHouse, home: HomeFinish, finishes: list[_RoomFinish]) -> None:
    of_room = {f.space.room.id: f for f in finishes}
    for index, item in enumerate(house.items):
        finish = of_room.get(item.room_id or "")
        if finish is None or item.kind not in (ItemKind.FLOOR, ItemKind.CEILING):
            continue
        if item.kind is ItemKind.CEILING:
            # Rooms without new finishes keep their ceilings too.
            if finish.walls is None:
                continue
            pattern, turn = home.ceiling, 0.0
        elif finish.floor is not None:
            pattern, turn = finish.floor.pattern, finish.floor.turn_rad
        else:
            continue
        material = pattern_material(house, pattern)
        house.change(index, laid(item, material, finish.space.area, turn), PASS)
        house.done[f"{PASS}: {pattern.family} {item.kind}"] += 1


def _paint_walls(mutable: MutableHouse, scheme: FinishScheme, finishes: list[_RoomFinish]) -> None:
    house = mutable.source
    finder = RoomFinder(house.rooms, [f.space.area for f in finishes])
    walls = {
        index: sided_wall(item, finder)
        for index, item in enumerate(mutable.items)
        if item.kind is ItemKind.WALL and item.n_faces and BASEBOARD not in item.tags
    }
    accents = _accent_runs(walls, finishes)
    rest = RestOfWall(
        foot=number_of_finish(mutable, replace(scheme.plaster, name=REVEAL)),
        flat=number_of_finish(mutable, scheme.plaster),
    )
    render = PatternMaterial(
        number_of_finish(mutable, scheme.render), (1.0, 1.0), lambda: scheme.render.paint
    )
    is_painted = any(f.walls is not None for f in finishes)
    for index, wall in walls.items():
        looks = {
            (k, r): _room_walls(mutable, finishes[run.room], is_accent=(index, k, r) in accents)
            for k, side in enumerate(wall.sides)
            for r, run in enumerate(side.runs)
            if run.room is not None and finishes[run.room].walls is not None
        }
        # Outdoors the home has one render, but for walls with a picture.
        if is_painted and _is_bare(mutable, mutable.items[index]):
            looks |= {
                (k, r): RoomWalls(render, side.low_y)
                for k, side in enumerate(wall.sides)
                for r, run in enumerate(side.runs)
                if run.room is None or finishes[run.room].space.kind is RoomKind.OUTDOOR
            }
        if looks:
            mutable.change(index, painted_wall(mutable.items[index], wall, looks, rest), PASS)
    for finish in finishes:
        if finish.walls is not None:
            mutable.done[f"{PASS}: {(finish.walls.low or finish.walls.main).family} walls"] += 1


def _is_bare(house: MutableHouse, item: Item) -> bool:
    """Whether all of a wall may be rendered: neither pictures nor glass."""
    return all(is_plain(house.materials[s.material]) for s in item.surfaces)


def _room_walls(house: MutableHouse, finish: _RoomFinish, *, is_accent: bool) -> RoomWalls:
    walls, floor_y = finish.walls, finish.space.room.floor_y
    if walls is None:
        raise ValueError("a room without a wall finish has no wall materials")
    if is_accent and walls.accent is not None:
        return RoomWalls(pattern_material(house, walls.accent), floor_y)
    low = None if walls.low is None else pattern_material(house, walls.low)
    return RoomWalls(pattern_material(house, walls.main), floor_y, low, floor_y + walls.low_m)


def _accent_runs(
    walls: Mapping[int, SidedWall], finishes: list[_RoomFinish]
) -> frozenset[tuple[int, int, int]]:
    """(wall, side, run) of every run in the plane of a room's longest wall, where it has an accent."""
    planes: dict[int, dict[tuple[int, int, int], float]] = {}
    runs: list[tuple[tuple[int, int, int], int, tuple[int, int, int]]] = []
    for index, wall in walls.items():
        for k, side in enumerate(wall.sides):
            # Walls in one plane are one wall to who looks at it.
            x, z = side.normal[0], side.normal[2]
            plane = (round(float(x) * 50), round(float(z) * 50), round(side.offset * 20))
            for r, run in enumerate(side.runs):
                if run.room is None or (finishes[run.room].walls or _NO_ACCENT).accent is None:
                    continue
                lengths = planes.setdefault(run.room, {})
                lengths[plane] = lengths.get(plane, 0.0) + run.end - run.start
                runs.append(((index, k, r), run.room, plane))
    longest = {room: max(by_plane, key=lambda p: by_plane[p]) for room, by_plane in planes.items()}
    return frozenset(key for key, room, plane in runs if longest[room] == plane)


_NO_ACCENT = WallFinish(Pattern("paint", 0))


def _set_boards(
    house: MutableHouse, home: HomeFinish, scheme: FinishScheme, finishes: list[_RoomFinish]
) -> None:
    if has_boards(house.source):
        _paint_boards(house, home, scheme, finishes)
        return
    walls = wall_plans(house.source)
    for finish in finishes:
        room = finish.space.room
        if finish.walls is None or finish.walls.is_tiled or finish.space.kind is RoomKind.STORE:
            continue
        board_finish = _board_finish(house, home, scheme, finish)
        board = skirting_board(house.source, room, finish.space.area, walls, home.board_m, 0)
        if board is not None:
            # A new board has no finish yet: apply it to all faces.
            looks = tuple(with_finish(house, s, board_finish, np.eye(3)) for s in board.surfaces)
            board = replace(board, surfaces=looks)
            house.add(replace(board, tags=(*board.tags, f"seed:{house.seed}")), PASS)
            house.done[f"{PASS}: skirting board"] += 1


def _paint_boards(
    house: MutableHouse, home: HomeFinish, scheme: FinishScheme, finishes: list[_RoomFinish]
) -> None:
    """Give the source's boards the home's finish; before tiles, the tiles'."""
    finder = RoomFinder(house.source.rooms, [f.space.area for f in finishes])
    for index, item in enumerate(house.items):
        if BASEBOARD not in item.tags or item.kind is not ItemKind.WALL or not item.n_faces:
            continue
        rooms = _rooms_before(item, finder)
        if not rooms or all(finishes[k].walls is None for k in rooms):
            continue
        finish = next(finishes[k] for k in rooms if finishes[k].walls is not None)
        board_finish = _board_finish(house, home, scheme, finish)
        painted = item_with_finish(house, item, board_finish)
        if painted is not item:
            house.change(index, painted, PASS)


def _rooms_before(board: Item, finder: RoomFinder) -> list[int]:
    # Rooms of a board by its own plan's points, most points first.
    wall = sided_wall(board, finder)
    lengths: dict[int, float] = {}
    for side in wall.sides:
        for run in side.runs:
            if run.room is not None:
                lengths[run.room] = lengths.get(run.room, 0.0) + run.end - run.start
    return sorted(lengths, key=lambda k: (-lengths[k], k))


def _board_finish(
    house: MutableHouse, home: HomeFinish, scheme: FinishScheme, finish: _RoomFinish
) -> Finish:
    walls, floor = finish.walls, finish.floor
    if walls is not None and walls.is_tiled:
        # Tiled rooms have a skirting of tiles.
        return Finish("skirting tile", (walls.low or walls.main).tints[0], 0.15)
    if not home.has_floor_boards:
        return scheme.trim
    if floor is None or floor.pattern.family not in WOOD_FLOORS:
        return scheme.trim
    material: PatternMaterial = pattern_material(house, floor.pattern)
    r, g, b = srgb_from_linear(np.array(material.mean_rgb)).tolist()
    return Finish("skirting wood", (r, g, b))
