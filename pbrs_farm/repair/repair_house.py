"""Repair: a house as read -> a house that light cannot leak through, by STEPS, with a report; no effects."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final

from pbrs_farm.core.catalogue import Catalogue
from pbrs_farm.core.house import Enclosure, House, Note, Room
from pbrs_farm.core.recipe import RepairFields
from pbrs_farm.repair.lamps.bulbs import with_bulbs
from pbrs_farm.repair.lamps.lampshades import with_shades
from pbrs_farm.repair.lamps.room_lighting import with_measured_lamps, with_room_lighting
from pbrs_farm.repair.measure.enclosure import Space
from pbrs_farm.repair.measure.furniture_audit import furniture_audit
from pbrs_farm.repair.measure.leaks import Occluder, leaks_of_house
from pbrs_farm.repair.mirrors import with_clear_panes, with_mirrors
from pbrs_farm.repair.repair_report import RepairReport, RoomAudit, StructureReport
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
from pbrs_farm.repair.structure.slabs import with_undersides
from pbrs_farm.repair.structure.watertight import Structure, repaired_structure, with_structure


@dataclass(frozen=True, slots=True)
class Repairing:
    """A house on its way through the steps; facts: report fields so far; built: set by `structure`."""

    house: House
    fields: RepairFields
    occluder_from: Callable[[House], Occluder] | None
    lamps_from: Callable[[], Catalogue] | None = None
    facts: Mapping[str, Any] = field(default_factory=dict)
    built: Structure | None = None

    @property
    def structure(self) -> Structure:
        """The repaired walls, floors and ceilings, after the step `structure`."""
        assert self.built is not None
        return self.built

    def after(self, house: House, **facts: Any) -> Repairing:
        """The work after a step: its house, and its facts beside those of the steps before."""
        return replace(self, house=house, facts={**self.facts, **facts})


@dataclass(frozen=True, slots=True)
class RepairStep:
    """One step of repair.

    run: returns the work with the step's house and facts. A fact without a field in the reports is
    a sentence: it is stored in repair.json and shown in the summary. A step that changes houses
    raises the version of the pass `repair` (prepare/passes.py).
    """

    name: str
    run: Callable[[Repairing], Repairing]


def repair(
    house: House,
    fields: RepairFields,
    *,
    occluder_from: Callable[[House], Occluder] | None = None,
    lamps_from: Callable[[], Catalogue] | None = None,
) -> tuple[House, RepairReport]:
    """The repaired house and a report of all changes (paper section 3).

    An already repaired house is returned unchanged. occluder_from: builds a ray caster over
    a house's triangles; None leaves leaks and the lamps' light output ratio unmeasured. lamps_from:
    loads the catalogue of ceiling lamps to add; with None they are globes on cords.
    """
    if house.is_repaired:
        return house, RepairReport(house_id=house.id, was_repaired=True)
    work = Repairing(house, fields, occluder_from, lamps_from)
    for step in STEPS:
        work = step.run(work)
    counts = {name: work.facts[name] for name in StructureReport.model_fields if name in work.facts}
    facts = {name: fact for name, fact in work.facts.items() if name not in counts}
    structure = work.structure.report.model_copy(update=counts)
    return work.house, RepairReport(house_id=house.id, structure=structure, **facts)


def _without_persons_and_plants(work: Repairing) -> Repairing:
    house, removed = without_persons_and_plants(work.house, work.fields)
    return work.after(house, removed=tuple(removed))


def _with_sound_faces(work: Repairing) -> Repairing:
    house, faces = with_sound_faces(work.house)
    return work.after(house, faces=faces)


def _with_white_walls(work: Repairing) -> Repairing:
    house, n_white = with_white_walls(work.house, work.fields.default_wall_rgb)
    return work.after(house, n_walls_made_white=n_white)


def _with_mirrors(work: Repairing) -> Repairing:
    house, mirrors = with_mirrors(work.house)
    return work.after(with_clear_panes(house), mirrors=mirrors)


def _with_structure(work: Repairing) -> Repairing:
    """Watertight walls, floors and ceilings with the openings cut; a note for each lost wall."""
    structure = repaired_structure(work.house, work.fields.wall_thickness_m)
    house, swallowed = with_structure(work.house, structure)
    notes = [
        Note("wall-lost", w.item_id, f"repair left {w.after_m2:.1f} of {w.before_m2:.1f} m2 of it")
        for w in structure.report.walls_lost
    ]
    house = replace(house, notes=(*house.notes, *notes))
    removed = (*work.facts["removed"], *swallowed)
    return replace(work, built=structure).after(house, removed=removed)


def _with_faces_apart(work: Repairing) -> Repairing:
    house, n_frames = with_frames_apart(work.house)
    house, n_parts = with_parts_apart(house)
    return work.after(house, n_frames_moved=n_frames, n_parts_moved=n_parts)


def _with_bulbs(work: Repairing) -> Repairing:
    """A bulb in every lamp, and a translucent shade on every dim one."""
    house, sources = with_bulbs(work.house, work.fields)
    if work.occluder_from is not None:
        house, sources = with_shades(house, sources, work.fields, work.occluder_from)
    return work.after(house, sources=tuple(sources))


def _with_room_lighting(work: Repairing) -> Repairing:
    fields = work.fields
    house, lights = with_room_lighting(
        work.house,
        fallback=fields.fallback_light,
        in_every_room=fields.lamp_in_every_room,
        lamp_lx=fields.lamp_lx,
        lamps_from=work.lamps_from,
    )
    n_added = len(house.items) - len(work.house.items)
    if work.occluder_from is not None:
        house = with_measured_lamps(house, n_added, fields, work.occluder_from)
    return work.after(
        house,
        fallback_lights=lights.fallback,
        added_lamps=lights.added,
        brightened_lamps=lights.brightened,
    )


def _with_enclosure(work: Repairing) -> Repairing:
    """Each room closed or open, by the verdict of the space that it belongs to."""
    spaces = work.structure.spaces
    verdicts: dict[str, dict[str, Any]] = {}
    for space in spaces:
        for room_id in space.rooms:
            is_open = not space.is_closed
            verdicts[room_id] = {
                "enclosure": Enclosure.OPEN if is_open else Enclosure.CLOSED,
                "enclosure_reason": space.explain(room_id) if is_open else "",
            }
    rooms = tuple(replace(room, **verdicts[room.id]) for room in work.house.rooms)
    house = replace(work.house, rooms=rooms, is_repaired=True)
    added = rooms_with_added_ceilings(house)
    return work.after(house, added_ceilings=added, rooms=_audit(rooms, spaces))


def _audit(rooms: Sequence[Room], spaces: Sequence[Space]) -> tuple[RoomAudit, ...]:
    space_of = {r: s.rooms for s in spaces for r in s.rooms}
    return tuple(
        RoomAudit(
            room_id=r.id,
            name=r.name,
            floor_area_m2=round(float(plan.polygon_of_room(r.polygon).area), 3),
            lit_by=r.lit_by,
            enclosure=str(r.enclosure),
            reason=r.enclosure_reason,
            space=space_of[r.id],
        )
        for r in rooms
    )


def _leaks_measured(work: Repairing) -> Repairing:
    """Leaks of light into closed rooms, by rays; unmeasured without a ray caster."""
    if work.occluder_from is None:
        return work
    house, built = work.house, work.structure
    # Fill the openings: a window is no leak.
    plugs = [surface for plug in built.plugs.values() for surface in plug]
    leaks = leaks_of_house(house, built.spaces, built.interiors, plugs, work.occluder_from)
    return work.after(house, leaks=leaks, is_leaking=leaks.n_sky > 0)


STEPS: Final = (
    RepairStep("persons-and-plants", _without_persons_and_plants),
    RepairStep("ceilings", lambda work: work.after(with_rooms_closed(work.house, work.fields))),
    RepairStep("faces", _with_sound_faces),
    RepairStep("white-walls", _with_white_walls),
    RepairStep("mirrors", _with_mirrors),
    RepairStep("structure", _with_structure),
    RepairStep("undersides", lambda work: work.after(with_undersides(work.house))),
    RepairStep("faces-apart", _with_faces_apart),
    RepairStep("bulbs", _with_bulbs),
    RepairStep("room-lighting", _with_room_lighting),
    RepairStep("boxes", lambda work: work.after(with_boxes_of_meshes(work.house))),
    RepairStep("enclosure", _with_enclosure),
    RepairStep("leaks", _leaks_measured),
    RepairStep(
        "furniture", lambda work: work.after(work.house, furniture=furniture_audit(work.house))
    ),
)
