"""The albedo layer: diffuse reflectance at each pixel's centre; no effects."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import HitRecord
from pbrs_farm.core.frames import linear_from_srgb, srgb_from_linear
from pbrs_farm.core.house import Geometry, House
from pbrs_farm.truth.bilinear import bilinear

_LINEAR_OF_BYTE = linear_from_srgb(np.arange(256) / 255).astype(np.float32)
_STEPS = 4096  # entries of the encoding table: fine enough that every byte is rounded as by formula
_BYTE_OF_LINEAR = np.rint(srgb_from_linear(np.arange(_STEPS + 1) / _STEPS) * 255).astype(np.uint8)


def albedo_png(
    hit: HitRecord, house: House, geometry: Geometry, textures: Mapping[str, NDArray[np.uint8]]
) -> NDArray[np.uint8]:
    """(H, W, 3) uint8 sRGB: diffuse colour times texture, multiplied in linear light; 0 = nothing.

    textures: id -> (H, W, 3 or 4) uint8 sRGB, row 0 = top (v = 1), repeated; looked up between the
    four nearest texels, not filtered over the pixel. A missing texture counts as white.
    """
    # Shade material by material: each texture is looked up once, for all its pixels.
    linear = np.zeros((*hit.face.shape, 3), np.float32)
    if len(geometry.faces):
        material = np.where(hit.valid, geometry.face_material[hit.face], -1)
        for number in np.unique(material[material >= 0]):
            shaded = house.materials[int(number)]
            mask = material == number
            colour = linear_from_srgb(np.array(shaded.diffuse)).astype(np.float32)
            pixels = textures.get(shaded.texture_id) if shaded.texture_id else None
            linear[mask] = colour
            if pixels is not None:
                linear[mask] *= bilinear(pixels[..., :3], hit.points.uv[mask], _LINEAR_OF_BYTE)
    # Encode by table: 8-bit sRGB.
    steps = np.rint(np.clip(linear, 0, 1) * _STEPS).astype(np.int32)
    return np.asarray(_BYTE_OF_LINEAR[steps])
