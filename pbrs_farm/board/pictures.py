"""Stored layers as pictures that a browser shows: photographs as they are, labels as colours; pure."""

from __future__ import annotations

import logging
import os
import secrets
import struct
import threading
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm import images
from pbrs_farm.core import keys
from pbrs_farm.core.arrays import Srgb8Image
from pbrs_farm.core.layers import LAYER
from pbrs_farm.core.lighting import ALL_MODES
from pbrs_farm.formats.layer_file import layer_from_bytes
from pbrs_farm.gallery import label_colours as colours

THUMBNAIL_PX: Final = 288  # longer edge
_QUALITY: Final = 76  # of a thumbnail's JPEG

# Layers whose values are ids, each shown in a colour of its own.
_IDS: Final = {"instance", "behind_glass_instance", "material", "nyu13", "class_source"}
_CLASSES: Final = {"semantic", "behind_glass_semantic"}
_MASKS: Final = {
    "valid", "boundary", "glass", "boundary_occlusion", "boundary_semantic", "boundary_crease",
    "occlusion_forward", "occlusion_backward", "occlusion_stereo",
}  # fmt: skip
_TITLES: Final = {
    "opengl_dl": "OpenGL, directional",
    "opengl_il": "OpenGL, indoor",
    "mlt_ol": "Physical, outdoor",
    "mlt_il_ol": "Physical, indoor + outdoor",
    "semantic": "Classes",
    "instance": "Instances",
    "boundary": "Boundaries",
}


def title_of(layer: str) -> str:
    """What a menu calls a layer."""
    return _TITLES.get(layer) or layer.replace("_", " ").capitalize()


def is_label(layer: str) -> bool:
    """Whether neighbouring values must not be mixed when the picture is scaled."""
    return layer in _IDS | _CLASSES | _MASKS


def is_photo(layer: str) -> bool:
    """Whether the layer is a picture of a lighting mode."""
    return layer in {mode.value for mode in ALL_MODES}


