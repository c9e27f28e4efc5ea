"""Development: linear AOVs to the light modes' pictures, denoised and tone-mapped; no effects."""

from __future__ import annotations

import io
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from dataclasses import fields as fields_of
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from scipy import ndimage

from pbrs_farm.core.arrays import F32, F64, RadianceImage, Srgb8Image, UnitVectors
from pbrs_farm.core.frames import LM_PER_W, LUMINANCE
from pbrs_farm.core.lighting import GROUPS_OF_MODE, Group
from pbrs_farm.core.recipe import SensorFields, ToneFields
from pbrs_farm.transport.develop.denoiser import denoise_radiance
from pbrs_farm.transport.develop.tone_mapping import (
    encoded,
    exposure_of,
    rolled_off,
    tone,
    with_glare,
)

# A camera's sensor: from linear light to 8 bits by electrons, a mosaic, noise and JPEG.
# The order is a camera's own: lens (lateral aberration, vignetting), exposure, Bayer mosaic,
# electrons (shot and read noise, saturation, digitising), demosaicing, white balance, tone, JPEG.
# Colours are linear sRGB throughout: the filters of the mosaic are those primaries.


_ABERRATION_WIDTH_PX: Final = 640.0  # of the picture that aberration_px is of
_SATURATION_LX_S: Final = 78.0  # times 1 / ISO: exposure that saturates, ISO 12232:2019


@dataclass(frozen=True, slots=True)
class Exposure:
    """What a camera chose: the shutter and the speed, and the factor they make of radiance."""

    shutter_s: float
    iso: float
    factor: float  # radiance times this is 1 at the tone curve's white

    def facts(self) -> dict[str, Any]:
        """What view.json says."""
        return {"shutter_s": self.shutter_s, "iso": round(self.iso, 1), "exposure": self.factor}


def chosen_exposure(wanted: float, fields: SensorFields) -> Exposure:
    """The exposure nearest to a wanted factor that shutter and ISO allow: the shutter opens first."""
    goal = wanted * 2**fields.compensation_ev
    # What one second at ISO 1 makes of radiance.
    unit = LM_PER_W * math.pi / 4 / fields.f_number**2 / _SATURATION_LX_S * fields.headroom
    product = goal / unit
    if fields.shutter_s > 0:
        shutter = fields.shutter_s
    else:
        longest = max(fields.shutter_max_s, fields.shutter_min_s)
        shutter = min(max(product / fields.iso_min, fields.shutter_min_s), longest)
    iso = min(max(product / shutter, fields.iso_min), max(fields.iso_max, fields.iso_min))
    return Exposure(shutter, iso, shutter * iso * unit)


def lagged_exposure(wanted: Sequence[float], times_s: Sequence[float], lag_s: float) -> float:
    """The factor of the last of some frames when it follows the wanted ones with a delay of lag_s.

    A first-order filter of the logarithm: after lag_s, 63 % of a step is made up.
    """
    level = math.log(wanted[0])
    for k in range(1, len(wanted)):
        share = 1 - math.exp(-(times_s[k] - times_s[k - 1]) / lag_s) if lag_s > 0 else 1.0
        level += share * (math.log(wanted[k]) - level)
    return math.exp(level)


def sensed(
    radiance: RadianceImage,
    gains: F32,
    exposure: Exposure,
    sensor: SensorFields,
    fields: ToneFields,
    *,
    seed: int,
) -> Srgb8Image:
    """(H, W, 3) uint8 sRGB as the sensor takes radiance (H, W, 3); gains (3,): its white balance.

    fields: contrast and black level of its curve, whose white is where the sensor saturates. Equal
    seeds give equal bits.
    """
    rng = np.random.default_rng(seed)
    # Saturation is white in all channels after the gains: scale them to 1 at least.
    scaled = gains.astype(np.float64) / float(gains.min())
    light = through_lens(radiance.astype(np.float64), sensor) * exposure.factor * float(gains.min())
    raw = _electrons_read(mosaic(light) if sensor.mosaic else light, exposure.iso, sensor, rng)
    rgb = demosaiced(raw) if sensor.mosaic else raw
    # Balance white, hold to what saturates, and let that be the curve's end.
    balanced = np.clip(rgb * scaled, 0, sensor.headroom)
    picture = encoded(rolled_off(balanced, sensor.headroom), fields)
    return jpeg_loss(picture, sensor.jpeg_quality) if sensor.jpeg_quality > 0 else picture


