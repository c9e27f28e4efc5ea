"""PNG <-> arrays with zlib and numpy alone; row filters "up" and "none" only; no effects.

The format of shards and of a view's labels: each row as its difference from the row above, which
compresses labels best and is decoded a row at a time. 16 bits stay 16. zlib-ng, if installed, inflates
the same bytes in a seventh of zlib's time.

Not left to a library, because training waits for reading. Times for a 640x480 picture, here (with
zlib-ng), by OpenImageIO and by Pillow: normals 2.8 (0.8), 15 ms, and unsupported (Pillow makes 16-bit
RGB 8 bits); colour 10 (9), 20 and 23 ms.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.errors import BadInput


def _inflating_library() -> Any:
    try:
        from zlib_ng import zlib_ng
    except ImportError:
        return zlib
    return zlib_ng


inflating: Final = _inflating_library()  # zlib, or a faster equivalent
_SIGNATURE: Final = b"\x89PNG\r\n\x1a\n"
_CHANNELS: Final = {0: 1, 2: 3}  # PNG colour type (grey, RGB) -> channels
_NONE, _UP = 0, 2  # filters
_LEVEL: Final = 6  # zlib compression level
_MAX_PIXELS: Final = 16384 * 16384
_STRIP_BYTES: Final = 100_000
_DAMAGED: Final = "cannot be read as a picture: damaged or truncated"


def png_of_rows(array: NDArray[np.uint8]) -> bytes:
    """PNG bytes of (H, W) or (H, W, 3) uint8, or uint16; equal arrays give equal bytes.

    Every row is stored as its difference from the one above, which `array_of_rows` decodes quickly;
    any PNG reader can read it. Other types and numbers of channels are not supported.
    """
    height, width = array.shape[:2]
    kind = 0 if array.ndim == 2 else 2
    big_endian = np.ascontiguousarray(array, array.dtype.newbyteorder(">"))
    rows = big_endian.view(np.uint8).reshape(height, -1)
    # The filter's number comes before each row's difference.
    lines = np.empty((height, rows.shape[1] + 1), np.uint8)
    lines[:, 0] = _UP
    lines[0, 1:] = rows[0]
    np.subtract(rows[1:], rows[:-1], out=lines[1:, 1:])
    header = struct.pack(">IIBBBBB", width, height, 8 * array.itemsize, kind, 0, 0, 0)
    data = zlib.compress(lines.tobytes(), _LEVEL)
    chunks = (_chunk(b"IHDR", header), _chunk(b"IDAT", data), _chunk(b"IEND", b""))
    return _SIGNATURE + b"".join(chunks)


def array_of_rows(png: bytes, place: str) -> NDArray[Any] | None:
    """(H, W) or (H, W, 3) uint8 or uint16 of a PNG; None if its rows have other filters.

    Raises BadInput, naming place, if it is damaged or not a PNG.
    """
    width, height, bits, kind, interlaced, data = _png_parts(png, place)
    if bits not in (8, 16) or kind not in _CHANNELS or interlaced:
        return None
    dtype = np.dtype(np.uint8 if bits == 8 else ">u2")
    shape = (height, width) if kind == 0 else (height, width, 3)
    pixels = np.empty(shape, dtype.newbyteorder("="))
    table = pixels.reshape(height, -1)
    # Decode strips of rows that fit the processor's cache.
    n_row = table.shape[1] * dtype.itemsize
    n_strip = max(_STRIP_BYTES // (n_row + 1), 1)
    rows = np.zeros((n_strip + 1, n_row), np.uint8)  # rows[0]: last row of the strip above
    first = 0
    for lines in _inflated(data, height, n_row + 1, n_strip, place):
        # Rows with other filters are left to a PNG library.
        filters = lines[:, 0]
        is_up = filters == _UP
        if not (is_up | (filters == _NONE)).all():
            return None
        # Add each difference to the row above.
        for differs, above, line, row in zip(is_up.tolist(), rows, lines[:, 1:], rows[1:]):
            np.add(above if differs else 0, line, out=row)
        n = len(lines)
        table[first : first + n] = rows[1 : n + 1].view(dtype)
        rows[0], first = rows[n], first + n
    return pixels


def _chunk(name: bytes, data: bytes) -> bytes:
    checksum = zlib.crc32(name + data)
    return struct.pack(">I", len(data)) + name + data + struct.pack(">I", checksum)


def _png_parts(png: bytes, place: str) -> tuple[int, int, int, int, int, bytes]:
    """Width, height, bits, colour type, interlacing, and the compressed rows."""
    if not png.startswith(_SIGNATURE) or png[12:16] != b"IHDR" or len(png) < 33:
        raise BadInput(place, "", "not a PNG file")
    width, height, bits, kind, _method, _filter, interlaced = struct.unpack(">IIBBBBB", png[16:29])
    if not 0 < width * height <= _MAX_PIXELS:
        raise BadInput(place, "", f"{width}x{height} pixels are too many")
    parts, position = [], 33
    while position + 12 <= len(png):
        # A chunk: length, name, data, checksum.
        end = position + 12 + int.from_bytes(png[position : position + 4], "big")
        name = png[position + 4 : position + 8]
        if name == b"IDAT":
            parts.append(png[position + 8 : end - 4])
        position = end
        if name == b"IEND" and end <= len(png):
            return width, height, bits, kind, interlaced, b"".join(parts)
    raise BadInput(place, "", _DAMAGED)


def _inflated(
    data: bytes, n_lines: int, n_line: int, n_strip: int, place: str
) -> Iterator[NDArray[np.uint8]]:
    """Yield the first row alone, since its filter usually decides, then strips of n_strip rows of bytes."""
    inflate = inflating.decompressobj()
    for first in range(1 - n_strip, n_lines, n_strip):
        n = min(n_strip, n_lines - first) if first > 0 else 1
        yield np.frombuffer(_some(inflate, data, n * n_line, place), np.uint8).reshape(n, n_line)
        data = inflate.unconsumed_tail
    # Request one byte more than expected, so that a decompression bomb stays small.
    if _some(inflate, data, 1, place, may_lack=True) or not inflate.eof:
        raise BadInput(place, "", _DAMAGED)


def _some(inflate: Any, data: bytes, n_bytes: int, place: str, *, may_lack: bool = False) -> bytes:
    try:
        raw: bytes = inflate.decompress(data, n_bytes)
    except (zlib.error, inflating.error):
        raise BadInput(place, "", _DAMAGED) from None
    if len(raw) != n_bytes and not may_lack:
        raise BadInput(place, "", _DAMAGED)
    return raw
