"""Holes that the alpha of a picture cuts into a surface: leaves, lace, gratings; no effects.

Labels, light and OpenGL share the test: alpha, between the four nearest texels, is below the material's
cutoff. `check` has its own code for it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F64, Bools
from pbrs_farm.core.house import Geometry, House
from pbrs_farm.core.resampling import bilinear

_SOLID: Final = np.full((1, 1, 1), 255, np.uint8)  # alpha without a picture


@dataclass(frozen=True, slots=True, eq=False)
class CutOut:
    """The holes of one material."""

    alpha: NDArray[np.uint8]  # (H, W, 1), row 0 = top; it repeats
    cutoff: float  # of alpha 0..1

    def is_hole(self, uv: NDArray[np.floating]) -> Bools:
        """(N,) whether nothing is left of the surface at texture coordinates (N, 2), v up."""
        return np.asarray(bilinear(self.alpha, uv)[:, 0] < 255 * self.cutoff)


CutOuts: TypeAlias = Mapping[int, CutOut]
"""By index in House.materials: those materials that may have holes."""


def cut_outs_by_material(
    house: House, pictures: Mapping[str, NDArray[np.uint8]]
) -> dict[int, CutOut]:
    """The holes of a house's materials.

    pictures: texture id -> (H, W, 3 or 4) uint8, row 0 at the top; those of materials with
    alpha_cutout are looked at. A picture that is not there, or has no alpha, is opaque.
    """
    cut_outs = {}
    for index, material in enumerate(house.materials):
        if material.alpha_cutout:
            picture = pictures.get(material.texture_id or "")
            has_alpha = picture is not None and picture.ndim == 3 and picture.shape[2] == 4
            alpha = picture[..., 3:] if picture is not None and has_alpha else _SOLID
            cut_outs[index] = CutOut(np.ascontiguousarray(alpha), material.alpha_cutoff)
    return {k: c for k, c in cut_outs.items() if c.alpha.min() < 255 * c.cutoff}


def faces_with_holes(geometry: Geometry, cut_outs: CutOuts) -> Bools:
    """(F,) bool: the face's material is among cut_outs."""
    return np.isin(geometry.face_material, list(cut_outs))


def pierced_holes(
    geometry: Geometry, cut_outs: CutOuts, faces: NDArray[np.integer], origins: F64, directions: F64
) -> tuple[F64, Bools]:
    """(N,) distance at which each ray pierces its face's plane, and whether there is a hole there.

    faces: (N,) numbers of faces with holes; origins, directions: (N, 3). Distances are in lengths
    of the directions, computed in double precision; inf where a ray runs along its face.
    """
    corner = geometry.faces[faces]
    a, b, c = (geometry.positions[corner[:, k]].astype(np.float64) for k in range(3))
    n = np.cross(b - a, c - a)
    with np.errstate(divide="ignore", invalid="ignore"):
        t = _dot(a - origins, n) / _dot(directions, n)
        t = np.where(np.isfinite(t), t, np.inf)
        # Weigh the corners by the areas over against them.
        from_a = origins + t[:, None] * directions - a
        squared = _dot(n, n)
        w_b, w_c = (
            _dot(np.cross(from_a, c - a), n) / squared,
            _dot(np.cross(b - a, from_a), n) / squared,
        )
    weights = np.nan_to_num(np.stack([1 - w_b - w_c, w_b, w_c], axis=1), posinf=0, neginf=0)
    uv = np.einsum("nk,nkc->nc", weights, geometry.uvs[corner].astype(np.float64))
    return t, is_hole_at(geometry, cut_outs, faces, uv)


def is_hole_at(geometry: Geometry, cut_outs: CutOuts, faces: NDArray[np.integer], uv: F64) -> Bools:
    """(N,) whether faces (N,) have a hole at texture coordinates (N, 2)."""
    material = geometry.face_material[faces]
    hole = np.zeros(len(faces), np.bool_)
    for index in np.unique(material):
        if int(index) in cut_outs:
            in_material = material == index
            hole[in_material] = cut_outs[int(index)].is_hole(uv[in_material])
    return hole


def _dot(x: F64, y: F64) -> F64:
    return np.asarray(np.einsum("ij,ij->i", x, y))
