"""A ledger and a registry of workers in memory: a farm as a slot and a coordinator see it."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from workers.ledger.task_ledger import (
    Claim,
    Fault,
    Finished,
    GoOn,
    Hold,
    JobView,
    LedgerUnavailable,
    WorkerView,
)


@dataclass
class MemoryLedger:
    """The methods of RedisLedger that slots and coordinators use, for tasks inserted by a test."""

    ready: list[str] = field(default_factory=list)
    queued: list[str] = field(default_factory=list)
    inputs: dict[str, str] = field(default_factory=dict)
    leases: dict[str, str] = field(default_factory=dict)  # task -> token
    attempts: Counter[str] = field(default_factory=Counter)
    finished: dict[str, Finished] = field(default_factory=dict)
    faults: dict[str, list[Fault]] = field(default_factory=lambda: defaultdict(list))
    affine: dict[str, str] = field(default_factory=dict)  # task -> the next task of its house
    refusal: Claim | None = None  # the answer to every claim
    heartbeats: list[str] = field(default_factory=list)  # answers to come; "ok" after the last
    n_heartbeats: int = 0
    beaten: list[list[str]] = field(
        default_factory=list
    )  # tasks whose leases each heartbeat renewed
    reports: list[list[str]] = field(default_factory=list)  # tasks of each report
    n_away: int = 0  # calls that fail before Redis answers again
    leader: str = ""
    reaped: int = 0
    fields: dict[str, str] = field(default_factory=lambda: {"recipe": "r", "state": "running"})
    seconds: dict[str, float] = field(
        default_factory=dict
    )  # stage -> seconds of its finished tasks
    others: dict[str, str] = field(default_factory=dict)  # another job -> its state
    lengths: Counter[str] = field(default_factory=Counter)  # queue -> its length

    def _answer(self) -> None:
        if self.n_away > 0:
            self.n_away -= 1
            raise LedgerUnavailable("no Redis")

    def steer(self, job: str, what: str, reason: str = "") -> str:
        self.fields |= {"state": "paused", "reason": reason} if what == "pause" else {}
        return self.fields["state"]

    def claim_many(
        self, job: str, tasks: Sequence[str], *, token: str, recipe: str, direct: bool = False
    ) -> list[Claim]:
        self._answer()
        return [self._claim(task, token) for task in tasks]

    def _claim(self, task: str, token: str) -> Claim:
        if self.refusal is not None:
            return self.refusal
        if task in self.finished:
            return Claim("done")
        if task in self.leases:
            return Claim("leased", f"{self.leases[task]}|w1|0")
        self.leases[task] = token
        self.attempts[task] += 1
        return Claim("run", str(self.attempts[task]), self.inputs.get(task, ""), token)

    def heartbeat(self, job: str, tasks: Sequence[str], token: str) -> str:
        self._answer()
        self.beaten.append(list(tasks))
        self.n_heartbeats += 1
        return self.heartbeats.pop(0) if self.heartbeats else "ok"

    def finish_many(
        self, job: str, ends: Mapping[str, Finished], token: str, go_on: GoOn | None = None
    ) -> dict[str, Claim]:
        self._answer()
        self.reports.append(list(ends))
        for task, end in ends.items():
            assert self.leases.pop(task) == token
            self.finished[task] = end
        more = [self.affine[t] for t in ends if t in self.affine]
        return {t: self._claim(t, token) for t in more} if go_on and go_on.is_long else {}

    def fail(self, job: str, task: str, token: str, fault: Fault, *, delay_s: float) -> str:
        self._answer()
        assert self.leases.pop(task) == token
        self.faults[task].append(fault)
        return "failed" if fault.fault == "data" else "retry"

    def lead(self, token: str) -> bool:
        self._answer()
        self.leader = self.leader or token
        return self.leader == token

    def resign(self, token: str) -> None:
        self.leader = "" if self.leader == token else self.leader

    def reap(self, token: str) -> int:
        self.reaped += 1
        return 0

    def dispatch(
        self, job: str, token: str, *, max_open: int, room: Mapping[str, int]
    ) -> list[str] | None:
        if self.leader != token:
            return None
        sent = []
        free = dict(room)
        for task in list(self.ready):
            stage = task.rpartition("/")[2]
            if free[stage] > 0:
                free[stage] -= 1
                self.ready.remove(task)
                self.queued.append(task)
                sent.append(task)
        return sent

    def wait(self, seconds: float) -> None:
        self._answer()

    def resend(self, job: str, token: str, stage: str, age_s: float) -> list[str] | None:
        return [t for t in self.queued if t.endswith(f"/{stage}")]

    def view(self, job: str) -> JobView | None:
        if job != "0" * 12:
            state = self.others.get(job)
            return None if state is None else JobView(job, {"state": state}, {}, {}, 0)
        counts: dict[str, float] = Counter(f"{task.rpartition('/')[2]}:q" for task in self.queued)
        counts |= Counter(f"{task.rpartition('/')[2]}:w" for task in self.ready)
        counts |= {f"seconds:{stage}": n for stage, n in self.seconds.items()}
        return JobView(job, self.fields, counts, {}, 0)

    def set_blocked(self, job: str, queues: Sequence[str], why: str) -> None:
        self.fields |= {"blocked": ",".join(queues), "blocked_why": why}

    def holds(self, job: str) -> list[Hold]:
        return []

    def set_notified(self, job: str, outcome: str) -> None:
        self.fields["notified"] = outcome

    def set_rates(self, job: str, rates: Mapping[str, float]) -> None:
        self.fields["rates"] = ",".join(rates)

    def queue_length(self, queue: str) -> int:
        return self.lengths[queue]

    def active_jobs(self) -> list[str]:
        return ["0" * 12]

    def known_jobs(self) -> list[str]:
        return ["0" * 12]


@dataclass
class MemoryRegistry:
    """The methods of Registry that they use."""

    n_slots: dict[str, int] = field(default_factory=dict)
    refusals: list[str] = field(default_factory=list)
    reason: str = ""

    def slots(self) -> dict[str, int]:
        return self.n_slots

    def workers(self) -> list[WorkerView]:
        return []

    def note_rejection(self, reason: str) -> None:
        self.refusals.append(reason)

    def open_breaker(self, reason: str) -> None:
        self.reason = reason

    def breaker(self) -> str:
        return self.reason
