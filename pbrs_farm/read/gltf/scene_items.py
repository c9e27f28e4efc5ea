"""Nodes of a glTF scene -> items placed in the world, with their lights; no effects."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final

import numpy as np

from pbrs_farm.core.arrays import F64, triple
from pbrs_farm.core.classes import LAMP, OTHERPROP
from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.frames import is_flattening, transform_points
from pbrs_farm.core.house import (
    MAX_INSTANCES,
    Box,
    Item,
    ItemKind,
    LightPart,
    MaterialKind,
    Surface,
    corners_of_surfaces,
)
from pbrs_farm.core.lighting import BULB_RADIUS_M, LightForm, PowerUnit
from pbrs_farm.core.mesh import face_areas, outside_area
from pbrs_farm.core.recipe import ReadFields
from pbrs_farm.formats.glb import Gltf, entry
from pbrs_farm.home.names import names_glass, names_mirror
from pbrs_farm.read.common.furniture_classes import PieceSize
from pbrs_farm.read.common.house_builder import unique_id
from pbrs_farm.read.common.material_library import PANE_OPACITY
from pbrs_farm.read.common.name_classes import UNMAPPED, NodeClass, class_of_node_name
from pbrs_farm.read.common.notes import Notes
from pbrs_farm.read.common.placed_mesh import (
    ASSUMED_LM,
    across_last,
    assumed_light,
    oriented_box,
    placed,
)
from pbrs_farm.read.common.room_shells import planar_parts
from pbrs_farm.read.gltf.document import Placed, meshes_of, numbers, object_at, placed_nodes
from pbrs_farm.read.gltf.materials import Emission, SceneMaterials, glass_materials, material_names
from pbrs_farm.read.gltf.node_classes import Mapping, class_of_node, collection_of
from pbrs_farm.read.gltf.scene_writer import joints_of_parts
from pbrs_farm.read.gltf.structure_parts import centres_of, structure_parts
from pbrs_farm.read.mesh.obj import Mesh

_LEAST_EXTENT_M: Final = 1e-6  # minimum extent of an item, limited by float32, metres
_UNMAPPED: Final = NodeClass(
    OTHERPROP, ItemKind.OBJECT, is_tagged=False
)  # class of an item with an unknown name


def _place_in_file(gltf: Gltf, thing: _Thing) -> str:
    """Location of an item in its file: a node, or the other format's term for it."""
    is_gltf = gltf.file.lower().endswith((".glb", ".gltf"))
    if not is_gltf and "item" in thing.extras:
        return str(thing.extras["item"])
    return f"nodes[{thing.root.index}] ({thing.name[:60]})"


@dataclass(slots=True)
class _Thing:
    """An item while its nodes are gathered."""

    root: Placed  # the node that gives the class
    name: str
    seen: NodeClass
    extras: dict[str, Any]  # the root's
    materials: tuple[str, ...] = ()  # names of the root's
    is_by_name: bool = False  # whether the class is from the root's name
    parts: list[Placed] = field(default_factory=list)  # the root and its descendants in the item


def items_of_scene(
    gltf: Gltf, mapping: Mapping, materials: SceneMaterials, notes: Notes, fields: ReadFields
) -> Iterator[Item]:
    """The items of the scene in the world frame, not yet on a level or in a room.

    A node with its descendants is one item, unless it is a group or a whole room, which is split.
    Raises BadHouse for too many triangles or items, and for coordinates too far away.
    """
    meshes: dict[Any, list[tuple[int | None, Mesh]]] = {}  # mesh number -> its primitives
    taken: set[str] = set()  # ids
    n_faces = n_items = 0
    placed: list[tuple[_Thing, str, Item]] = []  # with the place that notes name
    for thing in _gather_things(gltf, mapping):
        item = _item(gltf, thing, materials, notes, meshes, fields)
        if item is None:
            continue
        place = _place_in_file(gltf, thing)
        # Bound the extent, the triangles and the items.
        if item.surfaces and not float(np.abs(item.bounds).max()) <= fields.max_extent_m:
            text = f"is farther than {fields.max_extent_m:g} m from the origin"
            hint = "is its unit right? glTF is in metres; limit: read.max_extent_m"
            raise BadHouse(gltf.file, place, text, hint=hint)
        n_faces += item.n_faces
        if n_faces > fields.max_triangles or len(placed) >= MAX_INSTANCES:
            text = f"more than {fields.max_triangles} triangles or {MAX_INSTANCES} items"
            raise BadHouse(gltf.file, place, text, hint="limit: read.max_triangles")
        placed.append((thing, place, item))
    # Split rooms and items with class names in their materials; tags of the file or user take
    # precedence.
    centres = centres_of([item for _, _, item in placed])
    for thing, place, item in placed:
        if thing.extras.get("solid") is True or item.joints:
            parts: tuple[Item, ...] = (item,)
        elif thing.seen.is_tagged:
            parts = planar_parts(item)
        else:
            parts = tuple(_glazed(part, item, materials) for part in structure_parts(item, centres))
        if any(UNMAPPED in part.tags for part in parts):
            notes.add("unmapped-class", place, "matches no class; it is otherprop")
        if sum(part.n_faces for part in parts) < item.n_faces:
            notes.add("outer-side", place, "its outer side is left out")
        # Give each part a unique id: names in glTF may repeat.
        for part in parts:
            n_items += 1
            if n_items > MAX_INSTANCES:
                raise BadHouse(gltf.file, place, f"more than {MAX_INSTANCES} items")
            yield replace(part, id=unique_id(part.id, taken))


