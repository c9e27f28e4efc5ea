"""Which material of a SUNCG mirror is its glass: its MTL has colours alone. No effects."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from pbrs_farm.core.house import Material, MaterialKind
from pbrs_farm.core.mesh import area_vectors, triangle_corners
from pbrs_farm.read.common.model_cache import ParsedModel

_REFLECTANCE: Final = 0.9
_FLAT_COS: Final = (
    0.98  # minimum cosine between a face's normal and the glass's for the face to be part of it
)
_FLAT_SHARE: Final = 0.45  # least flat share of a material; a pane with back and edges has half
_NAMES: Final = ("mirror", "spiegel", "glass")  # an MTL's names are material_0, material_1 mostly


def mirror_slot(model: ParsedModel) -> int | None:
    """The position in the MTL of a mirror's glass, -1 for meshes without one; None if none is flat.

    The glass faces away from the wall: of the materials that lie flat across the model's thinnest
    level axis the one named so, else the one that shows the largest area.
    """
    # The thinner of the two level axes points out of the wall.
    corners = np.concatenate([m.positions for m in model.meshes])
    extent = np.ptp(corners, axis=0)
    across = 0 if extent[0] < extent[2] else 2
    areas = _areas_of_slots(model, across)
    is_flat = [s for s, (whole, flat_area) in areas.items() if flat_area > _FLAT_SHARE * whole]

    def rank(slot: int) -> tuple[bool, float]:
        name = model.mtl[slot].name.lower() if slot >= 0 else ""
        return any(word in name for word in _NAMES), areas[slot][1]

    return max(is_flat, key=rank, default=None)


def _areas_of_slots(model: ParsedModel, across: int) -> dict[int, list[float]]:
    """Index in the MTL -> total area, and area perpendicular to an axis."""
    areas: dict[int, list[float]] = {}
    for mesh, slot in zip(model.meshes, model.slots, strict=True):
        normals = area_vectors(triangle_corners(mesh.positions, mesh.faces))
        area = np.linalg.norm(normals, axis=1)
        flat = np.abs(normals[:, across]) >= _FLAT_COS * area
        sums = areas.setdefault(slot, [0.0, 0.0])
        sums[0] += float(area.sum())
        sums[1] += float(area[flat].sum())
    return areas


def as_mirror(material: Material) -> Material:
    """The material as a mirror."""
    return replace(
        material,
        kind=MaterialKind.MIRROR,
        specular=(_REFLECTANCE,) * 3,
        texture_id=None,
        opacity=1.0,
        alpha_cutout=False,
    )
