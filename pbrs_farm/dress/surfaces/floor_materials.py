"""Floors and ceilings with the materials of their rooms, laid along the walls; no effects."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.house import Item, Surface
from pbrs_farm.dress.textures.families import PatternMaterial


def room_frame(area: BaseGeometry) -> tuple[F64, F64]:
    """(2,) a corner of the room in plan and (2, 2) unit rows along its longer and shorter side."""
    if area.is_empty:
        return np.zeros(2), np.eye(2)
    box = shapely.get_coordinates(shapely.minimum_rotated_rectangle(area))[:4]
    if len(box) < 4:
        return np.zeros(2), np.eye(2)
    sides = box[[1, 2]] - box[[0, 1]]
    lengths = np.linalg.norm(sides, axis=1)
    along = sides[int(lengths.argmax())] / max(float(lengths.max()), 1e-9)
    # Settle which way round, so that the frame does not depend on where the outline begins.
    if along[0] < -1e-9 or (abs(along[0]) < 1e-9 and along[1] < 0):
        along = -along
    across = np.array([-along[1], along[0]])
    axes = np.stack([along, across])
    return np.asarray(axes.T @ (box @ axes.T).min(0)), axes


def laid(item: Item, material: PatternMaterial, area: BaseGeometry, turn_rad: float) -> Item:
    """The floor or ceiling with that material; u along the room's longer side, then turned."""
    origin, axes = room_frame(area)
    c, s = np.cos(turn_rad), np.sin(turn_rad)
    turned = np.array([[c, s], [-s, c]]) @ axes
    return replace(item, surfaces=tuple(_laid(f, material, origin, turned) for f in item.surfaces))


def _laid(surface: Surface, material: PatternMaterial, origin: F64, axes: F64) -> Surface:
    plan = surface.positions[:, [0, 2]].astype(np.float64) - origin
    u, v = (plan @ axes[k] / material.size_m[k] for k in (0, 1))
    # Seen from above x runs right and z towards the viewer: v grows away, against z.
    uvs = np.stack([u, -v], -1).astype(np.float32)
    return replace(surface, uvs=uvs, material=material.number)
