"""The glass among the materials of a SUNCG mirror or dressing table: an MTL has colours alone. No effects."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from typing import Final

import numpy as np

from pbrs_farm.core.classes import DRESSER
from pbrs_farm.core.house import Material, MaterialKind
from pbrs_farm.core.mesh import area_vectors, triangle_corners
from pbrs_farm.read.common.model_cache import ParsedModel
from pbrs_farm.read.mesh.mtl import ObjMaterial

_REFLECTANCE: Final = 0.9
_FLAT_COS: Final = (
    0.98  # minimum cosine between a face's normal and the glass's for the face to be part of it
)
_FLAT_SHARE: Final = 0.45  # least flat share of a material; a pane with back and edges has half
# a dressing table's mirror, in shares of the model
_LEAST_HEIGHT: Final = 0.35  # minimum height of its lower edge over the model's
_MOST_DEPTH: Final = 0.5  # maximum depth of the model above that edge over the whole depth
_LEAST_AREA: Final = 0.08  # minimum area, front and back, over width times height
_TABLES: Final = frozenset(("dressing", "vanity", "makeup"))
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


def mirror_slot_of_table(
    model: ParsedModel, class_words: Collection[str], nyu40: int
) -> int | None:
    """The position in the MTL of the glass of a dressing table's mirror; None without one.

    The pane is upright, faces the front (z), and is part of a piece deeper below. Only the pane has its
    material, which is plain and grey or bluish. A chest of drawers has no such pane.
    """
    if nyu40 != DRESSER and _TABLES.isdisjoint(class_words):
        return None
    points = np.concatenate([m.positions for m in model.meshes])
    low, size = points.min(0), np.ptp(points, axis=0)
    lowest: dict[int, float] = {}
    for mesh, slot in zip(model.meshes, model.slots, strict=True):
        lowest[slot] = min(lowest.get(slot, np.inf), float(mesh.positions[:, 1].min()))
    panes: dict[int, float] = {}
    for slot, (whole, flat_area) in _areas_of_slots(model, 2).items():
        looks = model.mtl[slot] if slot >= 0 else ObjMaterial("")
        above = points[points[:, 1] >= lowest[slot]]
        is_pane = (
            flat_area > _FLAT_SHARE * whole
            and flat_area > _LEAST_AREA * size[0] * size[1]
            and lowest[slot] > low[1] + _LEAST_HEIGHT * size[1]
            and np.ptp(above[:, 2]) < _MOST_DEPTH * size[2]
        )
        is_cool = not looks.map_kd and looks.kd[0] <= looks.kd[2]
        if is_pane and (is_cool or any(word in looks.name.lower() for word in _NAMES)):
            panes[slot] = flat_area
    return max(panes, key=panes.__getitem__, default=None)


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
