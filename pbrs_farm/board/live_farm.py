"""State of a farm, cached for two seconds for all open pages. Effects: reads Redis and the store."""

from __future__ import annotations

import json
import logging
import re
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, TypeVar

from pbrs_farm.core.errors import PbrsError
from pbrs_farm.core.shown_text import MAX_MESSAGE, shown

if TYPE_CHECKING:
    from workers.client.farm_client import Farm

T = TypeVar("T")
_KEPT_S: Final = 2.0  # lifetime of an answer
_MAX_KEPT: Final = 200  # maximum number of answers
_MAX_LOG: Final = 200_000  # characters from the end of a log
_COMMAND: Final = re.compile(r"\[reproduce: (.+?)\]")
_LOG: Final = logging.getLogger(__name__)
_SHOWN: Final = 20  # number of lines on the page


@dataclass(frozen=True, slots=True)
class FarmNow:
    """All jobs and workers."""

    jobs: tuple[dict[str, Any], ...] = ()  # rows of workers/client/job_rows.py, newest first
    workers: tuple[dict[str, Any], ...] = ()  # rows of Farm.workers with tasks
    storage: str = "ok"
    fault: str = ""  # of a farm without an answer, or ""


@dataclass(frozen=True, slots=True)
class JobNow:
    """One job."""

    status: dict[str, Any]  # Farm.status
    row: dict[str, Any]  # of workers/client/job_rows.py
    failures: tuple[dict[str, Any], ...] = ()  # kinds, each with a command to reproduce it
    running: tuple[dict[str, Any], ...] = ()  # task, worker, seconds


@dataclass(slots=True)
class _KeptAnswer:
    time: float
    value: Any


@dataclass(slots=True)
class LiveFarm:
    """A farm behind a cache of two seconds, for many threads."""

    farm: Farm
    clock: Callable[[], float] = time.monotonic
    _kept: dict[str, _KeptAnswer] = field(default_factory=dict)
    _asking: threading.Lock = field(default_factory=threading.Lock)
    _finished: set[str] = field(default_factory=set)
    _n_finished: dict[str, int] = field(default_factory=dict)  # of each job, at the last request

    def now(self) -> FarmNow:
        """All jobs and workers, or a fault."""
        return self._asked("", self._read_farm)

    def job(self, job: str) -> JobNow:
        """One job. Raises BadInput for an unknown one, LedgerUnavailable."""
        return self._asked(job, lambda: self._read_job(job))

    def log(self, job: str, task: str) -> str:
        """The end of a task's stored log. Raises BadInput without one."""
        return self.farm.logs(job, task)[-_MAX_LOG:]

    def finished_houses(self) -> set[str]:
        """The finished houses of all jobs; the previous ones if Redis does not answer."""
        try:
            for job in self.farm.ledger.known_jobs():
                view = self.farm.ledger.view(job)
                n = int(view.counts.get("houses:done", 0)) if view is not None else 0
                # Read only jobs with newly finished houses.
                if n and n != self._n_finished.get(job):
                    self._finished |= self.farm.finished_houses(job, besides=self._finished)
                    self._n_finished[job] = n
        except PbrsError as error:
            _LOG.warning("cannot read the finished houses of the farm: %s", error)
        return self._finished

    def user_with(self, token: str) -> str:
        """User of the farm with this token; "" without one or without an answer."""
        try:
            user = self.farm.users.named_by(token)
        except PbrsError as error:
            _LOG.warning("cannot check the token: %s", error)
            return ""
        return user.name if user is not None else ""

    def acting_as(self, name: str, place: str) -> Farm:
        """The farm with the rights of a user; "" is an admin with the board's own token.

        Raises BadInput for a removed user.
        """
        from workers.ledger.task_ledger import User
        from workers.ledger.user_table import known_user

        user = known_user(self.farm.users.all(), name) if name else User("board", is_admin=True)
        return self.farm.acting_as(user, place)

    def forget(self) -> None:
        """Discard the cached answers after a change."""
        with self._asking:
            self._kept.clear()

    def _asked(self, name: str, ask: Callable[[], T]) -> T:
        with self._asking:
            answer = self._kept.get(name)
            if answer is None or self.clock() - answer.time > _KEPT_S:
                value = ask()
                while len(self._kept) >= _MAX_KEPT:
                    self._kept.pop(next(iter(self._kept)))
                answer = self._kept[name] = _KeptAnswer(self.clock(), value)
        result: T = answer.value
        return result

    def _read_farm(self) -> FarmNow:
        from workers.client.job_rows import job_rows

        try:
            jobs = job_rows(self.farm)
            workers = self.farm.workers()
            active = [row["job"] for row in jobs if row["running"]]
            now = self.farm.ledger.now()
            # Tasks of each worker.
            runs: dict[str, list[str]] = {}
            for job in active:
                for task, (worker, since) in self.farm.ledger.claims(job).items():
                    runs.setdefault(worker, []).append(f"{task} ({max(0.0, now - since):.0f} s)")
            rows = [{**w, "tasks": sorted(runs.get(w["worker"], ()))} for w in workers]
            storage = self.farm.registry.breaker() or "ok"
        except PbrsError as error:
            return FarmNow(fault=str(error))
        return FarmNow(tuple(reversed(jobs)), tuple(rows), storage)

    def _read_job(self, job: str) -> JobNow:
        from workers.client.job_rows import job_row

        status = self.farm.status(job)
        row = job_row(self.farm.view(job), self.farm.registry.slots())
        now = self.farm.ledger.now()
        running = [
            {"task": task, "worker": worker, "for_s": max(0.0, now - since)}
            for task, (worker, since) in sorted(self.farm.ledger.claims(job).items())
        ]
        failures = [_with_command(kind) for kind in self.farm.failures(job)]
        return JobNow(status, row, tuple(failures), tuple(running))


def _with_command(kind: dict[str, Any]) -> dict[str, Any]:
    """A kind of failure with the command to reproduce it."""
    example = shown(kind["example"], 2 * MAX_MESSAGE)
    match = _COMMAND.search(example)
    task = kind["tasks"][0] if kind["tasks"] else ""
    command = match[1] if match else kind["command"]
    return {**kind, "example": example, "task": task, "command": command}


class Audit:
    """A file with a JSON line per change."""

    def __init__(self, file: Path) -> None:
        self._file = file
        self._lock = threading.Lock()

    def note(self, *, address: str, user: str, what: str, of: str, answer: str) -> None:
        """Append and log a line: time, user, address, action, its object and its result."""
        row = {
            "utc": datetime.now(UTC).isoformat(timespec="seconds"),
            "address": address,
            "user": user,
            "what": what,
            "of": shown(of),
            "answer": shown(answer, MAX_MESSAGE),
        }
        line = json.dumps(row)
        with self._lock, self._file.open("a", encoding="utf-8") as file:
            file.write(line + "\n")
        _LOG.warning("audit: %s", line)

    def last(self) -> list[dict[str, Any]]:
        """The last changes, newest first; user is "" in lines of older boards."""
        try:
            with self._file.open(encoding="utf-8") as file:
                lines = deque(file, maxlen=_SHOWN)
        except OSError:
            return []
        return [{"user": "", **json.loads(line)} for line in reversed(lines)]
