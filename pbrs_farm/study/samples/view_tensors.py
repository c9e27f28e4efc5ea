"""A Sample's arrays as torch tensors; no effects."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from pbrs_farm.study.reading.view_sample import Sample

Tensors = dict[str, Any]  # name -> tensor or text


def tensors_of_sample(sample: Sample) -> Tensors:
    """Tensors by the names of Sample's arrays, and id, house, room, mode, axes as text.

    colour (3, H, W) uint8; normal (3, H, W), depth (H, W) and K (3, 3) float32; valid and boundary
    (H, W) bool; class40 (H, W) uint8; instance (H, W) int32, since torch hardly knows uint16.
    """
    names = ("id", "house", "room", "mode", "axes")
    tensors: Tensors = {name: getattr(sample, name) for name in names}
    tensors["K"] = _tensor(sample.K)
    for name, array in sample.arrays().items():
        # Channels come first, as torch's convolutions want them.
        planes = array.transpose(2, 0, 1) if array.ndim == 3 else array
        tensors[name] = _tensor(planes.astype(np.int32) if name == "instance" else planes)
    return tensors


def _tensor(array: NDArray[Any]) -> Any:
    # Copy where the array is a view of something, or may not be written to.
    is_own = array.flags.c_contiguous and array.flags.writeable
    return torch.from_numpy(array if is_own else array.copy(order="C"))