def _glazed(part: Item, whole: Item, materials: SceneMaterials) -> Item:
    """A window or door split off a room's mesh, with its glass as panes."""
    openings = (ItemKind.WINDOW, ItemKind.DOOR)
    if part.kind not in openings or whole.kind in openings:
        return part
    surfaces = []
    for s in part.surfaces:
        material = materials.library.materials[s.material]
        is_opaque = material.kind is MaterialKind.OPAQUE
        if material.kind is MaterialKind.GLASS or (is_opaque and names_glass(s.name)):
            opacity = PANE_OPACITY if is_opaque else material.opacity
            pane = replace(material, kind=MaterialKind.PANE, opacity=opacity)
            surfaces.append(replace(s, material=materials.library.index(pane)))
        else:
            surfaces.append(s)
    return replace(part, surfaces=tuple(surfaces))


def _gather_things(gltf: Gltf, mapping: Mapping) -> list[_Thing]:
    """Group the scene's nodes into items.

    A node belongs to its nearest ancestor (or itself) that is an item: the outermost with a known
    class, and tagged ones below it. Members of a collection ("Chairs") without a class inherit the
    collection's.
    """
    # By path from the root: the item a node belongs to, and the class its members inherit.
    owner: dict[tuple[int, ...], _Thing] = {}
    members: dict[tuple[int, ...], NodeClass] = {}
    things: list[_Thing] = []
    for node in placed_nodes(gltf):
        fields_json = entry(gltf, "nodes", node.index)
        name = str(fields_json.get("name", ""))[:200]
        extras = object_at(fields_json, "extras")
        above = owner.get(node.path[:-1])
        materials = material_names(gltf, fields_json)
        cls = class_of_node(name, extras, mapping, materials)
        inherited = members.get(node.path[:-1])
        if cls and inherited and not cls.is_tagged and _is_shown(cls, inherited):
            cls = None
        effective = cls or inherited
        # A group named by a collective noun is not an item.
        if extras.get("group") is True:
            effective = None
        if effective and not effective.is_tagged and "mesh" not in fields_json:
            grouped = collection_of(name, effective)
            if grouped is not None:
                effective = None
                if grouped.nyu40 and above is None:
                    members[node.path] = grouped
        # Leave out empty nodes without a class: they only hold others.
        has_light = "KHR_lights_punctual" in object_at(fields_json, "extensions")
        has_part = "mesh" in fields_json or has_light or extras.get("one") is True
        # Begin an item at the outermost node of a class, and at tagged ones below it.
        if (effective and (above is None or effective.is_tagged)) or (above is None and has_part):
            is_by_name = cls is not None and (not cls.is_tagged or extras.get("by_name") is True)
            above = _Thing(node, name, effective or _UNMAPPED, extras, materials, is_by_name)
            things.append(above)
        if above is not None:
            owner[node.path] = above
            above.parts.append(node)
    return things


def _is_shown(own_class: NodeClass, collection: NodeClass) -> bool:
    """Whether a person or plant is what members of a collection show: a man among statues."""
    living = (ItemKind.PERSON, ItemKind.PLANT)
    return own_class.kind in living and collection.kind not in living


