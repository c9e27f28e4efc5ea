"""The parts of a packed view: which file of a shard holds which array, written and read; no effects.

Arrays of 8 bits are PNGs that zlib and numpy undo, colour a JPEG where it was packed so; arrays of
16 bits are .npz, which no picture decoder can make 8 bits of.
"""

from __future__ import annotations

import io
from collections.abc import Collection, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.errors import BadInput
from pbrs_farm.study.reading.baseline_jpeg import array_of_jpeg
from pbrs_farm.study.reading.npz_bytes import arrays_of_npz, npz_of_arrays
from pbrs_farm.study.reading.png_rows import array_of_rows, png_of_rows
from pbrs_farm.study.reading.stored_layers import Stored

# Array -> the part that holds it; colour is <mode>.png or <mode>.jpg.
_PARTS: Final = {
    "normal": "normal.npz",
    "valid": "normal.npz",
    "depth": "depth.npz",
    "class40": "class40.png",
    "instance": "instance.npz",
    "boundary": "boundary.png",
}


def label_parts(stored: Stored) -> dict[str, bytes]:
    """Part -> bytes of a view's labels, in a fixed order."""
    parts: dict[str, bytes] = {}
    for part in dict.fromkeys(_PARTS.values()):
        arrays = {n: stored[n] for n, own in _PARTS.items() if own == part and n in stored}
        if arrays:
            is_npz = part.endswith(".npz")
            parts[part] = npz_of_arrays(arrays) if is_npz else png_of_rows(*arrays.values())
    return parts


def part_of_array(name: str, mode: str, parts: Collection[str]) -> str:
    """The part that holds an array of a view that has these parts."""
    if name != "colour":
        return _PARTS[name]
    return f"{mode}.jpg" if f"{mode}.jpg" in parts else f"{mode}.png"


def arrays_of_part(names: Sequence[str], part: str, data: bytes, place: str) -> Stored:
    """The arrays of those names in a part; BadInput, naming place, where it is damaged."""
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
    """(H, W, 3) uint8 of a JPEG, by the first decoder there is: OpenCV, Pillow, our own."""
    for decoder in (_by_opencv, _by_pillow, array_of_jpeg):
        try:
            array = decoder(data)
        except ImportError:
            continue
        except (OSError, ValueError):
            array = None
        if array is not None:
            return array
        break
    raise BadInput(place, "", "cannot be read as a JPEG: damaged")


def _by_opencv(data: bytes) -> NDArray[np.uint8] | None:
    import cv2

    bgr = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
    return None if bgr is None else np.ascontiguousarray(bgr[..., ::-1])


def _by_pillow(data: bytes) -> NDArray[np.uint8]:
    from PIL import Image

    with Image.open(io.BytesIO(data), formats=["JPEG"]) as picture:
        return np.asarray(picture.convert("RGB"))
