"""Outdoor surroundings as light sees them: matte or glossy surfaces under the sky, kernels.

Rays that leave the home straight from the camera, by mirrors and glass, hit them. For rays scattered by a
rough surface, and for shadow rays, their light is part of a dome averaged over the windows
(`Outside.light_dome`), and they occlude the sun. Their radiance is one bounce: the whole sky by the cosine
(order 2 of spherical harmonics: Ramamoorthi and Hanrahan 2001), the unoccluded sun, and street lamps; a
coat mirrors the sky without its sun; windows of lit rooms are emissive. Air lightens distant objects:
everything is within 60 m, so that haze grows with the square of the distance.
Effects: holds a Mitsuba scene and numbers on the device.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Final, NamedTuple

import drjit as dr
import mitsuba as mi
import numpy as np

from pbrs_farm.core.arrays import F32, F64
from pbrs_farm.core.frames import LM_PER_W, LUMINANCE
from pbrs_farm.core.house import LIT, House
from pbrs_farm.transport.kernels.device_scene import DeviceScene, offset_ray_origin
from pbrs_farm.transport.kernels.packets import colour
from pbrs_farm.transport.kernels.sampler import device_array, opaque3
from pbrs_farm.transport.scene_tables.scene_tables import NO_LAMP, SceneTables
from pbrs_farm.transport.scene_tables.sky import Sky, directions, solid_angles

GLOW_CD_M2: Final = 45.0
"""Luminance of emissive surfaces, times their hue: a room seen through its window at night."""
GLOW_ALBEDO: Final = 0.2
"""Reflectance at which it does so; less shines less."""

STREET_LX: Final = 2.5
"""Illuminance by street lamps on all outdoor surfaces, at any hour: negligible by day."""
STREET_RGB: Final = (1.0, 0.72, 0.42)  # linear, its largest 1

HAZE_M: Final = 105.0
"""Distance at which 1 - 1/e of the radiance is from air: hills at the horizon's ring represent far ones."""

_LOW_SHAPE: Final = (32, 64)  # texels of the sky that coats mirror and that haze has the colour of
_HAZE_UP: Final = 0.12  # sine of the elevation at which haze has the sky's colour
_OPEN_UP: Final = (
    0.02,
    0.45,
)  # sines of the elevations between which a street gives way to the sky
_STREET_SHARE: Final = 0.3  # share of the sky's light reflected by occluders in its place
_LIGHT_SHAPE: Final = (48, 96)  # directions in which windows look
_MAX_WINDOWS: Final = 24
_LEAST_WEIGHT: Final = 1e-4  # of a direction in which no window sees anything but its own home

# Convolution of a clamped cosine with each order of spherical harmonics.
_COSINE: Final = np.array([np.pi, *[2 * np.pi / 3] * 3, *[np.pi / 4] * 5])


class Seen(NamedTuple):
    """Radiance and hit data of a ray into the surroundings."""

    valid: Any  # Bool
    radiance: Any  # Color3f
    albedo: Any  # Color3f


