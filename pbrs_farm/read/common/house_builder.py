"""A house under construction by a reader: structure, levels of rooms, openings, limits. No effects."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from pbrs_farm.core import keys
from pbrs_farm.core.arrays import F64
from pbrs_farm.core.classes import CEILING, FLOOR, WALL
from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.house import (
    MAX_INSTANCES,
    House,
    Item,
    ItemKind,
    Level,
    Opening,
    Room,
    Source,
    Surface,
)
from pbrs_farm.core.recipe import ReadFields
from pbrs_farm.read.common.doors_and_windows import Hole, fill_hole, opening_of
from pbrs_farm.read.common.material_library import MaterialLibrary
from pbrs_farm.read.common.notes import Notes
from pbrs_farm.read.common.rooms import check_rooms, level_of, levels_of, room_at

# NYU40 class of each kind; grounds have none.
CLASS_OF_STRUCTURE: Final = {ItemKind.WALL: WALL, ItemKind.FLOOR: FLOOR, ItemKind.CEILING: CEILING}


def structure_item(
    item_id: str,
    kind: ItemKind,
    surfaces: Sequence[Surface],
    *,
    name: str = "",
    level_id: str = "0",
    source_class: str = "",
    room_id: str | None = None,
    boundary_of: Sequence[str] = (),
) -> Item:
    """An item of a structure's kind. name, source_class: by default the kind; boundary_of: rooms of a wall."""
    return Item(
        id=item_id,
        name=name or kind.value,
        kind=kind,
        level_id=level_id,
        surfaces=tuple(surfaces),
        nyu40=CLASS_OF_STRUCTURE.get(kind, 0),
        source_class=source_class or kind.value.title(),
        room_id=room_id,
        tags=tuple(f"boundary_of:{room}" for room in boundary_of),
    )


def unique_id(name: str, taken: set[str]) -> str:
    """The name, with a number if it is taken; it is taken then."""
    unique, k = name, 2
    while unique in taken:
        unique, k = f"{name}.{k}", k + 1
    taken.add(unique)
    return unique


@dataclass(slots=True)
class HouseBuilder:
    """Collects a house's rooms, items and openings; `house` checks the limits and completes it.

    A reader calls `set_rooms` first: items and holes are sorted into the levels and rooms that it
    numbers. State: the parts added so far.

        builder = HouseBuilder(path.name, fields, notes, library)
        builder.set_rooms(rooms)
        for item in items:
            builder.add(item, foot(item))
        for hole in holes:
            builder.add_hole(hole)
        return builder.house(path.stem, Source("front3d", path.name, sha256))

    Not for formats whose file numbers levels and rooms itself (Sweet Home 3D, SUNCG).
    """

    file: str  # name, for messages
    fields: ReadFields
    notes: Notes
    library: MaterialLibrary
    levels: tuple[Level, ...] = ()
    rooms: tuple[Room, ...] = ()
    items: list[Item] = field(default_factory=list)
    openings: list[Opening] = field(default_factory=list)
    _id_of_room: dict[str, str] = field(default_factory=dict)  # the file's ids -> new ones

    def set_rooms(self, rooms: Sequence[Room]) -> None:
        """Sort rooms into numbered levels. BadHouse for too many or too much overlap."""
        self.levels, self.rooms = levels_of(rooms)
        check_rooms(self.rooms, self.file)
        self._id_of_room = {old.id: new.id for old, new in zip(rooms, self.rooms, strict=True)}

    def level_of(self, y: float) -> str:
        """The id of the level that holds a height of the world, metres."""
        return level_of(self.levels, y)

    def room_at(self, point: F64) -> str | None:
        """The id of the room that holds a point (3,) of the world, metres; None where none does."""
        return room_at(self.rooms, point)

    def add(self, item: Item, foot_y: float, place: F64 | None = None) -> None:
        """Add an item to the level of foot_y and to the room that the file calls item.room_id.

        Items without a room_id are in the room around the place (3,), if one is given. The rooms of
        tags `boundary_of:` are renamed, too.
        """
        if item.room_id:
            room_id = self._id_of_room.get(item.room_id)
        else:
            room_id = None if place is None else self.room_at(place)
        tags = []
        for tag in item.tags:
            word, _, name = tag.partition(":")
            is_room = word == "boundary_of"
            tags.append(f"{word}:{self._id_of_room.get(name, name)}" if is_room else tag)
        level_id = self.level_of(foot_y)
        self.items.append(replace(item, level_id=level_id, room_id=room_id, tags=tuple(tags)))

    def add_hole(
        self, hole: Hole, *, foot_y: float | None = None, cut_y: float | None = None
    ) -> None:
        """Add the door or window that fills a hole, and the opening that repair cuts.

        foot_y: a height on the level of the door or window; cut_y: on that of the opening; each by
        default the hole's lower edge.
        """
        low = float(hole.centre[1] - hole.size[1] / 2)
        level = self.level_of(low if foot_y is None else foot_y)
        item = fill_hole(hole, self.library, level, self.room_at(hole.centre))
        self.items += [item] if item is not None else []
        self.openings.append(opening_of(hole, self.level_of(low if cut_y is None else cut_y)))

    def house(
        self, stem: str, source: Source, *, name: str = "", openings: Iterable[Opening] = ()
    ) -> House:
        """The completed House. stem: of its file's name, with which its id begins.

        Raises BadHouse for too many triangles or items, and for coordinates too far away.
        """
        self._check_limits()
        return House(
            id=keys.house_id(stem, source.sha256),
            name=name or stem,
            source=source,
            levels=self.levels,
            rooms=self.rooms,
            items=tuple(self.items),
            materials=self.library.materials,
            textures=self.library.textures,
            openings=(*self.openings, *openings),
            notes=self.notes.all(),
        )

    def _check_limits(self) -> None:
        n_faces = sum(item.n_faces for item in self.items)
        if len(self.items) > MAX_INSTANCES or n_faces > self.fields.max_triangles:
            text = f"more than {self.fields.max_triangles} triangles or {MAX_INSTANCES} items"
            raise BadHouse(self.file, "", text, hint="limit: read.max_triangles")
        for item in self.items:
            # Refuse numbers that are not finite, too: the comparison is false for them.
            if item.surfaces and not float(np.abs(item.bounds).max()) <= self.fields.max_extent_m:
                text = f"is farther than {self.fields.max_extent_m:g} m from the origin"
                raise BadHouse(self.file, item.id, text, hint="limit: read.max_extent_m")
