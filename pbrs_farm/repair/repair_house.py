"""The repair pipeline: a house as read -> a house that light cannot leak through, with a report.

No effects. The ray caster is an argument; without one, leaks and light output are not measured.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from pbrs_farm.core.arrays import I32, Bools
from pbrs_farm.core.house import (
    Box,
    Enclosure,
    House,
    Item,
    ItemKind,
    Note,
    Room,
    Surface,
    corners_of_surfaces,
)
from pbrs_farm.core.mesh import faces_with_area, triangle_corners, unit_normals
from pbrs_farm.core.recipe import RepairFields
from pbrs_farm.repair.lamps.bulbs import with_bulbs, with_shades
from pbrs_farm.repair.lamps.room_lighting import GivenLights, with_room_lighting
from pbrs_farm.repair.measure.enclosure import Space
from pbrs_farm.repair.measure.furniture_audit import furniture_audit
from pbrs_farm.repair.measure.leaks import Occluder, leaks_of_house
from pbrs_farm.repair.mirrors import with_mirrors
from pbrs_farm.repair.repair_report import (
    FacesReport,
    Removed,
    RepairReport,
    RoomAudit,
    SourceRepair,
    StructureReport,
)
from pbrs_farm.repair.structure import plan_geometry as plan
from pbrs_farm.repair.structure.added_ceilings import (
    rooms_with_added_ceilings,
    with_ceilings,
    with_undersides,
)
from pbrs_farm.repair.structure.booleans import MIN_AREA_M2
from pbrs_farm.repair.structure.cut_openings import with_frames_apart
from pbrs_farm.repair.structure.walls import BASEBOARD
from pbrs_farm.repair.structure.watertight import repaired_structure, with_structure

_SQUARE = 1e-6  # axes of a box whose products differ more from 0 and 1 are no frame

# The small repairs: persons and plants out, default walls white, faces sound, boxes by the mesh.


def without_persons_and_plants(house: House, fields: RepairFields) -> tuple[House, list[Removed]]:
    """The house without persons and plants, as the recipe says (paper section 3)."""
    kinds = set()
    if fields.remove_persons:
        kinds.add(ItemKind.PERSON)
    if fields.remove_plants:
        kinds.add(ItemKind.PLANT)
    removed = [
        Removed(item_id=i.id, name=i.name, reason=str(i.kind))
        for i in house.items
        if i.kind in kinds
    ]
    return house.with_items(i for i in house.items if i.kind not in kinds), removed


def with_rooms_closed(house: House, fields: RepairFields) -> House:
    """The house with ceilings over walled rooms that have none, where the recipe asks for them."""
    return with_ceilings(house) if fields.add_ceilings else house


def with_white_walls(house: House, rgb: tuple[float, float, float]) -> tuple[House, int]:
    """Walls whose source names no colour painted rgb (sRGB); and how many, baseboards aside."""
    materials = list(house.materials)
    white: dict[int, int] = {}  # material as read -> its white copy
    items: list[Item] = []
    n = 0
    for item in house.items:
        if item.kind is not ItemKind.WALL:
            items.append(item)
            continue
        surfaces = []
        for s in item.surfaces:
            # Keep a colour that the source gives; baseboards and walls share one white material.
            material = materials[s.material]
            if not material.is_default or (material.diffuse == rgb and material.texture_id is None):
                surfaces.append(s)
                continue
            if s.material not in white:
                white[s.material] = len(materials)
                materials.append(replace(material, name=f"{material.name}_wall", diffuse=rgb, texture_id=None))  # fmt: skip
            surfaces.append(replace(s, material=white[s.material]))
        # Count walls, not surfaces; a baseboard is part of its wall.
        is_board = BASEBOARD in item.tags
        n += not is_board and any(house.materials[s.material].is_default for s in item.surfaces)
        items.append(replace(item, surfaces=tuple(surfaces)))
    return replace(house, items=tuple(items), materials=tuple(materials)), n


def with_sound_faces(house: House) -> tuple[House, FacesReport]:
    """Faces without area or with a corner that is no number dropped; winding made to agree.

    A face that looks against its own shading normals is turned round. Emptied surfaces stay, so
    that LightPart.emitting keeps its meaning.
    """
    n_dropped = n_turned = 0
    items = []
    for item in house.items:
        surfaces = []
        for surface in item.surfaces:
            sound, dropped, turned = _sound(surface)
            n_dropped += dropped
            n_turned += turned
            surfaces.append(sound)
        items.append(replace(item, surfaces=tuple(surfaces)))
    return house.with_items(items), FacesReport(n_degenerate_dropped=n_dropped, n_turned=n_turned)


def _sound(surface: Surface) -> tuple[Surface, int, int]:
    faces = surface.faces
    # Drop faces without area before their normals are asked for.
    keep = faces_with_area(triangle_corners(surface.positions, faces), MIN_AREA_M2)
    faces = faces[keep]
    against = _against_normals(surface, faces)
    n_dropped, n_turned = int((~keep).sum()), int(against.sum())
    if n_dropped + n_turned == 0:
        return surface, 0, 0  # the same object, so that sound meshes stay as read
    # Swap two corners: the face turns round, its first corner stays.
    faces = np.where(against[:, None], faces[:, [0, 2, 1]], faces)
    return replace(surface, faces=np.ascontiguousarray(faces, np.int32)), n_dropped, n_turned


def _against_normals(surface: Surface, faces: I32) -> Bools:
    if surface.normals is None or not len(faces):
        return np.zeros(len(faces), np.bool_)
    # Compare with the mean of the corner normals; its length does not matter.
    mean = surface.normals[faces].astype(np.float64).sum(1)
    own = unit_normals(triangle_corners(surface.positions, faces))
    return np.asarray((mean * own).sum(1) < -1e-6)


def with_boxes_of_meshes(house: House) -> House:
    """Every item's box taken from its triangles, along the axes it has: a source's is its plan's.

    A box that its mesh does not fill is made smaller, one that a bulb sticks out of larger.
    """
    return house.with_items(map(_with_box_of_mesh, house.items))


def _with_box_of_mesh(item: Item) -> Item:
    corners = corners_of_surfaces(item.surfaces).reshape(-1, 3)
    if not len(corners):
        return item
    axes = np.eye(3) if item.box is None else item.box.axes
    if np.abs(axes.T @ axes - np.eye(3)).max() > _SQUARE:
        axes = np.eye(3)
    # Measure along the axes, which are columns.
    local = corners @ axes
    low, high = local.min(0), local.max(0)
    # Vertices that no triangle has are in no box.
    if item.box is None and np.array_equal(item.bounds, np.array([low, high])):
        return item
    return replace(item, box=Box(axes @ ((low + high) / 2), (high - low) / 2, axes))


# The repair pipeline.


def repair(
    house: House, fields: RepairFields, *, occluder_from: Callable[[House], Occluder] | None = None
) -> tuple[House, RepairReport]:
    """The repaired house and everything that was changed (paper section 3).

    A house that is repaired already comes back as it is. occluder_from: builds a ray caster over
    a house's triangles; None leaves leaks and the lamps' light output ratio unmeasured.
    """
    if house.is_repaired:
        return house, RepairReport(house_id=house.id, was_repaired=True)

    # Remove what does not belong, and what is unsound.
    house, removed = without_persons_and_plants(house, fields)
    house = with_rooms_closed(house, fields)
    house, faces = with_sound_faces(house)
    house, n_white = with_white_walls(house, fields.default_wall_rgb)
    house, mirrors = with_mirrors(house)

    # Make walls, floors and ceilings watertight, with the openings cut.
    structure = repaired_structure(house, fields.wall_thickness_m)
    house, swallowed = with_structure(house, structure)
    house = replace(house, notes=(*house.notes, *_lost(structure.report)))
    house = with_undersides(house)
    house, n_apart = with_frames_apart(house)

    house, sources, given = _with_light(house, fields, occluder_from)
    house = with_boxes_of_meshes(house)

    # Say which rooms are closed, and let rays look for leaks in them.
    house = replace(house, rooms=_with_enclosure(house.rooms, structure.spaces), is_repaired=True)
    leaks = None  # None = not measured
    if occluder_from is not None:
        # Fill the openings: a window is no leak.
        plugs = [s for plug in structure.plugs.values() for s in plug]
        leaks = leaks_of_house(house, structure.spaces, structure.interiors, plugs, occluder_from)
    report = RepairReport(
        house_id=house.id,
        removed=(*removed, *swallowed),
        faces=faces,
        mirrors=mirrors,
        structure=structure.report.model_copy(
            update={"n_walls_made_white": n_white, "n_frames_moved": n_apart}
        ),
        sources=tuple(sources),
        fallback_lights=given.fallback,
        added_lamps=given.added,
        added_ceilings=rooms_with_added_ceilings(house),
        rooms=_audit(house.rooms, structure.spaces),
        is_leaking=None if leaks is None else leaks.n_sky > 0,
        leaks=leaks,
        furniture=furniture_audit(house),
    )
    return house, report


def _with_light(
    house: House, fields: RepairFields, occluder_from: Callable[[House], Occluder] | None
) -> tuple[House, list[SourceRepair], GivenLights]:
    """Give every lamp a bulb, every dim lamp a translucent shade, rooms without one a lamp."""
    house, sources = with_bulbs(house, fields)
    if occluder_from is not None:
        house, sources = with_shades(house, sources, fields, occluder_from)
    house, given = with_room_lighting(
        house,
        fallback=fields.fallback_light,
        in_every_room=fields.lamp_in_every_room,
        lamp_lx=fields.lamp_lx,
    )
    return house, sources, given


def _lost(report: StructureReport) -> list[Note]:
    # A wall that repair lost is told wherever the house's notes are.
    return [
        Note("wall-lost", w.item_id, f"repair left {w.after_m2:.1f} of {w.before_m2:.1f} m2 of it")
        for w in report.walls_lost
    ]


def _with_enclosure(rooms: Sequence[Room], spaces: Sequence[Space]) -> tuple[Room, ...]:
    # Give every room of a space the verdict of the space.
    found = {}
    for space in spaces:
        for room_id in space.rooms:
            found[room_id] = (Enclosure.CLOSED, "") if space.is_closed else (Enclosure.OPEN, space.explain(room_id))  # fmt: skip
    return tuple(
        replace(r, enclosure=found[r.id][0], enclosure_reason=found[r.id][1]) for r in rooms
    )


def _audit(rooms: Sequence[Room], spaces: Sequence[Space]) -> tuple[RoomAudit, ...]:
    space_of = {r: s.rooms for s in spaces for r in s.rooms}
    return tuple(
        RoomAudit(
            room_id=r.id,
            name=r.name,
            floor_area_m2=round(_area(r), 3),
            lit_by=r.lit_by,
            enclosure=str(r.enclosure),
            reason=r.enclosure_reason,
            space=space_of[r.id],
        )
        for r in rooms
    )


def _area(room: Room) -> float:
    return float(plan.polygon_of_room(room.polygon).area)
