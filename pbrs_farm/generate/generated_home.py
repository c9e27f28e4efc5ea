"""A made home by its seed: plan and furniture, drawn again until no gate is broken, and its file; no effects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from math import inf
from typing import Final

import numpy as np
from shapely.geometry import Polygon

from pbrs_farm.core import keys
from pbrs_farm.core.catalogue import EMPTY, Catalogue
from pbrs_farm.core.made_home import VERSION, MadeHome
from pbrs_farm.generate.drawn_plan import drawn_plan
from pbrs_farm.generate.floor_plan import PlacedPiece, Plan, PlanRoom, Rect, RoomType, Storey
from pbrs_farm.generate.furnish.furnished import furnished
from pbrs_farm.generate.furnish.room_space import FurnishSpace, room_space
from pbrs_farm.generate.furnish.walk_bitmap import WalkMap
from pbrs_farm.generate.home_file import HomeContents, home_contents
from pbrs_farm.generate.openings import plan_faults
from pbrs_farm.generate.plan_families import plan_families
from pbrs_farm.generate.programme import Programme, Wishes, with_family
from pbrs_farm.generate.staircase import Stair
from pbrs_farm.generate.two_storeys import drawn_storeys


@dataclass(frozen=True, slots=True)
class GeneratedHome:
    """A generated home."""

    storeys: tuple[Storey, ...]  # from below
    contents: HomeContents
    origin: str
    stair: Stair | None = None  # between them

    @property
    def data(self) -> bytes:
        """Its .sh3d, packed anew at each call."""
        return self.contents.archive()


def generate_home(
    home: MadeHome, catalogue: Catalogue, programme: Programme | None = None
) -> GeneratedHome:
    """The home of a seed, or of a seed and a programme; equal arguments give equal bytes.

    Raises BadInput for wishes that no home meets.
    """
    low, high = home.bedrooms
    bedrooms = max(low, home.offices + 1 if home.offices else 0), high
    area = float(home.area[0]), float(home.area[1])
    wishes = Wishes(bedrooms, area, home.storeys, home.plans, home.offices)
    # All randomness comes from one stream that the wishes and the version name.
    words = (home.word,) if programme is None else (home.word, repr(programme))
    rng = np.random.default_rng(keys.seed("made", home.stream, *words))
    shelf = catalogue if home.furniture else EMPTY
    drawn = drawn_home(rng, shelf, wishes=wishes, programme=programme, style=home.style)
    origin = origin_of_home(home, shelf, programme)
    contents = home_contents(drawn.storeys, shelf, rng, drawn.stair, name=home.name, origin=origin)
    return GeneratedHome(drawn.storeys, contents, origin, drawn.stair)


def origin_of_home(home: MadeHome, catalogue: Catalogue, programme: Programme | None = None) -> str:
    """Identity of a generated home, for its file: its word and a digest of all other inputs."""
    shelf = catalogue if home.furniture else EMPTY
    digest = keys.digest("made", home.version, home.word, repr(programme), shelf.digest)
    return f"{home.word} {digest}"


def furnish_storeys(
    plans: Sequence[Plan],
    given_pieces: Sequence[Sequence[PlacedPiece]],
    catalogue: Catalogue,
    key: str,
    *,
    seed: int,
    style: str = "",
    name: str = "home",
) -> GeneratedHome:
    """Build the storeys from below; rooms without given pieces are furnished by a seed.

    key: identifies the plans; it is combined with the seed.
    """
    rng = np.random.default_rng(keys.seed("own plan", VERSION, seed, style, key))
    storeys = []
    for plan, standing in zip(plans, given_pieces, strict=True):
        grounds = [Polygon(room.polygon).buffer(0.02) for room in plan.rooms]
        taken = {piece.room for piece in standing}
        drawn = [
            p
            for p in furnished(plan, catalogue, rng, style)
            if p.room not in taken and grounds[p.room].contains(Polygon(p.corners))
        ]
        storeys.append(Storey(plan, (*standing, *drawn)))
    words = [repr(standing) for standing in given_pieces if standing]
    digest = keys.digest("own plan", VERSION, seed, style, key, catalogue.digest, *words)
    contents = home_contents(storeys, catalogue, rng, name=name, origin=f"plan {digest}")
    return GeneratedHome(tuple(storeys), contents, f"plan {digest}")


_TRIES: Final = 4
_FURNISHINGS: Final = 2  # times that one plan is furnished before another plan is drawn


@dataclass(frozen=True, slots=True)
class DrawnHome:
    """Its storeys from below, the stairs between, and what breaks a gate, a line each."""

    storeys: tuple[Storey, ...]
    stair: Stair | None
    broken: tuple[str, ...]

    @property
    def plan(self) -> Plan:
        """Of the lowest storey."""
        return self.storeys[0].plan

    @property
    def pieces(self) -> tuple[PlacedPiece, ...]:
        """Furniture of the lowest storey."""
        return self.storeys[0].pieces


def drawn_home(
    rng: np.random.Generator,
    catalogue: Catalogue,
    *,
    wishes: Wishes | None = None,
    programme: Programme | None = None,
    style: str = "",
) -> DrawnHome:
    """A home by seed or for a programme; of some tries the one that breaks fewest gates. BadInput without."""
    # Draw the family once, so that families whose plans often fail are not under-represented.
    wishes = with_family(wishes or Wishes(), rng) if programme is None else wishes
    best: DrawnHome | None = None
    for _ in range(_TRIES):
        plans, stair = _drawn_plans(rng, wishes, programme)
        if wishes is not None:
            plans = with_other_uses(plans, wishes, rng.spawn(1)[0])
        for _ in range(_FURNISHINGS):
            storeys = tuple(Storey(p, furnished(p, catalogue, rng, style)) for p in plans)
            home = DrawnHome(
                storeys, stair, tuple(b for s in storeys for b in _broken(s, catalogue))
            )
            if best is None or len(home.broken) < len(best.broken):
                best = home
            if not best.broken:
                return best
    assert best is not None
    return best


def with_other_uses(
    plans: tuple[Plan, ...], wishes: Wishes, rng: np.random.Generator
) -> tuple[Plan, ...]:
    """The storeys with the wished offices, else by chance a dining room and an office; bedrooms remain."""
    if wishes.offices is not None:
        return with_rooms_of(plans, RoomType.OFFICE, wishes.offices)
    family = plan_families()[plans[0].family]
    is_dining, is_office = rng.random(2) < (family.dining_room, family.office)
    for type_, is_drawn in ((RoomType.DINING, is_dining), (RoomType.OFFICE, is_office)):
        bedrooms = [r for plan in plans for r in plan.rooms if r.type is RoomType.BEDROOM]
        if is_drawn and len(bedrooms) > max(wishes.bedrooms[0], 1):
            plans = with_rooms_of(plans, type_, 1)
    return plans


def with_rooms_of(plans: tuple[Plan, ...], type_: RoomType, n: int) -> tuple[Plan, ...]:
    """The storeys with n bedrooms turned into offices or dining rooms; the largest stays one.

    Rooms from which one enters a private room come last; else offices are the smallest bedrooms, and
    dining rooms those nearest to the kitchen.
    """
    rooms = [
        (storey, number) for storey, plan in enumerate(plans) for number in range(len(plan.rooms))
    ]
    bedrooms = [
        place for place in rooms if plans[place[0]].rooms[place[1]].type is RoomType.BEDROOM
    ]

    def rank(place: tuple[int, int]) -> tuple[bool, float]:
        plan = plans[place[0]]
        room = plan.rooms[place[1]]
        guests = (o for o in plan.openings if o.other == place[1] and o.room != place[1])
        private = (RoomType.WARDROBE, RoomType.BATHROOM)
        has_guest = any(plan.rooms[o.room].type in private for o in guests)
        return has_guest, _from_kitchen(plan, room) if type_ is RoomType.DINING else room.area

    largest = max(bedrooms, key=lambda place: plans[place[0]].rooms[place[1]].area, default=None)
    chosen = sorted((place for place in bedrooms if place != largest), key=rank)[:n]
    names = {
        place: type_.label if n == 1 else f"{type_.label} {k + 1}"
        for k, place in enumerate(sorted(chosen))
    }
    return tuple(
        replace(
            plan,
            rooms=tuple(
                replace(room, type=type_, name=names[storey, number])
                if (storey, number) in names
                else room
                for number, room in enumerate(plan.rooms)
            ),
        )
        for storey, plan in enumerate(plans)
    )


def _from_kitchen(plan: Plan, room: PlanRoom) -> float:
    """Metres from a room to the nearest kitchen of its storey."""
    kitchens = [Polygon(r.polygon) for r in plan.rooms if r.type is RoomType.KITCHEN]
    return min((float(k.distance(Polygon(room.polygon))) for k in kitchens), default=inf)


def _broken(storey: Storey, catalogue: Catalogue) -> list[str]:
    report = furnish_report(storey.plan, storey.pieces, catalogue)
    return [*plan_faults(storey.plan), *report.broken]


def _drawn_plans(
    rng: np.random.Generator, wishes: Wishes | None, programme: Programme | None
) -> tuple[tuple[Plan, ...], Stair | None]:
    if wishes is not None and wishes.storeys == 2 and programme is None:
        return drawn_storeys(rng, wishes)
    return (drawn_plan(rng, wishes, programme),), None


_SEATS: Final = ("sofa", "corner_sofa", "armchair", "chair")
MUST_HAVES: Final[dict[RoomType, tuple[tuple[str, ...], ...]]] = {
    RoomType.BEDROOM: (("bed",),),
    RoomType.OFFICE: (("desk",),),
    RoomType.DINING: (("dining_table",),),
    RoomType.STUDIO: (("bed",), _SEATS),
    RoomType.LIVING: (_SEATS,),
    RoomType.KITCHEN: (("sink",), ("cooker", "hob"), ("fridge",)),
    RoomType.BATHROOM: (("toilet",), ("washbasin",), ("bathtub", "shower")),
    RoomType.WC: (("toilet",),),
}
"""Of each type of room: one piece of each of these groups; and a lamp in every room."""

_MAY_OVERLAP: Final = {
    frozenset(pair)
    for pair in (
        ("chair", "dining_table"),
        ("chair", "desk"),
        ("office_chair", "desk"),
        ("chair", "coffee_table"),
        ("stool", "piano"),
        ("armchair", "dining_table"),
    )
}
_ON_FLOOR_M: Final = 0.05
_DEEP_M: Final = 0.01


@dataclass(frozen=True, slots=True)
class FurnishReport:
    """Faults of a furnished plan, one line each, and how full the home is."""

    broken: tuple[str, ...]
    pieces_per_m2: float  # on the floor
    walkable: float  # share of the floor of all rooms


def furnish_report(
    plan: Plan, pieces: tuple[PlacedPiece, ...], catalogue: Catalogue
) -> FurnishReport:
    """Check a furnished plan for missing (of those in the catalogue), blocked or overlapping pieces."""
    broken, walked, area = [], 0.0, 0.0
    grounds = [_ground_rect(p) for p in pieces]
    for number, room in enumerate(plan.rooms):
        placed = [p for p in pieces if p.room == number]
        broken += [f"{room.name}: no {group}" for group in missing(room.type, placed, catalogue)]
        space = room_space(plan, number)
        standing = [r for p, r in zip(pieces, grounds, strict=True) if p.elevation < 0.4]
        walk = WalkMap(space, standing)
        region = walk.reached(walk.free, ())
        if WalkMap(space).joined_ways != walk.joined_ways or region is None:
            broken.append(f"{room.name}: its doors are not joined")
        walked += walk.share(region) * room.area if region is not None else 0.0
        area += room.area
        broken += _blocked(space, placed)
    broken += _overlapping_pieces(pieces, grounds)
    n = sum(p.elevation < _ON_FLOOR_M for p in pieces)
    return FurnishReport(tuple(broken), n / area, walked / area)


def missing(type_: RoomType, pieces: list[PlacedPiece], catalogue: Catalogue) -> list[str]:
    """The groups that a room of that type lacks."""
    has = {p.piece.group for p in pieces}
    needed = MUST_HAVES.get(type_, ())
    if type_ not in (RoomType.BALCONY, RoomType.STAIRS):
        needed = (*needed, ("ceiling_lamp", "floor_lamp"))
    return [
        " or ".join(groups) for groups in needed if not has & set(groups) and catalogue.of(*groups)
    ]


def _blocked(space: FurnishSpace, pieces: list[PlacedPiece]) -> list[str]:
    """Furniture before doors, above window sills, or outside the room."""
    faults = []
    for piece in pieces:
        ground = _ground_rect(piece)
        if piece.elevation < 1.9 and any(_meet(ground, d) for d in space.doors.tolist()):
            faults.append(f"{piece.piece.name} blocks a door")
        if any(_meet(ground, o) for o in space.outside.tolist()):
            faults.append(f"{piece.piece.name} is in a wall")
        top = piece.elevation + piece.height
        if piece.piece.group == "sink":
            top = 0.9
        for window in space.windows:
            hides = any(
                top > low + 0.02 and _meet(ground, zone) for zone, low in window.clear_above
            )
            if hides and piece.elevation < 1.9:
                faults.append(f"{piece.piece.name} hides a window")
    return faults


def _overlapping_pieces(pieces: tuple[PlacedPiece, ...], grounds: list[Rect]) -> list[str]:
    faults = []
    for (a, ra), (b, rb) in combinations(zip(pieces, grounds, strict=True), 2):
        if a.room != b.room or not _meet(ra, rb):
            continue
        depth = min(a.elevation + a.height, b.elevation + b.height) - max(a.elevation, b.elevation)
        pair = frozenset((a.piece.group, b.piece.group))
        if depth > _DEEP_M and pair not in _MAY_OVERLAP:
            # Allow a television inside the edge of its cabinet, and taps below wall cabinets.
            if "tv" in pair and depth < 0.3:
                continue
            faults.append(f"{a.piece.name} and {b.piece.name} overlap")
    return faults


def _meet(a: Rect | list[float], b: Rect | list[float]) -> bool:
    x = min(a[2], b[2]) - max(a[0], b[0])
    z = min(a[3], b[3]) - max(a[1], b[1])
    return bool(np.minimum(x, z) > _DEEP_M)


def _ground_rect(piece: PlacedPiece) -> Rect:
    xs, zs = [p[0] for p in piece.corners], [p[1] for p in piece.corners]
    return min(xs), min(zs), max(xs), max(zs)
