"""A run on this machine, no server: the steps of every house through a pool of processes.

Effects: the store's, and worker processes.
"""

from __future__ import annotations

import os
import shlex
from collections import Counter, deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final, TypeAlias

from pbrs_farm.core.errors import PbrsError
from pbrs_farm.core.recipe import Recipe
from pbrs_farm.core.shown_text import MAX_PLACE, shown
from pbrs_farm.crash_notes import note_step
from pbrs_farm.prepare.dress_catalogue import fetch_catalogue
from pbrs_farm.prepare.passes import uses_catalogue
from pbrs_farm.prepare.source import SourceRef, resolve, variants
from pbrs_farm.read.common.source_files import SourceFiles
from pbrs_farm.run import plan
from pbrs_farm.run.output_root import claim_root, finish_root
from pbrs_farm.run.processes.early_start import end_untaken
from pbrs_farm.run.processes.limits import ProcessLimits, is_room_for_two, memory_share_mb
from pbrs_farm.run.processes.pool import FINISH, RENDER, Pool
from pbrs_farm.run.processes.render_task import Event, RenderTask, Setting
from pbrs_farm.run.request import Wanted
from pbrs_farm.store import StoreSettings, store_from_url

# Which task of a local run is done next, by which process, and what follows from how it ended.
#     one process a house:   all steps of the house -> per view: all its steps
#     light apart (RENDER):  house -> cameras and, beside it, illuminance
#                            -> per view: light and, beside it, its labels -> what needs both
# Effects: gives tasks to a pool and tells an observer of its events.


_OF_LIGHT: Final = ("illuminance", "light")  # steps of the process that renders light
_AFTER_LIGHT: Final = ("develop", "view")  # steps of a view that wait for it

_Stage: TypeAlias = list[
    tuple[int, RenderTask]
]  # tasks that are done side by side, each with its lane


class _Unit:
    """A house, or a view, that is being made: its stages follow one another."""

    def __init__(self, stages: Sequence[_Stage]) -> None:
        self.stages = deque(stage for stage in stages if stage)
        self.n_open = 0  # tasks of the stage under way that have not ended

    def without(self, step: str) -> None:
        """Leave a step out of the stages that have not begun."""
        later = [[(lane, _without(task, step)) for lane, task in stage] for stage in self.stages]
        kept = ([(lane, task) for lane, task in stage if task.steps] for stage in later)
        self.stages = deque(stage for stage in kept if stage)


