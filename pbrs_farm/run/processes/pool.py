"""The render processes of a local run: one task each, restarted when they die, logs in a temporary folder."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from types import TracebackType
from typing import Final

from pbrs_farm.operating_system import wait_readable
from pbrs_farm.run.processes.early_start import FINISHING_HANDLER, child_of
from pbrs_farm.run.processes.limits import ProcessLimits
from pbrs_farm.run.processes.messages import Message
from pbrs_farm.run.processes.render_process import CHECK_EVERY_S, Ended, RenderProcess
from pbrs_farm.run.processes.render_task import Event, RenderTask, Setting, line_from_task

RENDER: Final = 0
"""The lane of processes that do any task, or render light where another does all else."""
FINISH: Final = 1
"""The lane of the process that makes houses and finishes views whose light another one renders."""
ALONE, LIGHT, FINISHING = "alone", "light", "finishing"
HANDLERS: Final = {
    ALONE: "pbrs_farm.run.run_task:make_handler",
    LIGHT: "pbrs_farm.run.run_task:make_light_handler",
    FINISHING: FINISHING_HANDLER,
}
"""Factories of the handlers for all steps, for light, and for the other steps."""


@dataclass(slots=True)
class _Worker:
    process: RenderProcess
    lane: int
    task: RenderTask | None = None
    step: str = ""  # the step being done
    held_house: str = ""  # the house it keeps in memory
    done: list[str] = field(default_factory=list)  # steps of the task that ended, well or not


class Pool:
    """So many render processes per lane (RENDER, FINISH); one that dies costs the step it was in."""

    def __init__(self, lanes: tuple[int, int], setting: Setting, limits: ProcessLimits) -> None:
        self._lanes = lanes
        self._setting = setting
        self._limits = limits
        self._folder = tempfile.TemporaryDirectory(prefix="pbrs-farm-")
        self._workers: list[_Worker] = []

    def __enter__(self) -> Pool:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        tb: TracebackType | None,
    ) -> None:
        self.release()  # all end side by side
        for worker in self._workers:
            worker.process.close()
        self._folder.cleanup()

    def release(self) -> None:
        """Let idle processes end, without waiting for it: no task follows."""
        for worker in self._workers:
            worker.process.release()

    def start(self) -> None:
        """Start the first process of each lane, so that it loads its libraries before it has a task."""
        for lane, n in enumerate(self._lanes):
            if n:
                self._added(lane).process.start()

    @property
    def n_busy(self) -> int:
        """Processes with a task."""
        return sum(w.task is not None for w in self._workers)

    def idle_houses(self, lane: int) -> list[str]:
        """The house of each idle process, "" for none: one entry per task that the lane can take now."""
        idle = [w.held_house for w in self._of(lane) if w.task is None]
        return idle + [""] * (self._lanes[lane] - len(self._of(lane)))

    def busy_houses(self) -> set[str]:
        """Houses being worked on."""
        return {w.task.house_id for w in self._workers if w.task is not None}

    def give(self, task: RenderTask, lane: int) -> None:
        """Hand a task to an idle process of the lane: one with its house, else without any, else any other."""
        idle = [w for w in self._of(lane) if w.task is None]
        idle.sort(key=lambda w: (w.held_house != task.house_id, w.held_house != ""))
        fits = bool(idle) and idle[0].held_house in (task.house_id, "")
        if not fits and len(self._of(lane)) < self._lanes[lane]:
            idle = [self._added(lane)]
        self._begin(idle[0], task)

    def _of(self, lane: int) -> list[_Worker]:
        return [w for w in self._workers if w.lane == lane]

    def _added(self, lane: int) -> _Worker:
        log = Path(self._folder.name) / f"process-{len(self._workers)}.log"
        is_apart = self._lanes[FINISH] > 0
        role = FINISHING if lane == FINISH else LIGHT if is_apart else ALONE
        start = partial(child_of, HANDLERS[role], log)
        self._workers.append(_Worker(RenderProcess(start, self._limits), lane))
        return self._workers[-1]

    def events(self) -> Iterator[Event]:
        """Wait up to a second for the next events, in order per process; a death is an event, too."""
        busy = [w for w in self._workers if w.task is not None]
        if busy:
            wait_readable([w.process for w in busy], CHECK_EVERY_S)
        for worker in busy:
            # Read until it has nothing more to say: its buffer wakes nobody.
            while worker.task is not None and (heard := worker.process.poll(0.0)) is not None:
                if isinstance(heard, Ended):
                    yield from self._ended(worker, worker.task, heard)
                else:
                    yield from _events_in(worker, worker.task, heard)

    def _begin(self, worker: _Worker, task: RenderTask) -> None:
        worker.task, worker.step, worker.done = task, task.steps[0], []
        worker.held_house = task.house_id
        worker.process.begin(line_from_task(self._setting, task))

    def _ended(self, worker: _Worker, task: RenderTask, ended: Ended) -> Iterator[Event]:
        """The end of a task; when its process died, the step fails and the rest begins anew."""
        worker.task = None
        if not ended.cause:
            yield Event(**ended.body)
            return
        # The last output of native libraries says more than the signal.
        lines = last_lines(worker.process.log_tail())
        reason = f"{ended.text}: {lines}" if lines else ended.text
        yield Event("failed", task.house_id, task.view_id, worker.step, message=reason)
        remaining = tuple(s for s in task.steps if s != worker.step and s not in worker.done)
        if remaining:
            self._begin(worker, replace(task, steps=remaining))
        else:
            yield Event("end", task.house_id, task.view_id, "")


def _events_in(worker: _Worker, task: RenderTask, message: Message) -> Iterator[Event]:
    """The event in a message of a running task; none when it is only ready."""
    if message.kind == "step":
        worker.step = message.text
        yield Event("begin", task.house_id, task.view_id, message.text)
    elif message.kind == "share":
        share = {"share": float(message.text)}
        yield Event("under_way", task.house_id, task.view_id, worker.step, facts=share)
    elif message.kind == "event":
        event = Event(**message.body)
        worker.done.append(event.step)
        yield event


def last_lines(log: str) -> str:
    """The last three lines of a log on one line: the likeliest cause of a death; "" for an empty log."""
    return " | ".join([line.strip() for line in log.splitlines() if line.strip()][-3:])
