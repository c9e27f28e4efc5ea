"""Pieces of boxes and turned profiles, and tiny pictures as PNG bytes, for the built-in home. No effects."""

from __future__ import annotations

import struct
import zlib
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.frames import rotation_y
from pbrs_farm.core.house import Box, Item, ItemKind, LightPart, Surface
from pbrs_farm.core.lighting import PowerUnit
from pbrs_farm.core.record import Nyu40, Record
from pbrs_farm.geometry.solids import box_quads, lathe, quads_surface, sphere


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
