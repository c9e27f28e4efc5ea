"""Lights of a glTF scene: KHR_lights_punctual and emissive surfaces -> LightPart; no effects."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Final

import numpy as np

from pbrs_farm.core.arrays import F64, triple
from pbrs_farm.core.house import Item, LightPart, Surface, corners_of_surfaces
from pbrs_farm.core.lighting import BULB_RADIUS_M, LightForm, PowerUnit
from pbrs_farm.core.mesh import face_areas
from pbrs_farm.formats.glb import Gltf
from pbrs_farm.read.gltf.document import numbers, object_at

# Flux of a lamp whose strength the scene does not tell: a 60 W incandescent bulb's.
ASSUMED_LM: Final = 800.0


def punctual_light(
    gltf: Gltf, node: dict[str, Any], world_from_node: F64, place: str
) -> LightPart | None:
    """The point or spot light of a node; None if it has none, or a directional one (the sun)."""
    # A node names its light by number; the lights stand at the file's top.
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
    direction = -world_from_node[:3, 2] / max(float(np.linalg.norm(world_from_node[:3, 2])), 1e-12)
    return LightPart(
        position=triple(world_from_node[:3, 3]),
        radius_m=BULB_RADIUS_M,
        power=max(float(intensity), 0.0) * solid_angle,
        unit=PowerUnit.LUMEN,
        rgb_linear=triple(colour / max(float(colour.max()), 1e-6)),
        form=LightForm.SPOT if fields_json["type"] == "spot" else LightForm.POINT,
        direction=triple(direction),
        cutoff_rad=cutoff,
    )


def emitted(surfaces: Sequence[Surface], luminance: dict[int, float]) -> tuple[LightPart, ...]:
    """A light for every emissive surface. luminance: surface -> cd m-2, 0 = of unknown strength.

    Surfaces of unknown strength share ASSUMED_LM by their area.
    """
    # Share the assumed flux by area where no strength is told.
    area = {k: _area(surfaces[k]) for k in luminance}
    unknown = sum(area[k] for k, value in luminance.items() if value == 0)
    found = []
    for k, value in luminance.items():
        low, high = surfaces[k].positions.min(0), surfaces[k].positions.max(0)
        known = math.pi * value * area[k]  # a Lambertian emitter
        found.append(
            LightPart(
                position=triple((low + high) / 2),
                radius_m=float(np.mean(high - low)) / 2,
                power=known if value else ASSUMED_LM * area[k] / max(unknown, 1e-12),
                unit=PowerUnit.LUMEN,
                emitting=(k,),
            )
        )
    return tuple(found)


def assumed_light(item: Item) -> LightPart:
    """A light in the middle of a lamp about which the scene tells nothing."""
    centre = item.bounds.mean(0)
    return LightPart(triple(centre), BULB_RADIUS_M, ASSUMED_LM, PowerUnit.LUMEN)


def _area(surface: Surface) -> float:
    return float(face_areas(corners_of_surfaces([surface])).sum())
