"""What each type of room must have, may have, and is filled with; no effects."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pbrs_farm.generate.floor_plan import Plan, RoomType
from pbrs_farm.generate.furnish import bathroom, bedroom, living, small_rooms
from pbrs_farm.generate.furnish.kitchen import kitchen_places, units_of
from pbrs_farm.generate.furnish.places import Places, fixed_places
from pbrs_farm.generate.furnish.room_space import RoomSpace
from pbrs_farm.generate.furnish.shelf import Shelf
from pbrs_farm.generate.furnish.template import Group, Template


@dataclass(frozen=True, slots=True)
class Brief:
    """The groups of one room; density: floor pieces a square metre that fillers go up to."""

    groups: tuple[Group, ...]  # in the order they are placed
    fillers: tuple[Group, ...] = ()
    density: float = 0.0
    least_share: float = 0.0  # of the floor that stays walkable while fillers are added
    kitchen: Places | None = None  # where the group "kitchen" can stand


def brief_of(plan: Plan, space: RoomSpace, shelf: Shelf, rng: np.random.Generator) -> Brief:
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


def _group(name: str, templates: tuple[Template, ...], *, must: bool = False) -> Group:
    return Group(name, templates, must)


def _bedroom(plan: Plan, space: RoomSpace, shelf: Shelf, rng: np.random.Generator) -> Brief:
    bedrooms = [i for i, r in enumerate(plan.rooms) if r.type is RoomType.BEDROOM]
    largest = max(bedrooms, key=lambda i: (plan.rooms[i].area, -i))
    is_childs = space.number != largest and rng.random() < 0.65
    doubles, singles = bedroom.double_beds(shelf), bedroom.single_beds(shelf, child=is_childs)
    if is_childs:
        return _childs_room(singles or doubles, shelf)
    # Where no bed for two fits, one for one does.
    beds = doubles + tuple(_lower(t, 2.5) for t in singles[:6])
    groups = (
        _group("bed", beds, must=True),
        _group("wardrobe", bedroom.wardrobes(shelf, 2.0 if space.area > 11 else 1.2)),
    )
    fillers = [
        _group("dresser", living.dressers(shelf)), _group("armchair", living.armchairs(shelf)),
        _group("shelves", living.shelves(shelf, widest=1.1)), _group("lamp", living.lamps(shelf)),
        _group("plant", living.plants(shelf)), _group("baskets", bathroom.small_things(shelf)),
    ]  # fmt: skip
    if rng.random() < 0.4:
        fillers.insert(0, _group("desk", bedroom.desks(shelf, widest=1.3)))
    return Brief(groups, tuple(fillers), 0.54, 0.38)


def _childs_room(beds: tuple[Template, ...], shelf: Shelf) -> Brief:
    groups = (
        _group("bed", beds, must=True), _group("wardrobe", bedroom.wardrobes(shelf, 1.2)),
        _group("desk", bedroom.desks(shelf, widest=1.45)),
    )  # fmt: skip
    fillers = (
        _group("shelves", living.shelves(shelf, widest=1.1)), _group("toys", bedroom.toys(shelf)),
        _group("dresser", living.dressers(shelf)), _group("boxes", small_rooms.boxes(shelf)),
        _group("plant", living.plants(shelf)),
    )  # fmt: skip
    return Brief(groups, fillers, 0.56, 0.36)


def _lower(template: Template, by: float) -> Template:
    return replace(template, rank=template.rank - by)


def _living(space: RoomSpace, shelf: Shelf, rng: np.random.Generator, *, sleeps: bool) -> Brief:
    seats = 6 if space.area > 24 and rng.random() < 0.6 else 4
    lounge = _group("lounge", living.lounges(shelf, space.bounds, space.area), must=True)
    dining = _group(
        "dining",
        living.dining(shelf, seats)
        + tuple(_lower(t, 0.4) for t in living.dining(shelf, 2, at_wall=True)),
    )
    groups = [lounge, dining]
    if sleeps:
        beds = bedroom.double_beds(shelf) + bedroom.single_beds(shelf)
        groups = [
            _group("bed", beds, must=True), lounge,
            _group("wardrobe", bedroom.wardrobes(shelf, 1.6)), dining,
        ]  # fmt: skip
    shelves = _group("shelves", living.shelves(shelf))
    fillers = [
        shelves, _group("dresser", living.dressers(shelf)), _group("plant", living.plants(shelf)),
        _group("armchair", living.armchairs(shelf)), _group("lamp", living.lamps(shelf)), shelves,
        _group("desk", bedroom.desks(shelf)), _group("plant", living.plants(shelf)),
    ]  # fmt: skip
    if space.area > 26 and rng.random() < 0.3:
        fillers.insert(0, _group("piano", living.pianos(shelf)))
    return Brief(tuple(groups), tuple(fillers), 0.54, 0.42)


def _kitchen(space: RoomSpace, shelf: Shelf, rng: np.random.Generator) -> Brief:
    units = units_of(shelf)
    wanted = min(max(1.6 + 0.26 * space.area, 3.0), 5.2)
    found = kitchen_places(units, space, rng, wanted=wanted) if units else []
    groups = [_group("kitchen", (), must=units is not None)]
    # Without a wall between, one table serves both rooms.
    if space.walk_polygon.area < 1.2 * space.area:
        small = living.dining(shelf, 4) + living.dining(shelf, 3, at_wall=True)
        groups.append(_group("dining", small))
    fillers = (
        _group("bin", bathroom.small_things(shelf)),
        _group("shelves", bathroom.narrow_shelves(shelf)), _group("plant", living.plants(shelf)),
    )  # fmt: skip
    return Brief(tuple(groups), fillers, 1.0, 0.30, fixed_places(found))


def _bathroom(plan: Plan, space: RoomSpace, shelf: Shelf) -> Brief:
    groups = [
        _group("bath", bathroom.tubs(shelf), must=True),
        _group("toilet", bathroom.toilets(shelf), must=True),
        _group("washbasin", bathroom.basins(shelf), must=True),
    ]
    stores = [i for i, r in enumerate(plan.rooms) if r.type is RoomType.STORE]
    baths = [i for i, r in enumerate(plan.rooms) if r.type is RoomType.BATHROOM]
    if not stores and baths[0] == space.number:
        groups.append(_group("washer", bathroom.washers(shelf)))
    fillers = (
        _group("shelves", bathroom.narrow_shelves(shelf)),
        _group("small things", bathroom.small_things(shelf)),
        _group("small things", bathroom.small_things(shelf)),
    )
    return Brief(tuple(groups), fillers, 0.9, 0.22)


def _wc(space: RoomSpace, shelf: Shelf) -> Brief:
    del space
    groups = (
        _group("toilet", bathroom.toilets(shelf, beside=0.12), must=True),
        _group("washbasin", bathroom.basins(shelf, small=True, before=0.45)),
    )
    return Brief(groups)


def _hall(space: RoomSpace, shelf: Shelf) -> Brief:
    groups = (
        _group("coats", small_rooms.coats(shelf)), _group("console", small_rooms.consoles(shelf)),
    )  # fmt: skip
    fillers = (_group("plant", living.plants(shelf)),) if space.area > 8 else ()
    return Brief(groups, fillers, 0.28, 0.45)


def _stairs(space: RoomSpace, shelf: Shelf) -> Brief:
    # Nothing stands on stairs.
    del space, shelf
    return Brief(())


def _store(space: RoomSpace, shelf: Shelf) -> Brief:
    del space
    groups = (
        _group("washer", bathroom.washers(shelf)), _group("shelves", small_rooms.stores(shelf)),
    )  # fmt: skip
    fillers = (
        _group("shelves", small_rooms.stores(shelf)), _group("boxes", small_rooms.boxes(shelf)),
        _group("boxes", small_rooms.boxes(shelf)),
    )  # fmt: skip
    return Brief(groups, fillers, 1.6, 0.15)


def _wardrobe(space: RoomSpace, shelf: Shelf) -> Brief:
    long = max(space.bounds[2] - space.bounds[0], space.bounds[3] - space.bounds[1])
    row = _group("wardrobe", bedroom.wardrobes(shelf, long - 0.2))
    fillers = (
        _group("dresser", living.dressers(shelf)), _group("shelves", small_rooms.stores(shelf)),
        _group("boxes", small_rooms.boxes(shelf)),
    )  # fmt: skip
    return Brief((row,), fillers, 0.8, 0.2)


def _balcony(space: RoomSpace, shelf: Shelf) -> Brief:
    del space
    groups = (_group("seats", small_rooms.outdoor_sets(shelf)),)
    return Brief(groups, (_group("plant", living.plants(shelf)),), 0.8, 0.3)
