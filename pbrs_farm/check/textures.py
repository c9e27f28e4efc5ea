"""Pictures of a house's materials, decoded when first looked up; no effects."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F64, I64
from pbrs_farm.core.errors import BadInput
from pbrs_farm.images import decode_texture

Encoded = tuple[str, bytes] | None  # media type and bytes
Pixels = NDArray[np.uint8]  # (H, W, C)


@dataclass(frozen=True, slots=True, eq=False)
class Textures:
    """One kind of picture, such as the normal maps, of each material."""

    encoded: tuple[Encoded, ...] = ()
    _decoded: dict[int, Pixels | None] = field(default_factory=dict)

    def of(self, material: int) -> Pixels | None:
        """(H, W, C) pixels of a material's picture; None if it is missing or cannot be decoded."""
        if material not in self._decoded:
            self._decoded[material] = self._decode(material)
        return self._decoded[material]

    def _decode(self, material: int) -> Pixels | None:
        stored = self.encoded[material] if material < len(self.encoded) else None
        if stored is None:
            return None
        try:
            pixels = decode_texture(stored[1], f"material {material}", stored[0])
        except BadInput:
            return None
        return pixels[..., None] if pixels.ndim == 2 else pixels

    def apply(self, material: I64, function: Callable[[int, NDArray[Any], Pixels], None]) -> None:
        """Call function(material, mask of its points, pixels) for each material with a picture among N points."""
        for number in np.unique(material).tolist():
            pixels = self.of(number)
            if pixels is not None:
                function(number, material == number, pixels)


def between_texels(pixels: Pixels, uv: F64, value_of_byte: F64) -> F64:
    """(N, C) values interpolated between the four texels around each uv (N, 2), which repeats; v down."""
    height, width = pixels.shape[:2]
    x, y = uv[:, 0] * width - 0.5, uv[:, 1] * height - 0.5
    values = np.zeros((len(uv), pixels.shape[2]))
    for dx, dy in ((0, 0), (1, 0), (0, 1), (1, 1)):
        column, row = np.floor(x) + dx, np.floor(y) + dy
        weight = (1 - np.abs(x - column)) * (1 - np.abs(y - row))
        texel = value_of_byte[pixels[(row % height).astype(int), (column % width).astype(int)]]
        values += weight[:, None] * texel
    return values
