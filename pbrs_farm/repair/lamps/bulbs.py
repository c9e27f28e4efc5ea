"""Light sources without an emitting part get a bulb: a sphere that touches nothing of its lamp.

No effects. Paper section 3 marks bulbs by hand; where a source gives only a light's position, a
sphere stands there, of the source's radius where it fits, else smaller, else a little moved.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pbrs_farm.core.arrays import F64, I64, Bools, triple
from pbrs_farm.core.house import (
    House,
    Item,
    ItemKind,
    Material,
    MaterialKind,
    Surface,
    corners_of_surfaces,
)
from pbrs_farm.core.mesh import (
    area_vectors,
    clipped_to_box,
    distances_to_triangles,
    face_areas,
    unit_normals,
)
from pbrs_farm.core.recipe import RepairFields
from pbrs_farm.repair.measure.leaks import Occluder
from pbrs_farm.repair.repair_report import SourceRepair
from pbrs_farm.repair.structure.closed_shells import components, patch_from_surface

_CLEARANCE = 0.97  # of the free distance that a bulb fills
_LEAST_RADIUS_M = 0.004  # a smaller bulb is moved instead
_N_MOVES = 400  # random places tried


def with_bulbs(house: House, fields: RepairFields) -> tuple[House, list[SourceRepair]]:
    """Every light source of every lamp with an emitting surface, and what was done for each."""
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
    """The house's materials, with bulb materials added as they are asked for."""

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
        given = light.radius_m if light.radius_m > 0 else fields.bulb_radius_m
        emitting = tuple(k for k in light.emitting if len(surfaces[k].faces))
        radius, moved = given, 0.0
        if emitting:
            # Let the surfaces that the source names shine.
            for k in emitting:
                surfaces[k] = replace(
                    surfaces[k], material=materials.emitting(surfaces[k].material)
                )
        else:
            # Set a sphere where none shines; later bulbs must not touch it.
            centre, radius = _fitting_sphere(np.array(light.position), given, corners)
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
                radius_given_m=_rounded(given),
                radius_m=_rounded(radius),
                moved_m=_rounded(moved),
            )
        )
        lights.append(replace(light, emitting=emitting))
    # Call a piece with a light a lamp, whatever the source calls it.
    kind = ItemKind.LAMP if not item.kind.is_structure else item.kind
    return replace(item, kind=kind, surfaces=tuple(surfaces), lights=tuple(lights)), done


def _fitting_sphere(position: F64, radius: float, corners: F64) -> tuple[F64, float]:
    """Centre and radius of a sphere near position that touches none of the triangles (F, 3, 3)."""
    free = _free(position, corners)
    if free >= _LEAST_RADIUS_M / _CLEARANCE:
        return position, min(radius, _CLEARANCE * free)
    # Move the bulb to the roomiest place within its radius: a mesh passes through its centre.
    near = corners[distances_to_triangles(position, corners) < 4 * radius]
    rng = np.random.default_rng(0)  # fixed: repair is a function of the house
    steps = rng.normal(size=(_N_MOVES, 3))
    steps *= (radius * rng.random((_N_MOVES, 1)) ** (1 / 3)) / np.linalg.norm(steps, axis=1, keepdims=True)  # fmt: skip
    room = [_free(position + step, near) for step in steps]
    best = int(np.argmax(room))
    return position + steps[best], max(min(radius, _CLEARANCE * room[best]), _LEAST_RADIUS_M / 4)


def _free(point: F64, corners: F64) -> float:
    return float(distances_to_triangles(point, corners).min()) if len(corners) else np.inf


def icosphere(
    name: str, centre: F64, radius: float, material: int, *, n_splits: int = 2
) -> Surface:
    """A closed sphere of 20 * 4^n_splits triangles whose corners lie on it, smooth normals."""
    # Place the 12 vertices of an icosahedron by the golden ratio.
    g = (1 + 5**0.5) / 2
    points = [(s, t * g, 0.0) for s in (-1.0, 1.0) for t in (-1.0, 1.0)]
    points += [(0.0, x, y) for x, y, _ in points[:4]]
    points += [(y, 0.0, x) for x, y, _ in points[:4]]
    unit = np.array(points) / np.linalg.norm(points, axis=1, keepdims=True)
    near = np.linalg.norm(unit[:, None] - unit[None], axis=2) < 1.2  # an edge is 1.05 long
    faces = np.array(
        [
            (i, j, k)
            for i in range(12)
            for j in range(i + 1, 12)
            for k in range(j + 1, 12)
            if near[i, j] and near[j, k] and near[i, k]
        ]
    )
    # Halve the edges, then turn inward faces round.
    for _ in range(n_splits):
        unit, faces = _split(unit, faces)
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


