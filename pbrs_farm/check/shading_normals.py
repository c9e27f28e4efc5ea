"""Normals that light follows, from house.glb: interpolated over the mesh, bent by normal maps (glTF 2.0, 3.9.3); no effects."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.errors import BadInput
from pbrs_farm.images import decode_texture

Floats = NDArray[np.float64]

_BENT_KINDS = ("opaque", "mirror", "shade")  # glass and bulbs stay flat
_LEAST_Z = 0.1  # of a map's unit normal: steeper is noise of the picture
_BYTES = np.arange(256) / 1.0


@dataclass(frozen=True, slots=True, eq=False)
class NormalMaps:
    """The normal maps of a house's materials, decoded when one is looked up."""

    pictures: tuple[tuple[str, bytes] | None, ...]  # of each material: media type and bytes
    scales: NDArray[np.float64]  # (M,) times x and y
    kinds: tuple[str, ...]  # of each material
    decoded: dict[int, NDArray[np.uint8] | None] = field(default_factory=dict)

    def of(self, material: int) -> NDArray[np.uint8] | None:
        """Its picture, (H, W, C); None where it has none that shows."""
        stored = self.pictures[material]
        if stored is None or self.kinds[material] not in _BENT_KINDS:
            return None
        if material not in self.decoded:
            try:
                found = decode_texture(stored[1], f"material {material}", stored[0])
                self.decoded[material] = found if found.ndim == 3 else None
            except BadInput:
                self.decoded[material] = None  # counts as flat
        return self.decoded[material]


def between_corners(weights: Floats, normals: NDArray[np.float32], facing: Floats) -> Floats:
    """(N, 3) unit normals between the corners' (N, 3, 3) by weights (N, 3), on the side of facing.

    Where the corners have none, or cancel out, they are facing.
    """
    mean = np.einsum("nk,nkc->nc", weights, normals.astype(np.float64))
    length = np.linalg.norm(mean, axis=1, keepdims=True)
    smooth = np.where(length > 1e-6, mean / np.maximum(length, 1e-12), facing)
    away = np.einsum("nc,nc->n", smooth, facing) < 0
    return np.where(away[:, None], -smooth, smooth)


def bent(seen: Floats, corners: Floats, uv: Floats, mapped: Floats) -> Floats:
    """(N, 3) normals seen of triangles (N, 3, 3) with uv (N, 3, 2), v down, bent by mapped (N, 3) bytes.

    mapped has x and y times the map's scale after decoding: see `decoded`.
    """
    e1, e2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    up = uv * [1.0, -1.0]
    a, b = up[:, 1] - up[:, 0], up[:, 2] - up[:, 0]
    area = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    known = np.abs(area) > 1e-6 * ((a**2).sum(1) + (b**2).sum(1))
    side = np.sign(area)[:, None]
    along = (b[:, 1:] * e1 - a[:, 1:] * e2) * side
    # A map belongs to the front: turn the normals there and back.
    front = np.cross(e1, e2)
    turn = np.where(np.einsum("nc,nc->n", seen, front) < 0, -1.0, 1.0)[:, None]
    normal = turn * seen
    tangent = along - normal * np.einsum("nc,nc->n", normal, along)[:, None]
    length = np.linalg.norm(tangent, axis=1, keepdims=True)
    tangent = tangent / np.maximum(length, 1e-30)
    across = np.cross(normal, tangent) * side
    out = mapped[:, :1] * tangent + mapped[:, 1:2] * across + mapped[:, 2:] * normal
    out = out / np.maximum(np.linalg.norm(out, axis=1, keepdims=True), 1e-12)
    return np.where(known[:, None] & (length > 1e-20), turn * out, seen)


def decoded(values: Floats, scale: float) -> Floats:
    """(N, 3) unit normals in tangent space of (N, 3) bytes; black ones, which say nothing, are flat."""
    xyz = values * (2 / 255) - 1
    black = (xyz <= -1).all(axis=1)
    xyz[:, :2] *= scale
    xyz[:, 2] = np.maximum(xyz[:, 2], _LEAST_Z * np.maximum(np.hypot(xyz[:, 0], xyz[:, 1]), 1e-6))
    xyz[black] = [0, 0, 1]
    return np.asarray(xyz / np.linalg.norm(xyz, axis=1, keepdims=True))
