"""A house as one vertex buffer, one index buffer and draw calls; pure numpy, no effects."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F32, F64, I64, Bools
from pbrs_farm.core.house import House, Item, Surface
from pbrs_farm.core.mesh import triangle_corners, unit_normals


@dataclass(frozen=True, slots=True, eq=False)
class DrawMesh:
    """All triangles of a house for OpenGL; a draw is those of one item with one material."""

    vertices: F32  # (V, 8) position (world, m), normal (unit), uv (v up)
    indices: NDArray[np.uint32]  # (F, 3)
    draw_first: I64  # (D,) first triangle
    draw_count: I64  # (D,) number of triangles
    draw_item: I64  # (D,) instance id
    draw_material: I64  # (D,) index into House.materials
    draw_low: F64  # (D, 3) corners of the bounding box in the world
    draw_high: F64
    item_first: I64  # (I + 1,) first vertex of each item, and the end

    @property
    def n_draws(self) -> int:
        """The number of draws."""
        return len(self.draw_first)


def mesh_from_house(house: House) -> DrawMesh:
    """The mesh of every surface, panes too, by instance from 1, without non-finite triangles."""
    vertices: list[F32] = []
    indices: list[NDArray[np.uint32]] = []
    rows: list[tuple[int, int, int, int]] = []
    boxes: list[tuple[F32, F32]] = []
    item_first = [0]
    n_faces = 0

    # Write item by item, and within an item material by material: each pair is one draw.
    for instance, item in enumerate(house.items, start=1):
        n_vertices = item_first[-1]
        for material, v, f in _draws_of_item(item):
            vertices.append(v)
            indices.append((f + n_vertices).astype(np.uint32))
            if len(f):
                boxes.append(_box(v, f))
                rows.append((n_faces, len(f), instance, material))
            n_vertices, n_faces = n_vertices + len(v), n_faces + len(f)
        item_first.append(n_vertices)

    table = np.array(rows, np.int64).reshape(-1, 4)
    box = np.array(boxes, np.float64).reshape(-1, 2, 3)
    return DrawMesh(
        np.concatenate([np.zeros((0, 8), np.float32), *vertices]),
        np.concatenate([np.zeros((0, 3), np.uint32), *indices]),
        table[:, 0],
        table[:, 1],
        table[:, 2],
        table[:, 3],
        box[:, 0],
        box[:, 1],
        np.array(item_first),
    )


def move_item(mesh: DrawMesh, instance: int, item: Item) -> slice:
    """Update a rigidly moved item in the mesh, in place, with its boxes; the rows of changed vertices."""
    draws = _draws_of_item(item)
    rows = slice(*mesh.item_first[instance - 1 : instance + 1].tolist())
    mesh.vertices[rows] = np.concatenate(
        [np.zeros((0, 8), np.float32), *(v for _m, v, _f in draws)]
    )
    boxes = [_box(v, f) for _material, v, f in draws if len(f)]
    numbers = np.flatnonzero(mesh.draw_item == instance)
    for k, (low, high) in zip(numbers, boxes, strict=True):
        mesh.draw_low[k], mesh.draw_high[k] = low, high
    return rows


def _draws_of_item(item: Item) -> list[tuple[int, F32, I64]]:
    """(material, vertices, faces into them) of an item's draws, material by material."""
    draws = []
    for material in dict.fromkeys(s.material for s in item.surfaces):
        vertices, faces, n = [], [], 0
        for surface in item.surfaces:
            if surface.material == material:
                v, f = _vertices(surface)
                vertices.append(v)
                faces.append(f + n)
                n += len(v)
        draws.append((material, np.concatenate(vertices), np.concatenate(faces)))
    return draws


def _box(vertices: F32, faces: I64) -> tuple[F32, F32]:
    points = vertices[faces.reshape(-1), :3]
    return points.min(0), points.max(0)


def _vertices(surface: Surface) -> tuple[F32, I64]:
    """(V, 8) vertices and (F, 3) faces of a surface; flat ones get three vertices per face."""
    # Drop faces with a vertex that is not finite.
    points, faces = surface.positions, surface.faces.astype(np.int64)
    finite: Bools = np.all(np.isfinite(points), axis=1)
    faces = faces[np.all(finite[faces], axis=1)]
    uvs = surface.uvs if surface.uvs is not None else np.zeros((len(points), 2), np.float32)
    normals = surface.normals
    # Split vertices where a normal is missing or not of unit length: faces have their own there.
    if normals is None or not _is_unit(normals[faces.reshape(-1)]).all():
        corner = faces.reshape(-1)
        face_normals = unit_normals(triangle_corners(points, faces))
        face_normals[~face_normals.any(1)] = (0.0, 1.0, 0.0)  # up, where a triangle has no area
        flat = np.repeat(face_normals.astype(np.float32), 3, axis=0)
        if normals is not None:
            vertex_normals = normals[corner]
            flat = np.where(_is_unit(vertex_normals)[:, None], vertex_normals, flat)
        points, normals, uvs = points[corner], flat, uvs[corner]
        faces = np.arange(len(corner)).reshape(-1, 3)
    finite_uvs = np.where(np.isfinite(uvs), uvs, np.float32(0))
    return np.concatenate([points, normals, finite_uvs], 1, dtype=np.float32), faces


def _is_unit(normals: F32) -> Bools:
    with np.errstate(invalid="ignore"):
        return np.asarray(np.abs(np.einsum("ij,ij->i", normals, normals) - 1) < 0.1)