def _split(unit: F64, faces: I64) -> tuple[F64, I64]:
    # Make one middle vertex for the two faces of an edge, on the sphere.
    edges = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    pairs, inverse = np.unique(edges, axis=0, return_inverse=True)
    middle = unit[pairs].mean(1)
    middle /= np.linalg.norm(middle, axis=1, keepdims=True)
    ab, bc, ca = np.ravel(inverse).reshape(3, -1) + len(unit)
    # Put four faces in the place of each.
    a, b, c = faces.T
    parts = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
    return np.concatenate([unit, middle]), np.concatenate([np.stack(p, 1) for p in parts])


def _rounded(value: float) -> float:
    return round(value, 6)


# How much of each source's light leaves its lamp, measured with rays.
# All lamps of a house stand side by side in one scene, far apart, so that one ray caster serves
# them all and no lamp meets another's rays. With each stands what is near it of walls, floors and
# ceilings: a cup below a ceiling keeps its light though it is open above.


N_RAYS = 4000  # standard error below 0.8 % of the ratio
_SEE_THROUGH = frozenset({MaterialKind.GLASS, MaterialKind.PANE, MaterialKind.BULB})
_SPACING_M = 30.0  # between lamps, so that none meets another's rays
_REACH_M = 14.0  # a ray that gets this far has left its lamp
_MAX_LAYERS = 12  # of shade that one ray passes, or bounces off the structure
# Structure this near the lamp's bounds bounces its light; what is farther off is the room's.
_AT_LAMP_M = 0.05
_NEAR_M = 0.5  # a bulb that sees structure from behind this near is inside of it
_BOUNCE = 0.7  # reflectance of structure: a light paint
_STRUCTURE = -1  # in part_of_face

Part = tuple[int, int, int]  # a connected part of a lamp: item, surface, number of the part


@dataclass(frozen=True, slots=True, eq=False)
class LampScene:
    """Every lamp of a house laid out for measuring."""

    house: House
    occluder: Occluder | None  # None where no lamp has a face that stops light
    parts: tuple[Part, ...]
    part_of_face: I64  # (F,) index into parts, of each face; _STRUCTURE = of none
    normals: F64  # (F, 3) unit
    offset_of: dict[int, F64]  # item -> (3,) translation of that lamp
    bounds_of: dict[int, F64]  # item -> (2, 3) bounds of that lamp in the scene
    labels: dict[tuple[int, int], I64]  # (item, surface) -> (F,) part of each face


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
    numbers: list[I64] = []
    offset_of: dict[int, F64] = {}
    bounds_of: dict[int, F64] = {}
    structure = _structure_corners(house)
    labels: dict[tuple[int, int], I64] = {}
    for n, k in enumerate(lamps):
        item = house.items[k]
        # Stand the lamp in its cell of a square grid, the first bulb in the middle.
        row, column = divmod(n, side)
        cell = np.array([column - side / 2, 0.0, row - side / 2]) * _SPACING_M
        offset_of[k] = cell - np.array(item.lights[0].position)
        bounds_of[k] = item.bounds + offset_of[k]
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
        # Add the structure near it.
        low, high = item.bounds
        near = clipped_to_box(structure, low - _NEAR_M, high + _NEAR_M)
        if len(near) and not item.kind.is_structure:
            numbers.append(np.full(len(near), _STRUCTURE))
            surfaces.append(_surface_of(near + offset_of[k]))
        items.append(replace(item, surfaces=tuple(surfaces), lights=(), box=None))
    scene = house.with_items(items)
    part_of_face = np.concatenate([np.zeros(0, np.int64), *numbers])
    if not len(part_of_face):
        return LampScene(house, None, (), part_of_face, np.zeros((0, 3)), offset_of, bounds_of, labels)  # fmt: skip
    normals = unit_normals(corners_of_surfaces(s for _, _, _, s in scene.surfaces()))
    occluder = occluder_from(scene)
    return LampScene(
        house, occluder, tuple(parts), part_of_face, normals, offset_of, bounds_of, labels
    )


def _structure_corners(house: House) -> F64:
    """(F, 3, 3) corners of all walls, floors and ceilings."""
    return corners_of_surfaces(
        s for item in house.items if item.kind.is_structure for s in item.surfaces
    )


def _surface_of(corners: F64) -> Surface:
    faces = np.arange(3 * len(corners), dtype=np.int32).reshape(-1, 3)
    return Surface("structure", corners.reshape(-1, 3).astype(np.float32), faces, 0)


