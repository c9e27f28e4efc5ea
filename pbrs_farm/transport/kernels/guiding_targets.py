"""Guiding targets: lit face sides inside lampshades that guided rays aim at; kernels. Effects: holds buffers on the device."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F64, I64
from pbrs_farm.transport.kernels.device_scene import DeviceScene, offset_ray_origin
from pbrs_farm.transport.kernels.sampler import alias_rows, device_array, sample_alias_table

BACK_SIDE: Final = 0x80000000
NO_FACE: Final = 0xFFFFFFFF


@dataclass(frozen=True, slots=True, eq=False)
class GuidingTargets:
    """Face sides that reflect a lamp's light, lamp by lamp: S sides, L lamps."""

    sides: NDArray[np.uint32]  # (S,) face, + BACK_SIDE for its back
    probabilities: F64  # (S,) of each among its lamp's sides, sum 1
    pdfs: F64  # (S,) per m2
    first: I64  # (L + 1,) first side of each lamp
    shares: F64  # (L,) of the lamp's light that its sides send out, 0..1
    interiors: F64  # (L, 4) centre, radius in m around the bulb; radius 0 = none


class TargetSample(NamedTuple):
    """A direction to a guiding target."""

    d: Any  # unit Vector3f
    face: Any  # UInt32, the face that the ray must meet
    valid: Any


class TargetSampler:
    """The guiding targets of a scene on the device."""

    def __init__(self, targets: GuidingTargets) -> None:
        parts = zip(targets.first[:-1], targets.first[1:], strict=True)
        rows = [alias_rows(targets.probabilities[a:b]) for a, b in parts if b > a]
        alias = np.concatenate([*rows, np.ones((1, 2), np.float32)])
        self._alias = device_array(mi.Float, alias.ravel())
        # Two more, so that it is no array of one, which would be another kernel.
        self._sides = device_array(mi.UInt32, np.append(targets.sides, np.zeros(2, np.uint32)))
        first = np.append(targets.first, targets.first[-1:]).astype(np.uint32)
        self._first = device_array(mi.UInt32, first)

    def sample(
        self, scene: DeviceScene, p: Any, ng: Any, lamp: Any, u: Any, uv: Any, active: Any
    ) -> TargetSample:
        """The direction from p, on a face with normal ng, to a point on a target of a lamp.

        lamp: UInt32; valid is False for a lamp without targets and for a side facing away from p. Aims from
        the offset origin of the ray, slightly off the surface.
        """
        # Choose a target of the lamp, then a point on its face.
        first = dr.gather(mi.UInt32, self._first, lamp, active)
        count = dr.gather(mi.UInt32, self._first, lamp + 1, active) - first
        active = active & (count > 0)
        k, _u = sample_alias_table(self._alias, first, dr.maximum(count, 1), u, active)
        side = dr.gather(mi.UInt32, self._sides, first + k, active)
        face = side & (BACK_SIDE - 1)
        q, n = scene.sample_face(face, uv, active)
        # Aim from the ray's offset origin, or it would miss small near targets.
        origin = offset_ray_origin(p, dr.select(dr.dot(ng, q - p) > 0, ng, -ng))
        d = dr.normalize(q - origin)
        n = dr.select(side >= BACK_SIDE, -n, n)
        return TargetSample(d, face, active & (dr.dot(n, d) < 0))


def no_targets(n_lamps: int) -> GuidingTargets:
    """Empty targets, for scenes without lampshades and for views without guiding."""
    none, first = np.zeros(0), np.zeros(n_lamps + 1, np.int64)
    interiors = np.zeros((n_lamps, 4))
    return GuidingTargets(none.astype(np.uint32), none, none, first, np.zeros(n_lamps), interiors)
