"""Scene tables: a house as the flat arrays that the kernels gather from; pure numpy, no effects.

A scene is one mesh and a few arrays, so that the kernels are the same for every house, camera and
sky, and none is compiled again.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F32, F64, I32, I64, Bools
from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.house import Geometry, House, MaterialKind, geometry_from_house
from pbrs_farm.core.mesh import dots, faces_with_area, lengths, triangle_corners, unit_normals
from pbrs_farm.core.recipe import Recipe
from pbrs_farm.transport.scene_tables.area_emitters import AreaEmitter, area_emitters_of_house
from pbrs_farm.transport.scene_tables.lamp_symmetry import symmetry_row
from pbrs_farm.transport.scene_tables.material_rows import (
    MATERIAL_FLOATS,
    TAU,
    material_rows,
    max_albedo,
)
from pbrs_farm.transport.scene_tables.texture_atlas import texture_atlas

FACE_FLOATS: Final = 28  # columns of a face's row: seven packets of four, gathered together
ORIGIN, EDGE1, EDGE2 = slice(0, 3), slice(4, 7), slice(8, 11)  # first corner, edges to the others
UV0, DUV1, DUV2 = [3, 7], [11, 12], [13, 14]  # uv of the first corner, steps to the others
NORMALS = slice(16, 19), slice(20, 23), slice(24, 27)  # of the corners
FRONT_PDF, BACK_PDF, TARGET_EMITTER = 19, 23, 27  # filled by guiding; column 15 is free
NO_LAMP: Final = 0xFFFF  # upper half of a face's tag that does not emit
FACES_AT_ONCE: Final = 1 << 13  # in the making of rows, against memory


@dataclass(frozen=True, slots=True, eq=False)
class SceneTables:
    """A house as numpy arrays that kernels gather from: V vertices, F faces, M materials, L lamps."""

    positions: F32  # (V, 3) vertices of Mitsuba's mesh
    faces: I32  # (F, 3), without degenerate ones
    face_rows: F32  # (F, 28), columns as above
    face_tags: NDArray[np.uint32]  # (F,) material + 65536 * lamp
    transparent: Bools  # (F,) thin glass and alpha cut-outs: shadow rays may pass
    material_rows: F32  # (M, 20), columns as in material_rows.py
    max_albedo: float  # that Kd times its texture is held to
    texels: NDArray[np.uint32]  # the texture atlas
    lamps: tuple[AreaEmitter, ...]  # L of them
    lamp_rows: F32  # (L, 4) radiance r g b, area in m2
    lamp_first: NDArray[np.uint32]  # (L + 1,) first of each lamp's triangles in the next two
    lamp_faces: NDArray[np.uint32]  # (T,) face
    lamp_areas: F32  # (T,) running sum of areas over the lamp's area
    lamp_symmetries: F32  # (L, 4) as symmetry_row; no side where light may pass its faces
    kept: Bools  # (G,) mask of the geometry's faces in the tables (all but panes), in order
    notes: tuple[str, ...]  # what had to be changed or left out


def tables_from_house(
    house: House, textures: dict[str, NDArray[np.uint8]], recipe: Recipe
) -> SceneTables:
    """The tables of a house without its window panes, which would only cost rays.

    textures: id -> (H, W, 3 or 4) uint8 sRGB, row 0 at the top. Degenerate faces are left
    out, with a note. Raises BadHouse when no surface is left.
    """
    geometry = geometry_from_house(house, with_panes=False)
    keep = solid_faces(geometry)
    if not keep.any():
        raise BadHouse(house.source.file, house.id, "no surface for light to hit")
    n_left_out = int((~keep).sum())
    notes = [f"{n_left_out} degenerate faces left out of the light"] * (n_left_out > 0)

    # Tag each face with its material and its lamp.
    released = recipe.materials.preset == "released"
    packed = texture_atlas(house, textures, with_roughness=not released)
    rows, material_notes = material_rows(house, packed, recipe)
    lamps = area_emitters_of_house(house, geometry, keep, recipe)
    faces = geometry.faces[keep]
    face_lamp = np.full(len(geometry.faces), NO_LAMP, np.uint32)
    for index, lamp in enumerate(lamps):
        face_lamp[lamp.faces] = index
    material = geometry.face_material[keep].astype(np.uint32)
    first, lamp_faces, lamp_areas = _lamp_triangles(lamps, np.cumsum(keep) - 1)
    # Tell which materials let a shadow ray pass; in `released` opacity below 1 does, too.
    transparent = np.array(
        [
            m.kind is MaterialKind.GLASS or m.alpha_cutout or (released and m.opacity < 1)
            for m in house.materials
        ]
    )
    is_open = transparent[material] | rows[material, TAU].any(1)
    symmetries = np.zeros((len(lamps), 4), np.float32)
    for k, (a, b) in enumerate(pairwise(first)):
        emitting = lamp_faces[a:b]
        if not is_open[emitting].any():
            symmetries[k] = symmetry_row(triangle_corners(geometry.positions, faces[emitting]))
    return SceneTables(
        positions=geometry.positions,
        faces=faces,
        face_rows=rows_of_faces(geometry, faces),
        face_tags=material + (face_lamp[keep] << np.uint32(16)),
        transparent=transparent[material],
        material_rows=rows.reshape(-1, MATERIAL_FLOATS),
        max_albedo=max_albedo(recipe),
        texels=packed.texels,
        lamps=lamps,
        lamp_rows=np.array([[*x.radiance, x.area_m2] for x in lamps], np.float32).reshape(-1, 4),
        lamp_first=first,
        lamp_faces=lamp_faces,
        lamp_areas=lamp_areas,
        lamp_symmetries=symmetries,
        kept=keep,
        notes=(*notes, *material_notes),
    )


def moved_rows(geometry: Geometry, tables: SceneTables, faces: I64) -> F32:
    """(N, FACE_FLOATS) rows of faces (N,) at a geometry of the same house, moved; guiding's entries are 0."""
    return rows_of_faces(geometry, tables.faces[faces])


