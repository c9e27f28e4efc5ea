"""From light to a picture by the formulas of docs/light.md, without the stages' code; no effects."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from pbrs_farm.check.colours import LM_PER_W, LUMINANCE, srgb_from_linear
from pbrs_farm.core.arrays import F32, F64
from pbrs_farm.core.picture_cameras import PictureCamera
from pbrs_farm.core.recipe import SensorFields, ToneFields

TILE_PX = 16
_MITSUBA_LUMINANCE = np.array([0.212671, 0.715160, 0.072169])
SAME_LEVEL = 1e-5  # relative: levels nearer to each other are one


def tile_means(picture: NDArray[Any]) -> F64:
    """(R, C, K) means of the whole tiles of (H, W, K); a smaller picture has one tile across or down."""
    rows, columns = (min(TILE_PX, n) for n in picture.shape[:2])
    n_rows, n_columns = picture.shape[0] // rows, picture.shape[1] // columns
    cut = picture[: n_rows * rows, : n_columns * columns].astype(float)
    return np.asarray(cut.reshape(n_rows, rows, n_columns, columns, -1).mean(axis=(1, 3)))


def halved(picture: NDArray[Any]) -> F32:
    """(H / 2, W / 2, 3) means of 2 x 2 pixels; an odd row or column is left out."""
    height, width = (n // 2 * 2 for n in picture.shape[:2])
    parts = picture[:height, :width].astype(np.float32).reshape(height // 2, 2, width // 2, 2, 3)
    return np.ascontiguousarray(parts.mean(axis=(1, 3)))


def finite_light(light: NDArray[Any]) -> F64:
    """Light without infinities, NaN and negative values."""
    return np.maximum(np.nan_to_num(light.astype(np.float64), posinf=0.0), 0)


def add_glare(total: F32, share: float) -> F32:
    """Light of which a share is blurred by three Gaussians."""
    if share == 0:
        return total
    finite = np.nan_to_num(total, posinf=0.0)
    blurred = np.zeros_like(finite)
    for part in (0.01, 0.04, 0.16):
        wide, sigma = finite, part * total.shape[1]
        for axis in (0, 1):
            wide = ndimage.gaussian_filter1d(wide, sigma, axis, mode="nearest", truncate=3)
        blurred += wide / 3
    return np.asarray((1 - share) * finite + share * blurred, np.float32)


def white_balance(
    total: NDArray[Any], albedo: NDArray[Any], tone: ToneFields, *, margin: float = SAME_LEVEL
) -> F64:
    """(3,) gains of constant luminance against the median of radiance over albedo where it is high.

    margin: relative, by which a pixel's level may be outside of the range that counts.
    """
    errors = 2.0 ** np.array([tone.warmth_ev / 2, tone.tint_ev, -tone.warmth_ev / 2])
    light = np.ones(3)
    is_lit = (albedo > 0.02).all(axis=-1) & (total > 0).all(axis=-1)
    if tone.white_balance > 0 and is_lit.sum() >= 16:
        light = _light_colour(total[is_lit], albedo[is_lit].astype(np.float64), margin)
    gains = (light / (light @ LUMINANCE)) ** -tone.white_balance * errors
    return np.asarray((gains / (gains @ LUMINANCE)).astype(np.float32))


def _light_colour(total: NDArray[Any], surface: F64, margin: float) -> F64:
    """(3,) median of (N, 3) radiance over albedo between the middle and the 95th percentile."""
    level = (total / surface) @ LUMINANCE
    low, high = np.percentile(level, [50, 95])
    lit = (level >= low * (1 - margin)) & (level <= high * (1 + margin))
    total, surface = total[lit], surface[lit]
    logs = np.median(np.log(total / surface), axis=0)
    # Walls of one hue colour the light between them: clip it to the range of lamps and skies.
    largest, smallest = surface.max(axis=1), surface.min(axis=1)
    is_colour = largest - smallest > 0.35 * largest
    if is_colour.mean() > 0.5:
        chroma = surface[is_colour] - surface[is_colour].mean(axis=1, keepdims=True)
        hue = chroma / np.maximum(np.linalg.norm(chroma, axis=1, keepdims=True), 1e-9)
        common = np.median(hue, axis=0)
        length = float(np.linalg.norm(common))
        alike = int((hue @ common > 0.9 * length).sum()) if length > 0 else 0
        if alike / len(surface) > 0.5:
            tint = np.clip(logs[1] - (logs[0] + logs[2]) / 2, -0.1, 0.35)
            warmth = np.clip(logs[0] - logs[2], -0.7, 1.6)
            side = logs.mean() - tint / 3
            logs = np.array([side + warmth / 2, logs.mean() + 2 * tint / 3, side - warmth / 2])
    return np.asarray(np.exp(logs))


def exposure_of(balanced: F64, tone: ToneFields) -> float:
    """Factor from the log-average to the key; `photo` clips levels to 1/32 to 4 times the median."""
    if tone.preset == "released":
        level = balanced @ _MITSUBA_LUMINANCE
        return tone.key / float(np.exp(np.log(level + 1e-3).mean()))
    level = balanced @ LUMINANCE
    level = level[level > 0]
    if not level.size:
        return 1.0
    middle = float(np.median(level))
    average = float(np.exp(np.log(np.clip(level, middle / 32, middle * 4)).mean()))
    return float(tone.key / average * 2**tone.exposure_ev)


def sensor_unit(sensor: SensorFields) -> float:
    """Exposure factor of a second at ISO 1, by ISO 12232's saturation (docs/lenses.md)."""
    return LM_PER_W * np.pi / 4 / sensor.f_number**2 / 78 * sensor.headroom


