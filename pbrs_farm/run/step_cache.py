"""A step is done when its marker says so: run a function at most once, files first, marker last.

Effects: the store's. The marker holds the digest of everything the step depends on; present and
equal means done, different means the step runs again, the old marker removed first (rule 4).
"""

from __future__ import annotations

import os
import platform
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from pbrs_farm.core import keys
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.recipe import CameraFields, Recipe
from pbrs_farm.formats.marker import Marker, StoredFile, read_marker
from pbrs_farm.read.source import SourceRef
from pbrs_farm.run import plan
from pbrs_farm.run.house_cache import HouseCache
from pbrs_farm.store.interface import Store


@dataclass(frozen=True, slots=True)
class Work:
    """Everything a step may need. source: only the house step reads it. layers: optional ones."""

    store: Store
    recipe: Recipe
    house_id: str
    house_cache: HouseCache
    source: SourceRef | None = None
    view_id: str | None = None
    layers: tuple[str, ...] = ()
    inputs: Mapping[str, str] = field(default_factory=dict)  # step it reads -> digest of its marker


@dataclass(frozen=True, slots=True)
class Made:
    """What a step made: files by name (relative to the house or view folder) and its facts."""

    files: Mapping[str, bytes]
    facts: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Outcome:
    """A step's marker, and whether it was there already."""

    marker: Marker
    was_done: bool


def run_marked(
    name: str, work: Work, function: Callable[[Work], Made], *, attempt: int = 1
) -> Outcome:
    """Do one step unless its marker says it is done. Raises PbrsError; nothing half-done is left.

    Raises BadInput if a step before it has not been done.
    """
    step = plan.STEPS[name]
    view_id = work.view_id if step.per_view else None
    inputs = _inputs(step, work)
    digest = plan.step_digest(step, work.recipe, work.house_id, view_id, inputs, _extra(name, work))
    key = keys.marker_key(work.house_id, name, view_id)
    old = read_marker(work.store, key)
    if old is not None and old.digest == digest:
        return Outcome(old, was_done=True)
    if old is not None:
        work.store.delete(key)

    started = time.perf_counter()
    made = function(replace(work, inputs=inputs))
    files = tuple(_put(work, name, file, made.files[file]) for file in sorted(made.files))
    marker = Marker(
        step=name,
        house_id=work.house_id,
        view_id=view_id,
        digest=digest,
        files=files,
        facts=made.facts,
        seconds=round(time.perf_counter() - started, 3),
        worker=f"{platform.node()}/{os.getpid()}",
        attempt=attempt,
        finished_utc=datetime.now(UTC).isoformat(timespec="seconds"),
    )
    work.store.put_if_absent(key, marker.json_bytes())
    return Outcome(marker, was_done=False)


def _inputs(step: plan.Step, work: Work) -> dict[str, str]:
    digests = {}
    for before in step.after:
        per_view = plan.STEPS[before].per_view
        key = keys.marker_key(work.house_id, before, work.view_id if per_view else None)
        marker = read_marker(work.store, key)
        if marker is not None:
            digests[before] = marker.digest
        elif not per_view or before in step.needs:
            raise BadInput(key, "", f"{step.name} needs the step {before} first")
    return digests


def _extra(name: str, work: Work) -> object:
    """What a step depends on beside recipe fields and other steps."""
    if name == "house":
        return required_source(work).fingerprint
    if name == "truth":
        return work.layers
    if name == "cameras" and work.recipe.cameras.source == "file":
        return keys.sha256(camera_file_text(work.recipe.cameras).encode())
    return None


def camera_file_text(fields: CameraFields) -> str:
    """The user's camera file; BadInput if it cannot be read."""
    try:
        return Path(fields.file).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise BadInput(fields.file or "cameras.file", "", f"cannot be read: {error}") from None


def required_source(work: Work) -> SourceRef:
    if work.source is None:
        raise BadInput(work.house_id, "", "the house step needs the house's source")
    return work.source


def _put(work: Work, step: str, file: str, data: bytes) -> StoredFile:
    if plan.STEPS[step].per_view:
        key = keys.view_key(work.house_id, work.view_id or "", file)
    else:
        key = keys.house_key(work.house_id, file)
    work.store.put(key, data)
    return StoredFile(key=key, n_bytes=len(data), sha256=keys.sha256(data))
