"""Scheduler of a local run: the next task of each process, and the consequences of its end.

    one process a house:   all steps of the house -> per view: all its steps
    light apart (RENDER):  house -> cameras and, beside it, illuminance
                           -> per view: light and, beside it, its labels -> steps that need both

Effects: gives tasks to a pool and reports events to an observer.
"""

from __future__ import annotations

import shlex
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, Final, TypeAlias

from pbrs_farm.prepare.source_ref import SourceRef
from pbrs_farm.run import plan
from pbrs_farm.run.local_run import Run, Summary
from pbrs_farm.run.processes.pool import FINISH, RENDER, Pool
from pbrs_farm.run.processes.render_task import Event, RenderTask

_OF_LIGHT: Final = ("illuminance", "light")  # steps of the process that renders light
_AFTER_LIGHT: Final = ("develop", "view")  # steps of a view that wait for it

_Stage: TypeAlias = list[tuple[int, RenderTask]]  # parallel tasks, each with its lane


class _Unit:
    """A house or view in progress, with its remaining stages."""

    def __init__(self, stages: Sequence[_Stage]) -> None:
        self.stages = deque(stage for stage in stages if stage)
        self.n_open = 0  # tasks of the stage under way that have not ended

    def without(self, step: str) -> None:
        """Leave a step out of the stages that have not begun."""
        later = [[(lane, _without(task, step)) for lane, task in stage] for stage in self.stages]
        stages = ([(lane, task) for lane, task in stage if task.steps] for stage in later)
        self.stages = deque(stage for stage in stages if stage)


class Schedule:
    """Houses in order, each followed by its views; is_apart: one process renders light, another the rest."""

    def __init__(
        self,
        run: Run,
        sources: list[SourceRef],
        summary: Summary,
        observe: Callable[[Event], None],
        *,
        is_apart: bool,
    ) -> None:
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
        """Run until no task waits or runs, idle processes first, then events; also when all failed."""
        while self._houses or any(self._waiting.values()) or pool.n_busy:
            for lane in self._waiting:
                for house in pool.idle_houses(lane):
                    task = self._next(lane, house, pool)
                    if task is not None:
                        pool.give(task, lane)
            for event in pool.events():
                self._take(event)

    def _next(self, lane: int, held_house: str, pool: Pool) -> RenderTask | None:
        """Next task of an idle process of the lane: a waiting task, else the next house."""
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
        after = tuple(s for s in rest if s not in beside)
        stages = [[(lane, replace(task, steps=first))], _side_by_side(task, after, beside)]
        self._begin(task, stages)

    def _begin(self, task: RenderTask, stages: Sequence[_Stage]) -> None:
        unit = self._units[task.house_id, task.view_id or ""] = _Unit(stages)
        self._begin_stage(unit)

    def _begin_stage(self, unit: _Unit) -> None:
        stage = unit.stages.popleft()
        unit.n_open = len(stage)
        # Tasks that complete a view come before the labels of views whose light is being rendered.
        for lane, task in stage:
            if task.steps[0] in _AFTER_LIGHT:
                self._waiting[lane].appendleft(task)
            else:
                self._waiting[lane].append(task)

    def _take(self, event: Event) -> None:
        summary = self._summary
        summary.peak_mb = max(summary.peak_mb, event.peak_mb)
        key = (event.house_id, event.view_id or "")
        # A missing capability is an error if nothing else was requested.
        if event.kind == "lacking" and not plan.has_light(self._run.want):
            event = replace(event, kind="failed")
        if event.kind in ("done", "kept"):
            self._take_done(event)
        elif event.kind == "lacking":
            summary.lacking[event.step] = event.message
        elif event.kind == "failed":
            place = "/".join(x for x in (event.house_id, event.view_id, event.step) if x)
            summary.failures.append((place, event.message, self._command(event)))
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
        summary.taken_out.update(facts.get("taken_out", {}))
        if "leaks" in facts:
            n_sky, n_rays = facts["leaks"]
            line = f"{n_sky} of {n_rays} rays from closed rooms reached the sky"
            summary.leaks.append((event.house_id, line))
        summary.walls_lost += [(event.house_id, line) for line in facts.get("walls_lost", ())]

    def _add_views(self, house: str, facts: dict[str, Any]) -> None:
        want, source = self._run.want, self._sources[house]
        rows = [(str(v), str(room), float(score)) for v, room, score in facts["views"]]
        # Skip rooms measured as dark, if the recipe chooses the views.
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
        # Steps that need illuminance would fail again for the reported reason.
        modes = tuple(m for m in want.modes if not (m.groups and house in self._unlit))
        steps = plan.view_steps(want.model_copy(update={"modes": modes}))
        # They go before the next houses.
        waiting = self._waiting[RENDER]
        n_before = len(waiting)
        for view in views:
            task = RenderTask(house, steps, source, view, want.layers, want.drop_radiance)
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
