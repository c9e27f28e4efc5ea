"""Tiny pictures made in code, as PNG bytes, for the built-in home; no effects."""

from __future__ import annotations

import struct
import zlib

import numpy as np
from numpy.typing import NDArray


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
