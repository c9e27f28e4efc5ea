"""What a procedural surface gives: colour, roughness and normals that repeat; no effects."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F32, Srgb8Image
from pbrs_farm.core.frames import linear_from_srgb
from pbrs_farm.core.house import Texture
from pbrs_farm.dress.style import Rgb
from pbrs_farm.images import jpeg_from_array

# Periodic noise and shapes on a torus: every array continues at its opposite edge.


Shape2 = tuple[int, int]  # rows, columns

_LEAST_GAIN = 2e-4  # of the strongest frequency's


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
    # Columns that are nothing need no transform of their own: the second one fills them in.
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
    found: F32 = gain[used, :n_columns].astype(np.float32)
    found.flags.writeable = False
    return used, found


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
    """How much of a pixel a line covers: box-filtered, exact for lines along the axes."""
    reach = (half_width_m + 0.5 * pixel_m - distance_m) / pixel_m
    return np.asarray(np.clip(reach, 0.0, min(1.0, 2.0 * half_width_m / pixel_m)), np.float32)


def sampled(field: F32, rows: np.ndarray, columns: np.ndarray) -> F32:
    """field at integer pixels, wrapped at its edges."""
    h, w = field.shape
    # One number a pixel, and a mask in place of the remainder where a side is a power of two.
    at = _wrapped(rows, h) * np.int32(w) + _wrapped(columns, w)
    return np.asarray(field.reshape(-1)[at], np.float32)


def _wrapped(numbers: np.ndarray, size: int) -> np.ndarray:
    small = numbers.astype(np.int32)
    return small & np.int32(size - 1) if size & (size - 1) == 0 else small % np.int32(size)


# What a procedural surface gives.


_COLOUR_QUALITY = 92
_MAP_QUALITY = 90
_RELIEF_PX = 1024  # longest edge of roughness and normal maps


@dataclass(frozen=True, slots=True, eq=False)
class SurfaceMaps:
    """One repeat of a surface; row 0 is its upper edge, u to the right, v up."""

    colour: Srgb8Image  # (H, W, 3) uint8, sRGB-encoded, the relief's shade in it
    roughness: Srgb8Image | float  # (h, w) uint8, 255 = 1, or one value 0..1
    normal: Srgb8Image | None  # (h, w, 3) uint8, tangent space as glTF's; None = flat
    size_m: tuple[float, float]  # width and height of one repeat
    gloss: float = 0.0  # strength of the coat's reflection, 0 matt, 0.5 varnish or glaze

    @property
    def mean_rgb(self) -> Rgb:
        """The mean of the linear colour, what a surface's own colour is divided by to tint it."""
        table = linear_from_srgb(np.arange(256) / 255)
        # Count the bytes instead of looking each up.
        counts = [np.bincount(self.colour[..., k].reshape(-1), minlength=256) for k in range(3)]
        r, g, b = (float(table @ count) / count.sum() for count in counts)
        return (float(r), float(g), float(b))

    @property
    def mean_roughness(self) -> float:
        """The mean of the roughness, 0..1."""
        if isinstance(self.roughness, float):
            return self.roughness
        return float(self.roughness.mean()) / 255.0


def surface_maps(
    colour: F32, roughness: F32 | float, height_m: F32, size_m: tuple[float, float], gloss: float
) -> SurfaceMaps:
    """The maps of a surface: sRGB-encoded colour (H, W, 3), roughness (h, w) or one, height (H, W)."""
    rough = roughness if isinstance(roughness, float) else roughness_bytes(roughness)
    normal = normals_from_height(np.asarray(height_m, np.float32), size_m)
    return SurfaceMaps(colour_bytes(colour), rough, normal, size_m, gloss)


def colour_bytes(colour: F32) -> Srgb8Image:
    """(H, W, 3) uint8 of an sRGB-encoded colour 0..1."""
    scaled = np.clip(colour, np.float32(0), np.float32(1))
    scaled *= np.float32(255)
    scaled += np.float32(0.5)
    return scaled.astype(np.uint8)


def ramp(tone: F32, dark: Rgb, light: Rgb) -> F32:
    """(H, W, 3) colours between dark (tone 0) and light (tone 1), not clipped."""
    a, b = np.array(dark, np.float32), np.array(light, np.float32)
    return np.asarray(a + tone[..., None] * (b - a), np.float32)


def normals_from_height(height_m: F32, size_m: tuple[float, float]) -> Srgb8Image:
    """Tangent-space normals of a periodic height field in metres, uint8, at most _RELIEF_PX wide."""
    height_m = _coarse(height_m)
    rows, columns = height_m.shape
    du, dv = size_m[0] / columns, size_m[1] / rows
    slope_u = (np.roll(height_m, -1, 1) - np.roll(height_m, 1, 1)) / np.float32(2 * du)
    # Row numbers grow downwards, v upwards.
    slope_v = (np.roll(height_m, 1, 0) - np.roll(height_m, -1, 0)) / np.float32(2 * dv)
    length = np.sqrt(1.0 + slope_u**2 + slope_v**2)
    normal = np.stack([-slope_u / length, -slope_v / length, 1.0 / length], -1)
    return np.asarray((normal * 0.5 + 0.5) * 255.0 + 0.5, np.uint8)


def roughness_bytes(roughness: F32) -> Srgb8Image:
    """uint8 of a roughness 0..1 (H, W), at most _RELIEF_PX wide."""
    return np.asarray(np.clip(_coarse(roughness), 0.02, 1.0) * 255.0 + 0.5, np.uint8)


def _coarse(field: F32) -> F32:
    while max(field.shape) > _RELIEF_PX and field.shape[0] % 2 == field.shape[1] % 2 == 0:
        field = halved(field)
    return field


def texture_from_pixels(name: str, pixels: Srgb8Image, quality: int) -> Texture:
    """The pixels as a JPEG texture; its id is that of its bytes."""
    data = jpeg_from_array(pixels, quality)
    return Texture(hashlib.sha256(data).hexdigest()[:16], name, "image/jpeg", data)


def encoded(maps: SurfaceMaps, name: str) -> tuple[Texture, Texture | None, Texture | None]:
    """Colour, roughness and normal map as textures; the last two None where there is none."""
    colour = texture_from_pixels(f"{name}.jpg", maps.colour, _COLOUR_QUALITY)
    rough = normal = None
    if not isinstance(maps.roughness, float):
        rough = texture_from_pixels(f"{name}-roughness.jpg", maps.roughness, _MAP_QUALITY)
    if maps.normal is not None:
        normal = texture_from_pixels(f"{name}-normal.jpg", maps.normal, _MAP_QUALITY)
    return colour, rough, normal
