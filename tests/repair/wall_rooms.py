"""Small houses for repair, built in code: walls as prisms or planes, rooms as rectangles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pbrs_farm.core.house import House, Item, ItemKind, Level, Material, Room, Source, Surface
from pbrs_farm.geometry.plan_surfaces import counter_clockwise, horizontal
from pbrs_farm.geometry.solids import quads_surface, wall_prism

HEIGHT_M = 2.5
WALL, FLOOR, CEILING = 0, 1, 2
MATERIALS = (Material("wall", is_default=True), Material("floor"), Material("ceiling"))

Rect = tuple[float, float, float, float]
"""x0, z0, x1, z1 in metres."""


def house(items: Sequence[Item], rooms: Sequence[Room]) -> House:
    """A House of those items and rooms, on the levels in the rooms' ids."""
    levels = {
        r.level_id: Level(r.level_id, r.level_id, r.floor_y, r.ceiling_y - r.floor_y) for r in rooms
    }
    return House(
        id="small",
        name="small",
        source=Source("builtin", "small", "0" * 64),
        levels=tuple(levels.values()),
        rooms=tuple(rooms),
        items=tuple(items),
        materials=MATERIALS,
        textures={},
    )  # fmt: skip


def room(room_id: str, rect: Rect, *, floor_y: float = 0.0, ceiling_y: float = HEIGHT_M) -> Room:
    """A rectangular room; its level is the part of its id before the underscore."""
    return Room(room_id, room_id, room_id.split("_")[0], _outline(rect), floor_y, ceiling_y)


def covers(of: Room, *, floor: bool = True, ceiling: bool = True) -> list[Item]:
    """The planar floor and ceiling of a room."""
    items = []
    for kind, y, material, is_wanted in (
        (ItemKind.FLOOR, of.floor_y, FLOOR, floor),
        (ItemKind.CEILING, of.ceiling_y, CEILING, ceiling),
    ):
        if is_wanted:
            up = kind is ItemKind.FLOOR
            surface = horizontal(str(kind), [[of.polygon]], y, material, up=up)
            items.append(Item(f"{kind}_{of.id}", "", kind, of.level_id, (surface,), room_id=of.id))
    return items


def wall(
    item_id: str,
    start: tuple[float, float],
    end: tuple[float, float],
    *,
    thickness: float = 0.2,
    bottom: float = 0.0,
    top: float = HEIGHT_M,
) -> Item:
    """A straight wall about its middle line, square ends."""
    a, b = np.array(start), np.array(end)
    along = (b - a) / np.linalg.norm(b - a)
    side = 0.5 * thickness * np.array([along[1], -along[0]])
    tops = np.full(2, top)
    surfaces = wall_prism(
        np.array([a + side, b + side]), np.array([a - side, b - side]), bottom, tops, tops, (WALL,) * 3
    )  # fmt: skip
    return Item(item_id, item_id, ItemKind.WALL, "0", surfaces, nyu40=1)


def walls_around(rect: Rect, prefix: str = "w", **more: float) -> list[Item]:
    """Four walls whose inner faces are the rectangle's edges; corners overlap."""
    x0, z0, x1, z1 = rect
    t = more.get("thickness", 0.2)
    h = 0.5 * t
    corners = [(x0 - h, z0 - h), (x1 + h, z0 - h), (x1 + h, z1 + h), (x0 - h, z1 + h)]
    items = []
    for k in range(4):
        (ax, az), (bx, bz) = corners[k], corners[(k + 1) % 4]
        ux, uz = np.sign(bx - ax), np.sign(bz - az)
        items.append(
            wall(f"{prefix}{k}", (ax - h * ux, az - h * uz), (bx + h * ux, bz + h * uz), **more)
        )
    return items  # fmt: skip


def mitred_walls(rect: Rect, *, thickness: float = 0.2, top: float = HEIGHT_M) -> list[Item]:
    """Four mitred walls around the rectangle, which meet in the corners' diagonals without overlap."""
    x0, z0, x1, z1 = rect
    inner = _outline(rect)
    outer = _outline((x0 - thickness, z0 - thickness, x1 + thickness, z1 + thickness))
    items = []
    for k in range(4):
        ends, tops = [(k + 1) % 4, k], np.full(2, top)
        surfaces = wall_prism(inner[ends], outer[ends], 0.0, tops, tops, (WALL,) * 3)
        items.append(Item(f"m{k}", f"m{k}", ItemKind.WALL, "0", surfaces, nyu40=1))
    return items


def planar_walls(rect: Rect, *, top: float = HEIGHT_M) -> list[Item]:
    """Four walls of zero thickness on the rectangle's edges, facing into the room."""
    outline = _outline(rect)
    items = []
    for k in range(4):
        a, b = outline[k], outline[(k + 1) % 4]
        # Counter-clockwise in plan (x right, z up) the room is to the left.
        quad = np.array([[a[0], 0, a[1]], [b[0], 0, b[1]], [b[0], top, b[1]], [a[0], top, a[1]]])
        surface = quads_surface("plane", quad[None], WALL)
        items.append(Item(f"p{k}", f"p{k}", ItemKind.WALL, "0", (surface,), nyu40=1))
    return items


def turned(source: House, angle_rad: float) -> House:
    """The house turned about the vertical axis."""
    c, s = np.cos(angle_rad), np.sin(angle_rad)
    plan = np.array([[c, s], [-s, c]])

    def moved(surface: Surface) -> Surface:
        positions = surface.positions.astype(np.float64)
        positions[:, [0, 2]] = positions[:, [0, 2]] @ plan
        return replace(surface, positions=positions.astype(np.float32))

    items = [replace(i, surfaces=tuple(moved(x) for x in i.surfaces)) for i in source.items]
    rooms = [replace(r, polygon=r.polygon @ plan) for r in source.rooms]
    return replace(source, items=tuple(items), rooms=tuple(rooms))


def _outline(rect: Rect) -> np.ndarray:  # type: ignore[type-arg]
    x0, z0, x1, z1 = rect
    return counter_clockwise(np.array([[x0, z0], [x1, z0], [x1, z1], [x0, z1]], np.float64))
