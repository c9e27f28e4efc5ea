"""Apply the edits of a source to its finished house, in order. Effects: reads the files they name."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np
import shapely

from pbrs_farm.core import keys
from pbrs_farm.core.classes import NYU40_NAMES
from pbrs_farm.core.edits import (
    AddLight,
    CoverItems,
    FloatModel,
    KeyJoints,
    MoveItems,
    OpenJoints,
    PaintItems,
    PlaceModel,
    RecordBodies,
    RemoveItems,
    SetLight,
    StandAt,
)
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.frames import transform_points
from pbrs_farm.core.house import (
    FLOATING,
    MAX_INSTANCES,
    REMOVED,
    Box,
    House,
    Item,
    ItemKind,
    LightPart,
    Material,
    MaterialKind,
    ModelPose,
    Surface,
)
from pbrs_farm.core.lighting import LightForm, PowerUnit
from pbrs_farm.core.mesh import area_vectors, triangle_corners
from pbrs_farm.core.motions import Motion
from pbrs_farm.core.recipe import ReadFields
from pbrs_farm.core.shown_text import did_you_mean
from pbrs_farm.geometry.moving import house_at, moved_item
from pbrs_farm.geometry.opened import moved_surface
from pbrs_farm.geometry.solids import sphere
from pbrs_farm.prepare.open_joints import keyed, opened, with_motions
from pbrs_farm.prepare.source_ref import SourceRef
from pbrs_farm.read.common.material_library import texture_from_bytes
from pbrs_farm.read.objects.own_model import model_shape
from pbrs_farm.regular_files import MAX_DIGEST_BYTES, read_given


def apply_edits(house: House, source: SourceRef, fields: ReadFields) -> House:
    """Apply the source's edits to the house of its `unedited`; BadInput for a missing item or file."""
    for edit in source.edits:
        house = _ONE[edit.do](house, edit, fields)
    if len(house.items) > MAX_INSTANCES:
        raise BadInput(
            source.house_id, "", f"has {len(house.items)} items, at most {MAX_INSTANCES}"
        )
    return replace(house, id=source.house_id)


def _place(house: House, edit: PlaceModel | FloatModel, fields: ReadFields) -> House:
    if any(item.id == edit.item for item in house.items):
        raise BadInput(house.id, edit.item, "there is an item of that id")
    model, shape = edit.model, model_shape(edit.model, fields)
    world_from_model = np.array(edit.world_from_model)
    first = len(house.materials)
    surfaces = tuple(
        moved_surface(replace(s, material=s.material + first), world_from_model)
        for s in shape.surfaces
    )
    low, high = shape.bounds
    centre = transform_points(world_from_model, ((low + high) / 2)[None])[0]
    item = Item(
        id=edit.item,
        name=model.id,
        kind=ItemKind.OBJECT,
        level_id="",
        surfaces=surfaces,
        nyu40=model.nyu40,
        source_class=model.category,
        box=Box(centre, (high - low) / 2, world_from_model[:3, :3]),
        pose=ModelPose(model.id, edit.world_from_model),
        tags=(FLOATING,) if edit.do == "float" else (),
    )
    item = _at_home(house, item)
    source = house.source
    if model.credit and model.credit not in source.attribution:
        lines = "; ".join(line for line in (source.attribution, model.credit) if line)
        source = replace(source, attribution=lines)
    return replace(
        house,
        items=(*house.items, item),
        materials=(*house.materials, *shape.materials),
        textures={**house.textures, **shape.textures},
        source=source,
        # Notes of a model appear once, however often it is placed.
        notes=tuple(dict.fromkeys((*house.notes, *shape.notes))),
    )


def _at_home(house: House, item: Item) -> Item:
    """The item with the room and level of its centre."""
    x, y, z = item.bounds.mean(0)
    rooms = [
        room
        for room in house.rooms
        if room.floor_y - 0.2 <= y <= max(room.ceiling_y, room.floor_y) + 0.2
        and shapely.contains_xy(shapely.Polygon(room.polygon), x, z)
    ]
    if rooms:
        room = max(rooms, key=lambda r: r.floor_y)
        return replace(item, room_id=room.id, level_id=room.level_id)
    below = [level for level in house.levels if level.elevation <= y]
    level = max(below or house.levels, key=lambda one: one.elevation if below else -one.elevation)
    return replace(item, level_id=level.id, room_id=None)


