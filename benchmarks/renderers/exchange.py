"""Writes what our kernels gather from as files for another renderer: scene.npz and scene.json.

benchmarks/renderers/cycles.py calls it; cycles_scene.py, in Blender's own Python, reads the files.
"""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from shapely.geometry import Point, Polygon

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.house import House
from pbrs_farm.core.recipe import Recipe
from pbrs_farm.raycast.variant import choose_variant
from pbrs_farm.transport.light_scene import LightScene
from pbrs_farm.transport.scene_tables.material_rows import (
    ALPHA,
    CUTOFF,
    F0,
    KD,
    KIND,
    MIRROR,
    SURFACE,
    TAU,
)
from pbrs_farm.transport.scene_tables.portals import portals_of_house
from pbrs_farm.transport.scene_tables.scene_tables import (
    DUV1,
    DUV2,
    NO_LAMP,
    NORMALS,
    UV0,
    SceneTables,
    tables_from_house,
)
from pbrs_farm.transport.scene_tables.sky import Sky, sky_for_house

BESIDE_M = 0.4  # distance from an opening's middle plane to a point inside the room beside it


def home_without_coats(name: str) -> tuple[House, LightScene, dict[str, NDArray[np.uint8]]]:
    """(repaired house, its scene without coats, decoded textures) of an example home."""
    from pbrs_farm.prepare.finished_house import repaired_house
    from pbrs_farm.prepare.source import resolve
    from pbrs_farm.run.house_cache import decoded_textures

    recipe = Recipe()
    house, _report = repaired_house(resolve(name), recipe)
    textures, _unreadable = decoded_textures(house)
    sky = sky_for_house(recipe, house.id)
    tables = without_coats(tables_from_house(house, textures, recipe))
    return house, LightScene(tables, sky, portals_of_house(house), choose_variant()), textures


def without_coats(tables: SceneTables) -> SceneTables:
    """The tables with every coat taken off; a metal's reflectance becomes diffuse."""
    rows = tables.material_rows.copy()
    is_metal = (rows[:, KIND] == SURFACE) & (rows[:, F0].max(1) > 0.081)
    rows[is_metal, KD] += rows[is_metal, F0]
    rows[rows[:, KIND] == SURFACE, F0] = 0
    rows[rows[:, KIND] == SURFACE, ALPHA] = 0
    return replace(tables, material_rows=rows)


def write_scene(
    folder: Path,
    tables: SceneTables,
    sky: Sky,
    house: House,
    textures: dict[str, NDArray[np.uint8]],
) -> None:
    """Write scene.npz (geometry) and scene.json (materials, lamps, sun) into folder.

    A part is what shares a material and a lamp; "texture" is the id of one of textures, by which its
    "kd" is multiplied and then held to "max_kd".
    """
    folder.mkdir(parents=True, exist_ok=True)
    rows = tables.face_rows
    first = rows[:, UV0]
    tags, part = np.unique(tables.face_tags, return_inverse=True)
    np.savez(
        folder / "scene.npz",
        positions=tables.positions,
        faces=tables.faces,
        face_part=part.astype(np.int32),
        uvs=np.stack([first, first + rows[:, DUV1], first + rows[:, DUV2]], 1),
        normals=np.stack([rows[:, columns] for columns in NORMALS], 1),
    )
    described = {
        "parts": [_part(int(tag), tables, house, set(textures)) for tag in tags],
        "portals": [
            {"corners": q.tolist(), "inwards": n.tolist()} for q, n in portals_inwards(house)
        ],
        "sun": {
            "direction": sky.sun_direction.tolist(),
            "irradiance": sky.sun_irradiance.tolist(),
            "half_angle_rad": sky.sun_half_angle_rad,
        },
    }
    (folder / "scene.json").write_text(json.dumps(described, indent=1))


def portals_inwards(house: House) -> list[tuple[F64, F64]]:
    """((4, 3) corners, (3,) unit normal into the room) of every opening that daylight enters by."""
    rooms = [(room, Polygon(room.polygon)) for room in house.rooms]

    def is_indoors(point: F64) -> bool:
        return any(
            room.floor_y <= point[1] <= room.ceiling_y
            and outline.contains(Point(point[0], point[2]))
            for room, outline in rooms
        )

    portals = []
    for quad in portals_of_house(house):
        across = np.cross(quad[1] - quad[0], quad[3] - quad[0])
        normal, middle = across / np.linalg.norm(across), quad.mean(0)
        sides = [n for n in (normal, -normal) if is_indoors(middle + BESIDE_M * n)]
        portals += [(quad, n) for n in sides]
    return portals


def _part(tag: int, tables: SceneTables, house: House, textures: set[str]) -> dict[str, Any]:
    index, lamp = tag & 0xFFFF, tag >> 16
    row, material = tables.material_rows[index], house.materials[index]
    texture = material.texture_id if material.texture_id in textures else None
    return {
        "name": f"{index} {material.name}"[:60],
        "kind": int(row[KIND]),
        "kd": row[KD].tolist(),
        "max_kd": tables.max_albedo,
        "f0": row[F0].tolist(),
        "tau": row[TAU].tolist(),
        "texture": texture if int(row[KIND]) != MIRROR else None,
        "cutout": bool(row[CUTOFF] > 0),
        "radiance": [0.0] * 3 if lamp == NO_LAMP else tables.lamp_rows[lamp, :3].tolist(),
    }
