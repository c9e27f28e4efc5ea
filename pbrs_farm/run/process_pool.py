"""Worker processes of a local run: one task each at a time, restarted when they die.

Effects: starts and kills processes, writes their logs to a temporary folder.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import signal
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from pathlib import Path
from types import TracebackType
from typing import Final

from pbrs_farm.run.render_process import last_lines, work_forever
from pbrs_farm.run.task import Event, Setting, Task

_START_S: Final = 60.0
"""What a process may take to start before its first step's time begins to count."""


@dataclass(slots=True)
class _Worker:
    process: BaseProcess
    pipe: Connection
    log: Path
    task: Task | None = None
    step: str = ""
    since: float = 0.0
    held_house: str = ""
    done: list[str] = field(default_factory=list)


class Pool:
    """n processes that run tasks. A process that dies costs the step it was in.

    step_timeout_s: a step that takes longer is killed and failed.
    """

    def __init__(self, n: int, setting: Setting, *, step_timeout_s: float) -> None:
        self._setting = setting
        self._timeout_s = step_timeout_s
        self._context = multiprocessing.get_context("spawn")
        self._folder = tempfile.TemporaryDirectory(prefix="pbrs-farm-")
        self._workers: list[_Worker] = []
        self._n = n
        self._n_started = 0

    def __enter__(self) -> Pool:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        tb: TracebackType | None,
    ) -> None:
        for worker in self._workers:
            worker.pipe.close()
            if worker.task is not None:
                worker.process.kill()
        for worker in self._workers:
            worker.process.join(10)
            if worker.process.is_alive():
                worker.process.kill()
                worker.process.join()
        self._folder.cleanup()

    @property
    def n_busy(self) -> int:
        """Processes with a task."""
        return sum(w.task is not None for w in self._workers)

    def idle_houses(self) -> list[str]:
        """The house each idle process holds in memory ("" for none): a slot per idle process."""
        idle = [w.held_house for w in self._workers if w.task is None]
        return idle + [""] * (self._n - len(self._workers))

    def busy_houses(self) -> set[str]:
        """Houses being worked on."""
        return {w.task.house_id for w in self._workers if w.task is not None}

    def give(self, task: Task) -> None:
        """Hand a task to an idle process, one that holds its house if there is one."""
        idle = [w for w in self._workers if w.task is None]
        idle.sort(key=lambda w: w.held_house != task.house_id)
        holds = bool(idle) and idle[0].held_house == task.house_id
        if not holds and len(self._workers) < self._n:
            worker = self._start()
            self._workers.append(worker)
        else:
            worker = idle[0]
        worker.task, worker.step, worker.done = task, task.steps[0], []
        worker.since, worker.held_house = time.monotonic() + _START_S, task.house_id
        with contextlib.suppress(OSError):  # it died while idle: events() finds that out
            worker.pipe.send(task)

    def events(self) -> Iterator[Event]:
        """What happens next, at least once a second; nothing when no process has a task."""
        pipes = {w.pipe: w for w in self._workers if w.task is not None}
        for ready in wait(list(pipes), timeout=1.0):
            worker = pipes[ready]  # type: ignore[index]
            try:
                event: Event = worker.pipe.recv()
            except (EOFError, OSError):
                yield from self._bury(worker, "")
                continue
            if event.kind == "begin":
                worker.step, worker.since = event.step, time.monotonic()
            elif event.kind in ("done", "kept", "failed"):
                worker.done.append(event.step)
            elif event.kind == "end":
                worker.task = None
            yield event
        for worker in list(self._workers):
            if worker.task is not None and time.monotonic() - worker.since > self._timeout_s:
                worker.process.kill()
                yield from self._bury(worker, f"took longer than {self._timeout_s:.0f} s; killed")

    def _start(self) -> _Worker:
        self._n_started += 1
        log = Path(self._folder.name) / f"worker-{self._n_started}.log"
        ours, theirs = self._context.Pipe()
        process = self._context.Process(
            target=work_forever, args=(theirs, self._setting, str(log)), daemon=True
        )
        process.start()
        theirs.close()
        return _Worker(process, ours, log)

    def _bury(self, worker: _Worker, reason: str) -> Iterator[Event]:
        """Fail the step a dead process was in, then go on with the rest of its task elsewhere."""
        worker.process.join(10)
        reason = reason or _death(worker.process.exitcode, last_lines(worker.log))
        task = worker.task
        worker.pipe.close()
        self._workers.remove(worker)
        if task is None:
            return
        yield Event("failed", task.house_id, task.view_id, worker.step, message=reason)
        left = tuple(s for s in task.steps if s != worker.step and s not in worker.done)
        if left:
            replacement = self._start()
            self._workers.append(replacement)
            rest = Task(task.house_id, left, task.source, task.view_id, task.layers)
            replacement.task, replacement.step = rest, left[0]
            replacement.since = time.monotonic() + _START_S
            replacement.held_house = task.house_id
            replacement.pipe.send(rest)
        else:
            yield Event("end", task.house_id, task.view_id, "")


def _death(exitcode: int | None, lines: str) -> str:
    if exitcode is not None and exitcode < 0:
        how = f"its process was killed by {signal.Signals(-exitcode).name}"
        if exitcode == -signal.SIGKILL:
            how += " (out of memory?)"
    else:
        how = f"its process ended with exit code {exitcode}"
    return f"{how}: {lines}" if lines else how
