"""Layers that follow from depth and normals: hha by its formula, depth sensors by their statistics.

Why a sensor has no reading is judged by the surfaces around the pixel: a reason must hold there.
Effects: none. The numbers are those of docs/formats/layer_rules.md. A noisy pixel must be within the range of its
neighbours, and the mean over flat surfaces near 0.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy import ndimage

from pbrs_farm.check.axes import dot, world_normals
from pbrs_farm.check.cases import ViewCase
from pbrs_farm.check.checks import Check
from pbrs_farm.check.colours import linear_from_srgb
from pbrs_farm.check.pixel_checks import albedo_of
from pbrs_farm.core.arrays import F64, Bools
from pbrs_farm.core.record import Record, read_csv

_HHA_STEPS = 1.51  # of 255: rounding, and half a millimetre of depth
_SATURATED_MM = 65535


class _Sensor(Record):
    """A row of sensors.csv."""

    sensor: str
    focal_px: float = 0.0
    baseline_m: float = 0.0
    steps: int = 0
    noise_px: float = 0.0
    nearest_m: float
    farthest_m: float
    reflectance: float
    largest_angle_deg: float = 180.0
    grain_px2: float = 1.0


_SENSORS = {row.sensor: row for row in read_csv(Path(__file__).with_name("sensors.csv"), _Sensor)}
# Layer of reasons -> its sensor; the reasons, by their numbers.
_HOLES = {name.replace("sensor", "hole"): name for name in _SENSORS}
_CLEAR, _MIRROR, _TOO_DARK, _TOO_NEAR, _TOO_FAR, _GRAZING, _SHADOW, _EDGE = range(1, 9)
_MOST_DISPARITY_PX = 126.0
_FAR_SHARE = 0.75  # of the farthest reach, from which noise may exceed it
_COLOUR_STEPS = 2.5  # of 255
_SIGMAS = 6.5  # of noise, for a pixel
_FLAT_SIGMAS = 0.8  # of noise: range of the neighbours of a flat pixel
_SLANT_SIGMAS = 8.0  # the same of a time-of-flight sensor
_BIAS_SIGMAS = 0.35  # of noise: largest mean over flat pixels
_LEAST_ALIKE = 0.3  # correlation of neighbours' noise, where a sensor matches blocks
_SPREAD = (0.6, 1.5)  # noise of flat pixels over the expected one
_LEAST_MEASURED = 0.25  # share of flat pixels within reach
_FEW_BLOCKS = 0.5  # of standard deviations, that so few blocks may be off by chance
_FEW = 500  # flat pixels that statistics need
_REACH_PX = 7  # size of the neighbourhood that a pixel may have measured


def check_derived(case: ViewCase) -> None:
    """Judge hha by its formula, noisy depth by its neighbours' range and its mean over flat surfaces."""
    if "hha" in case.arrays:
        _check_hha(case)
    for name, sensor in _SENSORS.items():
        if name in case.arrays:
            (_check_matching if sensor.focal_px else _check_tof)(case, sensor)
    if any(name in case.arrays for name in _HOLES):
        seen = _seen_by_sensors(case)
        for hole, name in _HOLES.items():
            if hole in case.arrays:
                _check_holes(case, hole, _SENSORS[name], seen)


