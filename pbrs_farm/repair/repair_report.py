"""What repair changed and measured, in counts and names: repair.json. Frozen values, no effects."""

from __future__ import annotations

import html
from collections.abc import Iterator

from pbrs_farm.core.record import Record
from pbrs_farm.core.shown_text import MAX_MESSAGE, shown

Point = tuple[float, float, float]


class Removed(Record):
    """An item that was taken out."""

    item_id: str
    name: str
    reason: str  # "person", "plant", or "nothing left of it": inside other walls and openings


class LeftAsIs(Record):
    """Something repair could not do its work on."""

    what: str  # "wall", "floor", "ceiling", "opening"
    id: str
    reason: str


class SideArea(Record):
    """A wall seen from the side, openings cut apart, or a floor or ceiling seen from above."""

    item_id: str
    kind: str  # "wall", "floor", "ceiling", "ground"
    before_m2: float  # as read, or as thickened
    after_m2: float


class WallLoss(Record):
    """A wall of which repair took more than a tenth: a fault of the repair."""

    item_id: str
    before_m2: float
    after_m2: float


class StructureReport(Record):
    """What was done to walls, floors, ceilings and openings."""

    n_walls: int = 0
    n_walls_thickened: int = 0  # planar as read
    n_walls_made_white: int = 0  # the source names no colour
    n_floors_thickened: int = 0
    n_ceilings_thickened: int = 0
    n_solid_before: int = 0  # walls, floors and ceilings that came as closed shells
    n_joints_closed: int = 0  # places where a wall was bridged to its neighbour
    n_stairwells_closed: int = 0  # floors and ceilings over stairwells that no room covers
    n_openings: int = 0
    n_openings_cut: int = 0  # the others touch no wall
    n_frames_moved: int = 0  # doors, windows and things that lay in the faces of walls or floors
    left_as_is: tuple[LeftAsIs, ...] = ()
    areas: tuple[SideArea, ...] = ()  # of every wall, floor and ceiling
    walls_lost: tuple[WallLoss, ...] = ()


class FacesReport(Record):
    """Triangles dropped because they have no area or no finite corner, and turned the right way."""

    n_degenerate_dropped: int = 0
    n_turned: int = 0


class SourceRepair(Record):
    """One light source of a lamp."""

    item_id: str
    source: int  # index into Item.lights
    bulb_added: bool
    radius_given_m: float  # of the source, or the recipe
    radius_m: float  # smaller where the lamp leaves no room
    moved_m: float  # of the bulb, out of the lamp's own mesh
    escape_before: float | None = None  # light output ratio without shades; None = not measured
    escape: float | None = None  # light output ratio, 0..1
    shades: tuple[str, ...] = ()  # names of the surfaces that became shades


class RoomAudit(Record):
    """A room: what lights it, how large, whether closed."""

    room_id: str
    name: str
    floor_area_m2: float
    lit_by: tuple[str, ...]  # as Room.lit_by
    enclosure: str
    reason: str
    space: tuple[str, ...]  # ids of the rooms it opens into, its own included


class Leak(Record):
    """A ray that reached the sky: where it started, and where it went."""

    origin: Point
    direction: Point


class SpaceLeaks(Record):
    """Leak meter of one closed space: rooms that open into each other."""

    rooms: tuple[str, ...]
    n_rays: int
    n_blind: int  # met a back side first, so began inside a solid: they prove nothing
    n_sky: int  # reached the sky
    leaks: tuple[Leak, ...] = ()  # the first 50


class LeakReport(Record):
    """Leak meter of the house."""

    spaces: tuple[SpaceLeaks, ...] = ()
    n_rays: int = 0
    n_blind: int = 0
    n_sky: int = 0
    closed_share: float = 0.0  # floor area in closed rooms / all floor area


class Overlap(Record):
    """Two pieces that share volume."""

    a: str
    b: str
    volume_m3: float
    share: float  # of the smaller piece, 0..1


