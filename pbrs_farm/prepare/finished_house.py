"""Finish the house of a source by the passes of prepare/passes.py, in their order; nothing is written."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from pbrs_farm.core.house import House
from pbrs_farm.core.recipe import Recipe
from pbrs_farm.crash_notes import note_step
from pbrs_farm.prepare.passes import PASSES, FinishedHouse, Pass, Preparation, cache_key
from pbrs_farm.prepare.source_ref import SourceRef

if TYPE_CHECKING:
    from pbrs_farm.repair import RepairReport


class HouseBeforeEdits:
    """The process's last finished house before its edits, which many edited homes share."""

    def __init__(self) -> None:
        self._key = ""
        self._finished: FinishedHouse | None = None

    def get(self, source: SourceRef, recipe: Recipe) -> FinishedHouse | None:
        """The cached house of a source without edits (`SourceRef.unedited`); None for others."""
        return self._finished if self._key == cache_key(source, recipe) else None

    def keep(self, source: SourceRef, recipe: Recipe, finished: FinishedHouse) -> None:
        """Cache the finished house of a source without edits, and drop the previous one."""
        self._key, self._finished = cache_key(source, recipe), finished

    def clear(self) -> None:
        """Drop the cached house."""
        self._key, self._finished = "", None


def _ignore_share(_share: float) -> None:
    """Ignore the progress of dressing."""


def finished_house(
    source: SourceRef,
    recipe: Recipe,
    tell_share: Callable[[float], None] = _ignore_share,
    before_edits: HouseBeforeEdits | None = None,
) -> FinishedHouse:
    """Read, furnish, dress, repair and edit the house of a source, as the recipe says.

    Equal arguments give equal bits. tell_share: called with the finished share of dressing and repair.
    before_edits: cache for the house without its edits. Raises BadHouse if the file is not a house or
    has changed, BadInput, BadRecipe, MachineFailed.

        >>> house, report, dressing = finished_house(resolve("builtin"), Recipe())
        >>> dressing is None
        True
    """
    cache = before_edits or HouseBeforeEdits()

    def finish(other: SourceRef, fields: Recipe) -> FinishedHouse:
        return finished_house(other, fields, before_edits=cache)

    work = Preparation(source, recipe, tell_share, finish)
    passes = [p for p in PASSES if p.is_needed(source, recipe)]
    if not source.edits:
        return _through(passes, work)
    # Apply the edits to the house before its edits.
    bare = source.unedited
    before = cache.get(bare, recipe)
    if before is None:
        before = finished_house(bare, recipe, tell_share, cache)
        cache.keep(bare, recipe, before)
    work = replace(work, current=before.house, report=before.report, dressing=before.dressing)
    return _through([p for p in passes if not p.is_needed(bare, recipe)], work)


def _through(passes: Sequence[Pass], work: Preparation) -> FinishedHouse:
    for house_pass in passes:
        note_step(work.source.location, house_pass.name)
        work = house_pass.run(work)
    return work.finished


def repaired_house(source: SourceRef, recipe: Recipe) -> tuple[House, RepairReport]:
    """As finished_house, without the report of dressing."""
    house, report, _dressing = finished_house(source, recipe)
    return house, report
