"""Gives surfaces a finish of paint, wood or metal; effects: adds materials and textures to the house."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.house import Item, Material, MaterialKind, Surface
from pbrs_farm.dress.box_mapping import box_mapped
from pbrs_farm.dress.finishes import grain_pattern
from pbrs_farm.dress.mutable_house import MutableHouse
from pbrs_farm.dress.patterns import pattern_material
from pbrs_farm.dress.style import Metal, Rgb, Wood


@dataclass(frozen=True, slots=True)
class Finish:
    """Wood if given, else metal, else sRGB paint 0..1 with a roughness."""

    name: str
    paint: Rgb = (0.93, 0.925, 0.91)
    roughness: float = 0.4
    wood: Wood | None = None
    metal: Metal | None = None


FINISHED = "coated"
"""First word of the names of these materials, which the pass `parts` skips."""

_SHEEN = (0.4, 0.4, 0.4)


def with_finish(house: MutableHouse, surface: Surface, finish: Finish, axes: F64) -> Surface:
    """The surface with a finish, the grain of wood along the item's axes (3, 3)."""
    if finish.wood is None:
        return replace(surface, material=number_of_finish(house, finish))
    veneer = pattern_material(house, grain_pattern(house, finish.wood))
    mapped = box_mapped(surface, axes, veneer.size_m)
    return replace(mapped, material=veneer.number)


def item_with_finish(house: MutableHouse, item: Item, finish: Finish) -> Item:
    """Apply the finish to every plain opaque surface; returns the same item if it has none."""
    if not has_plain(house, item):
        return item
    axes = np.eye(3) if item.box is None else item.box.axes
    return replace(
        item,
        surfaces=tuple(
            with_finish(house, s, finish, axes) if is_plain(house.materials[s.material]) else s
            for s in item.surfaces
        ),
    )


def has_plain(house: MutableHouse, item: Item) -> bool:
    """True if a finish would change a surface: glass, mirrors, bulbs and textured ones never change."""
    return any(is_plain(house.materials[s.material]) for s in item.surfaces)


def is_plain(material: Material) -> bool:
    """Whether a finish would cover it: opaque and without a picture."""
    is_solid = material.kind is MaterialKind.OPAQUE and material.opacity == 1
    return is_solid and material.texture_id is None


def number_of_finish(house: MutableHouse, finish: Finish) -> int:
    """Number in house.materials of a finish as a plain material, of wood its mean colour; added if new."""
    return house.material(material_of_finish(finish))


def material_of_finish(finish: Finish) -> Material:
    """The material of a finish without a picture; wood counts as its mean colour."""
    if finish.metal is not None:
        return _metal_material(finish.metal)
    paint = finish.paint if finish.wood is None else finish.wood.mean
    return _paint_material(finish.name, paint, finish.roughness)


def _paint_material(name: str, colour: Rgb, roughness: float) -> Material:
    r, g, b = (round(c, 4) for c in colour)
    code = "".join(f"{round(255 * c):02x}" for c in (r, g, b))
    return Material(
        f"{FINISHED} {name} {code} {roughness:.2f}",
        diffuse=(r, g, b),
        specular=_SHEEN,
        shininess=round(2.0 / roughness**4 - 2.0, 1),
        roughness=roughness,
    )


def _metal_material(metal: Metal) -> Material:
    # Nearly all light is in the highlight, as the metals of furniture have it.
    r, g, b = (round(0.4 * c, 4) for c in metal.colour)
    return Material(
        f"{FINISHED} {metal.name}",
        diffuse=(r, g, b),
        specular=metal.colour,
        roughness=metal.roughness,
        shininess=round(2 / max(metal.roughness, 0.1) ** 4 - 2, 1),
    )
