"""Values of the ledger, independent of where it is kept; no effects.

The ledger tracks which tasks may run, their workers, attempts and successors. It is a cache of the truth in
storage: `recover` rebuilds it. redis_ledger.py keeps it.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields
from typing import Final, Literal

from pbrs_farm.core.errors import PbrsError, Transient
from workers.ids import DEFAULT_PRIORITY, MOST_IN_GROUP, STAGES

# fmt: off
ClaimAnswer = Literal[
    "run", "done", "failed", "leased", "early", "cancelled", "paused", "held", "version", "recipe",
    "store", "blocked", "draining", "cooling", "elsewhere", "alone", "unknown",
]
# fmt: on
# fmt: off
FaultClass = Literal[
    "data", "bug", "crash", "resource", "machine", "timeout", "silent", "lost",
    "storage", "preempted", "drained", "version", "cancelled",
]
# fmt: on

TOGETHER_S: Final = (
    30.0  # of work per claim of a slot: long compared to a claim, short enough to lose
)
MOST_TOGETHER: Final = MOST_IN_GROUP  # maximum tasks of one house per claim of a slot
EVERYWHERE: Final = "*"  # all queues, for a blocked job
ALIVE_S: Final = 45.0  # a worker whose last heartbeat is no older than this is there
# Classes of fault that do not count against the task: the attempt is given back.
UNCOUNTED: Final = ("preempted", "storage", "version", "drained")
# Classes of fault that speak against the worker: three in a row and it cools down.
SUSPECT: Final = ("crash", "resource", "machine", "timeout", "silent")
# A unit's state: name -> the letter it has in the ledger; Lua knows the names as constants.
STATES: Final = {
    "LOADED": "l",  # entered, its house not admitted
    "READY": "w",  # in the outbox, or waiting for its time
    "QUEUED": "q",  # its message is sent
    "RUNNING": "r",  # leased
    "DONE": "d",
    "FAILED": "f",  # for good
    "CANCELLED": "x",
}


SPENT_DAYS: Final = 30  # over which a user's slot-hours are counted
WITH_FAILURES: Final = "done with failures"


class LedgerUnavailable(PbrsError, Transient):
    """Redis did not answer, or rejected the credentials; says which."""


@dataclass(frozen=True, slots=True)
class Claim:
    """The answer to a claim of one task; only verdict "run" grants it. docs/farm/inside.md explains each verdict."""

    verdict: ClaimAnswer
    detail: str = ""  # the attempt's number for "run", otherwise the reason
    inputs: str = ""  # the house's source for geometry, its batches of views for what follows
    token: str = ""  # of the claim; without it nobody ends the task or keeps its lease


@dataclass(frozen=True, slots=True)
class Fault:
    """A task that ended badly, as the ledger keeps it.

    Faults of one class whose messages differ only in numbers and paths have one fingerprint:
    `failures` groups by it, and a job with too many of one pauses itself.
    """

    fault: FaultClass
    fingerprint: str  # equal for faults alike
    message: str  # for people
    worker: str = ""
    attempt: int = 0
    log: str = ""  # key of the log object, or ""
    tail: str = ""  # the end of the log

    def json(self) -> str:
        """The fault as fault_from_json reads it."""
        return json.dumps(asdict(self))


def fault_from_json(text: str) -> Fault:
    """The fault in JSON text, without names that only a later version knows."""
    names = {f.name for f in fields(Fault)}
    return Fault(**{name: value for name, value in json.loads(text).items() if name in names})


@dataclass(frozen=True, slots=True)
class Finished:
    """Result of a finished task: its duration, and data for its successors."""

    seconds: float
    batches: tuple[tuple[str, ...], ...] = ()  # of views, only after geometry
    n_views: int = 0


@dataclass(frozen=True, slots=True)
class GoOn:
    """Candidates for a slot's next tasks without a message."""

    recipe: str  # digest of the job's recipe
    queues: tuple[str, ...]  # that its worker takes from
    is_long: bool = False  # the last task loaded a scene worth reusing for its house


@dataclass(frozen=True, slots=True)
class Hold:
    """A task that a slot holds."""

    job: str
    task: str
    token: str  # of the slot's hold; tasks claimed together share one
    worker: str
    since: float  # by Redis' clock
    is_preempted: bool = False  # it shall end


def hold_from_text(job: str, task: str, text: str) -> Hold:
    """The hold that the ledger keeps as "<token>|<worker>|<since>", "|p" behind it once it shall end."""
    token, worker, since, *mark = text.split("|")
    return Hold(job, task, token, worker, float(since), bool(mark))


