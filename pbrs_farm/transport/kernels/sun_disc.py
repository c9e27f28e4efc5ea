"""The sun as a disc of even radiance; kernels.

Effects: holds numbers on the device.
"""

from __future__ import annotations

import math
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from pbrs_farm.transport.kernels.sampler import opaque3
from pbrs_farm.transport.scene_tables.sky import Sky


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
