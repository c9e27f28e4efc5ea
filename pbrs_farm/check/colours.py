"""Colour functions of `verify`, written apart from core.frames (IEC 61966-2-1, Rec. 709); no effects."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F32, F64

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])  # weights of linear sRGB in luminance
LM_PER_W = 179.0  # lumen per watt of white light


def linear_from_srgb(srgb: Any) -> F64:
    """Linear light of sRGB values in 0..1, clipped to that range."""
    c = np.clip(np.asarray(srgb, np.float64), 0, 1)
    return np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)


def srgb_from_linear(linear: Any) -> F64:
    """SRGB values of linear light; not clipped above 1."""
    c = np.asarray(linear, np.float64)
    return np.where(c <= 0.0031308, 12.92 * c, 1.055 * np.maximum(c, 0.0) ** (1 / 2.4) - 0.055)


def luminance_of(channels: Mapping[str, F32], name: str) -> F64:
    """(H, W) luminance of the channels name.R, name.G and name.B of radiance.exr."""
    return np.asarray(rgb_of(channels, name) @ LUMINANCE)


def rgb_of(channels: Mapping[str, F32], name: str, axes: str = "RGB") -> F64:
    """(H, W, 3) the channels name.R, name.G and name.B, or of other axes."""
    return np.stack([channels[f"{name}.{c}"] for c in axes], axis=-1).astype(np.float64)


def has_channels(
    channels: Mapping[str, NDArray[Any]], size: tuple[int, int], colours: str, vectors: str = ""
) -> bool:
    """True if radiance.exr has the groups of RGB and of XYZ channels, named with spaces between, at a size."""
    names = [f"{group}.{c}" for group in colours.split() for c in "RGB"]
    names += [f"{group}.{c}" for group in vectors.split() for c in "XYZ"]
    return all(name in channels and channels[name].shape == size for name in names)
