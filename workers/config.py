"""How this process takes part in a farm: Settings plus limits, from the environment.

Effects: reads environment variables and secret files, through pbrs_farm.settings; makes scratch.
"""

from __future__ import annotations

import os
import platform
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any, Final
from urllib.parse import quote, urlsplit, urlunsplit

from pbrs_farm.core.errors import BadInput, MachineFailed
from pbrs_farm.run.processes.limits import ProcessLimits, memory_share_mb
from pbrs_farm.settings import settings_from_environment, value_or_file
from pbrs_farm.store.secret import Secret
from pbrs_farm.store.url import StoreSettings
from workers.ids import GEOMETRY, GL, LIGHT, QUEUES
from workers.liveness import alive_file

_PREFIX: Final = "PBRS_FARM_"


# A field's minimum is in its metadata: _check_config raises BadInput below it.
def _above(default: float, limit: float = 0.0) -> Any:
    return field(default=default, metadata={"above": limit})


def _least(default: int, limit: int) -> Any:
    return field(default=default, metadata={"above": limit - 1})


@dataclass(frozen=True, slots=True)
class Limits:
    """When a render process is killed, and after how many tasks it is replaced."""

    geometry_s: float = _above(1800.0)  # deadline of one task of the stage; so the next three
    gl_s: float = _above(1800.0)
    light_s: float = _above(4 * 3600.0)
    reduce_s: float = _above(3600.0)  # of shard and job too
    silence_s: float = _above(1800.0)  # without a step or a line in the log
    memory_mb: int = _least(0, 0)  # of one process; 0 = its share of the machine
    tasks_per_renderer: int = _least(2000, 1)

    def __post_init__(self) -> None:
        _check_config(self, f"{_PREFIX}LIMITS_")

    def deadline_s(self, stage: str) -> float:
        """Time limit of a task of the stage, seconds; all merges share that of reduce."""
        return {GEOMETRY: self.geometry_s, GL: self.gl_s, LIGHT: self.light_s}.get(
            stage, self.reduce_s
        )

    def of_process(self, n_slots: int) -> ProcessLimits:
        """Limits of the render process of one of n slots, by default its share of the machine's memory."""
        memory_mb = self.memory_mb or memory_share_mb(n_slots)
        return ProcessLimits(
            silence_s=self.silence_s,
            memory_mb=memory_mb,
            recycle_mb=memory_mb / 2,
            recycle_tasks=self.tasks_per_renderer,
        )


@dataclass(frozen=True, slots=True)
class FarmConfig:
    """Everything a coordinator, a worker or a client needs to know.

    `config_from_environment` makes it from PBRS_* and PBRS_FARM_* (docs/farm/settings.md lists them);
    tests give the fields. Only redis_url is needed to look at a farm; what stores something
    needs store_url. Raises BadInput for a value out of its range.
    """

    redis_url: Secret
    redis_ca: str = ""  # file of the CA for rediss://, "" = the system's
    store_url: str = ""
    store: StoreSettings = field(default_factory=StoreSettings)
    prefix: str = "pbrs:"  # of every key in Redis
    store_id: str = ""  # of the store, as the worker's supervisor read it
    worker: str = ""  # its name in the ledger
    slots: int = _least(1, 1)  # concurrent tasks
    queues: tuple[str, ...] = ()  # () = all
    scratch: Path = Path("/tmp")
    runner: str = "workers.node.house_runner:runner"  # what does the tasks
    lease_s: float = _above(120.0)  # without a heartbeat, then the task is somebody else's
    heartbeat_s: float = _above(20.0)
    sticky_s: float = 2.0  # a task this long takes another of its house with it
    retry_delay_s: float = 10.0  # times the number of the attempt
    storage_patience_s: float = 600.0  # a step waits so long for storage that does not answer
    breaker_s: int = _least(30, 1)  # claims stop this long after a storage failure
    cooldown_s: float = 600.0  # an unhealthy worker claims nothing for this long
    grace_s: float = _above(600.0)  # from TERM until every task is done or given back
    min_free_mb: int = _least(500, 0)  # scratch space a worker wants before it starts
    window_per_slot: int = _least(4, 1)  # tasks in flight per stage and slot
    window_min: int = _least(128, 1)  # tasks in flight per stage, at least
    resend_s: float = _above(60.0)  # a message unclaimed for so long may be lost
    webhook: Secret = field(
        default_factory=lambda: Secret("")
    )  # gets a POST when a job ends or pauses
    token: Secret = field(default_factory=Secret)  # says which user gives orders
    metrics_port: int = _least(0, 0)  # of the coordinator's Prometheus endpoint, 0 = off
    limits: Limits = field(default_factory=Limits)

    def __post_init__(self) -> None:
        _check_config(self, _PREFIX)
        unknown = sorted(set(self.queues) - set(QUEUES))
        if unknown:
            hint = f"of {', '.join(QUEUES)}"
            raise BadInput("environment", f"{_PREFIX}QUEUES", f"no queue {unknown[0]!r}", hint=hint)

    @property
    def preemption_file(self) -> Path:
        """While this file exists, the worker's tasks are returned to the ledger immediately."""
        return self.scratch / f"pbrs-{self.worker}.preempted"

    @property
    def leaving_file(self) -> Path:
        """While this file exists, the worker finishes its tasks and takes no more."""
        return self.scratch / f"pbrs-{self.worker}.leaving"

    @property
    def heartbeat_file(self) -> Path:
        """Touched by the worker's main loop; its age is the liveness probe."""
        return alive_file(self.scratch, self.worker)