def _remove(house: House, edit: RemoveItems, _fields: ReadFields) -> House:
    gone = frozenset(edit.items)
    _found(house, gone)
    openings = tuple(
        replace(opening, item_id=None) if opening.item_id in gone else opening
        for opening in house.openings
    )
    # Removed items stay as empty ones, so that the labels of all others keep their numbers.
    items = tuple(
        _emptied(item, k) if item.id in gone else item for k, item in enumerate(house.items, 1)
    )
    motions = tuple(motion for motion in house.motions if motion.item not in gone)
    return replace(house, items=items, openings=openings, motions=motions)


def _emptied(item: Item, instance: int) -> Item:
    """An empty item in place of a removed one. Its id is free: a new item may have it."""
    return Item(
        f"removed/{instance}", item.name, ItemKind.OBJECT, item.level_id, (), tags=(REMOVED,)
    )


def _move(house: House, edit: MoveItems, _fields: ReadFields) -> House:
    for motion in house.motions:
        if motion.item in edit.items and not motion.is_of_joint:
            text = "has recorded motion"
            raise BadInput(house.id, motion.item, text, hint="move it before recording")
    matrix = np.array(edit.world_from_world)
    return _changed(house, edit.items, lambda item: _at_home(house, moved_item(item, matrix)))


def _open(house: House, edit: OpenJoints, _fields: ReadFields) -> House:
    for index, part in _joints_named(house, edit.joints):
        house = opened(house, index, part, edit.share)
    edited = set(edit.joints)
    motions = tuple(m for m in house.motions if (m.item, m.part) not in edited)
    return replace(house, motions=motions)


def _key_joints(house: House, edit: KeyJoints, _fields: ReadFields) -> House:
    for index, part in _joints_named(house, edit.joints):
        house = keyed(house, index, part, edit.keys)
    return house


def _joints_named(house: House, joints: Sequence[tuple[str, str]]) -> list[tuple[int, str]]:
    """(item index, part) of joints given as (item id, part)."""
    _found(house, {item for item, _part in joints})
    index_of = {item.id: k for k, item in enumerate(house.items)}
    for item_id, part in joints:
        parts = [joint.part for joint in house.items[index_of[item_id]].joints]
        if part not in parts:
            raise BadInput(
                house.id, f"{item_id}/{part}", "no such joint", hint=did_you_mean(part, parts)
            )
    return [(index_of[item_id], part) for item_id, part in joints]


def _record(house: House, edit: RecordBodies, _fields: ReadFields) -> House:
    _found(house, {body.item for body in edit.bodies})
    return with_motions(
        house, [Motion(b.item, "", b.times_s, b.values, b.pivot) for b in edit.bodies]
    )


def _stand_at(house: House, edit: StandAt, _fields: ReadFields) -> House:
    return replace(house_at(house, edit.time_s), motions=())


def _paint(house: House, edit: PaintItems, _fields: ReadFields) -> House:
    def painted(material: Material) -> Material:
        if material.kind not in (MaterialKind.OPAQUE, MaterialKind.SHADE):
            return material
        rough = material.roughness if edit.roughness is None else edit.roughness
        return replace(
            material,
            diffuse=edit.rgb,
            texture_id=None,
            alpha_cutout=False,
            roughness=rough,
            is_default=False,
        )

    return _with_materials(house, edit.items, painted)


def _cover(house: House, edit: CoverItems, _fields: ReadFields) -> House:
    data = _file(edit.path, edit.sha256)
    try:
        texture = texture_from_bytes(data, Path(edit.path).name).texture
    except ValueError as error:
        raise BadInput(edit.path, "", str(error)) from None

    def covered(material: Material) -> Material:
        if material.kind is not MaterialKind.OPAQUE:
            return material
        return replace(
            material,
            diffuse=(1.0, 1.0, 1.0),
            texture_id=texture.id,
            alpha_cutout=False,
            normal_texture_id=None,
            roughness_texture_id=None,
            is_default=False,
        )

    def laid_out(item: Item) -> Item:
        return replace(item, surfaces=tuple(_laid_out(s, edit.scale_m) for s in item.surfaces))

    house = replace(house, textures={**house.textures, texture.id: texture})
    return _with_materials(_changed(house, edit.items, laid_out), edit.items, covered)


