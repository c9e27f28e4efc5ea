"""Cells of the sun's plane that matter to a view, and tables of the points that they light; kernels.

A ray from the sun through each cell of a plane facing it (sun.py) estimates the value of the cell's light
for a view: its contribution, by a few more rays, to the voxels visited by the pilot's paths. Cells get rays
in proportion to their value. The lit points are grouped by proximity.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import mitsuba as mi
import numpy as np
from scipy.ndimage import uniform_filter
from scipy.spatial import cKDTree

from pbrs_farm.core.arrays import F32, F64, I64
from pbrs_farm.core.frames import LUMINANCE
from pbrs_farm.transport.kernels.arrival_rates import MAX_SUNLIT
from pbrs_farm.transport.kernels.device_scene import DeviceScene
from pbrs_farm.transport.kernels.sampler import device_array
from pbrs_farm.transport.kernels.sun import SunDisc, SunPlane
from pbrs_farm.transport.kernels.sun_rays import (
    ALPHA,
    COS_SUN,
    F0,
    IRRADIANCE,
    PLANE_PDF,
    POINT_FLOATS,
    RADIANCE,
    trace_lit_points,
    value_cells,
)
from pbrs_farm.transport.kernels.voxel_grid import VoxelGrid

_MIN_RAYS, _MAX_RAYS = 1 << 13, 1 << 16  # of a launch
_SAMPLES_A_RAY: Final = 16
_LEAST_LIT: Final = 32  # minimum points of a group
_CELL_SEED: Final = 0x5CE11  # parts the rays that value the cells from those of points
_SMOOTH: Final = 3  # cells, edge of the window over which a cell's worth is averaged
_ROUNDS: Final = 8  # of grouping
_LEAST_RADIUS_M2: Final = 1e-4


@dataclass(frozen=True, slots=True, eq=False)
class UsedCells:
    """How the cells of a plane are used for a view: C cells."""

    plane: SunPlane
    groups: I64  # (C,) group of each, -1 = not used
    shares: F64  # (C,) of the rays that go through each, sum 1, or 0 where no light matters


@dataclass(frozen=True, slots=True, eq=False)
class SunlitTables:
    """Sunlit points, group after group: N points, C cells, G = MAX_SUNLIT groups."""

    plane: SunPlane
    rows: F32  # (N, POINT_FLOATS) of sun_rays.py
    first: I64  # (G + 1,) first point of each group
    cells: F32  # (C, 2) pdf per m2 of the plane, as of a group's points; group
    spheres: F64  # (G, 4) centre, mean square distance from it in m2
    fluxes: F64  # (G,) luminance that a group reflects


def no_points() -> SunlitTables:
    """The tables of a view without any."""
    plane, none = SunPlane(np.array([0.0, 1.0, 0.0]), np.zeros((1, 3))), np.zeros(0, np.int64)
    rows, cells = np.zeros((0, POINT_FLOATS), np.float32), np.zeros((2, 2), np.float32)
    return _tables_of_points(plane, rows, none, cells)


def find_used_cells(scene: DeviceScene, sun: SunDisc, grid: VoxelGrid, vertices: I64) -> UsedCells:
    """The cells whose light matters, by counts (voxels,) of a view's paths, not all 0; by its own seed."""
    # Cover the voxels that paths have been to, as the sun sees them.
    centres = grid.centres()[vertices > 0]
    corners = (np.indices((2, 2, 2)).reshape(3, -1).T - 0.5) * grid.edge_m
    plane = SunPlane(sun.direction, (centres[:, None] + corners).reshape(-1, 3))
    visits = device_array(mi.Float, (vertices / vertices.sum()).astype(np.float32))
    places, worth = value_cells(scene, sun, plane, grid, visits, _CELL_SEED)
    # Let a cell count for its neighbours, too: one ray a cell is a noisy estimate.
    picture = worth.astype(np.float64).reshape(plane.shape)
    smooth = np.asarray(uniform_filter(picture, _SMOOTH, mode="constant"), np.float64).ravel()
    # Round, so that the last bits of a sum never change a picture.
    shares: F64 = np.round(np.maximum(smooth, 0) / max(float(smooth.sum()), 1e-30), 9)
    groups = np.full(plane.n_cells, -1)
    lit, used = np.flatnonzero((worth > 0) & (shares > 0)), np.flatnonzero(shares > 0)
    if not len(lit):
        return UsedCells(plane, groups, np.zeros(plane.n_cells))
    # A cell whose own ray lit nothing goes with the nearest cell on the plane.
    cells = np.stack(np.divmod(np.arange(plane.n_cells), plane.shape[1]), 1).astype(np.float64)
    of_lit = _group_places(places[lit].astype(np.float64), shares[lit])
    groups[used] = of_lit[_nearest_place(cells[used], cells[lit])]
    return UsedCells(plane, groups, shares / shares.sum())


