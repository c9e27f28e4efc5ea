"""Nodes of a SUNCG house -> placed items with lights (docs/spec/suncg.md sections 1.3-2). Reads their models.

An MTL has colours alone: the glass of a mirror or dressing table is found by its shape.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Final, TypeVar

import numpy as np

from pbrs_farm.core.arrays import F64, triple
from pbrs_farm.core.classes import DRESSER, MIRROR, OTHERPROP
from pbrs_farm.core.frames import transform_points
from pbrs_farm.core.house import Item, ItemKind, LightPart, Material, MaterialKind, Surface, part_of
from pbrs_farm.core.lighting import BULB_RADIUS_M, PowerUnit
from pbrs_farm.core.mesh import area_vectors, triangle_corners
from pbrs_farm.geometry.connected import connected_faces
from pbrs_farm.home.names import words_of
from pbrs_farm.read.common.arch_elements import Arch
from pbrs_farm.read.common.house_builder import structure_item
from pbrs_farm.read.common.model_materials import (
    DamagedModel,
    ModelCache,
    ModelMaterials,
    ParsedModel,
)
from pbrs_farm.read.common.notes import Notes
from pbrs_farm.read.common.placed_mesh import oriented_box, placed
from pbrs_farm.read.common.source_files import RootFolder
from pbrs_farm.read.mesh.mtl import ObjMaterial
from pbrs_farm.read.suncg.arch_json import arch_items
from pbrs_farm.read.suncg.house_json import Node
from pbrs_farm.read.suncg.metadata import LampMaterials, ModelClass, Tables

_T = TypeVar("_T")

# Grounds and boxes have no row in the category table and stay unlabelled, as published.
UNLABELLED: Final = 0

_WALL_GROUP: Final = re.compile(r"Wall(?:Inside|Outside)#.*_(\d+)")

BOX_FACES: Final = ((1, 1, 0), (1, -1, 1), (0, 1, 2), (0, -1, 3), (2, 1, 4), (2, -1, 5))
"""(axis, sign, material) of a Box's faces in sstk's order, which made the published pictures.

GAPS exchanges the materials of -x and +x (docs/spec/suncg.md section 1.5).
"""


@dataclass(frozen=True, slots=True)
class ReaderContext:
    """Shared inputs for building nodes."""

    house: str  # id
    folder: RootFolder  # the SUNCG root
    tables: Tables
    materials: ModelMaterials
    models: ModelCache
    notes: Notes
    world_from_house: F64  # (4, 4) scale and axes
    arch: Arch | None = None


def object_item(context: ReaderContext, node: Node, room_id: str | None) -> Item | None:
    """An Object node; None (with a note) where its model is missing or has no area."""
    try:
        loaded = _object_model(context, node)
    except DamagedModel as error:
        # A library is shared by many houses: one damaged model costs its objects only.
        context.notes.add("unreadable-model", node.place, f"{error.message}; left out")
        return None
    if loaded is None:
        text = f"object/{node.model_id} does not exist; left out"
        context.notes.add("missing-model", node.place, text)
        return None
    variant, model = loaded
    model_row = _row_of_model(context.tables.classes, variant, node.model_id)
    model_class = model_row or ModelClass(node.model_id, OTHERPROP, ItemKind.OBJECT)
    if model_row is None and context.tables.classes:
        text = "is not in ModelCategoryMapping.csv; it is otherprop"
        context.notes.add("unmapped-class", f"object/{node.model_id}", text)
    # Place the meshes; bulbs stay apart, so that lights can own them.
    lamp = _row_of_model(context.tables.lamps, variant, node.model_id) or LampMaterials((), ())
    world_from_model = context.world_from_house @ node.house_from_model
    surfaces, bulbs = _surfaces_and_bulbs(context, node, model, model_class, lamp)
    if not surfaces:
        context.notes.add(
            "empty-model", node.place, f"object/{node.model_id} has no area; left out"
        )
        return None
    # Pair the lights of the table with the bulbs of the mesh.
    lights = _row_of_model(context.tables.lights, variant, node.model_id) or ()
    placed_lights: tuple[LightPart, ...] = ()
    if lights or bulbs:
        in_world = [placed_light(light, world_from_model) for light in lights]
        placed_lights = with_emitting_bulbs(in_world, surfaces, bulbs)
    return Item(
        id=node.id,
        name=model_class.name.replace("_", " ") or node.model_id,
        kind=model_class.kind,
        level_id=node.level_id,
        surfaces=surfaces,
        nyu40=model_class.nyu40,
        source_class=node.model_id,
        room_id=room_id,
        lights=placed_lights,
        box=oriented_box(model.meshes, world_from_model),
        tags=_tags(context, node, model_class, is_known=model_row is not None),
    )


def _row_of_model(table: dict[str, _T], variant: str, model_id: str) -> _T | None:
    """The row of a model; a variant such as 122_0 has the row of its model (docs/spec/suncg.md section 2)."""
    for name in (variant, model_id, re.sub(r"_\d$", "", model_id)):
        if name in table:
            return table[name]
    return None


def _object_model(context: ReaderContext, node: Node) -> tuple[str, ParsedModel] | None:
    """The mesh of the node's state: state k > 0 is `<id>_<k-1>.obj` where that exists."""
    base = f"object/{node.model_id}/"
    # Try the state's own mesh first, then the variants that the table lists, then the model's.
    names = [node.model_id]
    if node.state > 0:
        listed = context.tables.variants.get(node.model_id, ())
        names = [*listed[node.state : node.state + 1], node.model_id]
        names.insert(0, f"{node.model_id}_{node.state - 1}")
    for name in names:
        model = context.models.model(f"{base}{name}.obj", f"{base}{node.model_id}.mtl")
        if model is not None:
            return name, model
    return None


