"""Stored layers for the browser: pictures, labels as colours, a packet of labels; cached in a folder.

Effects: writes and removes files there.
"""

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
from pbrs_farm.formats.layer_file import layer_from_bytes
from pbrs_farm.gallery.label_colours import shown_colours

THUMBNAIL_PX: Final = 288  # longer edge
_QUALITY: Final = 76  # of a thumbnail's JPEG

# The packet of a view's labels, for the panel of the pixel. Little-endian: "PBPX", width, height,
# flags (uint32 each), then the planes of the flags in this order: 1 instance (uint16), 2 depth in mm
# (uint16), 4 normal (3 x uint16, as stored), 8 NYU40 class (uint8). Planes are (H, W) in rows.
MAGIC: Final = b"PBPX"
# Layer, its bit, type and shape after (H, W).
PLANES: Final[tuple[tuple[str, int, str, tuple[int, ...]], ...]] = (
    ("instance", 1, "<u2", ()),
    ("depth", 2, "<u2", ()),
    ("normal", 4, "<u2", (3,)),
    ("semantic", 8, "<u1", ()),
)
_LOG: Final = logging.getLogger(__name__)
_MAX_BYTES: Final = 4 * 10**9  # of the folder; the oldest files are removed first
_AT_ONCE: Final = 2  # number of pictures made in parallel
_SWEEP_EVERY: Final = 2000  # number of new pictures between two checks of the folder's size


def title_of(layer: str) -> str:
    """Title of a layer in menus."""
    return LAYER[layer].shown_title


def shown_pixels(layer: str, data: bytes, place: str) -> Srgb8Image:
    """(H, W, 3) uint8 sRGB of a layer's file, for display only. Raises BadInput naming place.

    Ids and classes become colours, depth a scale between its percentiles. Not for radiance.
    """
    return shown_colours(LAYER[layer], layer_from_bytes(layer, data, place))


def shown_png(layer: str, data: bytes, place: str) -> bytes:
    """PNG of a layer at full size. Raises BadInput."""
    return images.png_from_array(shown_pixels(layer, data, place))


def thumbnail_jpeg(layer: str, data: bytes, place: str) -> bytes:
    """Small JPEG of a layer; labels are resized by the nearest pixel. Raises BadInput."""
    pixels = shown_pixels(layer, data, place)
    small = images.thumbnail(pixels, max_edge_px=THUMBNAIL_PX, nearest=LAYER[layer].is_label)
    return images.jpeg_from_array(np.ascontiguousarray(small), _QUALITY)


def packet(layers: Mapping[str, NDArray[Any]]) -> bytes:
    """The packet of the layers in PLANES that have the size of the first one."""
    shape = next((layers[name].shape[:2] for name, *_ in PLANES if name in layers), (0, 0))
    flags, planes = 0, []
    for name, bit, dtype, channels in PLANES:
        array = layers.get(name)
        if array is not None and array.shape == (*shape, *channels):
            flags |= bit
            planes.append(np.ascontiguousarray(array).astype(dtype).tobytes())
    return MAGIC + struct.pack("<III", shape[1], shape[0], flags) + b"".join(planes)


class PictureCache:
    """Pictures by their words."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._making = threading.Semaphore(_AT_ONCE)
        self._n_made = 0
        self.folder.mkdir(parents=True, exist_ok=True)

    def file(self, words: tuple[str, ...], ending: str) -> Path:
        """File of a picture; its name is a digest of the words."""
        digest = keys.digest(list(words))
        return self.folder / digest[:2] / f"{digest}.{ending}"

    def get(self, words: tuple[str, ...], ending: str, make: Callable[[], bytes]) -> bytes:
        """The cached picture of these words, made by the first call. Raises errors of make.

        The words must determine the picture, so they include the version of its files.
        """
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
            _LOG.warning("cannot cache %s: %s", path, error)
            part.unlink(missing_ok=True)
        self._n_made += 1
        if self._n_made % _SWEEP_EVERY == 0:
            self.sweep()

    def sweep(self) -> None:
        """Remove the oldest files until the folder is within its size."""
        files = sorted(
            (e.stat().st_mtime, e.stat().st_size, e.path) for e in _cached_files(self.folder)
        )
        excess = sum(size for _time, size, _path in files) - _MAX_BYTES
        for _time, size, path in files:
            if excess <= 0:
                return
            Path(path).unlink(missing_ok=True)
            excess -= size


def _cached_files(folder: Path) -> list[os.DirEntry[str]]:
    with os.scandir(folder) as parts:
        folders = [entry.path for entry in parts if entry.is_dir()]
    files: list[os.DirEntry[str]] = []
    for path in folders:
        with os.scandir(path) as entries:
            files += [entry for entry in entries if entry.is_file()]
    return files
