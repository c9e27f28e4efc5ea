"""Required, optional and filler furniture of each room type. Effect: reads briefs.toml beside."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, replace
from math import inf
from pathlib import Path
from typing import Any, Final, Literal

import numpy as np
from pydantic import Field, field_validator

from pbrs_farm.core.record import Record, read_toml
from pbrs_farm.generate.floor_plan import Plan, RoomType
from pbrs_farm.generate.furnish import bedrooms, living_rooms, small_rooms
from pbrs_farm.generate.furnish.kitchen import kitchen_places, units_of
from pbrs_farm.generate.furnish.pieces import Shelf
from pbrs_farm.generate.furnish.places import Places, fixed_places
from pbrs_farm.generate.furnish.room_space import FurnishSpace, free_stretches
from pbrs_farm.generate.furnish.template import PieceGroup, Template


@dataclass(frozen=True, slots=True)
class RoomBrief:
    """The groups of one room; density: floor pieces a square metre that fillers go up to."""

    groups: tuple[PieceGroup, ...]  # in the order they are placed
    fillers: tuple[PieceGroup, ...] = ()
    density: float = 0.0
    least_share: float = 0.0  # of the floor that stays walkable while fillers are added
    kitchen: Places | None = None  # candidate places for the group "kitchen"

    def without(self, names: Collection[str]) -> RoomBrief:
        """The brief without the groups of these names."""
        return replace(
            self,
            groups=tuple(g for g in self.groups if g.name not in names),
            fillers=tuple(g for g in self.fillers if g.name not in names),
        )


# Facts about a room: it is a studio, no room is open to it, it is where the home's laundry is done.
_Fact = Literal["", "studio", "closed", "laundry"]
# Its outline, square metres, metres of its longest row, of its free stretches of wall, seats at its table.
_Measure = Literal["bounds", "area", "row", "stretches", "seats"]


# Template functions available to briefs.toml: every public function of the template modules.
_TEMPLATES_BY_NAME: Final[dict[str, Callable[..., tuple[Template, ...]]]] = {
    name: function
    for module in (bedrooms, living_rooms, small_rooms)
    for name, function in vars(module).items()
    if getattr(function, "__module__", "") == module.__name__ and not name.startswith("_")
}


class _ForSome(Record):
    above_m2: float = -inf
    up_to_m2: float = inf


class _Templates(_ForSome):
    make: str
    given: dict[str, bool | float | _Measure] = Field(default_factory=dict)
    first: int | None = None
    lower: float = 0.0
    chance: float = 1.0

    @field_validator("make")
    @classmethod
    def _is_made_here(cls, make: str) -> str:
        if make not in _TEMPLATES_BY_NAME:
            raise ValueError(f"no module of templates makes {make!r}")
        return make


class _PieceGroup(_ForSome):
    name: str
    of: tuple[_Templates, ...]
    instead: tuple[_Templates, ...] = ()
    must: bool = False
    where: _Fact = ""
    chance: float = 1.0


class BriefTable(Record):
    groups: tuple[_PieceGroup, ...]
    fillers: tuple[_PieceGroup, ...] = ()
    density: float = 0.0
    least_share: float = 0.0


UseWithoutType = Literal["childs_room"]
"""Briefs for uses that are not a RoomType: drawn at random."""

_LEAST_STRETCH_M: Final = 1.3  # shorter walls are not filled from side to side
_FOR_SIX_M2, _FOR_EIGHT_M2 = 16.0, 24.0  # rooms that have a table for so many
_LARGE_TABLES: Final = 0.65  # share of rooms whose table is as large as they let it
_CHILDS_ROOM: Final = "childs_room"
_BRIEFS: Final = read_toml(
    Path(__file__).with_name("briefs.toml"), dict[RoomType | UseWithoutType, BriefTable]
)


def brief_of(
    plan: Plan,
    space: FurnishSpace,
    shelf: Shelf,
    rng: np.random.Generator,
    use: UseWithoutType | None = None,
) -> RoomBrief:
    """Required, optional (drawn) and filler furniture, of the shelf's groups, by the room's type or `use`."""
    type_ = plan.rooms[space.number].type
    name: str = use or (RoomType.LIVING if type_ is RoomType.STUDIO else type_)
    if use is None and type_ is RoomType.BEDROOM and _is_childs(plan, space, rng):
        name = _CHILDS_ROOM
    facts, measures = _facts_of_room(plan, space, type_), _measures(space, type_, rng)

    def groups_of(groups: Iterable[_PieceGroup]) -> tuple[PieceGroup, ...]:
        # Draw only for what the room is large enough for.
        suitable = [
            g
            for g in groups
            if g.where in facts
            and _is_for(g, space)
            and (g.chance == 1.0 or rng.random() < g.chance)
        ]
        return tuple(
            PieceGroup(
                g.name,
                _templates(g.of, space, shelf, measures, rng)
                or _templates(g.instead, space, shelf, measures, rng),
                g.must,
            )
            for g in suitable
        )

    brief = _BRIEFS[name]  # type: ignore[index]
    room_brief = RoomBrief(
        groups_of(brief.groups), groups_of(brief.fillers), brief.density, brief.least_share
    )
    return _with_kitchen(room_brief, space, shelf, rng) if type_ is RoomType.KITCHEN else room_brief


def _is_childs(plan: Plan, space: FurnishSpace, rng: np.random.Generator) -> bool:
    bedrooms = [i for i, r in enumerate(plan.rooms) if r.type is RoomType.BEDROOM]
    largest = max(bedrooms, key=lambda i: (plan.rooms[i].area, -i))
    return bool(space.number != largest and rng.random() < 0.65)


def _facts_of_room(plan: Plan, space: FurnishSpace, type_: RoomType) -> set[_Fact]:
    facts: set[_Fact] = {""}
    if type_ is RoomType.STUDIO:
        facts.add("studio")
    if space.walk_polygon.area < 1.2 * space.area:
        facts.add("closed")
    # The laundry is done in the first bathroom of a home without a store.
    types = [r.type for r in plan.rooms]
    if RoomType.STORE not in types and types[: space.number + 1].count(RoomType.BATHROOM) == 1:
        facts.add("laundry")
    return facts


def _measures(space: FurnishSpace, type_: RoomType, rng: np.random.Generator) -> dict[str, Any]:
    x0, z0, x1, z1 = space.bounds
    measures: dict[str, Any] = {
        "bounds": space.bounds,
        "area": space.area,
        "row": max(x1 - x0, z1 - z0) - 0.2,
        "stretches": free_stretches(space, _LEAST_STRETCH_M),
    }
    if type_ in (RoomType.LIVING, RoomType.STUDIO, RoomType.DINING):
        # Large rooms have tables for eight, small ones for four.
        most = 8 if space.area > _FOR_EIGHT_M2 else 6 if space.area > _FOR_SIX_M2 else 4
        measures["seats"] = most if rng.random() < _LARGE_TABLES else max(most - 2, 4)
    return measures


def _is_for(some: _ForSome, space: FurnishSpace) -> bool:
    return some.above_m2 < space.area <= some.up_to_m2


def _templates(
    some: Iterable[_Templates],
    space: FurnishSpace,
    shelf: Shelf,
    measures: Mapping[str, Any],
    rng: np.random.Generator,
) -> tuple[Template, ...]:
    templates: list[Template] = []
    for row in some:
        if _is_for(row, space) and (row.chance == 1.0 or rng.random() < row.chance):
            arguments = {k: measures[v] if isinstance(v, str) else v for k, v in row.given.items()}
            variants = _TEMPLATES_BY_NAME[row.make](shelf, **arguments)[: row.first]
            templates += [replace(t, rank=t.rank - row.lower) if row.lower else t for t in variants]
    return tuple(templates)


def _with_kitchen(
    brief: RoomBrief, space: FurnishSpace, shelf: Shelf, rng: np.random.Generator
) -> RoomBrief:
    """The brief with the places of the one row of units that its home has."""
    units = units_of(shelf)
    length = min(max(1.6 + 0.26 * space.area, 3.0), 5.2)
    kitchen = kitchen_places(units, space, rng, wanted=length) if units else []
    # Without units nobody misses a kitchen.
    groups = tuple(
        replace(g, is_required=units is not None) if g.name == "kitchen" else g
        for g in brief.groups
    )
    return replace(brief, groups=groups, kitchen=fixed_places(kitchen))
