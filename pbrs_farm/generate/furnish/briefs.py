"""What each type of room must have, may have, and is filled with; no effects."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pbrs_farm.generate.floor_plan import Plan, RoomType
from pbrs_farm.generate.furnish import rooms
from pbrs_farm.generate.furnish.kitchen import kitchen_places, units_of
from pbrs_farm.generate.furnish.pieces import Shelf
from pbrs_farm.generate.furnish.places import Places, fixed_places
from pbrs_farm.generate.furnish.room_space import FurnishSpace
from pbrs_farm.generate.furnish.template import PieceGroup, Template


@dataclass(frozen=True, slots=True)
class RoomBrief:
    """The groups of one room; density: floor pieces a square metre that fillers go up to."""

    groups: tuple[PieceGroup, ...]  # in the order they are placed
    fillers: tuple[PieceGroup, ...] = ()
    density: float = 0.0
    least_share: float = 0.0  # of the floor that stays walkable while fillers are added
    kitchen: Places | None = None  # where the group "kitchen" can stand


def brief_of(plan: Plan, space: FurnishSpace, shelf: Shelf, rng: np.random.Generator) -> RoomBrief:
    """The brief of a room, by its type and what else the home has."""
    type_ = plan.rooms[space.number].type
    if type_ is RoomType.BEDROOM:
        return _bedroom(plan, space, shelf, rng)
    if type_ in (RoomType.LIVING, RoomType.STUDIO):
        return _living(space, shelf, rng, sleeps=type_ is RoomType.STUDIO)
    if type_ is RoomType.KITCHEN:
        return _kitchen(space, shelf, rng)
    if type_ is RoomType.BATHROOM:
        return _bathroom(plan, space, shelf)
    small = {
        RoomType.WC: _wc, RoomType.HALL: _hall, RoomType.STORE: _store,
        RoomType.WARDROBE: _wardrobe, RoomType.BALCONY: _balcony, RoomType.STAIRS: _stairs,
    }  # fmt: skip
    return small[type_](space, shelf)


def _group(name: str, templates: tuple[Template, ...], *, must: bool = False) -> PieceGroup:
    return PieceGroup(name, templates, must)


def _bedroom(plan: Plan, space: FurnishSpace, shelf: Shelf, rng: np.random.Generator) -> RoomBrief:
    bedrooms = [i for i, r in enumerate(plan.rooms) if r.type is RoomType.BEDROOM]
    largest = max(bedrooms, key=lambda i: (plan.rooms[i].area, -i))
    is_childs = space.number != largest and rng.random() < 0.65
    doubles, singles = rooms.double_beds(shelf), rooms.single_beds(shelf, child=is_childs)
    if is_childs:
        return _childs_room(singles or doubles, shelf)
    # Where no bed for two fits, one for one does.
    beds = doubles + tuple(_lower(t, 2.5) for t in singles[:6])
    groups = (
        _group("bed", beds, must=True),
        _group("wardrobe", rooms.wardrobes(shelf, 2.0 if space.area > 11 else 1.2)),
    )
    fillers = [
        _group("dresser", rooms.dressers(shelf)), _group("armchair", rooms.armchairs(shelf)),
        _group("shelves", rooms.shelves(shelf, widest=1.1)), _group("lamp", rooms.lamps(shelf)),
        _group("plant", rooms.plants(shelf)), _group("baskets", rooms.small_things(shelf)),
    ]  # fmt: skip
    if rng.random() < 0.4:
        fillers.insert(0, _group("desk", rooms.desks(shelf, widest=1.3)))
    return RoomBrief(groups, tuple(fillers), 0.54, 0.38)


def _childs_room(beds: tuple[Template, ...], shelf: Shelf) -> RoomBrief:
    groups = (
        _group("bed", beds, must=True), _group("wardrobe", rooms.wardrobes(shelf, 1.2)),
        _group("desk", rooms.desks(shelf, widest=1.45)),
    )  # fmt: skip
    fillers = (
        _group("shelves", rooms.shelves(shelf, widest=1.1)), _group("toys", rooms.toys(shelf)),
        _group("dresser", rooms.dressers(shelf)), _group("boxes", rooms.boxes(shelf)),
        _group("plant", rooms.plants(shelf)),
    )  # fmt: skip
    return RoomBrief(groups, fillers, 0.56, 0.36)


def _lower(template: Template, by: float) -> Template:
    return replace(template, rank=template.rank - by)


def _living(
    space: FurnishSpace, shelf: Shelf, rng: np.random.Generator, *, sleeps: bool
) -> RoomBrief:
    seats = 6 if space.area > 24 and rng.random() < 0.6 else 4
    lounge = _group("lounge", rooms.lounges(shelf, space.bounds, space.area), must=True)
    dining = _group(
        "dining",
        rooms.dining(shelf, seats)
        + tuple(_lower(t, 0.4) for t in rooms.dining(shelf, 2, at_wall=True)),
    )
    groups = [lounge, dining]
    if sleeps:
        beds = rooms.double_beds(shelf) + rooms.single_beds(shelf)
        groups = [
            _group("bed", beds, must=True), lounge,
            _group("wardrobe", rooms.wardrobes(shelf, 1.6)), dining,
        ]  # fmt: skip
    shelves = _group("shelves", rooms.shelves(shelf))
    fillers = [
        shelves, _group("dresser", rooms.dressers(shelf)), _group("plant", rooms.plants(shelf)),
        _group("armchair", rooms.armchairs(shelf)), _group("lamp", rooms.lamps(shelf)), shelves,
        _group("desk", rooms.desks(shelf)), _group("plant", rooms.plants(shelf)),
    ]  # fmt: skip
    if space.area > 26 and rng.random() < 0.3:
        fillers.insert(0, _group("piano", rooms.pianos(shelf)))
    return RoomBrief(tuple(groups), tuple(fillers), 0.54, 0.42)


def _kitchen(space: FurnishSpace, shelf: Shelf, rng: np.random.Generator) -> RoomBrief:
    units = units_of(shelf)
    wanted = min(max(1.6 + 0.26 * space.area, 3.0), 5.2)
    found = kitchen_places(units, space, rng, wanted=wanted) if units else []
    groups = [_group("kitchen", (), must=units is not None)]
    # Without a wall between, one table serves both rooms.
    if space.walk_polygon.area < 1.2 * space.area:
        small = rooms.dining(shelf, 4) + rooms.dining(shelf, 3, at_wall=True)
        groups.append(_group("dining", small))
    fillers = (
        _group("bin", rooms.small_things(shelf)),
        _group("shelves", rooms.narrow_shelves(shelf)), _group("plant", rooms.plants(shelf)),
    )  # fmt: skip
    return RoomBrief(tuple(groups), fillers, 1.0, 0.30, fixed_places(found))


def _bathroom(plan: Plan, space: FurnishSpace, shelf: Shelf) -> RoomBrief:
    groups = [
        _group("bath", rooms.tubs(shelf), must=True),
        _group("toilet", rooms.toilets(shelf), must=True),
        _group("washbasin", rooms.basins(shelf), must=True),
    ]
    stores = [i for i, r in enumerate(plan.rooms) if r.type is RoomType.STORE]
    baths = [i for i, r in enumerate(plan.rooms) if r.type is RoomType.BATHROOM]
    if not stores and baths[0] == space.number:
        groups.append(_group("washer", rooms.washers(shelf)))
    fillers = (
        _group("shelves", rooms.narrow_shelves(shelf)),
        _group("small things", rooms.small_things(shelf)),
        _group("small things", rooms.small_things(shelf)),
    )
    return RoomBrief(tuple(groups), fillers, 0.9, 0.22)


def _wc(space: FurnishSpace, shelf: Shelf) -> RoomBrief:
    del space
    groups = (
        _group("toilet", rooms.toilets(shelf, beside=0.12), must=True),
        _group("washbasin", rooms.basins(shelf, small=True, before=0.45)),
    )
    return RoomBrief(groups)


def _hall(space: FurnishSpace, shelf: Shelf) -> RoomBrief:
    groups = (
        _group("coats", rooms.coats(shelf)), _group("console", rooms.consoles(shelf)),
    )  # fmt: skip
    fillers = (_group("plant", rooms.plants(shelf)),) if space.area > 8 else ()
    return RoomBrief(groups, fillers, 0.28, 0.45)


def _stairs(space: FurnishSpace, shelf: Shelf) -> RoomBrief:
    # Nothing stands on stairs.
    del space, shelf
    return RoomBrief(())


def _store(space: FurnishSpace, shelf: Shelf) -> RoomBrief:
    del space
    groups = (
        _group("washer", rooms.washers(shelf)), _group("shelves", rooms.stores(shelf)),
    )  # fmt: skip
    fillers = (
        _group("shelves", rooms.stores(shelf)), _group("boxes", rooms.boxes(shelf)),
        _group("boxes", rooms.boxes(shelf)),
    )  # fmt: skip
    return RoomBrief(groups, fillers, 1.6, 0.15)


def _wardrobe(space: FurnishSpace, shelf: Shelf) -> RoomBrief:
    long = max(space.bounds[2] - space.bounds[0], space.bounds[3] - space.bounds[1])
    row = _group("wardrobe", rooms.wardrobes(shelf, long - 0.2))
    fillers = (
        _group("dresser", rooms.dressers(shelf)), _group("shelves", rooms.stores(shelf)),
        _group("boxes", rooms.boxes(shelf)),
    )  # fmt: skip
    return RoomBrief((row,), fillers, 0.8, 0.2)


def _balcony(space: FurnishSpace, shelf: Shelf) -> RoomBrief:
    del space
    groups = (_group("seats", rooms.outdoor_sets(shelf)),)
    return RoomBrief(groups, (_group("plant", rooms.plants(shelf)),), 0.8, 0.3)
