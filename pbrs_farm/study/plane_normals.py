"""Normals of a depth picture from fitted planes, with a mask of reliable ones.

Inverse depth on a plane is linear in the pixel, 1/z = a u + b v + c. A structured-light camera
measures inverse depth with uniform noise, so least squares of inverse depth are appropriate.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter

from pbrs_farm.core.arrays import F32, F64, Mask

_Pixels = tuple[NDArray[np.intp], ...]  # rows and columns
_N_TRIPLES, _N_POINTS = 600, 3000  # candidate planes, and pixels that score them
_REACH: Final = 0.2  # of a triple, share of the width
_MOST_PLANES: Final = 12
_LEAST_SHARE: Final = 0.03  # of the picture, of a large plane
# Kinect's noise grows with the square of depth, so distances are relative to depth.
_MOST_DISTANCE: Final = 0.015  # of a pixel from its plane
_LEAST_COSINE: Final = 0.87  # between local normal and plane: 30 degrees

_STEPS: Final = (
    -1.0,
    -0.75,
    -0.5,
    -0.25,
    0.0,
    0.25,
    0.5,
    0.75,
    1.0,
)  # offsets of samples, in radii


@dataclass(frozen=True, slots=True)
class PlaneFit:
    """Parameters of the fit and thresholds of the mask."""

    radius: float = 0.0125  # of the window, share of the width: 8 pixels of 640
    same_surface: float = 0.03  # maximum relative difference of depth of a neighbour
    least_share: float = 0.6  # minimum share of samples on the surface
    most_residual: float = 0.01  # maximum RMS distance from the plane, relative to depth
    least_cosine: float = 0.15  # minimum cosine between normal and ray


def normals_of_depth(
    depth_m: NDArray[Any], K: F64, fit: PlaneFit | None = None
) -> tuple[F32, Mask]:
    """(H, W, 3) normals towards the camera and (H, W) mask, of depth in metres and K (centres at 0.5)."""
    fit = fit or PlaneFit()
    depth = np.asarray(depth_m, np.float64)
    inverse = np.where(depth > 0, 1 / np.where(depth > 0, depth, 1.0), 0.0)
    sums, n_samples = _sums(inverse, fit)
    a, b, c, is_solved = _solved(sums)
    # Convert from the plane over the window (u, v from its middle) to camera space.
    height, width = depth.shape
    u = (np.arange(width) + 0.5 - K[0, 2])[None, :]
    v = (np.arange(height) + 0.5 - K[1, 2])[:, None]
    normal = -np.stack([a * K[0, 0], b * K[1, 1], c - a * u - b * v], -1)
    length = np.linalg.norm(normal, axis=-1)
    normal /= np.maximum(length, 1e-12)[..., None]
    # Require many samples near the plane and a plane that is not edge-on.
    count = sums[0]
    residual = np.sqrt(np.maximum(_residual(sums, a, b, c), 0) / np.maximum(count, 1))
    ray = np.stack(np.broadcast_arrays(u / K[0, 0], v / K[1, 1], 1.0), -1)
    cosine = -(normal * ray).sum(-1) / np.linalg.norm(ray, axis=-1)
    is_reliable = (
        is_solved
        & (depth > 0)
        & (count >= fit.least_share * n_samples)
        & (residual * depth <= fit.most_residual)
        & (cosine >= fit.least_cosine)
    )
    return np.asarray(np.where(is_reliable[..., None], normal, 0), np.float32), is_reliable


def _sums(inverse: F64, fit: PlaneFit) -> tuple[F64, int]:
    """(10, H, W): count, and sums of u, v, uu, uv, vv, w, uw, vw, ww over the surface in each window."""
    height, width = inverse.shape
    offsets = sorted({round(step * max(fit.radius * width, 2.0)) for step in _STEPS})
    reach = offsets[-1]
    padded = np.pad(inverse, reach)
    sums = np.zeros((10, height, width))
    for v in offsets:
        for u in offsets:
            w = padded[reach + v : reach + v + height, reach + u : reach + u + width]
            is_same = (w > 0) & (np.abs(w - inverse) < fit.same_surface * inverse)
            m, mw = is_same.astype(np.float64), np.where(is_same, w, 0.0)
            for k, part in enumerate((1, u, v, u * u, u * v, v * v)):
                if part:
                    sums[k] += part * m
            for k, part in enumerate((1, u, v), 6):
                if part:
                    sums[k] += part * mw
            sums[9] += mw * w
    return sums, len(offsets) ** 2


def _solved(sums: F64) -> tuple[F64, F64, F64, Mask]:
    """a, b, c of 1/z = a u + b v + c by Cramer's rule, and the mask of solutions."""
    n, u, v, uu, uv, vv, w, uw, vw, _ = sums
    det = uu * (vv * n - v * v) - uv * (uv * n - v * u) + u * (uv * v - vv * u)
    is_solved = det > 1e-6 * np.maximum(n, 1) ** 3
    det = np.where(is_solved, det, 1.0)
    a = (uw * (vv * n - v * v) - uv * (vw * n - v * w) + u * (vw * v - vv * w)) / det
    b = (uu * (vw * n - w * v) - uw * (uv * n - v * u) + u * (uv * w - vw * u)) / det
    c = (uu * (vv * w - v * vw) - uv * (uv * w - vw * u) + uw * (uv * v - vv * u)) / det
    return a, b, c, is_solved


