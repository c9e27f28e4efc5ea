"""Tone mapping: radiance to 8-bit sRGB, exposed by the log-average; pure numpy, no effects.

`released` is Reinhard's global operator as the published images used it (docs/spec/suncg.md section 5:
key 0.8, burn 0.2); `photo`, the default, rolls highlights off.
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
_SHOULDER: Final = 0.6  # of photo: the curve is straight below
_HALVINGS: Final = 60  # that find a knee to the last bit
_GLARE_WIDTHS: Final = (0.01, 0.04, 0.16)  # of the picture's width, standard deviations


def tone(
    radiance: RadianceImage, fields: ToneFields, *, exposure: float | None = None
) -> Srgb8Image:
    """(H, W, 3) uint8 sRGB of a radiance image.

    exposure: a factor (see `exposure_of`); the image's own when None. A black image stays black.
    Non-finite and negative values count as 0.
    """
    rgb = np.maximum(np.nan_to_num(np.asarray(radiance, np.float64), posinf=0.0), 0.0)
    if fields.preset == "released":
        linear = _reinhard(rgb, fields.key, exposure)
    else:
        factor = exposure_of(radiance, fields) if exposure is None else exposure
        linear = roll_off(rgb * factor, fields.white)
    return encode_tone(linear, fields)


def encode_tone(linear: F64, fields: ToneFields) -> Srgb8Image:
    """(H, W, 3) uint8 sRGB of linear light; `photo` with its contrast and black level.

    Both act on the encoded luma, as a camera's own curve does: the contrast is an S through the
    middle of the range (its odds to a power), the black level a line. Colours keep their chroma
    where they get lighter, and their saturation where they get darker.
    """
    rgb = np.clip(srgb_from_linear(linear), 0, 1)
    if fields.preset == "photo" and (fields.contrast != 1 or fields.black > 0):
        luma = (rgb @ _LUMA)[..., None]
        light, dark = luma**fields.contrast, (1 - luma).clip(0) ** fields.contrast
        curved = (light / (light + dark) - fields.black) / (1 - fields.black)
        curved = np.maximum(curved, 0)
        ratio = np.divide(curved, luma, out=np.zeros_like(luma), where=luma > 0)
        rgb = np.clip(curved + (rgb - luma) * np.minimum(ratio, 1), 0, 1)
    return np.round(rgb * 255).astype(np.uint8)


def exposure_of(radiance: RadianceImage, fields: ToneFields) -> float:
    """The factor that brings an image's log-average luminance to the key; 1 for a black one.

    For `photo` luminance is clamped to 0.001..1 of its 98th percentile (windows and bulbs are above),
    and the factor is higher by the fields' stops.
    """
    rgb = np.maximum(np.nan_to_num(np.asarray(radiance, np.float64), posinf=0.0), 0.0)
    if fields.preset == "released":
        luminance = rgb @ _MITSUBA_LUMINANCE
        return fields.key / float(np.exp(np.mean(np.log(luminance + _LOG_FLOOR))))
    luminance = rgb @ LUMINANCE
    if luminance.max() <= 0:
        return 1.0
    luminance = luminance[luminance > 0]  # leave out pixels that hit nothing
    bright = float(np.percentile(luminance, 98))
    clipped = np.clip(luminance, bright / 1000, bright)
    return 2**fields.exposure_ev * fields.key / float(np.exp(np.mean(np.log(clipped))))


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
    """The curve of `photo`: straight up to the shoulder, then a logarithm that reaches 1 at white.

    It maps the largest component and keeps the hue; colours far beyond white fade to white.
    """
    # Leave what lies on the straight part as it is: most of a picture.
    top = np.maximum(np.maximum(rgb[..., 0], rgb[..., 1]), rgb[..., 2])
    is_soft = top > _SHOULDER
    out = np.array(rgb)
    out[is_soft] = _shoulder(rgb[is_soft], top[is_soft][:, None], knee_of(white))
    return out


def _shoulder(rgb: F64, top: F64, knee: float) -> F64:
    """The curve of `photo` above the straight part: of (N, 3) colours, top (N, 1) their largest."""
    # Its slope at the shoulder is 1, so that it goes on without a bend.
    target = np.minimum(_SHOULDER + knee * np.log1p((top - _SHOULDER) / knee), 1.0)
    # Scale all three components alike; fade to white over five stops, from twice white on.
    fade = np.clip(np.log2(top / 2) / 5, 0, 1)
    return np.asarray(rgb * (target / top) * (1 - fade) + target * fade)


@functools.cache
def knee_of(white: float) -> float:
    """The k for which _SHOULDER + k log(1 + (white - _SHOULDER) / k) is 1.

    white: the value that becomes 1, more than _SHOULDER. Found by halving between 1e-4 and 1e4, so
    a white so near to 1 that no curve bends gives an end of that range.
    """
    low, high = 1e-4, 1e4
    for _ in range(_HALVINGS):
        k = (low * high) ** 0.5
        is_short = _SHOULDER + k * math.log1p((white - _SHOULDER) / k) < 1
        low, high = (k, high) if is_short else (low, k)
    return low


def add_glare(radiance: RadianceImage, share: float) -> RadianceImage:
    """Radiance (H, W, 3) with a share of each pixel's light spread wide about it, as in lens and eye.

    A third each by Gaussians of 1, 4 and 16 % of the picture's width; light is neither lost nor
    made but at the edges, beyond which the picture goes on as its border.
    """
    if share <= 0:
        return radiance
    light = np.nan_to_num(np.asarray(radiance, np.float32), posinf=0.0)
    width = radiance.shape[1]
    spread = sum(
        ndimage.gaussian_filter(light, (part * width, part * width, 0), mode="nearest", truncate=3)
        for part in _GLARE_WIDTHS
    ) / np.float32(len(_GLARE_WIDTHS))
    return np.asarray(light * np.float32(1 - share) + spread * np.float32(share), np.float32)