def trace_points(
    scene: DeviceScene, sun: SunDisc, used: UsedCells, n_samples: int, seed: int
) -> SunlitTables:
    """The points that rays through the cells light, other ones for each seed, more for more samples."""
    if used.groups.max() < 0:
        return no_points()
    # Send each cell its share of the rays, in order, so that neighbours are neighbours.
    order = np.argsort(used.groups, kind="stable")
    ends = np.cumsum(used.shares[order])
    n_rays = min(max(n_samples // _SAMPLES_A_RAY, _MIN_RAYS), _MAX_RAYS)
    strata = (np.arange(n_rays) + 0.5) / n_rays * ends[-1]
    cells = order[np.minimum(np.searchsorted(ends, strata), len(order) - 1)]
    # A group's points are drawn among themselves, as often as rays were sent through each cell; a
    # cell too small for a ray is left to the paths.
    area, groups = used.plane.edge_m**2, used.groups[cells]
    sent = np.bincount(groups, minlength=MAX_SUNLIT)
    rays = np.bincount(cells, minlength=used.plane.n_cells)
    is_used = rays > 0
    pdfs = np.zeros(used.plane.n_cells)
    pdfs[is_used] = rays[is_used] / sent[used.groups[is_used]] / area
    on_device = device_array(mi.Float, pdfs.astype(np.float32))
    rows, numbers = trace_lit_points(scene, sun, used.plane, cells, on_device, seed)

    # Of a group's rays only some light a point; each of those is drawn more often for it. Of too
    # few the share is not known.
    lit = np.bincount(groups[numbers], minlength=MAX_SUNLIT)
    scale = np.where(lit >= _LEAST_LIT, sent / np.maximum(lit, 1), 0)
    is_lit = scale[groups[numbers]] > 0
    rows, numbers = rows[is_lit], numbers[is_lit]
    rows[:, PLANE_PDF] *= scale[groups[numbers]]
    table = np.zeros((used.plane.n_cells, 2), np.float32)
    table[is_used, 0] = pdfs[is_used] * scale[used.groups[is_used]]
    table[is_used, 1] = used.groups[is_used]
    return _tables_of_points(used.plane, rows, groups[numbers], table)


def _tables_of_points(plane: SunPlane, rows: F32, groups: I64, cells: F32) -> SunlitTables:
    counts = np.bincount(groups, minlength=MAX_SUNLIT)
    first = np.concatenate([[0], np.cumsum(counts)])
    # Flux of a point: its reflected light over its sampling density.
    often = np.maximum(rows[:, PLANE_PDF] * rows[:, COS_SUN], 1e-12).astype(np.float64)
    by_coat = rows[:, IRRADIANCE] * rows[:, F0] * rows[:, [COS_SUN]] / np.pi
    by_coat *= rows[:, [ALPHA]] > 0
    light = (rows[:, RADIANCE] + by_coat).astype(np.float64) @ LUMINANCE / often
    fluxes = np.bincount(groups, light, MAX_SUNLIT) / np.maximum(counts, 1)
    spheres = np.zeros((MAX_SUNLIT, 4))
    for k in np.flatnonzero(counts):
        places = rows[first[k] : first[k + 1], :3].astype(np.float64)
        spheres[k, :3] = places.mean(0)
        spheres[k, 3] = ((places - spheres[k, :3]) ** 2).sum(1).mean()
    spheres[:, 3] = np.maximum(spheres[:, 3], _LEAST_RADIUS_M2)
    return SunlitTables(plane, rows, first, cells, spheres, fluxes)


def _group_places(places: F64, weights: F64) -> I64:
    """(N,) group of each place, by rounds of k-means from far places on."""
    # Begin at the heaviest place, then each time at that farthest from the others by its weight.
    centres = places[[int(np.argmax(weights))]]
    for _ in range(MAX_SUNLIT - 1):
        away = ((places[:, None] - centres) ** 2).sum(2).min(1)
        centres = np.append(centres, places[[int(np.argmax(away * weights))]], 0)
    for _ in range(_ROUNDS):
        groups = _nearest_place(places, centres)
        total = np.bincount(groups, weights, len(centres))
        for k in np.flatnonzero(total > 0):
            centres[k] = np.average(places[groups == k], axis=0, weights=weights[groups == k])
    return _nearest_place(places, centres)


def _nearest_place(places: F64, others: F64) -> I64:
    """(N,) number of the other place nearest to each."""
    _distance, number = cKDTree(others).query(places)
    return np.asarray(number, np.int64)