def _surfaces_and_bulbs(
    context: ReaderContext, node: Node, model: ParsedModel, cls: ModelClass, lamp: LampMaterials
) -> tuple[tuple[Surface, ...], list[int]]:
    """(surfaces in the model's order, indices of the bulbs)."""
    world_from_model = context.world_from_house @ node.house_from_model
    # Glass in a wall is a pane: panes do not refract light.
    is_opening = cls.kind in (ItemKind.WINDOW, ItemKind.DOOR)
    clear = MaterialKind.PANE if is_opening else MaterialKind.GLASS
    surfaces: list[Surface] = []
    bulbs: list[int] = []
    if cls.nyu40 == MIRROR:
        glass = mirror_slot(model)
    else:
        glass = mirror_slot_of_table(model, words_of(cls.name), cls.nyu40)
    for mesh, slot in zip(model.meshes, model.slots, strict=True):
        # Take the model's own material under what the node says of it.
        mtl = model.mtl[slot] if slot >= 0 else None
        override = node.overrides[slot] if 0 <= slot < len(node.overrides) else None
        material = context.materials.material(mtl, override, place=node.place, clear=clear)
        if glass is not None and slot == glass:
            material = as_mirror(material)
        # Materials that the lamp table names become bulbs and shades.
        is_bulb = slot in lamp.bulbs
        if is_bulb:
            material = replace(material, kind=MaterialKind.BULB)
        elif slot in lamp.shades and material.kind is MaterialKind.OPAQUE:
            material = replace(material, kind=MaterialKind.SHADE)
        name = mesh.material or "grey"
        surface = placed(
            mesh, world_from_model, name=name, material=context.materials.library.index(material)
        )
        if surface is None:
            continue
        # Split bulbs in one mesh: each is a light source.
        parts = separate_bulbs(surface) if is_bulb else (surface,)
        bulbs += range(len(surfaces), len(surfaces) + len(parts)) if is_bulb else ()
        surfaces += parts
    return tuple(surfaces), bulbs


def _tags(
    context: ReaderContext, node: Node, model_class: ModelClass, *, is_known: bool
) -> tuple[str, ...]:
    # Believe the transform: it is what places the mesh.
    mirrored = bool(np.linalg.det(node.house_from_model[:3, :3]) < 0)
    if node.is_mirrored is not None and node.is_mirrored != mirrored:
        text = f"isMirrored says {node.is_mirrored}, the transform says {mirrored}, which is used"
        context.notes.add("mirrored-differs", node.place, text)
    tags = ["mirrored"] if mirrored else []
    tags += [] if is_known else ["unmapped"]
    tags += ["structure"] if model_class.structure else []
    return tuple(tags)


def box_item(context: ReaderContext, node: Node, room_id: str | None) -> Item | None:
    """A Box node: six faces centred on its origin, uv in metres; None if it has no extent."""
    # Make each face that has an extent, with the material at its own position.
    half = np.array(node.dimensions) / 2
    world_from_box = context.world_from_house @ node.house_from_model
    surfaces = []
    for axis, sign, slot in BOX_FACES:
        override = node.overrides[slot] if slot < len(node.overrides) else None
        material = context.materials.material(
            None, override, place=node.place, clear=MaterialKind.GLASS
        )
        index = context.materials.library.index(material)
        if np.count_nonzero(np.delete(half, axis)) == 2:
            surfaces.append(_box_face(half, axis, sign, world_from_box, index))
    if not surfaces:
        context.notes.add("empty-model", node.place, "a Box without extent; left out")
        return None
    return Item(
        node.id,
        "box",
        ItemKind.OBJECT,
        node.level_id,
        tuple(surfaces),
        UNLABELLED,
        "Box",
        room_id,
        tags=("box", "unmapped"),
    )


