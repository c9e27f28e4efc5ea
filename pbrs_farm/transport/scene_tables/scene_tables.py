"""A house as the flat tables that the light kernels gather from; pure numpy, no effects.

Everything is one mesh and a few arrays, so that the kernels are the same for every house: nothing
is compiled again for another home, camera or sky.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.house import Geometry, House, MaterialKind, geometry_from_house
from pbrs_farm.core.mesh import faces_with_area, triangle_corners, unit_normals
from pbrs_farm.core.recipe import Recipe
from pbrs_farm.transport.scene_tables.lamp_emission import AreaEmitter, area_emitters_of_house
from pbrs_farm.transport.scene_tables.material_rows import (
    MATERIAL_FLOATS,
    TextureAtlas,
    material_rows,
    texture_atlas,
)

FACE_FLOATS: Final = 28
NO_LAMP: Final = 0xFFFF


@dataclass(frozen=True, slots=True, eq=False)
class SceneTables:
    """What the kernels gather from.

    positions (V, 3) float32, faces (F, 3) int32: the mesh for Mitsuba, degenerate faces removed.
    face_rows: (F, 28) float32 v0 u0 | e1 v0 | e2 du1 | dv1 du2 dv2 0 | n0 a | n1 b | n2 c; a, b, c
    are kept free for DeviceScene.set_guiding_targets.
    face_tags: (F,) uint32, material + 65536 * lamp (65535 = no lamp).
    see_through: (F,) bool, thin glass and cut-outs: shadow rays may pass.
    material_rows: (M, 16) float32. texels: the packed texture atlas.
    lamps: the emitters, in order. lamp_rows: (L, 4) float32 r g b area. lamp_first: (L + 1,)
    first triangle of each lamp; lamp_faces: (T,) face; lamp_areas: (T,) running sum of areas
    inside each lamp, divided by the lamp's area.
    """

    positions: NDArray[np.float32]
    faces: NDArray[np.int32]
    face_rows: NDArray[np.float32]
    face_tags: NDArray[np.uint32]
    see_through: NDArray[np.bool_]
    material_rows: NDArray[np.float32]
    texels: NDArray[np.uint32]
    lamps: tuple[AreaEmitter, ...]
    lamp_rows: NDArray[np.float32]
    lamp_first: NDArray[np.uint32]
    lamp_faces: NDArray[np.uint32]
    lamp_areas: NDArray[np.float32]
    notes: tuple[str, ...]


def tables_from_house(
    house: House, textures: dict[str, NDArray[np.uint8]], recipe: Recipe
) -> SceneTables:
    """The tables of a house without its panes. Raises BadHouse when nothing is left to hit."""
    geometry = geometry_from_house(house, with_panes=False)
    keep = _solid_faces(geometry)
    if not keep.any():
        raise BadHouse(house.source.file, house.id, "no surface that light could meet")
    notes = (
        [f"{int((~keep).sum())} degenerate faces left out of the light"] if (~keep).any() else []
    )

    packed: TextureAtlas = texture_atlas(house, textures)
    rows, material_notes = material_rows(house, packed, recipe)
    lamps = area_emitters_of_house(house, geometry, keep, recipe)
    faces = geometry.faces[keep]
    face_lamp = np.full(len(geometry.faces), NO_LAMP, np.uint32)
    for index, lamp in enumerate(lamps):
        face_lamp[lamp.faces] = index
    new_number = np.cumsum(keep) - 1
    material = geometry.face_material[keep].astype(np.uint32)
    first, lamp_faces, lamp_areas = _lamp_triangles(lamps, new_number)
    kinds = np.array([m.kind is MaterialKind.GLASS or m.alpha_cutout for m in house.materials])
    if recipe.materials.preset == "released":
        kinds = np.array([m.opacity < 1 or m.kind is MaterialKind.GLASS or m.alpha_cutout
                          for m in house.materials])  # fmt: skip
    return SceneTables(
        positions=geometry.positions,
        faces=faces,
        face_rows=_face_rows(geometry, faces),
        face_tags=material + (face_lamp[keep] << np.uint32(16)),
        see_through=kinds[material],
        material_rows=rows.reshape(-1, MATERIAL_FLOATS),
        texels=packed.texels,
        lamps=lamps,
        lamp_rows=np.array([[*x.radiance, x.area_m2] for x in lamps], np.float32).reshape(-1, 4),
        lamp_first=first,
        lamp_faces=lamp_faces,
        lamp_areas=lamp_areas,
        notes=(*notes, *material_notes),
    )


def _solid_faces(geometry: Geometry) -> NDArray[np.bool_]:
    """(F,) bool: finite, and wide enough that the plane of the face is known."""
    return faces_with_area(triangle_corners(geometry.positions, geometry.faces), 0.5e-10)


def _face_rows(geometry: Geometry, faces: NDArray[np.int32]) -> NDArray[np.float32]:
    corners = triangle_corners(geometry.positions, faces)
    e1, e2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    flat = unit_normals(corners)

    # Take the face's own normal where a vertex has none or one that is no unit vector.
    normals = geometry.normals[faces].astype(np.float64)
    with np.errstate(invalid="ignore", divide="ignore"):
        length = np.linalg.norm(normals, axis=2, keepdims=True)
        normals = np.where((length > 0.5) & (length < 2), normals / length, flat[:, None])
    # Keep one side for all three: a vertex normal that leans to the back is turned round.
    side = np.sign((normals.sum(1) * flat).sum(1))
    normals = np.where(((normals.sum(1) * flat).sum(1) < 0)[:, None, None], -normals, normals)
    lean = (normals * flat[:, None]).sum(2, keepdims=True)
    normals = np.where((lean > 0.05) & (side != 0)[:, None, None], normals, flat[:, None])

    # Repeat makes whole texture turns free: start near 0 so that float32 keeps the fraction.
    uvs = np.nan_to_num(geometry.uvs[faces].astype(np.float64), posinf=0, neginf=0)
    uvs -= np.floor(uvs.min(1, keepdims=True))
    duv = uvs[:, 1:] - uvs[:, :1]

    rows = np.zeros((len(faces), FACE_FLOATS), np.float32)
    rows[:, 0:3], rows[:, 3] = corners[:, 0], uvs[:, 0, 0]
    rows[:, 4:7], rows[:, 7] = e1, uvs[:, 0, 1]
    rows[:, 8:11], rows[:, 11] = e2, duv[:, 0, 0]
    rows[:, 12], rows[:, 13], rows[:, 14] = duv[:, 0, 1], duv[:, 1, 0], duv[:, 1, 1]
    for k in range(3):
        rows[:, 16 + 4 * k : 19 + 4 * k] = normals[:, k]
    return rows


def _lamp_triangles(
    lamps: tuple[AreaEmitter, ...], new_number: NDArray[np.int64]
) -> tuple[NDArray[np.uint32], NDArray[np.uint32], NDArray[np.float32]]:
    first = np.cumsum([0, *(len(lamp.faces) for lamp in lamps)]).astype(np.uint32)
    faces = [new_number[lamp.faces] for lamp in lamps]
    areas = [np.cumsum(lamp.face_areas) / np.sum(lamp.face_areas) for lamp in lamps]
    return (
        first,
        np.concatenate([np.zeros(0), *faces]).astype(np.uint32),
        np.concatenate([np.zeros(0), *areas]).astype(np.float32),
    )


def bounding_spheres(tables: SceneTables) -> NDArray[np.float64]:
    """(L, 4) centre and radius in m of the box around each lamp's shining faces."""
    balls = np.zeros((len(tables.lamps), 4))
    for k in range(len(tables.lamps)):
        shining = tables.lamp_faces[tables.lamp_first[k] : tables.lamp_first[k + 1]]
        corners = tables.positions[tables.faces[shining]].reshape(-1, 3)
        low, high = corners.min(0), corners.max(0)
        balls[k, :3], balls[k, 3] = 0.5 * (low + high), 0.5 * float(np.linalg.norm(high - low))
    return balls
