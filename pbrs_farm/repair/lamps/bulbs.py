"""Add a bulb, a sphere that does not touch its lamp, to light sources without an emitting part.

No effects. The paper marks bulbs by hand (section 3); if a source gives only a light's position, a
sphere is added there, with the source's radius if it fits, else smaller, else slightly moved.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pbrs_farm.core.arrays import F64, triple
from pbrs_farm.core.house import (
    House,
    Item,
    ItemKind,
    Material,
    MaterialKind,
    Surface,
    corners_of_surfaces,
)
from pbrs_farm.core.mesh import area_vectors, distances_to_triangles, unit_vectors
from pbrs_farm.core.recipe import RepairFields
from pbrs_farm.geometry.solids import icosphere_mesh
from pbrs_farm.repair.repair_report import SourceRepair

_CLEARANCE = 0.97  # share of the free distance that a bulb's radius takes
_LEAST_RADIUS_M = 0.004  # a smaller bulb is moved instead
_N_MOVES = 400  # random places tried


def with_bulbs(house: House, fields: RepairFields) -> tuple[House, list[SourceRepair]]:
    """Give every light source of every lamp an emitting surface; reports the change for each.

    Surfaces named by a source become emitting; otherwise a sphere that fits in the lamp is added,
    smaller or moved if necessary. A piece with a light gets the kind lamp; items without a light are
    unchanged. Materials of emitting surfaces are appended, so that existing indices stay valid.
    """
    materials = _BulbMaterials(house.materials)
    items = []
    sources: list[SourceRepair] = []
    for item in house.items:
        if item.lights:
            item, done = _with_bulbs(item, materials, fields)
            sources += done
        items.append(item)
    return replace(house, items=tuple(items), materials=tuple(materials.all)), sources


class _BulbMaterials:
    """The house's materials, with bulb materials added on demand."""

    def __init__(self, materials: tuple[Material, ...]) -> None:
        self.all = list(materials)
        self._bulbs: dict[tuple[float, float, float], int] = {}  # colour -> material
        self._emitting: dict[int, int] = {}  # material as read -> its bulb

    def bulb(self, rgb_linear: tuple[float, float, float]) -> int:
        """Index of a bulb material for light of that colour."""
        if rgb_linear not in self._bulbs:
            self._bulbs[rgb_linear] = len(self.all)
            name = f"bulb_{len(self._bulbs)}"
            self.all.append(Material(name, kind=MaterialKind.BULB))
        return self._bulbs[rgb_linear]

    def emitting(self, material: int) -> int:
        """Index of the material as a bulb, with its own colour."""
        if self.all[material].kind is MaterialKind.BULB:
            return material
        if material not in self._emitting:
            self._emitting[material] = len(self.all)
            old = self.all[material]
            self.all.append(replace(old, name=f"{old.name}_bulb", kind=MaterialKind.BULB))
        return self._emitting[material]


def _with_bulbs(
    item: Item, materials: _BulbMaterials, fields: RepairFields
) -> tuple[Item, list[SourceRepair]]:
    surfaces = list(item.surfaces)
    corners = corners_of_surfaces(item.surfaces)
    lights, done = [], []
    for number, light in enumerate(item.lights):
        nominal = light.radius_m if light.radius_m > 0 else fields.bulb_radius_m
        emitting = tuple(k for k in light.emitting if len(surfaces[k].faces))
        radius, moved = nominal, 0.0
        if emitting:
            # Let the surfaces that the source names shine.
            for k in emitting:
                surfaces[k] = replace(
                    surfaces[k], material=materials.emitting(surfaces[k].material)
                )
        else:
            # Set a sphere where none shines; later bulbs must not touch it.
            centre, radius = _fitting_sphere(np.array(light.position), nominal, corners)
            moved = float(np.linalg.norm(centre - np.array(light.position)))
            emitting = (len(surfaces),)
            surfaces.append(icosphere("bulb", centre, radius, materials.bulb(light.rgb_linear)))
            light = replace(light, position=triple(centre), radius_m=radius)
            bulb = corners_of_surfaces(surfaces[-1:])
            corners = np.concatenate([corners, bulb])
        done.append(
            SourceRepair(
                item_id=item.id,
                source=number,
                bulb_added=not light.emitting or emitting != light.emitting,
                radius_given_m=_round_key(nominal),
                radius_m=_round_key(radius),
                moved_m=_round_key(moved),
            )
        )
        lights.append(replace(light, emitting=emitting))
    # Call a piece with a light a lamp, whatever the source calls it.
    kind = ItemKind.LAMP if not item.kind.is_structure else item.kind
    return replace(item, kind=kind, surfaces=tuple(surfaces), lights=tuple(lights)), done


def _fitting_sphere(position: F64, radius: float, corners: F64) -> tuple[F64, float]:
    """Centre and radius of a sphere near position that touches none of the triangles (F, 3, 3)."""
    free = _distance_to_lamp(position, corners)
    if free >= _LEAST_RADIUS_M / _CLEARANCE:
        return position, min(radius, _CLEARANCE * free)
    # Move the bulb to the roomiest place within its radius: a mesh passes through its centre.
    near = corners[distances_to_triangles(position, corners) < 4 * radius]
    rng = np.random.default_rng(0)  # fixed: repair is a function of the house
    steps = rng.normal(size=(_N_MOVES, 3))
    steps *= (radius * rng.random((_N_MOVES, 1)) ** (1 / 3)) / np.linalg.norm(
        steps, axis=1, keepdims=True
    )
    room = [_distance_to_lamp(position + step, near) for step in steps]
    best = int(np.argmax(room))
    return position + steps[best], max(min(radius, _CLEARANCE * room[best]), _LEAST_RADIUS_M / 4)


def _distance_to_lamp(point: F64, corners: F64) -> float:
    return float(distances_to_triangles(point, corners).min()) if len(corners) else np.inf


def icosphere(
    name: str, centre: F64, radius: float, material: int, *, n_splits: int = 2
) -> Surface:
    """A closed, inscribed sphere of 20 * 4^n_splits triangles, smooth normals, no uvs, about centre (3,)."""
    # Place the 12 vertices of an icosahedron by the golden ratio.
    g = (1 + 5**0.5) / 2
    points = [(s, t * g, 0.0) for s in (-1.0, 1.0) for t in (-1.0, 1.0)]
    points += [(0.0, x, y) for x, y, _ in points[:4]]
    points += [(y, 0.0, x) for x, y, _ in points[:4]]
    unit, faces = icosphere_mesh(unit_vectors(np.array(points)), n_splits)
    # Turn inward faces round.
    inward = (area_vectors(unit[faces]) * unit[faces[:, 0]]).sum(1) < 0
    faces = np.where(inward[:, None], faces[:, [0, 2, 1]], faces)
    return Surface(
        name,
        (centre + radius * unit).astype(np.float32),
        faces.astype(np.int32),
        material,
        None,
        unit.astype(np.float32),
    )


def _round_key(value: float) -> float:
    return round(value, 6)
