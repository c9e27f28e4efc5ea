"""The house of a source, by its format or its kind of home. Reads files and packages, maybe through apt."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.house import House
from pbrs_farm.core.recipe import ReadFields
from pbrs_farm.prepare.formats import format_of_source
from pbrs_farm.prepare.home_kinds import HOME_KIND
from pbrs_farm.prepare.source import check_unchanged
from pbrs_farm.prepare.source_ref import SourceRef, home_id
from pbrs_farm.read.common.notes import Notes
from pbrs_farm.regular_files import naming_kind

_FAR_M: Final = 100.0  # metres from every room: probably a wrong unit


def read_house(source: SourceRef, fields: ReadFields, licences: tuple[str, ...] = ()) -> House:
    """The house as its source gives it, unrepaired, with notes on items far from every room.

    licences: of the library furniture of a generated home; () for any.

    Raises BadHouse with the place, also if a file of the source has changed since it was named;
    BadInput for a plan, naming the room or opening; MachineFailed if a package or a plugin is not
    the one that the source was named with. Not for homes of plugins, which are finished.
    """
    check_unchanged(source)
    return _with_far_noted(_house_of(source, fields, licences), fields)


def _house_of(source: SourceRef, fields: ReadFields, licences: tuple[str, ...]) -> House:
    kind = HOME_KIND.get(source.kind)
    if kind is not None and kind.read is not None:
        return kind.read(source, fields, licences)
    entry = format_of_source(source)
    if entry is None:
        raise BadHouse(source.location, "", f"unsupported kind: {source.kind}")
    # The source alone names its house, whatever the reader calls it.
    with naming_kind(source.given.path):
        return replace(entry.read(source.given, fields), id=home_id(source))


def _with_far_noted(house: House, fields: ReadFields) -> House:
    """Add a note for each item far from every room."""
    if not house.rooms:
        return house
    notes = Notes(house.source.file, strict=fields.strict)
    # Measure from the rectangle around all rooms.
    plans = np.concatenate([room.polygon for room in house.rooms])
    low, high = plans.min(0), plans.max(0)
    for item in house.items:
        bounds = item.bounds[:, [0, 2]]
        away = float(np.maximum(bounds[0] - high, low - bounds[1]).max())
        if away > _FAR_M:
            notes.add("far-away", item.id, f"{item.name!r} is {away:.0f} m from the rooms")
    return replace(house, notes=(*house.notes, *notes.all())) if notes.all() else house
