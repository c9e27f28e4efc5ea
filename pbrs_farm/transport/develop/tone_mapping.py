"""Tone mapping: radiance to 8-bit sRGB, exposed by the log-average; pure numpy, no effects.

`released` is Reinhard's global operator as the published images used it (docs/spec/suncg.md section 5:
key 0.8, burn 0.2); `photo`, the default, is a camera's response: a veil of stray light, a straight
part with a shoulder, an S of contrast, and sharpening.
"""

from __future__ import annotations

import functools
import math
from typing import Final

import numpy as np
from scipy import ndimage

from pbrs_farm.core.arrays import F64, RadianceImage, Srgb8Image
from pbrs_farm.core.frames import LUMINANCE, srgb_from_linear
from pbrs_farm.core.recipe import ToneFields

_MITSUBA_LUMINANCE: Final = np.array([0.212671, 0.715160, 0.072169])  # of Mitsuba's tone mapper
_LUMA: Final = np.array([0.299, 0.587, 0.114])  # of encoded colours, ITU-R BT.601
_BURN: Final = 0.2  # of Reinhard's operator: how far highlights may burn out
_LOG_FLOOR: Final = 1e-3  # added before the logarithm, as Mitsuba's tone mapper does
_METERED: Final = (
    1 / 32,
    4.0,
)  # of the median luminance; pixels outside this range are clamped to it
_SHOULDER: Final = 0.6  # of photo: the curve is straight below
_LEAST_STOPS: Final = 1e-3  # from 1 to a white of 1
_HALVINGS: Final = 60  # that find a knee to the last bit
_GLARE_WIDTHS: Final = (0.01, 0.04, 0.16)  # of the picture's width, standard deviations
_LOCAL_RADIUS: Final = 1 / 24  # of the picture's width, of the guided filter of local_contrast
_LOCAL_EDGE: Final = 0.5  # stops: larger steps of light keep their edge in it
_LOCAL_FLOOR: Final = 2.0**-10  # luminance below which it sees no detail
_SHARPENED_PX: Final = 0.8  # standard deviation of the blur that sharpening compares with


def tone(
    radiance: RadianceImage, fields: ToneFields, *, exposure: float | None = None
) -> Srgb8Image:
    """(H, W, 3) uint8 sRGB of a radiance image; exposure: a factor, None = `exposure_of` the image."""
    rgb = _finite_light(radiance)
    if fields.preset == "released":
        return _eight_bits(srgb_from_linear(_reinhard(rgb, fields.key, exposure)))
    factor = exposure_of(radiance, fields) if exposure is None else exposure
    return encode_tone(add_veil(rgb * factor, fields), fields, fields.white)


def _finite_light(radiance: RadianceImage) -> F64:
    """Radiance as float64; negative and non-finite values become 0."""
    rgb = np.asarray(radiance, np.float64)
    # Nothing is to be done to nearly every picture: two sums tell.
    if rgb.min(initial=0.0) >= 0 and np.isfinite(rgb.sum()):
        return rgb
    return np.maximum(np.nan_to_num(rgb, posinf=0.0), 0.0)


def encode_tone(light: F64, fields: ToneFields, white: float) -> Srgb8Image:
    """(H, W, 3) uint8 sRGB of exposed light by the response of `photo`; white becomes 255.

    Contrast acts on the encoded luma, as a camera's own curve does: an S through the middle of the
    range (its odds to a power). Colours keep their chroma where they get lighter, and their
    saturation where they get darker.
    """
    linear = roll_off(flatten_light(light, fields), white)
    rgb = np.clip(srgb_from_linear(linear), 0, 1)
    luma = (rgb @ _LUMA)[..., None]
    if fields.contrast != 1:
        bright, dark = luma**fields.contrast, (1 - luma).clip(0) ** fields.contrast
        curved = bright / (bright + dark)
        ratio = np.divide(curved, luma, out=np.zeros_like(luma), where=luma > 0)
        rgb -= luma
        rgb *= np.minimum(ratio, 1)
        rgb += curved
        luma = curved
    if fields.sharpening > 0:
        blurred = ndimage.gaussian_filter(luma[..., 0], _SHARPENED_PX, mode="nearest")
        rgb = rgb + fields.sharpening * (luma - blurred[..., None])
    return _eight_bits(rgb)


def _eight_bits(rgb: F64) -> Srgb8Image:
    steps = np.clip(rgb, 0, 1)
    steps *= 255
    return np.round(steps, out=steps).astype(np.uint8)


def exposure_of(radiance: RadianceImage, fields: ToneFields) -> float:
    """The factor that brings an image's log-average luminance to the key; 1 for a black one.

    `photo` meters the room and not its windows and lamps: luminance counts as 1/32 to 4 times the
    median. The factor is higher by the fields' stops.
    """
    rgb = _finite_light(radiance)
    if fields.preset == "released":
        luminance = rgb @ _MITSUBA_LUMINANCE
        return fields.key / float(np.exp(np.mean(np.log(luminance + _LOG_FLOOR))))
    luminance = rgb @ LUMINANCE
    luminance = luminance[luminance > 0]  # leave out pixels that hit nothing
    if not luminance.size:
        return 1.0
    low, high = (share * float(np.median(luminance)) for share in _METERED)
    average = float(np.exp(np.mean(np.log(np.clip(luminance, low, high)))))
    return 2**fields.exposure_ev * fields.key / average


