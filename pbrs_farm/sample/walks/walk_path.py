"""A way of cells as a smooth path, and how fast it is walked; no effects."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from pbrs_farm.core.arrays import F64, Bools
from pbrs_farm.core.walkable import CELL_M, WALK_M
from pbrs_farm.sample.walks.walk_space import WalkSpace

_ROUNDS: Final = 150  # of relaxation: corners are rounded over half a metre
_CONTROL_M: Final = 0.2  # between the control points of the spline
_DENSE_M: Final = 0.005  # between the points that speed is measured at
_ACROSS_MPS2: Final = 0.8  # acceleration in a turn, at most
_ALONG_MPS2: Final = 0.6  # of setting off and slowing down, at most
_LEAST_MPS: Final = 0.05  # least speed, also at the ends, so that the walk gets to its end
_CURVE_M: Final = 0.05  # of way before and after a place over which its curvature is measured
_HEADING_M: Final = 0.2  # the same for its heading


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """Positions of a walker at given times."""

    places: F64  # (N, 2) plan x, z
    heading: F64  # (N, 2) unit direction of the path
    length_m: float  # of the walked path


def relax_path(way: F64, space: WalkSpace) -> F64:
    """The way (M, 2) with corners rounded, ends kept, clear by half a way, points about CELL_M apart."""
    places = _resampled(way, CELL_M)
    # Move each point towards its neighbours' middle, where that stays clear; the ends stay.
    for _round in range(_ROUNDS if len(places) > 2 else 0):
        moved = places.copy()
        moved[1:-1] += 0.5 * ((places[:-2] + places[2:]) / 2 - places[1:-1])
        clear = _is_clear(moved, space)
        places = np.where(clear[:, None], moved, places)
    return places


def _is_clear(places: F64, space: WalkSpace) -> Bools:
    cells = space.grid.cells(places)
    inside = space.grid.holds(cells)
    clear = np.zeros(len(places), bool)
    clear[inside] = space.clearance[tuple(cells[inside].T)] >= WALK_M / 2
    return clear


def _resampled(path: F64, step_m: float) -> F64:
    """Points step_m apart along a polyline (M, 2), its ends among them."""
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    n = max(round(float(along[-1]) / step_m), 1)
    distances = np.linspace(0, along[-1], n + 1)
    return np.stack([np.interp(distances, along, path[:, k]) for k in range(2)], axis=1)


def spline_through(places: F64) -> F64:
    """(M, 2) points 5 mm apart on the cubic B-spline (inside its hull) of the places."""
    from scipy.interpolate import BSpline  # here: 0.1 s that only walks need

    control = _resampled(places, _CONTROL_M)
    # Repeat the ends, so that the curve begins and ends at them.
    control = np.concatenate([control[:1], control[:1], control, control[-1:], control[-1:]])
    knots = np.arange(len(control) + 4, dtype=np.float64)
    curve = BSpline(knots, control, 3)
    parameters = np.linspace(knots[3], knots[-4], max(int(len(places) * CELL_M / _DENSE_M), 8))
    return _resampled(np.asarray(curve(parameters)), _DENSE_M)


def time_walk(path: F64, times: F64, speed_mps: float) -> Motion:
    """The walker on a path (M, 2) at times (N,) s, at most speed_mps, slower in turns, gentle at ends."""
    step = np.linalg.norm(np.diff(path, axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(step)])
    # Bound the speed by the curvature, then by what can be gained or lost on the way.
    speed = np.minimum(speed_mps, np.sqrt(_ACROSS_MPS2 / np.maximum(_curvature(path), 1e-6)))
    speed = np.maximum(speed, _LEAST_MPS)
    gain = 2 * _ALONG_MPS2 * np.append(step, 0)
    squared = speed**2
    for k in range(1, len(squared)):
        squared[k] = min(squared[k], squared[k - 1] + gain[k - 1])
    for k in range(len(squared) - 2, -1, -1):
        squared[k] = min(squared[k], squared[k + 1] + gain[k])
    speed = np.sqrt(squared)
    # Integrate the time from point to point and interpolate the requested times.
    when = np.concatenate([[0.0], np.cumsum(step / ((speed[:-1] + speed[1:]) / 2))])
    distances = np.interp(times, when, along)
    places = np.stack([np.interp(distances, along, path[:, k]) for k in range(2)], axis=1)
    return Motion(places, _heading(path, along, distances), float(distances[-1]))


def _curvature(path: F64) -> F64:
    """(M,) 1/m, over 10 cm: a polyline has no curvature at a point."""
    n = max(int(_CURVE_M / _DENSE_M), 1)
    if len(path) <= 2 * n:
        return np.zeros(len(path))
    back, ahead = path[n:-n] - path[: -2 * n], path[2 * n :] - path[n:-n]
    cross = back[:, 0] * ahead[:, 1] - back[:, 1] * ahead[:, 0]
    turn = np.abs(np.arctan2(cross, (back * ahead).sum(1)))
    return np.pad(turn / (n * _DENSE_M), n, mode="edge")


def _heading(path: F64, along: F64, at: F64) -> F64:
    """(N, 2) unit direction at lengths at, over 20 cm ahead and behind."""
    ends = [
        np.stack([np.interp(at + d, along, path[:, k]) for k in range(2)], axis=1)
        for d in (-_HEADING_M, _HEADING_M)
    ]
    direction = ends[1] - ends[0]
    length = np.linalg.norm(direction, axis=1, keepdims=True)
    return np.where(length > 1e-6, direction / np.maximum(length, 1e-9), [1.0, 0.0])
