"""Stored layers for the browser: pictures, labels as colours, a packet of labels."""

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
