"""Normalised colour and depth histograms of pictures, and their reduction to fewer bins; no effects.

Bin edges are nested powers of two: a histogram at any coarser binning is an exact sum of bins, so
one stored histogram serves every binning of a reference.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F32, Srgb8Image
from pbrs_farm.core.recipe import HistogramFields

Counts = NDArray[np.uint32]  # (bins,) pixels in each bin


@dataclass(frozen=True, slots=True, eq=False)
class Histogram:
    """Pixel counts of one picture."""

    colour: Counts  # (colour_bins ** 3,), first channel slowest
    depth: Counts  # (depth_bins,), of pixels of known depth only


def histogram(
    rgb_srgb8: Srgb8Image, depth_mm: NDArray[np.integer], settings: HistogramFields
) -> Histogram:
    """Histogram (paper section 3.3) of (H, W, 3) uint8 and depth in mm, maybe of another size; ValueError."""
    return Histogram(colour_counts(rgb_srgb8, settings), depth_counts(depth_mm, settings))


def colour_counts(rgb_srgb8: Srgb8Image, settings: HistogramFields) -> Counts:
    """(colour_bins ** 3,) uint32 counts of the pixels of (H, W, 3) uint8 in settings.colour_space.

    Bins are the leading bits of each channel, the first channel slowest, so colour_bins is a power
    of two. The counts sum to H W. ValueError for any other shape or type than (H, W, 3) uint8.
    """
    if rgb_srgb8.ndim != 3 or rgb_srgb8.shape[2] != 3 or rgb_srgb8.dtype != np.uint8:
        raise ValueError(f"a picture is (H, W, 3) uint8, got {rgb_srgb8.shape} {rgb_srgb8.dtype}")
    pixels = _ycbcr(rgb_srgb8) if settings.colour_space == "ycbcr" else rgb_srgb8
    # Combine the leading bits of the three channels to a bin index.
    bits = settings.colour_bins.bit_length() - 1
    index = (pixels[..., 0] >> (8 - bits)).astype(np.uint16)
    for channel in (1, 2):
        index <<= np.uint16(bits)
        index |= pixels[..., channel] >> (8 - bits)
    return np.bincount(index.reshape(-1), minlength=settings.colour_bins**3).astype(np.uint32)


def depth_counts(depth_mm: NDArray[np.integer], settings: HistogramFields) -> Counts:
    """(depth_bins,) uint32 counts of known depths; values beyond the range count in the first or last bin.

    depth_mm is (H, W) of whole millimetres, 0 = unknown and not counted; the range of the bins is
    settings.depth_min_m to depth_max_m. The counts sum to the pixels of known depth. ValueError for
    floats, which would be metres.
    """
    if depth_mm.ndim != 2 or not np.issubdtype(depth_mm.dtype, np.integer):
        raise ValueError(f"depth is (H, W) whole millimetres, got {depth_mm.dtype}")
    # Count each millimetre first: a table of 65536 bins is quicker than a division per pixel.
    per_mm = np.bincount(np.clip(depth_mm, 0, 65535).reshape(-1).astype(np.intp), minlength=65536)
    per_mm[0] = 0  # unknown
    # Sum the millimetres of each bin.
    low, high = settings.depth_min_m * 1000.0, settings.depth_max_m * 1000.0
    place = np.floor((np.arange(65536) - low) * (settings.depth_bins / (high - low)))
    bins = np.clip(place, 0, settings.depth_bins - 1).astype(np.intp)
    return np.bincount(bins, weights=per_mm, minlength=settings.depth_bins).astype(np.uint32)


def _ycbcr(rgb: Srgb8Image) -> Srgb8Image:
    """(H, W, 3) uint8 luma and chroma of full range (BT.601), in 16-bit fixed point, rounded."""
    r, g, b = (rgb[..., k].astype(np.int32) for k in range(3))
    half = 1 << 15  # of a unit in fixed point: rounds
    y = (19595 * r + 38470 * g + 7471 * b + half) >> 16
    cb = (-11059 * r - 21709 * g + 32768 * b + half) // 65536 + 128
    cr = (32768 * r - 27439 * g - 5329 * b + half) // 65536 + 128
    return np.clip(np.stack([y, cb, cr], axis=-1), 0, 255).astype(np.uint8)


def coarser_colour(counts: NDArray[np.generic], shape: tuple[int, int, int]) -> NDArray[np.generic]:
    """(..., a * b * c) sums of colour bins (..., n ** 3); ValueError unless a, b, c divide n."""
    n = round(counts.shape[-1] ** (1 / 3))
    if n**3 != counts.shape[-1] or any(n % k for k in shape):
        raise ValueError(f"{counts.shape[-1]} colour bins cannot be summed to {shape}")
    if shape == (n, n, n):
        return counts
    a, b, c = shape
    # Split each axis into (coarse bin, fine bin within it) and sum the latter.
    cube = counts.reshape(*counts.shape[:-1], a, n // a, b, n // b, c, n // c)
    return np.asarray(cube.sum(axis=(-5, -3, -1))).reshape(*counts.shape[:-1], a * b * c)


def coarser_depth(counts: NDArray[np.generic], n_bins: int) -> NDArray[np.generic]:
    """(..., n_bins) exact sums of depth bins (..., bins); ValueError unless n_bins divides them."""
    if counts.shape[-1] % n_bins:
        raise ValueError(f"{counts.shape[-1]} depth bins cannot be summed to {n_bins}")
    if n_bins == counts.shape[-1]:
        return counts
    pairs = counts.reshape(*counts.shape[:-1], n_bins, counts.shape[-1] // n_bins)
    return np.asarray(pairs.sum(axis=-1))


def normalised(counts: NDArray[np.generic]) -> F32:
    """(..., bins) float32 shares of counts, of sum 1, or 0 without any, over the last axis."""
    total = counts.sum(axis=-1, keepdims=True, dtype=np.float64)
    total[total == 0] = 1.0  # nothing counted: shares of 0
    return np.asarray(np.divide(counts, total, dtype=np.float32, casting="same_kind"))
