"""Encode and decode the files of a view in a shard; no effects.

8-bit arrays are PNGs readable with zlib and numpy, colour a JPEG if packed as such; 16-bit arrays
are .npz without a timestamp, which no picture decoder can reduce to 8 bits.
"""

from __future__ import annotations

import io
import zipfile
import zlib
from collections.abc import Collection, Mapping, Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.errors import BadInput
from pbrs_farm.views.png_rows import array_of_rows, png_of_rows
from pbrs_farm.views.stored_layers import Stored

_DATE: Final = (1980, 1, 1, 0, 0, 0)  # the earliest date of a zip file
_LEVEL: Final = 6

# Array -> its part; colour is <mode>.png or <mode>.jpg.
_PARTS: Final = {
    "normal": "normal.npz",
    "valid": "normal.npz",
    "depth": "depth.npz",
    "class40": "class40.png",
    "instance": "instance.npz",
    "boundary": "boundary.png",
}


def npz_of_arrays(arrays: Mapping[str, NDArray[Any]]) -> bytes:
    """.npz bytes; equal arrays give equal bytes.

    In the order given, with a fixed date for each member; compressed. Raises ValueError for arrays of
    objects.
    """
    whole = io.BytesIO()
    with zipfile.ZipFile(whole, "w", zipfile.ZIP_DEFLATED, compresslevel=_LEVEL) as archive:
        for name, array in arrays.items():
            member = zipfile.ZipInfo(f"{name}.npy", _DATE)
            member.compress_type = zipfile.ZIP_DEFLATED
            part = io.BytesIO()
            np.lib.format.write_array(part, np.ascontiguousarray(array), allow_pickle=False)
            archive.writestr(member, part.getbuffer())
    return whole.getvalue()


def arrays_of_npz(data: bytes, place: str) -> dict[str, NDArray[Any]]:
    """Name -> array; BadInput, naming place, if data is damaged or not an .npz.

    Arrays of objects are refused, so a file from a stranger runs no code.
    """
    try:
        with np.load(io.BytesIO(data), allow_pickle=False) as archive:
            return {name: archive[name] for name in archive.files}
    except (
        OSError,
        ValueError,
        KeyError,
        EOFError,
        AttributeError,
        zipfile.BadZipFile,
        zlib.error,
    ):
        raise BadInput(place, "", "not an .npz of arrays, or damaged") from None


def label_parts(stored: Stored) -> dict[str, bytes]:
    """Part -> bytes of a view's labels, in a fixed order.

    stored: a view's arrays by name, as in a root; missing arrays make no part. The picture is not
    included.
    """
    parts: dict[str, bytes] = {}
    for part in dict.fromkeys(_PARTS.values()):
        arrays = {n: stored[n] for n, of in _PARTS.items() if of == part and n in stored}
        if arrays:
            is_npz = part.endswith(".npz")
            parts[part] = npz_of_arrays(arrays) if is_npz else png_of_rows(*arrays.values())
    return parts


def part_of_array(name: str, mode: str, parts: Collection[str]) -> str:
    """The part with an array of a view.

    parts: names of the view's parts. For colour the JPEG if present, else the PNG. KeyError for an
    array without a part.
    """
    if name != "colour":
        return _PARTS[name]
    return f"{mode}.jpg" if f"{mode}.jpg" in parts else f"{mode}.png"


def arrays_of_part(names: Sequence[str], part: str, data: bytes, place: str) -> Stored:
    """The arrays of those names in a part; BadInput, naming place, if it is damaged.

    place: name for messages. BadInput also for a name missing in the part, or a PNG not written by
    `pack`.
    """
    if part.endswith(".npz"):
        arrays = arrays_of_npz(data, place)
        for name in names:
            if name not in arrays:
                raise BadInput(place, "", f"has no array {name}")
        return {name: arrays[name] for name in names}
    array = _jpeg_array(data, place) if part.endswith(".jpg") else array_of_rows(data, place)
    if array is None:
        raise BadInput(place, "", "a PNG of another program", hint="`pbrs-farm pack` writes shards")
    return dict.fromkeys(names, array)


def _jpeg_array(data: bytes, place: str) -> NDArray[np.uint8]:
    """(H, W, 3) uint8 of a JPEG, by Pillow: one decoder, the same bits on every machine."""
    from PIL import Image  # not needed for shards of PNGs

    try:
        with Image.open(io.BytesIO(data), formats=["JPEG"]) as picture:
            return np.asarray(picture.convert("RGB"))
    except (OSError, ValueError, SyntaxError):
        raise BadInput(place, "", "cannot be read as a JPEG: damaged") from None
