"""A small furnished home of two rooms, for demos and tests; unrepaired, like a reader's. Reads builtin.toml."""

from __future__ import annotations

import math
import struct
import zlib
from dataclasses import replace
from pathlib import Path
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from pbrs_farm.core import keys
from pbrs_farm.core.arrays import F64, Points2, triple
from pbrs_farm.core.classes import CEILING, FLOOR, WALL
from pbrs_farm.core.frames import rotation_y
from pbrs_farm.core.house import (
    Box,
    House,
    Item,
    ItemKind,
    Level,
    LightPart,
    Material,
    Opening,
    Room,
    Source,
    StoredCamera,
    Surface,
)
from pbrs_farm.core.joints import Joint, JointKind
from pbrs_farm.core.lighting import PowerUnit
from pbrs_farm.core.record import Nyu40, Record, read_toml
from pbrs_farm.geometry.plan_surfaces import counter_clockwise, horizontal
from pbrs_farm.geometry.solids import box, box_quads, lathe, quads_surface, sphere, wall_prism
from pbrs_farm.read.common.material_library import MaterialLibrary
from pbrs_farm.read.common.notes import Notes


def png_from_srgb8(rgb_srgb8: NDArray[np.uint8]) -> bytes:
    """PNG of (H, W, 3) uint8, row 0 on top, written here so that no library's version changes its bytes."""
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


Triple = tuple[float, float, float]
Four = tuple[float, float, float, float]
Boxes = tuple[tuple[Triple, Triple], ...]  # low and high corners in the piece's frame


class Part(Record):
    """Boxes of one material."""

    material: str
    slabs: tuple[Four, ...] = ()  # width, depth, from and to which height
    boxes: Boxes = ()
    legs: Four | None = None

    @property
    def all_boxes(self) -> Boxes:
        """Slabs and legs as boxes, too."""
        slabs = [((-w / 2, y0, -d / 2), (w / 2, y1, d / 2)) for w, d, y0, y1 in self.slabs]
        return (*slabs, *self.boxes, *(_legs(*self.legs) if self.legs else ()))


class Turned(Record):
    """A profile turned about the piece's axis."""

    material: str
    profile: tuple[tuple[float, float], ...]  # (radius, height) from the bottom


class BuiltinPiece(Record):
    """A piece to place."""

    nyu40: Nyu40 = Field(alias="class")
    parts: tuple[Part, ...] = ()
    turned: tuple[Turned, ...] = ()
    kind: ItemKind = ItemKind.OBJECT
    bulb: tuple[Triple, float, bool] | None = None  # its place, radius, whether it is a sphere

    @property
    def materials(self) -> set[str]:
        """Names of its materials."""
        return {part.material for part in self.parts} | {body.material for body in self.turned}


def _legs(w: float, d: float, h: float, t: float) -> Boxes:
    """Four legs of thickness t under a w x d rectangle, h high."""
    xs = ((-w / 2, -w / 2 + t), (w / 2 - t, w / 2))
    zs = ((-d / 2, -d / 2 + t), (d / 2 - t, d / 2))
    return tuple(((x0, 0.0, z0), (x1, h, z1)) for x0, x1 in xs for z0, z1 in zs)


def place_piece(
    name: str,
    piece: BuiltinPiece,
    item_id: str,
    room_id: str,
    at: Triple,
    turn_deg: float,
    materials: dict[str, int],
) -> Item:
    """The piece as an item, turned about +y and moved to at (3,); materials: name -> index in the house."""
    turn = rotation_y(np.radians(turn_deg))
    origin = np.asarray(at, np.float64)
    surfaces = [_boxes(part, turn, origin, materials) for part in piece.parts]
    for body in piece.turned:
        profile, number = np.asarray(body.profile), materials[body.material]
        surfaces.append(lathe(body.material, profile, origin, number))
    # Put the bulb in, as a sphere that emits or as a light alone.
    lights: tuple[LightPart, ...] = ()
    if piece.bulb is not None:
        local, radius, is_modelled = piece.bulb
        centre = turn @ np.asarray(local) + origin
        if is_modelled:
            surfaces.append(sphere("bulb", centre, radius, materials["bulb"]))
        emitting = (len(surfaces) - 1,) if is_modelled else ()
        x, y, z = (float(c) for c in centre)
        lights = (LightPart((x, y, z), radius, 0.5, PowerUnit.SWEETHOME3D, emitting=emitting),)
    item = Item(
        id=item_id,
        name=name,
        kind=piece.kind,
        level_id="0",
        surfaces=tuple(surfaces),
        nyu40=piece.nyu40,
        source_class=f"builtin#{name}",
        room_id=room_id,
        lights=lights,
    )
    return replace(item, box=_oriented_box(item, turn, origin))


