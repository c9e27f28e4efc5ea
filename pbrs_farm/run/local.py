"""A run on this machine, no server: the steps of every house through a pool of processes.

Effects: the store's, and worker processes.
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from pbrs_farm.core import keys
from pbrs_farm.core.errors import PbrsError
from pbrs_farm.core.recipe import Recipe
from pbrs_farm.core.shown_text import MAX_PLACE, shown
from pbrs_farm.read.common.source_files import SourceFiles
from pbrs_farm.read.source import SourceRef, resolve, variants
from pbrs_farm.run import plan
from pbrs_farm.run.attributions import write_attribution
from pbrs_farm.run.dressed_house import fetch_catalogue, uses_catalogue
from pbrs_farm.run.output_root import claim_root, finish_house, merge_manifests
from pbrs_farm.run.plan import Wanted
from pbrs_farm.run.processes.early_start import end_untaken
from pbrs_farm.run.processes.limits import ProcessLimits, is_room_for_two, memory_share_mb
from pbrs_farm.run.processes.pool import Pool
from pbrs_farm.run.processes.render_task import Event, Setting
from pbrs_farm.run.processes.verb_process import doing
from pbrs_farm.run.schedule import Schedule
from pbrs_farm.store import StoreSettings, store_from_url
from pbrs_farm.store.object_store import Store

Observer = Callable[[Event], None]


@dataclass(frozen=True, slots=True)
class Run:
    """What is asked of a local run."""

    homes: Sequence[str]  # words as read.source.resolve takes them
    store_url: str
    recipe: Recipe
    want: Wanted = field(default_factory=Wanted)
    n_jobs: int = 1  # render processes
    update: bool = False  # replace the root's recipe where it is another
    step_timeout_s: float = 3600.0  # a process whose step takes longer is killed
    silence_s: float = 0.0  # and one without a step begun or a line in its log; 0 = step_timeout_s
    memory_mb: float = 0.0  # and one that holds more; 0 = its share of the machine
    debug: bool = False  # tracebacks travel with failures
    store: StoreSettings = field(default_factory=StoreSettings)
    sources: Sequence[SourceRef] = ()  # homes that are resolved already
    dress_seeds: Sequence[int] = ()  # each home dressed by each of them; none = by the recipe's
    refused: Sequence[tuple[str, str]] = ()  # what was asked for and cannot be read, and why


@dataclass(slots=True)
class Summary:
    """What came of a run."""

    houses: list[str] = field(default_factory=list)
    n_views: int = 0
    n_done: int = 0  # steps
    n_kept: int = 0  # steps that were done already
    peak_mb: float = 0.0  # of the largest process
    failures: list[tuple[str, str, str]] = field(default_factory=list)  # what, message, command
    without_views: list[tuple[str, str]] = field(default_factory=list)  # house, why it has none
    left_out: list[tuple[str, str]] = field(default_factory=list)  # house, which views and why
    leaks: list[tuple[str, str]] = field(default_factory=list)  # house, rays that reached the sky
    walls_lost: list[tuple[str, str]] = field(default_factory=list)  # house, walls repair lost
    notes: Counter[str] = field(default_factory=Counter)  # of the houses, by kind
    dark: list[tuple[str, str]] = field(default_factory=list)  # house/view, how dark it is


def run_local(run: Run, observe: Observer = lambda _event: None) -> Summary:
    """Do everything that is not done yet; a fault costs its step and the run goes on.

    Raises BadRecipe when the root holds another recipe, StoreFailed when it cannot be written.
    """
    store = store_from_url(run.store_url, run.store)
    summary = Summary()
    summary.failures += [(shown(what, MAX_PLACE), text, "") for what, text in run.refused]
    with _pool(run) as pool:
        # Let the processes load their libraries while the homes are looked for, and no others beside.
        pool.start()
        end_untaken()
        sources = _resolved(run, summary)
        if not sources:
            return summary
        if any(uses_catalogue(source, run.recipe) for source in sources):
            fetch_catalogue(run.recipe.dress)
        claim_root(store, run.recipe, update=run.update)
        Schedule(run, sources, summary, observe, is_apart=finishes_apart(run)).drive(pool)
        pool.release()
        _finish_root(store, summary.houses)
    return summary


def _pool(run: Run) -> Pool:
    """The run's processes: n_jobs of them, or one for light and one for all else."""
    # Share the cores among the processes, or each would take them all.
    n_jobs = max(1, run.n_jobs)
    n_threads = max(1, (os.cpu_count() or 1) // n_jobs)
    setting = Setting(run.store_url, run.recipe, n_threads, run.debug, run.store)
    lanes = (n_jobs, int(finishes_apart(run)))
    limits = ProcessLimits(
        step_s=run.step_timeout_s,
        silence_s=run.silence_s or run.step_timeout_s,
        memory_mb=run.memory_mb or memory_share_mb(sum(lanes)),
    )
    return Pool(lanes, setting, limits)


def finishes_apart(run: Run) -> bool:
    """Whether a second process makes houses and finishes views while the first renders light.

    One render process leaves cores idle while it reads, labels, draws and develops.
    """
    return run.n_jobs <= 1 and is_room_for_two() and "light" in plan.view_steps(run.want)


def _finish_root(store: Store, houses: Sequence[str]) -> None:
    for house_id in houses:
        finish_house(store, house_id)
    # The root's manifest covers every house of the folder, those of former runs too.
    below = [keys.parse_house_key(key) for top in keys.FOLDERS for key in store.list(f"{top}/")]
    merge_manifests(store, [at.house for at in below if at and at.file == keys.MANIFEST])
    write_attribution(store)


def _resolved(run: Run, summary: Summary) -> list[SourceRef]:
    # Take each home once, whatever words name it; one that is none costs itself alone.
    seeds = run.dress_seeds or (run.recipe.dress.seed,)
    sources = {s.house_id: s for given in run.sources for s in variants(given, seeds)}
    files = SourceFiles()
    for word in run.homes:
        doing(word, "read")
        try:
            source = resolve(word, files)
        except PbrsError as error:
            summary.failures.append((shown(word, MAX_PLACE), str(error), ""))
            continue
        for variant in variants(source, seeds):
            sources.setdefault(variant.house_id, variant)
    return list(sources.values())
