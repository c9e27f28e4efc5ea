"""Normals of a depth picture by fitting planes, with a mask of where they can be trusted; no effects.

A plane is linear in inverse depth over pixels, 1/z = a u + b v + c, and inverse depth is what a
structured-light camera measures with equal noise everywhere: its least squares are the right ones.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F32, F64, Mask

_STEPS: Final = (-1.0, -0.75, -0.5, -0.25, 0.0, 0.25, 0.5, 0.75, 1.0)  # samples, of the radius


@dataclass(frozen=True, slots=True)
class PlaneFit:
    """How planes are fitted, and which are trusted."""

    radius: float = 0.0125  # of the window, as a share of the picture's width: 8 pixels of 640
    same_surface: float = 0.03  # a neighbour counts whose depth differs by less than this share
    least_share: float = 0.6  # of the window's samples that must count
    most_residual: float = 0.01  # mean distance from the plane, as a share of depth
    least_cosine: float = 0.15  # between normal and ray: planes seen edge-on are noise


def normals_of_depth(
    depth_m: NDArray[Any], K: F64, fit: PlaneFit | None = None
) -> tuple[F32, Mask]:
    """(H, W, 3) float32 unit normals, x right, y down, z forward, towards the camera; (H, W) trusted.

    depth_m: (H, W) metres along the axis, 0 = unknown. K: (3, 3) pixels, centres at 0.5. Pixels that
    are not trusted hold 0.
    """
    fit = fit or PlaneFit()
    depth = np.asarray(depth_m, np.float64)
    inverse = np.where(depth > 0, 1 / np.where(depth > 0, depth, 1.0), 0.0)
    sums, n_samples = _sums(inverse, fit)
    a, b, c, is_solved = _solved(sums)
    # Turn the plane of the window (u, v from its middle) into one of the camera's space.
    height, width = depth.shape
    u = (np.arange(width) + 0.5 - K[0, 2])[None, :]
    v = (np.arange(height) + 0.5 - K[1, 2])[:, None]
    normal = -np.stack([a * K[0, 0], b * K[1, 1], c - a * u - b * v], -1)
    length = np.linalg.norm(normal, axis=-1)
    normal /= np.maximum(length, 1e-12)[..., None]
    # Trust what many samples lie near to, and what is not seen edge-on.
    count = sums[0]
    residual = np.sqrt(np.maximum(_residual(sums, a, b, c), 0) / np.maximum(count, 1))
    ray = np.stack(np.broadcast_arrays(u / K[0, 0], v / K[1, 1], 1.0), -1)
    cosine = -(normal * ray).sum(-1) / np.linalg.norm(ray, axis=-1)
    trusted = (
        is_solved & (depth > 0) & (count >= fit.least_share * n_samples)
        & (residual * depth <= fit.most_residual) & (cosine >= fit.least_cosine)
    )  # fmt: skip
    return np.asarray(np.where(trusted[..., None], normal, 0), np.float32), trusted


def _sums(inverse: F64, fit: PlaneFit) -> tuple[F64, int]:
    """(10, H, W): count, and sums of u, v, uu, uv, vv, w, uw, vw, ww over each window's own surface."""
    height, width = inverse.shape
    offsets = sorted({round(step * max(fit.radius * width, 2.0)) for step in _STEPS})
    reach = offsets[-1]
    padded = np.pad(inverse, reach)
    sums = np.zeros((10, height, width))
    for v in offsets:
        for u in offsets:
            w = padded[reach + v : reach + v + height, reach + u : reach + u + width]
            # Take neighbours of about the same depth.
            same = (w > 0) & (np.abs(w - inverse) < fit.same_surface * inverse)
            m, mw = same.astype(np.float64), np.where(same, w, 0.0)
            for k, part in enumerate((1, u, v, u * u, u * v, v * v)):
                if part:
                    sums[k] += part * m
            for k, part in enumerate((1, u, v), 6):
                if part:
                    sums[k] += part * mw
            sums[9] += mw * w
    return sums, len(offsets) ** 2


def _solved(sums: F64) -> tuple[F64, F64, F64, Mask]:
    """a, b, c of 1/z = a u + b v + c by Cramer's rule, and where there is one plane."""
    n, u, v, uu, uv, vv, w, uw, vw, _ = sums
    det = uu * (vv * n - v * v) - uv * (uv * n - v * u) + u * (uv * v - vv * u)
    is_solved = det > 1e-6 * np.maximum(n, 1) ** 3
    det = np.where(is_solved, det, 1.0)
    a = (uw * (vv * n - v * v) - uv * (vw * n - v * w) + u * (vw * v - vv * w)) / det
    b = (uu * (vw * n - w * v) - uw * (uv * n - v * u) + u * (uv * w - vw * u)) / det
    c = (uu * (vv * w - v * vw) - uv * (uv * w - vw * u) + uw * (uv * v - vv * u)) / det
    return a, b, c, is_solved


def _residual(sums: F64, a: F64, b: F64, c: F64) -> F64:
    """Sum of squared distances of 1/z from the plane, at its least: ww - a uw - b vw - c w."""
    _, _, _, _, _, _, w, uw, vw, ww = sums
    return np.asarray(ww - a * uw - b * vw - c * w)