def _item(
    gltf: Gltf,
    thing: _Thing,
    materials: SceneMaterials,
    notes: Notes,
    cache: dict[Any, list[tuple[int | None, Mesh]]],
    fields: ReadFields,
) -> Item | None:
    surfaces: list[Surface] = []
    shining: dict[int, Emission] = {}
    parts = list(_meshes(gltf, thing, notes, cache, fields))
    if thing.is_by_name and parts:
        size = _size_of(parts)
        sized = class_of_node_name(thing.name, materials=thing.materials, size=size)
        is_tagged = thing.seen.is_tagged
        thing.seen = replace(sized, is_tagged=is_tagged) if sized else _UNMAPPED
    kind = thing.seen.kind
    is_opening = kind in (ItemKind.WINDOW, ItemKind.DOOR)
    # Transparent materials are panes in an opening, glass elsewhere.
    clear = MaterialKind.PANE if is_opening else MaterialKind.GLASS
    lights = _punctual_lights(gltf, thing)
    numbers = [number for _, meshes in parts for number, _ in meshes]
    glass = glass_materials(gltf, numbers) if is_opening else frozenset()
    joints = joints_of_parts(gltf, thing.parts)
    part_names = [str(entry(gltf, "nodes", part.index).get("name", "")) for part, _ in parts]
    for (part, meshes), part_name in zip(parts, part_names, strict=True):
        is_own_part = part.path != thing.root.path
        is_glass = is_opening and is_own_part and names_glass(part_name)
        is_said = is_own_part and (names_glass(part_name) or names_mirror(part_name, part_names))
        for number, mesh in meshes:
            material, emission = materials.material(number, clear=clear)
            # Glass by its name alone is a pane, unless the file tags its kind.
            named = (number in glass or is_glass) and not materials.is_tagged(number)
            if named and material.kind is MaterialKind.OPAQUE:
                material = replace(material, kind=clear, opacity=PANE_OPACITY)
            coloured, material = materials.with_vertex_colours(mesh, material)
            # Emission of unknown strength counts for lamps only: screens and stickers glow, too.
            emits = emission is not None and not kind.is_structure
            is_known = emission is not None and emission.luminance > 0
            emits = emits and (is_known or kind is ItemKind.LAMP)
            index = materials.as_bulb(material) if emits else materials.library.index(material)
            name = material.name or f"part {len(surfaces)}"
            if is_said and kind is ItemKind.OBJECT and material.kind is MaterialKind.OPAQUE:
                # By that name repair knows a mirror or a pane of a piece.
                name = part_name
            laid = materials.laid(number, coloured)
            surface = placed(laid, part.world_from_node, name=name, material=index)
            if surface is None:
                continue
            if part.path in joints:
                surface = replace(surface, part=joints[part.path].part)
            if emits and emission is not None:
                shining[len(surfaces)] = emission
            surfaces.append(surface)
    if not surfaces and not lights:
        return None
    if lights:
        # Lights of the file are what its glowing surfaces of unknown strength send out.
        unknown = [k for k, emission in shining.items() if emission.luminance == 0]
        lights = _with_surfaces(lights, surfaces, unknown)
        shining = {k: emission for k, emission in shining.items() if k not in unknown}
    lights += emitted(surfaces, shining)
    item = _finish_item(thing, surfaces, lights, _box_of_thing(thing, parts))
    shown_parts = {s.part for s in surfaces}
    moving = tuple(joint for joint in dict.fromkeys(joints.values()) if joint.part in shown_parts)
    return replace(item, joints=moving) if moving else item


def _with_surfaces(
    lights: list[LightPart], surfaces: Sequence[Surface], glowing: Sequence[int]
) -> list[LightPart]:
    """The lights, each with the emissive surfaces nearest to it."""
    places = np.array([light.position for light in lights])
    owned: dict[int, list[int]] = {}
    for k in glowing:
        middle = surfaces[k].positions.astype(np.float64)
        middle = (middle.min(0) + middle.max(0)) / 2
        owned.setdefault(int(np.linalg.norm(places - middle, axis=1).argmin()), []).append(k)
    return [replace(light, emitting=tuple(owned.get(n, ()))) for n, light in enumerate(lights)]