def solid_faces(geometry: Geometry) -> Bools:
    """(F,) bool: finite corners and an area that defines the face's plane."""
    keep = np.empty(len(geometry.faces), np.bool_)
    for part in _chunks_of_faces(len(keep)):
        corners = triangle_corners(geometry.positions, geometry.faces[part])
        keep[part] = faces_with_area(corners, 0.5e-10)
    return keep


def rows_of_faces(geometry: Geometry, faces: I32) -> F32:
    """(F, FACE_FLOATS) what a ray needs to know of each face."""
    rows = np.zeros((len(faces), FACE_FLOATS), np.float32)
    for part in _chunks_of_faces(len(faces)):
        _fill_rows(rows[part], geometry, faces[part])
    return rows


def _chunks_of_faces(n_faces: int) -> Iterator[slice]:
    """Slices of n_faces that stay in the cache."""
    for start in range(0, n_faces, FACES_AT_ONCE):
        yield slice(start, start + FACES_AT_ONCE)


def _fill_rows(rows: F32, geometry: Geometry, faces: I32) -> None:
    corners = triangle_corners(geometry.positions, faces)
    e1, e2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    flat = unit_normals(corners)

    # Use the face's own normal where a vertex normal is missing or not of unit length.
    normals = geometry.normals[faces].astype(np.float64)
    of_face = np.broadcast_to(flat[:, None], normals.shape)
    with np.errstate(invalid="ignore", divide="ignore"):
        length = lengths(normals)
        normals /= length[..., None]
        is_bad = ~((length > 0.5) & (length < 2))
    normals[is_bad] = of_face[is_bad]
    # Turn all three to the front; replace one that leans to the back by the face's own.
    side = np.sign(dots(normals[:, 0] + normals[:, 1] + normals[:, 2], flat))
    normals[side < 0] *= -1
    leans_back = ~((dots(normals, flat[:, None]) > 0.05) & (side != 0)[:, None])
    normals[leans_back] = of_face[leans_back]

    # Shift repeating textures by whole turns to start near 0: float32 keeps the fraction.
    uvs = np.nan_to_num(geometry.uvs[faces].astype(np.float64), posinf=0, neginf=0)
    least = np.minimum(np.minimum(uvs[:, 0], uvs[:, 1]), uvs[:, 2])
    uvs -= np.floor(least)[:, None]
    duv = uvs[:, 1:] - uvs[:, :1]

    rows[:, ORIGIN], rows[:, EDGE1], rows[:, EDGE2] = corners[:, 0], e1, e2
    rows[:, UV0], rows[:, DUV1], rows[:, DUV2] = uvs[:, 0], duv[:, 0], duv[:, 1]
    for k, columns in enumerate(NORMALS):
        rows[:, columns] = normals[:, k]


def _lamp_triangles(
    lamps: tuple[AreaEmitter, ...], new_number: I64
) -> tuple[NDArray[np.uint32], NDArray[np.uint32], F32]:
    """(first, faces, areas) as in SceneTables; new_number: of each face of the geometry."""
    first = np.cumsum([0, *(len(lamp.faces) for lamp in lamps)]).astype(np.uint32)
    faces = [new_number[lamp.faces] for lamp in lamps]
    areas = [np.cumsum(lamp.face_areas) / np.sum(lamp.face_areas) for lamp in lamps]
    return (
        first,
        np.concatenate([np.zeros(0), *faces]).astype(np.uint32),
        np.concatenate([np.zeros(0), *areas]).astype(np.float32),
    )


def bounding_spheres(tables: SceneTables) -> F64:
    """(L, 4) centre and radius in m of the sphere around the bounding box of each lamp's faces."""
    spheres = np.zeros((len(tables.lamps), 4))
    for k in range(len(tables.lamps)):
        emitting = tables.lamp_faces[tables.lamp_first[k] : tables.lamp_first[k + 1]]
        corners = tables.positions[tables.faces[emitting]].reshape(-1, 3)
        low, high = corners.min(0), corners.max(0)
        spheres[k, :3], spheres[k, 3] = 0.5 * (low + high), 0.5 * float(np.linalg.norm(high - low))
    return spheres
