"""What lies before the windows, as light sees it: matte surfaces under the sky, kernels.

A ray that leaves the home straight from the camera, by mirrors and glass, shows them; one that a rough
surface has scattered, and every shadow ray, does not meet them, so that they change no light in a room.
Their radiance is that of one bounce: the whole sky by the cosine (order 2 of spherical harmonics:
Ramamoorthi and Hanrahan 2001), the sun where nothing shades it, and street lamps; windows of lit rooms
shine by themselves.
Effects: holds a Mitsuba scene and numbers on the device.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Final, NamedTuple

import drjit as dr
import mitsuba as mi
import numpy as np

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.frames import LM_PER_W, LUMINANCE
from pbrs_farm.core.house import LIT, House
from pbrs_farm.transport.kernels.device_scene import DeviceScene, offset_ray_origin
from pbrs_farm.transport.kernels.sampler import opaque3
from pbrs_farm.transport.scene_tables.scene_tables import NO_LAMP, SceneTables
from pbrs_farm.transport.scene_tables.sky import Sky, directions, solid_angles

GLOW_CD_M2: Final = 45.0
"""Luminance of what shines by itself, times its hue: a room seen through its window at night."""

STREET_LX: Final = 2.5
"""Of street lamps on whatever lies outside, at any hour: by day it cannot be seen."""
STREET_RGB: Final = (1.0, 0.72, 0.42)  # linear, its largest 1

# Convolution of a clamped cosine with each order of spherical harmonics.
_COSINE: Final = np.array([np.pi, *[2 * np.pi / 3] * 3, *[np.pi / 4] * 5])


class Seen(NamedTuple):
    """What a ray shows of the outside."""

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
        self._scene = DeviceScene(replace(tables, face_tags=material | (lamp << np.uint32(16))))
        self._coefficients = [opaque3(mi.Color3f, c) for c in sky_harmonics(sky) * _COSINE[:, None]]
        self._sun = opaque3(mi.Vector3f, sky.sun_direction)
        self._sun_irradiance = opaque3(mi.Color3f, sky.sun_irradiance)
        self._shines = dr.opaque(mi.Bool, bool(sky.sun_irradiance.max() > 0))
        street = np.array(STREET_RGB) / (np.array(STREET_RGB) @ LUMINANCE) * STREET_LX / LM_PER_W
        self._street = opaque3(mi.Color3f, street)
        self._glow = dr.opaque(mi.Float, GLOW_CD_M2 / LM_PER_W)

    @dr.syntax
    def seen(self, home: DeviceScene, o: Any, d: Any, active: Any) -> Seen:
        """What rays show that have left the home.

        o: Point3f, d: unit Vector3f of rays that met nothing at home. valid is False where a ray
        meets nothing outside, and for lanes that are not active.
        """
        valid, radiance, albedo = mi.Bool(False), mi.Color3f(0), mi.Color3f(0)
        # Branch: packets of lanes whose rays are all at home pass by.
        if active:
            valid, radiance, albedo = self._shown(home, o, d, active)
        return Seen(valid, radiance, albedo)

    def _shown(self, home: DeviceScene, o: Any, d: Any, active: Any) -> tuple[Any, Any, Any]:
        si = self._scene.intersect_past_holes(o, d, active)
        # The sun, unless the home or the outside stands before it.
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
        radiance = si.bsdf.kd * irradiance * (1 / np.pi)
        # Glass that a lit room stands behind is dark by day: its colour alone counts at night.
        hue = si.bsdf.kd / dr.maximum(dr.max(si.bsdf.kd), 1e-6)
        radiance += dr.select(si.emitter != NO_LAMP, hue * self._glow, 0)
        return si.valid, dr.select(si.valid, radiance, 0), si.bsdf.kd

    def _of_sky(self, n: Any) -> Any:
        """Color3f irradiance by the sky of a surface of normal n."""
        total = mi.Color3f(0)
        for value, coefficient in zip(_harmonics(n.x, n.y, n.z), self._coefficients, strict=True):
            total += value * coefficient
        return dr.maximum(total, 0)


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
        0.282095 + 0 * x, 0.488603 * y, 0.488603 * z, 0.488603 * x, 1.092548 * x * y, 1.092548 * y * z,
        0.315392 * (3 * z * z - 1), 1.092548 * x * z, 0.546274 * (x * x - y * y),
    )  # fmt: skip
