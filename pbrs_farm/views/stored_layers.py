"""A view's layers as stored (whole numbers) and as a Sample's arrays; no effects.

Resizing works on the whole numbers, so a view read from a folder and resized has the same bits as
one packed at that size.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.resampling import resized_any, resized_by_area, resized_nearest
from pbrs_farm.views.normal_axes import decode_normal
from pbrs_farm.views.view_sample import Sample, SampleRequest, Size

Stored = dict[str, NDArray[Any]]  # array name -> (H, W) or (H, W, 3)


@dataclass(frozen=True, slots=True)
class StoredArray:
    """How an array is stored: type, unit, value of empty pixels, and the view's file."""

    dtype: str
    unit: str
    nothing: str
    file: str  # below the view's folder
    channels: int = 1


# By the names of Sample's arrays; colour is a picture by its mode's name.
STORED: Final = {
    "colour": StoredArray("uint8", "sRGB", "-", "{mode}.png", 3),
    "normal": StoredArray(
        "uint16", "round((n + 1) 65535 / 2), x right, y forward, z up", "32768", "normal.png", 3
    ),
    "valid": StoredArray("uint8", "255 where normal is known", "0", "valid.png"),
    "depth": StoredArray("uint16", "mm along the axis; 65535: as much or more", "0", "depth.png"),
    "class40": StoredArray("uint8", "NYU40 id", "0", "semantic.png"),
    "instance": StoredArray("uint16", "instance id", "0", "instance.png"),
    "boundary": StoredArray("uint8", "255 where instances meet", "0", "boundary.png"),
}


@dataclass(frozen=True, slots=True)
class ViewFacts:
    """A view's id and camera, at its stored size."""

    house: str
    view: str
    room: str
    size: Size
    K: tuple[tuple[float, ...], ...]  # 3 x 3, pixels
    world_from_camera_opencv: tuple[tuple[float, ...], ...]  # 4 x 4, metres, y up

    @property
    def id(self) -> str:
        """<house>/<view>, unique in a root."""
        return f"{self.house}/{self.view}"

    def k_at(self, size: Size) -> NDArray[np.float64]:
        """(3, 3) K of the picture at another size (width, height)."""
        scale = np.array([size[0] / self.size[0], size[1] / self.size[1], 1])
        return np.asarray(np.array(self.K, np.float64) * scale[:, None])


def facts_from_json(row: Any, place: str) -> ViewFacts:
    """ViewFacts of view.json, or of a packed view's; BadInput, naming place, for anything else.

    Checks only that K is (3, 3), the pose (4, 4) and the size at least 1 pixel. The room of a view
    without one is "".
    """
    try:
        k, pose = (
            tuple(tuple(float(x) for x in line) for line in row[name])
            for name in ("K", "world_from_camera_opencv")
        )
        size = int(row["width_px"]), int(row["height_px"])
        if [len(x) for x in (*k, *pose)] != [3] * 3 + [4] * 4 or min(size) < 1:
            raise ValueError
        room = row.get("room") or ""
        return ViewFacts(str(row["house"]), str(row["view"]), str(room), size, k, pose)
    except (KeyError, TypeError, ValueError, AttributeError):
        hint = "is a run still writing it? `pbrs-farm verify` finds damaged files"
        raise BadInput(place, "", "not a view's camera", hint=hint) from None


def array_names(layers: tuple[str, ...]) -> tuple[str, ...]:
    """The arrays needed for layers: valid comes with normal.

    In the order of layers, each once.

        >>> array_names(("depth", "normal"))
        ('depth', 'normal', 'valid')
    """
    names = [n for layer in layers for n in ((layer, "valid") if layer == "normal" else (layer,))]
    return tuple(dict.fromkeys(names))


def check_array(name: str, array: NDArray[Any], size: Size, place: str) -> NDArray[Any]:
    """The array unchanged, if it has the right type and size; BadInput, naming place, if not.

    Refuses a 16-bit array reduced to 8 bits, or to 8 bits spread over 16, by a program on the way.
    """
    want = STORED[name]
    shape = (size[1], size[0], 3) if want.channels == 3 else (size[1], size[0])
    hint = "another program rewrote the file: use the original"
    if array.dtype == np.uint8 and want.dtype == "uint16":
        raise BadInput(place, "", "8 bits a value, 16 are stored", hint=hint)
    if array.dtype != np.dtype(want.dtype) or array.shape != shape:
        text = f"{array.dtype} {array.shape}, expected {want.dtype} {shape}"
        raise BadInput(place, "", text, hint=hint)
    if want.dtype == "uint16" and name != "instance" and _were_8_bits(array):
        raise BadInput(place, "", "8 bits spread over 16", hint=hint)
    return array


def _were_8_bits(array: NDArray[np.uint16]) -> bool:
    # 8 bits spread over 16 repeat the byte: every value is a multiple of 257.
    some = array[::8, ::8]
    if (some % 257).any():
        return False
    return bool((array % 257 == 0).all() and len(np.unique(some)) > 3)


def resize_stored(stored: Stored, size: Size) -> Stored:
    """Resample the arrays: colour by area, boundaries if the cell contains any, all others nearest.

    size is (width, height). Labels are never mixed, so a class thinner than a pixel may vanish;
    boundaries do not.
    """
    return {name: _resized(name, array, *size) for name, array in stored.items()}


def _resized(name: str, array: NDArray[Any], width: int, height: int) -> NDArray[Any]:
    if name == "colour":
        return resized_by_area(array, width, height)
    if name == "boundary":
        return resized_any(array > 0, width, height).astype(np.uint8) * np.uint8(255)
    return resized_nearest(array, width, height)


def sample_of_stored(facts: ViewFacts, stored: Stored, request: SampleRequest) -> Sample:
    """The Sample of a view's stored arrays, at the requested size.

    Depth becomes float32 metres (0 = nothing), normals unit vectors in request.axes, boundary and
    valid bool; colour, class40 and instance stay as stored. K follows the size.
    """
    size = request.size or facts.size
    stored = resize_stored(stored, size)
    arrays: dict[str, Any] = {
        n: stored[n] for n in ("colour", "class40", "instance") if n in stored
    }
    # Convert whole numbers to metres, unit vectors and booleans.
    if "depth" in stored:
        arrays["depth"] = stored["depth"].astype(np.float32) / np.float32(1000)
    if "boundary" in stored:
        arrays["boundary"] = stored["boundary"] > 0
    if "normal" in stored:
        valid = stored["valid"] > 0
        arrays |= {"normal": decode_normal(stored["normal"], valid, request.axes), "valid": valid}
    k = facts.k_at(size).astype(np.float32)
    return Sample(facts.id, facts.house, facts.room, request.mode, k, request.axes, **arrays)
