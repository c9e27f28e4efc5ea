"""White balance: gains that turn the light's colour in a picture towards white; no effects."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F32, RadianceImage
from pbrs_farm.core.frames import LUMINANCE
from pbrs_farm.core.recipe import ToneFields

_LIT_PERCENTILES: Final = (50, 95)  # of irradiance: pixels that tell the light's colour
# Relative: a sky of one level fills half of some views, and differs from itself in the last bits.
_SAME_LEVEL: Final = 1e-5
_SATURATED: Final = 0.35  # (max - min) / max of an albedo from which it is a colour
_SAME_HUE_COS: Final = 0.9  # of the angle between two chroma vectors
_FILLED: Final = 0.5  # share of pixels from which one colour fills a view
# Of a light, in natural logarithms of linear sRGB: green over the mean of red and blue, and red
# over blue. Black bodies from 2,300 K on and clear skies lie within.
_TINT: Final = (-0.1, 0.35)
_WARMTH: Final = (-0.7, 1.6)


def white_balance(radiance: RadianceImage, albedo: RadianceImage, fields: ToneFields) -> F32:
    """(3,) gains that shift the illuminant's colour towards white, as cameras do; luminance 1.

    The illuminant is radiance over albedo, both known: the median of its logarithm over the better lit half
    of the pixels, since shaded pixels have the colour of the walls and floors that reflect light to them;
    correcting that would turn a garden blue. Returns ones, except for the fields' errors, if fewer than 16
    pixels are usable. In a view filled by one colour, interreflections have that colour, which no camera
    would take for a lamp's: the illuminant is then clamped to colours of lamps and skies.

    fields: white_balance, 0 keeps the colour, 1 makes it neutral; warmth_ev and tint_ev are the camera's
    errors.
    """
    light = _illuminant(radiance, albedo) if fields.white_balance > 0 else None
    gains: NDArray[np.floating] = np.ones(3)
    if light is not None:
        gains = (light / (light @ LUMINANCE)) ** -np.float32(fields.white_balance)
    # Red and blue part by the warmth, green and both by the tint.
    errors = fields.warmth_ev / 2 * np.array([1, 0, -1]) + fields.tint_ev * np.array([0, 1, 0])
    gains = gains * np.exp2(errors)
    return np.asarray(gains / (gains @ LUMINANCE), np.float32)


def _illuminant(radiance: RadianceImage, albedo: RadianceImage) -> F32 | None:
    """(3,) the light's colour; None when fewer than 16 pixels tell it."""
    # Go by channel, each in one piece: a third of the time of (N, 3) rows.
    radiances, surface = _channels(radiance), _channels(albedo)
    usable = (_least(surface) > 0.02) & (_least(radiances) > 0)
    if usable.sum() < 16:
        return None
    if not usable.all():
        radiances, surface = [c[usable] for c in radiances], [c[usable] for c in surface]
    # Take the better lit half without the very brightest.
    light = [c / s for c, s in zip(radiances, surface, strict=True)]
    level = sum(c * w for c, w in zip(light, LUMINANCE.astype(np.float32), strict=True))
    low, high = np.percentile(level, _LIT_PERCENTILES)
    is_lit = (level >= low * (1 - _SAME_LEVEL)) & (level <= high * (1 + _SAME_LEVEL))
    lit = np.flatnonzero(is_lit)
    colour = np.exp(np.array([np.median(np.log(c[lit])) for c in light], np.float32))
    is_filled = _one_colour_fills(np.stack([c[lit] for c in surface], -1))
    return _clamp_to_lamps_and_skies(colour) if is_filled else colour


def _channels(image: RadianceImage) -> list[F32]:
    """The three channels of (H, W, 3), (H * W,) each."""
    return [np.ascontiguousarray(image[..., c], np.float32).ravel() for c in range(3)]


def _least(channels: list[F32]) -> F32:
    return np.minimum(np.minimum(channels[0], channels[1]), channels[2])


def _one_colour_fills(albedo: F32) -> bool:
    """Whether most of (N, 3) albedos share one saturated hue."""
    red, green, blue = albedo.T
    top = np.maximum(np.maximum(red, green), blue)
    is_colour = top - np.minimum(np.minimum(red, green), blue) > _SATURATED * top
    if is_colour.mean() <= _FILLED:
        return False
    # Count those whose hue is near the median one.
    coloured = albedo[is_colour]
    chroma = coloured - coloured.mean(1, keepdims=True)
    hue = chroma / np.maximum(np.linalg.norm(chroma, axis=1, keepdims=True), 1e-9)
    common = _medians(hue)
    length = float(np.linalg.norm(common))
    n_common = np.count_nonzero(hue @ common > _SAME_HUE_COS * length) if length > 0 else 0
    return bool(n_common / len(albedo) > _FILLED)


def all_channels(holds: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(H, W) whether all three of (H, W, 3) hold: `np.all` over so short an axis takes four times as long."""
    return holds[..., 0] & holds[..., 1] & holds[..., 2]


def _medians(rows: F32) -> F32:
    """(3,) medians of (N, 3) rows, channel by channel."""
    return np.array([np.median(np.ascontiguousarray(channel)) for channel in rows.T], rows.dtype)


def _clamp_to_lamps_and_skies(light: F32) -> F32:
    """A light's colour with its tint and warmth clamped to what lamps and skies have."""
    red, green, blue = np.log(light)
    mean = (red + green + blue) / 3
    tint = np.clip(green - (red + blue) / 2, *_TINT)
    warmth = np.clip(red - blue, *_WARMTH)
    red_blue = mean - tint / 3  # mean of red and blue
    logs = [red_blue + warmth / 2, mean + 2 * tint / 3, red_blue - warmth / 2]
    return np.exp(np.array(logs, np.float32))
