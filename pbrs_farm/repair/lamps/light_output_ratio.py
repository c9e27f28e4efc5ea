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

N_RAYS = 4000  # standard error below 0.8 % of the ratio
_SEE_THROUGH = frozenset({MaterialKind.GLASS, MaterialKind.PANE, MaterialKind.BULB})
_SPACING_M = 30.0  # between lamps, so that none meets another's rays
_REACH_M = 14.0  # a ray that gets this far has left its lamp
_MAX_LAYERS = 12  # of shade that one ray passes

Part = tuple[int, int, int]  # a connected part of a lamp: item, surface, number of the part


@dataclass(frozen=True, slots=True, eq=False)
class LampScene:
    """Every lamp of a house laid out for measuring."""

    house: House
    occluder: Occluder | None  # None where no lamp has a face that stops light
    parts: tuple[Part, ...]
    part_of_face: NDArray[np.int64]  # (F,) index into parts, of each face of the scene
    offset_of: dict[int, F64]  # item -> (3,) translation of that lamp
    labels: dict[tuple[int, int], NDArray[np.int64]]  # (item, surface) -> (F,) part of each face


@dataclass(frozen=True, slots=True, eq=False)
class LightOutput:
    """How much of a source's light leaves its lamp."""

    ratio: float  # light output ratio, 0..1
    blocked: F64  # (n_parts,) share of the light that each part stops


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
        # Stand the lamp in its cell of a square grid, the first bulb in the middle.
        row, column = divmod(n, side)
        cell = np.array([column - side / 2, 0.0, row - side / 2]) * _SPACING_M
        offset_of[k] = cell - np.array(item.lights[0].position)
        surfaces = []
        for j, s in enumerate(item.surfaces):
            if house.materials[s.material].kind in _SEE_THROUGH or not len(s.faces):
                continue
            # Split the surface into connected parts, the units that may become shades.
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
    # Send the rays from the bulb where it stands in the scene.
    origins, directions = diffuse_rays(emitting, N_RAYS, rng)
    origins += scene.offset_of[item]
    blocked = np.zeros(len(scene.parts))
    is_shade = np.zeros(len(scene.parts), np.bool_)
    is_shade[list(shades)] = True

    # Follow the rays through the shades, layer by layer, until each is stopped or out.
    weight = np.full(len(origins), 1.0 / max(len(origins), 1))
    ratio = 0.0
    for _ in range(_MAX_LAYERS):
        if scene.occluder is None or not len(origins):
            break
        distance, face = scene.occluder.first_hit(
            origins.astype(np.float32), directions.astype(np.float32), _REACH_M
        )
        out = face < 0
        ratio += float(weight[out].sum())
        # Charge a stopped ray to its part; let the others through, weakened.
        part = scene.part_of_face[face[~out]]
        through = is_shade[part]
        np.add.at(blocked, part[~through], weight[~out][~through])
        origins = (origins + directions * np.where(out, 0.0, distance)[:, None])[~out][through]
        directions = directions[~out][through]
        origins = origins + 1e-4 * directions  # off the face just passed
        weight = weight[~out][through] * transmission
    if scene.occluder is None:
        ratio = 1.0
    return LightOutput(ratio, blocked)


def diffuse_rays(surfaces: Sequence[Surface], n: int, rng: np.random.Generator) -> tuple[F64, F64]:
    """n rays (origins, unit directions) that leave the surfaces' fronts as a diffuse emitter's."""
    sound = [s for s in surfaces if len(s.faces)]
    corners = np.concatenate([triangle_corners(s.positions, s.faces) for s in sound])
    areas, normals = face_areas(corners), unit_normals(corners)
    # Choose faces by area, points uniformly on them.
    chosen = rng.choice(len(areas), n, p=areas / areas.sum())
    u, v = np.sqrt(rng.random(n)), rng.random(n)
    weights = np.stack([1 - u, u * (1 - v), u * v], 1)
    points = np.einsum("nk,nki->ni", weights, corners[chosen])
    # Choose directions by the cosine: a point on a unit sphere that touches the face.
    sphere = rng.normal(size=(n, 3))
    sphere /= np.linalg.norm(sphere, axis=1, keepdims=True)
    directions = sphere + normals[chosen]
    directions /= np.maximum(np.linalg.norm(directions, axis=1, keepdims=True), 1e-12)
    step = min(1e-4, 0.01 * float(np.sqrt(areas.sum())))  # off the bulb
    return points + step * normals[chosen], directions
