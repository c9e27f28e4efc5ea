"""Changes and measurements of repair, as counts and names: repair.json. Frozen values, no effects."""

from __future__ import annotations

import html

from pbrs_farm.core.record import Record
from pbrs_farm.core.shown_text import shown
from pbrs_farm.repair.report_text import summary_of_report

Point = tuple[float, float, float]


class Removed(Record):
    """A removed item."""

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
    """Changes to walls, floors, ceilings and openings."""

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
    n_frames_moved: int = (
        0  # doors, windows and items moved out of coplanar faces of walls or floors
    )
    n_parts_moved: int = 0  # parts of items moved out of coplanar faces of others
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
    gap_m: float  # distance to the next surface below; -1 = none


class FurnitureAudit(Record):
    """Furniture that overlaps, floats, or is duplicated in place."""

    overlaps: tuple[Overlap, ...] = ()
    floating: tuple[Floating, ...] = ()  # touch no other item
    duplicates: tuple[tuple[str, str], ...] = ()  # same mesh, same place
    n_unaudited: int = 0  # pieces beyond the audit's limit
    n_unmeasured: int = 0  # minimum number of touching pairs beyond the limit of intersections


class RepairReport(Record, extra="allow"):
    """The changes to a house, and the measurements after them; facts without a field are sentences."""

    __pydantic_extra__: dict[str, str]

    house_id: str
    was_repaired: bool = False  # it came in repaired: nothing was changed
    removed: tuple[Removed, ...] = ()
    faces: FacesReport = FacesReport()
    structure: StructureReport = StructureReport()
    mirrors: tuple[str, ...] = ()  # ids of items drawn as boards and replaced by mirrors
    sources: tuple[SourceRepair, ...] = ()
    fallback_lights: tuple[str, ...] = ()  # ids of the rooms that got one: nothing lit them
    added_lamps: tuple[str, ...] = ()  # ids of rooms with no lamp, or too weak ones
    brightened_lamps: tuple[str, ...] = ()  # ids of rooms whose ceiling lamps were too weak
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
        """Summary of the faults and their repairs, for a notebook."""
        head, *lines = summary_of_report(self).split("\n")
        rows = "".join(f"<li>{html.escape(line.removeprefix('- '))}</li>" for line in lines)
        return f"<div>{html.escape(head)}<ul>{rows}</ul></div>"
