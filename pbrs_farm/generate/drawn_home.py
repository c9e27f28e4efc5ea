"""A furnished home by seed: plan and furniture, of one storey or two, drawn again until no gate is broken; no effects."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import inf
from typing import Final

import numpy as np
from shapely.geometry import Polygon

from pbrs_farm.core.catalogue import Catalogue
from pbrs_farm.generate.drawn_plan import drawn_plan
from pbrs_farm.generate.floor_plan import PlacedPiece, Plan, PlanRoom, RoomType, Storey
from pbrs_farm.generate.furnish.furnished import furnished
from pbrs_farm.generate.furnish.gates import furnish_report
from pbrs_farm.generate.openings import plan_faults
from pbrs_farm.generate.plan_families import plan_families
from pbrs_farm.generate.programme import Programme, Wishes, with_family
from pbrs_farm.generate.staircase import Stair
from pbrs_farm.generate.two_storeys import drawn_storeys

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
