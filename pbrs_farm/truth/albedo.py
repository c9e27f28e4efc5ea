"""The albedo layer: diffuse reflectance at each pixel's centre; no effects."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F32, HitRecord
from pbrs_farm.core.frames import linear_from_srgb, srgb_from_linear
from pbrs_farm.core.house import Geometry, House

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
            linear[mask] = colour if pixels is None else colour * _texels(pixels, hit.uv[mask])
    # Encode by table: 8-bit sRGB.
    steps = np.rint(np.clip(linear, 0, 1) * _STEPS).astype(np.int32)
    return np.asarray(_BYTE_OF_LINEAR[steps])


def _texels(pixels: NDArray[np.uint8], uv: F32) -> F32:
    """(N, 3) linear colour at uv (N, 2), bilinear, repeating."""
    # Place texel centres at half integers; v points up, rows count down.
    height, width = pixels.shape[:2]
    finite = np.where(np.isfinite(uv), uv, 0).astype(np.float64)
    x = finite[:, 0] * width - 0.5
    y = (1 - finite[:, 1]) * height - 0.5
    # Find the four texels around each point and how far it lies between them.
    x0, y0 = np.floor(x), np.floor(y)
    fx, fy = (x - x0).astype(np.float32)[:, None], (y - y0).astype(np.float32)[:, None]
    left, right = (x0 % width).astype(np.int64), ((x0 + 1) % width).astype(np.int64)
    top, bottom = (y0 % height).astype(np.int64), ((y0 + 1) % height).astype(np.int64)

    def at(rows: NDArray[np.int64], columns: NDArray[np.int64]) -> F32:
        return _LINEAR_OF_BYTE[pixels[rows, columns, :3]]

    # Blend in linear light, along rows first.
    upper = at(top, left) * (1 - fx) + at(top, right) * fx
    lower = at(bottom, left) * (1 - fx) + at(bottom, right) * fx
    return np.asarray(upper * (1 - fy) + lower * fy, np.float32)
