"""Probabilities of the outdoor techniques by a vertex's position; kernels.

The view's weights apply to all of it, but a window of the next room deserves no shadow ray, and only few
vertices see the sun. So the pilot, which samples one technique at a time, counts its paths' vertices and
each technique's contribution in voxels of the home, and each voxel gets separate weights (a visibility
map as of Guo et al. 2020, to techniques instead of voxels).
Effects: holds buffers on the device.
"""

from __future__ import annotations

from typing import Any, Final, NamedTuple

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F64
from pbrs_farm.transport.kernels.lamp_guiding import sample_discrete
from pbrs_farm.transport.kernels.sampler import device_array
from pbrs_farm.transport.kernels.voxel_grid import VoxelGrid
from pbrs_farm.transport.scene_tables.portals import MAX_PORTALS

MAX_TECHNIQUES: Final = 8  # floats of a row: two packets
# A voxel counts as if it had so many vertices more, lit as those around it are, and these so many more,
# lit as the view's are; and so much of its weights is the view's, for what no vertex has found.
PRIOR_VERTICES: Final = 4.0
_VIEW_SHARE: Final = 0.2
# A technique's contribution is counted as luminance over that of white ground: integer steps of the
# root, up to that of _MOST.
_STEPS: Final = 1024.0
_MOST: Final = 100.0


assert MAX_PORTALS + 2 <= MAX_TECHNIQUES


class TechniqueCounts(NamedTuple):
    """Of vertices at which one technique was asked for alone, by voxel and technique."""

    vertices: Any  # UInt32, (voxels * MAX_TECHNIQUES,)
    brought: Any  # sums of the root of the luminance that it brought the path, in 1 / _STEPS

    def numpy(self) -> NDArray[np.uint32]:
        """(2, voxels, MAX_TECHNIQUES) uint32, as of ArrivalCounts, but by technique."""
        return np.stack([x.numpy().reshape(-1, MAX_TECHNIQUES) for x in self])


class OutdoorChoice:
    """The weights of all outdoor techniques in every voxel of a home, for one view."""

    def __init__(self, grid: VoxelGrid, level: float) -> None:
        """level: luminance of white ground under the open sky, > 0, the unit of contributions."""
        self.grid, self._scale = grid, dr.opaque(mi.Float, 1 / level)
        self.set_weights(np.ones(1))

    def set_weights(self, weights: F64) -> None:
        """Set a view's weights: (techniques,) or (voxels, techniques), rows sum to 1; compiles nothing."""
        rows = np.zeros((self.grid.n_voxels, MAX_TECHNIQUES), np.float32)
        rows[:, : weights.shape[-1]] = weights
        self._rows = device_array(mi.Float, rows.ravel())

    def chances(self, p: Any, active: Any) -> list[Any]:
        """The chance of each technique at p, a list entry each; 0 of those a view does not have."""
        first = self.grid.voxel(p) * (MAX_TECHNIQUES // 4)
        rows = [dr.gather(mi.Vector4f, self._rows, first + k, active) for k in range(2)]
        return [row[k] for row in rows for k in range(4)]

    def no_counts(self) -> TechniqueCounts:
        """Where nothing was counted yet."""
        n = self.grid.n_voxels * MAX_TECHNIQUES
        return TechniqueCounts(dr.zeros(mi.UInt32, n), dr.zeros(mi.UInt32, n))

    def count(
        self, counts: TechniqueCounts, p: Any, technique: Any, active: Any, brought: Any
    ) -> None:
        """Count vertices at p and the luminance that the only technique sampled (< 0: none) brought there."""
        counted = active & (technique >= 0)
        place = self.grid.voxel(p) * MAX_TECHNIQUES + mi.UInt32(dr.maximum(technique, 0))
        # Add in place: a copy per thread would put the number of voxels into the kernel, and every
        # home
        # would compile a new one.
        unit, mode = mi.UInt32(1), dr.ReduceMode.Direct
        dr.scatter_add(counts.vertices, unit, place, counted, mode=mode)
        # The root, so that a few bright vertices do not say all; whole numbers, so that their order
        # changes no sum.
        root = mi.UInt32(_STEPS * dr.sqrt(dr.clip(brought * self._scale, 0, _MOST)) + 0.5)
        dr.scatter_add(counts.brought, root, place, counted & (brought > 0), mode=mode)


def choose_technique(chances: list[Any], u: Any) -> tuple[Any, Any]:
    """(technique drawn by `OutdoorChoice.chances`, u made uniform again); u: Float in [0, 1)."""
    numbers = [mi.UInt32(k) for k in range(len(chances))]
    return sample_discrete(numbers, chances, mi.Float(1), dr.minimum(u, 1 - 1e-6))


def weights_by_place(weights: F64, counts: NDArray[np.uint32], grid: VoxelGrid) -> F64:
    """(voxels, techniques) weights: the view's (techniques,), times how much more light each brings to a voxel."""
    own_counts = counts[..., : len(weights)].astype(np.uint64)
    near_vertices, near_brought = (grid.with_neighbours(rows) for rows in own_counts)
    vertices, brought = own_counts.astype(np.float64)
    everywhere = (brought.sum(0) + 0.5 * _STEPS) / (vertices.sum(0) + 1)
    near = (near_brought + PRIOR_VERTICES * everywhere) / (near_vertices + PRIOR_VERTICES)
    rate = (brought + PRIOR_VERTICES * near) / (vertices + PRIOR_VERTICES)
    # Mix in the view's weights: the visibility from a voxel is estimated from few vertices.
    rows = weights * rate / everywhere
    rows /= rows.sum(1, keepdims=True)
    rows = (1 - _VIEW_SHARE) * rows + _VIEW_SHARE * weights
    return np.asarray(np.round(rows, 6) / np.round(rows, 6).sum(1, keepdims=True))