def config_from_environment(environment: Mapping[str, str] | None = None) -> FarmConfig:
    """FarmConfig from PBRS_STORE, PBRS_REDIS_URL (and password), PBRS_FARM_<FIELD>; BadInput."""
    env = dict(os.environ if environment is None else environment)
    settings = settings_from_environment(env)
    password = value_or_file(env, "PBRS_REDIS_PASSWORD")
    # PBRS_FARM_LIMITS_* are fields of Limits, the other PBRS_FARM_* of FarmConfig.
    limits = f"{_PREFIX}LIMITS_"
    of_limits = {n: text for n, text in env.items() if n.startswith(limits)}
    of_farm = {n: text for n, text in env.items() if n.startswith(_PREFIX) and n not in of_limits}
    values: dict[str, Any] = {"worker": platform.node()} | _read_setting(
        FarmConfig, of_farm, _PREFIX
    )
    # Looking for a temporary folder fails where none can be written, as in a read-only container.
    if "scratch" not in values:
        values["scratch"] = Path(tempfile.gettempdir())
    return FarmConfig(
        **values,
        redis_url=Secret(_with_password(settings.redis_url.reveal(), password)),
        store_url=env.get("PBRS_STORE", ""),
        store=settings.store,
        webhook=Secret(value_or_file(env, "PBRS_WEBHOOK")),
        token=Secret(value_or_file(env, "PBRS_TOKEN")),
        limits=Limits(**_read_setting(Limits, of_limits, limits)),
    )


def make_scratch(config: FarmConfig) -> None:
    """Create the scratch folder if needed, at a process's start; MachineFailed if it is not writable."""
    # A file in its place, a read-only folder, another user's folder: one line for each.
    fault = ""
    try:
        config.scratch.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        fault = error.strerror or type(error).__name__
    if not fault and not os.access(config.scratch, os.W_OK | os.X_OK):
        fault = "cannot be written"
    if fault:
        hint = "PBRS_FARM_SCRATCH names another folder"
        raise MachineFailed(f"{config.scratch}: {fault}", hint=hint)


# Type of a field -> its value from text.
_READERS: Final[Mapping[str, Callable[[str], object]]] = {
    "int": int,
    "float": float,
    "str": str,
    "Path": Path,
    "tuple[str, ...]": lambda text: tuple(x for x in text.split(",") if x),
}
# Settings that had another name once -> their field.
_FORMER_NAMES: Final = {"beat_s": "heartbeat_s", "forgive_s": "cooldown_s"}
# Fields that other variables set.
_ELSEWHERE: Final = {"redis_url", "store_url", "store", "limits", "webhook", "token"}


def _read_setting(
    cls: type[FarmConfig | Limits], environment: Mapping[str, str], prefix: str
) -> dict[str, Any]:
    """Field -> value parsed from its variable; BadInput for an invalid one."""
    # Read each variable by the type of its field; an unknown one is an error: no slip passes.
    kinds = {f.name: str(f.type) for f in fields(cls) if f.name not in _ELSEWHERE}
    values = {}
    for name, text in environment.items():
        setting = name.removeprefix(prefix).lower()
        setting = _FORMER_NAMES.get(setting, setting)
        kind = kinds.get(setting)
        if kind is None:
            raise BadInput(
                "environment", name, "no such setting", hint="docs/farm/settings.md lists them"
            )
        try:
            values[setting] = _READERS[kind](text)
        except ValueError:
            raise BadInput("environment", name, f"{text!r} is not of type {kind}") from None
    return values


def _check_config(config: FarmConfig | Limits, prefix: str) -> None:
    # NaN fails the comparison too.
    for f in fields(config):
        value, above = getattr(config, f.name), f.metadata.get("above")
        if above is not None and not value > above:
            name = f"{prefix}{f.name.upper()}"
            raise BadInput("environment", name, f"expected more than {above:g}, got {value}")


def _with_password(url: str, password: str) -> str:
    parts = urlsplit(url)
    if not password or parts.password:
        return url
    # Put it between the user's name and the host.
    host = parts.netloc.rpartition("@")[2]
    netloc = f"{parts.username or ''}:{quote(password, safe='')}@{host}"
    return urlunsplit(parts._replace(netloc=netloc))


def shown_url(url: str) -> str:
    """A URL without user and password, for messages; a query is kept, so put no secret there."""
    parts = urlsplit(url)
    return urlunsplit(parts._replace(netloc=parts.netloc.rpartition("@")[2]))