def _laid_out(surface: Surface, scale_m: float) -> Surface:
    """The surface with a picture's edge of scale_m, projected along each face's steepest axis."""
    corners = triangle_corners(surface.positions, surface.faces)
    axis = np.abs(area_vectors(corners)).argmax(1)
    # u and v are the two other axes: along x faces z and y, along y x and z, along z x and y.
    u, v = np.array([2, 0, 0])[axis], np.array([1, 2, 1])[axis]
    faces = np.arange(len(corners))
    uvs = np.stack([corners[faces, :, u], corners[faces, :, v]], axis=-1) / scale_m
    index = surface.faces.reshape(-1)
    return replace(
        surface,
        positions=surface.positions[index],
        normals=None if surface.normals is None else surface.normals[index],
        uvs=uvs.reshape(-1, 2).astype(np.float32),
        faces=np.arange(len(index), dtype=np.int32).reshape(-1, 3),
    )


def _set_light(house: House, edit: SetLight, _fields: ReadFields) -> House:
    def lit(item: Item) -> Item:
        if not item.lights:
            raise BadInput(house.id, item.id, "is not a lamp", hint="home.add_light adds one")
        return replace(item, lights=tuple(_shining(light, edit) for light in item.lights))

    return _changed(house, edit.items, lit)


def _shining(light: LightPart, edit: SetLight) -> LightPart:
    rgb = light.rgb_linear if edit.rgb_linear is None else edit.rgb_linear
    is_coloured = light.is_coloured or edit.rgb_linear is not None
    return replace(
        light,
        power=edit.lm,
        unit=PowerUnit.LUMEN,
        rgb_linear=rgb,
        is_coloured=is_coloured,
        is_bare=False,
    )


def _add_light(house: House, edit: AddLight, _fields: ReadFields) -> House:
    if any(item.id == edit.item for item in house.items):
        raise BadInput(house.id, edit.item, "there is an item of that id")
    r, g, b = edit.rgb_linear
    bulb = Material("bulb", MaterialKind.BULB, (r, g, b))
    spot: dict[str, Any] = {}
    if edit.direction is not None:
        spot = {"form": LightForm.SPOT, "direction": edit.direction, "cutoff_rad": edit.cutoff_rad}
    light = LightPart(
        edit.position,
        edit.radius_m,
        edit.lm,
        PowerUnit.LUMEN,
        rgb_linear=edit.rgb_linear,
        emitting=(0,),
        is_coloured=True,
        **spot,
    )
    surface = sphere("bulb", np.array(edit.position), edit.radius_m, len(house.materials))
    item = Item(
        edit.item,
        "lamp",
        ItemKind.LAMP,
        "",
        (surface,),
        nyu40=NYU40_NAMES.index("lamp"),
        source_class="lamp",
        lights=(light,),
    )
    items = (*house.items, _at_home(house, item))
    return replace(house, items=items, materials=(*house.materials, bulb))


def _with_materials(
    house: House, items: Collection[str], change: Callable[[Material], Material]
) -> House:
    """The house with the materials of some items changed; other items keep theirs."""
    materials = list(house.materials)
    index_of: dict[int, int] = {}  # material -> changed material, shared by all items of the edit

    def one(surface: Surface) -> Surface:
        old = surface.material
        if old not in index_of:
            changed = change(house.materials[old])
            index_of[old] = old if changed == house.materials[old] else len(materials)
            if index_of[old] != old:
                materials.append(changed)
        return replace(surface, material=index_of[old])

    changed = _changed(
        house, items, lambda item: replace(item, surfaces=tuple(map(one, item.surfaces)))
    )
    return replace(changed, materials=tuple(materials))


def _changed(house: House, ids: Collection[str], change: Callable[[Item], Item]) -> House:
    item_ids = frozenset(ids)
    _found(house, item_ids)
    return house.with_items(change(item) if item.id in item_ids else item for item in house.items)


def _found(house: House, ids: Collection[str]) -> None:
    present = {item.id for item in house.items if not item.is_removed}
    for name in ids:
        if name not in present:
            raise BadInput(house.id, name, "no such item", hint=did_you_mean(name, sorted(present)))


def _file(path: str, sha256: str) -> bytes:
    data = read_given(Path(path), MAX_DIGEST_BYTES)
    if keys.sha256(data) != sha256:
        raise BadInput(path, "", "changed since the home was loaded", hint="load the home again")
    return data


_ONE: Final[dict[str, Callable[[House, Any, ReadFields], House]]] = {
    "place": _place,
    "float": _place,
    "remove": _remove,
    "move": _move,
    "open": _open,
    "key_joints": _key_joints,
    "record": _record,
    "at": _stand_at,
    "paint": _paint,
    "cover": _cover,
    "light": _set_light,
    "add_light": _add_light,
}
