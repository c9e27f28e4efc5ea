"""How often each outdoor technique is chosen, by where a vertex lies; kernels.

The weights of a view hold for all of it. But a window of the next room is worth no shadow ray, and of
the sun only few vertices see anything. So the pilot, which asks for one technique at a time, counts
in voxels of the home its paths' vertices and what light a technique brought the paths there, and each
voxel gets weights of its own (a map of visibility as of Guo et al. 2020, to techniques, not to voxels).
Effects: holds buffers on the device.
"""

from __future__ import annotations

from typing import Any, Final, NamedTuple

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F32, F64
from pbrs_farm.transport.kernels.lamp_guiding import MAX_NEAR, sample_discrete
from pbrs_farm.transport.kernels.sampler import device_array, opaque3
from pbrs_farm.transport.scene_tables.portals import MAX_PORTALS

# The voxels of a home in which a view counts how its light arrives; kernels.
# Effects: holds numbers on the device.


_EDGE_M: Final = 0.5  # of a voxel, longer where a home would have more than _MAX_VOXELS
_MAX_VOXELS: Final = 1 << 16


class VoxelGrid:
    """Cubes that fill a home's box; the kernel is the same for every home."""

    def __init__(self, positions: F32) -> None:
        """positions: (N, 3) of all that there is."""
        low, shape, edge = voxel_grid(positions)
        self.n_voxels, self.edge_m = int(np.prod(shape)), edge
        self._host_low, self._host_shape = low, shape
        self._low, self._scale = opaque3(mi.Vector3f, low), dr.opaque(mi.Float, 1 / edge)
        self._shape = [dr.opaque(mi.UInt32, int(n)) for n in shape]

    def voxel(self, p: Any) -> Any:
        """The number of the voxel of p, the nearest one for a p outside."""
        at = dr.maximum((mi.Vector3f(p) - self._low) * self._scale, 0)
        x, y, z = (dr.minimum(mi.UInt32(at[k]), self._shape[k] - 1) for k in range(3))
        return (x * self._shape[1] + y) * self._shape[2] + z

    def centres(self) -> F64:
        """(voxels, 3) their middles."""
        at = np.indices(tuple(int(n) for n in self._host_shape)).reshape(3, -1).T
        return np.asarray(self._host_low + (at + 0.5) * self.edge_m)

    def with_neighbours(self, rows: NDArray[np.unsignedinteger]) -> NDArray[np.unsignedinteger]:
        """(voxels, K) sums of rows over each voxel and the 26 around it, as far as there are any."""
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
    """(lowest corner, number of voxels along each axis, edge in m) of a grid around positions."""
    # Leave out corners that are not finite: their faces are no part of the scene.
    positions = positions[np.isfinite(positions).all(1)]
    low, high = positions.min(0).astype(np.float64), positions.max(0).astype(np.float64)
    edge = _EDGE_M
    while np.prod(shape := np.floor((high - low) / edge) + 1) > _MAX_VOXELS:
        edge *= 1.25
    return low, shape.astype(np.int64), edge


# How often each outdoor technique is chosen, by where a vertex lies.


MAX_TECHNIQUES: Final = 8  # floats of a row: two packets
# A voxel counts as if it had so many vertices more, lit as those around it are, and these so many more,
# lit as the view's are; and so much of its weights is the view's, for what no vertex has found.
_PRIOR: Final = 4.0
_VIEW_SHARE: Final = 0.2
# What a technique brings counts by its luminance over that of white ground: whole steps of the root, up
# to that of _MOST.
_STEPS: Final = 1024.0
_MOST: Final = 100.0

assert MAX_PORTALS + 2 <= MAX_TECHNIQUES


class TechniqueCounts(NamedTuple):
    """Of vertices at which one technique was asked for alone, by voxel and technique."""

    vertices: Any  # UInt32, (voxels * MAX_TECHNIQUES,)
    brought: Any  # sums of the root of the luminance that it brought the path, in 1 / _STEPS

    def numpy(self) -> NDArray[np.uint32]:
        """(2, voxels, MAX_TECHNIQUES)."""
        return np.stack([x.numpy().reshape(-1, MAX_TECHNIQUES) for x in self])


