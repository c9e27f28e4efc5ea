"""Lights of a glTF scene: KHR_lights_punctual and emissive surfaces -> LightPart. No effects."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from pbrs_farm.core.arrays import F64, triple
from pbrs_farm.core.house import LightPart, Surface, corners_of_surfaces
from pbrs_farm.core.lighting import BULB_RADIUS_M, LightForm, PowerUnit
from pbrs_farm.core.mesh import face_areas, outside_area
from pbrs_farm.formats.glb import Gltf
from pbrs_farm.read.common.placed_mesh import ASSUMED_LM
from pbrs_farm.read.gltf.document import numbers, object_at
from pbrs_farm.read.gltf.materials import Emission


def punctual_light(
    gltf: Gltf, node: dict[str, Any], world_from_node: F64, place: str
) -> LightPart | None:
    """The point or spot light of a node (along -z, lumens = candela x solid angle); None for others."""
    # A node refers to its light by number; the lights are at the top level of the file.
    number = object_at(object_at(node, "extensions"), "KHR_lights_punctual").get("light")
    lights = object_at(object_at(gltf.document, "extensions"), "KHR_lights_punctual").get("lights")
    if type(number) is not int or not isinstance(lights, list) or not 0 <= number < len(lights):
        return None
    fields_json = lights[number]
    if not isinstance(fields_json, dict) or fields_json.get("type") not in ("point", "spot"):
        return None
    (intensity,) = numbers(gltf, [fields_json.get("intensity", 1)], 1, f"{place}: light intensity")
    colour = np.clip(
        numbers(gltf, fields_json.get("color", [1, 1, 1]), 3, f"{place}: light colour"), 0, 1
    )
    # A point light shines everywhere, a spot within its outer cone.
    cutoff = math.pi
    if fields_json["type"] == "spot":
        angle = object_at(fields_json, "spot").get("outerConeAngle", math.pi / 4)
        cutoff = float(np.clip(numbers(gltf, [angle], 1, f"{place}: cone")[0], 0.01, math.pi))
    # Candela times the cone's solid angle are lumens; a light looks along -z.
    solid_angle = 2 * math.pi * (1 - math.cos(cutoff))
    # Of a scene in another format whose lights say how large they are, not how strong.
    extras = object_at(fields_json, "extras")
    radius = numbers(gltf, [extras.get("radius_m", BULB_RADIUS_M)], 1, f"{place}: light radius")
    power = max(float(intensity), 0.0) * solid_angle
    direction = -world_from_node[:3, 2] / max(float(np.linalg.norm(world_from_node[:3, 2])), 1e-12)
    return LightPart(
        position=triple(world_from_node[:3, 3]),
        radius_m=float(np.clip(radius[0], 1e-3, 10.0)),
        power=ASSUMED_LM if extras.get("assumed") is True else power,
        unit=PowerUnit.LUMEN,
        rgb_linear=triple(colour / max(float(colour.max()), 1e-6)),
        form=LightForm.SPOT if fields_json["type"] == "spot" else LightForm.POINT,
        direction=triple(direction),
        cutoff_rad=cutoff,
        is_coloured="color" in fields_json,
    )


def emitted(surfaces: Sequence[Surface], shining: dict[int, Emission]) -> tuple[LightPart, ...]:
    """Lights of emissive surfaces (surface -> emission); those of unknown strength share ASSUMED_LM by area."""
    # Share the assumed flux by area where the file gives no strength.
    corners = {k: corners_of_surfaces([surfaces[k]]) for k in shining}
    area = {k: float(face_areas(corners[k]).sum()) for k in shining}
    unknown = sum(area[k] for k, emission in shining.items() if emission.luminance == 0)
    light_parts = []
    for k, emission in shining.items():
        low, high = surfaces[k].positions.min(0), surfaces[k].positions.max(0)
        # A Lambertian emitter.
        power_lm = math.pi * emission.luminance * outside_area(corners[k])
        light_parts.append(
            LightPart(
                position=triple((low + high) / 2),
                radius_m=float(np.mean(high - low)) / 2,
                power=power_lm or ASSUMED_LM * area[k] / max(unknown, 1e-12),
                unit=PowerUnit.LUMEN,
                rgb_linear=emission.rgb_linear,
                is_coloured=emission.is_coloured,
                is_bare=emission.luminance > 0,
                emitting=(k,),
            )
        )
    return tuple(light_parts)
