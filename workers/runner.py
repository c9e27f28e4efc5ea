"""What the farm asks of whatever makes the pictures; values and one interface, no effects.

A renderer process holds one runner and gives it tasks one after another. The runner keeps loaded
what the next task may need (scenes), writes outputs and markers to the store, and may be killed
at any time: a task that is run again finds its markers and does only what is missing.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from importlib import import_module
from typing import Protocol

from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.record import Record
from workers.config import FarmConfig
from workers.job import JobSpec

OnText = Callable[[str], None]


class TaskRequest(Record):
    """A task for the runner, as it crosses to the render process.

    unit: "-" for the house or job as a whole, a number for a batch of views, "s3" for shard 3
    (workers/ids.py).
    """

    job_id: str
    house: str
    unit: str
    stage: str
    views: tuple[str, ...] = ()  # of its batch
    source: str = ""  # of the house, JSON; for geometry only
    attempt: int = 1


class Result(Record):
    """What came of a task."""

    batches: tuple[tuple[str, ...], ...] = ()  # of views to be made, only after geometry
    n_views: int = 0
    left_out: str = ""  # why pictures that this machine cannot make were left out


@dataclass(frozen=True, slots=True)
class Survey:
    """What storage says of a house."""

    batches: tuple[tuple[str, ...], ...] | None = None  # None while its geometry is not done
    missing: Mapping[str, str] = field(default_factory=dict)  # unit -> first stage not done, or ""
    reduced: bool = False  # the house is finished


class StepRunner(Protocol):
    """Runs the steps of a task; raises the errors of pbrs_farm.core.errors."""

    def run(self, request: TaskRequest, on_step: OnText) -> Result:
        """Do what the markers say is missing. on_step: called with the name of each step begun.

        May be called again for a task that was cut off at any moment. Raises BadInput and its kin
        for the house's own faults, Transient errors for what may work later; other exceptions count
        as bugs.
        """
        ...

    def survey(self, spec: JobSpec, house: str, done: frozenset[str]) -> Survey:
        """How far the house is. done: names of its markers, "<step>" or "<step>.<view>".

        Tells `recover` what to enter into the ledger; it must not make anything. A Survey without
        batches says that geometry is to be done.
        """
        ...


RunnerMaker = Callable[[FarmConfig, OnText], StepRunner]


def runner_maker(name: str) -> RunnerMaker:
    """The function a `module:function` of this machine's own configuration names.

    It is called with the configuration and with what to call while storage does not answer.
    Names never come from messages. Raises BadInput.
    """
    module, _, attribute = name.partition(":")
    try:
        maker: RunnerMaker = getattr(import_module(module), attribute)
    except (ImportError, AttributeError, ValueError) as error:
        raise BadInput("PBRS_FARM_RUNNER", name, f"no such runner: {error}") from None
    return maker
