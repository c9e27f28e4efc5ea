"""What a farm does now, asked of Redis once for all who look. Effects: reads Redis and the store.

Many pages may be open: each answer is kept for two seconds, so that looking costs the farm the same
whether one looks or a hundred.
"""

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
_KEPT_S: Final = 2.0  # an answer that Redis gave
_MAX_KEPT: Final = 200  # answers
_MAX_LOG: Final = 200_000  # characters of a log, its end
_COMMAND: Final = re.compile(r"\[reproduce: (.+?)\]")
_LOG: Final = logging.getLogger(__name__)
_SHOWN: Final = 20  # lines that the page shows


@dataclass(frozen=True, slots=True)
class FarmNow:
    """All jobs and workers."""

    jobs: tuple[dict[str, Any], ...] = ()  # rows of workers/client/job_rows.py, newest first
    workers: tuple[dict[str, Any], ...] = ()  # rows of Farm.workers, with what each runs
    storage: str = "ok"
    fault: str = ""  # why the farm does not answer, or ""


@dataclass(frozen=True, slots=True)
class JobNow:
    """One job."""

    status: dict[str, Any]  # Farm.status
    row: dict[str, Any]  # of workers/client/job_rows.py
    failures: tuple[dict[str, Any], ...] = ()  # kinds, with the command that reproduces one
    running: tuple[dict[str, Any], ...] = ()  # task, worker, seconds


@dataclass(slots=True)
class _KeptAnswer:
    at: float
    value: Any


@dataclass(slots=True)
class LiveFarm:
    """A farm behind a memory of two seconds; safe to ask from many threads."""

    farm: Farm
    clock: Callable[[], float] = time.monotonic
    _kept: dict[str, _KeptAnswer] = field(default_factory=dict)
    _asking: threading.Lock = field(default_factory=threading.Lock)
    _finished: set[str] = field(default_factory=set)
    _n_finished: dict[str, int] = field(default_factory=dict)  # of each job, when asked last

    def now(self) -> FarmNow:
        """All jobs and workers; says so where the farm does not answer."""
        return self._asked("", self._read_farm)

    def job(self, job: str) -> JobNow:
        """One job. Raises BadInput for one there is not, LedgerUnavailable."""
        return self._asked(job, lambda: self._read_job(job))

    def log(self, job: str, task: str) -> str:
        """The end of a task's stored log. Raises BadInput where there is none.

        Only the last part of a long log.
        """
        text = self.farm.logs(job, task)
        return text[-_MAX_LOG:]

    def finished_houses(self) -> set[str]:
        """The houses of every job that need no more work; those known before if Redis is silent.

        Grows only: what was finished stays so while the board runs. Asks the farm once a job that
        finished something since.
        """
        try:
            for job in self.farm.ledger.known_jobs():
                view = self.farm.ledger.view(job)
                n = int(view.counts.get("houses:done", 0)) if view is not None else 0
                # Ask only where a house was finished since.
                if n and n != self._n_finished.get(job):
                    self._finished |= self.farm.finished_houses(job, besides=self._finished)
                    self._n_finished[job] = n
        except PbrsError as error:
            _LOG.warning("the farm does not say which houses are done: %s", error)
        return self._finished

    def user_with(self, token: str) -> str:
        """Which user of the farm has this token; "" for none, or where the farm does not answer."""
        try:
            user = self.farm.users.named_by(token)
        except PbrsError as error:
            _LOG.warning("the farm does not say whose token it is: %s", error)
            return ""
        return user.name if user is not None else ""

    def acting_as(self, name: str, place: str) -> Farm:
        """The farm as a user sees it; "" is who has the board's own token, and may all.

        Raises BadInput for a user who was removed.
        """
        from workers.ledger.task_ledger import User
        from workers.ledger.user_table import known_user

        user = known_user(self.farm.users.all(), name) if name else User("board", is_admin=True)
        return self.farm.acting_as(user, place)

    def forget(self) -> None:
        """Ask anew next time: something was changed."""
        with self._asking:
            self._kept.clear()

    def _asked(self, name: str, ask: Callable[[], T]) -> T:
        # Whoever comes while somebody asks waits for that answer.
        with self._asking:
            kept = self._kept.get(name)
            if kept is None or self.clock() - kept.at > _KEPT_S:
                value = ask()
                while len(self._kept) >= _MAX_KEPT:
                    self._kept.pop(next(iter(self._kept)))
                kept = self._kept[name] = _KeptAnswer(self.clock(), value)
        answer: T = kept.value
        return answer

    def _read_farm(self) -> FarmNow:
        from workers.client.job_rows import job_rows

        try:
            jobs = job_rows(self.farm)
            workers = self.farm.workers()
            active = [row["job"] for row in jobs if row["running"]]
            now = self.farm.ledger.now()
            # What each worker runs, of the jobs that run something.
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
    """A kind of failure with the command that makes one of it happen again."""
    example = shown(kind["example"], 2 * MAX_MESSAGE)
    found = _COMMAND.search(example)
    task = kind["tasks"][0] if kind["tasks"] else ""
    command = found[1] if found else kind["command"]
    return {**kind, "example": example, "task": task, "command": command}


class Audit:
    """A file of JSON lines, one a change."""

    def __init__(self, file: Path) -> None:
        self._file = file
        self._lock = threading.Lock()

    def note(self, *, address: str, user: str, what: str, of: str, answer: str) -> None:
        """Write one line: when, who, from which address, what was done to what, what came of it.

        Lines are appended and also logged, and none is ever changed. Write it after the thing was
        done or refused, with what came of it.
        """
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
        """The last changes, newest first.

        [] where nothing was ever done. Lines of older boards have no user, which is "" here.
        """
        try:
            with self._file.open(encoding="utf-8") as file:
                lines = deque(file, maxlen=_SHOWN)
        except OSError:
            return []
        return [{"user": "", **json.loads(line)} for line in reversed(lines)]
