"""Arrival rates of shadow rays, by origin and target; kernels.

The unoccluded contribution of a shadow ray is known before it is cast; its visibility is not. So the
trial of a view (pilot.py) counts cast and unoccluded shadow rays of each kind in voxels of the home. A
kind is an outdoor technique, one of the strongest lamps of the view, any other lamp, or a group of
sunlit points (sunlit_points.py).
Effects: holds buffers on the device.
"""

from __future__ import annotations

from typing import Any, Final, NamedTuple

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F64
from pbrs_farm.transport.kernels.lamp_guiding import MAX_NEAR
from pbrs_farm.transport.kernels.outdoor_choice import MAX_TECHNIQUES, PRIOR_VERTICES
from pbrs_farm.transport.kernels.sampler import device_array
from pbrs_farm.transport.kernels.voxel_grid import VoxelGrid

# Kinds of shadow rays: a row's places. The rest of the last packet of four floats is empty.
FIRST_LAMP: Final = MAX_TECHNIQUES
OTHER_LAMP: Final = FIRST_LAMP + MAX_NEAR
FIRST_SUNLIT: Final = OTHER_LAMP + 4  # rays to sunlit points, group by group
MAX_SUNLIT: Final = 8  # groups
N_KINDS: Final = FIRST_SUNLIT + MAX_SUNLIT
_MIN_RATE: Final = 0.02


class ArrivalCounts(NamedTuple):
    """Counts of cast and of unoccluded shadow rays, by voxel and kind."""

    cast: Any  # UInt32, (voxels * N_KINDS,)
    arrived: Any  # those that met nothing on their way

    def numpy(self) -> NDArray[np.uint32]:
        """(2, voxels, N_KINDS) uint32; row 0 counts cast rays, row 1 unoccluded ones; waits for the kernel."""
        return np.stack([x.numpy().reshape(-1, N_KINDS) for x in self])


class ArrivalRates:
    """The share of each kind of shadow rays that arrive from every voxel, for one view."""

    def __init__(self, grid: VoxelGrid) -> None:
        self.grid = grid
        self.set_rates(None)

    def set_rates(self, rates: F64 | None) -> None:
        """Set the rates of a view, (voxels, N_KINDS) in (0, 1]; None = every ray arrives. Compiles nothing."""
        rows = np.ones((self.grid.n_voxels, N_KINDS), np.float32)
        if rates is not None:
            rows[:] = rates
        self._rows = device_array(mi.Float, rows.ravel())

    def of_kind(self, p: Any, kind: Any, active: Any) -> Any:
        """The rate of one kind (UInt32 below N_KINDS) at p."""
        return dr.gather(mi.Float, self._rows, self.grid.voxel(p) * N_KINDS + kind, active)

    def of_near_lamps(self, p: Any, active: Any) -> list[Any]:
        """The rates of the strongest lamps at p, a list entry each."""
        return self._of_kinds(p, FIRST_LAMP, MAX_NEAR, active)

    def of_sunlit(self, p: Any, active: Any) -> list[Any]:
        """The rates of each group of sunlit points at p, a list entry each."""
        return self._of_kinds(p, FIRST_SUNLIT, MAX_SUNLIT, active)

    def _of_kinds(self, p: Any, kind: int, n: int, active: Any) -> list[Any]:
        first = self.grid.voxel(p) * (N_KINDS // 4) + kind // 4
        rows = [dr.gather(mi.Vector4f, self._rows, first + k, active) for k in range(n // 4)]
        return [row[k] for row in rows for k in range(4)]

    def no_counts(self) -> ArrivalCounts:
        """Where nothing was counted yet."""
        n = self.grid.n_voxels * N_KINDS
        return ArrivalCounts(dr.zeros(mi.UInt32, n), dr.zeros(mi.UInt32, n))

    def count(self, counts: ArrivalCounts, p: Any, kind: Any, is_cast: Any, arrives: Any) -> None:
        """Count shadow rays from p, atomically; is_cast, arrives: Bool of each lane."""
        place = self.grid.voxel(p) * N_KINDS + kind
        # Add in place: a copy for each thread would put the number of voxels into the kernel.
        unit, mode = mi.UInt32(1), dr.ReduceMode.Direct
        dr.scatter_add(counts.cast, unit, place, is_cast, mode=mode)
        dr.scatter_add(counts.arrived, unit, place, is_cast & arrives, mode=mode)


def arrival_rates(counts: NDArray[np.uint32], grid: VoxelGrid) -> F64:
    """(voxels, N_KINDS) share of the rays that arrive, never 0. counts: ArrivalCounts.numpy().

    Each voxel's rate is drawn towards that of its 26 neighbours and this to the house's,
    PRIOR_VERTICES strong, since few rays start in a voxel. Kinds without any ray get 0.5. Rounded
    to six digits, so that pictures do not depend on the last bits.
    """
    # Of a kind that no ray was of nothing is known.
    rates = np.full(counts.shape[1:], 0.5)
    kinds = np.flatnonzero(counts[0].any(0))
    own_counts = counts[..., kinds]
    near_cast, near_arrived = (grid.with_neighbours(rows) for rows in own_counts)
    cast, arrived = own_counts.astype(np.float64)
    everywhere = (arrived.sum(0) + 0.5) / (cast.sum(0) + 1)
    near = (near_arrived + PRIOR_VERTICES * everywhere) / (near_cast + PRIOR_VERTICES)
    rate = (arrived + PRIOR_VERTICES * near) / (cast + PRIOR_VERTICES)
    # Round, so that the last bits of a quotient never change a picture.
    rates[:, kinds] = np.round(np.maximum(rate, _MIN_RATE), 6)
    return rates