def _box_face(half: F64, axis: int, sign: int, world_from_box: F64, index: int) -> Surface:
    # Lay the corners around the face's two other axes.
    a, b = {0: (2, 1), 1: (0, 2), 2: (0, 1)}[axis]
    corners = np.zeros((4, 3))
    corners[:, axis] = sign * half[axis]
    corners[:, a] = np.array([-1, 1, 1, -1]) * half[a]
    corners[:, b] = np.array([-1, -1, 1, 1]) * half[b]
    # Turn the winding so that the face looks outward, also in a mirrored box.
    outward = np.cross(np.eye(3)[a], np.eye(3)[b])[axis] * sign > 0
    is_mirrored = np.linalg.det(world_from_box[:3, :3]) < 0
    faces = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    world = transform_points(world_from_box, corners)
    return Surface(
        name=f"{'-+'[sign > 0]}{'xyz'[axis]}",
        positions=world.astype(np.float32),
        faces=np.ascontiguousarray(faces if outward != is_mirrored else faces[:, ::-1]),
        material=index,
        uvs=(corners[:, [a, b]] + half[[a, b]]).astype(np.float32),
    )


def ground_item(context: ReaderContext, node: Node) -> Item | None:
    """A Ground node: `room/<house>/<modelId>f.obj`, already in house coordinates."""
    if "Floor" in node.hidden:
        return None
    if context.arch is not None:
        return next(arch_items(context.arch, node, node.id, context.materials), None)
    surfaces = [s for _, s in room_surfaces(context, node, "f", default_walls=False)]
    level_id, name = node.level_id, node.model_id
    ground = structure_item(
        node.id, ItemKind.GROUND, surfaces, level_id=level_id, source_class=name
    )
    return ground if surfaces else None


def room_surfaces(
    context: ReaderContext, node: Node, part: str, *, default_walls: bool
) -> list[tuple[str, Surface]]:
    """(group, surface) of a room's floor f, ceiling c or walls w; empty, with a note, without faces."""
    base = f"room/{context.house}/{node.model_id}{part}"
    model = context.models.model(f"{base}.obj", f"{base}.mtl")
    if model is None:
        context.notes.add("missing-room-part", node.place, f"{base}.obj does not exist")
        return []
    # Place each mesh; one that has no area in single precision is left out.
    surfaces = []
    for mesh, slot in zip(model.meshes, model.slots, strict=True):
        mtl = model.mtl[slot] if slot >= 0 else None
        material = _room_material(context, node, mtl, default_walls=default_walls)
        index = context.materials.library.index(material)
        name = f"{mesh.group} {mesh.material}".strip()
        surface = placed(mesh, context.world_from_house, name=name, material=index)
        if surface is not None:
            surfaces.append((mesh.group, surface))
    return surfaces


def _room_material(
    context: ReaderContext, node: Node, mtl: ObjMaterial | None, *, default_walls: bool
) -> Material:
    if default_walls:
        return context.materials.wall_material(mtl, None, place=node.place)
    return context.materials.material(mtl, None, place=node.place, clear=MaterialKind.GLASS)


def room_items(context: ReaderContext, node: Node, room_id: str) -> Iterator[Item]:
    """Floor, ceiling and one item per wall of a Room node; hidden parts are left out."""
    if context.arch is not None:
        yield from arch_items(context.arch, node, room_id, context.materials)
        return
    # Take floor and ceiling, an item each, where the node does not hide them.
    parts = (("Floor", "f", ItemKind.FLOOR), ("Ceiling", "c", ItemKind.CEILING))
    for hidden, part, kind in parts:
        if hidden in node.hidden:
            continue
        surfaces = room_surfaces(context, node, part, default_walls=False)
        if surfaces:
            yield _part_of_room(node, room_id, part, kind, [s for _, s in surfaces])
    # The inside and outside slabs of one wall share its number, so they are one item.
    walls: dict[str, list[Surface]] = {}
    if "Walls" not in node.hidden:
        for group, surface in room_surfaces(context, node, "w", default_walls=True):
            match = _WALL_GROUP.fullmatch(group)
            walls.setdefault(match[1] if match else "", []).append(surface)
    for number, parts_of_wall in walls.items():
        yield _part_of_room(node, room_id, f"w{number}", ItemKind.WALL, parts_of_wall)


