"""What repair changed and measured, in counts and names: repair.json. Frozen values, no effects."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict


class _Record(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


Point = tuple[float, float, float]


class Removed(_Record):
    """An item that was taken out. reason: "person", "plant", or "nothing left of it": the
    item lay wholly inside other walls and openings.
    """

    item_id: str
    name: str
    reason: str


class LeftAsIs(_Record):
    """Something repair could not do its work on. what: "wall", "floor", "ceiling", "opening"."""

    what: str
    id: str
    reason: str


class StructureReport(_Record):
    """The geometry work. n_joints_closed: places where a wall was bridged to its neighbour.
    n_stairwells_closed: floors and ceilings carried on over stairwells that no room covers.
    """

    n_walls: int = 0
    n_walls_thickened: int = 0
    n_walls_made_white: int = 0
    n_floors_thickened: int = 0
    n_ceilings_thickened: int = 0
    n_solid_before: int = 0
    n_joints_closed: int = 0
    n_stairwells_closed: int = 0
    n_openings: int = 0
    n_openings_cut: int = 0
    left_as_is: tuple[LeftAsIs, ...] = ()


class FacesReport(_Record):
    """Triangles dropped because they have no area or no finite corner, and turned the right way."""

    n_degenerate_dropped: int = 0
    n_turned: int = 0


class SourceRepair(_Record):
    """One light source of a lamp. radii and moved_m in metres; escape: light output ratio or None."""

    item_id: str
    source: int
    bulb_added: bool
    radius_given_m: float
    radius_m: float
    moved_m: float
    escape_before: float | None = None
    escape: float | None = None
    shades: tuple[str, ...] = ()


class RoomAudit(_Record):
    """A room: what lights it, how large, whether closed. space: rooms it opens into."""

    room_id: str
    name: str
    floor_area_m2: float
    lit_by: tuple[str, ...]
    enclosure: str
    reason: str
    space: tuple[str, ...]


class Leak(_Record):
    """A ray that reached the sky: where it started, and where it went."""

    origin: Point
    direction: Point


class SpaceLeaks(_Record):
    """Leak meter of one closed space (rooms that open into each other). leaks: the first 50.

    n_blind: rays that saw the back of a face first, so started inside a solid: they prove nothing.
    """

    rooms: tuple[str, ...]
    n_rays: int
    n_blind: int
    n_sky: int
    leaks: tuple[Leak, ...] = ()


class LeakReport(_Record):
    """Leak meter of the house; closed_share: floor area in closed rooms / all floor area."""

    spaces: tuple[SpaceLeaks, ...] = ()
    n_rays: int = 0
    n_blind: int = 0
    n_sky: int = 0
    closed_share: float = 0.0


class Overlap(_Record):
    """Two pieces that share volume. share: of the smaller piece."""

    a: str
    b: str
    volume_m3: float
    share: float


class Floating(_Record):
    """A piece that nothing carries. gap_m: down to what is below it."""

    item_id: str
    gap_m: float


class FurnitureAudit(_Record):
    """Furniture that shares volume, floats, or stands twice in the same place."""

    overlaps: tuple[Overlap, ...] = ()
    floating: tuple[Floating, ...] = ()
    duplicates: tuple[tuple[str, str], ...] = ()


class RepairReport(_Record):
    """Everything that was changed in a house and what was measured in it afterwards.

    was_repaired: it came in repaired, so nothing was changed. is_leaking: None = not measured.
    """

    house_id: str
    was_repaired: bool = False
    removed: tuple[Removed, ...] = ()
    faces: FacesReport = FacesReport()
    structure: StructureReport = StructureReport()
    sources: tuple[SourceRepair, ...] = ()
    fallback_lights: tuple[str, ...] = ()
    rooms: tuple[RoomAudit, ...] = ()
    is_leaking: bool | None = None
    leaks: LeakReport | None = None
    furniture: FurnitureAudit = FurnitureAudit()
