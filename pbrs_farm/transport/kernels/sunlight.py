"""The sun: its disc, its rays, the cells of a plane that it shines through, and the points that it shines on; kernels."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import drjit as dr
import mitsuba as mi
import numpy as np
from scipy.ndimage import uniform_filter
from scipy.spatial import cKDTree

from pbrs_farm.core.arrays import F32, F64, I64
from pbrs_farm.core.frames import LUMINANCE
from pbrs_farm.transport.kernels.bsdf import (
    coat_reflection,
    diffuse_reflection,
    diffuse_response,
    luminance,
)
from pbrs_farm.transport.kernels.device_scene import (
    LEAST_COS,
    MAX_TRANSPARENT,
    DeviceScene,
    SurfaceInteraction,
    offset_ray_origin,
)
from pbrs_farm.transport.kernels.lamp_guiding import sample_discrete
from pbrs_farm.transport.kernels.outdoor_choice import (
    FIRST_SUNLIT,
    MAX_SUNLIT,
    ArrivalRates,
    VoxelGrid,
)
from pbrs_farm.transport.kernels.packets import colour, gather_packets, point, rgb, vector, xyz
from pbrs_farm.transport.kernels.sampler import SobolSampler, device_array, opaque3, stream_key
from pbrs_farm.transport.scene_tables.material_rows import GLASS, SURFACE
from pbrs_farm.transport.scene_tables.sky import Sky

# Cells of a plane that the sun shines on squarely: each lane's place there, and what a cell
# holds; kernels.
# Effects: holds buffers on the device.


_EDGE_M: Final = 0.05  # of a cell, longer where there would be more than _MAX_CELLS
_MAX_CELLS: Final = 1 << 15
REACH_M: Final = 200.0  # from the plane to where the sun's rays begin


class SunPlane:
    """Square cells that cover a part of a home as the sun sees it; the kernel is the same for all."""

    def __init__(self, direction: F64, places: F64) -> None:
        """direction: (3,) unit, to the sun. places: (N, 3) that lie on some cell, N >= 1."""
        # Span the plane through the middle of the places.
        middle = places.mean(0)
        helper = np.eye(3)[np.argmin(np.abs(direction))]
        a = np.cross(direction, helper)
        a /= np.linalg.norm(a)
        b = np.cross(direction, a)
        at = (places - middle) @ np.stack([a, b], 1)
        low, size = at.min(0), np.ptp(at, axis=0)
        edge = _EDGE_M
        while np.prod(shape := np.floor(size / edge) + 1) > _MAX_CELLS:
            edge *= 1.1
        self.edge_m, self.shape = edge, (int(shape[0]), int(shape[1]))
        self._a, self._b = opaque3(mi.Vector3f, a), opaque3(mi.Vector3f, b)
        self._n, self._middle = opaque3(mi.Vector3f, direction), opaque3(mi.Point3f, middle)
        self._low = [dr.opaque(mi.Float, float(x)) for x in low]
        self._edge = dr.opaque(mi.Float, edge)
        self._counts = [dr.opaque(mi.UInt32, n) for n in self.shape]

    @property
    def n_cells(self) -> int:
        """The number of cells."""
        return self.shape[0] * self.shape[1]

    def point(self, cell: Any, uv: Any) -> Any:
        """The point of a cell at uv in [0, 1)^2."""
        x = self._low[0] + (mi.Float(cell // self._counts[1]) + uv.x) * self._edge
        y = self._low[1] + (mi.Float(cell % self._counts[1]) + uv.y) * self._edge
        return self._middle + x * self._a + y * self._b

    def cell(self, p: Any, d: Any) -> tuple[Any, Any]:
        """(cell that the line through p in direction d crosses, whether a ray through it may meet p)."""
        to = p - self._middle
        ahead = dr.dot(to, self._n) / dr.dot(d, self._n)
        q = to - d * ahead
        x, y = (
            (dr.dot(q, axis) - low) / self._edge
            for axis, low in zip((self._a, self._b), self._low, strict=True)
        )
        column, row = mi.UInt32(dr.maximum(x, 0)), mi.UInt32(dr.maximum(y, 0))
        inside = (
            (ahead < REACH_M)
            & (x >= 0)
            & (y >= 0)
            & (column < self._counts[0])
            & (row < self._counts[1])
        )
        return column * self._counts[1] + row, inside


# The sun as a disc of even radiance; kernels.
# Effects: holds numbers on the device.


class SunDisc:
    """The sun of a sky on the device."""

    def __init__(self, sky: Sky) -> None:
        cos_max = math.cos(sky.sun_half_angle_rad)
        # The disc's radiance gives its irradiance: integral of the cosine over the cone.
        projected = math.pi * math.sin(sky.sun_half_angle_rad) ** 2
        self.direction = np.asarray(sky.sun_direction, np.float64)  # (3,) unit
        self.shines = bool(sky.sun_irradiance.max() > 0)
        self._frame = mi.Frame3f(opaque3(mi.Vector3f, sky.sun_direction))
        self._cos = dr.opaque(mi.Float, cos_max)
        self._rgb = opaque3(mi.Color3f, sky.sun_irradiance / projected)
        self.pdf = dr.opaque(mi.Float, 1 / (2 * math.pi * (1 - cos_max)))  # of a direction to it

    @property
    def irradiance(self) -> Any:
        """Color3f that a direction drawn to it brings to a surface that faces it."""
        return self._rgb / self.pdf

    def sample(self, uv: Any) -> Any:
        """A unit direction uniform in the disc."""
        warp: Any = mi.warp.square_to_uniform_cone
        return self._frame.to_world(warp(uv, self._cos))

    def radiance(self, d: Any) -> Any:
        """Color3f of the disc in direction d, black beside it."""
        inside = dr.dot(d, self._frame.n) >= self._cos - 1e-7
        return dr.select(inside, self._rgb, 0)


# Rays from the sun to the surfaces that they meet; kernels.


_POINTS, _CELLS = 0xFFFFFFFF, 0xFFFFFFFE  # random streams that no pixel has
_SCATTERED: Final = 8  # rays from a place, to see what its light is worth

# Floats of a point: place, cosine to the sun; face normal, pdf of the ray per m2 of the plane; shading
# normal, roughness of its coat or 0; radiance that it reflects diffusely, less diffuse_response()
# (bsdf.py), direction to the sun, and the sun's irradiance, each with a channel of the coat's f0.
POINT_FLOATS: Final = 24
COS_SUN, PLANE_PDF, ALPHA = 3, 7, 11
RADIANCE, IRRADIANCE = slice(12, 15), slice(20, 23)
F0: Final = [15, 19, 23]


class SunRays(NamedTuple):
    """Where rays from the sun end."""

    si: SurfaceInteraction
    d: Any  # unit direction to the sun
    cos_sun: Any  # to the face's normal
    light: Any  # Color3f, radiance reflected diffusely, less diffuse_response()
    irradiance: Any  # Color3f, of a surface that faces the sun
    lit: Any  # Bool: the sun shines on a surface that scatters and lets nothing through


def sun_rays(scene: DeviceScene, sun: SunDisc, plane: SunPlane, cell: Any, sampler: Any) -> SunRays:
    """A ray through a point of each cell; takes dimensions 0 to 3."""
    through = plane.point(cell, sampler.get_2d(mi.UInt32(0)))
    d = sun.sample(sampler.get_2d(mi.UInt32(2)))
    # Find the first surface that no light goes straight through.
    begin = _behind_glass(scene, through + REACH_M * d, -d)
    si = scene.intersect(begin, -d, mi.Bool(True))
    cos_sun, cos_n = dr.dot(si.ng, d), dr.dot(si.n_interpolated, d)
    is_rough = si.valid & ~si.is_cutout & (si.bsdf.kind == SURFACE)
    may = is_rough & (dr.max(si.bsdf.tau) <= 0) & (cos_sun > 0) & (cos_n > 0)
    clear = scene.transmittance(offset_ray_origin(si.p, si.ng), d, mi.Float(dr.inf), may)
    irradiance = sun.irradiance * clear
    light = diffuse_reflection(si.bsdf, cos_n) * irradiance
    return SunRays(si, d, cos_sun, light, irradiance, may & (dr.max(irradiance) > 0))


def lit_points(
    scene: DeviceScene, sun: SunDisc, plane: SunPlane, cells: Any, pdfs: Any, seed: int
) -> tuple[F32, Any]:
    """(points that rays light (N, POINT_FLOATS), number of each one's ray (N,)).

    cells: (R,) that the rays go through. pdfs: (cells,) of a ray per m2 of the plane.
    """
    key = stream_key(dr.opaque(mi.UInt32, _POINTS), dr.opaque(mi.UInt32, seed & 0xFFFFFFFF))
    sampler = SobolSampler(key, dr.arange(mi.UInt32, len(cells)))
    cell = device_array(mi.UInt32, cells)
    rays = sun_rays(scene, sun, plane, cell, sampler)
    # Keep the cell that the other technique finds: at an edge rounding may say the next one.
    at, inside = plane.cell(rays.si.p, rays.d)
    lit = rays.lit & inside & (at == cell)
    pdf = dr.gather(mi.Float, pdfs, at, lit)
    si, f0 = rays.si, rgb(rays.si.bsdf.f0)
    # Write each point's row, and keep those that are lit.
    normals = *xyz(si.ng), pdf, *xyz(si.n_interpolated), si.bsdf.alpha
    light = *rgb(rays.light), f0[0], *xyz(rays.d), f0[1], *rgb(rays.irradiance), f0[2]
    columns = [*xyz(si.p), rays.cos_sun, *normals, *light]
    lit &= pdf > 0
    dr.eval(lit, *columns)
    keep = np.flatnonzero(lit.numpy())
    rows = np.zeros((len(keep), POINT_FLOATS), np.float32)
    for k, column in enumerate(columns):
        rows[:, k] = column.numpy()[keep]
    return rows, keep


def reached_by_cells(
    scene: DeviceScene, sun: SunDisc, plane: SunPlane, grid: VoxelGrid, wanted: Any, seed: int
) -> tuple[F32, F32]:
    """(places (C, 3) that a ray through each cell lights, worth (C,) of that light).

    wanted: (voxels,) how much light in each of them matters. A point's worth is what it reflects,
    times that of the voxels where it falls.
    """
    key = stream_key(dr.opaque(mi.UInt32, _CELLS), dr.opaque(mi.UInt32, seed & 0xFFFFFFFF))
    cell = dr.arange(mi.UInt32, plane.n_cells)
    sampler = SobolSampler(key, cell)
    rays = sun_rays(scene, sun, plane, cell, sampler)
    worth = _worth_of(scene, grid, wanted, rays.si, sampler, mi.Bool(rays.lit))
    by_coat = rays.irradiance * rays.si.bsdf.f0 * (rays.cos_sun * dr.inv_pi)
    reflected = luminance(rays.light + dr.select(rays.si.bsdf.alpha > 0, by_coat, 0))
    worth *= dr.select(rays.lit, reflected / rays.cos_sun, 0)
    dr.eval(worth, rays.si.p)
    places = np.stack([x.numpy() for x in xyz(rays.si.p)], 1)
    return places, worth.numpy()


@dr.syntax
def _worth_of(
    scene: DeviceScene,
    grid: VoxelGrid,
    wanted: Any,
    si: SurfaceInteraction,
    sampler: Any,
    active: Any,
) -> Any:
    """Mean of wanted over the voxels where rays that scatter from si end."""
    begin, frame = offset_ray_origin(si.p, si.ng), mi.Frame3f(si.ng)
    total, n = mi.Float(0), mi.UInt32(0)
    while active:
        wo = mi.warp.square_to_cosine_hemisphere(sampler.get_2d(4 + 2 * n))
        d = mi.Vector3f(frame.to_world(wo))
        o = _behind_glass(scene, begin, d)
        hit = scene.intersect(o, d, active)
        total += dr.select(hit.valid, dr.gather(mi.Float, wanted, grid.voxel(hit.p), hit.valid), 0)
        n += 1
        active = active & (n < _SCATTERED)
    return total / _SCATTERED


@dr.syntax
def _behind_glass(scene: DeviceScene, o: Any, d: Any) -> Any:
    """Where a ray starts that passes all glass and cut-outs before its first other surface."""
    here, n = mi.Point3f(o), mi.UInt32(0)
    goes_on = dr.full(mi.Bool, True, dr.width(o))
    while goes_on:
        si = scene.intersect(here, d, goes_on)
        passes = goes_on & si.valid & (si.is_cutout | (si.bsdf.kind == GLASS))
        here = dr.select(passes, offset_ray_origin(si.p, -si.ng), here)
        n += 1
        goes_on = passes & (n < MAX_TRANSPARENT)
    return here


# The cells of a plane that sunlight worth having comes through, and the points that it lights;
# kernels.
# A ray from the sun through each cell of a plane that faces it (SunPlane) tells what the
# cell's light is worth to a view: what it brings, by a few rays more, to the voxels that the
# pilot's paths have been to. Cells are worth as many rays. The places that they light are put
# into groups, near ones together.


_MIN_RAYS, _MAX_RAYS = 1 << 13, 1 << 16  # of a launch
_SAMPLES_A_RAY: Final = 16
_LEAST_LIT: Final = 32  # points of a group, or it has none
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
    rows: F32  # (N, POINT_FLOATS) of sunlight.py
    first: I64  # (G + 1,) first point of each group
    cells: F32  # (C, 2) pdf per m2 of the plane, as of a group's points; group
    spheres: F64  # (G, 4) centre, mean square distance from it in m2
    fluxes: F64  # (G,) luminance that a group reflects


def no_points() -> SunlitTables:
    """The tables of a view without any."""
    plane, none = SunPlane(np.array([0.0, 1.0, 0.0]), np.zeros((1, 3))), np.zeros(0, np.int64)
    rows, cells = np.zeros((0, POINT_FLOATS), np.float32), np.zeros((2, 2), np.float32)
    return _tables(plane, rows, none, cells)


def used_cells(scene: DeviceScene, sun: SunDisc, grid: VoxelGrid, vertices: I64) -> UsedCells:
    """The cells whose light matters. vertices: (voxels,) of a view's paths, not all 0."""
    # Cover the voxels that paths have been to, as the sun sees them.
    centres = grid.centres()[vertices > 0]
    corners = (np.indices((2, 2, 2)).reshape(3, -1).T - 0.5) * grid.edge_m
    plane = SunPlane(sun.direction, (centres[:, None] + corners).reshape(-1, 3))
    wanted = device_array(mi.Float, (vertices / vertices.sum()).astype(np.float32))
    places, worth = reached_by_cells(scene, sun, plane, grid, wanted, _CELL_SEED)
    # Let a cell count for its neighbours, too: a ray of each has told little.
    picture = worth.astype(np.float64).reshape(plane.shape)
    smooth = np.asarray(uniform_filter(picture, _SMOOTH, mode="constant"), np.float64).ravel()
    # Round, so that the last bits of a sum never change a picture.
    shares: F64 = np.round(np.maximum(smooth, 0) / max(float(smooth.sum()), 1e-30), 9)
    groups = np.full(plane.n_cells, -1)
    lit, used = np.flatnonzero((worth > 0) & (shares > 0)), np.flatnonzero(shares > 0)
    if not len(lit):
        return UsedCells(plane, groups, np.zeros(plane.n_cells))
    # A cell whose own ray lit nothing goes with the nearest cell on the plane.
    at = np.stack(np.divmod(np.arange(plane.n_cells), plane.shape[1]), 1).astype(np.float64)
    of_lit = _groups_of(places[lit].astype(np.float64), shares[lit])
    groups[used] = of_lit[_nearest(at[used], at[lit])]
    return UsedCells(plane, groups, shares / shares.sum())


def traced_points(
    scene: DeviceScene, sun: SunDisc, used: UsedCells, n_samples: int, seed: int
) -> SunlitTables:
    """The points that rays through the cells light, other ones for each seed.

    n_samples: of the launch that they are for: there are more points for more samples, up to a number.
    """
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
    rows, numbers = lit_points(scene, sun, used.plane, cells, on_device, seed)

    # Of a group's rays only some light a point; each of those is drawn more often for it. Of too
    # few the share is not known.
    lit = np.bincount(groups[numbers], minlength=MAX_SUNLIT)
    scale = np.where(lit >= _LEAST_LIT, sent / np.maximum(lit, 1), 0)
    kept = scale[groups[numbers]] > 0
    rows, numbers = rows[kept], numbers[kept]
    rows[:, PLANE_PDF] *= scale[groups[numbers]]
    table = np.zeros((used.plane.n_cells, 2), np.float32)
    table[is_used, 0] = pdfs[is_used] * scale[used.groups[is_used]]
    table[is_used, 1] = used.groups[is_used]
    return _tables(used.plane, rows, groups[numbers], table)


def _tables(plane: SunPlane, rows: F32, groups: I64, cells: F32) -> SunlitTables:
    counts = np.bincount(groups, minlength=MAX_SUNLIT)
    first = np.concatenate([[0], np.cumsum(counts)])
    # Flux of a point: what it reflects, over how often it is drawn.
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


def _groups_of(places: F64, weights: F64) -> I64:
    """(N,) group of each place, by rounds of k-means from far places on."""
    # Begin at the heaviest place, then each time at that farthest from the others by its weight.
    centres = places[[int(np.argmax(weights))]]
    for _ in range(MAX_SUNLIT - 1):
        away = ((places[:, None] - centres) ** 2).sum(2).min(1)
        centres = np.append(centres, places[[int(np.argmax(away * weights))]], 0)
    for _ in range(_ROUNDS):
        own = _nearest(places, centres)
        total = np.bincount(own, weights, len(centres))
        for k in np.flatnonzero(total > 0):
            centres[k] = np.average(places[own == k], axis=0, weights=weights[own == k])
    return _nearest(places, centres)


def _nearest(places: F64, others: F64) -> I64:
    """(N,) number of the other place nearest to each."""
    _distance, number = cKDTree(others).query(places)
    return np.asarray(number, np.int64)


# Sunlit points.


class SunlitSample(NamedTuple):
    """A sunlit point as a vertex sees it."""

    d: Any  # unit Vector3f
    distance: Any
    radiance: Any  # Color3f that it reflects
    pdf: Any  # per solid angle
    valid: Any
    kind: Any  # UInt32, of outdoor_choice.py
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
            self._used = used_cells(scene, sun, self._grid, vertices)

    def trace(self, scene: DeviceScene, sun: SunDisc, n_samples: int, seed: int) -> None:
        """Trace rays from the sun for a launch of n_samples, other ones for each seed; 0 = no points."""
        vertices = self._vertices if n_samples > 0 and sun.shines else None
        before, self._traced = self._traced, (vertices, n_samples, seed)
        if vertices is None or not vertices.any():
            if before[0] is not None:
                self._set_points(no_points())
        elif vertices is not before[0] or (n_samples, seed) != before[1:]:
            self.choose_cells(scene, sun)
            assert self._used is not None
            self._set_points(traced_points(scene, sun, self._used, n_samples, seed))

    def chances(self, p: Any, active: Any) -> list[Any]:
        """The chance of each group at p, a list entry each; all 0 where there are none."""
        rates = self._arrival.of_sunlit(p, active)
        weights, total = [], mi.Float(0)
        for group, rate in zip(self._groups, rates, strict=True):
            closeness = dr.rcp(dr.squared_norm(group.centre - p) + group.square_radius)
            weights.append(group.flux * rate * closeness)
            total += weights[-1]
        return [weight / dr.maximum(total, 1e-30) for weight in weights]

    def sample(self, p: Any, u: Any, active: Any) -> SunlitSample:
        """One of the points, as it is seen from p."""
        # Choose a group, then one of its points; both in order, so that u's strata are places.
        chances = self.chances(p, active)
        total = sum(chances, mi.Float(0))
        numbers = [mi.UInt32(k) for k in range(MAX_SUNLIT)]
        number, rest = sample_discrete(numbers, chances, total, u)
        chance, _rest = sample_discrete(chances, chances, total, u)
        first = dr.gather(mi.UInt32, self._first, number, active)
        count = dr.gather(mi.UInt32, self._first, number + 1, active) - first
        active = active & (total > 0) & (count > 0)
        at = first + dr.minimum(mi.UInt32(rest * mi.Float(count)), count - 1)
        rows = gather_packets(self._rows, at, POINT_FLOATS // 4, active)

        # Turn what it reflects to p.
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
        """What share sample() takes over of what si reflects of the sun.

        ray: that has met si: where it was drawn, and the pdf per solid angle of the surface there, 0 =
        a mirror or the camera. d: unit direction to the sun.
        """
        p, p_bsdf = ray
        at, inside = self._plane.cell(si.p, d)
        active = active & inside & (p_bsdf > 0) & (dr.max(si.bsdf.tau) <= 0)
        row = dr.gather(mi.Vector2f, self._cells, at, active)
        chance, number = mi.Float(0), mi.UInt32(row[1])
        for k, other in enumerate(self.chances(p, active)):
            chance = dr.select(number == k, other, chance)
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
    # Leave out where the shading normal would be bent, by what it is seen from.
    drawn = (cos > 1e-4) & (dr.dot(y.n, w) > LEAST_COS) & (y.cos_sun > 0)
    return dr.select(drawn, y.plane_pdf * y.cos_sun * dr.square(distance) / cos, 0)