def _part_of_room(
    node: Node, room_id: str, part: str, kind: ItemKind, surfaces: list[Surface]
) -> Item:
    return structure_item(
        f"{room_id}{part}",
        kind,
        surfaces,
        name=f"{kind.value} {room_id}",
        level_id=node.level_id,
        source_class=f"{node.model_id}{part}",
        room_id=room_id,
        boundary_of=(room_id,) if kind is ItemKind.WALL else (),
    )


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


_REFLECTANCE: Final = 0.9
_FLAT_COS: Final = (
    0.98  # minimum cosine between a face's normal and the glass's for the face to be part of it
)
_FLAT_SHARE: Final = 0.45  # least flat share of a material; a pane with back and edges has half
# a dressing table's mirror, in shares of the model
_LEAST_HEIGHT: Final = 0.35  # minimum height of its lower edge over the model's
_MOST_DEPTH: Final = 0.5  # maximum depth of the model above that edge over the whole depth
_LEAST_AREA: Final = 0.08  # minimum area, front and back, over width times height
_TABLES: Final = frozenset(("dressing", "vanity", "makeup"))
_NAMES: Final = ("mirror", "spiegel", "glass")  # an MTL's names are material_0, material_1 mostly


def mirror_slot(model: ParsedModel) -> int | None:
    """The position in the MTL of a mirror's glass, -1 for meshes without one; None if none is flat.

    The glass faces away from the wall: of the materials that lie flat across the model's thinnest
    level axis the one named so, else the one that shows the largest area.
    """
    # The thinner of the two level axes points out of the wall.
    corners = np.concatenate([m.positions for m in model.meshes])
    extent = np.ptp(corners, axis=0)
    across = 0 if extent[0] < extent[2] else 2
    areas = _areas_of_slots(model, across)
    is_flat = [s for s, (whole, flat_area) in areas.items() if flat_area > _FLAT_SHARE * whole]

    def rank(slot: int) -> tuple[bool, float]:
        name = model.mtl[slot].name.lower() if slot >= 0 else ""
        return any(word in name for word in _NAMES), areas[slot][1]

    return max(is_flat, key=rank, default=None)


def mirror_slot_of_table(
    model: ParsedModel, class_words: Collection[str], nyu40: int
) -> int | None:
    """The position in the MTL of the glass of a dressing table's mirror; None without one.

    The pane is upright, faces the front (z), and is part of a piece deeper below. Only the pane has its
    material, which is plain and grey or bluish. A chest of drawers has no such pane.
    """
    if nyu40 != DRESSER and _TABLES.isdisjoint(class_words):
        return None
    points = np.concatenate([m.positions for m in model.meshes])
    low, size = points.min(0), np.ptp(points, axis=0)
    lowest: dict[int, float] = {}
    for mesh, slot in zip(model.meshes, model.slots, strict=True):
        lowest[slot] = min(lowest.get(slot, np.inf), float(mesh.positions[:, 1].min()))
    panes: dict[int, float] = {}
    for slot, (whole, flat_area) in _areas_of_slots(model, 2).items():
        looks = model.mtl[slot] if slot >= 0 else ObjMaterial("")
        above = points[points[:, 1] >= lowest[slot]]
        is_pane = (
            flat_area > _FLAT_SHARE * whole
            and flat_area > _LEAST_AREA * size[0] * size[1]
            and lowest[slot] > low[1] + _LEAST_HEIGHT * size[1]
            and np.ptp(above[:, 2]) < _MOST_DEPTH * size[2]
        )
        is_cool = not looks.map_kd and looks.kd[0] <= looks.kd[2]
        if is_pane and (is_cool or any(word in looks.name.lower() for word in _NAMES)):
            panes[slot] = flat_area
    return max(panes, key=panes.__getitem__, default=None)


def _areas_of_slots(model: ParsedModel, across: int) -> dict[int, list[float]]:
    """Index in the MTL -> total area, and area perpendicular to an axis."""
    areas: dict[int, list[float]] = {}
    for mesh, slot in zip(model.meshes, model.slots, strict=True):
        normals = area_vectors(triangle_corners(mesh.positions, mesh.faces))
        area = np.linalg.norm(normals, axis=1)
        flat = np.abs(normals[:, across]) >= _FLAT_COS * area
        sums = areas.setdefault(slot, [0.0, 0.0])
        sums[0] += float(area.sum())
        sums[1] += float(area[flat].sum())
    return areas


def as_mirror(material: Material) -> Material:
    """The material as a mirror."""
    return replace(
        material,
        kind=MaterialKind.MIRROR,
        specular=(_REFLECTANCE,) * 3,
        texture_id=None,
        opacity=1.0,
        alpha_cutout=False,
    )