def light_output_of_source(
    scene: LampScene, item: int, source: int, shades: Sequence[int], transmission: float
) -> LightOutput:
    """Light output of one source from its own lamp, by N_RAYS rays that leave its bulb diffusely.

    shades: indices of parts that let light through, each time weakened by transmission.
    """
    rng = np.random.default_rng([item, source])
    origins, directions = _rays_of_source(scene, item, source, rng)
    # The last row of both stands for the structure, which is _STRUCTURE = -1.
    blocked = np.zeros(len(scene.parts) + 1)
    is_shade = np.zeros(len(scene.parts) + 1, np.bool_)
    is_shade[list(shades)] = True

    # Follow the rays through the shades, layer by layer, until each is stopped or out.
    if scene.occluder is None:
        return LightOutput(1.0, blocked[:-1])
    weight = np.full(len(origins), 1.0 / max(len(origins), 1))
    ratio = 0.0
    for _ in range(_MAX_LAYERS):
        if not len(origins):
            break
        distance, face = scene.occluder.first_hit(
            origins.astype(np.float32), directions.astype(np.float32), _REACH_M
        )
        points = origins + directions * np.where(face < 0, 0.0, distance)[:, None]
        part = np.where(face < 0, _STRUCTURE, scene.part_of_face[face])
        # Let out what meets nothing, or the front of structure away from the lamp.
        normals = scene.normals[face]
        on_structure = (face >= 0) & (part == _STRUCTURE)
        at_front = on_structure & ((directions * normals).sum(1) < 0)
        # Most rays meet structure from behind: the bulb is inside of it.
        if (on_structure & ~at_front).mean() > 0.5 and ratio == 0:
            return LightOutput(0.0, blocked[:-1])
        low, high = scene.bounds_of[item]
        at_lamp = ((points > low - _AT_LAMP_M) & (points < high + _AT_LAMP_M)).all(1)
        bounced, out = at_front & at_lamp, (face < 0) | (at_front & ~at_lamp)
        ratio += float(weight[out].sum())
        # Charge a stopped ray to its part; let the others through, weakened.
        through = is_shade[part]
        stopped = ~(out | bounced | through)
        np.add.at(blocked, part[stopped], weight[stopped])
        # Bounce diffusely what meets the front of structure at the lamp; what meets a back is in it.
        directions[bounced] = _scattered(normals[bounced], rng)
        weight = weight * np.where(bounced, _BOUNCE, transmission)
        going = through | bounced
        directions, weight = directions[going], weight[going]
        origins = points[going] + 1e-4 * directions  # off the face just met
    return LightOutput(ratio, blocked[:-1])


def _rays_of_source(
    scene: LampScene, item: int, source: int, rng: np.random.Generator
) -> tuple[F64, F64]:
    """Rays from a source's bulb where it stands in the scene."""
    lamp = scene.house.items[item]
    emitting = [lamp.surfaces[k] for k in lamp.lights[source].emitting]
    origins, directions = diffuse_rays(emitting, N_RAYS, rng)
    return origins + scene.offset_of[item], directions


def diffuse_rays(surfaces: Sequence[Surface], n: int, rng: np.random.Generator) -> tuple[F64, F64]:
    """n rays (origins, unit directions) that leave the surfaces' fronts as a diffuse emitter's."""
    corners = corners_of_surfaces(surfaces)
    areas, normals = face_areas(corners), unit_normals(corners)
    # Choose faces by area, points uniformly on them.
    chosen = rng.choice(len(areas), n, p=areas / areas.sum())
    u, v = np.sqrt(rng.random(n)), rng.random(n)
    weights = np.stack([1 - u, u * (1 - v), u * v], 1)
    points = np.einsum("nk,nki->ni", weights, corners[chosen])
    directions = _scattered(normals[chosen], rng)
    step = min(1e-4, 0.01 * float(np.sqrt(areas.sum())))  # off the bulb
    return points + step * normals[chosen], directions


def _scattered(normals: F64, rng: np.random.Generator) -> F64:
    """Unit directions about normals (N, 3) by the cosine: points of a unit sphere on the face."""
    sphere = rng.normal(size=normals.shape)
    sphere /= np.maximum(np.linalg.norm(sphere, axis=1, keepdims=True), 1e-12)
    directions = sphere + normals
    return np.asarray(
        directions / np.maximum(np.linalg.norm(directions, axis=1, keepdims=True), 1e-12)
    )


# Lamps that keep their light: what encloses the bulb becomes a translucent shade. No effects.
# Never invisible, and never more than a lamp's own part.


