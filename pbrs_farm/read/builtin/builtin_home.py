"""A small furnished home of our own, built in code: for demos without a network, and for tests.

No effects. Two rooms side by side, a door between them, a front door, a window in each room, two
lamps (one with a bulb, one without). It is a House as a reader gives it: walls are uncut solids,
floors and ceilings planes, so that repair has its usual work to do.
"""

from __future__ import annotations

import math
import struct
import zlib

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core import keys
from pbrs_farm.core.arrays import Points2
from pbrs_farm.core.classes import CEILING, FLOOR, WALL
from pbrs_farm.core.house import (
    House,
    Item,
    ItemKind,
    Level,
    Material,
    MaterialKind,
    Opening,
    Room,
    Source,
    StoredCamera,
)
from pbrs_farm.geometry.solids import box, wall_prism
from pbrs_farm.read.builtin import builtin_furniture as furniture
from pbrs_farm.read.common.material_library import MaterialLibrary
from pbrs_farm.read.common.notes import Notes
from pbrs_farm.read.mesh.triangulate import counter_clockwise, horizontal

# Tiny pictures made in code, as PNG bytes, for the built-in home.


def png_from_srgb8(rgb_srgb8: NDArray[np.uint8]) -> bytes:
    """An 8-bit RGB PNG of (H, W, 3) uint8, row 0 on top."""
    height, width, _ = rgb_srgb8.shape
    rows = b"".join(b"\0" + row.tobytes() for row in rgb_srgb8)
    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    parts = [(b"IHDR", header), (b"IDAT", zlib.compress(rows, 9)), (b"IEND", b"")]
    return b"\x89PNG\r\n\x1a\n" + b"".join(_chunk(kind, data) for kind, data in parts)


