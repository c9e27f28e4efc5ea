"""The labels of every pixel of a view in one packet, for the probe under the pointer; pure.

Little-endian: "PBPX", width, height, flags (uint32 each), then the planes that the flags name, in
this order: 1 instance (uint16), 2 depth in mm (uint16), 4 normal (3 x uint16, as stored),
8 NYU40 class (uint8). Each plane is (H, W) row by row.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

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
