"""What our kernels gather from, written as files for other renderers. Effects: writes them.

benchmarks/cycles.py and benchmarks/luxcore.py write a scene with it; each renderer's own program
reads scene.npz and scene.json, and pictures in a form of its own.
"""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.house import House
from pbrs_farm.core.recipe import Recipe
from pbrs_farm.raycast.variant import choose_variant
from pbrs_farm.transport.light_scene import LightScene
from pbrs_farm.transport.scene_tables.material_rows import MIRROR, SURFACE
from pbrs_farm.transport.scene_tables.portals import portals_of_house
from pbrs_farm.transport.scene_tables.scene_tables import NO_LAMP, SceneTables, tables_from_house
from pbrs_farm.transport.scene_tables.sky import Sky, sky_for_house


def home_without_coats(name: str) -> tuple[House, LightScene, dict[str, NDArray[np.uint8]]]:
    """(repaired house, its scene without coats, decoded textures) of an example home."""
    from pbrs_farm.read.source import resolve
    from pbrs_farm.run.house_cache import decoded_textures
    from pbrs_farm.run.steps import repaired_house

    recipe = Recipe()
    house, _report = repaired_house(resolve(name), recipe)
    textures, _unreadable = decoded_textures(house)
    sky = sky_for_house(recipe, house.id)
    tables = without_coats(tables_from_house(house, textures, recipe))
    return house, LightScene(tables, sky, portals_of_house(house), choose_variant()), textures


def without_coats(tables: SceneTables) -> SceneTables:
    """The tables with every coat taken off; a metal's reflectance becomes diffuse."""
    rows = tables.material_rows.copy()
    is_metal = (rows[:, 11] == SURFACE) & (rows[:, 4:7].max(1) > 0.081)
    rows[is_metal, 0:3] += rows[is_metal, 4:7]
    rows[rows[:, 11] == SURFACE, 4:8] = 0
    return replace(tables, material_rows=rows)


def write_scene(
    folder: Path,
    tables: SceneTables,
    sky: Sky,
    house: House,
    textures: dict[str, NDArray[np.uint8]],
) -> None:
    """Write scene.npz (geometry) and scene.json (materials, lamps, sun) into folder.

    A part is what shares a material and a lamp; "texture" is the id of one of textures.
    """
    folder.mkdir(parents=True, exist_ok=True)
    rows = tables.face_rows
    first = np.stack([rows[:, 3], rows[:, 7]], 1)
    step = rows[:, [11, 12]], rows[:, [13, 14]]
    tags, part = np.unique(tables.face_tags, return_inverse=True)
    np.savez(
        folder / "scene.npz",
        positions=tables.positions,
        faces=tables.faces,
        face_part=part.astype(np.int32),
        uvs=np.stack([first, first + step[0], first + step[1]], 1),
        normals=np.stack([rows[:, 16 + 4 * k : 19 + 4 * k] for k in range(3)], 1),
    )
    described = {
        "parts": [_part(int(tag), tables, house, set(textures)) for tag in tags],
        "sun": {
            "direction": sky.sun_direction.tolist(),
            "irradiance": sky.sun_irradiance.tolist(),
            "half_angle_rad": sky.sun_half_angle_rad,
        },
    }
    (folder / "scene.json").write_text(json.dumps(described, indent=1))


def _part(tag: int, tables: SceneTables, house: House, textures: set[str]) -> dict[str, Any]:
    index, lamp = tag & 0xFFFF, tag >> 16
    row, material = tables.material_rows[index], house.materials[index]
    texture = material.texture_id if material.texture_id in textures else None
    return {
        "name": f"{index} {material.name}"[:60],
        "kind": int(row[11]),
        "kd": row[0:3].tolist(),
        "f0": row[4:7].tolist(),
        "tau": row[8:11].tolist(),
        "texture": texture if int(row[11]) != MIRROR else None,
        "cutout": bool(row[15] > 0),
        "radiance": [0.0] * 3 if lamp == NO_LAMP else tables.lamp_rows[lamp, :3].tolist(),
    }
