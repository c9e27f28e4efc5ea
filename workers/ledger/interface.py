"""What the farm asks of a ledger, whatever keeps it; values and one interface, no effects.

The ledger knows which task may run, who runs it, how often it was tried and what follows it. It is
a cache of the truth in storage: `recover` rebuilds it. Another backend replaces redis_ledger.py.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields
from typing import TYPE_CHECKING, Literal, Protocol

from pbrs_farm.core.errors import PbrsError, Transient

if TYPE_CHECKING:
    from workers.job import HouseEntry, JobSpec

Verdict = Literal[
    "run", "done", "failed", "leased", "early", "cancelled", "paused", "held", "version", "recipe",
    "draining", "blocked", "elsewhere", "unknown",
]  # fmt: skip
FaultClass = Literal[
    "data", "bug", "crash", "resource", "machine", "timeout", "silent", "lost",
    "storage", "preempted", "drained", "version", "cancelled",
]  # fmt: skip


class LedgerUnavailable(PbrsError, Transient):
    """Redis did not answer, or refused the credentials; says which."""


@dataclass(frozen=True, slots=True)
class Claim:
    """The answer to a claim. detail: the attempt's number for "run", otherwise why not."""

    verdict: Verdict
    detail: str = ""
    inputs: str = ""
    token: str = ""


@dataclass(frozen=True, slots=True)
class Fault:
    """A task that ended badly, as the ledger keeps it. log: key of the log object, or ""."""

    fault: FaultClass
    fingerprint: str
    message: str
    worker: str = ""
    attempt: int = 0
    log: str = ""
    tail: str = ""

    def json(self) -> str:
        """The fault as fault_from_json reads it."""
        return json.dumps(asdict(self))


def fault_from_json(text: str) -> Fault:
    """The fault a JSON object tells of; names it does not know are left out."""
    known = {f.name for f in fields(Fault)}
    return Fault(**{name: value for name, value in json.loads(text).items() if name in known})


@dataclass(frozen=True, slots=True)
class Finished:
    """How a task ended well. groups: of views, only after geometry."""

    seconds: float
    groups: tuple[tuple[str, ...], ...] = ()
    n_views: int = 0


@dataclass(frozen=True, slots=True)
class HouseState:
    """A house as storage tells it. units: unit -> (stage, "d" done | "l" to be run)."""

    index: int
    house_id: str
    done: bool
    groups: tuple[tuple[str, ...], ...] = ()
    units: Mapping[str, tuple[str, str]] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class JobView:
    """A job as the ledger sees it now, from O(1) reads. counts: "gl:q", "done:gl", "houses:open"."""

    job_id: str
    fields: Mapping[str, str]
    counts: Mapping[str, float]
    rates: Mapping[str, float]
    n_waiting_houses: int

    @property
    def state(self) -> str:
        """loading, running, paused, done, cancelled."""
        return self.fields.get("state", "")


@dataclass(frozen=True, slots=True)
class WorkerView:
    """A worker as it registered itself. age_s: since its last sign of life."""

    name: str
    age_s: float
    fields: Mapping[str, str]


class Ledger(Protocol):
    """Every method is atomic and may be called again after a lost answer."""

    def create(self, spec: JobSpec) -> str: ...
    def add_houses(self, job: str, first: int, houses: Sequence[HouseEntry]) -> None: ...
    def load_houses(self, job: str, houses: Iterable[HouseState]) -> int: ...
    def open(self, job: str, priority: int) -> None: ...
    def forget(self, job: str) -> None: ...

    def claim(
        self, job: str, task: str, *, token: str, recipe: str, direct: bool = False
    ) -> Claim: ...
    def beat(self, job: str, task: str, token: str) -> str: ...
    def finish(self, job: str, task: str, token: str, end: Finished, *, sticky: bool) -> str: ...
    def fail(self, job: str, task: str, token: str, fault: Fault, *, delay_s: float) -> str: ...

    def lead(self, token: str) -> bool: ...
    def reap(self, token: str) -> int: ...
    def feed(
        self, job: str, token: str, *, max_open: int, room: Mapping[str, int]
    ) -> list[str] | None: ...
    def rest(self, seconds: float) -> None: ...
    def resend(self, job: str, token: str, stage: str, age_s: float) -> list[str] | None: ...

    def steer(self, job: str, what: str, reason: str = "") -> str: ...
    def retry(self, job: str, task: str) -> bool: ...
    def view(self, job: str) -> JobView | None: ...
    def active_jobs(self) -> list[str]: ...
    def known_jobs(self) -> list[str]: ...