def add_veil(light: F64, fields: ToneFields) -> F64:
    """Add veiling glare: the share of the mean of light (H, W, 3), clipped at the white, that a lens scatters."""
    if fields.flare == 0:
        return light
    return np.asarray(light + fields.flare * np.minimum(light, fields.white).mean(axis=(0, 1)))


def flatten_light(light: F64, fields: ToneFields) -> F64:
    """Exposed light (H, W, 3) with less contrast between regions, by a guided filter (He, Sun, Tang 2013)."""
    if fields.local_contrast == 0:
        return light
    stops = np.log2(np.maximum(light @ LUMINANCE, _LOCAL_FLOOR))
    large = _guided_filter(stops, round(light.shape[1] * _LOCAL_RADIUS))
    gain = 2 ** (fields.local_contrast * (math.log2(fields.key) - large))
    return np.asarray(light * gain[..., None])


def _guided_filter(values: F64, radius: int) -> F64:
    """(H, W) values smoothed within a square where they vary by less than _LOCAL_EDGE, guided by themselves."""

    def mean(of: F64) -> F64:
        return np.asarray(ndimage.uniform_filter(of, 2 * radius + 1, mode="nearest"))

    middle = mean(values)
    variance = np.maximum(mean(values * values) - middle * middle, 0)
    slope = variance / (variance + _LOCAL_EDGE**2)
    return np.asarray(mean(slope) * values + mean(middle * (1 - slope)))


def _reinhard(rgb: F64, key: float, exposure: float | None) -> F64:
    # Scale the log-average to the key and find the luminance that becomes white.
    luminance = rgb @ _MITSUBA_LUMINANCE
    average = float(np.exp(np.mean(np.log(luminance + _LOG_FLOOR))))
    scaled = luminance * (key / average if exposure is None else exposure)
    white = float(scaled.max()) * (1 - _BURN) ** 2
    if white <= 0:
        return rgb
    # Compress luminance and scale all three components alike.
    mapped = scaled * (1 + scaled / white**2) / (1 + scaled)
    ratio = np.divide(mapped, luminance, out=np.zeros_like(mapped), where=luminance > 0)
    return np.asarray(rgb * ratio[..., None])


def roll_off(rgb: F64, white: float) -> F64:
    """The curve of `photo`: straight up to the shoulder, then a logarithm to 1 at white; keeps the hue up to 1."""
    # Skip pixels on the linear part of the curve, which are most of a picture.
    top = np.maximum(np.maximum(rgb[..., 0], rgb[..., 1]), rgb[..., 2])
    is_soft = top > _SHOULDER
    out = np.array(rgb)
    out[is_soft] = _shoulder(rgb[is_soft], top[is_soft][:, None], white)
    return out


def _shoulder(rgb: F64, top: F64, white: float) -> F64:
    """The curve of `photo` above the straight part: of (N, 3) colours, top (N, 1) their largest."""
    # Its slope at the shoulder is 1, so that it goes on without a bend.
    knee = knee_of(white)
    target = np.minimum(_SHOULDER + knee * np.log1p((top - _SHOULDER) / knee), 1.0)
    # Scale all three components alike; pale by stops of luminance: a bright red stays red.
    level = np.maximum(rgb @ LUMINANCE, 1)[:, None]
    pale = np.clip(np.log2(level) / max(math.log2(white), _LEAST_STOPS), 0, 1)
    return np.asarray(rgb * (target / top) * (1 - pale) + target * pale)


@functools.cache
def knee_of(white: float) -> float:
    """The k for which _SHOULDER + k log(1 + (white - _SHOULDER) / k) is 1, by bisection in 1e-4..1e4."""
    low, high = 1e-4, 1e4
    for _ in range(_HALVINGS):
        k = (low * high) ** 0.5
        is_short = _SHOULDER + k * math.log1p((white - _SHOULDER) / k) < 1
        low, high = (k, high) if is_short else (low, k)
    return low


def add_glare(radiance: RadianceImage, share: float) -> RadianceImage:
    """Radiance with a share of each pixel's light spread by Gaussians of 1, 4 and 16 % of the picture's width."""
    if share <= 0:
        return radiance
    light = np.nan_to_num(np.asarray(radiance, np.float32), posinf=0.0)
    width = radiance.shape[1]
    spread = sum(
        ndimage.gaussian_filter(light, (part * width, part * width, 0), mode="nearest", truncate=3)
        for part in _GLARE_WIDTHS
    ) / np.float32(len(_GLARE_WIDTHS))
    return np.asarray(light * np.float32(1 - share) + spread * np.float32(share), np.float32)