def toned(
    balanced: F64, exposure: float, camera: PictureCamera, gains: NDArray[Any], iso: float
) -> NDArray[np.uint8]:
    """8 bits by Reinhard's operator (`released`), else by a line and a logarithm that ends at white.

    balanced: light times gains (3,); a sensor at that ISO reads the light without gains.
    """
    tone, sensor = camera.tone, camera.sensor
    is_released = tone.preset == "released" and not sensor.is_on
    if is_released:
        level = balanced @ _MITSUBA_LUMINANCE * exposure
        white = float(level.max()) * 0.64
        linear = balanced
        if white > 0:
            ratio = (1 + level / white**2) / (1 + level) * exposure
            linear = balanced * ratio[..., None]
    else:
        light, white = balanced * exposure, tone.white
        light = light + tone.flare * np.minimum(light, tone.white).mean(axis=(0, 1))
        if sensor.is_on:
            white = sensor.headroom
            light = _read(light * _vignette(light, sensor), gains / gains.min(), iso, sensor)
        linear = _roll_off(_flattened(light, tone), white)
    srgb = srgb_from_linear(np.clip(linear, 0, 1))
    response = srgb if is_released else _respond(srgb, tone)
    return np.asarray(np.rint(255 * np.clip(response, 0, 1)), np.uint8)


def _read(light: F64, gains: NDArray[Any], iso: float, sensor: SensorFields) -> F64:
    """Light (H, W, 3) with a sensor's noise drawn anew, which brightens darkness in the mean."""
    rng = np.random.default_rng(0)
    well = sensor.full_well_e * sensor.iso_min / max(iso, sensor.iso_min)
    electrons = rng.poisson(np.clip(light / gains / sensor.headroom * well, 0, 1e9)).astype(float)
    electrons += rng.normal(0, sensor.read_noise_e, light.shape)
    lowest = -sensor.black_level / (1 - sensor.black_level)
    raw = np.clip(electrons / well, lowest, 1) * sensor.headroom
    return np.asarray(np.clip(raw * gains, 0, sensor.headroom))


def _respond(srgb: F64, tone: ToneFields) -> F64:
    """Luma by an S-curve whose odds are raised to a power, then sharpened by its difference to a blurred one."""
    luma = srgb @ [0.299, 0.587, 0.114]
    with np.errstate(divide="ignore"):
        s_shaped = 1 / (1 + (np.maximum(1 / luma - 1, 0)) ** tone.contrast)
    chroma = np.minimum(np.divide(s_shaped, luma, out=np.zeros_like(luma), where=luma > 0), 1)
    picture = s_shaped[..., None] + (srgb - luma[..., None]) * chroma[..., None]
    if tone.sharpening == 0:
        return np.asarray(picture)
    soft = s_shaped
    for axis in (0, 1):
        soft = ndimage.gaussian_filter1d(soft, 0.8, axis, mode="nearest")
    return np.asarray(picture + tone.sharpening * (s_shaped - soft)[..., None])


def _flattened(light: F64, tone: ToneFields) -> F64:
    """Light with large differences in stops reduced by local_contrast: He's self-guided filter."""
    if tone.local_contrast == 0:
        return light
    stops = np.log2(np.maximum(light @ LUMINANCE, 2.0**-10))
    r = round(light.shape[1] / 24)
    first, second = _box_means(stops, r), _box_means(stops**2, r)
    variance = np.maximum(second - first**2, 0)
    a = variance / (variance + 0.25)
    large = _box_means(a, r) * stops + _box_means(first - a * first, r)
    return np.asarray(light * (2 ** (tone.local_contrast * (np.log2(tone.key) - large)))[..., None])


def _box_means(values: F64, r: int) -> F64:
    """Means over squares of 2 r + 1, by cumulative sums; the border repeats its last pixel."""
    wide = np.pad(values, r, mode="edge").cumsum(0).cumsum(1)
    wide = np.pad(wide, ((1, 0), (1, 0)))
    n = 2 * r + 1
    return np.asarray((wide[n:, n:] - wide[:-n, n:] - wide[n:, :-n] + wide[:-n, :-n]) / n**2)


def _vignette(light: F64, sensor: SensorFields) -> F64:
    """(H, W, 1) transmission of a lens, by the squared distance from the middle."""
    height, width = light.shape[:2]
    y, x = np.mgrid[0:height, 0:width] + 0.5
    squared = (y - height / 2) ** 2 + (x - width / 2) ** 2
    squared /= (height / 2) ** 2 + (width / 2) ** 2
    return np.asarray(1 - sensor.vignetting * squared)[..., None]


def _roll_off(light: F64, white: float) -> F64:
    """Linear to 0.6, then 0.6 + k log(1 + (x - 0.6) / k), which is 1 at white; paler from a luminance of 1 on."""
    # The sum rises with k, so that bisecting its logarithm finds it.
    low, high = -9.3, 9.3
    for _ in range(100):
        middle = (low + high) / 2
        k = float(np.exp(middle))
        is_short = 0.6 + k * np.log1p((white - 0.6) / k) < 1
        low, high = (middle, high) if is_short else (low, middle)
    top = light.max(axis=-1, keepdims=True)
    over = np.maximum(top - 0.6, 0)
    target = np.where(top > 0.6, np.minimum(0.6 + k * np.log1p(over / k), 1), top)
    scaled = light * np.divide(target, top, out=np.ones_like(top), where=top > 0)
    level = np.maximum(light @ LUMINANCE, 1)[..., None]
    pale = np.clip(np.log2(level) / max(np.log2(white), 1e-3), 0, 1)
    return np.asarray(scaled * (1 - pale) + target * pale)