class OutdoorChoice:
    """The weights of all outdoor techniques in every voxel of a home, for one view."""

    def __init__(self, grid: VoxelGrid, level: float) -> None:
        """level: luminance of white ground under the open sky, > 0, that what is counted goes by."""
        self._grid, self._scale = grid, dr.opaque(mi.Float, 1 / level)
        self.set_weights(np.ones(1))

    def set_weights(self, weights: F64) -> None:
        """Set the weights of a view: (techniques,), or (voxels, techniques); rows sum to 1."""
        rows = np.zeros((self._grid.n_voxels, MAX_TECHNIQUES), np.float32)
        rows[:, : weights.shape[-1]] = weights
        self._rows = device_array(mi.Float, rows.ravel())

    def chances(self, p: Any, active: Any) -> list[Any]:
        """The chance of each technique at p, a list entry each; 0 of those a view does not have."""
        first = self._grid.voxel(p) * (MAX_TECHNIQUES // 4)
        rows = [dr.gather(mi.Vector4f, self._rows, first + k, active) for k in range(2)]
        return [row[k] for row in rows for k in range(4)]

    def no_counts(self) -> TechniqueCounts:
        """Where nothing was counted yet."""
        n = self._grid.n_voxels * MAX_TECHNIQUES
        return TechniqueCounts(dr.zeros(mi.UInt32, n), dr.zeros(mi.UInt32, n))

    def count(
        self, counts: TechniqueCounts, p: Any, technique: Any, active: Any, brought: Any
    ) -> None:
        """Count vertices at p, and the luminance brought to the path there.

        technique: the one that is asked for alone, or less than 0.
        """
        counted = active & (technique >= 0)
        place = self._grid.voxel(p) * MAX_TECHNIQUES + mi.UInt32(dr.maximum(technique, 0))
        # Add in place: a copy for each thread would put the number of voxels into the kernel, and
        # every home would compile one of its own.
        one, mode = mi.UInt32(1), dr.ReduceMode.Direct
        dr.scatter_add(counts.vertices, one, place, counted, mode=mode)
        # The root, so that a few bright vertices do not say all; whole numbers, so that their order
        # changes no sum.
        root = mi.UInt32(_STEPS * dr.sqrt(dr.clip(brought * self._scale, 0, _MOST)) + 0.5)
        dr.scatter_add(counts.brought, root, place, counted & (brought > 0), mode=mode)


def choose_technique(chances: list[Any], u: Any) -> tuple[Any, Any]:
    """(number of a technique, drawn by its chance, u made uniform again)."""
    numbers = [mi.UInt32(k) for k in range(len(chances))]
    return sample_discrete(numbers, chances, mi.Float(1), dr.minimum(u, 1 - 1e-6))


def weights_by_place(weights: F64, counts: NDArray[np.uint32], grid: VoxelGrid) -> F64:
    """(voxels, techniques) weights, each of the view's times how much more light it brings to a voxel.

    weights: (techniques,) of the view. counts: TechniqueCounts.numpy().
    """
    own = counts[..., : len(weights)].astype(np.uint64)
    near_vertices, near_brought = (grid.with_neighbours(rows) for rows in own)
    vertices, brought = own.astype(np.float64)
    everywhere = (brought.sum(0) + 0.5 * _STEPS) / (vertices.sum(0) + 1)
    near = (near_brought + _PRIOR * everywhere) / (near_vertices + _PRIOR)
    here = (brought + _PRIOR * near) / (vertices + _PRIOR)
    # Keep a part of the view's own weights: what is seen from a voxel is known by few vertices.
    rows = weights * here / everywhere
    rows /= rows.sum(1, keepdims=True)
    rows = (1 - _VIEW_SHARE) * rows + _VIEW_SHARE * weights
    return np.asarray(np.round(rows, 6) / np.round(rows, 6).sum(1, keepdims=True))


# How many shadow rays arrive, by where they begin and where they go; kernels.
# What a shadow ray would bring if nothing stood in its way is known before it is cast, whether
# something stands there is not. So the trial of a view (pilot.py) counts in voxels of the home
# the shadow rays of each kind and those that arrived. A kind is an outdoor technique, one of the
# strongest lamps of the view, any other lamp, or a group of sunlit points (sunlight.py).
# Effects: holds buffers on the device.


# Kinds of shadow rays: a row's places. The rest of the last packet of four floats is empty.
FIRST_LAMP: Final = MAX_TECHNIQUES
OTHER_LAMP: Final = FIRST_LAMP + MAX_NEAR
FIRST_SUNLIT: Final = OTHER_LAMP + 4  # rays to sunlit points, group by group
MAX_SUNLIT: Final = 8  # groups
N_KINDS: Final = FIRST_SUNLIT + MAX_SUNLIT
_LEAST_RATE: Final = 0.02


class ArrivalCounts(NamedTuple):
    """Of shadow rays that were cast, by voxel and kind."""

    cast: Any  # UInt32, (voxels * N_KINDS,)
    arrived: Any  # those that met nothing on their way

    def numpy(self) -> NDArray[np.uint32]:
        """(2, voxels, N_KINDS)."""
        return np.stack([x.numpy().reshape(-1, N_KINDS) for x in self])


class ArrivalRates:
    """The share of each kind of shadow rays that arrive from every voxel, for one view."""

    def __init__(self, grid: VoxelGrid) -> None:
        self.grid = grid
        self.set_rates(None)

    def set_rates(self, rates: F64 | None) -> None:
        """Set the rates of a view: (voxels, N_KINDS), None = every ray arrives."""
        rows = np.ones((self.grid.n_voxels, N_KINDS), np.float32)
        if rates is not None:
            rows[:] = rates
        self._rows = device_array(mi.Float, rows.ravel())

    def of_kind(self, p: Any, kind: Any, active: Any) -> Any:
        """The rate of one kind at p."""
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
        """Count shadow rays from p."""
        place = self.grid.voxel(p) * N_KINDS + kind
        # Add in place: a copy for each thread would put the number of voxels into the kernel.
        one, mode = mi.UInt32(1), dr.ReduceMode.Direct
        dr.scatter_add(counts.cast, one, place, is_cast, mode=mode)
        dr.scatter_add(counts.arrived, one, place, is_cast & arrives, mode=mode)


def arrival_rates(counts: NDArray[np.uint32], grid: VoxelGrid) -> F64:
    """(voxels, N_KINDS) share of the rays that arrive, never 0. counts: ArrivalCounts.numpy()."""
    # Of a kind that no ray was of nothing is known.
    rates = np.full(counts.shape[1:], 0.5)
    kinds = np.flatnonzero(counts[0].any(0))
    own = counts[..., kinds]
    near_cast, near_arrived = (grid.with_neighbours(rows) for rows in own)
    cast, arrived = own.astype(np.float64)
    everywhere = (arrived.sum(0) + 0.5) / (cast.sum(0) + 1)
    near = (near_arrived + _PRIOR * everywhere) / (near_cast + _PRIOR)
    here = (arrived + _PRIOR * near) / (cast + _PRIOR)
    # Round, so that the last bits of a quotient never change a picture.
    rates[:, kinds] = np.round(np.maximum(here, _LEAST_RATE), 6)
    return rates