def through_lens(light: F64, sensor: SensorFields) -> F64:
    """Radiance with lateral chromatic aberration and vignetting, both by the distance from the middle."""
    height, width = light.shape[:2]
    y, x = np.mgrid[0:height, 0:width] + 0.5
    middle = np.array([height / 2, width / 2])
    corner = float(np.hypot(*middle))
    if sensor.aberration_px > 0:
        # Blue is a little smaller, red a little larger than green; the corners differ by the field's px.
        shift = sensor.aberration_px * width / _ABERRATION_WIDTH_PX / corner / 2
        light = light.copy()
        for channel, scale in ((0, 1 - shift), (2, 1 + shift)):
            at = [(g - m) * scale + m - 0.5 for g, m in zip((y, x), middle, strict=True)]
            light[..., channel] = ndimage.map_coordinates(
                light[..., channel], at, order=1, mode="nearest"
            )
    if sensor.vignetting == 0:
        return light
    squared = ((y - middle[0]) ** 2 + (x - middle[1]) ** 2) / corner**2
    return np.asarray(light * (1 - sensor.vignetting * squared)[..., None])


def mosaic(rgb: F64) -> F64:
    """(H, W) what the pixels of a Bayer mosaic see: rows RGRG and GBGB."""
    raw = rgb[..., 1].copy()
    raw[0::2, 0::2] = rgb[0::2, 0::2, 0]
    raw[1::2, 1::2] = rgb[1::2, 1::2, 2]
    return raw


def demosaiced(raw: F64) -> F64:
    """(H, W, 3) from a mosaic RGGB (H, W), by the linear filters of Malvar, He and Cutler 2004."""
    padded = np.pad(raw, 2, mode="reflect")

    def filtered(kernel: Sequence[Sequence[float]]) -> F64:
        found = ndimage.correlate(padded, np.array(kernel) / 8, mode="nearest")
        return np.asarray(found[2:-2, 2:-2])

    # Green at red and blue; a colour at green between its own along rows, or columns; at the other.
    green = filtered(_GREEN)
    along, down, across = (
        filtered(_ALONG),
        filtered(np.transpose(_ALONG).tolist()),
        filtered(_OTHER),
    )
    rgb = np.stack([raw, raw, raw], axis=-1)
    rgb[0::2, 0::2, 1], rgb[1::2, 1::2, 1] = green[0::2, 0::2], green[1::2, 1::2]
    rgb[0::2, 1::2, 0], rgb[1::2, 0::2, 0] = along[0::2, 1::2], down[1::2, 0::2]
    rgb[1::2, 1::2, 0] = across[1::2, 1::2]
    rgb[1::2, 0::2, 2], rgb[0::2, 1::2, 2] = along[1::2, 0::2], down[0::2, 1::2]
    rgb[0::2, 0::2, 2] = across[0::2, 0::2]
    return rgb


_GREEN: Final = (
    (0, 0, -1, 0, 0), (0, 0, 2, 0, 0), (-1, 2, 4, 2, -1), (0, 0, 2, 0, 0), (0, 0, -1, 0, 0),
)  # fmt: skip
_ALONG: Final = (
    (0, 0, 0.5, 0, 0), (0, -1, 0, -1, 0), (-1, 4, 5, 4, -1), (0, -1, 0, -1, 0), (0, 0, 0.5, 0, 0),
)  # fmt: skip
_OTHER: Final = (
    (0, 0, -1.5, 0, 0), (0, 2, 0, 2, 0), (-1.5, 0, 6, 0, -1.5), (0, 2, 0, 2, 0), (0, 0, -1.5, 0, 0),
)  # fmt: skip


def _electrons_read(light: F64, iso: float, sensor: SensorFields, rng: np.random.Generator) -> F64:
    """Light (1 = the tone's white) as it is read: shot noise, read noise, saturation, whole steps.

    What noise makes of darkness may be negative.
    """
    # The amplifier reaches its end with fewer electrons as ISO rises.
    well = sensor.full_well_e * sensor.iso_min / iso
    electrons = rng.poisson(np.clip(light / sensor.headroom * well, 0, 1e9)).astype(np.float64)
    electrons += rng.normal(0.0, sensor.read_noise_e, light.shape)
    steps = 2**sensor.bits - 1
    # No light stands at the black level, so that noise below it is not cut off: the mean is right.
    black = round(sensor.black_level * steps) / steps
    read = np.rint(np.clip(black + electrons / well * (1 - black), 0, 1) * steps) / steps
    return np.asarray((read - black) / (1 - black) * sensor.headroom)


