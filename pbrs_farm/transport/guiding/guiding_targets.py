"""Face sides that shine in a lamp's light, as targets for guided rays (guide.py); no effects."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from pbrs_farm.transport.kernels.alias_table import alias_rows, sample_alias_table
from pbrs_farm.transport.kernels.device_scene import DeviceScene, offset_ray_origin
from pbrs_farm.transport.kernels.sampler import device_array

BACK: Final = 0x80000000
NO_FACE: Final = 0xFFFFFFFF


@dataclass(frozen=True, slots=True, eq=False)
class GlowTables:
    """Face sides that shine in a lamp's light, lamp by lamp.

    sides: (S,) uint32 face, + BACK for its back. chances: (S,) of each among its lamp's, sum 1.
    pdfs: (S,) per m2. first: (L + 1,) first side of each lamp. shares: (L,) of the lamp's
    light that they send out, 0..1. balls: (L, 4) centre and radius in m of the lamp's inside: the
    bulb and nine tenths of that light; radius 0 = none.
    """

    sides: NDArray[np.uint32]
    chances: NDArray[np.float64]
    pdfs: NDArray[np.float64]
    first: NDArray[np.int64]
    shares: NDArray[np.float64]
    balls: NDArray[np.float64]


class Aim(NamedTuple):
    """A direction towards a glowing side. face: the one that must be met; valid."""

    d: Any
    face: Any
    valid: Any


class Aims:
    """The glowing sides of a scene on the device."""

    def __init__(self, tables: GlowTables) -> None:
        parts = zip(tables.first[:-1], tables.first[1:], strict=True)
        rows = [alias_rows(tables.chances[a:b]) for a, b in parts if b > a]
        alias = np.concatenate([*rows, np.ones((1, 2), np.float32)])
        self._alias = device_array(mi.Float, alias.ravel())
        # Two more, so that it is no array of one, which would be another kernel.
        self._sides = device_array(mi.UInt32, np.append(tables.sides, np.zeros(2, np.uint32)))
        first = np.append(tables.first, tables.first[-1:]).astype(np.uint32)
        self._first = device_array(mi.UInt32, first)

    def aim(
        self, scene: DeviceScene, p_ng: tuple[Any, Any], lamp: Any, u: Any, uv: Any, active: Any
    ) -> Aim:
        """DirectionSample a point on a glowing side of a lamp; p_ng: vertex and face normal there."""
        first = dr.gather(mi.UInt32, self._first, lamp, active)
        count = dr.gather(mi.UInt32, self._first, lamp + 1, active) - first
        active = active & (count > 0)
        k, _u = sample_alias_table(self._alias, first, dr.maximum(count, 1), u, active)
        side = dr.gather(mi.UInt32, self._sides, first + k, active)
        face = side & 0x7FFFFFFF
        q, n = scene.sample_face(face, uv, active)
        # From where the ray will start, or it would miss what is small and near.
        p, ng = p_ng
        begin = offset_ray_origin(p, dr.select(dr.dot(ng, q - p) > 0, ng, -ng))
        d = dr.normalize(q - begin)
        n = dr.select(side >= BACK, -n, n)
        return Aim(d, face, active & (dr.dot(n, d) < 0))


def no_glow(n_lamps: int) -> GlowTables:
    """Nothing glows."""
    none = np.zeros(0)
    return GlowTables(
        none.astype(np.uint32),
        none,
        none,
        np.zeros(n_lamps + 1, np.int64),
        np.zeros(n_lamps),
        np.zeros((n_lamps, 4)),
    )
