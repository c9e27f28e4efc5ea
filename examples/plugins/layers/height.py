"""A custom label layer: height above the floor of the house's lowest level, millimetres.

pbrs-farm run builtin --layers height --out out/height
"""

from __future__ import annotations

from typing import Any

import numpy as np

from pbrs_farm.plugin import optional_layer


class Height:
    """Target of the entry point: an object with a layer and a function that computes it."""

    layer = optional_layer("height", "Y", "uint16", "mm above the lowest floor")

    @staticmethod
    def label(inputs: Any) -> Any:
        """(H, W) uint16 of pbrs_farm.truth.optional_layers.LabelInputs."""
        y = inputs.hit.points.position_world[..., 1] - min(r.floor_y for r in inputs.house.rooms)
        return np.where(inputs.hit.valid, np.clip(np.rint(y * 1000), 0, 65535), 0).astype(np.uint16)


HEIGHT = Height()