def jpeg_loss(picture: Srgb8Image, quality: int) -> Srgb8Image:
    """The picture as it comes out of JPEG of that quality, 1..100."""
    buffer = io.BytesIO()
    Image.fromarray(picture).save(buffer, "JPEG", quality=quality)
    back: NDArray[np.uint8] = np.array(Image.open(buffer))
    return back


# Development.


# Of a light group: of all, or of R, G and B.
Factor = float | tuple[float, float, float]

_SATURATED: Final = 0.35  # (max - min) / max of an albedo from which it is a colour
_SAME_HUE_COS: Final = 0.9  # of the angle between two chroma vectors
_WRAPPED_PX: Final = 64  # beyond a panorama's edges, more than a denoiser looks
_FILLED: Final = 0.5  # share of pixels from which one colour fills a view
# Of a light, in natural logarithms of linear sRGB: green over the mean of red and blue, and red
# over blue. Black bodies from 2,300 K on and clear skies lie within.
_TINT: Final = (-0.1, 0.35)
_WARMTH: Final = (-0.7, 1.6)


@dataclass(frozen=True, slots=True, eq=False)
class LinearAovs:
    """The linear AOVs (arbitrary output variables) of radiance.exr, (H, W, 3) each."""

    outdoor: RadianceImage  # raw radiance of each light group, W m-2 sr-1
    indoor: RadianceImage
    albedo: RadianceImage  # 0..1; it and normal are free of noise: the denoiser's guides
    normal: UnitVectors  # unit, or 0 where nothing is hit


@dataclass(frozen=True, slots=True, eq=False)
class ToneMappedImage:
    """A tone-mapped image: rgb_srgb8 = tone(radiance * gains * exposure)."""

    rgb_srgb8: Srgb8Image
    gains: F32  # (3,) factors of the white balance
    exposure: float  # factor before the tone curve
    taken: Exposure | None = None  # by a sensor

    def facts(self) -> dict[str, Any]:
        """What view.json says of the image."""
        facts = {"gains": [round(float(g), 6) for g in self.gains], "exposure": self.exposure}
        return facts | (self.taken.facts() if self.taken else {})


@dataclass(frozen=True, slots=True)
class SensorShot:
    """A sensor, its noise's seed, and the exposures that it followed until now."""

    fields: SensorFields
    seed: int
    before: tuple[
        Mapping[str, float], ...
    ] = ()  # mode -> wanted factor, of earlier frames in order
    times_s: tuple[float, ...] = ()  # of those frames; this one's is 0

    def exposure(self, mode: str, wanted: float) -> Exposure:
        """What it takes a mode's picture with, whose own wanted factor is given."""
        path = [frame[mode] for frame in self.before]
        lagged = lagged_exposure([*path, wanted], [*self.times_s, 0.0], self.fields.lag_s)
        return chosen_exposure(lagged, self.fields)


def develop(
    aovs: LinearAovs,
    fields: ToneFields,
    *,
    denoise: bool,
    indoor: Factor = 1.0,
    outdoor: Factor = 1.0,
    shot: SensorShot | None = None,
    wraps: bool = False,
) -> dict[str, ToneMappedImage]:
    """Mode name -> image of every mode that is a sum of light groups.

    Each group is denoised by itself, so that the modes stay sums. indoor, outdoor: factors of
    all, or of R, G and B; they scale what is denoised, so that every picture is linear in them.
    shot: the sensor that takes the pictures, None for a perfect one. wraps: see denoised.
    """
    clean = denoised(aovs, wraps=wraps) if denoise else aovs
    groups = {
        Group.OUTDOOR: clean.outdoor * np.asarray(outdoor, np.float32),
        Group.INDOOR: clean.indoor * np.asarray(indoor, np.float32),
    }
    # Sum the groups of each mode, balance white, expose, and apply the tone curve.
    images = {}
    for mode, names in GROUPS_OF_MODE.items():
        if names:
            total = sum((groups[name] for name in names), np.zeros_like(aovs.outdoor))
            total = with_glare(total, fields.glare)
            gains = white_balance(total, aovs.albedo, fields.white_balance)
            exposure = exposure_of(total * gains, fields)
            if shot is not None:
                taken = shot.exposure(mode.value, exposure)
                rgb = sensed(total, gains, taken, shot.fields, fields, seed=shot.seed)
                images[mode.value] = ToneMappedImage(rgb, gains, taken.factor, taken)
                continue
            rgb = tone(total * gains, fields, exposure=exposure)
            images[mode.value] = ToneMappedImage(rgb, gains, exposure)
    return images