def shown_pixels(layer: str, data: bytes, place: str) -> Srgb8Image:
    """(H, W, 3) uint8 sRGB of a layer's file. Raises BadInput where it cannot be read."""
    stored = layer_from_bytes(layer, data, place)
    if layer in _CLASSES:
        return colours.semantic_colours(stored)
    if layer in _IDS:
        return colours.instance_colours(stored)
    if layer in _MASKS:
        return colours.boundary_colours(stored)
    if layer.endswith("depth") or layer.startswith("depth_sensor"):
        return colours.depth_colours(stored)
    if layer == "depth_z":
        return colours.depth_colours(np.rint(np.nan_to_num(stored) * 1000).astype(np.int64))
    if layer in ("flow_forward", "flow_backward"):
        return colours.flow_colours(stored)
    if layer.endswith("_kitti"):
        return colours.flow_colours(np.where(stored[..., 2:] > 0, stored[..., :2] / 64 - 512, 0))
    if layer == "disparity":  # near is large: turned round
        return colours.depth_colours(np.where(stored > 0, 4_000_000 // np.maximum(stored, 1), 0))
    if layer == "position":
        return _position_colours(stored)
    if LAYER[layer].dtype == "uint16":  # normals
        return colours.normal_colours(stored)
    return np.repeat(stored[..., None], 3, axis=2) if stored.ndim == 2 else stored[..., :3]


def shown_png(layer: str, data: bytes, place: str) -> bytes:
    """PNG of a layer at its full size. Raises BadInput where it cannot be read."""
    return images.png_from_array(shown_pixels(layer, data, place))


def thumbnail_jpeg(layer: str, data: bytes, place: str) -> bytes:
    """JPEG of a layer, small. Raises BadInput where it cannot be read."""
    pixels = shown_pixels(layer, data, place)
    small = images.thumbnail(pixels, max_edge_px=THUMBNAIL_PX, nearest=is_label(layer))
    return images.jpeg_from_array(np.ascontiguousarray(small), _QUALITY)


def _position_colours(metres: NDArray[Any]) -> Srgb8Image:
    """Each axis of (H, W, 3) scaled to what the picture sees of it."""
    points = np.nan_to_num(np.asarray(metres, np.float64))
    low, high = points.min((0, 1)), points.max((0, 1))
    scaled = (points - low) / np.maximum(high - low, 1e-6)
    return np.asarray(np.rint(255 * scaled), np.uint8)


# The labels of every pixel of a view in one packet, for the probe under the pointer; pure.
# Little-endian: "PBPX", width, height, flags (uint32 each), then the planes that the flags name,
# in this order: 1 instance (uint16), 2 depth in mm (uint16), 4 normal (3 x uint16, as stored), 8
# NYU40 class (uint8). Each plane is (H, W) row by row.


MAGIC: Final = b"PBPX"
# Layer, its bit, type and shape behind (H, W).
PLANES: Final[tuple[tuple[str, int, str, tuple[int, ...]], ...]] = (
    ("instance", 1, "<u2", ()),
    ("depth", 2, "<u2", ()),
    ("normal", 4, "<u2", (3,)),
    ("semantic", 8, "<u1", ()),
)


def packet(layers: Mapping[str, NDArray[Any]]) -> bytes:
    """The packet of the layers there are; those of another size than the first are left out."""
    shape = next((layers[name].shape[:2] for name, *_ in PLANES if name in layers), (0, 0))
    flags, planes = 0, []
    for name, bit, dtype, behind in PLANES:
        array = layers.get(name)
        if array is not None and array.shape == (*shape, *behind):
            flags |= bit
            planes.append(np.ascontiguousarray(array).astype(dtype).tobytes())
    return MAGIC + struct.pack("<III", shape[1], shape[0], flags) + b"".join(planes)


# Pictures that were made once, as files of a folder. Effects: writes and removes files there.


_LOG: Final = logging.getLogger(__name__)
MAX_BYTES: Final = 4 * 10**9  # of the folder; the oldest go first
_AT_ONCE: Final = 2  # pictures made at the same time: a page of thumbnails may not take every core
_SWEEP_EVERY: Final = 2000  # pictures made between two looks at the folder's size


class PictureCache:
    """Bytes by the words they were made from."""

    def __init__(self, folder: Path, *, max_bytes: int = MAX_BYTES) -> None:
        self.folder = folder
        self._max_bytes = max_bytes
        self._making = threading.Semaphore(_AT_ONCE)
        self._n_made = 0
        self.folder.mkdir(parents=True, exist_ok=True)

    def file(self, words: tuple[str, ...], ending: str) -> Path:
        """Where the picture of these words is kept; the name is a digest, no word of a request."""
        digest = keys.digest(list(words))
        return self.folder / digest[:2] / f"{digest}.{ending}"

    def get(self, words: tuple[str, ...], ending: str, make: Callable[[], bytes]) -> bytes:
        """The picture of these words, made when there is none yet. Raises what make raises."""
        path = self.file(words, ending)
        try:
            return path.read_bytes()
        except OSError:
            pass
        with self._making:
            # Another request may have made it while this one waited.
            try:
                return path.read_bytes()
            except OSError:
                data = make()
        self._keep(path, data)
        return data

    def _keep(self, path: Path, data: bytes) -> None:
        part = path.with_name(f"{secrets.token_hex(8)}.part")
        try:
            path.parent.mkdir(exist_ok=True)
            part.write_bytes(data)
            part.replace(path)
        except OSError as error:
            _LOG.warning("cannot keep %s: %s", path, error)  # a full disk: made again next time
            part.unlink(missing_ok=True)
        self._n_made += 1
        if self._n_made % _SWEEP_EVERY == 0:
            self.sweep()

    def sweep(self) -> None:
        """Remove the files made first until the folder is within its size."""
        found = sorted((e.stat().st_mtime, e.stat().st_size, e.path) for e in _files(self.folder))
        excess = sum(size for _time, size, _path in found) - self._max_bytes
        for _time, size, path in found:
            if excess <= 0:
                return
            Path(path).unlink(missing_ok=True)
            excess -= size


def _files(folder: Path) -> list[os.DirEntry[str]]:
    with os.scandir(folder) as parts:
        folders = [entry.path for entry in parts if entry.is_dir()]
    found: list[os.DirEntry[str]] = []
    for path in folders:
        with os.scandir(path) as entries:
            found += [entry for entry in entries if entry.is_file()]
    return found
