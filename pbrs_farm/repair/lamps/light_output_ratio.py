"""How much of each source's light leaves its lamp, measured with rays; no effects.

All lamps of a house stand side by side in one scene, far apart, so that one ray caster serves
them all and no lamp meets another's rays.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.house import House, Item, MaterialKind, Surface
from pbrs_farm.core.mesh import face_areas, triangle_corners, unit_normals
from pbrs_farm.repair.measure.occluder import Occluder
from pbrs_farm.repair.structure.booleans import F64
from pbrs_farm.repair.structure.closed_shells import components
from pbrs_farm.repair.structure.patches import patch_from_surface

N_RAYS = 4000
_SEE_THROUGH = frozenset({MaterialKind.GLASS, MaterialKind.PANE, MaterialKind.BULB})
_SPACING_M = 30.0
_REACH_M = 14.0
_MAX_LAYERS = 12

Part = tuple[int, int, int]
"""A connected part of a lamp: index of the item, of its surface, number of the part in it."""


@dataclass(frozen=True, slots=True, eq=False)
class LampScene:
    """Every lamp of a house laid out for measuring.

    part_of_face: (F,) int64 index into parts, of each face of the scene.
    offset_of: item index -> (3,) translation of that lamp. labels: (item, surface) -> (F,) number
    of the part each face belongs to.
    """

    house: House
    occluder: Occluder | None
    parts: tuple[Part, ...]
    part_of_face: NDArray[np.int64]
    offset_of: dict[int, F64]
    labels: dict[tuple[int, int], NDArray[np.int64]]


@dataclass(frozen=True, slots=True, eq=False)
class LightOutput:
    """share: of the light that leaves the lamp. blocked: (n_parts,) share each part stops."""

    share: float
    blocked: F64


def lamp_scene_of_house(house: House, occluder_from: Callable[[House], Occluder]) -> LampScene:
    """Lay out the house's lamps, glass and bulbs left out, and build their ray caster."""
    lamps = [k for k, item in enumerate(house.items) if item.lights]
    side = max(int(np.ceil(np.sqrt(len(lamps)))), 1)
    items: list[Item] = []
    parts: list[Part] = []
    numbers: list[NDArray[np.int64]] = []
    offset_of: dict[int, F64] = {}
    labels: dict[tuple[int, int], NDArray[np.int64]] = {}
    for n, k in enumerate(lamps):
        item = house.items[k]
        row, column = divmod(n, side)
        cell = np.array([column - side / 2, 0.0, row - side / 2]) * _SPACING_M
        offset_of[k] = cell - np.array(item.lights[0].position)
        surfaces = []
        for j, s in enumerate(item.surfaces):
            if house.materials[s.material].kind in _SEE_THROUGH or not len(s.faces):
                continue
            labels[k, j] = np.unique(components([patch_from_surface(s, k)])[0], return_inverse=True)[1]  # fmt: skip
            numbers.append(labels[k, j] + len(parts))
            parts += [(k, j, part) for part in range(int(labels[k, j].max()) + 1)]
            moved = (s.positions.astype(np.float64) + offset_of[k]).astype(np.float32)
            surfaces.append(replace(s, positions=moved))
        items.append(replace(item, surfaces=tuple(surfaces), lights=(), box=None))
    scene = house.with_items(items)
    part_of_face = np.concatenate([np.zeros(0, np.int64), *numbers])
    occluder = occluder_from(scene) if len(part_of_face) else None
    return LampScene(house, occluder, tuple(parts), part_of_face, offset_of, labels)


def light_output_of_source(
    scene: LampScene, item: int, source: int, shades: Sequence[int], transmission: float
) -> LightOutput:
    """Light output of one source from its own lamp, by N_RAYS rays that leave its bulb diffusely.

    shades: indices of parts that let light through, each time weakened by transmission.
    """
    lamp = scene.house.items[item]
    emitting = [lamp.surfaces[k] for k in lamp.lights[source].emitting]
    rng = np.random.default_rng([item, source])
    origins, directions = diffuse_rays(emitting, N_RAYS, rng)
    origins += scene.offset_of[item]
    blocked = np.zeros(len(scene.parts))
    is_shade = np.zeros(len(scene.parts), np.bool_)
    is_shade[list(shades)] = True

    # Through the shades, layer by layer, until a ray is stopped or out.
    weight = np.full(len(origins), 1.0 / max(len(origins), 1))
    share = 0.0
    for _ in range(_MAX_LAYERS):
        if scene.occluder is None or not len(origins):
            break
        distance, face = scene.occluder.first_hit(
            origins.astype(np.float32), directions.astype(np.float32), _REACH_M
        )
        out = face < 0
        share += float(weight[out].sum())
        part = scene.part_of_face[face[~out]]
        through = is_shade[part]
        np.add.at(blocked, part[~through], weight[~out][~through])
        origins = (origins + directions * np.where(out, 0.0, distance)[:, None])[~out][through]
        directions = directions[~out][through]
        origins = origins + 1e-4 * directions
        weight = weight[~out][through] * transmission
    if scene.occluder is None:
        share = 1.0
    return LightOutput(share, blocked)


def diffuse_rays(surfaces: Sequence[Surface], n: int, rng: np.random.Generator) -> tuple[F64, F64]:
    """n rays (origins, unit directions) that leave the surfaces' fronts as a diffuse emitter's."""
    sound = [s for s in surfaces if len(s.faces)]
    corners = np.concatenate([triangle_corners(s.positions, s.faces) for s in sound])
    areas, normals = face_areas(corners), unit_normals(corners)
    chosen = rng.choice(len(areas), n, p=areas / areas.sum())
    u, v = np.sqrt(rng.random(n)), rng.random(n)
    weights = np.stack([1 - u, u * (1 - v), u * v], 1)
    points = np.einsum("nk,nki->ni", weights, corners[chosen])
    sphere = rng.normal(size=(n, 3))
    sphere /= np.linalg.norm(sphere, axis=1, keepdims=True)
    directions = sphere + normals[chosen]
    directions /= np.maximum(np.linalg.norm(directions, axis=1, keepdims=True), 1e-12)
    step = min(1e-4, 0.01 * float(np.sqrt(areas.sum())))
    return points + step * normals[chosen], directions
