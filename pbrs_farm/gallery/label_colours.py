"""Layers as readable colours, each drawn by its entry in the table of layers; no effects."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import Srgb8Image
from pbrs_farm.core.classes import NYU40_COLOURS
from pbrs_farm.core.layers import Layer, ShownAs

_NEAR_TO_FAR: Final = np.array(
    [[253, 246, 214], [164, 216, 172], [64, 172, 172], [34, 112, 162], [42, 54, 122], [18, 14, 42]],
    np.float64,
)  # sRGB of depths at equal steps


def depth_range_m(depth_mm: NDArray[np.integer]) -> tuple[float, float]:
    """Metres, 1 mm apart at least, of the 1st and 99th percentile of mm above 0; (0, 1) without."""
    valid = depth_mm[depth_mm > 0]
    if not valid.size:
        return 0.0, 1.0
    low, high = np.percentile(valid, (1, 99)) / 1000.0
    return float(low), float(max(high, low + 1e-3))


def depth_colours(
    depth_mm: NDArray[np.integer], near_m: float | None = None, far_m: float | None = None
) -> Srgb8Image:
    """(H, W, 3): pale = near_m, dark blue = far_m (default: depth_range_m), grey = no depth (0)."""
    # Scale to 0..1, then look up a ramp of 256 colours.
    low, high = depth_range_m(depth_mm)
    low = low if near_m is None else near_m
    high = high if far_m is None else far_m
    share = np.clip((depth_mm / 1000.0 - low) / max(high - low, 1e-6), 0, 1)
    ramp = np.linspace(0, 1, len(_NEAR_TO_FAR))
    table = np.stack(
        [np.interp(np.arange(256) / 255, ramp, column) for column in _NEAR_TO_FAR.T], axis=-1
    )
    picked = np.rint(table[np.rint(share * 255).astype(np.intp)])
    colours = np.asarray(picked, np.uint8)
    colours[depth_mm == 0] = (58, 58, 62)  # no depth: a grey outside the ramp
    return colours


def semantic_colours(nyu40: NDArray[np.integer]) -> Srgb8Image:
    """(H, W, 3) uint8 NYU40_COLOURS of ids (H, W); ids above 40 get the colour of no class."""
    return NYU40_COLOURS[np.where(nyu40 > 40, 0, nyu40)]


def instance_colours(instance: NDArray[np.integer]) -> Srgb8Image:
    """(H, W, 3) a colour per instance id (0 = nothing), alike in all views, not to be decoded."""
    ids = np.arange(int(instance.max(initial=0)) + 1)
    # Step hues by the golden ratio, and vary value and saturation, so neighbours differ.
    hue = (ids * 0.61803398875) % 1.0
    value = np.array([0.96, 0.74, 0.56])[ids // 2 % 3]
    saturation = np.array([0.72, 0.50, 0.85])[ids // 5 % 3]
    # HSV to RGB.
    ring = np.clip(np.abs((hue[:, None] * 6 + [0, 4, 2]) % 6 - 3) - 1, 0, 1)
    table = 255 * value[:, None] * (1 - saturation[:, None] * (1 - ring))
    table[0] = NYU40_COLOURS[0]
    return np.asarray(np.rint(table).astype(np.uint8)[instance])


def flow_colours(flow: NDArray[Any], most_px: float | None = None) -> Srgb8Image:
    """(H, W, 3): hue = direction, saturation = distance up to most_px (99th percentile); white = none."""
    length = np.linalg.norm(flow, axis=-1)
    most = max(float(np.percentile(length, 99)), 0.5) if most_px is None else most_px
    share = np.clip(length / most, 0, 1)[..., None]
    # HSV to RGB with value 1: hues fade to white.
    hue = np.arctan2(flow[..., 1], flow[..., 0]) / (2 * np.pi) % 1.0
    ring = np.clip(np.abs((hue[..., None] * 6 + [0, 4, 2]) % 6 - 3) - 1, 0, 1)
    return np.asarray(np.rint(255 * (1 - share * (1 - ring))), np.uint8)


def normal_colours(normal_label: NDArray[Any]) -> Srgb8Image:
    """(H, W, 3) uint8 of a normal layer as stored, in its own axes (x right, y forward, z up)."""
    if normal_label.dtype == np.uint8:
        return np.asarray(normal_label[..., :3], np.uint8)
    return np.asarray(normal_label[..., :3] >> 8, np.uint8)


def boundary_colours(boundary: NDArray[np.uint8]) -> Srgb8Image:
    """(H, W, 3): boundaries are light on dark."""
    table = np.array([[20, 22, 28], [244, 236, 214]], np.uint8)
    return np.asarray(table[(boundary > 0).astype(np.intp)])


def shown_colours(layer: Layer, stored: NDArray[Any]) -> Srgb8Image:
    """(H, W, 3) uint8 sRGB of a stored array by layer.shown_as, of depth_layers its second surface; KeyError for radiance."""
    if stored.ndim == 3 and stored.shape[2] > 4:
        stored = stored[..., 1].astype(np.int64)
    return _SHOWN[layer.shown_as](stored)


def _picture_colours(stored: NDArray[Any]) -> Srgb8Image:
    if stored.dtype != np.uint8:
        stored = (stored >> 8).astype(np.uint8)
    return np.repeat(stored[..., None], 3, axis=2) if stored.ndim == 2 else stored[..., :3]


def _depth_m_colours(metres: NDArray[Any]) -> Srgb8Image:
    return depth_colours(np.rint(np.nan_to_num(metres) * 1000).astype(np.int64))


def _disparity_colours(disparity: NDArray[Any]) -> Srgb8Image:
    # Invert: disparity is large near the camera.
    steps = disparity.astype(np.int64)
    return depth_colours(np.where(steps > 0, 4_000_000 // np.maximum(steps, 1), 0))


def _kitti_colours(flow: NDArray[Any]) -> Srgb8Image:
    return flow_colours(np.where(flow[..., 2:] > 0, flow[..., :2] / 64 - 512, 0))


def _range_colours(stored: NDArray[Any]) -> Srgb8Image:
    values = np.nan_to_num(np.asarray(stored, np.float64))
    low, high = values.min((0, 1)), values.max((0, 1))
    scaled = np.rint(255 * (values - low) / np.maximum(high - low, 1e-6)).astype(np.uint8)
    return np.repeat(scaled[..., None], 3, axis=2) if scaled.ndim == 2 else scaled[..., :3]


_SHOWN: Final[Mapping[ShownAs, Callable[[NDArray[Any]], Srgb8Image]]] = {
    "picture": _picture_colours,
    "classes": semantic_colours,
    "ids": instance_colours,
    "mask": boundary_colours,
    "depth": depth_colours,
    "depth_m": _depth_m_colours,
    "disparity": _disparity_colours,
    "flow": flow_colours,
    "flow_kitti": _kitti_colours,
    "high_byte": normal_colours,
    "range": _range_colours,
}
