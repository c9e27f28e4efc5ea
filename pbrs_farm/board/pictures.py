"""Stored layers as a browser takes them: pictures, labels as colours, labels in one packet; no effects."""

from __future__ import annotations

import struct
from collections.abc import Mapping
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm import images
from pbrs_farm.core.arrays import Srgb8Image
from pbrs_farm.core.layers import LAYER
from pbrs_farm.formats.layer_file import layer_from_bytes
from pbrs_farm.gallery.label_colours import shown_colours

THUMBNAIL_PX: Final = 288  # longer edge
_QUALITY: Final = 76  # of a thumbnail's JPEG

# The packet of a view's labels, for the probe under the pointer. Little-endian: "PBPX", width,
# height, flags (uint32 each), then the planes that the flags name, in this order: 1 instance
# (uint16), 2 depth in mm (uint16), 4 normal (3 x uint16, as stored), 8 NYU40 class (uint8). Each
# plane is (H, W) row by row.
MAGIC: Final = b"PBPX"
# Layer, its bit, type and shape behind (H, W).
PLANES: Final[tuple[tuple[str, int, str, tuple[int, ...]], ...]] = (
    ("instance", 1, "<u2", ()),
    ("depth", 2, "<u2", ()),
    ("normal", 4, "<u2", (3,)),
    ("semantic", 8, "<u1", ()),
)


def title_of(layer: str) -> str:
    """What a menu calls a layer."""
    return LAYER[layer].shown_title


def shown_pixels(layer: str, data: bytes, place: str) -> Srgb8Image:
    """(H, W, 3) uint8 sRGB of a layer's file. Raises BadInput where it cannot be read.

    data is the stored file, place what messages call it. Ids and classes become colours, depth a
    scale between its own percentiles: never decode values from it. Not for radiance, which is no
    picture.
    """
    return shown_colours(LAYER[layer], layer_from_bytes(layer, data, place))


def shown_png(layer: str, data: bytes, place: str) -> bytes:
    """PNG of a layer at its full size. Raises BadInput where it cannot be read."""
    return images.png_from_array(shown_pixels(layer, data, place))


def thumbnail_jpeg(layer: str, data: bytes, place: str) -> bytes:
    """JPEG of a layer, small. Raises BadInput where it cannot be read.

    Labels are made small by the nearest pixel, so that no new colour comes in between two classes.
    """
    pixels = shown_pixels(layer, data, place)
    small = images.thumbnail(pixels, max_edge_px=THUMBNAIL_PX, nearest=LAYER[layer].is_label)
    return images.jpeg_from_array(np.ascontiguousarray(small), _QUALITY)


def packet(layers: Mapping[str, NDArray[Any]]) -> bytes:
    """The packet of the layers there are; those of another size than the first are left out.

    Width, height and a bit for each layer that is there, then the planes in the order of PLANES,
    rows from the top. Layers that PLANES does not name are left out.
    """
    shape = next((layers[name].shape[:2] for name, *_ in PLANES if name in layers), (0, 0))
    flags, planes = 0, []
    for name, bit, dtype, behind in PLANES:
        array = layers.get(name)
        if array is not None and array.shape == (*shape, *behind):
            flags |= bit
            planes.append(np.ascontiguousarray(array).astype(dtype).tobytes())
    return MAGIC + struct.pack("<III", shape[1], shape[0], flags) + b"".join(planes)
