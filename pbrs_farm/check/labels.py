"""The layers of a stored view, read and held to their size and type. Effects: reads files."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.check.certificate import Tally
from pbrs_farm.check.stored_view import StoredView
from pbrs_farm.core.arrays import F32
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.layers import LAYERS, Layer

BASIC = tuple(x.name for x in LAYERS if x.step == "truth" and not x.optional)
_DEPTHS = {"RGB": (3,), "R G B": (3,), "X Y Z": (3,), "X Y": (2,)}  # of vectors and colours


def read_labels(view: StoredView, tally: Tally) -> dict[str, NDArray[Any]] | None:
    """Layers by name; None if a basic one is missing, damaged or of a wrong shape.

    Includes the optional layers that the view has and that can be read, without radiance. Reports
    every fault to the tally.
    """
    arrays = {}
    for layer in LAYERS:
        if layer.name in BASIC or (view.has(layer.file) and layer.name != "radiance"):
            array = _read_layer(view, layer, tally)
            if array is not None:
                arrays[layer.name] = array
    return arrays if all(name in arrays for name in BASIC) else None


def read_radiance(view: StoredView, tally: Tally) -> dict[str, F32]:
    """The channels of radiance.exr; {} if it is missing or cannot be read."""
    if not view.has("radiance.exr"):
        return {}
    try:
        return view.exr("radiance.exr")
    except BadInput as error:
        tally.expect("radiance", view.place, False, str(error))
        return {}


def _read_layer(view: StoredView, layer: Layer, tally: Tally) -> NDArray[Any] | None:
    expect = tally.at("layers", f"{view.place}/{layer.file}")
    if not expect(view.has(layer.file), "is missing"):
        return None
    try:
        array = view.png(layer.file) if layer.file.endswith(".png") else _planes(view, layer)
    except (BadInput, KeyError) as error:
        expect(False, str(error))
        return None
    shape = (*view.size, *_DEPTHS.get(layer.channels, ()))
    # EXR files are read as 32-bit floats, whatever they hold.
    dtype = "float32" if layer.dtype == "float16" else layer.dtype
    fits = array.shape == shape and str(array.dtype) == dtype
    fault = f"{array.shape} {array.dtype}, expected {shape} {layer.dtype}"
    return array if expect(fits, fault) else None


def _planes(view: StoredView, layer: Layer) -> F32:
    """The channels of an EXR layer, stacked if there are several."""
    channels = view.exr(layer.file)
    planes = [channels[name] for name in layer.channels.split()]
    return planes[0] if len(planes) == 1 else np.stack(planes, axis=-1)
