"""The shading normals that light follows: interpolated, and bent by normal maps; no effects."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F64, I32, HitRecord, UnitVectors
from pbrs_farm.core.house import Geometry, House
from pbrs_farm.core.mesh import triangle_corners, unit_normals
from pbrs_farm.core.normal_maps import normals_from_picture, perturbed_normals, tangents
from pbrs_farm.truth.bilinear import bilinear


def shading_normals(
    hit: HitRecord, house: House, geometry: Geometry, textures: Mapping[str, NDArray[np.uint8]]
) -> UnitVectors:
    """(H, W, 3) unit shading normals with normal maps, turned as the hit's own; (0, 0, 0) = nothing.

    textures: as in LabelInputs; looked up between the four nearest texels, not filtered over the
    pixel. The geometric normals of every other layer stay what they are.
    """
    normals = hit.points.shading_normal_world.copy()
    if not len(geometry.faces):
        return normals
    # Bend material by material: each map is looked up once, for all its pixels.
    material = np.where(hit.valid, geometry.face_material[hit.face], -1)
    for number in np.unique(material[material >= 0]):
        shaded = house.materials[int(number)]
        pixels = textures.get(shaded.normal_texture_id or "") if shaded.shows_maps else None
        if pixels is None or pixels.ndim != 3:
            continue
        mask = material == number
        values = bilinear(pixels[..., :3], hit.points.uv[mask])
        mapped = normals_from_picture(values, shaded.normal_scale).astype(np.float64)
        faces, seen = hit.face[mask], normals[mask].astype(np.float64)
        normals[mask] = _bent(geometry, faces, seen, mapped).astype(np.float32)
    return normals


def _bent(geometry: Geometry, faces: I32, seen: F64, mapped: F64) -> F64:
    """(N, 3) normals seen at faces, bent by the map's; both turned to the camera."""
    corners = triangle_corners(geometry.positions, geometry.faces[faces])
    dp_du, side, is_defined = tangents(
        corners, geometry.uvs[geometry.faces[faces]].astype(np.float64)
    )
    # A map belongs to the front: turn the normals there and back.
    turn = np.where((seen * unit_normals(corners)).sum(1) < 0, -1.0, 1.0)[:, None]
    bent = turn * perturbed_normals(turn * seen, dp_du, side, mapped)
    return np.where(is_defined[:, None], bent, seen)
