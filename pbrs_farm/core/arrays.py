"""Named array types: shape, dtype, unit, special values; no effects."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

F32 = NDArray[np.float32]  # of any shape, and so are the next four: docstrings say which
F64 = NDArray[np.float64]
I32 = NDArray[np.int32]
I64 = NDArray[np.int64]
Bools = NDArray[np.bool_]

# (H, W) uint32: instance id of the item seen through each pixel's centre, 0 = nothing.
ItemBuffer = NDArray[np.uint32]

# (H, W, 3) float32, linear sRGB primaries, W m-2 sr-1; finite and >= 0.
RadianceImage = NDArray[np.float32]

Srgb8Image = NDArray[np.uint8]  # (H, W, 3) uint8, sRGB-encoded
DepthZ = NDArray[np.float32]  # (H, W) float32, metres along the optical axis, 0 = nothing
UnitVectors = NDArray[np.float32]  # (H, W, 3) float32 unit vectors; (0, 0, 0) = nothing
Mask = NDArray[np.bool_]  # (H, W) bool
Points = NDArray[np.float32]  # (N, 3) float32, metres, world frame
Points2 = NDArray[np.float64]  # (N, 2) float64, metres, plan: columns are world x and world z
Matrix4 = NDArray[np.float64]  # (4, 4) float64, affine, column vectors: p_a = a_from_b @ p_b


FirstHit = Callable[[F64, F64], tuple[F32, I32]]
"""Origins and directions (N, 3) -> distance in lengths of the direction, and face (-1 = nothing)."""


def triple(values: NDArray[np.floating]) -> tuple[float, float, float]:
    """Three numbers of an array as Python floats, to compare and hash; ValueError for more or fewer."""
    x, y, z = (float(v) for v in values)
    return (x, y, z)


class SurfacePoints(NamedTuple):
    """Properties of the hit points that only some layers read; 0 = nothing."""

    position_world: NDArray[np.float32]  # (H, W, 3) metres
    shading_normal_world: UnitVectors  # (H, W, 3) interpolated, turned towards the camera
    uv: NDArray[np.float32]  # (H, W, 2) texture coordinates, v up


@dataclass(frozen=True, eq=False)
class HitRecord:
    """First hit of the ray through each pixel's centre: the one source of every label (rule 8)."""

    face: NDArray[np.int32]  # (H, W) index into Geometry.faces, -1 = nothing
    item: ItemBuffer  # (H, W) instance id, 0 = nothing
    depth_z: DepthZ  # (H, W) metres along the optical axis, 0 = nothing
    geo_normal_world: UnitVectors  # (H, W, 3) of the triangle, turned towards the camera
    interpolate: Callable[[], SurfacePoints]  # called once, by the first layer that reads `points`

    @cached_property
    def points(self) -> SurfacePoints:
        """Positions, shading normals and texture coordinates: a third of a record's time, cached."""
        return self.interpolate()

    @property
    def valid(self) -> Mask:
        """(H, W) bool: the pixel sees something."""
        return np.asarray(self.face >= 0)
