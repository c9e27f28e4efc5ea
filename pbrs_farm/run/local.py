"""A run on this machine, no server: the steps of every house through a pool of processes.

Effects: the store's, and worker processes.
"""

from __future__ import annotations

import os
import shlex
from collections import Counter, deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from pbrs_farm.core import keys
from pbrs_farm.core.errors import PbrsError
from pbrs_farm.core.recipe import Recipe
from pbrs_farm.core.shown_text import MAX_PLACE, shown
from pbrs_farm.read.common.companion_files import SourceFiles
from pbrs_farm.read.source import SourceRef, resolve, variants
from pbrs_farm.run import plan
from pbrs_farm.run.attributions import write_attribution
from pbrs_farm.run.dressed_house import fetch_catalogue, uses_catalogue
from pbrs_farm.run.output_root import claim_root, finish_house, merge_manifests
from pbrs_farm.run.plan import Wanted
from pbrs_farm.run.processes.limits import ProcessLimits, machine_mb, memory_share_mb
from pbrs_farm.run.processes.pool import FINISH, RENDER, Pool
from pbrs_farm.run.processes.render_task import Event, Setting, Task
from pbrs_farm.run.processes.verb_process import doing
from pbrs_farm.store import StoreSettings, store_from_url
from pbrs_farm.store.object_store import Store

_APART_MB = 6000.0  # memory of a machine on which two processes may share a view's steps

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
        # Let the processes load their libraries while the homes are looked for.
        pool.start()
        sources = _resolved(run, summary)
        if not sources:
            return summary
        if any(uses_catalogue(source, run.recipe) for source in sources):
            fetch_catalogue(run.recipe.dress)
        claim_root(store, run.recipe, update=run.update)
        _Schedule(run, sources, summary, observe).drive(pool)
        pool.release()
        _finish_root(store, summary.houses)
    return summary


def _pool(run: Run) -> Pool:
    """The run's processes: n_jobs of them, or one for light and one for all else of its views."""
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
    """Whether a second process finishes a view while the first renders the light of the next.

    One render process leaves cores idle while it labels, draws and develops.
    """
    is_room_for_two = (os.cpu_count() or 1) > 1 and machine_mb() > _APART_MB
    return run.n_jobs <= 1 and is_room_for_two and "light" in plan.view_steps(run.want)


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


