"""Estimated masses of items and parts, from volume and material density; no effects.

masses.csv has a construction per material: a wall of some thickness around a filling. Its densities are from
handbooks: chipboard 650 kg/m3 (EN 312 has 600 to 700), glass 2,500 (EN 572), stone and china 2,400, plastic 1,000,
paper 700, cloth 300 around foam and feathers of 40. Housings of appliances are steel sheets of 0.6 mm. A leaf of a
door is two skins and a frame around a light core, together as heavy as 19 mm of chipboard: 20 to 24 kg for
0.85 m x 2 m: our estimate, between a honeycomb core and tubular chipboard.
"""

from __future__ import annotations

import functools
import re
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.classes import DOOR
from pbrs_farm.core.house import House, Item, Material, MaterialKind, Surface, corners_of_surfaces
from pbrs_farm.core.mesh import closed_edge_share, face_areas, signed_volume
from pbrs_farm.core.record import Nyu40, Record, Several, read_csv
from pbrs_farm.geometry.convex_parts import connected

_GLASSY: Final = (MaterialKind.GLASS, MaterialKind.PANE, MaterialKind.MIRROR)
_CLOSED: Final = 0.9  # share of paired edges from which triangles bound a solid
_OWN: Final = ("generated#", "pbrs_farm#", "builtin#")  # Item.source_class of generated items
_DIGITS: Final = 3  # of a joint's mass in kilograms


class Construction(Record):
    """A row of masses.csv."""

    words: str  # of materials, between blanks; `steel` is in "brushed steel"
    only: Nyu40 | None = None  # the row is for this class alone
    classes: Several[Nyu40] = ()  # made of it if the material's name is not conclusive
    wall_kg_m3: float
    wall_m: float  # parts thinner than this are solid, metres
    core_kg_m3: float = 0.0


@functools.cache
def constructions() -> tuple[Construction, ...]:
    """The rows of masses.csv; the first that fits counts, the last is for all other materials."""
    return read_csv(Path(__file__).with_suffix(".csv"), Construction)


def weighed(house: House) -> House:
    """The house with the mass of each part that a joint moves, in its present materials.

    A mass stated by the source remains; of generated items, all masses are estimated.
    """
    return house.with_items(_weighed(item, house.materials) for item in house.items)


def _weighed(item: Item, materials: Sequence[Material]) -> Item:
    if not item.joints:
        return item
    is_own = item.source_class.startswith(_OWN)
    joints = []
    for joint in item.joints:
        mass = joint.mass_kg
        if is_own or not mass:
            moved = [s for s in item.surfaces if s.part == joint.part]
            mass = round(surfaces_kg(moved, materials, class_of_material(item)), _DIGITS)
        joints.append(replace(joint, mass_kg=mass))
    return replace(item, joints=tuple(joints))


def class_of_material(item: Item) -> int:
    """The NYU40 class that suggests an item's material; 0 = none.

    A sink whose doors open is a cabinet with a bowl.
    """
    return 0 if item.joints and item.nyu40 != DOOR else item.nyu40


def surfaces_kg(surfaces: Iterable[Surface], materials: Sequence[Material], nyu40: int) -> float:
    """Mass in kilograms of surfaces of an item, each connected body on its own."""
    return body_kg(
        (
            (solid, materials[surface.material])
            for surface in surfaces
            if len(surface.faces)
            for solid in connected(corners_of_surfaces((surface,)))
        ),
        nyu40,
    )


def body_kg(solids: Iterable[tuple[F64, Material]], nyu40: int) -> float:
    """Mass in kilograms of an item's connected bodies, given as triangles (F, 3, 3) and material.

    Models draw a chest as one closed shell, so of bodies thicker than their material's wall only the
    wall and a cushion's filling count. An open mesh weighs as a sheet of that thickness. nyu40: the
    item's class.
    """
    total = 0.0
    for corners, material in solids:
        made = _construction(material, nyu40)
        walls = made.wall_m * float(face_areas(corners).sum())
        volume = walls
        if closed_edge_share(corners.round(5)) >= _CLOSED:
            volume = abs(signed_volume(corners, corners.mean((0, 1))))
        total += made.wall_kg_m3 * min(volume, walls) + made.core_kg_m3 * max(volume - walls, 0.0)
    return total


def _construction(material: Material, nyu40: int) -> Construction:
    words = set(re.findall("[a-z]+", material.name.casefold()))
    if material.kind in _GLASSY:
        words.add("glass")
    rows = [row for row in constructions() if row.only in (None, nyu40)]
    match = next((row for row in rows if words & set(row.words.split())), None)
    if match is None and material.is_metal:
        return next(row for row in rows if "metal" in row.words.split())
    return match or next((row for row in rows if nyu40 in row.classes), rows[-1])
