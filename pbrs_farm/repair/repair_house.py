"""The repair pipeline: a house as read -> a house that light cannot leak through, with a report.

No effects. The ray caster is an argument; without one, leaks and light output are not measured.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from pbrs_farm.core.house import Enclosure, House, Note, Room
from pbrs_farm.core.recipe import RepairFields
from pbrs_farm.repair.lamps.bulbs import with_bulbs
from pbrs_farm.repair.lamps.lampshades import with_shades
from pbrs_farm.repair.lamps.room_lighting import GivenLights, with_room_lighting
from pbrs_farm.repair.measure.enclosure import Space
from pbrs_farm.repair.measure.furniture_audit import furniture_audit
from pbrs_farm.repair.measure.leaks import Occluder, leaks_of_house
from pbrs_farm.repair.mirrors import with_clear_panes, with_mirrors
from pbrs_farm.repair.repair_report import RepairReport, RoomAudit, SourceRepair, StructureReport
from pbrs_farm.repair.small_repairs import (
    with_boxes_of_meshes,
    with_rooms_closed,
    with_sound_faces,
    with_white_walls,
    without_persons_and_plants,
)
from pbrs_farm.repair.structure import plan_geometry as plan
from pbrs_farm.repair.structure.added_ceilings import rooms_with_added_ceilings
from pbrs_farm.repair.structure.frames_apart import with_frames_apart, with_parts_apart
from pbrs_farm.repair.structure.undersides import with_undersides
from pbrs_farm.repair.structure.watertight import repaired_structure, with_structure


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
    house = with_clear_panes(house)

    # Make walls, floors and ceilings watertight, with the openings cut.
    structure = repaired_structure(house, fields.wall_thickness_m)
    house, swallowed = with_structure(house, structure)
    house = replace(house, notes=(*house.notes, *_lost(structure.report)))
    house = with_undersides(house)
    house, n_apart = with_frames_apart(house)
    house, n_parts_apart = with_parts_apart(house)

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
            update={
                "n_walls_made_white": n_white,
                "n_frames_moved": n_apart,
                "n_parts_moved": n_parts_apart,
            }
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
    # A wall that repair lost is shown wherever the house's notes are.
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
            floor_area_m2=round(_area_of_room(r), 3),
            lit_by=r.lit_by,
            enclosure=str(r.enclosure),
            reason=r.enclosure_reason,
            space=space_of[r.id],
        )
        for r in rooms
    )


def _area_of_room(room: Room) -> float:
    return float(plan.polygon_of_room(room.polygon).area)
