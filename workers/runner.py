"""Interface between the farm and the renderer, and its values; no effects.

A renderer process holds one runner and gives it tasks one after another. The runner keeps data for the next task
loaded (scenes), writes outputs and markers to the store, and may be killed at any time: a repeated task finds
its markers and does only the missing steps.
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
    """A task for the render process; unit: "-" (house, job), "0" (a batch) or "s3" (a shard)."""

    job_id: str
    house: str
    unit: str
    stage: str
    views: tuple[str, ...] = ()  # of its batch
    source: str = ""  # of the house, JSON; for geometry only
    attempt: int = 1


class Result(Record):
    """Result of a task."""

    batches: tuple[tuple[str, ...], ...] = ()  # of views to be made, only after geometry
    n_views: int = 0
    left_out: str = ""  # why pictures that this machine cannot make were left out


@dataclass(frozen=True, slots=True)
class Survey:
    """Progress of a house in storage."""

    batches: tuple[tuple[str, ...], ...] | None = None  # None while its geometry is not done
    missing: Mapping[str, str] = field(default_factory=dict)  # unit -> first stage not done, or ""
    reduced: bool = False  # the house is finished


class StepRunner(Protocol):
    """Runs the steps of a task; raises the errors of pbrs_farm.core.errors."""

    def run(self, request: TaskRequest, on_step: OnText) -> Result:
        """Do the steps without markers. on_step: called with the name of each started step.

        May be called again for a task interrupted at any moment. Raises BadInput and its subclasses for faults of
        the house, Transient errors for temporary failures; other exceptions count as bugs.
        """
        ...

    def survey(self, spec: JobSpec, house: str, done: frozenset[str]) -> Survey:
        """Progress of the house. done: names of its markers, "<step>" or "<step>.<view>".

        For `recover`, which enters it into the ledger; it must have no effects. A Survey without batches means that
        geometry is not done.
        """
        ...


RunnerMaker = Callable[[FarmConfig, OnText], StepRunner]


def runner_maker(name: str) -> RunnerMaker:
    """The function that `module:function` of this machine's configuration, never a message, names; BadInput."""
    module, _, attribute = name.partition(":")
    try:
        maker: RunnerMaker = getattr(import_module(module), attribute)
    except (ImportError, AttributeError, ValueError) as error:
        raise BadInput("PBRS_FARM_RUNNER", name, f"no such runner: {error}") from None
    return maker
