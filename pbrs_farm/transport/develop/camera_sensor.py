"""A camera's sensor: from linear light to 8 bits by electrons, a mosaic, noise and JPEG; no effects.

The order is a camera's own: lens (lateral aberration, vignetting), exposure, Bayer mosaic,
electrons (shot and read noise, saturation, digitising), demosaicing, white balance, tone, JPEG.
Colours are linear sRGB throughout: the filters of the mosaic are those primaries.
"""

from __future__ import annotations

import io
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from scipy import ndimage

from pbrs_farm.core.arrays import F32, F64, RadianceImage, Srgb8Image
from pbrs_farm.core.frames import LM_PER_W
from pbrs_farm.core.recipe import SensorFields, ToneFields
from pbrs_farm.transport.develop.tone_mapping import add_veil, encode_tone

_ABERRATION_WIDTH_PX: Final = 640.0  # of the picture that aberration_px is of
_SATURATION_LX_S: Final = 78.0  # times 1 / ISO: exposure that saturates, ISO 12232:2019
_GREEN_KERNEL: Final = (
    (0, 0, -1, 0, 0),
    (0, 0, 2, 0, 0),
    (-1, 2, 4, 2, -1),
    (0, 0, 2, 0, 0),
    (0, 0, -1, 0, 0),
)
_ALONG_KERNEL: Final = (
    (0, 0, 0.5, 0, 0),
    (0, -1, 0, -1, 0),
    (-1, 4, 5, 4, -1),
    (0, -1, 0, -1, 0),
    (0, 0, 0.5, 0, 0),
)
_OTHER_KERNEL: Final = (
    (0, 0, -1.5, 0, 0),
    (0, 2, 0, 2, 0),
    (-1.5, 0, 6, 0, -1.5),
    (0, 2, 0, 2, 0),
    (0, 0, -1.5, 0, 0),
)


@dataclass(frozen=True, slots=True)
class Exposure:
    """Exposure settings of a camera: shutter time, ISO speed, and the resulting factor on radiance."""

    shutter_s: float
    iso: float
    factor: float  # radiance times this is 1 at the tone curve's white

    def facts(self) -> dict[str, Any]:
        """Entries for view.json."""
        return {"shutter_s": self.shutter_s, "iso": round(self.iso, 1), "exposure": self.factor}


def choose_exposure(target: float, fields: SensorFields) -> Exposure:
    """The exposure nearest to target (radiance to the picture's scale): the shutter opens first, then ISO rises."""
    goal = target * 2**fields.compensation_ev
    # Factor on radiance of one second at ISO 1.
    unit = LM_PER_W * math.pi / 4 / fields.f_number**2 / _SATURATION_LX_S * fields.headroom
    product = goal / unit
    if fields.shutter_s > 0:
        shutter = fields.shutter_s
    else:
        longest = max(fields.shutter_max_s, fields.shutter_min_s)
        shutter = min(max(product / fields.iso_min, fields.shutter_min_s), longest)
    iso = min(max(product / shutter, fields.iso_min), max(fields.iso_max, fields.iso_min))
    return Exposure(shutter, iso, shutter * iso * unit)


def lag_exposure(targets: Sequence[float], times_s: Sequence[float], lag_s: float) -> float:
    """The factor of the last frame when it follows the wanted ones by a first-order filter of lag_s."""
    level = math.log(targets[0])
    for k in range(1, len(targets)):
        share = 1 - math.exp(-(times_s[k] - times_s[k - 1]) / lag_s) if lag_s > 0 else 1.0
        level += share * (math.log(targets[k]) - level)
    return math.exp(level)


@dataclass(frozen=True, slots=True)
class SensorShot:
    """A sensor, its noise's seed, and the exposures that it followed until now."""

    fields: SensorFields
    seed: int
    before: tuple[
        Mapping[str, float], ...
    ] = ()  # mode -> wanted factor, of earlier frames in order
    times_s: tuple[float, ...] = ()  # of those frames; this one's is 0

    def exposure(self, mode: str, target: float) -> Exposure:
        """Exposure of a mode from its own target, pulled along by previous frames; KeyError if they lack the mode."""
        path = [frame[mode] for frame in self.before]
        lagged = lag_exposure([*path, target], [*self.times_s, 0.0], self.fields.lag_s)
        return choose_exposure(lagged, self.fields)


def take_by_sensor(
    radiance: RadianceImage,
    gains: F32,
    exposure: Exposure,
    sensor: SensorFields,
    fields: ToneFields,
    *,
    seed: int,
) -> Srgb8Image:
    """(H, W, 3) uint8 sRGB as the sensor takes radiance (H, W, 3); gains (3,): its white balance."""
    rng = np.random.default_rng(seed)
    # Saturation is white in all channels after the gains: scale them to 1 at least.
    scaled = gains.astype(np.float64) / float(gains.min())
    # Veiling glare is from the lens, so it precedes noise and saturation.
    light = apply_lens(add_veil(radiance.astype(np.float64) * exposure.factor, fields), sensor)
    light = light * float(gains.min())
    raw = electrons_read(mosaic(light) if sensor.mosaic else light, exposure.iso, sensor, rng)
    rgb = demosaic(raw) if sensor.mosaic else raw
    # Balance white, hold to what saturates, and let that be the curve's end.
    balanced = np.clip(rgb * scaled, 0, sensor.headroom)
    picture = encode_tone(balanced, fields, sensor.headroom)
    return compress_as_jpeg(picture, sensor.jpeg_quality) if sensor.jpeg_quality > 0 else picture