class _Schedule:
    """Which task next: houses in order, each followed by its views.

    Where views are finished apart, each is two tasks: its light, then what is left of it.
    """

    def __init__(
        self, run: Run, sources: list[SourceRef], summary: Summary, observe: Observer
    ) -> None:
        self._run = run
        self._summary = summary
        self._observe = observe
        self._sources = {s.house_id: s for s in sources}
        houses = (Task(s.house_id, plan.house_steps(run.want, s.house_id), s) for s in sources)
        self._waiting: dict[int, deque[Task]] = {RENDER: deque(houses), FINISH: deque()}
        self._is_apart = finishes_apart(run)
        self._unfinished: dict[
            tuple[str, str], Task
        ] = {}  # (house, view) -> what follows its light
        self._cameras: dict[str, dict[str, Any]] = {}  # house -> facts of its cameras step
        self._floor_lux: dict[str, dict[str, Any]] = {}  # house -> room -> lx by group
        self._unlit: set[str] = set()  # houses whose illuminance failed: no light in their views

    def drive(self, pool: Pool) -> None:
        """Until nothing waits and nobody works."""
        while any(self._waiting.values()) or pool.n_busy:
            for lane, waiting in self._waiting.items():
                for held in pool.idle_houses(lane):
                    if waiting:
                        pool.give(_next(waiting, held, pool.busy_houses()), lane)
            for event in pool.events():
                self._take(event)

    def _take(self, event: Event) -> None:
        summary = self._summary
        summary.peak_mb = max(summary.peak_mb, event.peak_mb)
        # Once its light has ended the rest of a view can be done; only then does the view end.
        light = (event.house_id, event.view_id or "")
        if event.kind == "end" and light in self._unfinished:
            self._waiting[FINISH].append(self._unfinished.pop(light))
            return
        if event.kind in ("done", "kept"):
            self._take_done(event)
        elif event.kind == "failed":
            what = "/".join(x for x in (event.house_id, event.view_id, event.step) if x)
            summary.failures.append((what, event.message, self._command(event)))
            if event.step == "illuminance":
                self._unlit.add(event.house_id)
            if event.step == "light" and light in self._unfinished:
                self._unfinished[light] = _without(self._unfinished[light], "develop")
        elif event.view_id is None and event.kind == "end" and event.house_id in self._cameras:
            self._add_views(event.house_id, self._cameras.pop(event.house_id))
        self._observe(event)

    def _take_done(self, event: Event) -> None:
        summary, facts = self._summary, event.facts
        summary.n_done += event.kind == "done"
        summary.n_kept += event.kind == "kept"
        if event.step == "house":
            self._take_house(event)
        if event.step == "cameras":
            self._cameras[event.house_id] = facts
        if event.step == "illuminance":
            self._floor_lux[event.house_id] = facts.get("floor_lux", {})
        if "dark" in facts:
            summary.dark.append((f"{event.house_id}/{event.view_id}", "; ".join(facts["dark"])))

    def _take_house(self, event: Event) -> None:
        summary, facts = self._summary, event.facts
        summary.houses.append(event.house_id)
        summary.notes.update(facts.get("note_kinds", {}))
        if "leaks" in facts:
            n_sky, n_rays = facts["leaks"]
            line = f"{n_sky} of {n_rays} rays from closed rooms reached the sky"
            summary.leaks.append((event.house_id, line))
        summary.walls_lost += [(event.house_id, line) for line in facts.get("walls_lost", ())]

    def _add_views(self, house: str, facts: dict[str, Any]) -> None:
        want, source = self._run.want, self._sources[house]
        rows = [(str(v), str(room), float(score)) for v, room, score in facts["views"]]
        # Leave out rooms that were measured dark, where the recipe chooses the views.
        reason, lux = str(facts.get("why_none", "")), self._floor_lux.pop(house, {})
        if plan.leaves_out_dark_rooms(self._run.recipe, want, house):
            rows, lines = plan.lit_views(rows, lux, self._run.recipe.selection.min_room_lx)
            self._summary.left_out += [(house, line) for line in lines]
            reason = reason or "; ".join(lines)
        views = plan.chosen_views(rows, want.n_views, self._run.recipe)
        self._summary.n_views += len(views)
        self._observe(Event("planned", house, None, "view", facts={"views": views}))
        if not views:
            self._summary.without_views.append((house, reason))
        # What needs illuminance would fail for the reason that illuminance has told already.
        modes = tuple(m for m in want.modes if not (m.groups and house in self._unlit))
        steps = plan.view_steps(replace(want, modes=modes))
        tasks = [Task(house, steps, source, view, want.layers) for view in views]
        if self._is_apart and "light" in steps:
            self._unfinished |= {(house, t.view_id or ""): _without(t, "light") for t in tasks}
            tasks = [replace(task, steps=("light",)) for task in tasks]
        self._waiting[RENDER].extendleft(reversed(tasks))

    def _command(self, event: Event) -> str:
        source = self._sources[event.house_id]
        words = ["pbrs-farm", "step", event.step, source.location, "--out", self._run.store_url]
        if source.dress_seed:
            words += ["--dress", str(source.dress_seed)]
        if event.view_id:
            words += ["--view", event.view_id]
        return shlex.join(words)


def _next(waiting: deque[Task], held_house: str, busy: set[str]) -> Task:
    """A waiting task: of the house already in memory, else of one nobody works on, else any."""

    def rank(task: Task) -> int:
        return 0 if task.house_id == held_house else 1 + (task.house_id in busy)

    task = min(waiting, key=rank)
    waiting.remove(task)
    return task


def _without(task: Task, step: str) -> Task:
    return replace(task, steps=tuple(s for s in task.steps if s != step))
