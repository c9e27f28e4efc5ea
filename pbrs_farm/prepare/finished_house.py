"""A source becomes a finished House: read, furnished, dressed, repaired, edited.

Effects: reads the files of the source, the cached packages and the user's libraries. Keeps the last
house before its edits. Writes nothing.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, TypeAlias

from pbrs_farm.core import keys
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.house import House, geometry_from_house
from pbrs_farm.core.plugins import plugin_homes
from pbrs_farm.core.recipe import Recipe, with_settings
from pbrs_farm.crash_notes import note_step
from pbrs_farm.prepare.dress_catalogue import house_of_source
from pbrs_farm.prepare.dressed_house import dressed_and_repaired, furnished, with_told_furnished
from pbrs_farm.read.source import SourceRef, check_unchanged

if TYPE_CHECKING:
    from pbrs_farm.dress.report import DressReport
    from pbrs_farm.repair import RepairReport


def _ignore_share(_share: float) -> None:
    """Nobody hears how far dressing is."""


def repaired_house(source: SourceRef, recipe: Recipe) -> tuple[House, RepairReport]:
    """The house of a source, read, dressed where asked for, and repaired. Raises BadHouse."""
    house, report, _dressing = finished_house(source, recipe)
    return house, report


def finished_house(
    source: SourceRef, recipe: Recipe, tell: Callable[[float], None] = _ignore_share
) -> FinishedHouse:
    """As repaired_house, with what dressing did; None where the source is not dressed.

    tell: called with the share that is done while it is dressed.
    """
    from pbrs_farm.raycast.caster import Caster
    from pbrs_farm.repair import RepairReport, repair

    if source.edits:
        from pbrs_farm.prepare.apply_edits import edited

        key = _made_with(source.unedited, recipe)
        if _BEFORE_EDITS[0] != key:
            remember_house(source.unedited, recipe, finished_house(source.unedited, recipe))
        house, report, dressing = _BEFORE_EDITS[1]
        return edited(house, source, recipe.read), report, dressing

    if source.kind == "plugin":
        return _house_of_plugin(source, recipe)
    # An object without context has no walls to close.
    note_step(source.location, "read")
    house = house_of_source(source, recipe.read)
    if source.kind == "object":
        return house, RepairReport(house_id=house.id, was_repaired=True), None

    def occluder_from(some: House) -> Caster:
        return Caster(geometry_from_house(some))

    house = with_told_furnished(house, source, recipe)
    house = furnished(house, source, recipe)
    repaired = partial(repair, fields=recipe.repair, occluder_from=occluder_from)
    house, report, dressing = dressed_and_repaired(house, source, recipe, repaired, tell)
    return _before_windows(house, recipe), report, dressing


def _before_windows(house: House, recipe: Recipe) -> House:
    """The repaired house with what lies before its windows, where the recipe asks for it."""
    if recipe.surroundings.kind == "none":
        return house
    from pbrs_farm.dress.surroundings import with_surroundings

    return with_surroundings(house, recipe.surroundings.kind, recipe.seed)


def _house_of_plugin(source: SourceRef, recipe: Recipe) -> FinishedHouse:
    """The finished house of the Home that a plugin gives for a seed, under the source's own id."""
    note_step(source.location, "plugin")
    if source.dress_seed:
        raise BadInput(source.location, "--dress", "a plugin dresses its homes itself")
    check_unchanged(source)
    (named,) = plugin_homes(source.location)
    home = named.make()
    groups = {path.partition(".")[0] for path, _value in home.settings}
    if others := groups - {"read", "dress", "repair"}:
        text = f"sets recipe fields of {', '.join(sorted(others))}, which belong to the run"
        raise BadInput(source.location, "", text, hint="fields of read, dress and repair alone")
    inner = with_settings(recipe, dict(home.settings))
    house, report, dressing = finished_house(home.source, inner)
    return replace(house, id=source.house_id), report, dressing


FinishedHouse: TypeAlias = "tuple[House, RepairReport, DressReport | None]"

# The last house before its edits: homes that differ in their edits alone are read once.
_BEFORE_EDITS: tuple[str, FinishedHouse] = ("", None)  # type: ignore[assignment]


def remember_house(source: SourceRef, recipe: Recipe, made: FinishedHouse) -> None:
    """Keep what finished_house gives of a source without edits for those with."""
    global _BEFORE_EDITS
    _BEFORE_EDITS = (_made_with(source, recipe), made)


def _made_with(source: SourceRef, recipe: Recipe) -> str:
    return keys.digest(source, recipe.digest("read", "dress", "repair", "surroundings"))
