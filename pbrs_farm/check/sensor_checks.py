"""Layers that follow from depth and normals: hha by its formula, depth sensors by their statistics.

Effects: none. The numbers are those that docs/formats/layer_rules.md tells; where noise is, a pixel is held
against what its neighbours allow, and the mean over flat surfaces against none.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from pbrs_farm.check.certificate import Tally
from pbrs_farm.check.embree_caster import Floats
from pbrs_farm.check.stored_view import StoredView

_HHA_STEPS = 1  # of 255, by which a channel may differ
_SATURATED_MM = 65535

# Disparity of the sensors that match patterns: px times metres, steps of a px, noise in px, reach in m.
_MATCHING = {
    "depth_sensor": (580.0 * 0.075, 8, 1 / 6, (0.5, 8.0)),
    "depth_sensor_stereo": (447.0 * 0.05, 32, 0.08, (0.0, 10.0)),
    "depth_sensor_d455": (455.0 * 0.095, 32, 0.08, (0.0, 20.0)),
}
# Reach in m of those that time light; their noise is in _tof_sigma_m.
_TOF_REACH_M = {
    "depth_sensor_tof": (0.5, 4.5),
    "depth_sensor_azure": (0.5, 3.86),
    "depth_sensor_l515": (0.25, 9.0),
}
_SIGMAS = 6.5  # of noise, for a pixel
_FLAT_SIGMAS = 0.8  # of noise: what the neighbours of a flat pixel may differ by
_SLANT_SIGMAS = 8.0  # the same of a time-of-flight sensor
_BIAS_SIGMAS = 0.35  # of noise: what the mean over flat pixels may be
# Pixels that share their noise.
_GRAIN_PX2 = {"depth_sensor": 81.0, "depth_sensor_stereo": 28.0, "depth_sensor_d455": 28.0}
_LEAST_ALIKE = 0.3  # correlation of neighbours' noise, where a sensor matches blocks
_SPREAD = (0.6, 1.5)  # noise of flat pixels over what it should be
_LEAST_MEASURED = 0.25  # of flat pixels within reach
_FEW_BLOCKS = 0.5  # of standard deviations, that so few blocks may be off by chance
_FEW = 500  # flat pixels that statistics need
_REACH_PX = 7  # of the neighbours that a pixel may have measured


def check_derived(view: StoredView, arrays: Mapping[str, NDArray[Any]], tally: Tally) -> None:
    """Judge hha and the depth sensors, where the view has them.

    arrays has the layers by name, depth among them. What a sensor adds at random is judged by what
    its neighbours allow, and by the mean over flat surfaces.
    """
    depth = arrays["depth"]
    if "hha" in arrays:
        _check_hha(view, arrays, tally)
    for name in _MATCHING:
        if name in arrays:
            _check_matching(view, name, arrays[name], depth, tally)
    for name in _TOF_REACH_M:
        if name in arrays:
            _check_tof(view, name, arrays, tally)


def _points_and_normals(
    view: StoredView, arrays: Mapping[str, NDArray[Any]]
) -> tuple[Floats, Floats, Floats]:
    """(H, W, 3) points from the eye, unit normals, both along the world's axes; rays of unit depth."""
    height, width = view.size
    rows, columns = (g.reshape(-1) for g in np.mgrid[0:height, 0:width])
    _origin, rays = view.rays(rows, columns)
    rays = rays.reshape(height, width, 3)
    own = arrays["normal"] * (2 / 65535) - 1
    # Published axes are x right, y forward, z up; the pose's are x right, y down, z forward.
    facing = np.stack([own[..., 0], -own[..., 2], own[..., 1]], axis=-1)
    normals = facing @ view.world_from_camera[:3, :3].T
    return rays * (arrays["depth"] / 1000)[..., None], normals, rays


def _check_hha(view: StoredView, arrays: Mapping[str, NDArray[Any]], tally: Tally) -> None:
    """Disparity, height and angle from depth, pose and normals (Gupta et al. 2014)."""
    stored, depth = arrays["hha"].astype(float), arrays["depth"]
    points, normals, _rays = _points_and_normals(view, arrays)
    seen, height_cm = depth > 0, points[..., 1] * 100
    if not seen.any():
        _tally_pixels(view, "hha", np.asarray(~stored.any(axis=-1)), tally)
        return
    lowest = float(height_cm[seen].min())
    # At the limit between a floor that is seen and one that is assumed, either is right.
    floors = {lowest} if lowest < -89.9 else {-130.0}
    floors |= {lowest, -130.0} if abs(lowest + 90) < 0.2 else set()
    with np.errstate(divide="ignore"):
        near = 31000 / np.maximum(depth / 10, 100)
    # What half a millimetre of depth changes.
    slack = _HHA_STEPS + 0.51
    angle = np.degrees(np.arccos(np.clip(normals[..., 1], -1, 1))) + 38
    right = np.zeros(depth.shape, bool)
    for floor in floors:
        expected = np.clip(np.stack([near, height_cm - floor, angle], axis=-1), 0, 255)
        right |= (np.abs(stored - expected) <= slack).all(axis=-1)
    right |= depth >= _SATURATED_MM
    _tally_pixels(view, "hha", np.where(seen, right, ~stored.any(axis=-1)), tally)


