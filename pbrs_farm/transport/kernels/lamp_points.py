"""Points on lamps, where shadow rays end; kernels. Effects: holds buffers on the device."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from pbrs_farm.transport.kernels.device_scene import DeviceScene
from pbrs_farm.transport.kernels.packets import point
from pbrs_farm.transport.kernels.sampler import alias_rows, device_array, sample_alias_table
from pbrs_farm.transport.scene_tables.scene_tables import SceneTables

if TYPE_CHECKING:
    pass


class LampPointSampler:
    """The triangles of all lamps on the device."""

    def __init__(self, tables: SceneTables) -> None:
        self._first = padded(mi.UInt32, tables.lamp_first, tables.lamp_first[-1:])
        self._faces = padded(mi.UInt32, tables.lamp_faces, np.zeros(1, np.uint32))
        alias = [np.zeros((0, 2), np.float32)] + [
            alias_rows(np.diff(tables.lamp_areas[a:b], prepend=0.0))
            for a, b in zip(tables.lamp_first[:-1], tables.lamp_first[1:], strict=True)
        ]
        self._alias = padded(mi.Float, np.concatenate(alias), np.ones((1, 2), np.float32))
        symmetries = tables.lamp_symmetries.ravel()
        self._symmetries = padded(mi.Float, symmetries, np.zeros(4, np.float32))

    def sample(
        self, scene: DeviceScene, lamp: Any, p: Any, u: Any, uv: Any, active: Any
    ) -> tuple[Any, Any, Any]:
        """(point on a lamp, unit normal there, whether it faces p), uniform over area_share of it.

        p: the receiver. The pdf per area is 1 over the lamp's area times `area_share`; a lamp that is its own
        mirror image is sampled on the half facing p.
        """
        # Choose a triangle by area, and a point on that.
        first = dr.gather(mi.UInt32, self._first, lamp, active)
        count = dr.gather(mi.UInt32, self._first, lamp + 1, active) - first
        triangle, _u = sample_alias_table(self._alias, first, count, u, active)
        face = dr.gather(mi.UInt32, self._faces, first + triangle, active)
        q, n = scene.sample_face(face, uv, active)
        # Take the opposite point of a symmetric lamp where this one is turned away.
        centre, side = self._symmetry(lamp, p, active)
        is_away = dr.dot(n, p - q) * side < 0
        q, n = dr.select(is_away, 2 * centre - q, q), dr.select(is_away, -n, n)
        return q, n, dr.dot(n, p - q) * side >= 0

    def area_share(self, lamp: Any, p: Any, active: Any) -> Any:
        """Share of a lamp's area that points for p are drawn from: half of a symmetric one."""
        _centre, side = self._symmetry(lamp, p, active)
        return dr.select(side != 0, mi.Float(0.5), 1)

    def _symmetry(self, lamp: Any, p: Any, active: Any) -> tuple[Any, Any]:
        """(centre, signed radius of a symmetric lamp around p, or 0)."""
        row = dr.gather(mi.Vector4f, self._symmetries, lamp, active)
        is_outside = dr.squared_norm(p - point(row)) > dr.square(row[3])
        return point(row), dr.select(is_outside, row[3], 0)


def padded(kind: Any, rows: NDArray[Any], last: NDArray[Any]) -> Any:
    """Rows (N, ...) and a last one on the device, flattened: a house without lamps has a row, too."""
    return device_array(kind, np.concatenate([rows, last]).ravel())
