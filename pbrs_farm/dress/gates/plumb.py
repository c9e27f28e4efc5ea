"""Which faces lie above and below places of a house, and whose; no effects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F64
from pbrs_farm.dress.gates.bodies import Body

_CELL_M: Final = 0.1
_MANY_CELLS: Final = 400  # a triangle over more is looked at for every place
_STEEP: Final = 1e-9  # square metres in plan: a triangle with less stands upright
_EDGE: Final = 1e-6  # of a triangle's extent: a place on its edge is on it

Ints = NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class Hits:
    """What the upright lines through places meet."""

    place: Ints  # (N,) number of the place
    y: F64  # (N,) where its line meets a face
    body: Ints  # (N,) number of the face's body


class Plumb:
    """Upright lines through all faces of bodies that do not stand upright themselves."""

    def __init__(self, bodies: Sequence[Body]) -> None:
        corners = np.concatenate([np.zeros((0, 3, 3)), *(b.corners for b in bodies)])
        owner = np.repeat(np.arange(len(bodies)), [len(b.corners) for b in bodies])
        plan = corners[:, :, [0, 2]]
        ab, ac = plan[:, 1] - plan[:, 0], plan[:, 2] - plan[:, 0]
        lies = np.abs(ab[:, 0] * ac[:, 1] - ab[:, 1] * ac[:, 0]) > 2 * _STEEP
        self._corners, self._owner = corners[lies], owner[lies]
        # Enter each triangle into the cells of its bounds.
        plan = plan[lies]
        self._origin = plan.min((0, 1)) if len(plan) else np.zeros(2)
        first = np.floor((plan.min(1) - self._origin) / _CELL_M - _EDGE).astype(np.int64)
        last = np.floor((plan.max(1) - self._origin) / _CELL_M + _EDGE).astype(np.int64)
        shape = last - first + 1
        n_cells = shape.prod(1)
        self._large = np.flatnonzero(n_cells > _MANY_CELLS)
        small = np.flatnonzero(n_cells <= _MANY_CELLS)
        triangle = np.repeat(small, n_cells[small])
        k = np.arange(len(triangle)) - np.repeat(
            np.cumsum(n_cells[small]) - n_cells[small], n_cells[small]
        )
        across = shape[triangle, 1]
        cell = np.stack([first[triangle, 0] + k // across, first[triangle, 1] + k % across], -1)
        self._stride = int(last[:, 1].max(initial=0)) + 2
        keys = cell[:, 0] * self._stride + cell[:, 1]
        order = np.argsort(keys, kind="stable")
        self._keys, self._triangle = keys[order], triangle[order]

    def hits(self, places: F64) -> Hits:
        """Every face above or below plan places (N, 2), edges included."""
        cell = np.floor((places - self._origin) / _CELL_M).astype(np.int64)
        keys = cell[:, 0] * self._stride + cell[:, 1]
        keys[(cell < 0).any(1) | (cell[:, 1] >= self._stride)] = -1
        low, high = np.searchsorted(self._keys, keys), np.searchsorted(self._keys, keys, "right")
        count = high - low
        place = np.repeat(np.arange(len(places)), count)
        k = np.arange(len(place)) - np.repeat(np.cumsum(count) - count, count)
        triangle = self._triangle[np.repeat(low, count) + k]
        # Add the large triangles for every place.
        n = len(self._large)
        place = np.concatenate([place, np.repeat(np.arange(len(places)), n)])
        triangle = np.concatenate([triangle, np.tile(self._large, len(places))])
        y = heights_at(places[place], self._corners[triangle])
        met = np.isfinite(y)
        return Hits(place[met], y[met], self._owner[triangle[met]])


def heights_at(places: F64, corners: F64) -> F64:
    """(N,) y of triangles (N, 3, 3) at plan places (N, 2) of the same row; NaN beyond their edges."""
    a, b, c = (corners[:, k][:, [0, 2]] for k in range(3))
    ab, ac, ap = b - a, c - a, places - a
    with np.errstate(divide="ignore", invalid="ignore"):
        det = ab[:, 0] * ac[:, 1] - ab[:, 1] * ac[:, 0]
        s = (ap[:, 0] * ac[:, 1] - ap[:, 1] * ac[:, 0]) / det
        t = (ab[:, 0] * ap[:, 1] - ab[:, 1] * ap[:, 0]) / det
        on_it = (s >= -_EDGE) & (t >= -_EDGE) & (s + t <= 1 + _EDGE)
        y = corners[:, 0, 1] + s * (corners[:, 1, 1] - corners[:, 0, 1])
        y = y + t * (corners[:, 2, 1] - corners[:, 0, 1])
    return np.where(on_it, y, np.nan)
