"""The files of a view's layers, PNG or EXR as core/layers.py says: pictures and labels. Pure.

Written by `truth`, `opengl_dl`, `opengl_il` and `develop`; radiance.exr is in radiance_exr.py.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.layers import LAYER, Layer
from pbrs_farm.formats.radiance_exr import radiance_from_exr
from pbrs_farm.images import array_from_png, exr_from_layers, layers_from_exr, png_from_array


def layer_bytes(name: str, array: NDArray[Any], attribution: str = "") -> bytes:
    """The PNG or EXR of a layer's (H, W[, C]) array in its row's type; attribution: its copyright."""
    layer = LAYER[name]
    if layer.file.endswith(".png"):
        if layer.n_stacked > 1:
            array = np.ascontiguousarray(np.concatenate(np.moveaxis(array, -1, 0)))
        return png_from_array(array, attribution=attribution)
    # An EXR keeps each channel as a plane by its name: Z, or R, G and B.
    channels = layer.channels.split()
    planes = [array] if len(channels) == 1 else list(np.moveaxis(array, -1, 0))
    named = zip(channels, planes, strict=True)
    layers = {c: np.ascontiguousarray(plane, np.float32) for c, plane in named}
    return exr_from_layers(layers, half=layer.dtype == "float16", attribution=attribution)


def layer_from_bytes(name: str, data: bytes, place: str) -> NDArray[Any]:
    """The array of layer_bytes, half floats as float32, radiance.exr as all its light; BadInput."""
    layer = LAYER[name]
    if layer.file.endswith(".png"):
        return unstacked(layer, array_from_png(data, place))
    if name == "radiance":
        return radiance_from_exr(data, place).total()
    planes = layers_from_exr(data, place)
    arrays = [planes[channel] for channel in layer.channels.split()]
    return arrays[0] if len(arrays) == 1 else np.stack(arrays, axis=-1)


def unstacked(layer: Layer, pixels: NDArray[Any]) -> NDArray[Any]:
    """(H, W, K) of K pictures below one another (K H, W); a PNG of one picture is unchanged."""
    if layer.n_stacked == 1 or len(pixels) % layer.n_stacked:
        return pixels
    return np.stack(np.split(pixels, layer.n_stacked), axis=-1)