def _check_matching(
    view: StoredView, name: str, stored: NDArray[Any], depth: NDArray[Any], tally: Tally
) -> None:
    """A sensor that measures disparity in steps: each value is a step, near what its neighbours have."""
    fb, steps, noise, (nearest, farthest) = _MATCHING[name]
    measured = stored > 0
    metres = np.where(measured, stored / 1000, 1.0)
    # The step whose depth is stored, and whether any has it.
    step = np.rint(fb / metres * steps)
    fits = np.abs(np.rint(fb * steps / np.maximum(step, 1) * 1000) - stored) <= 0.5
    reach = (metres >= nearest - 0.001) & (metres <= farthest + 0.001)
    with np.errstate(divide="ignore"):
        true = np.where(depth > 0, fb / (depth / 1000), np.nan)
    low, high = _extremes(true)
    slack = _SIGMAS * noise + 1 / steps
    found = step / steps
    with np.errstate(invalid="ignore"):
        near = (found >= low - slack) & (found <= high + slack)
        is_flat = (high - low < _FLAT_SIGMAS * noise) & (depth > 0)
        # Depths that noise does not push out of reach.
        is_flat &= (fb / true > nearest * 1.1) & (fb / true < farthest * 0.8)
    _tally_pixels(view, f"{name}: values", ~measured | (fits & reach & near), tally)
    _check_statistics(view, name, (found - true) / noise, measured, is_flat, tally)


def _check_tof(
    view: StoredView, name: str, arrays: Mapping[str, NDArray[Any]], tally: Tally
) -> None:
    """A sensor that times light: noise by distance and slant."""
    stored, depth, reach_m = arrays[name], arrays["depth"], _TOF_REACH_M[name]
    _points, normals, rays = _points_and_normals(view, arrays)
    cosine = np.abs(np.einsum("...i,...i->...", normals, rays)) / np.linalg.norm(rays, axis=-1)
    angle = np.minimum(np.arccos(np.clip(cosine, 0, 1)), np.radians(85))
    true = np.where(depth > 0, depth / 1000, np.nan)
    low, high = _extremes(true)
    sigma = _tof_sigma_m(name, high, angle)
    found, measured = stored / 1000, stored > 0
    reach = (found >= reach_m[0] - 0.001) & (found <= reach_m[1] + 0.001)
    slack = _SIGMAS * sigma + 0.001
    with np.errstate(invalid="ignore"):
        near = (found >= low - slack) & (found <= high + slack)
        # It measures the pixel itself, so that a slant moves nothing.
        is_flat = (high - low < _SLANT_SIGMAS * sigma) & (depth > 0)
        is_flat &= (true > reach_m[0] * 1.1) & (true < reach_m[1] * 0.9)
    _tally_pixels(view, f"{name}: values", ~measured | (reach & near), tally)
    _check_statistics(view, name, (found - true) / sigma, measured, is_flat, tally)


def _tof_sigma_m(name: str, z: Floats, angle: Floats) -> Floats:
    """Standard deviation at depth z (m) and slant: of a Kinect 2 (Fankhauser et al. 2015), no more than at
    2.5 m of an Azure Kinect (Kurillo et al. 2022), by its data sheet of an L515.
    """
    if name == "depth_sensor_l515":
        return np.maximum(2.5 + 13 / 8 * (z - 1), 0.5) / 1000
    far = np.minimum(z, 2.5) if name == "depth_sensor_azure" else z
    slant = angle**2 / (np.pi / 2 - angle) ** 2
    return np.maximum(1.5 - 0.5 * far + 0.3 * far**2 + 0.1 * far**1.5 * slant, 0.5) / 1000


def _extremes(values: Floats) -> tuple[Floats, Floats]:
    """(H, W) least and most of the pixels about each that see anything; NaN where none does."""
    known = np.isfinite(values)
    low = ndimage.minimum_filter(np.where(known, values, np.inf), _REACH_PX, mode="nearest")
    high = ndimage.maximum_filter(np.where(known, values, -np.inf), _REACH_PX, mode="nearest")
    return np.where(np.isfinite(low), low, np.nan), np.where(np.isfinite(high), high, np.nan)


def _check_statistics(
    view: StoredView,
    name: str,
    error: Floats,
    measured: NDArray[np.bool_],
    is_flat: NDArray[np.bool_],
    tally: Tally,
) -> None:
    """Over flat surfaces: most is measured, the mean error is none, and noise is as large as it should be.

    error: (H, W) in standard deviations. Too few flat pixels tell nothing.
    """
    n = int(is_flat.sum())
    if n < _FEW:
        return
    here = is_flat & measured
    share = here.sum() / n
    check = f"{name}: statistics"
    what = f"measures {share:.0%} of flat surfaces within reach"
    if not tally.expect(check, view.place, share >= _LEAST_MEASURED, what):
        return
    values = error[here]
    bias, spread = float(np.mean(values)), float(np.std(values))
    # So many pixels tell of so many independent blocks.
    chance = 4 * np.sqrt(_GRAIN_PX2.get(name, 1.0) / here.sum())
    what = f"is off by {bias:.2f} standard deviations in the mean"
    tally.expect(check, view.place, abs(bias) <= _BIAS_SIGMAS + chance, what)
    if chance > _FEW_BLOCKS:
        return
    if name in _GRAIN_PX2:
        pair = here[:, 1:] & here[:, :-1]
        alike = float(np.corrcoef(error[:, 1:][pair], error[:, :-1][pair])[0, 1])
        what = f"has noise of which neighbours share {alike:.2f}"
        tally.expect(check, view.place, alike >= _LEAST_ALIKE, what)
    what = f"has {spread:.2f} times the noise it should have"
    tally.expect(check, view.place, _SPREAD[0] <= spread <= _SPREAD[1], what)


def _tally_pixels(view: StoredView, check: str, right: NDArray[np.bool_], tally: Tally) -> None:
    tally.add(check, right.size)
    if not right.all():
        row, column = np.argwhere(~right)[0]
        tally.fail(check, view.place, f"row {row}, column {column}", int((~right).sum()))