_MOST_SHADES = 16  # of one lamp
_LEAST_BLOCKED = 0.02  # share of the light that makes a part worth opening


def with_shades(
    house: House,
    sources: Sequence[SourceRepair],
    fields: RepairFields,
    occluder_from: Callable[[House], Occluder],
) -> tuple[House, list[SourceRepair]]:
    """The light output ratio of every source; shades where it is below fields.min_escape."""
    scene = lamp_scene_of_house(house, occluder_from)
    shades, measured = _measured(scene, fields)
    materials = list(house.materials)
    items: list[Item] = []
    names: dict[str, tuple[str, ...]] = {}  # item id -> surfaces that became shades
    for k, item in enumerate(house.items):
        # Split the shades of this lamp off its surfaces.
        mine = [scene.parts[p] for p in shades if scene.parts[p][0] == k]
        for j in sorted({part[1] for part in mine}):
            wanted = [part[2] for part in mine if part[1] == j]
            is_shade = np.isin(scene.labels[k, j], wanted)
            item = _split_off(item, j, is_shade, _shade_of(item.surfaces[j].material, materials))
            names[item.id] = (*names.get(item.id, ()), house.items[k].surfaces[j].name)
        lights = tuple(
            replace(light, escape=_rounded_ratio(measured[k, n][1].ratio))
            for n, light in enumerate(item.lights)
        )
        items.append(replace(item, lights=lights))

    # Add the ratios and the shades to the report of each source.
    index = {item.id: k for k, item in enumerate(house.items)}
    done = []
    for s in sources:
        before, after = (_rounded_ratio(x.ratio) for x in measured[index[s.item_id], s.source])
        shaded = {"escape_before": before, "escape": after, "shades": names.get(s.item_id, ())}
        done.append(s.model_copy(update=shaded))
    return replace(house, items=tuple(items), materials=tuple(materials)), done


def _measured(
    scene: LampScene, fields: RepairFields
) -> tuple[list[int], dict[tuple[int, int], tuple[LightOutput, LightOutput]]]:
    """Parts that become shades; (item, source) -> its light output without and with them."""
    shades: list[int] = []
    measured: dict[tuple[int, int], tuple[LightOutput, LightOutput]] = {}
    for k, item in enumerate(scene.house.items):
        for source in range(len(item.lights)):
            before = light_output_of_source(scene, k, source, (), fields.shade_transmission)
            measured[k, source] = (before, _with_more_shades(scene, k, source, shades, fields))
    if shades:
        # Measure every source again: a shade may serve several of one lamp.
        measured = {
            key: (before, light_output_of_source(scene, *key, shades, fields.shade_transmission))
            for key, (before, _) in measured.items()
        }
    return shades, measured


def _with_more_shades(
    scene: LampScene, item: int, source: int, shades: list[int], fields: RepairFields
) -> LightOutput:
    """Add to shades the parts that stop most of this source's light, until enough gets out."""
    while True:
        found = light_output_of_source(scene, item, source, shades, fields.shade_transmission)
        # Stop when enough gets out, or no part stops much of what is left.
        worst = int(np.argmax(found.blocked)) if len(found.blocked) else -1
        mine = sum(scene.parts[p][0] == item for p in shades)
        if found.ratio >= fields.min_escape or mine >= _MOST_SHADES:
            return found
        if worst < 0 or found.blocked[worst] < _LEAST_BLOCKED:
            return found
        shades.append(worst)


def _shade_of(material: int, materials: list[Material]) -> int:
    """Index of the material as a shade, added at the end if it is not there yet."""
    shade = replace(
        materials[material], name=f"{materials[material].name}_shade", kind=MaterialKind.SHADE
    )
    if shade not in materials:
        materials.append(shade)
    return materials.index(shade)


def _split_off(item: Item, j: int, is_shade: Bools, material: int) -> Item:
    """The item with those faces of its surface j in the shade's material.

    A surface that is split keeps its place, its shade comes last: LightPart.emitting still holds.
    """
    surfaces = list(item.surfaces)
    s: Surface = surfaces[j]
    if is_shade.all():
        surfaces[j] = replace(s, material=material)
    else:
        surfaces[j] = replace(s, faces=np.ascontiguousarray(s.faces[~is_shade]))
        faces = np.ascontiguousarray(s.faces[is_shade])
        surfaces.append(replace(s, name=f"{s.name}_shade", faces=faces, material=material))
    return replace(item, surfaces=tuple(surfaces))


def _rounded_ratio(value: float) -> float:
    return round(value, 5)
