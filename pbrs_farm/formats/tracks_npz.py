"""tracks.npz: surface points followed through the frames of a film, written and read; no effects."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.errors import BadInput

FILE: Final = "tracks.npz"
ARRAYS: Final = {
    "points": ("float32", 3),
    "occluded": ("bool", 2),
    "depth_m": ("float32", 2),
    "query_frame": ("int32", 1),
    "instance": ("uint16", 1),
}
"""Type and number of axes of each array; the first axis counts points, the second frames."""


def tracks_npz(tracks: object, frames: Sequence[str]) -> bytes:
    """The file: the arrays of ARRAYS, attributes of tracks, and the ids of the frames. Not pickled."""
    arrays: dict[str, Any] = {name: getattr(tracks, name) for name in ARRAYS}
    buffer = io.BytesIO()
    np.savez_compressed(buffer, allow_pickle=False, frames=np.array(list(frames)), **arrays)
    return buffer.getvalue()


def tracks_from_npz(data: bytes, place: str) -> Mapping[str, NDArray[Any]]:
    """Name -> array of what tracks_npz wrote, "frames" among them; BadInput names place."""
    try:
        with np.load(io.BytesIO(data), allow_pickle=False) as archive:
            arrays = {name: archive[name] for name in ("frames", *ARRAYS)}
    except (OSError, ValueError, KeyError, zipfile.BadZipFile) as error:
        raise BadInput(place, "", f"not a tracks.npz: {error}") from None
    n, t = len(arrays["query_frame"]), len(arrays["frames"])
    shapes = {1: (n,), 2: (n, t), 3: (n, t, 2)}
    for name, (kind, axes) in ARRAYS.items():
        if arrays[name].dtype != kind or arrays[name].shape != shapes[axes]:
            raise BadInput(place, name, f"expected {kind} {shapes[axes]}")
    return arrays
