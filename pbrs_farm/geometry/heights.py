"""Heights (y) of triangles above and below plan places (x, z), metres, edges included; no effects."""

from __future__ import annotations

from typing import Final

import numpy as np

from pbrs_farm.core.arrays import F64, Bools
from pbrs_farm.core.mesh import triangle_bounds

_EDGE: Final = 1e-9  # barycentric coordinates by which a place may lie beyond an edge
_UPRIGHT_M2: Final = 1e-12  # twice the area in plan of a triangle that has no height
_PAIRS: Final = 1_000_000  # maximum pairs of position and triangle per batch, to bound memory


def highest_below(places: F64, triangles: F64, limit_y: float | F64 = np.inf) -> F64:
    """(N,) y of the highest surface up to limit_y of triangles (F, 3, 3) at places (N, 2); -inf if none."""
    limit = np.broadcast_to(np.asarray(limit_y, np.float64), (len(places),))
    highest = np.full(len(places), -np.inf)
    triangles = _candidates_near(places, triangles)
    step = max(1, _PAIRS // max(1, len(triangles)))
    for k in range(0, len(places) if len(triangles) else 0, step):
        part = slice(k, k + step)
        y, covers = _heights_at(places[part, None], triangles)
        highest[part] = np.where(covers & (y <= limit[part, None]), y, -np.inf).max(1)
    return highest


def lowest_above(places: F64, triangles: F64, least_y: float | F64) -> F64:
    """(N,) y of the lowest surface above least_y of triangles (F, 3, 3) at places (N, 2); inf if none."""
    least = np.broadcast_to(np.asarray(least_y, np.float64), (len(places),))
    lowest = np.full(len(places), np.inf)
    triangles = _candidates_near(places, triangles)
    triangles = triangles[triangles[:, :, 1].max(1) > least.min(initial=np.inf)]
    step = max(1, _PAIRS // max(1, len(triangles)))
    for k in range(0, len(places) if len(triangles) else 0, step):
        y, covers = _heights_at(places[k : k + step, None], triangles)
        lowest[k : k + step] = np.where(covers & (y > least[k : k + step, None]), y, np.inf).min(1)
    return lowest


def heights_in(places: F64, triangles: F64, edge: float = _EDGE) -> F64:
    """(N,) y of triangle k at place k; NaN beyond its edges by more than `edge` (barycentric)."""
    y, covers = _heights_at(places, triangles, edge)
    return np.where(covers, y, np.nan)


def _candidates_near(places: F64, triangles: F64) -> F64:
    """The triangles whose plan box meets the places' and that are not upright."""
    if not len(places) or not len(triangles):
        return triangles[:0]
    low, high = triangle_bounds(triangles[:, :, [0, 2]])
    near = triangles[(high >= places.min(0)).all(1) & (low <= places.max(0)).all(1)]
    e, f = near[:, 1] - near[:, 0], near[:, 2] - near[:, 0]
    return np.asarray(near[np.abs(e[:, 0] * f[:, 2] - e[:, 2] * f[:, 0]) > _UPRIGHT_M2])


def _heights_at(places: F64, triangles: F64, edge: float = _EDGE) -> tuple[F64, Bools]:
    """y of triangles (..., 3, 3) at places (..., 2), which broadcast, and whether they cover them."""
    a = triangles[..., 0, :]
    e, f = triangles[..., 1, :] - a, triangles[..., 2, :] - a
    dx, dz = places[..., 0] - a[..., 0], places[..., 1] - a[..., 2]
    # Solve for the place in the triangle's plan.
    with np.errstate(divide="ignore", invalid="ignore"):
        det = e[..., 0] * f[..., 2] - e[..., 2] * f[..., 0]
        u = (dx * f[..., 2] - dz * f[..., 0]) / det
        v = (e[..., 0] * dz - e[..., 2] * dx) / det
        y = a[..., 1] + u * e[..., 1] + v * f[..., 1]
        covers = (u >= -edge) & (v >= -edge) & (u + v <= 1 + edge)
    return y, covers