class Floating(Record):
    """A piece that nothing carries."""

    item_id: str
    gap_m: float  # down to what is below it; -1 = nothing is


class FurnitureAudit(Record):
    """Furniture that shares volume, floats, or stands twice in the same place."""

    overlaps: tuple[Overlap, ...] = ()
    floating: tuple[Floating, ...] = ()  # touch no other item
    duplicates: tuple[tuple[str, str], ...] = ()  # same mesh, same place
    n_unaudited: int = 0  # pieces beyond those that are audited
    n_unmeasured: int = 0  # pairs whose boxes meet beyond those that are intersected, at least


class RepairReport(Record):
    """Everything that was changed in a house and what was measured in it afterwards."""

    house_id: str
    was_repaired: bool = False  # it came in repaired: nothing was changed
    removed: tuple[Removed, ...] = ()
    faces: FacesReport = FacesReport()
    structure: StructureReport = StructureReport()
    mirrors: tuple[str, ...] = ()  # ids of items that were drawn as boards and mirror now
    sources: tuple[SourceRepair, ...] = ()
    fallback_lights: tuple[str, ...] = ()  # ids of the rooms that got one: nothing lit them
    added_lamps: tuple[str, ...] = ()  # ids of rooms with no lamp, or too weak ones
    added_ceilings: tuple[str, ...] = ()  # ids of rooms that had walls and no ceiling
    rooms: tuple[RoomAudit, ...] = ()
    is_leaking: bool | None = None  # None = not measured
    leaks: LeakReport | None = None
    furniture: FurnitureAudit = FurnitureAudit()

    def __repr__(self) -> str:
        n_lights = len(self.fallback_lights) + len(self.added_lamps)
        return (
            f"<RepairReport {shown(self.house_id)}: {len(self.rooms)} rooms,"
            f" {len(self.removed)} items taken out, {n_lights} lamps added>"
        )

    def _repr_html_(self) -> str:
        """What was wrong with the house and what was done about it, for a notebook."""
        head, *lines = summary_of_report(self).split("\n")
        rows = "".join(f"<li>{html.escape(line.removeprefix('- '))}</li>" for line in lines)
        return f"<div>{html.escape(head)}<ul>{rows}</ul></div>"


# A repair report in plain words: what was wrong with the house.


def summary_of_report(report: RepairReport) -> str:
    """What was wrong with a house and what was done about it, a sentence per line."""
    if report.was_repaired:
        return f"{report.house_id} was repaired before; nothing was changed."
    lines = [
        *_structure(report),
        *_lamps(report),
        *_rooms(report),
        *_leaks(report),
        *_furniture(report),
    ]
    return "\n".join([f"{report.house_id}:", *(f"- {shown(line, MAX_MESSAGE)}" for line in lines)])


def _structure(report: RepairReport) -> Iterator[str]:
    # Say what was taken out.
    living = [r for r in report.removed if r.reason in ("person", "plant")]
    if living:
        yield f"{_n(len(living), 'person or plant', 'persons and plants')} taken out."
    gone = [r.item_id for r in report.removed if r.reason not in ("person", "plant")]
    if gone:
        yield f"{_n(len(gone), 'wall')} lay wholly inside others or in an opening: {_some(gone)}."
    # Say what was wrong with single faces.
    faces = report.faces
    if faces.n_degenerate_dropped:
        yield f"{_n(faces.n_degenerate_dropped, 'face')} without area dropped."
    if faces.n_turned:
        yield f"{_n(faces.n_turned, 'face')} looked against their own normals and were turned."
    if report.mirrors:
        yield f"{_n(len(report.mirrors), 'mirror')} that did not mirror got a mirror's surface."
    # Say what was done to walls, floors, ceilings and openings.
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
        yield f"{_n(s.n_stairwells_closed, 'floor or ceiling', 'floors or ceilings')} carried on over stairwells without a room."  # fmt: skip
    if report.added_ceilings:
        yield f"{_n(len(report.added_ceilings), 'room')} had walls and no ceiling and got one at the walls' height: {_some(report.added_ceilings)}."
    if s.n_openings:
        yield f"{s.n_openings_cut} of {_n(s.n_openings, 'opening')} cut through the walls."
    if s.n_frames_moved:
        yield f"{_n(s.n_frames_moved, 'piece')} lay in the faces of walls: moved 0.5 mm out."
    for wall in s.walls_lost:
        yield (
            f"WALL LOST: of wall {wall.item_id} repair left {wall.after_m2:.1f} of "
            f"{wall.before_m2:.1f} m2."
        )
    for thing in s.left_as_is:
        yield f"{thing.what} {thing.id} left as it is: {thing.reason}."