@dataclass(frozen=True, slots=True)
class User:
    """Somebody who may ask the farm for work: a share, which counts while others wait, and limits, 0 = none."""

    name: str
    token_sha256: str = ""
    share: float = 1.0  # of the slots, in proportion to the others who want some
    max_slots: int = 0  # tasks of all the user's jobs in flight, 0 = unlimited
    slot_hours: float = 0.0  # that his jobs may take in SPENT_DAYS, 0 = any
    is_admin: bool = False  # may steer every job, drain workers and change users
    may_preempt: bool = False  # may submit urgent jobs


@dataclass(frozen=True, slots=True)
class HouseState:
    """A house as storage has it."""

    index: int  # in the job's order
    house_id: str
    done: bool
    batches: tuple[tuple[str, ...], ...] = ()
    # unit -> (stage, letter: "d" done, "l" to be run)
    units: Mapping[str, tuple[str, str]] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class JobView:
    """A job as the ledger sees it at one moment; its properties are what others ask of it.

    It is read in a handful of O(1) calls whatever the job's size, and does not follow later
    changes. counts has "<stage>:<letter>" (STATES), "done:<stage>", "seconds:<stage>",
    "houses:<how>", "batches", "views" and "failures:<class>"; what never happened is missing,
    so read by `counts.get(name, 0)`.
    """

    job_id: str
    fields: Mapping[str, str]  # the job's entry, its state and the reason for it
    counts: Mapping[str, float]  # "gl:q", "done:gl", "houses:open", ...
    rates: Mapping[str, float]  # stage -> tasks per second
    n_waiting_houses: int

    @property
    def state(self) -> str:
        """loading, running, paused, done, cancelled."""
        return self.fields.get("state", "")

    @property
    def outcome(self) -> str:
        """The state; for a finished job also whether tasks failed permanently."""
        return WITH_FAILURES if self.state == "done" and self.n_failed else self.state

    @property
    def uses_gpu(self) -> bool:
        """Whether its light goes to the queue of GPUs."""
        return self.fields.get("gpu") == "1"

    @property
    def max_slots(self) -> int:
        """Maximum tasks in flight, 0 for as many as there are slots."""
        return int(self.fields.get("max_slots") or 0)

    @property
    def budget_h(self) -> float:
        """Slot-hours it may spend, 0 for any."""
        return float(self.fields.get("budget_h") or 0.0)

    @property
    def spent_h(self) -> float:
        """Slot-hours of its finished tasks."""
        return sum(n for name, n in self.counts.items() if name.startswith("seconds:")) / 3600

    @property
    def after(self) -> tuple[str, ...]:
        """Jobs that must be done before it begins."""
        return tuple(filter(None, self.fields.get("after", "").split(",")))

    @property
    def user(self) -> str:
        """Owner of the job, "" for none."""
        return self.fields.get("user", "")

    @property
    def is_urgent(self) -> bool:
        """Whether running tasks of other jobs make room for it."""
        return self.fields.get("preempt") == "1"

    @property
    def blocked_queues(self) -> tuple[str, ...]:
        """Queues on which it may not be claimed now, (EVERYWHERE,) for all."""
        return tuple(filter(None, self.fields.get("blocked", "").split(",")))

    @property
    def blocked_why(self) -> str:
        """Why it may not be claimed there, "" where it may."""
        return self.fields.get("blocked_why", "")

    @property
    def priority(self) -> int:
        """0 goes first, 9 last."""
        return int(self.fields.get("priority", DEFAULT_PRIORITY))

    @property
    def n_running(self) -> float:
        """Tasks that slots hold."""
        return self._n_in("RUNNING")

    @property
    def n_in_flight(self) -> float:
        """Number of queued and running tasks."""
        return self.n_running + self._n_in("QUEUED")

    def _n_in(self, state: str) -> float:
        return sum(self.counts.get(f"{stage}:{STATES[state]}", 0.0) for stage in STAGES)

    @property
    def n_failed(self) -> int:
        """Tasks that failed for good."""
        return int(sum(self.counts.get(f"{s}:{STATES['FAILED']}", 0) for s in STAGES))


@dataclass(frozen=True, slots=True)
class WorkerView:
    """A worker as it registered itself."""

    name: str
    age_s: float  # since its last heartbeat
    fields: Mapping[str, str]

    @property
    def state(self) -> str:
        """alive, draining, drained or dead."""
        if self.age_s > ALIVE_S:
            return "dead"
        if self.fields.get("leaving") == "1":
            return "draining"
        if self.fields.get("drain") != "1":
            return "alive"
        return "drained" if self.fields.get("slots") == "0" else "draining"


def batches_from_text(text: str) -> tuple[tuple[str, ...], ...]:
    """ "a,b;c" -> (("a", "b"), ("c",)), "" -> (); `text_from_batches` is the inverse."""
    return tuple(tuple(batch.split(",")) for batch in text.split(";") if batch)


def text_from_batches(batches: Sequence[Sequence[str]]) -> str:
    """(("a", "b"), ("c",)) -> "a,b;c"."""
    return ";".join(",".join(batch) for batch in batches)