def apply_lens(light: F64, sensor: SensorFields) -> F64:
    """Radiance with lateral chromatic aberration and vignetting, both by the distance from the middle.

    light: (H, W, 3) linear radiance. Red and blue are sampled anew, linearly, at larger and smaller
    radii; green stays. The same array comes back where both effects are 0; the input is never
    written to.
    """
    height, width = light.shape[:2]
    y, x = np.mgrid[0:height, 0:width] + 0.5
    middle = np.array([height / 2, width / 2])
    corner = float(np.hypot(*middle))
    if sensor.aberration_px > 0:
        # Blue is a little smaller, red a little larger than green; the corners differ by the field's px.
        shift = sensor.aberration_px * width / _ABERRATION_WIDTH_PX / corner / 2
        light = light.copy()
        for channel, scale in ((0, 1 - shift), (2, 1 + shift)):
            positions = [(g - m) * scale + m - 0.5 for g, m in zip((y, x), middle, strict=True)]
            light[..., channel] = ndimage.map_coordinates(
                light[..., channel], positions, order=1, mode="nearest"
            )
    if sensor.vignetting == 0:
        return light
    squared = ((y - middle[0]) ** 2 + (x - middle[1]) ** 2) / corner**2
    return np.asarray(light * (1 - sensor.vignetting * squared)[..., None])


def mosaic(rgb: F64) -> F64:
    """(H, W) values of a Bayer mosaic, rows RGRG and GBGB, of rgb (H, W, 3) linear; see `demosaic`."""
    raw = rgb[..., 1].copy()
    raw[0::2, 0::2] = rgb[0::2, 0::2, 0]
    raw[1::2, 1::2] = rgb[1::2, 1::2, 2]
    return raw


def demosaic(raw: F64) -> F64:
    """(H, W, 3) from a mosaic RGGB (H, W), by the linear filters of Malvar, He and Cutler 2004.

    raw: linear, the first pixel red, at least 3 x 3. Filters overshoot at edges, so values below 0
    and above the mosaic's own occur: clip afterwards. The picture is mirrored at its border.
    """
    padded = np.pad(raw, 2, mode="reflect")

    def filtered(kernel: Sequence[Sequence[float]]) -> F64:
        values = ndimage.correlate(padded, np.array(kernel) / 8, mode="nearest")
        return np.asarray(values[2:-2, 2:-2])

    # Green at red and blue; a colour at green between its own along rows, or columns; at the other.
    green = filtered(_GREEN_KERNEL)
    along, down, across = (
        filtered(_ALONG_KERNEL),
        filtered(np.transpose(_ALONG_KERNEL).tolist()),
        filtered(_OTHER_KERNEL),
    )
    rgb = np.stack([raw, raw, raw], axis=-1)
    rgb[0::2, 0::2, 1], rgb[1::2, 1::2, 1] = green[0::2, 0::2], green[1::2, 1::2]
    rgb[0::2, 1::2, 0], rgb[1::2, 0::2, 0] = along[0::2, 1::2], down[1::2, 0::2]
    rgb[1::2, 1::2, 0] = across[1::2, 1::2]
    rgb[1::2, 0::2, 2], rgb[0::2, 1::2, 2] = along[1::2, 0::2], down[0::2, 1::2]
    rgb[0::2, 0::2, 2] = across[0::2, 0::2]
    return rgb


def electrons_read(light: F64, iso: float, sensor: SensorFields, rng: np.random.Generator) -> F64:
    """Sensor values of light (1 = the tone's white): shot noise, read noise, saturation, steps; may be below 0."""
    # The amplifier reaches its end with fewer electrons as ISO rises.
    well = sensor.full_well_e * sensor.iso_min / iso
    electrons = rng.poisson(np.clip(light / sensor.headroom * well, 0, 1e9)).astype(np.float64)
    electrons += rng.normal(0.0, sensor.read_noise_e, light.shape)
    steps = 2**sensor.bits - 1
    # Zero light is at the black level, so that noise below it is not clipped and the mean is right.
    black = round(sensor.black_level * steps) / steps
    read = np.rint(np.clip(black + electrons / well * (1 - black), 0, 1) * steps) / steps
    return np.asarray((read - black) / (1 - black) * sensor.headroom)


def compress_as_jpeg(picture: Srgb8Image, quality: int) -> Srgb8Image:
    """The picture after JPEG of a quality 1..100; its bits depend on the version of libjpeg."""
    buffer = io.BytesIO()
    Image.fromarray(picture).save(buffer, "JPEG", quality=quality)
    back: NDArray[np.uint8] = np.array(Image.open(buffer))
    return back