def _boxes(part: Part, turn: F64, origin: F64, materials: dict[str, int]) -> Surface:
    quads = []
    for low, high in part.all_boxes:
        a, b = np.asarray(low, np.float64), np.asarray(high, np.float64)
        quads.append(box_quads((a + b) / 2, (b - a) / 2))
    world = np.concatenate(quads) @ turn.T + origin
    return quads_surface(part.material, world, materials[part.material])


def _oriented_box(item: Item, turn: F64, origin: F64) -> Box:
    world = np.concatenate([s.positions for s in item.surfaces]).astype(np.float64)
    local = (world - origin) @ turn
    low, high = local.min(0), local.max(0)
    return Box(turn @ ((low + high) / 2) + origin, (high - low) / 2, turn)


VERSION = "1"  # part of the home's fingerprint: raise it with any change
WALL_HEIGHT_M = 2.5
OUTER_M, INNER_M = 0.2, 0.1  # thickness of the walls

# Inner faces of the rooms: x0, z0, x1, z1.
LIVING = (0.0, 0.0, 5.0, 4.0)
BEDROOM = (5.0 + INNER_M, 0.0, 9.0, 4.0)


class _OpeningRow(Record):
    id: str
    is_window: bool
    room: str
    centre: tuple[float, float]
    along: Literal["x", "z"]
    width: float
    bottom: float
    top: float


class BuiltinTable(Record):
    # The file builtin.toml.
    materials: tuple[Material, ...]
    pieces: dict[str, BuiltinPiece]
    places: tuple[tuple[str, str, Triple, float], ...]
    holes: tuple[_OpeningRow, ...]

    @model_validator(mode="after")
    def _is_there(self) -> BuiltinTable:
        materials = {m.name for m in self.materials}
        for name, piece in self.pieces.items():
            if unknown := piece.materials - materials:
                raise ValueError(f"{name}: no material {', '.join(sorted(unknown))}")
        if unknown := {place[0] for place in self.places} - self.pieces.keys():
            raise ValueError(f"places: no piece {', '.join(sorted(unknown))}")
        return self


_FILE: Final = read_toml(Path(__file__).with_name("builtin.toml"), BuiltinTable)


def builtin_home() -> House:
    """The built-in home, unrepaired, as a reader would give it; a fresh, equal House on every call."""
    library, index = _materials()
    openings, fillings = _openings(index)
    items = (*_wall_items(index), *_plane_items(index), *fillings, *_furniture_items(index))
    sha = keys.sha256(f"builtin home {VERSION}".encode())
    return House(
        id=keys.house_id("builtin", sha),
        name="Built-in home",
        source=Source("builtin", "builtin", sha, author="pbrs_farm", licence="Apache-2.0"),
        levels=(Level("0", "Ground floor", 0.0, WALL_HEIGHT_M),),
        rooms=(
            _make_room("0_0", "Living room", LIVING, "Living_Room"),
            _make_room("0_1", "Bedroom", BEDROOM, "Bedroom"),
        ),
        items=items,
        materials=library.materials,
        textures=library.textures,
        openings=openings,
        cameras=(
            StoredCamera(
                "Living room",
                np.array([4.6, 1.6, 3.6]),
                np.array([-0.8, -0.16, -0.58]),
                math.radians(65),
            ),
            StoredCamera(
                "Bedroom", np.array([5.4, 1.6, 0.4]), np.array([0.7, -0.18, 0.69]), math.radians(65)
            ),
        ),
    )


def _materials() -> tuple[MaterialLibrary, dict[str, int]]:
    """The home's materials in a library, and the index of each by its name."""
    library = MaterialLibrary(Notes("builtin", strict=True))
    pictures = {
        "planks": planks(),
        "rug": checks(64, 8, (150, 40, 45), (205, 190, 160)),
        "picture": stripes(64, 6, (30, 90, 150), (230, 190, 60)),
    }
    textures = {name: _add_texture(library, name, pixels) for name, pixels in pictures.items()}
    materials = [
        replace(m, texture_id=textures[m.texture_id]) if m.texture_id else m
        for m in _FILE.materials
    ]
    return library, {m.name: library.index(m) for m in materials}


def _add_texture(library: MaterialLibrary, name: str, rgb_srgb8: NDArray[np.uint8]) -> str | None:
    png = png_from_srgb8(rgb_srgb8)
    loaded = library.texture(name, name=name, place=name, load=lambda: png)
    return loaded and loaded.texture.id


def _make_room(room_id: str, name: str, rect: tuple[float, float, float, float], kind: str) -> Room:
    return Room(room_id, name, "0", _corners_of_rect(rect), 0.0, WALL_HEIGHT_M, types=(kind,))


def _corners_of_rect(rect: tuple[float, float, float, float]) -> Points2:
    x0, z0, x1, z1 = rect
    return counter_clockwise(np.array([[x0, z0], [x1, z0], [x1, z1], [x0, z1]], np.float64))


def _wall_items(index: dict[str, int]) -> tuple[Item, ...]:
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
                left,
                right,
                0.0,
                top,
                top,
                (index[sides[0]], index[sides[1]], index["wall_default"]),
            ),
            nyu40=WALL,
        )
        for k, (left, right, sides) in enumerate(outlines)
    )