def _chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def planks() -> NDArray[np.uint8]:
    """A square metre of wooden floor, eight boards along v; tiles in both directions."""
    size_px, n = 128, 8
    rng = np.random.default_rng(7)
    # Give each board its shade and the place of its joint.
    board = np.arange(size_px) * n // size_px
    shade = 0.85 + 0.15 * rng.random((n, 2))
    joint = rng.integers(0, size_px, n)
    x = (np.arange(size_px)[None, :] - joint[:, None]) % size_px
    half = (x >= size_px // 2).astype(int)
    value = np.take_along_axis(shade, half, 1)[board]
    # Add grain along the board, and dark seams between boards.
    grain = 1 + 0.04 * np.sin(2 * np.pi * 3 * np.arange(size_px) / size_px + 5 * board[:, None])
    seam = (np.arange(size_px) * n % size_px < n)[:, None] | (x == 0)[board]
    value = np.where(seam, 0.45, value * grain)
    return np.asarray(np.clip(value[..., None] * [186, 140, 92], 0, 255), np.uint8)


def checks(
    size_px: int, n: int, a: tuple[int, int, int], b: tuple[int, int, int]
) -> NDArray[np.uint8]:
    """A checkerboard of n x n squares in the colours a and b (sRGB 0..255)."""
    i = np.arange(size_px) * n // size_px
    odd = (i[:, None] + i[None, :]) % 2
    return np.asarray(np.where(odd[..., None] == 1, a, b), np.uint8)


def stripes(
    size_px: int, n: int, a: tuple[int, int, int], b: tuple[int, int, int]
) -> NDArray[np.uint8]:
    """n vertical stripes in turn of the colours a and b (sRGB 0..255)."""
    odd = (np.arange(size_px) * n // size_px) % 2
    row = np.where(odd[:, None] == 1, a, b)
    return np.asarray(np.broadcast_to(row, (size_px, size_px, 3)), np.uint8)


# A small furnished home of our own, built in code.


VERSION = "1"  # part of the home's fingerprint: raise it with any change
WALL_HEIGHT_M = 2.5
OUTER_M, INNER_M = 0.2, 0.1  # thickness of the walls

# Inner faces of the rooms: x0, z0, x1, z1.
LIVING = (0.0, 0.0, 5.0, 4.0)
BEDROOM = (5.0 + INNER_M, 0.0, 9.0, 4.0)


def builtin_home() -> House:
    """The built-in home, unrepaired; the same on every call."""
    library, index = _materials()
    openings, joinery = _openings(index)
    items = (*_walls(index), *_planes(index), *joinery, *_furniture(index))
    sha = keys.sha256(f"builtin home {VERSION}".encode())
    return House(
        id=keys.house_id("builtin", sha),
        name="Built-in home",
        source=Source("builtin", "builtin", sha, author="pbrs_farm", licence="Apache-2.0"),
        levels=(Level("0", "Ground floor", 0.0, WALL_HEIGHT_M),),
        rooms=(_room("0_0", "Living room", LIVING, "Living_Room"), _room("0_1", "Bedroom", BEDROOM, "Bedroom")),
        items=items,
        materials=library.materials,
        textures=library.textures,
        openings=openings,
        cameras=(
            StoredCamera("Living room", np.array([4.6, 1.6, 3.6]), np.array([-0.8, -0.16, -0.58]), math.radians(65)),
            StoredCamera("Bedroom", np.array([5.4, 1.6, 0.4]), np.array([0.7, -0.18, 0.69]), math.radians(65)),
        ),
    )  # fmt: skip


def _materials() -> tuple[MaterialLibrary, dict[str, int]]:
    """The home's materials in a library, and the index of each by its name."""
    library = MaterialLibrary(Notes("builtin", strict=True))
    floor = _texture(library, "planks", planks())
    rug = _texture(library, "rug", checks(64, 8, (150, 40, 45), (205, 190, 160)))
    picture = _texture(library, "picture", stripes(64, 6, (30, 90, 150), (230, 190, 60)))
    materials = (
        Material("wall_default", is_default=True),
        Material("wall_sand", diffuse=(0.93, 0.88, 0.78)),
        Material("ceiling_default", is_default=True),
        _glossy("floor_planks", (1.0, 1.0, 1.0), floor),
        Material("carpet", diffuse=(0.55, 0.57, 0.6)),
        _glossy("wood", (0.72, 0.53, 0.34)),
        _glossy("wood_dark", (0.36, 0.24, 0.16)),
        Material("white", diffuse=(0.92, 0.92, 0.9)),
        _glossy("black", (0.05, 0.05, 0.05)),
        Material("metal", diffuse=(0.35, 0.35, 0.36), specular=(0.6, 0.6, 0.6), shininess=80.0),
        Material("cloth_blue", diffuse=(0.35, 0.5, 0.68)),
        Material("cloth_navy", diffuse=(0.16, 0.22, 0.38)),
        Material("cloth_red", diffuse=(0.68, 0.24, 0.2)),
        Material("leaf", diffuse=(0.2, 0.45, 0.16)),
        Material("clay", diffuse=(0.7, 0.4, 0.28)),
        Material("shade", diffuse=(0.95, 0.9, 0.8)),
        Material("rug", texture_id=rug),
        Material("picture", texture_id=picture),
        Material("glass", MaterialKind.GLASS, diffuse=(0.9, 0.95, 0.95), opacity=0.2),
        Material("pane", MaterialKind.PANE, diffuse=(0.9, 0.95, 0.95), opacity=0.2),
        Material("mirror", MaterialKind.MIRROR, specular=(0.9, 0.9, 0.9)),
        Material("bulb", MaterialKind.BULB),
    )
    return library, {m.name: library.index(m) for m in materials}


def _texture(library: MaterialLibrary, name: str, rgb_srgb8: NDArray[np.uint8]) -> str | None:
    png = png_from_srgb8(rgb_srgb8)
    loaded = library.texture(name, name=name, place=name, load=lambda: png)
    return loaded and loaded.texture.id


def _glossy(
    name: str, diffuse: tuple[float, float, float], texture_id: str | None = None
) -> Material:
    return Material(
        name, diffuse=diffuse, specular=(0.2, 0.2, 0.2), shininess=40.0, texture_id=texture_id
    )


def _room(room_id: str, name: str, rect: tuple[float, float, float, float], kind: str) -> Room:
    return Room(room_id, name, "0", _rectangle(rect), 0.0, WALL_HEIGHT_M, types=(kind,))


def _rectangle(rect: tuple[float, float, float, float]) -> Points2:
    x0, z0, x1, z1 = rect
    return counter_clockwise(np.array([[x0, z0], [x1, z0], [x1, z1], [x0, z1]], np.float64))


def _walls(index: dict[str, int]) -> tuple[Item, ...]:
    x0, z0, x1, z1 = LIVING[0], LIVING[1], BEDROOM[2], BEDROOM[3]
    o = OUTER_M
    inner = np.array([[x0, z0], [x1, z0], [x1, z1], [x0, z1]])
    outer = np.array([[x0 - o, z0 - o], [x1 + o, z0 - o], [x1 + o, z1 + o], [x0 - o, z1 + o]])
    # Four mitred outer walls, then the wall between the rooms.
    outlines = [
        (outer[[k, (k + 1) % 4]], inner[[k, (k + 1) % 4]], ("wall_default", "wall_default"))
        for k in range(4)
    ]
    a, b = LIVING[2], BEDROOM[0]
    outlines.append(
        (np.array([[b, z0], [b, z1]]), np.array([[a, z0], [a, z1]]), ("wall_sand", "wall_default"))
    )
    top = np.full(2, WALL_HEIGHT_M)
    return tuple(
        Item(
            id=f"wall_{k}",
            name=f"wall {k}",
            kind=ItemKind.WALL,
            level_id="0",
            surfaces=wall_prism(
                left, right, 0.0, top, top,
                (index[sides[0]], index[sides[1]], index["wall_default"]),
            ),
            nyu40=WALL,
        )
        for k, (left, right, sides) in enumerate(outlines)
    )  # fmt: skip


def _planes(index: dict[str, int]) -> list[Item]:
    items = []
    for room_id, rect, floor in (("0_0", LIVING, "floor_planks"), ("0_1", BEDROOM, "carpet")):
        # A floor and a ceiling of the room's outline.
        polygons = [[_rectangle(rect)]]
        for kind, nyu40, y, material, up in (
            (ItemKind.FLOOR, FLOOR, 0.0, floor, True),
            (ItemKind.CEILING, CEILING, WALL_HEIGHT_M, "ceiling_default", False),
        ):
            surface = horizontal(str(kind), polygons, y, index[material], up=up)
            items.append(
                Item(f"{kind}_{room_id}", str(kind), kind, "0", (surface,), nyu40, room_id=room_id)
            )
    return items


# id, is window, room, centre in the wall's middle plane (x, z), along x or z, width, bottom, top
_HOLES = (
    ("door_inner", False, "0_0", (5.05, 3.2), "z", 0.9, 0.0, 2.05),
    ("door_front", False, "0_0", (-0.1, 3.2), "z", 0.95, 0.0, 2.1),
    ("window_living", True, "0_0", (2.5, -0.1), "x", 1.8, 0.9, 2.1),
    ("window_bedroom", True, "0_1", (7.3, 4.1), "x", 1.2, 0.9, 2.1),
)


def _openings(index: dict[str, int]) -> tuple[tuple[Opening, ...], list[Item]]:
    openings, items = [], []
    for item_id, is_window, room_id, (x, z), along, width, y0, y1 in _HOLES:
        axes = np.eye(3) if along == "x" else np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]])
        centre = np.array([x, (y0 + y1) / 2, z])
        half = np.array([width / 2, (y1 - y0) / 2, 0.16])
        cutter = box("cutter", centre, half, index["wall_default"], axes=axes)
        # The hole's rectangle, halfway through the wall.
        corners = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
        quad = centre + (corners * half) @ axes.T
        openings.append(
            Opening(f"opening_{item_id}", "0", item_id, is_window, cutter, quad, axes[:, 2])
        )
        # The joinery stands in the hole, turned with the wall.
        piece = _window_piece(width, y1 - y0) if is_window else _door_piece(width, y1 - y0)
        turn = 0.0 if along == "x" else 90.0
        items.append(furniture.place(piece, item_id, room_id, (x, y0, z), turn, index))
    return tuple(openings), items