class Outside:
    """The outside of a house under one sky."""

    def __init__(self, tables: SceneTables, house: House, sky: Sky) -> None:
        """tables: of the outside alone, whose materials are the house's."""
        glows = np.array([m.name.startswith(LIT) for m in house.materials])
        material = tables.face_tags & np.uint32(0xFFFF)
        lamp = np.where(glows[material], np.uint32(0), np.uint32(NO_LAMP))
        self.sky = sky
        self._scene = DeviceScene(replace(tables, face_tags=material | (lamp << np.uint32(16))))
        self._coefficients = [opaque3(mi.Color3f, c) for c in sky_harmonics(sky) * _COSINE[:, None]]
        self._sun = opaque3(mi.Vector3f, sky.sun_direction)
        self._sun_irradiance = opaque3(mi.Color3f, sky.sun_irradiance)
        self._shines = dr.opaque(mi.Bool, bool(sky.sun_irradiance.max() > 0))
        street = np.array(STREET_RGB) / (np.array(STREET_RGB) @ LUMINANCE) * STREET_LX / LM_PER_W
        self._street = opaque3(mi.Color3f, street)
        self._glow = dr.opaque(mi.Float, GLOW_CD_M2 / LM_PER_W)
        low = np.zeros((*_LOW_SHAPE, 4), np.float32)
        low[..., :3] = coarse_dome(sky.dome, *_LOW_SHAPE)
        self._low = device_array(mi.Float, low.ravel())
        self._mist = dr.opaque(mi.Float, 1 / HAZE_M)

    @dr.syntax
    def seen(self, home: DeviceScene, o: Any, d: Any, active: Any) -> Seen:
        """Outdoor surface on rays (o, d) that have left the home; valid is False without one."""
        valid, radiance, albedo = mi.Bool(False), mi.Color3f(0), mi.Color3f(0)
        # Branch: packets of lanes whose rays are all at home pass by.
        if active:
            valid, radiance, albedo = self._shown(home, o, d, active)
        return Seen(valid, radiance, albedo)

    @dr.syntax
    def lets_through(self, o: Any, d: Any, active: Any) -> Any:
        """Color3f of light from infinity, direction d, that reaches o past everything outside."""
        clear = mi.Color3f(1)
        if active:
            clear = self._scene.transmittance(o, d, mi.Float(dr.inf), active)
        return clear

    def light_dome(self, home: DeviceScene, portals: F64) -> F32:
        """(H, W, 3) float32 radiance from each direction at the windows, without the sun.

        A texel is the mean of the windows' view in that direction, of sky or surroundings, weighted by their
        projected area and limited by the home's own occlusion: so the total flux equals that of the real view.
        portals: (K, 4, 3) rectangles of windows, metres; without any, the sky's own dome. Runs a kernel
        immediately.
        """
        dome = np.asarray(self.sky.dome, np.float32)
        if not len(portals):
            return dome
        # Look from random places in the windows in directions spread over each texel.
        area = np.linalg.norm(
            np.cross(portals[:, 1] - portals[:, 0], portals[:, 3] - portals[:, 0]), axis=-1
        )
        largest = np.sort(np.argsort(-area, kind="stable")[:_MAX_WINDOWS])
        area, corners = area[largest], portals[largest]
        rng = np.random.default_rng(0)
        n, (rows, columns) = len(corners), _LIGHT_SHAPE
        u = rng.random((n, rows, columns, 4))
        along, up = (
            corners[:, None, None, 1] - corners[:, None, None, 0],
            corners[:, None, None, 3] - corners[:, None, None, 0],
        )
        o = corners[:, None, None, 0] + u[..., :1] * along + u[..., 1:2] * up
        y = np.cos(np.pi * (np.arange(rows)[:, None] + u[..., 2]) / rows)
        phi = 2 * np.pi * (np.arange(columns) + u[..., 3]) / columns
        s = np.sqrt(1 - y * y)
        d = np.stack([s * np.sin(phi), y, -s * np.cos(phi)], -1)
        normal = np.cross(along, up)
        normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
        places, ways = (mi.Point3f(*_columns(o)), mi.Vector3f(*_columns(d)))
        free = home.transmittance(places, ways, mi.Float(dr.inf), mi.Bool(True))
        valid, radiance, _albedo = self._shown(home, places, ways, mi.Bool(True))
        free = dr.max(free)
        dr.eval(valid, radiance, free)
        # Weight the views, and put the surroundings in front of the sky.
        turned = area[:, None, None] * np.abs((normal * d).sum(-1))
        weight = turned * (free.numpy().reshape(turned.shape) + _LEAST_WEIGHT)
        share = weight / weight.sum(0)
        covered = (share * valid.numpy().reshape(turned.shape)).sum(0)
        shown = np.stack([c.numpy().reshape(turned.shape) for c in radiance], -1)
        of_things = (share[..., None] * shown).sum(0)
        row = np.arange(dome.shape[0]) * rows // dome.shape[0]
        column = np.arange(dome.shape[1]) * columns // dome.shape[1]
        cell = np.ix_(row, column)
        return np.asarray(dome * (1 - covered[cell])[..., None] + of_things[cell], np.float32)

    def _shown(self, home: DeviceScene, o: Any, d: Any, active: Any) -> tuple[Any, Any, Any]:
        si = self._scene.intersect_past_holes(o, d, active)
        # The sun, unless the home or the surroundings occlude it.
        cos = dr.dot(si.n, self._sun)
        lit = si.valid & self._shines & (cos > 0) & (dr.dot(si.ng, self._sun) > 0)
        begin = offset_ray_origin(si.p, si.ng)
        clear = self._scene.transmittance(begin, self._sun, mi.Float(dr.inf), lit)
        clear *= home.transmittance(begin, self._sun, mi.Float(dr.inf), lit & (dr.max(clear) > 0))
        irradiance = (
            self._of_sky(si.n)
            + self._street
            + dr.select(lit, self._sun_irradiance * cos * clear, 0)
        )
        coat = dr.select(si.bsdf.alpha > 0, _schlick(si.bsdf.f0, -dr.dot(si.n, d)), 0)
        mirrored = d - 2 * dr.dot(si.n, d) * si.n
        radiance = (1 - coat) * si.bsdf.kd * irradiance * (1 / np.pi)
        radiance += coat * self._mirrored_sky(mirrored, si.valid)
        # Windows of lit rooms are dark by day: an albedo of GLOW_ALBEDO emits fully at night.
        hue = dr.minimum(si.bsdf.kd * (1 / GLOW_ALBEDO), 1)
        radiance += dr.select(si.emitter != NO_LAMP, hue * self._glow, 0)
        # Air before it has the sky's colour over the horizon there.
        clear_air = dr.exp(-dr.square(dr.dot(si.p - o, d) * self._mist))
        level = dr.normalize(mi.Vector3f(d.x, 0, d.z) + mi.Vector3f(0, 0, 1e-6))
        haze = self._low_sky(dr.normalize(level + mi.Vector3f(0, _HAZE_UP, 0)), si.valid)
        radiance = dr.lerp(haze, radiance, clear_air)
        return si.valid, dr.select(si.valid, radiance, 0), si.bsdf.kd

    def _mirrored_sky(self, d: Any, active: Any) -> Any:
        """Color3f mirrored by a coat in direction d: the sky, near the horizon its occluders."""
        low, high = _OPEN_UP
        t = dr.clip((d.y - low) * (1 / (high - low)), 0, 1)
        open_share = dr.lerp(_STREET_SHARE, 1.0, t * t * (3 - 2 * t))
        return self._low_sky(d, active) * open_share

    def _low_sky(self, d: Any, active: Any) -> Any:
        """Color3f radiance of the sky in direction d, blurred, without its sun."""
        rows, columns = _LOW_SHAPE
        x = dr.atan2(d.x, -d.z) * (columns / (2 * np.pi)) + (columns - 0.5)
        y = dr.safe_acos(d.y) * (rows / np.pi) - 0.5
        fx, fy = dr.floor(x), dr.floor(y)
        tx, ty = x - fx, y - fy
        total = mi.Color3f(0)
        for dx, dy in ((0, 0), (1, 0), (0, 1), (1, 1)):
            column = mi.UInt32(mi.Int32(fx) + dx) % columns
            row = mi.UInt32(dr.clip(mi.Int32(fy) + dy, 0, rows - 1))
            texel = dr.gather(mi.Vector4f, self._low, row * columns + column, active)
            total += (tx if dx else 1 - tx) * (ty if dy else 1 - ty) * colour(texel)
        return total

    def _of_sky(self, n: Any) -> Any:
        """Color3f irradiance by the sky of a surface of normal n."""
        total = mi.Color3f(0)
        for value, coefficient in zip(_harmonics(n.x, n.y, n.z), self._coefficients, strict=True):
            total += value * coefficient
        return dr.maximum(total, 0)


