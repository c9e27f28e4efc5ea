"""Polygons in plan; no effects."""

from __future__ import annotations

import numpy as np

from pbrs_farm.core.arrays import F64


def is_within(polygon: list[list[float]], point: F64) -> bool:
    """True if a polygon contains a point: an odd number of its sides are beyond it."""
    a = np.array(polygon, np.float64)
    b = np.roll(a, -1, axis=0)
    crosses = (a[:, 1] > point[1]) != (b[:, 1] > point[1])
    with np.errstate(divide="ignore", invalid="ignore"):
        x = a[:, 0] + (point[1] - a[:, 1]) * (b[:, 0] - a[:, 0]) / (b[:, 1] - a[:, 1])
    return bool((crosses & (point[0] < x)).sum() % 2)


def polygon_area(points: F64) -> float:
    """Area of a simple polygon (N, 2), as the sum of its trapezia."""
    x, z = points.T
    return abs(float((x * np.roll(z, -1) - np.roll(x, -1) * z).sum())) / 2


def points_in_plan(
    polygon: list[list[float]], n: int, height: float, *, inner: bool = False
) -> F64:
    """(N, 3) points of a polygon at a height, of a grid of n by n; inner: without the grid's border."""
    corners = np.array(polygon, np.float64)
    low, high = corners.min(0), corners.max(0)
    cut = slice(1, -1) if inner else slice(None)
    x, z = np.meshgrid(*(np.linspace(a, b, n)[cut] for a, b in zip(low, high, strict=True)))
    points = np.stack([x.ravel(), z.ravel()], axis=1)
    inside = np.array([is_within(polygon, p) for p in points], bool)
    return np.insert(points[inside], 1, height, axis=1)