def _frame(
    w: float, h: float, t: float, d: float
) -> tuple[tuple[furniture.Triple, furniture.Triple], ...]:
    return (
        ((-w / 2, 0.0, -d), (-w / 2 + t, h, d)),
        ((w / 2 - t, 0.0, -d), (w / 2, h, d)),
        ((-w / 2 + t, h - t, -d), (w / 2 - t, h, d)),
    )


def _door_piece(w: float, h: float) -> furniture.BuiltinPiece:
    leaf = ((-w / 2 + 0.05, 0.0, -0.02), (w / 2 - 0.05, h - 0.05, 0.02))
    knobs = (((w / 2 - 0.16, 0.98, -0.07), (w / 2 - 0.1, 1.02, 0.07)),)
    parts = (
        furniture.Part("white", _frame(w, h, 0.05, 0.11)),
        furniture.Part("wood", (leaf,)),
        furniture.Part("metal", knobs),
    )
    return furniture.BuiltinPiece("door", 8, parts, kind=ItemKind.DOOR)


def _window_piece(w: float, h: float) -> furniture.BuiltinPiece:
    sill = ((-w / 2 + 0.05, 0.0, -0.05), (w / 2 - 0.05, 0.05, 0.05))
    mullion = ((-0.025, 0.05, -0.03), (0.025, h - 0.05, 0.03))
    panes = (
        ((-w / 2 + 0.05, 0.05, -0.002), (-0.025, h - 0.05, 0.002)),
        ((0.025, 0.05, -0.002), (w / 2 - 0.05, h - 0.05, 0.002)),
    )
    parts = (
        furniture.Part("white", (*_frame(w, h, 0.05, 0.05), sill, mullion)),
        furniture.Part("pane", panes),
    )
    return furniture.BuiltinPiece("window", 9, parts, kind=ItemKind.WINDOW)