def wanted_exposures(
    aovs: LinearAovs, fields: ToneFields, *, denoise: bool, wraps: bool = False
) -> dict[str, float]:
    """Mode -> the factor that a picture of these would be exposed by.

    denoise, wraps: as of the picture; noise lowers the mean of logarithms, and so brightens.
    """
    images = develop(aovs, fields, denoise=denoise, wraps=wraps)
    return {mode: image.exposure for mode, image in images.items()}


def denoised(aovs: LinearAovs, *, wraps: bool = False) -> LinearAovs:
    """The same view with each light group denoised by itself; what hits nothing stays black.

    wraps: the left edge adjoins the right one, as in a panorama, and must show no seam.
    """
    if wraps:
        # Let the denoiser see beyond both edges what lies there.
        n = min(_WRAPPED_PX, aovs.outdoor.shape[1])
        wide = {
            f.name: np.pad(getattr(aovs, f.name), ((0, 0), (n, n), (0, 0)), mode="wrap")
            for f in fields_of(LinearAovs)
        }
        clean = denoised(LinearAovs(**wide))
        return replace(aovs, outdoor=clean.outdoor[:, n:-n], indoor=clean.indoor[:, n:-n])
    # The denoiser would smear light over pixels without a surface.
    light = aovs.outdoor + aovs.indoor
    is_hit = ~_all_channels(~((light > 0) | (aovs.albedo > 0)))[..., None]
    outdoor, indoor = (
        denoise_radiance(radiance, aovs.albedo, aovs.normal) * is_hit
        for radiance in (aovs.outdoor, aovs.indoor)
    )
    return replace(aovs, outdoor=outdoor, indoor=indoor)


def white_balance(radiance: RadianceImage, albedo: RadianceImage, strength: float) -> F32:
    """(3,) gains that turn the illuminant's colour towards white, as a camera's do; luminance 1.

    The illuminant is radiance over albedo, which is known here: the median of its logarithm over
    pixels that are neither dark nor overexposed. strength: 0 leaves the colour, 1 makes it
    neutral. Ones when fewer than 16 pixels tell it. Where one colour fills the view, the light that
    its walls reflect at each other has that colour, and no camera would take it for a lamp's: the
    illuminant is then clamped to colours that lamps and skies have.
    """
    # Take pixels between the 10th and the 90th percentile of luminance.
    level = radiance @ LUMINANCE
    usable = (level > 0) & _all_channels(albedo > 0.02) & _all_channels(radiance > 0)
    if strength == 0 or usable.sum() < 16:
        return np.ones(3, np.float32)
    low, high = np.percentile(level[usable], [10, 90])
    usable &= (level >= low) & (level <= high)
    # Scale against the illuminant, at constant luminance.
    reflecting = albedo[usable]
    light = np.exp(_medians(np.log(radiance[usable] / reflecting)))
    if _one_colour_fills(reflecting):
        light = _as_a_lamp_or_sky(light)
    gains = (light / (light @ LUMINANCE)) ** -strength
    return np.asarray(gains / (gains @ LUMINANCE), np.float32)


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


def _all_channels(holds: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(H, W) whether all three of (H, W, 3) hold: `np.all` over so short an axis takes four times as long."""
    return holds[..., 0] & holds[..., 1] & holds[..., 2]


def _medians(rows: F32) -> F32:
    """(3,) medians of (N, 3) rows, channel by channel."""
    return np.array([np.median(np.ascontiguousarray(channel)) for channel in rows.T], rows.dtype)


def _as_a_lamp_or_sky(light: F32) -> F32:
    """A light's colour with its tint and warmth clamped to what lamps and skies have."""
    red, green, blue = np.log(light)
    mean = (red + green + blue) / 3
    tint = np.clip(green - (red + blue) / 2, *_TINT)
    warmth = np.clip(red - blue, *_WARMTH)
    others = mean - tint / 3  # mean of red and blue
    logs = [others + warmth / 2, mean + 2 * tint / 3, others - warmth / 2]
    return np.exp(np.array(logs, np.float32))
