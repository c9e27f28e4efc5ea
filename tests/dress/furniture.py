"""Rooms and raw furniture built in code, for tests of the dressing."""

from __future__ import annotations

import numpy as np

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.house import House, Item, ItemKind, Level, Material, Room, Source, Surface
from pbrs_farm.geometry.solids import box, box_quads, quads_surface

WIDTH, DEPTH, HEIGHT = 4.0, 3.0, 2.5  # of the room, metres


def room(name: str = "Living room") -> Room:
    """A room from the origin to (WIDTH, DEPTH)."""
    polygon = np.array([[0.0, 0.0], [0.0, DEPTH], [WIDTH, DEPTH], [WIDTH, 0.0]])
    return Room("0_0", name, "0", polygon, 0.0, HEIGHT, (name,))


def solid(item_id: str, low: F64 | list[float], high: F64 | list[float], nyu40: int = 7) -> Item:
    """An axis-aligned box as an item."""
    low, high = np.asarray(low, np.float64), np.asarray(high, np.float64)
    surface = box("box", (low + high) / 2, (high - low) / 2, 0)
    return Item(item_id, item_id, ItemKind.OBJECT, "0", (surface,), nyu40, room_id="0_0")


def boards(item_id: str, boxes: list[tuple[list[float], list[float]]], nyu40: int) -> Item:
    """An item of several boxes, each from low to high."""
    surfaces = tuple(s for low, high in boxes for s in solid("", low, high).surfaces)
    return Item(item_id, item_id, ItemKind.OBJECT, "0", surfaces, nyu40, room_id="0_0")


def bookcase(item_id: str = "bookcase", n_shelves: int = 4) -> Item:
    """A bookcase 1 m wide, 0.3 m deep, 2 m high, its back at the wall z = 0, open to +z; boards of 2 cm."""
    x0, x1, z0, z1 = 1.0, 2.0, 0.0, 0.3
    parts = [
        ([x0, 0.0, z0], [x0 + 0.02, 2.0, z1]),
        ([x1 - 0.02, 0.0, z0], [x1, 2.0, z1]),
        ([x0 + 0.02, 0.0, z0], [x1 - 0.02, 2.0, z0 + 0.01]),
    ]
    for y in np.linspace(0.1, 1.98, n_shelves + 1):
        parts.append(([x0 + 0.02, float(y), z0 + 0.01], [x1 - 0.02, float(y) + 0.02, z1]))
    return boards(item_id, parts, 10)


def thin_table(item_id: str = "table") -> Item:
    """A table top of zero thickness that faces downwards, 0.75 m high, 1.2 x 0.8 m."""
    low, high = [1.0, 0.75, 1.0], [2.2, 0.75, 1.8]
    corners = np.array([low, [high[0], 0.75, low[2]], high, [low[0], 0.75, high[2]]])
    surface: Surface = quads_surface("top", corners[None], 0)
    return Item(item_id, "Table", ItemKind.OBJECT, "0", (surface,), 7, room_id="0_0")


def house(*items: Item, name: str = "Living room") -> House:
    """A house of one room without walls that contains these items."""
    return House(
        "test-00000000", "test", Source("builtin", "", ""), (Level("0", "0", 0.0, HEIGHT),),
        (room(name),), items, (Material("white"),), {},
    )  # fmt: skip


def quads_of(low: list[float], high: list[float]) -> F64:
    """(6, 4, 3) faces of a box from low to high."""
    a, b = np.asarray(low), np.asarray(high)
    return box_quads((a + b) / 2, (b - a) / 2)