def _box_of_thing(
    thing: _Thing, parts: list[tuple[Placed, list[tuple[int | None, Mesh]]]]
) -> Box | None:
    """The box of an item of one mesh in its node's frame; of a door or window all parts' box."""
    filled = [(part, [m for _, m in meshes]) for part, meshes in parts if meshes]
    if len(filled) == 1:
        (part, meshes), *_ = filled
        box = oriented_box(meshes, part.world_from_node)
        return across_last(box) if box else None
    world = thing.root.world_from_node
    is_opening = thing.seen.kind in (ItemKind.WINDOW, ItemKind.DOOR)
    # An item of several meshes keeps the box given in its file.
    has_frame = is_opening or thing.extras.get("has_frame") is True
    if not filled or not has_frame or is_flattening(world[:3, :3]):
        return None
    # Bring a frame and its panes into the frame of the node that holds them.
    node_from_world = np.linalg.inv(world).astype(np.float64)
    inner = [
        replace(m, positions=transform_points(node_from_world @ p.world_from_node, m.positions))
        for p, meshes in filled
        for m in meshes
    ]
    box = oriented_box(inner, world)
    return across_last(box) if box else None


def _punctual_lights(gltf: Gltf, thing: _Thing) -> list[LightPart]:
    light_parts = [
        punctual_light(gltf, entry(gltf, "nodes", p.index), p.world_from_node, f"nodes[{p.index}]")
        for p in thing.parts
    ]
    return [light for light in light_parts if light]


def _meshes(
    gltf: Gltf,
    thing: _Thing,
    notes: Notes,
    cache: dict[Any, list[tuple[int | None, Mesh]]],
    fields: ReadFields,
) -> Iterator[tuple[Placed, list[tuple[int | None, Mesh]]]]:
    """(node, its meshes with the numbers of their materials) of every part that has a mesh."""
    for part in thing.parts:
        node = entry(gltf, "nodes", part.index)
        if "mesh" not in node:
            continue
        if is_flattening(part.world_from_node[:3, :3]):
            notes.add("flat-node", f"nodes[{part.index}]", "its scale is 0; left out")
            continue
        entry(gltf, "meshes", node["mesh"])
        if node["mesh"] not in cache:
            most = fields.max_model_triangles
            cache[node["mesh"]] = meshes_of(gltf, node["mesh"], max_triangles=most)
        meshes = cache[node["mesh"]]
        if meshes and _extent_m(meshes, part.world_from_node) < _LEAST_EXTENT_M:
            notes.add("flat-node", f"nodes[{part.index}]", "nothing is left of it; left out")
            continue
        yield part, meshes


def _extent_m(meshes: Sequence[tuple[int | None, Mesh]], world_from_node: F64) -> float:
    """Longest side of the bounding box of meshes in their world pose."""
    low, high = _bounds(meshes, world_from_node)
    return float((high - low).max())


def _bounds(meshes: Sequence[tuple[int | None, Mesh]], world_from_node: F64) -> tuple[F64, F64]:
    placed_points = [transform_points(world_from_node, m.positions) for _, m in meshes]
    low = np.min([p.min(0) for p in placed_points], 0)
    return low, np.max([p.max(0) for p in placed_points], 0)


def _size_of(parts: list[tuple[Placed, list[tuple[int | None, Mesh]]]]) -> PieceSize | None:
    """Size of an item's parts together; None without points."""
    boxes = [_bounds(meshes, part.world_from_node) for part, meshes in parts if meshes]
    if not boxes:
        return None
    low, high = np.min([b[0] for b in boxes], 0), np.max([b[1] for b in boxes], 0)
    width, height, depth = (high - low).tolist()
    return PieceSize(width, height, depth)


def _finish_item(
    thing: _Thing, surfaces: list[Surface], lights: list[LightPart], box: Box | None
) -> Item:
    thing_class = thing.seen
    if lights and not surfaces:
        # A light without a shape is a lamp.
        thing_class = replace(thing_class, kind=ItemKind.LAMP, nyu40=LAMP)
    tags = [UNMAPPED] if thing_class is _UNMAPPED else []
    if any(np.linalg.det(p.world_from_node[:3, :3]) < 0 for p in thing.parts):
        tags.append("mirrored")
    item_id, name = thing.extras.get("item"), thing.extras.get("name")
    item = Item(
        id=item_id[:100] if isinstance(item_id, str) and item_id else f"n{thing.root.index}",
        name=name[:200] if isinstance(name, str) else thing.name or f"node {thing.root.index}",
        kind=thing_class.kind,
        level_id="0",
        surfaces=tuple(surfaces),
        nyu40=thing_class.nyu40,
        source_class=thing.name,
        lights=tuple(lights),
        box=box,
        tags=tuple(tags),
    )
    if thing_class.kind is ItemKind.LAMP and not lights:
        return replace(item, lights=(assumed_light(item),), tags=(*item.tags, "assumed_light"))
    return item


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