def _plane_items(index: dict[str, int]) -> list[Item]:
    items = []
    for room_id, rect, floor in (("0_0", LIVING, "floor_planks"), ("0_1", BEDROOM, "carpet")):
        # A floor and a ceiling of the room's outline.
        polygons = [[_corners_of_rect(rect)]]
        for kind, nyu40, y, material, up in (
            (ItemKind.FLOOR, FLOOR, 0.0, floor, True),
            (ItemKind.CEILING, CEILING, WALL_HEIGHT_M, "ceiling_default", False),
        ):
            surface = horizontal(str(kind), polygons, y, index[material], up=up)
            items.append(
                Item(f"{kind}_{room_id}", str(kind), kind, "0", (surface,), nyu40, room_id=room_id)
            )
    return items


_LEAF: Final = "leaf 1"


def _openings(index: dict[str, int]) -> tuple[tuple[Opening, ...], list[Item]]:
    openings, items = [], []
    for hole in _FILE.holes:
        (x, z), width, y0, y1 = hole.centre, hole.width, hole.bottom, hole.top
        axes = np.eye(3) if hole.along == "x" else np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]])
        centre = np.array([x, (y0 + y1) / 2, z])
        half = np.array([width / 2, (y1 - y0) / 2, 0.16])
        cutter = box("cutter", centre, half, index["wall_default"], axes=axes)
        # The hole's rectangle, halfway through the wall.
        corners = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
        quad = centre + (corners * half) @ axes.T
        openings.append(
            Opening(f"opening_{hole.id}", "0", hole.id, hole.is_window, cutter, quad, axes[:, 2])
        )
        # The door or window fills the hole, turned with the wall.
        name, make = ("window", _window_piece) if hole.is_window else ("door", _door_piece)
        turn = 0.0 if hole.along == "x" else 90.0
        piece = make(width, y1 - y0)
        item = place_piece(name, piece, hole.id, hole.room, (x, y0, z), turn, index)
        items.append(item if hole.is_window else _hung(item, width))
    return tuple(openings), items


def _hung(door: Item, width: float) -> Item:
    """The door with its leaf on hinges, at the left seen from its front, to which it opens."""
    box = door.oriented_box
    foot = box.centre - box.half[1] * box.axes[:, 1]
    position = foot + box.axes @ np.array([-width / 2 + 0.05, 0.0, 0.02])
    surfaces = tuple(
        replace(s, part=_LEAF) if s.name in ("wood", "metal") else s for s in door.surfaces
    )
    joint = Joint(_LEAF, JointKind.REVOLUTE, triple(position), (0.0, -1.0, 0.0), np.pi / 2)
    return replace(door, surfaces=surfaces, joints=(joint,))


def _window_frame(w: float, h: float, t: float, d: float) -> Boxes:
    return (
        ((-w / 2, 0.0, -d), (-w / 2 + t, h, d)),
        ((w / 2 - t, 0.0, -d), (w / 2, h, d)),
        ((-w / 2 + t, h - t, -d), (w / 2 - t, h, d)),
    )


def _door_piece(w: float, h: float) -> BuiltinPiece:
    leaf = ((-w / 2 + 0.05, 0.0, -0.02), (w / 2 - 0.05, h - 0.05, 0.02))
    knobs = ((w / 2 - 0.16, 0.98, -0.07), (w / 2 - 0.1, 1.02, 0.07))
    parts = _parts_of_home(white=_window_frame(w, h, 0.05, 0.11), wood=(leaf,), metal=(knobs,))
    return BuiltinPiece(**{"class": "door"}, parts=parts, kind=ItemKind.DOOR)


def _window_piece(w: float, h: float) -> BuiltinPiece:
    sill = ((-w / 2 + 0.05, 0.0, -0.05), (w / 2 - 0.05, 0.05, 0.05))
    mullion = ((-0.025, 0.05, -0.03), (0.025, h - 0.05, 0.03))
    panes = (
        ((-w / 2 + 0.05, 0.05, -0.002), (-0.025, h - 0.05, 0.002)),
        ((0.025, 0.05, -0.002), (w / 2 - 0.05, h - 0.05, 0.002)),
    )
    parts = _parts_of_home(white=(*_window_frame(w, h, 0.05, 0.05), sill, mullion), pane=panes)
    return BuiltinPiece(**{"class": "window"}, parts=parts, kind=ItemKind.WINDOW)


def _parts_of_home(**boxes: Boxes) -> tuple[Part, ...]:
    return tuple(Part(material=name, boxes=some) for name, some in boxes.items())


def _furniture_items(index: dict[str, int]) -> list[Item]:
    return [
        place_piece(name, _FILE.pieces[name], f"piece_{k}", room_id, position, turn, index)
        for k, (name, room_id, position, turn) in enumerate(_FILE.places)
    ]
