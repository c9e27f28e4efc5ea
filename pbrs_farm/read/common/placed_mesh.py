"""Meshes of a model's own frame -> surfaces and boxes in the world; no effects."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from pbrs_farm.core.arrays import F32, F64, triple
from pbrs_farm.core.frames import transform_points
from pbrs_farm.core.house import Box, Item, LightPart, Surface
from pbrs_farm.core.lighting import BULB_RADIUS_M, PowerUnit
from pbrs_farm.core.mesh import face_areas, triangle_corners
from pbrs_farm.read.mesh.obj import Mesh

_MIN_AREA_M2 = 0.5e-12  # below it float32 cannot tell a triangle from a line
# Flux of a lamp whose strength the scene does not tell: a 60 W incandescent bulb's.
ASSUMED_LM: Final = 800.0


def placed(mesh: Mesh, world_from_model: F64, *, name: str, material: int) -> Surface | None:
    """A mesh as a Surface in the world, fronts kept in front; None if no area is left."""
    world = transform_points(world_from_model, mesh.positions).astype(np.float32)
    faces = mesh.faces
    if np.linalg.det(world_from_model[:3, :3]) < 0:
        faces = faces[:, ::-1]
    # Measure what float32 has left of them.
    faces = faces[face_areas(triangle_corners(world, faces)) > _MIN_AREA_M2]
    if not len(faces):
        return None
    return Surface(
        name=name,
        positions=world,
        faces=np.ascontiguousarray(faces),
        material=material,
        uvs=None if mesh.uvs is None else mesh.uvs.astype(np.float32),
        normals=_normals(mesh.normals, world_from_model),
    )


def mesh_of_surface(surface: Surface) -> Mesh:
    """A surface of a model's own frame as a mesh, flat where it has no normals."""
    n, uvs = surface.normals, surface.uvs
    return Mesh(
        "",
        surface.name,
        surface.positions.astype(np.float64),
        surface.faces,
        None if uvs is None else uvs.astype(np.float64),
        np.zeros((len(surface.positions), 3)) if n is None else n.astype(np.float64),
    )


def _normals(normals: F64, world_from_model: F64) -> F32 | None:
    """Unit normals by the inverse transpose, or None (flat) if one is zero."""
    n = normals @ np.linalg.inv(world_from_model[:3, :3])
    length = np.linalg.norm(n, axis=1, keepdims=True)
    if (length < 1e-12).any():
        return None
    unit: F32 = (n / length).astype(np.float32)
    return unit


def oriented_box(meshes: Sequence[Mesh], world_from_model: F64) -> Box | None:
    """The model's axis-aligned box, placed in the world, right-handed; None where the transform shears."""
    low = np.min([m.positions.min(0) for m in meshes], 0)
    high = np.max([m.positions.max(0) for m in meshes], 0)
    # Part the transform into scale and axes; a shear has no such parts.
    scale = np.linalg.norm(world_from_model[:3, :3], axis=0)
    axes = world_from_model[:3, :3] / scale
    if not np.allclose(axes.T @ axes, np.eye(3), atol=1e-4):
        return None
    if np.linalg.det(axes) < 0:
        # Keep the axes right-handed; a box is symmetric, so nothing moves.
        axes = axes * np.array([-1.0, 1.0, 1.0])
    centre = world_from_model[:3, :3] @ ((low + high) / 2) + world_from_model[:3, 3]
    return Box(centre, scale * (high - low) / 2, axes)


def assumed_light(item: Item) -> LightPart:
    """A light of ASSUMED_LM at the centre of an item that its source only calls a lamp."""
    centre = item.bounds.mean(0)
    return LightPart(triple(centre), BULB_RADIUS_M, ASSUMED_LM, PowerUnit.LUMEN)


def across_last(box: Box) -> Box:
    """The box's axes reordered: its thinnest horizontal axis, a door's front, is +z; tilted boxes unchanged."""
    level = np.flatnonzero(np.abs(box.axes[1]) < 0.1)
    if len(level) != 2:
        return box
    wide, thin = sorted(level, key=lambda k: (-box.half[k], k))
    order = np.array([wide, 3 - wide - thin, thin])
    axes = box.axes[:, order]
    if np.linalg.det(axes) < 0:
        # Keep the axes right-handed.
        axes = axes * np.array([-1.0, 1.0, 1.0])
    return Box(box.centre, box.half[order], axes)