class Schedule:
    """Houses in order, each followed by its views.

    is_apart: one process renders light, another does the rest.
    """

    def __init__(
        self, run: Run, sources: list[SourceRef], summary: Summary,
        observe: Callable[[Event], None], *, is_apart: bool,
    ) -> None:  # fmt: skip
        self._run = run
        self._summary = summary
        self._observe = observe
        self._is_apart = is_apart
        self._sources = {s.house_id: s for s in sources}
        self._houses = deque(self._sources)  # ids of those that no task was made for
        self._waiting: dict[int, deque[RenderTask]] = {RENDER: deque(), FINISH: deque()}
        self._units: dict[tuple[str, str], _Unit] = {}  # (house, view or "") under way
        self._cameras: dict[str, dict[str, Any]] = {}  # house -> facts of its cameras step
        self._floor_lux: dict[str, dict[str, Any]] = {}  # house -> room -> lx by group
        self._unlit: set[str] = set()  # houses whose illuminance failed: no light in their views
        while self._houses and not is_apart:
            self._begin_house(self._houses.popleft(), RENDER)

    def drive(self, pool: Pool) -> None:
        """Until nothing waits and nobody works."""
        while self._houses or any(self._waiting.values()) or pool.n_busy:
            for lane in self._waiting:
                for held in pool.idle_houses(lane):
                    task = self._next(lane, held, pool)
                    if task is not None:
                        pool.give(task, lane)
            for event in pool.events():
                self._take(event)

    def _next(self, lane: int, held_house: str, pool: Pool) -> RenderTask | None:
        """What an idle process of the lane does: a task that waits, else the next house."""
        waiting = self._waiting[lane]
        if not waiting and self._houses and self._may_begin(lane, pool):
            self._begin_house(self._houses.popleft(), lane)
        if not waiting:
            return None
        busy = pool.busy_houses()

        def rank(task: RenderTask) -> int:
            # Of the house already in memory, else of one nobody works on, else any.
            return 0 if task.house_id == held_house else 1 + (task.house_id in busy)

        task = min(waiting, key=rank)
        waiting.remove(task)
        return task

    def _may_begin(self, lane: int, pool: Pool) -> bool:
        """Whether an idle process of the lane makes the next house."""
        # One house at a time; the process of light makes it while the other one finishes views.
        if any(not view for _house, view in self._units):
            return False
        is_finishing = bool(self._units) or not pool.idle_houses(FINISH)
        return is_finishing == (lane == RENDER)

    def _begin_house(self, house: str, lane: int) -> None:
        steps = plan.house_steps(self._run.want, house)
        task = RenderTask(house, steps, self._sources[house])
        if not self._is_apart:
            self._begin(task, [[(lane, task)]])
            return
        first, rest = steps[:1], steps[1:]
        beside = tuple(s for s in rest if s in _OF_LIGHT)
        others = tuple(s for s in rest if s not in beside)
        stages = [[(lane, replace(task, steps=first))], _side_by_side(task, others, beside)]
        self._begin(task, stages)

    def _begin(self, task: RenderTask, stages: Sequence[_Stage]) -> None:
        unit = self._units[task.house_id, task.view_id or ""] = _Unit(stages)
        self._begin_stage(unit)

    def _begin_stage(self, unit: _Unit) -> None:
        stage = unit.stages.popleft()
        unit.n_open = len(stage)
        # What completes a view goes before the labels of those whose light is still rendered.
        for lane, task in stage:
            if task.steps[0] in _AFTER_LIGHT:
                self._waiting[lane].appendleft(task)
            else:
                self._waiting[lane].append(task)

    def _take(self, event: Event) -> None:
        summary = self._summary
        summary.peak_mb = max(summary.peak_mb, event.peak_mb)
        key = (event.house_id, event.view_id or "")
        if event.kind in ("done", "kept"):
            self._take_done(event)
        elif event.kind == "failed":
            what = "/".join(x for x in (event.house_id, event.view_id, event.step) if x)
            summary.failures.append((what, event.message, self._command(event)))
            if event.step == "illuminance":
                self._unlit.add(event.house_id)
            self._leave_out(self._units[key], event.step)
        elif event.kind == "end":
            # A house or a view ends once, with the last of its tasks.
            unit = self._units[key]
            unit.n_open -= 1
            if unit.n_open == 0 and unit.stages:
                self._begin_stage(unit)
            if unit.n_open:
                return
            del self._units[key]
            if event.view_id is None and event.house_id in self._cameras:
                self._add_views(event.house_id, self._cameras.pop(event.house_id))
        self._observe(event)

    def _leave_out(self, unit: _Unit, failed: str) -> None:
        """Leave out of later stages what reads the files of a step that failed."""
        for step in plan.STEPS.values():
            if failed in step.after and step.name != "view":
                unit.without(step.name)
                self._leave_out(unit, step.name)

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
        steps = plan.view_steps(want.model_copy(update={"modes": modes}))
        # They go before the next houses.
        waiting = self._waiting[RENDER]
        n_before = len(waiting)
        for view in views:
            task = RenderTask(house, steps, source, view, want.layers)
            self._begin(task, self._stages_of_view(task))
        waiting.rotate(len(waiting) - n_before)

    def _stages_of_view(self, task: RenderTask) -> list[_Stage]:
        if not self._is_apart or "light" not in task.steps:
            return [[(FINISH if self._is_apart else RENDER, task)]]
        last = tuple(s for s in task.steps if s in _AFTER_LIGHT)
        labels = tuple(s for s in task.steps if s not in (*_OF_LIGHT, *last))
        lit = _side_by_side(task, labels, ("light",))
        return [lit, [(FINISH, replace(task, steps=last))]]

    def _command(self, event: Event) -> str:
        source = self._sources[event.house_id]
        words = ["pbrs-farm", "step", event.step, source.word, "--out", self._run.store_url]
        if source.models:
            words += ["--models", source.models]
        if source.dress_seed:
            words += ["--dress", str(source.dress_seed)]
        if event.view_id:
            words += ["--view", event.view_id]
        return shlex.join(words)


def _side_by_side(task: RenderTask, rest: tuple[str, ...], of_light: tuple[str, ...]) -> _Stage:
    parts = ((RENDER, replace(task, steps=of_light)), (FINISH, replace(task, steps=rest)))
    return [(lane, part) for lane, part in parts if part.steps]


def _without(task: RenderTask, step: str) -> RenderTask:
    return replace(task, steps=tuple(s for s in task.steps if s != step))


# A run on this machine, no server.


Observer = Callable[[Event], None]


@dataclass(frozen=True, slots=True)
class Run:
    """What is asked of a local run."""

    homes: Sequence[str]  # words as prepare.source.resolve takes them
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
    models: str = ""  # folder of the models that the homes' files name


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
        finish_root(store, summary.houses)
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


def _resolved(run: Run, summary: Summary) -> list[SourceRef]:
    # Take each home once, whatever words name it; one that is none costs itself alone.
    seeds = run.dress_seeds or (run.recipe.dress.seed,)
    sources = {s.house_id: s for given in run.sources for s in variants(given, seeds)}
    files = SourceFiles()
    for word in run.homes:
        note_step(word, "read")
        try:
            source = resolve(word, files, models=run.models)
        except PbrsError as error:
            summary.failures.append((shown(word, MAX_PLACE), str(error), ""))
            continue
        for variant in variants(source, seeds):
            sources.setdefault(variant.house_id, variant)
    return list(sources.values())
