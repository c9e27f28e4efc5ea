"""Normals of a depth picture from fitted planes, with a mask of reliable ones.

Inverse depth on a plane is linear in the pixel, 1/z = a u + b v + c. A structured-light camera
measures inverse depth with uniform noise, so least squares of inverse depth are appropriate.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F32, F64, Mask

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
