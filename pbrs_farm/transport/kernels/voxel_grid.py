"""The voxels of a home in which a view counts how its light arrives; kernels. Effects: holds numbers on the device."""

from __future__ import annotations

from typing import Any, Final

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F32, F64
from pbrs_farm.transport.kernels.sampler import opaque3

_EDGE_M: Final = 0.5  # of a voxel, longer where a home would have more than _MAX_VOXELS
_MAX_VOXELS: Final = 1 << 16


class VoxelGrid:
    """Cubes that fill a home's box, numbered, to count by place; opaque, so that every home has one kernel."""

    def __init__(self, positions: F32) -> None:
        """positions: (N, 3) of all that there is."""
        low, shape, edge = voxel_grid(positions)
        self.n_voxels, self.edge_m = int(np.prod(shape)), edge
        self._host_low, self._host_shape = low, shape
        self._low, self._scale = opaque3(mi.Vector3f, low), dr.opaque(mi.Float, 1 / edge)
        self._shape = [dr.opaque(mi.UInt32, int(n)) for n in shape]

    def voxel(self, p: Any) -> Any:
        """Index of the voxel of p; of the nearest one if p is outside, of the first if p is NaN."""
        place = dr.fmax((mi.Vector3f(p) - self._low) * self._scale, 0)
        x, y, z = (dr.minimum(mi.UInt32(place[k]), self._shape[k] - 1) for k in range(3))
        return (x * self._shape[1] + y) * self._shape[2] + z

    def centres(self) -> F64:
        """(voxels, 3) their middles."""
        cell = np.indices(tuple(int(n) for n in self._host_shape)).reshape(3, -1).T
        return np.asarray(self._host_low + (cell + 0.5) * self.edge_m)

    def with_neighbours(self, rows: NDArray[np.unsignedinteger]) -> NDArray[np.unsignedinteger]:
        """(voxels, K) sums of unsigned rows (voxels, K) over each voxel and its neighbours; may wrap around."""
        sums = rows.reshape(*self._host_shape, -1)
        for axis in range(3):
            # Add the voxels before and behind, axis by axis.
            alone, total = np.moveaxis(sums, axis, 0), sums.copy()
            along = np.moveaxis(total, axis, 0)
            along[:-1] += alone[1:]
            along[1:] += alone[:-1]
            sums = total
        return sums.reshape(rows.shape)


def voxel_grid(positions: F32) -> tuple[F64, NDArray[np.int64], float]:
    """(lowest corner, number of voxels along each axis, edge in m) of a grid around positions.

    positions: (V, 3) float32, rows that are not finite are left out, at least one is. The edge
    grows by quarters until there are at most _MAX_VOXELS.
    """
    # Leave out corners that are not finite: their faces are no part of the scene.
    positions = positions[np.isfinite(positions).all(1)]
    low, high = positions.min(0).astype(np.float64), positions.max(0).astype(np.float64)
    edge = _EDGE_M
    while np.prod(shape := np.floor((high - low) / edge) + 1) > _MAX_VOXELS:
        edge *= 1.25
    return low, shape.astype(np.int64), edge
