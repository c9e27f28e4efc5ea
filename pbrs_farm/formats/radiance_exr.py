"""radiance.exr: the linear images of a view's light, written by `light`, read by `develop` and relight.

Pure. Channels are `<image>.<channel>`: R, G, B of outdoor, indoor, albedo, lamp<N>; X, Y, Z of normal.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from pbrs_farm.core.arrays import F32
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.layers import LAYER
from pbrs_farm.images import exr_from_layers, layers_from_exr

FILE: Final = LAYER["radiance"].file


def _channels(image: str) -> str:
    return "XYZ" if image == "normal" else "RGB"


def radiance_exr(images: Mapping[str, F32], *, attribution: str = "") -> bytes:
    """The file of linear images (H, W, 3) by name, channels "<name>.R"; attribution: its copyright."""
    planes = {
        f"{name}.{channel}": image[..., k]
        for name, image in images.items()
        for k, channel in enumerate(_channels(name))
    }
    return exr_from_layers(planes, attribution=attribution)


@dataclass(frozen=True, slots=True, eq=False)
class RadianceExr:
    """The channels of a radiance.exr."""

    planes: Mapping[str, F32]  # "indoor.R" -> (H, W)
    place: str  # of the file, for messages

    def image(self, name: str) -> F32:
        """(H, W, 3) float32 "outdoor", "indoor", "albedo", "normal" or "lamp<n>"; BadInput without it."""
        try:
            return np.stack([self.planes[f"{name}.{c}"] for c in _channels(name)], -1)
        except KeyError as error:
            raise BadInput(self.place, str(error), "no such layer") from None

    def total(self) -> F32:
        """(H, W, 3) float32 radiance of all light together; BadInput without light."""
        names = sorted({name.partition(".")[0] for name in self.planes})
        lamps = [name for name in names if name.startswith("lamp")]
        indoor = ["indoor"] if "indoor" in names else lamps
        return np.asarray(sum(self.image(name) for name in ["outdoor", *indoor]), np.float32)


def radiance_from_exr(data: bytes, place: str) -> RadianceExr:
    """Inverse of radiance_exr, all layers decoded; BadInput names place (a file or key)."""
    return RadianceExr(layers_from_exr(data, place), place)