def _check_hha(case: ViewCase) -> None:
    """Disparity, height and angle from depth, pose and normals (Gupta et al. 2014)."""
    stored, depth = case.arrays["hha"].astype(float), case.arrays["depth"]
    hit, nothing = depth > 0, np.asarray(~stored.any(axis=-1))
    if not hit.any():
        case.tally.pixels("hha", case.place, nothing)
        return
    height_cm = case.view.ray_grid()[..., 1] * (depth / 10)
    normals = world_normals(case.arrays["normal"], case.view.world_from_camera)
    lowest = float(height_cm[hit].min())
    # At the limit between a visible floor and an assumed one, either is right.
    floors = {lowest} if lowest < -89.9 else {-130.0}
    floors |= {lowest, -130.0} if abs(lowest + 90) < 0.2 else set()
    with np.errstate(divide="ignore"):
        near = 31000 / np.maximum(depth / 10, 100)
    angle = np.degrees(np.arccos(np.clip(normals[..., 1], -1, 1))) + 38
    right = np.zeros(depth.shape, bool)
    for floor in floors:
        expected = np.clip(np.stack([near, height_cm - floor, angle], axis=-1), 0, 255)
        right |= (np.abs(stored - expected) <= _HHA_STEPS).all(axis=-1)
    right |= depth >= _SATURATED_MM
    case.tally.pixels("hha", case.place, np.where(hit, right, nothing))


def _check_matching(case: ViewCase, sensor: _Sensor) -> None:
    """A sensor that measures disparity in steps: each value is a step, near those of its neighbours."""
    stored, depth = case.arrays[sensor.sensor], case.arrays["depth"]
    fb, steps, noise = sensor.focal_px * sensor.baseline_m, sensor.steps, sensor.noise_px
    measured = stored > 0
    metres = np.where(measured, stored / 1000, 1.0)
    # The step of the stored depth, if there is one.
    step = np.rint(fb / metres * steps)
    fits = np.abs(np.rint(fb * steps / np.maximum(step, 1) * 1000) - stored) <= 0.5
    with np.errstate(divide="ignore"):
        true = np.where(depth > 0, fb / (depth / 1000), np.nan)
    low, high = _extremes(true)
    slack = _SIGMAS * noise + 1 / steps
    disparity = step / steps
    with np.errstate(invalid="ignore"):
        near = (disparity >= low - slack) & (disparity <= high + slack)
        is_flat = (high - low < _FLAT_SIGMAS * noise) & (depth > 0)
        # Depths that noise does not push out of reach.
        is_flat &= (fb / true > sensor.nearest_m * 1.1) & (fb / true < sensor.farthest_m * 0.8)
    _check_values(case, sensor, fits & near, (disparity - true) / noise, is_flat)


def _check_tof(case: ViewCase, sensor: _Sensor) -> None:
    """A sensor that times light: noise by distance and slant."""
    stored, depth = case.arrays[sensor.sensor], case.arrays["depth"]
    rays = case.view.ray_grid()
    normals = world_normals(case.arrays["normal"], case.view.world_from_camera)
    cosine = np.abs(dot(normals, rays)) / np.linalg.norm(rays, axis=-1)
    angle = np.minimum(np.arccos(np.clip(cosine, 0, 1)), np.radians(85))
    true = np.where(depth > 0, depth / 1000, np.nan)
    low, high = _extremes(true)
    sigma, metres = _tof_sigma_m(sensor.sensor, high, angle), stored / 1000
    slack = _SIGMAS * sigma + 0.001
    with np.errstate(invalid="ignore"):
        near = (metres >= low - slack) & (metres <= high + slack)
        # It measures the pixel itself, so that a slant moves nothing.
        is_flat = (high - low < _SLANT_SIGMAS * sigma) & (depth > 0)
        is_flat &= (true > sensor.nearest_m * 1.1) & (true < sensor.farthest_m * 0.9)
    _check_values(case, sensor, near, (metres - true) / sigma, is_flat)


def _check_values(
    case: ViewCase, sensor: _Sensor, right: Bools, error: F64, is_flat: Bools
) -> None:
    """Measured values are right and within reach (error: in sigmas)."""
    metres = case.arrays[sensor.sensor] / 1000
    in_reach = (metres >= sensor.nearest_m - 0.001) & (metres <= sensor.farthest_m + 0.001)
    right = (metres == 0) | (right & in_reach)
    case.tally.pixels(f"{sensor.sensor}: values", case.place, right)
    _check_statistics(case, sensor, error, metres > 0, is_flat)


