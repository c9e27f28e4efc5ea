"""Request and summary of a run on this machine; values, no effects."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from pbrs_farm.core.recipe import Recipe
from pbrs_farm.prepare.source_ref import SourceRef
from pbrs_farm.run.processes.render_task import Event
from pbrs_farm.run.request import Wanted
from pbrs_farm.store import StoreSettings

Observer = Callable[[Event], None]


@dataclass(frozen=True, slots=True)
class Run:
    """Request of a local run."""

    homes: Sequence[str]  # words as prepare.source.resolve takes them
    store_url: str
    recipe: Recipe
    want: Wanted = field(default_factory=Wanted)
    n_jobs: int = 1  # render processes
    update: bool = False  # replace the root's recipe where it is another
    step_timeout_s: float = 3600.0  # a process whose step takes longer is killed
    silence_s: float = 0.0  # and one without a step begun or a line in its log; 0 = step_timeout_s
    memory_mb: float = 0.0  # and one that holds more; 0 = its share of the machine
    debug: bool = False  # tracebacks travel with failures
    store: StoreSettings = field(default_factory=StoreSettings)
    sources: Sequence[SourceRef] = ()  # resolved homes
    dress_seeds: Sequence[int] = ()  # each home dressed by each of them; none = by the recipe's
    refused: Sequence[tuple[str, str]] = ()  # unreadable homes and the reason of each
    models: str = ""  # folder of the models that the homes' files name


@dataclass(slots=True)
class Summary:
    """Result of a run."""

    houses: list[str] = field(default_factory=list)
    n_views: int = 0
    n_done: int = 0  # steps
    n_kept: int = 0  # steps completed in an earlier run
    peak_mb: float = 0.0  # of the largest process
    failures: list[tuple[str, str, str]] = field(default_factory=list)  # what, message, command
    without_views: list[tuple[str, str]] = field(default_factory=list)  # house, reason
    left_out: list[tuple[str, str]] = field(default_factory=list)  # house, which views and why
    leaks: list[tuple[str, str]] = field(default_factory=list)  # house, rays that reached the sky
    walls_lost: list[tuple[str, str]] = field(default_factory=list)  # house, walls repair lost
    notes: Counter[str] = field(default_factory=Counter)  # of the houses, by kind
    taken_out: Counter[str] = field(default_factory=Counter)  # "person", "plant": how many
    lacking: dict[str, str] = field(default_factory=dict)  # step this machine cannot do -> why
    dark: list[tuple[str, str]] = field(default_factory=list)  # house/view, how dark it is
