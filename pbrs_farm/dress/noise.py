"""Periodic noise and shapes on a torus: every array continues at its opposite edge; no effects."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F32

Shape2 = tuple[int, int]  # rows, columns

_LEAST_GAIN = 2e-4  # frequencies weaker than this share of the strongest are left out


def noise(
    rng: np.random.Generator,
    shape: Shape2,
    *,
    slope: float = 2.0,
    stretch: tuple[float, float] = (1.0, 1.0),
    band: tuple[float, float] = (1.0, 1e9),
) -> F32:
    """(H, W) float32 of mean 0 and deviation 1, periodic by construction.

    Power falls with frequency k as k^-slope (0 white, 2 clouds, 4 hills). stretch: how many times
    longer features are along rows and along columns. band: cycles per texture that are let
    through, softly at the upper end.
    """
    # Draw the half spectrum that a real picture has, where the band lets anything through.
    rows, gain = _gain(shape, slope, stretch, band)
    spectrum = np.zeros((shape[0], gain.shape[1]), np.complex64)
    spectrum[rows] = rng.standard_normal(gain.shape, np.float32) * gain
    spectrum.imag[rows] = rng.standard_normal(gain.shape, np.float32) * gain
    # Columns of zeros need no transform: the second one fills them in.
    field = np.fft.irfft(np.fft.ifft(spectrum, axis=0), shape[1], axis=1)
    field *= np.float32(1 / max(float(field.std()), 1e-12))
    return np.asarray(field, np.float32)


@lru_cache(maxsize=32)
def _gain(
    shape: Shape2, slope: float, stretch: tuple[float, float], band: tuple[float, float]
) -> tuple[NDArray[np.intp], F32]:
    """By what the frequencies of a spectrum are multiplied: numbers (R,) of its rows that are not
    nothing, and (R, C) of their first columns, beyond which all is nothing; read only."""
    rows, columns = shape
    fy = np.fft.fftfreq(rows, 1.0 / rows).astype(np.float32)[:, None] * np.float32(stretch[0])
    fx = np.arange(columns // 2 + 1, dtype=np.float32)[None] * np.float32(stretch[1])
    k2 = fy * fy + fx * fx
    # Let the band through; the mean is nothing.
    gain = np.exp(np.log(np.maximum(k2, np.float32(1e-6))) * np.float32(-slope / 4.0))
    gain *= k2 >= np.float32(band[0] ** 2 * 0.999)
    if band[1] < max(shape):
        gain *= np.exp(-k2 / np.float32(band[1] ** 2))
    gain[0, 0] = 0.0
    # Leave out what adds nothing that eight bits show.
    some = gain > _LEAST_GAIN * gain.max()
    used, n_columns = np.flatnonzero(some.any(1)), int(np.flatnonzero(some.any(0))[-1]) + 1
    used_gain: F32 = gain[used, :n_columns].astype(np.float32)
    used_gain.flags.writeable = False
    return used, used_gain


def blurred(field: F32, sigma_px: float) -> F32:
    """The field (H, W) under a periodic Gaussian of sigma_px pixels."""
    rows, columns = field.shape
    fy = np.fft.fftfreq(rows).astype(np.float32)[:, None]
    fx = np.fft.rfftfreq(columns).astype(np.float32)[None]
    gain = np.exp(-2.0 * (np.pi * sigma_px) ** 2 * (fy * fy + fx * fx)).astype(np.float32)
    return np.asarray(np.fft.irfft2(np.fft.rfft2(field) * gain, field.shape), np.float32)


def halved(field: F32) -> F32:
    """The means of blocks of two by two pixels; both edges even."""
    return np.asarray(
        (field[::2, ::2] + field[1::2, ::2] + field[::2, 1::2] + field[1::2, 1::2])
        * np.float32(0.25),
        np.float32,
    )


def smoothstep(low: float, high: float, x: F32) -> F32:
    """0 below low, 1 above high, smooth between; low > high turns it round."""
    t = np.clip((x - low) / (high - low), 0.0, 1.0)
    return np.asarray(t * t * (3.0 - 2.0 * t), np.float32)


def coverage(distance_m: F32, half_width_m: float, pixel_m: float) -> F32:
    """Share of a pixel that a line covers: box-filtered, exact for lines along the axes."""
    reach = (half_width_m + 0.5 * pixel_m - distance_m) / pixel_m
    return np.asarray(np.clip(reach, 0.0, min(1.0, 2.0 * half_width_m / pixel_m)), np.float32)


def sampled(field: F32, rows: np.ndarray, columns: np.ndarray) -> F32:
    """field at integer pixels, wrapped at its edges."""
    h, w = field.shape
    # One number a pixel, and a mask in place of the remainder where a side is a power of two.
    index = _wrapped(rows, h) * np.int32(w) + _wrapped(columns, w)
    return np.asarray(field.reshape(-1)[index], np.float32)


def _wrapped(numbers: np.ndarray, size: int) -> np.ndarray:
    small = numbers.astype(np.int32)
    return small & np.int32(size - 1) if size & (size - 1) == 0 else small % np.int32(size)
