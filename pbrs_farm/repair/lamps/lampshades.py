"""Parts of a lamp that enclose its bulb become a translucent, never an invisible, shade; no effects.

The share of each source's light that leaves its lamp is measured with rays. All lamps of a house are laid out in one
scene, far apart, so that one ray caster measures all of them without interference. Nearby walls, floors and ceilings
are included: a bowl below a ceiling keeps its light although it is open at the top.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pbrs_farm.core.arrays import F64, I64, Bools
from pbrs_farm.core.house import House, Item, Material, MaterialKind, Surface, corners_of_surfaces
from pbrs_farm.core.mesh import clipped_to_box, face_areas, unit_normals, unit_vectors
from pbrs_farm.core.recipe import RepairFields
from pbrs_farm.repair.measure.leaks import Occluder
from pbrs_farm.repair.repair_report import SourceRepair
from pbrs_farm.repair.structure.closed_shells import components, patch_from_surface

_MOST_SHADES = 16  # of one lamp
_LEAST_BLOCKED = 0.02  # share of the light that makes a part worth opening


def with_shades(
    house: House,
    sources: Sequence[SourceRepair],
    fields: RepairFields,
    occluder_from: Callable[[House], Occluder],
) -> tuple[House, list[SourceRepair]]:
    """The light output ratio of every source; shades where it is below fields.min_light_output_ratio.

    The ratio is what share of a bulb's light leaves the lamp. sources: of `with_bulbs`, in whose
    report the ratios go. Only whole connected parts of a surface become shades; LightPart.escape
    carries the ratio afterwards.
    """
    scene = lamp_scene_of_house(house, occluder_from)
    shades, measured = _measure_sources(scene, fields)
    materials = list(house.materials)
    items: list[Item] = []
    names: dict[str, tuple[str, ...]] = {}  # item id -> surfaces that became shades
    for k, item in enumerate(house.items):
        # Split the shades of this lamp off its surfaces.
        mine = [scene.parts[p] for p in shades if scene.parts[p][0] == k]
        for j in sorted({part[1] for part in mine}):
            numbers = [part[2] for part in mine if part[1] == j]
            is_shade = np.isin(scene.labels[k, j], numbers)
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


def _measure_sources(
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
        output = light_output_of_source(scene, item, source, shades, fields.shade_transmission)
        # Stop once enough light escapes, or no part blocks much of the remainder.
        worst = int(np.argmax(output.blocked)) if len(output.blocked) else -1
        mine = sum(scene.parts[p][0] == item for p in shades)
        if output.ratio >= fields.min_light_output_ratio or mine >= _MOST_SHADES:
            return output
        if worst < 0 or output.blocked[worst] < _LEAST_BLOCKED:
            return output
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
    """The item with some faces of surface j as an appended surface, so that LightPart.emitting stays valid."""
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


N_RAYS = 4000  # standard error below 0.8 % of the ratio
_SEE_THROUGH = frozenset({MaterialKind.GLASS, MaterialKind.PANE, MaterialKind.BULB})
_SPACING_M = 30.0  # between lamps, so that none meets another's rays
_REACH_M = 14.0  # a ray that gets this far has left its lamp
_MAX_LAYERS = 12  # of shade that one ray passes, or bounces off the structure
# Structure within this distance of the lamp's bounds reflects its light, metres.
_AT_LAMP_M = 0.05
_NEAR_M = 0.5  # a bulb that meets structure from behind within this distance is inside it
_BOUNCE = 0.7  # reflectance of structure: a light paint
_STRUCTURE = -1  # in part_of_face
Part = tuple[int, int, int]  # a connected part of a lamp: item, surface, number of the part


@dataclass(frozen=True, slots=True, eq=False)
class LampScene:
    """Every lamp of a house laid out for measuring."""

    house: House
    occluder: Occluder | None  # None where no lamp has a face that stops light
    parts: tuple[Part, ...]
    part_of_face: I64  # (F,) part index of each face; _STRUCTURE for walls, floors and ceilings
    normals: F64  # (F, 3) unit
    offset_of: dict[int, F64]  # item -> (3,) translation of that lamp
    bounds_of: dict[int, F64]  # item -> (2, 3) bounds of that lamp in the scene
    labels: dict[tuple[int, int], I64]  # (item, surface) -> (F,) part of each face


@dataclass(frozen=True, slots=True, eq=False)
class LightOutput:
    """Share of a source's light that leaves its lamp."""

    ratio: float  # light output ratio, 0..1
    blocked: F64  # (n_parts,) share of the light that each part stops


def lamp_scene_of_house(house: House, occluder_from: Callable[[House], Occluder]) -> LampScene:
    """A caster over the lamps, far apart, with structure near them, without glass and bulbs; or None."""
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
            labels[k, j] = np.unique(
                components([patch_from_surface(s, k)])[0], return_inverse=True
            )[1]
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
        return LampScene(
            house, None, (), part_of_face, np.zeros((0, 3)), offset_of, bounds_of, labels
        )
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
    """Share of N_RAYS diffuse rays of a bulb that leave its lamp, each shade weakening by transmission."""
    rng = np.random.default_rng([item, source])
    origins, directions = _rays_of_source(scene, item, source, rng)
    # The last row of both is the structure, whose index is _STRUCTURE = -1.
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
        directions[bounced] = _cosine_directions(normals[bounced], rng)
        weight = weight * np.where(bounced, _BOUNCE, transmission)
        going = through | bounced
        directions, weight = directions[going], weight[going]
        origins = points[going] + 1e-4 * directions  # off the face just met
    return LightOutput(ratio, blocked[:-1])


def _rays_of_source(
    scene: LampScene, item: int, source: int, rng: np.random.Generator
) -> tuple[F64, F64]:
    """Rays from a source's bulb at its position in the scene."""
    lamp = scene.house.items[item]
    emitting = [lamp.surfaces[k] for k in lamp.lights[source].emitting]
    origins, directions = diffuse_rays(emitting, N_RAYS, rng)
    return origins + scene.offset_of[item], directions


def diffuse_rays(surfaces: Sequence[Surface], n: int, rng: np.random.Generator) -> tuple[F64, F64]:
    """n rays (origins a little off the face, unit directions), (n, 3) each, as of a diffuse emitter's fronts."""
    corners = corners_of_surfaces(surfaces)
    areas, normals = face_areas(corners), unit_normals(corners)
    # Choose faces by area, points uniformly on them.
    chosen = rng.choice(len(areas), n, p=areas / areas.sum())
    u, v = np.sqrt(rng.random(n)), rng.random(n)
    weights = np.stack([1 - u, u * (1 - v), u * v], 1)
    points = np.einsum("nk,nki->ni", weights, corners[chosen])
    directions = _cosine_directions(normals[chosen], rng)
    step = min(1e-4, 0.01 * float(np.sqrt(areas.sum())))  # off the bulb
    return points + step * normals[chosen], directions


def _cosine_directions(normals: F64, rng: np.random.Generator) -> F64:
    """Unit directions about normals (N, 3) by the cosine: points of a unit sphere on the face."""
    sphere = unit_vectors(rng.normal(size=normals.shape))
    return unit_vectors(sphere + normals)
