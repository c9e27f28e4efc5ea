"""Sunlit points: surfaces that the sun shines on, to which shadow rays are sent as to a lamp; kernels.

A shadow ray (direct_light.py) takes over a share of the sunlight that paths would bring by chance; `share_of_sun`
says which, so that no light is lost or counted twice. Effects: holds buffers on the device.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import drjit as dr
import mitsuba as mi
import numpy as np

from pbrs_farm.core.arrays import I64
from pbrs_farm.transport.kernels.arrival_rates import FIRST_SUNLIT, MAX_SUNLIT, ArrivalRates
from pbrs_farm.transport.kernels.bsdf import coat_reflection, diffuse_response
from pbrs_farm.transport.kernels.device_scene import LEAST_COS, DeviceScene, SurfaceInteraction
from pbrs_farm.transport.kernels.lamp_guiding import sample_discrete
from pbrs_farm.transport.kernels.packets import colour, gather_packets, point, vector
from pbrs_farm.transport.kernels.sampler import device_array, opaque3
from pbrs_farm.transport.kernels.sun import SunDisc
from pbrs_farm.transport.kernels.sun_rays import ALPHA, COS_SUN, PLANE_PDF, POINT_FLOATS
from pbrs_farm.transport.kernels.sunlit_tables import (
    SunlitTables,
    UsedCells,
    find_used_cells,
    no_points,
    trace_points,
)
from pbrs_farm.transport.kernels.voxel_grid import VoxelGrid


class SunlitSample(NamedTuple):
    """A sunlit point as a vertex sees it."""

    d: Any  # unit Vector3f
    distance: Any
    radiance: Any  # Color3f that it reflects
    pdf: Any  # per solid angle
    valid: Any
    kind: Any  # UInt32, of arrival_rates.py
    emitter: Any = None


class _Point(NamedTuple):
    """A point that the sun may shine on, as both techniques know it."""

    ng: Any  # unit normal of the face, on the sun's side
    n: Any  # unit shading normal, the same side
    cos_sun: Any  # of ng to the direction in which the sun is seen
    plane_pdf: Any  # per m2 of the plane, among its group


class _Group(NamedTuple):
    """A group of points, as numbers that all lanes share."""

    centre: Any
    square_radius: Any  # m2
    flux: Any


class SunlitPoints:
    """The sunlit points of a view on the device."""

    def __init__(self, grid: VoxelGrid, arrival: ArrivalRates) -> None:
        self._grid, self._arrival = grid, arrival
        self._vertices: I64 | None = None
        self._used: UsedCells | None = None
        self._traced: tuple[I64 | None, int, int] = None, 0, 0  # what the points were traced for
        self._set_points(no_points())

    def set_view(self, vertices: I64 | None) -> None:
        """Set (voxels,) how many vertices the paths of a view have in each; None = no points."""
        if vertices is not self._vertices:
            self._vertices, self._used = vertices, None

    def choose_cells(self, scene: DeviceScene, sun: SunDisc) -> None:
        """Find once for a view which cells of the sun's plane its points come from."""
        vertices = self._vertices
        if self._used is None and sun.shines and vertices is not None and vertices.any():
            self._used = find_used_cells(scene, sun, self._grid, vertices)

    def trace(self, scene: DeviceScene, sun: SunDisc, n_samples: int, seed: int) -> None:
        """Trace rays from the sun for a launch of n_samples, different ones for each seed; 0 = no points.

        Does nothing if view, n_samples and seed equal those of the last call. Call it before the launch that
        uses the points: it runs separate kernels.
        """
        vertices = self._vertices if n_samples > 0 and sun.shines else None
        before, self._traced = self._traced, (vertices, n_samples, seed)
        if vertices is None or not vertices.any():
            if before[0] is not None:
                self._set_points(no_points())
        elif vertices is not before[0] or (n_samples, seed) != before[1:]:
            self.choose_cells(scene, sun)
            assert self._used is not None
            self._set_points(trace_points(scene, sun, self._used, n_samples, seed))

    def chances(self, p: Any, active: Any) -> list[Any]:
        """The probability of each group at p, one list entry each; all 0 without points."""
        rates = self._arrival.of_sunlit(p, active)
        weights, total = [], mi.Float(0)
        for group, rate in zip(self._groups, rates, strict=True):
            closeness = dr.rcp(dr.squared_norm(group.centre - p) + group.square_radius)
            weights.append(group.flux * rate * closeness)
            total += weights[-1]
        return [weight / dr.maximum(total, 1e-30) for weight in weights]

    def sample(self, p: Any, u: Any, active: Any) -> SunlitSample:
        """One of the points as seen from p, by u in [0, 1); radiance before occlusion; not valid without points."""
        # Choose a group, then one of its points; both in order, so that u's strata are places.
        chances = self.chances(p, active)
        total = sum(chances, mi.Float(0))
        numbers = [mi.UInt32(k) for k in range(MAX_SUNLIT)]
        number, rest = sample_discrete(numbers, chances, total, u)
        chance, _rest = sample_discrete(chances, chances, total, u)
        first = dr.gather(mi.UInt32, self._first, number, active)
        count = dr.gather(mi.UInt32, self._first, number + 1, active) - first
        active = active & (total > 0) & (count > 0)
        index = first + dr.minimum(mi.UInt32(rest * mi.Float(count)), count - 1)
        rows = gather_packets(self._rows, index, POINT_FLOATS // 4, active)

        # Evaluate its reflection towards p.
        to = point(rows[0]) - p
        distance = dr.norm(to)
        d = to / distance
        y = _Point(vector(rows[1]), vector(rows[2]), rows[0][COS_SUN], rows[1][PLANE_PDF % 4])
        alpha, f0 = rows[ALPHA // 4][3], mi.Color3f(rows[3][3], rows[4][3], rows[5][3])
        radiance = colour(rows[3]) * diffuse_response(alpha > 0, dr.maximum(-dr.dot(y.n, d), 0))
        frame = mi.Frame3f(y.n)
        wi, wo = frame.to_local(-d), frame.to_local(vector(rows[4]))
        has_coat = (alpha > 0) & (wi.z > 0) & (wo.z > 0)
        by_coat = coat_reflection(f0, alpha, wi, wo) * colour(rows[5])
        radiance += dr.select(has_coat, by_coat, 0)
        pdf = chance * _pdf(y, -d, distance)
        valid = active & (pdf > 0) & (distance > 1e-4)
        return SunlitSample(d, distance, radiance, pdf, valid, number + FIRST_SUNLIT)

    def share_of_sun(
        self, ray: tuple[Any, Any], si: SurfaceInteraction, d: Any, active: Any
    ) -> Any:
        """Share of the sun's light reflected by si that sample() takes over.

        ray: to si: its origin, and the pdf per solid angle of the surface there, 0 = a mirror or the camera.
        d: unit direction to the sun.
        """
        p, p_bsdf = ray
        cell, inside = self._plane.cell(si.p, d)
        active = active & inside & (p_bsdf > 0) & (dr.max(si.bsdf.tau) <= 0)
        row = dr.gather(mi.Vector2f, self._cells, cell, active)
        chance, number = mi.Float(0), mi.UInt32(row[1])
        for k, p_other in enumerate(self.chances(p, active)):
            chance = dr.select(number == k, p_other, chance)
        y = _Point(si.ng, si.n_interpolated, dr.dot(si.ng, d), row[0])
        to = p - si.p
        distance = dr.norm(to)
        pdf = chance * _pdf(y, to / distance, distance)
        return dr.select(active & (pdf > 0), pdf / (pdf + p_bsdf), 0)

    def _set_points(self, tables: SunlitTables) -> None:
        # One point more, so that a view without any has a row, too.
        rows = np.append(tables.rows, np.zeros((1, POINT_FLOATS), np.float32), 0)
        self._plane = tables.plane
        self._rows = device_array(mi.Float, rows.ravel())
        self._first = device_array(mi.UInt32, tables.first.astype(np.uint32))
        self._cells = device_array(mi.Float, tables.cells.ravel())
        self._groups = [
            _Group(
                opaque3(mi.Point3f, sphere[:3]),
                dr.opaque(mi.Float, float(sphere[3])),
                dr.opaque(mi.Float, float(flux)),
            )
            for sphere, flux in zip(tables.spheres, tables.fluxes, strict=True)
        ]


def _pdf(y: _Point, w: Any, distance: Any) -> Any:
    """Pdf of y per solid angle at a vertex in direction w from it, by its group; 0 = not drawn so."""
    cos = dr.dot(y.ng, w)
    # Skip points whose shading normal would be bent, depending on the viewer.
    drawn = (cos > 1e-4) & (dr.dot(y.n, w) > LEAST_COS) & (y.cos_sun > 0)
    return dr.select(drawn, y.plane_pdf * y.cos_sun * dr.square(distance) / cos, 0)