def _tof_sigma_m(name: str, z: F64, angle: F64) -> F64:
    """Standard deviation at depth z (m) and slant (rad).

    Of a Kinect 2 (Fankhauser et al. 2015), no more than at 2.5 m of an Azure Kinect (Kurillo et al.
    2022), by its data sheet of an L515.
    """
    if name == "depth_sensor_l515":
        return np.maximum(2.5 + 13 / 8 * (z - 1), 0.5) / 1000
    far = np.minimum(z, 2.5) if name == "depth_sensor_azure" else z
    slant = angle**2 / (np.pi / 2 - angle) ** 2
    return np.maximum(1.5 - 0.5 * far + 0.3 * far**2 + 0.1 * far**1.5 * slant, 0.5) / 1000


class _Seen(NamedTuple):
    """Properties of the surface at each pixel that sensors depend on; each (H, W)."""

    z: F64  # m, 0 = nothing
    angle: F64  # rad, between ray and normal
    clear: Bools
    mirror: Bools
    most_return: F64  # share of light over m^2, with the tolerance of a stored colour
    least_return: F64


def _seen_by_sensors(case: ViewCase) -> _Seen:
    """Cast rays through all pixels, for materials; depth and normals are those of the stored layers."""
    shape = case.arrays["depth"].shape
    cast = case.cast(*(n.reshape(-1) for n in np.indices(shape)))
    triangles, is_hit = case.now.triangles, cast.face >= 0
    kinds = triangles.kinds_of(cast.face) if len(triangles.faces) else np.zeros(len(cast), str)
    srgb = albedo_of(case.view, cast).max(1)
    length = np.linalg.norm(cast.directions, axis=1)
    cosine = np.abs(dot(cast.normal, cast.directions)) / np.maximum(length, 1e-9)
    share = np.divide(
        cosine, (cast.z * length) ** 2, out=np.full(len(cast), np.inf), where=is_hit & (cast.z > 0)
    )
    returns = [
        share * (linear_from_srgb(np.clip(srgb + by, 0, 255) / 255) + by * 1e-5)
        for by in (_COLOUR_STEPS, -_COLOUR_STEPS)
    ]
    arrays = (
        case.arrays["depth"] / 1000,
        np.arccos(np.clip(cosine, 0, 1)),
        np.isin(kinds, ("glass", "pane")),
        kinds == "mirror",
        *returns,
    )
    return _Seen(*(np.asarray(a).reshape(shape) for a in arrays))


def _check_holes(case: ViewCase, name: str, sensor: _Sensor, seen: _Seen) -> None:
    """Each reason holds beside the pixel, and only pixels with a reason lack a measurement."""
    stored, nothing = case.arrays[name], seen.z == 0
    least = sensor.reflectance / sensor.farthest_m**2  # assumed least light, share over m^2
    # The nearest that the search of a stereo camera finds.
    nearest = sensor.nearest_m or sensor.focal_px * sensor.baseline_m / _MOST_DISPARITY_PX
    near_z = np.where(nothing, np.inf, seen.z)
    reasons = {
        _CLEAR: seen.clear,
        _MIRROR: seen.mirror,
        _TOO_DARK: ~nothing & (seen.least_return < least),
        _TOO_NEAR: near_z < nearest * 1.1,
        _TOO_FAR: near_z > sensor.farthest_m * _FAR_SHARE,
    }
    steep = seen.angle > np.radians(sensor.largest_angle_deg - 0.1)
    reasons[_GRAZING] = ~nothing & steep
    if sensor.baseline_m:
        reasons[_SHADOW] = _in_shadow(case, sensor, near_z)
    if sensor.sensor == "depth_sensor_azure":
        low, high = (
            f(near_z, 3, mode="nearest") for f in (ndimage.minimum_filter, ndimage.maximum_filter)
        )
        with np.errstate(invalid="ignore"):
            reasons[_EDGE] = ~(high - low <= 0.029 * low)
    right = stored == 0
    for reason, holds in reasons.items():
        beside = ndimage.maximum_filter(holds, _REACH_PX, mode="nearest")
        right |= (stored == reason) & beside
    # A surface that no sensor measures, with nothing else about it.
    blind = seen.clear | seen.mirror | nothing | (seen.most_return < least)
    right &= ~((stored == 0) & ndimage.minimum_filter(blind, _REACH_PX, mode="nearest"))
    if sensor.sensor in case.arrays:
        measured = case.arrays[sensor.sensor] > 0
        by_material = np.isin(stored, (0, _CLEAR, _MIRROR, _TOO_DARK))
        right &= np.where(measured, by_material, stored > 0)
    case.tally.pixels("depth holes", f"{case.place}/{name}.png", right)


