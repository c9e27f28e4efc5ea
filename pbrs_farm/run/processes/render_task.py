"""Tasks of a render process of a local run, and its events; values, no effects."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, field
from functools import lru_cache
from typing import Any, Literal

from pydantic import TypeAdapter

from pbrs_farm.core.recipe import Recipe
from pbrs_farm.prepare.source_ref import SourceRef
from pbrs_farm.store.s3 import S3Settings
from pbrs_farm.store.secret import Secret
from pbrs_farm.store.url import StoreSettings


@dataclass(frozen=True, slots=True)
class RenderTask:
    """Steps of one house or one view, done in order by one process."""

    house_id: str
    steps: tuple[str, ...]
    source: SourceRef
    view_id: str | None = None
    layers: tuple[str, ...] = ()
    drops_radiance: bool = False


@dataclass(frozen=True, slots=True)
class Setting:
    """Settings that all tasks of a run share."""

    store_url: str
    recipe: Recipe
    n_threads: int
    debug: bool = False  # tracebacks travel with failures
    store: StoreSettings = field(default_factory=StoreSettings)
    runner: str = "pbrs_farm.run.steps:run_step"  # does a step; tests put their own


@dataclass(frozen=True, slots=True)
class Event:
    """Something that happened to a step, or the end of a task."""

    # done: made now; kept: done before; end: of a task. planned: the views of a house to make,
    # known after its cameras and without dark rooms. under_way: facts hold the finished "share" of
    # a long step. lacking: the machine cannot do the step, for the reason in message.
    kind: Literal["begin", "done", "kept", "failed", "lacking", "end", "planned", "under_way"]
    house_id: str
    view_id: str | None
    step: str
    seconds: float = 0.0
    message: str = ""
    facts: dict[str, Any] = field(default_factory=dict)  # of the step's marker
    peak_mb: float = 0.0  # largest resident memory of the process so far


_TASK = TypeAdapter(RenderTask)
# Fields hidden by str(): revealed for the pipe to our own child, never for a file.
_SECRETS = ("secret_key", "session_token")


def line_from_task(setting: Setting, task: RenderTask) -> bytes:
    """A line for task_from_line, with the store's secret keys: for a pipe only, no log, no file."""
    fields = {
        name: getattr(setting, name) for name in ("store_url", "n_threads", "debug", "runner")
    }
    row = fields | {"recipe": setting.recipe.model_dump_json(), "store": asdict(setting.store)}
    text = json.dumps(row, default=Secret.reveal)
    return json.dumps([text, _TASK.dump_json(task).decode()]).encode()


def task_from_line(line: bytes) -> tuple[Setting, RenderTask]:
    """The setting and the task of a line of line_from_task."""
    setting, task = json.loads(line)
    return _setting_from_text(setting), _TASK.validate_json(task)


@lru_cache(maxsize=1)
def _setting_from_text(text: str) -> Setting:
    row = json.loads(text)
    store = row.pop("store")
    s3 = store["s3"] | {name: Secret(store["s3"][name]) for name in _SECRETS}
    recipe = Recipe.model_validate_json(row.pop("recipe"))
    return Setting(
        **row, recipe=recipe, store=StoreSettings(store["fsync"], S3Settings(**s3), store["layout"])
    )