def _lamps(report: RepairReport) -> Iterator[str]:
    added = [s for s in report.sources if s.bulb_added]
    if added:
        # A radius that only rounding changed is not smaller.
        smaller = sum(s.radius_m < 0.999 * s.radius_given_m for s in added)
        moved = sum(s.moved_m > 0 for s in added)
        more = f", {smaller} of them smaller than given to fit" if smaller else ""
        more += f", {moved} moved out of the lamp's own mesh" if moved else ""
        yield f"{_n(len(added), 'lamp')} had no part that shines and got a bulb{more}."
    shaded = sorted({s.item_id for s in report.sources if s.shades})
    if shaded:
        yield f"{_n(len(shaded), 'lamp')} kept their light in; what encloses it is a shade now: {_some(shaded)}."  # fmt: skip
    if report.fallback_lights:
        yield f"{_n(len(report.fallback_lights), 'room')} had neither lamp nor window and got a ceiling light: {_some(report.fallback_lights)}."  # fmt: skip
    if report.added_lamps:
        yield f"{_n(len(report.added_lamps), 'room')} where people live had no lamp, or too weak ones; a ceiling light was added for the evening: {_some(report.added_lamps)}."  # fmt: skip


def _rooms(report: RepairReport) -> Iterator[str]:
    for room in report.rooms:
        if room.enclosure == "open":
            yield f"Room {room.room_id}{_named(room.name)} is open: {room.reason}."
        if not room.lit_by:
            yield f"Nothing lights room {room.room_id}{_named(room.name)}."


def _leaks(report: RepairReport) -> Iterator[str]:
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
            yield f"{space.n_sky} of them from {_some(space.rooms)}, one near ({x:.2f}, {y:.2f}, {z:.2f})."  # fmt: skip


def _furniture(report: RepairReport) -> Iterator[str]:
    f = report.furniture
    if f.n_unaudited or f.n_unmeasured:
        more = f", {_n(f.n_unaudited, 'piece')} not looked at" if f.n_unaudited else ""
        yield f"Too much furniture stands in one place: the audit is of a part of it{more}."
    if f.overlaps:
        # Name the pair that shares most.
        worst = max(f.overlaps, key=lambda o: o.volume_m3)
        yield (
            f"{_n(len(f.overlaps), 'pair')} of pieces share volume, most of all {worst.a} and "
            f"{worst.b} ({1000 * worst.volume_m3:.1f} litres)."
        )
    if f.floating:
        yield f"{_n(len(f.floating), 'piece')} touch nothing: {_some([p.item_id for p in f.floating])}."  # fmt: skip
    if f.duplicates:
        pairs = [f"{a} and {b}" for a, b in f.duplicates]
        yield f"{_n(len(pairs), 'piece')} stand twice in one place: {_some(pairs)}."


def _n(count: int, one: str, many: str = "") -> str:
    return f"{count} {one if count == 1 else many or one + 's'}"


def _some(names: list[str] | tuple[str, ...]) -> str:
    return ", ".join(shown(name) for name in names[:5]) + (
        f" and {len(names) - 5} more" if len(names) > 5 else ""
    )


def _named(name: str) -> str:
    return f" ({shown(name)})" if name else ""
