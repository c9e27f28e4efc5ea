"""Stored layers as pictures that a browser shows: photographs as they are, labels as colours; pure."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm import images
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
