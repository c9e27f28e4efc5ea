"""Lights of a placed SUNCG model, each with the bulbs that emit it (docs/spec/suncg.md section 2). No effects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pbrs_farm.core.arrays import F64, triple
from pbrs_farm.core.frames import transform_points
from pbrs_farm.core.house import LightPart, Surface, part_of
from pbrs_farm.core.lighting import BULB_RADIUS_M, PowerUnit
from pbrs_farm.geometry.connected import connected_faces

# Power of a lamp that has bulbs but no row in suncgModelLights.json; shared by its bulbs.
ASSUMED_WATT = 60.0


def placed_light(light: LightPart, world_from_model: F64) -> LightPart:
    """A light of a model's frame in the world."""
    points = (
        [light.position] if light.position_end is None else [light.position, light.position_end]
    )
    world = transform_points(world_from_model, np.array(points))
    direction = world_from_model[:3, :3] @ np.array(light.direction)
    direction /= max(float(np.linalg.norm(direction)), 1e-12)
    return replace(
        light,
        position=triple(world[0]),
        position_end=None if light.position_end is None else triple(world[1]),
        direction=triple(direction),
    )


def separate_bulbs(bulb: Surface) -> tuple[Surface, ...]:
    """The connected parts of a bulb material's surface, one per bulb."""
    # Weld equal positions, then find the connected parts of the faces.
    _, same = np.unique(bulb.positions, axis=0, return_inverse=True)
    part_of_face = connected_faces(same.reshape(-1)[bulb.faces])
    parts = np.unique(part_of_face)
    if len(parts) == 1:
        return (bulb,)
    return tuple(
        part_of(bulb, bulb.faces[part_of_face == part], f"{bulb.name}_{k}")
        for k, part in enumerate(parts)
    )


def with_emitting_bulbs(
    lights: Sequence[LightPart], surfaces: Sequence[Surface], bulbs: Sequence[int]
) -> tuple[LightPart, ...]:
    """lights with the bulbs (indices into surfaces) that emit each.

    Every bulb belongs to the light nearest to it, and a light without one shares the bulb nearest
    to it. Without lights every bulb is one, of an assumed power; without bulbs none emits, and
    repair adds them.
    """
    if not bulbs:
        return tuple(replace(light, radius_m=BULB_RADIUS_M) for light in lights)
    # Centre and mean radius of each bulb.
    bounds = [(surfaces[b].positions.min(0), surfaces[b].positions.max(0)) for b in bulbs]
    centres = np.array([(low + high) / 2 for low, high in bounds], np.float64)
    radii = [float(np.mean(high - low)) / 2 for low, high in bounds]
    if not lights:
        # Without lights every bulb is one, with an equal share of the assumed power.
        share = 1 / len(bulbs)
        return tuple(
            LightPart(triple(c), r, ASSUMED_WATT, PowerUnit.WATT, share, emitting=(b,))
            for c, r, b in zip(centres, radii, bulbs, strict=True)
        )
    positions = np.array([light.position for light in lights])
    # Give every bulb to its nearest light; a light left without shares its nearest bulb.
    distance = np.linalg.norm(positions[:, None] - centres[None], axis=2)
    light_of_bulb = distance.argmin(0)
    results = []
    for k, light in enumerate(lights):
        mine = np.flatnonzero(light_of_bulb == k)
        if not len(mine):
            mine = np.array([distance[k].argmin()])
        emitting = tuple(bulbs[int(m)] for m in mine)
        results.append(replace(light, radius_m=radii[int(mine[0])], emitting=emitting))
    return tuple(results)