def _in_shadow(case: ViewCase, sensor: _Sensor, z: F64) -> Bools:
    """(H, W) pixels that a surface to the right hides from a point beside the camera, or outside its picture."""
    is_kinect = sensor.sensor == "depth_sensor"
    if not is_kinect:
        size = max(round(5 * z.shape[1] / 848) | 1, 3)
        z = ndimage.minimum_filter(z, size, mode="nearest")
    places = np.arange(z.shape[1]) - case.view.k[0, 0] * sensor.baseline_m / z
    hidden = np.zeros(z.shape, bool)
    first = places[:, -1]
    for column in range(z.shape[1] - 1, -1, -1):
        first = np.minimum(first, places[:, column])
        hidden[:, column] = places[:, column] > first + 0.4
    return hidden if is_kinect else hidden | (places < -0.4)


def _extremes(values: F64) -> tuple[F64, F64]:
    """(H, W) least and largest value around each pixel; NaN without values."""
    is_value = np.isfinite(values)
    low = ndimage.minimum_filter(np.where(is_value, values, np.inf), _REACH_PX, mode="nearest")
    high = ndimage.maximum_filter(np.where(is_value, values, -np.inf), _REACH_PX, mode="nearest")
    return np.where(np.isfinite(low), low, np.nan), np.where(np.isfinite(high), high, np.nan)


def _check_statistics(
    case: ViewCase, sensor: _Sensor, error: F64, measured: Bools, is_flat: Bools
) -> None:
    """Flat surfaces have mostly measured pixels, a mean error near 0 and the expected noise (error: in sigmas)."""
    n = int(is_flat.sum())
    if n < _FEW:
        return
    expect, chosen = case.expect(f"{sensor.sensor}: statistics"), is_flat & measured
    share = chosen.sum() / n
    fault = f"measures {share:.0%} of flat surfaces within reach"
    if not expect(share >= _LEAST_MEASURED, fault):
        return
    bias, spread = float(np.mean(error[chosen])), float(np.std(error[chosen]))
    # Pixels that share their noise count once.
    chance = 4 * np.sqrt(sensor.grain_px2 / chosen.sum())
    fault = f"is off by {bias:.2f} standard deviations in the mean"
    expect(abs(bias) <= _BIAS_SIGMAS + chance, fault)
    if chance > _FEW_BLOCKS:
        return
    if sensor.grain_px2 > 1:
        pair = chosen[:, 1:] & chosen[:, :-1]
        alike = float(np.corrcoef(error[:, 1:][pair], error[:, :-1][pair])[0, 1])
        expect(
            alike >= _LEAST_ALIKE,
            f"has noise with a correlation of only {alike:.2f} between neighbours",
        )
    fault = f"has {spread:.2f} times the expected noise"
    expect(_SPREAD[0] <= spread <= _SPREAD[1], fault)


CHECKS = (
    Check(
        "derived layers",
        "view",
        check_derived,
        15,
        ("hha", *_SENSORS, *_HOLES),
        {f"{name}.png": "each reason holds for a surface beside the pixel" for name in _HOLES},
    ),
)
