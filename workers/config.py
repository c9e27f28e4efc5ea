"""How this process takes part in a farm: Settings plus limits, from the environment.

Effects: reads environment variables and secret files, through pbrs_farm.settings.
"""

from __future__ import annotations

import os
import platform
import tempfile
from collections.abc import Mapping
from pathlib import Path
from urllib.parse import quote, urlsplit, urlunsplit

from pydantic import BaseModel, ConfigDict, Field, SecretStr, ValidationError

from pbrs_farm.errors import BadInput
from pbrs_farm.settings import settings_from_environment
from pbrs_farm.store.url import StoreSettings
from workers.alive import alive_file

_PREFIX = "PBRS_FARM_"


class Limits(BaseModel):
    """When a renderer is killed. A stage's deadline is for one task of it."""

    model_config = ConfigDict(frozen=True, extra="forbid")
    geometry_s: float = Field(1800.0, gt=0)
    gl_s: float = Field(1800.0, gt=0)
    light_s: float = Field(4 * 3600.0, gt=0)
    reduce_s: float = Field(3600.0, gt=0)
    silence_s: float = Field(1800.0, gt=0, description="without a step or a line in the log")
    memory_mb: int = Field(0, ge=0, description="of one renderer; 0 = share of the machine's")
    tasks_per_renderer: int = Field(2000, ge=1, description="then it starts afresh")

    def deadline_s(self, stage: str) -> float:
        """Seconds a task of the stage may take."""
        return {"geometry": self.geometry_s, "gl": self.gl_s, "light": self.light_s}.get(
            stage, self.reduce_s
        )


class FarmConfig(BaseModel):
    """Everything a coordinator, a worker or a client needs to know."""

    model_config = ConfigDict(frozen=True, extra="forbid")
    redis_url: SecretStr
    redis_ca: str = Field("", description="file of the CA for rediss://; empty = the system's")
    store_url: str = ""
    store: StoreSettings = StoreSettings()
    prefix: str = "pbrs:"
    worker: str = ""
    slots: int = Field(1, ge=1)
    queues: tuple[str, ...] = ()
    scratch: Path = Path("/tmp")
    runner: str = "workers.houses:runner"
    lease_s: float = Field(120.0, gt=0)
    beat_s: float = Field(20.0, gt=0)
    sticky_s: float = Field(2.0, description="a task this long takes another of its house with it")
    retry_delay_s: float = Field(10.0, ge=0)
    storage_patience_s: float = Field(600.0, ge=0)
    breaker_s: int = Field(30, ge=1, description="claims stop this long after a storage failure")
    forgive_s: float = Field(600.0, description="a worker suspected of being sick rests this long")
    grace_s: float = Field(600.0, gt=0, description="from TERM to having handed everything back")
    min_free_mb: int = Field(500, ge=0, description="scratch space a worker wants before it starts")
    window_per_slot: int = Field(4, ge=1)
    window_min: int = Field(128, ge=1, description="tasks in flight per stage, at least")
    resend_s: float = Field(60.0, gt=0)
    metrics_port: int = Field(
        0, ge=0, description="of the coordinator's Prometheus endpoint; 0 = off"
    )
    limits: Limits = Limits()

    @property
    def handback_file(self) -> Path:
        """While this file exists the worker's tasks are given back to the ledger at once."""
        return self.scratch / f"pbrs-{self.worker}.handback"

    @property
    def heartbeat_file(self) -> Path:
        """Touched by the worker's main loop; its age is the liveness probe."""
        return alive_file(self.scratch, self.worker)


def config_from_environment(environment: Mapping[str, str] | None = None) -> FarmConfig:
    """FarmConfig from PBRS_STORE, PBRS_REDIS_URL and PBRS_FARM_<FIELD> (PBRS_FARM_LIMITS_<FIELD>).

    PBRS_REDIS_PASSWORD(_FILE) is put into the URL when that has none. Raises BadInput.
    """
    env = dict(os.environ if environment is None else environment)
    settings = settings_from_environment(env)
    fields: dict[str, object] = {"worker": platform.node(), "scratch": tempfile.gettempdir()}
    limits: dict[str, str] = {}
    for name, text in env.items():
        if name.startswith(f"{_PREFIX}LIMITS_"):
            limits[name.removeprefix(f"{_PREFIX}LIMITS_").lower()] = text
        elif name.startswith(_PREFIX):
            fields[name.removeprefix(_PREFIX).lower()] = text
    if isinstance(fields.get("queues"), str):
        fields["queues"] = tuple(q for q in str(fields["queues"]).split(",") if q)
    url = _with_password(settings.redis_url.get_secret_value(), _secret(env, "PBRS_REDIS_PASSWORD"))
    try:
        return FarmConfig.model_validate(
            fields
            | {
                "redis_url": url,
                "store_url": env.get("PBRS_STORE", ""),
                "store": settings.store,
                "limits": limits,
            }
        )
    except ValidationError as error:
        first = error.errors()[0]
        name = "_".join(str(p) for p in first["loc"]).upper()
        raise BadInput("environment", f"{_PREFIX}{name}", str(first["msg"])) from None


def _secret(env: Mapping[str, str], name: str) -> str:
    file = env.get(f"{name}_FILE")
    if not file:
        return env.get(name, "")
    try:
        return Path(file).read_text(encoding="utf-8").strip()
    except (OSError, UnicodeDecodeError) as error:
        raise BadInput(file, f"{name}_FILE", f"cannot be read: {error}") from None


def _with_password(url: str, password: str) -> str:
    parts = urlsplit(url)
    if not password or parts.password:
        return url
    host = parts.netloc.rpartition("@")[2]
    netloc = f"{parts.username or ''}:{quote(password, safe='')}@{host}"
    return urlunsplit(parts._replace(netloc=netloc))


def shown_url(url: str) -> str:
    """A URL without its password, for messages."""
    parts = urlsplit(url)
    return urlunsplit(parts._replace(netloc=parts.netloc.rpartition("@")[2]))
