"""Rays from the sun to the surfaces that they meet; kernels."""

from __future__ import annotations

from typing import Any, Final, NamedTuple

import drjit as dr
import mitsuba as mi
import numpy as np

from pbrs_farm.core.arrays import F32
from pbrs_farm.transport.kernels.bsdf import diffuse_reflection, luminance
from pbrs_farm.transport.kernels.device_scene import (
    MAX_TRANSPARENT,
    DeviceScene,
    SurfaceInteraction,
    offset_ray_origin,
)
from pbrs_farm.transport.kernels.packets import rgb, xyz
from pbrs_farm.transport.kernels.sampler import SobolSampler, device_array, stream_key
from pbrs_farm.transport.kernels.sun import REACH_M, SunDisc, SunPlane
from pbrs_farm.transport.kernels.voxel_grid import VoxelGrid
from pbrs_farm.transport.scene_tables.material_rows import GLASS, SURFACE

# Floats of a point: place, cosine to the sun; face normal, pdf of the ray per m2 of the plane; shading
# normal, roughness of its coat or 0; radiance that it reflects diffusely, less diffuse_response()
# (bsdf.py), direction to the sun, and the sun's irradiance, each with a channel of the coat's f0.
POINT_FLOATS: Final = 24
COS_SUN, PLANE_PDF, ALPHA = 3, 7, 11
RADIANCE, IRRADIANCE = slice(12, 15), slice(20, 23)
F0: Final = [15, 19, 23]
_POINTS, _CELLS = 0xFFFFFFFF, 0xFFFFFFFE  # random streams that no pixel has
_SCATTERED: Final = 8  # rays from a place, to see what its light is worth


class SunRays(NamedTuple):
    """Where rays from the sun end."""

    si: SurfaceInteraction
    d: Any  # unit direction to the sun
    cos_sun: Any  # to the face's normal
    light: Any  # Color3f, radiance reflected diffusely, less diffuse_response()
    irradiance: Any  # Color3f, of a surface that faces the sun
    lit: Any  # Bool: the sun shines on a surface that scatters and lets nothing through


def trace_sun_rays(
    scene: DeviceScene, sun: SunDisc, plane: SunPlane, cell: Any, sampler: Any
) -> SunRays:
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
    clear *= sun.past_outside(offset_ray_origin(si.p, si.ng), d, may & (dr.max(clear) > 0))
    irradiance = sun.irradiance * clear
    light = diffuse_reflection(si.bsdf, cos_n) * irradiance
    return SunRays(si, d, cos_sun, light, irradiance, may & (dr.max(irradiance) > 0))


def trace_lit_points(
    scene: DeviceScene, sun: SunDisc, plane: SunPlane, cells: Any, pdfs: Any, seed: int
) -> tuple[F32, Any]:
    """(points lit (N, POINT_FLOATS), number of each one's ray (N,)) of rays through cells (R,), by their pdfs."""
    key = stream_key(dr.opaque(mi.UInt32, _POINTS), dr.opaque(mi.UInt32, seed & 0xFFFFFFFF))
    sampler = SobolSampler(key, dr.arange(mi.UInt32, len(cells)))
    cell = device_array(mi.UInt32, cells)
    rays = trace_sun_rays(scene, sun, plane, cell, sampler)
    # Keep the cell that the other technique finds: at an edge rounding may say the next one.
    cells_hit, inside = plane.cell(rays.si.p, rays.d)
    lit = rays.lit & inside & (cells_hit == cell)
    pdf = dr.gather(mi.Float, pdfs, cells_hit, lit)
    si, f0 = rays.si, rgb(rays.si.bsdf.f0)
    # Write each point's row, and keep the lit ones.
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


def value_cells(
    scene: DeviceScene, sun: SunDisc, plane: SunPlane, grid: VoxelGrid, wanted: Any, seed: int
) -> tuple[F32, F32]:
    """(points (C, 3) lit by a ray through each cell, value (C,) of that light by importance wanted (voxels,))."""
    key = stream_key(dr.opaque(mi.UInt32, _CELLS), dr.opaque(mi.UInt32, seed & 0xFFFFFFFF))
    cell = dr.arange(mi.UInt32, plane.n_cells)
    sampler = SobolSampler(key, cell)
    rays = trace_sun_rays(scene, sun, plane, cell, sampler)
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
    # Constants are excluded from the state of the loop, or Dr.Jit traces its code twice.
    while dr.hint(active, exclude=[scene, grid, wanted, sampler, begin, frame]):
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
    start, n = mi.Point3f(o), mi.UInt32(0)
    goes_on = dr.full(mi.Bool, True, dr.width(o))
    while dr.hint(goes_on, exclude=[scene, d]):
        si = scene.intersect(start, d, goes_on)
        passes = goes_on & si.valid & (si.is_cutout | (si.bsdf.kind == GLASS))
        start = dr.select(passes, offset_ray_origin(si.p, -si.ng), start)
        n += 1
        goes_on = passes & (n < MAX_TRANSPARENT)
    return start
