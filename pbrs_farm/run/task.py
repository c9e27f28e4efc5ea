"""What a local worker process is asked to do and what it answers; frozen values, no effects."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Literal

from pbrs_farm.core.recipe import Recipe
from pbrs_farm.read.source import SourceRef
from pbrs_farm.store.url import StoreSettings


@dataclass(frozen=True, slots=True)
class Task:
    """Steps of one house or one view, done in order by one process."""

    house_id: str
    steps: tuple[str, ...]
    source: SourceRef
    view_id: str | None = None
    layers: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Setting:
    """What every worker process is started with. debug: tracebacks travel with failures.

    runner: "module:function" that does a step as steps.run_step does (tests put their own).
    """

    store_url: str
    recipe: Recipe
    n_threads: int
    debug: bool = False
    store: StoreSettings = field(default_factory=StoreSettings)
    runner: str = "pbrs_farm.run.steps:run_step"


@dataclass(frozen=True, slots=True)
class Event:
    """Something that happened to a step.

    kind: "begin", "done" (made now), "kept" (was there already), "failed", or "end" of a task.
    facts: of the step's marker. peak_mb: largest resident memory of the process so far.
    """

    kind: Literal["begin", "done", "kept", "failed", "end"]
    house_id: str
    view_id: str | None
    step: str
    seconds: float = 0.0
    message: str = ""
    facts: dict[str, Any] = field(default_factory=dict)
    peak_mb: float = 0.0
