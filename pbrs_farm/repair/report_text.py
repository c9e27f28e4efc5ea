"""Summary of a repair report as sentences; no effects."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from pbrs_farm.core.shown_text import MAX_MESSAGE, shown

if TYPE_CHECKING:
    from pbrs_farm.repair.repair_report import RepairReport


def summary_of_report(report: RepairReport) -> str:
    """The faults of a house and their repairs, one sentence per line, names made printable."""
    if report.was_repaired:
        return f"{report.house_id} was repaired before; no changes."
    lines = [
        *_lines_of_structure(report),
        *_lines_of_lamps(report),
        *_lines_of_rooms(report),
        *_lines_of_leaks(report),
        *_lines_of_furniture(report),
        *filter(None, (report.model_extra or {}).values()),
    ]
    return "\n".join([f"{report.house_id}:", *(f"- {shown(line, MAX_MESSAGE)}" for line in lines)])


def _lines_of_structure(report: RepairReport) -> Iterator[str]:
    living = [r for r in report.removed if r.reason in ("person", "plant")]
    if living:
        yield f"{_n(len(living), 'person or plant', 'persons and plants')} removed."
    gone = [r.item_id for r in report.removed if r.reason not in ("person", "plant")]
    if gone:
        yield f"{_n(len(gone), 'wall')} removed, inside others or in an opening: {_some(gone)}."
    faces = report.faces
    if faces.n_degenerate_dropped:
        yield f"{_n(faces.n_degenerate_dropped, 'face')} without area dropped."
    if faces.n_turned:
        yield f"{_n(faces.n_turned, 'face')} turned to agree with their normals."
    if report.mirrors:
        yield f"{_n(len(report.mirrors), 'mirror')} without a mirror's surface got one."
    s = report.structure
    if s.n_walls_thickened:
        yield f"{_n(s.n_walls_thickened, 'wall')} had no thickness and got one."
    if s.n_floors_thickened + s.n_ceilings_thickened:
        yield (
            f"{_n(s.n_floors_thickened, 'floor')} and {_n(s.n_ceilings_thickened, 'ceiling')} "
            "had no thickness: now slabs that reach into the walls."
        )
    if s.n_walls_made_white:
        yield f"{_n(s.n_walls_made_white, 'wall')} without a colour painted white."
    if s.n_joints_closed:
        yield f"{_n(s.n_joints_closed, 'place')} where walls missed each other closed."
    if s.n_stairwells_closed:
        yield f"{_n(s.n_stairwells_closed, 'floor or ceiling', 'floors or ceilings')} extended over stairwells without a room."
    if report.added_ceilings:
        yield f"{_n(len(report.added_ceilings), 'room')} had walls and no ceiling and got one at the walls' height: {_some(report.added_ceilings)}."
    if s.n_openings:
        yield f"{s.n_openings_cut} of {_n(s.n_openings, 'opening')} cut through the walls."
    if s.n_frames_moved:
        yield f"{_n(s.n_frames_moved, 'piece')} coincided with faces of walls: moved out by 0.5 mm."
    if s.n_parts_moved:
        yield f"{_n(s.n_parts_moved, 'part')} coincided with other faces: moved out by 0.5 mm."
    for wall in s.walls_lost:
        yield (
            f"WALL LOST: of wall {wall.item_id} repair kept {wall.after_m2:.1f} of "
            f"{wall.before_m2:.1f} m2."
        )
    for thing in s.left_as_is:
        yield f"{thing.what} {thing.id} not repaired: {thing.reason}."


def _lines_of_lamps(report: RepairReport) -> Iterator[str]:
    added = [s for s in report.sources if s.bulb_added]
    if added:
        # A radius that only rounding changed is not smaller.
        smaller = sum(s.radius_m < 0.999 * s.radius_given_m for s in added)
        moved = sum(s.moved_m > 0 for s in added)
        more = f", {smaller} of them reduced to fit" if smaller else ""
        more += f", {moved} moved out of the lamp's mesh" if moved else ""
        yield f"{_n(len(added), 'lamp')} had no emitter and got a bulb{more}."
    shaded = sorted({s.item_id for s in report.sources if s.shades})
    if shaded:
        yield f"{_n(len(shaded), 'closed lamp')} got a shade from the enclosing surface: {_some(shaded)}."
    if report.fallback_lights:
        yield f"{_n(len(report.fallback_lights), 'room')} had neither lamp nor window and got a ceiling light: {_some(report.fallback_lights)}."
    if report.added_lamps:
        yield f"{_n(len(report.added_lamps), 'room')} where people live had no lamp, or a weak one, and got a ceiling light: {_some(report.added_lamps)}."
    if report.brightened_lamps:
        yield f"{_n(len(report.brightened_lamps), 'room')} had weak ceiling lamps, now brighter: {_some(report.brightened_lamps)}."


def _lines_of_rooms(report: RepairReport) -> Iterator[str]:
    for room in report.rooms:
        if room.enclosure == "open":
            yield f"Room {room.room_id}{_names_of(room.name)} is open: {room.reason}."
        if not room.lit_by:
            yield f"Nothing lights room {room.room_id}{_names_of(room.name)}."


def _lines_of_leaks(report: RepairReport) -> Iterator[str]:
    if report.leaks is None:
        yield "Leaks were not measured."
        return
    leaks = report.leaks
    if not leaks.n_rays:
        yield "Leaks were not measured: no space is closed, so no ray was sent."
        return
    share = f"{100 * leaks.closed_share:.0f} % of the floor area is in closed rooms"
    if not leaks.n_sky:
        yield f"No light leaks: of {leaks.n_rays} rays none reached the sky; {share}."
        return
    yield f"LIGHT LEAKS IN: {leaks.n_sky} of {leaks.n_rays} rays reached the sky; {share}."
    for space in leaks.spaces:
        if space.n_sky:
            # Name one place per space where light leaks in.
            x, y, z = space.leaks[0].origin
            yield f"{space.n_sky} of them from {_some(space.rooms)}, one near ({x:.2f}, {y:.2f}, {z:.2f})."


def _lines_of_furniture(report: RepairReport) -> Iterator[str]:
    f = report.furniture
    if f.n_unaudited or f.n_unmeasured:
        more = f", {_n(f.n_unaudited, 'piece')} not checked" if f.n_unaudited else ""
        yield f"Too much furniture in one place: only a part of it was checked{more}."
    if f.overlaps:
        # Name the pair that shares most.
        worst = max(f.overlaps, key=lambda o: o.volume_m3)
        yield (
            f"{_n(len(f.overlaps), 'pair')} of pieces share volume, most of all {worst.a} and "
            f"{worst.b} ({1000 * worst.volume_m3:.1f} litres)."
        )
    if f.floating:
        yield f"{_n(len(f.floating), 'piece')} touch nothing: {_some([p.item_id for p in f.floating])}."
    if f.duplicates:
        pairs = [f"{a} and {b}" for a, b in f.duplicates]
        yield f"{_n(len(pairs), 'duplicate')} in one place: {_some(pairs)}."


def _n(count: int, one: str, many: str = "") -> str:
    return f"{count} {one if count == 1 else many or one + 's'}"


def _some(names: list[str] | tuple[str, ...]) -> str:
    return ", ".join(shown(name) for name in names[:5]) + (
        f" and {len(names) - 5} more" if len(names) > 5 else ""
    )


def _names_of(name: str) -> str:
    return f" ({shown(name)})" if name else ""