def _furniture(index: dict[str, int]) -> list[Item]:
    f = furniture
    places: tuple[tuple[furniture.BuiltinPiece, str, furniture.Triple, float], ...] = (
        (f.RUG, "0_0", (1.8, 0.0, 1.9), 0),
        (f.SOFA, "0_0", (1.8, 0.0, 0.65), 0),
        (f.COFFEE_TABLE, "0_0", (1.8, 0.0, 1.9), 0),
        (f.BOWL, "0_0", (1.95, 0.41, 1.85), 0),
        (f.ARMCHAIR, "0_0", (0.55, 0.0, 1.95), 70),
        (f.FLOOR_LAMP, "0_0", (0.35, 0.0, 0.45), 0),
        (f.TV_BENCH, "0_0", (1.7, 0.0, 3.72), 180),
        (f.TV, "0_0", (1.7, 0.45, 3.74), 180),
        (f.BOOKSHELF, "0_0", (3.6, 0.0, 0.17), 0),
        (f.DINING_TABLE, "0_0", (4.1, 0.0, 1.9), 90),
        (f.CHAIR, "0_0", (3.5, 0.0, 1.7), 90),
        (f.CHAIR, "0_0", (4.7, 0.0, 2.0), -100),
        (f.PICTURE, "0_0", (4.983, 1.3, 1.6), -90),
        (f.PLANT, "0_0", (0.3, 0.0, 2.5), 0),
        (f.BED, "0_1", (7.2, 0.0, 1.02), 0),
        (f.PILLOW, "0_1", (6.85, 0.5, 0.4), 4),
        (f.PILLOW, "0_1", (7.55, 0.5, 0.4), -3),
        (f.NIGHT_STAND, "0_1", (6.2, 0.0, 0.22), 0),
        (f.WARDROBE, "0_1", (8.68, 0.0, 1.4), -90),
        (f.DESK, "0_1", (7.4, 0.0, 3.68), 180),
        (f.CHAIR, "0_1", (7.4, 0.0, 3.2), 10),
        (f.MIRROR, "0_1", (5.117, 0.7, 1.9), 90),
        (f.PENDANT, "0_1", (7.1, 1.9, 2.1), 0),
    )
    return [
        f.place(piece, f"piece_{k}", room_id, at, turn, index)
        for k, (piece, room_id, at, turn) in enumerate(places)
    ]