def coarse_dome(dome: F32, rows: int, columns: int) -> F64:
    """(rows, columns, 3) mean radiance of a latitude-longitude image (H, W, 3), any size from 2 x 4."""
    row = (np.arange(4 * rows) + 0.5) / (4 * rows) * dome.shape[0]
    column = (np.arange(4 * columns) + 0.5) / (4 * columns) * dome.shape[1]
    fine = np.asarray(dome, np.float64)[np.ix_(row.astype(int), column.astype(int))]
    return np.asarray(fine.reshape(rows, 4, columns, 4, 3).mean((1, 3)))


def _columns(rows: F64) -> list[Any]:
    """Columns of (..., 3) on the device."""
    return [device_array(mi.Float, c.astype(np.float32)) for c in rows.reshape(-1, 3).T]


def _schlick(f0: Any, cos: Any) -> Any:
    t = 1 - dr.clip(cos, 0, 1)
    return f0 + (1 - f0) * (dr.square(dr.square(t)) * t)


def sky_harmonics(sky: Sky) -> F64:
    """(9, 3) coefficients of the dome, its sun left out, in real spherical harmonics of order 2.

    Float64, RGB, the integral of radiance times each basis function over the sphere. Enough for the
    light on matte surfaces (Ramamoorthi and Hanrahan 2001), not for reflections.
    """
    height, width = sky.dome.shape[:2]
    towards = directions(height, width)
    weight = solid_angles(height, width)[:, None]
    values = np.stack(
        np.broadcast_arrays(*_harmonics(towards[..., 0], towards[..., 1], towards[..., 2]))
    )
    dome = np.asarray(sky.dome, np.float64)
    return np.asarray(np.einsum("khw,hwc->kc", values * weight, dome))


def _harmonics(x: Any, y: Any, z: Any) -> tuple[Any, ...]:
    """The nine values at a direction."""
    return (
        0.282095 + 0 * x,
        0.488603 * y,
        0.488603 * z,
        0.488603 * x,
        1.092548 * x * y,
        1.092548 * y * z,
        0.315392 * (3 * z * z - 1),
        1.092548 * x * z,
        0.546274 * (x * x - y * y),
    )