def _residual(sums: F64, a: F64, b: F64, c: F64) -> F64:
    """Least sum of squared distances of 1/z from the plane: ww - a uw - b vw - c w."""
    _, _, _, _, _, _, w, uw, vw, ww = sums
    return np.asarray(ww - a * uw - b * vw - c * w)


def large_planes(depth_m: NDArray[Any], normal: NDArray[Any], valid: Mask, K: F64) -> F32:
    """(H, W, 3) normals of the large planes through the valid pixels, 0 elsewhere.

    RANSAC with a fixed seed, the largest plane first, each refined by least squares of inverse
    depth. normal (H, W, 3): unit vectors of normals_of_depth, which keep a plane off the clutter
    that it crosses.
    """
    height, width = valid.shape
    x = (np.arange(width) + 0.5 - K[0, 2]) / K[0, 0]
    y = (np.arange(height) + 0.5 - K[1, 2]) / K[1, 1]
    rays = np.stack(np.broadcast_arrays(x[None, :], y[:, None], 1.0), -1)
    inverse = np.where(valid, 1 / np.where(valid, depth_m, 1.0), 1.0)
    dice, is_free = np.random.default_rng(0), valid.copy()
    planes = np.zeros((height, width, 3), np.float32)

    def near(plane: F64, pixels: _Pixels) -> Mask:
        """The pixels on planes (3, ...) a x + b y + c = 1/z, (pixels, ...)."""
        unit = plane / np.linalg.norm(plane, axis=0)
        w = inverse[pixels][:, None]
        is_near = np.abs(rays[pixels] @ plane - w) <= _MOST_DISTANCE * w
        return np.asarray(is_near & (-(normal[pixels] @ unit) >= _LEAST_COSINE), bool)

    for _ in range(_MOST_PLANES):
        free = np.nonzero(is_free)
        if len(free[0]) < _LEAST_SHARE * valid.size:
            break
        indices = dice.integers(0, len(free[0]), _N_POINTS)
        points = tuple(axis[indices] for axis in free)
        candidates = _planes_of_triples(points, is_free, rays, inverse, dice)
        if not candidates.size:
            break
        counts = near(candidates, points).sum(0)
        plane: F64 = candidates[:, [int(counts.argmax())]]
        for _refinement in range(3):
            pixels = tuple(axis[near(plane, free)[:, 0]] for axis in free)
            if len(pixels[0]) < 3:
                break
            # Least squares of relative errors.
            weights = 1 / inverse[pixels][:, None]
            fit = np.linalg.lstsq(rays[pixels] * weights, np.ones_like(weights), rcond=None)
            plane = np.asarray(fit[0], np.float64)
        pixels = tuple(axis[near(plane, free)[:, 0]] for axis in free)
        if len(pixels[0]) < _LEAST_SHARE * valid.size:
            break
        planes[pixels] = -plane[:, 0] / np.linalg.norm(plane)
        is_free[pixels] = False
    return planes


def _planes_of_triples(
    points: _Pixels, is_free: Mask, rays: F64, inverse: F64, dice: np.random.Generator
) -> F64:
    """(3, n) planes a, b, c through triples of free pixels near each other."""
    height, width = is_free.shape
    reach = max(round(_REACH * width), 2)
    first = np.stack([axis[:_N_TRIPLES] for axis in points])
    offsets = dice.integers(-reach, reach + 1, (2, 3, _N_TRIPLES))
    offsets[:, 0] = 0
    rows, columns = np.clip(first[:, None] + offsets, 0, [[[height - 1]], [[width - 1]]])
    matrices = rays[rows, columns].transpose(1, 0, 2)
    is_sound = is_free[rows, columns].all(0) & (np.abs(np.linalg.det(matrices)) > 1e-6)
    rhs = inverse[rows, columns].T[is_sound][..., None]
    return np.asarray(np.linalg.solve(matrices[is_sound], rhs)[..., 0].T, np.float64)


def smoothed_normals(normal: NDArray[Any], valid: Mask, radius: float = 0.025) -> F32:
    """(H, W, 3) unit mean of the valid normals in a square of this radius, a share of the width."""
    side = 2 * max(round(radius * valid.shape[1]), 1) + 1
    shown = np.where(valid[..., None], normal, 0).astype(np.float64)
    sums = uniform_filter(shown, (side, side, 1), mode="constant")
    length = np.linalg.norm(sums, axis=-1, keepdims=True)
    return np.asarray(sums / np.maximum(length, 1e-12), np.float32)
