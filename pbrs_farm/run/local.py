"""A run on this machine, no server: the steps of every house through a pool of processes."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Final

from pbrs_farm.core.errors import PbrsError
from pbrs_farm.core.shown_text import MAX_PLACE, shown
from pbrs_farm.crash_notes import note_step
from pbrs_farm.prepare.dress_catalogue import fetch_catalogue
from pbrs_farm.prepare.passes import uses_catalogue
from pbrs_farm.prepare.source import resolve, variants
from pbrs_farm.prepare.source_ref import SourceRef
from pbrs_farm.read.common.source_files import SourceFiles
from pbrs_farm.regular_files import real_path
from pbrs_farm.run import plan
from pbrs_farm.run.local_run import Observer, Run, Summary
from pbrs_farm.run.output_root import claim_root, finish_root
from pbrs_farm.run.processes.early_start import end_untaken
from pbrs_farm.run.processes.limits import ProcessLimits, is_room_for_two, memory_share_mb
from pbrs_farm.run.processes.pool import Pool
from pbrs_farm.run.processes.render_task import Setting
from pbrs_farm.run.schedule import Schedule
from pbrs_farm.store import store_from_url

_FEW_SAMPLES: Final = 1 << 18  # of a view's light


def run_local(run: Run, observe: Observer = lambda _event: None) -> Summary:
    """Do everything that is not done yet; a fault costs its step. BadRecipe for another recipe, StoreFailed."""
    store = store_from_url(run.store_url, run.store)
    summary = Summary()
    summary.failures += [(shown(word, MAX_PLACE), text, "") for word, text in run.refused]
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
        finish_root(store, summary.houses)
    return summary


def _pool(run: Run) -> Pool:
    """The run's processes: n_jobs of them, or one for light and one for all else."""
    n_jobs = max(1, run.n_jobs)
    setting = Setting(run.store_url, run.recipe, threads_of_process(run), run.debug, run.store)
    lanes = (n_jobs, int(finishes_apart(run)))
    limits = ProcessLimits(
        step_s=run.step_timeout_s,
        silence_s=run.silence_s or run.step_timeout_s,
        memory_mb=run.memory_mb or memory_share_mb(sum(lanes)),
    )
    return Pool(lanes, setting, limits)


def threads_of_process(run: Run) -> int:
    """Threads of each process: its share of the cores. With two processes both take all cores, or one less for small views."""
    n_cores, image = os.cpu_count() or 1, run.recipe.image
    if finishes_apart(run):
        # Idle threads spin: for small views that is a seventh of the light's CPU, while the other
        # process could use the core.
        n_samples = image.width_px * image.height_px * run.recipe.light.spp
        return n_cores - 1 if n_samples <= _FEW_SAMPLES else n_cores
    return max(1, n_cores // max(1, run.n_jobs))


def finishes_apart(run: Run) -> bool:
    """True if a second process makes houses and finishes views while the first renders light."""
    return run.n_jobs <= 1 and is_room_for_two() and "light" in plan.view_steps(run.want)


def _resolved(run: Run, summary: Summary) -> list[SourceRef]:
    # Take each home once, even if several words name it; an unreadable home fails alone.
    seeds = run.dress_seeds or (run.recipe.dress.seed,)
    sources = {s.house_id: s for run_source in run.sources for s in variants(run_source, seeds)}
    files = SourceFiles()
    for word in run.homes:
        note_step(word, "read")
        try:
            source = resolve(word, files, models=run.models)
        except PbrsError as error:
            text = str(error).removeprefix(f"{real_path(Path(word))}: ")
            summary.failures.append((shown(word, MAX_PLACE), text, ""))
            continue
        for variant in variants(source, seeds):
            sources.setdefault(variant.house_id, variant)
    return list(sources.values())
