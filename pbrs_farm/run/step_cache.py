"""A step is done when its marker says so: run a function at most once, files first, marker last.

Effects: the store's. The marker holds the digest of everything the step depends on; present and
equal means done, different means the step runs again, the old marker removed first (rule 4).
"""

from __future__ import annotations

import os
import platform
import time
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from pbrs_farm.core import keys
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.layers import LAYER, LAYERS, layers_in_digest
from pbrs_farm.core.plugins import marks_in_digest, plugins
from pbrs_farm.core.recipe import CAMERA_SOURCES, CameraFields, Recipe
from pbrs_farm.formats.marker import Marker, StoredFile, read_marker
from pbrs_farm.prepare import passes
from pbrs_farm.prepare.source_ref import SourceRef
from pbrs_farm.regular_files import (
    MAX_TEXT_BYTES,
    fault_of,
    read_regular,
    text_from_bytes,
    text_given,
)
from pbrs_farm.run import plan
from pbrs_farm.run.house_cache import HouseCache
from pbrs_farm.sample.camera_source import source_of
from pbrs_farm.store.object_store import Store, put_done, replace_marker
from pbrs_farm.transport.scene_tables.material_rows import max_albedo


def unheard(_share: float) -> None:
    """Nobody hears how far a step is."""


@dataclass(frozen=True, slots=True)
class Work:
    """Everything a step may need."""

    store: Store
    recipe: Recipe
    house_id: str
    house_cache: HouseCache
    source: SourceRef | None = None  # only the house step reads it
    view_id: str | None = None  # of a step of a view
    layers: tuple[str, ...] = ()  # optional layers to write beside the present ones
    drops_radiance: bool = False  # remove radiance.exr once the view is finished
    inputs: Mapping[str, str] = field(default_factory=dict)  # step it reads -> digest of its marker
    digest: str = ""  # of the step under way
    tell_share: Callable[[float], None] = unheard  # called with the share done of a long step

    def layers_of(self, step: str) -> tuple[str, ...]:
        """The optional layers that concern a step; for `light` those made of light."""
        written_by = {"light": "develop"}.get(step, step)
        return tuple(name for name in self.layers if LAYER[name].step == written_by)


@dataclass(frozen=True, slots=True)
class StepOutput:
    """Result of a step's function."""

    files: Mapping[str, bytes]  # by name below the house's or the view's folder
    facts: dict[str, Any] = field(default_factory=dict)  # of its marker
    unfinished: str = ""  # key of the step's checkpoint, to remove once it is done


@dataclass(frozen=True, slots=True)
class Outcome:
    """Result of a step."""

    marker: Marker
    was_done: bool  # it was there already


def run_unless_done(
    name: str, work: Work, function: Callable[[Work], StepOutput], *, attempt: int = 1
) -> Outcome:
    """Do one step unless its marker says it is done; PbrsError, nothing half-done is left."""
    found = _looked_up(name, work)
    key, old, is_valid, work = found.key, found.old, found.is_valid, found.work
    if old is not None and found.is_done and not _must_trace_again(old, work):
        return Outcome(old, was_done=True)
    # Remove the marker before its files change, so that a crash leaves an unfinished step. Valid
    # files outlast a step that fails to add to them.
    if old is not None and not is_valid:
        work.store.delete(key)

    # Put the files, then the marker: in one write if the store packs them.
    started = time.perf_counter()
    output = function(work)
    if is_valid:
        work.store.delete(key)
    data = {_file_key(work, name, file): output.files[file] for file in sorted(output.files)}
    files = tuple(StoredFile(key=k, n_bytes=len(d), sha256=keys.sha256(d)) for k, d in data.items())
    if old is not None:
        _remove_stale(work, old, files)
    marker = Marker(
        step=name,
        house_id=work.house_id,
        view_id=work.view_id if plan.STEPS[name].per_view else None,
        digest=work.digest,
        files=files,
        facts=output.facts,
        seconds=round(time.perf_counter() - started, 3),
        worker=f"{platform.node()}/{os.getpid()}",
        attempt=attempt,
        finished_utc=datetime.now(UTC).isoformat(timespec="seconds"),
    )
    put_done(work.store, key, marker.json_bytes(), data)
    if output.unfinished:
        work.store.delete(output.unfinished)
    return Outcome(marker, was_done=False)


@dataclass(frozen=True, slots=True)
class _LookedUp:
    """A step's marker, compared with the digest of all inputs."""

    key: str  # of the marker
    old: Marker | None
    is_valid: bool  # only layers may be missing
    work: Work  # with inputs, digest, and requested and present layers of the step

    @property
    def is_done(self) -> bool:
        return self.old is not None and self.old.digest == self.work.digest


def _looked_up(name: str, work: Work) -> _LookedUp:
    """Compare the digest of all inputs with that of the present marker; BadInput as run_unless_done."""
    step = plan.STEPS[name]
    view_id = work.view_id if step.per_view else None
    inputs = _inputs(step, work)

    def digest_of(work: Work) -> str:
        extra = extra_inputs(name, work)
        return plan.step_digest(step, work.recipe, work.house_id, view_id, inputs, extra)

    key = keys.marker_key(work.house_id, name, view_id)
    old = read_marker(work.store, key)
    # Keep the present layers if nothing else has changed.
    written = replace(work, layers=_written_layers(old))
    is_valid = old is not None and old.digest == digest_of(written)
    if is_valid:
        work = replace(work, layers=_union(work.layers, written.layers))
    return _LookedUp(key, old, is_valid, replace(work, inputs=inputs, digest=digest_of(work)))


def _must_trace_again(old: Marker, work: Work) -> bool:
    """True if light was dropped that the pictures need, since their recipe or layers have changed."""
    is_dropped = old.step == "light" and not old.files
    return is_dropped and not _looked_up("develop", work).is_done


def drop_radiance(work: Work) -> None:
    """Remove the light of a view whose pictures are done, marker first; its step stays done."""
    key = keys.marker_key(work.house_id, "light", work.view_id)
    marker = read_marker(work.store, key)
    if marker is None or not _looked_up("develop", work).is_done:
        return
    if marker.files:
        replace_marker(work.store, key, marker.model_copy(update={"files": ()}).json_bytes())
    work.store.delete(keys.view_key(work.house_id, work.view_id or "", LAYER["radiance"].file))


def _written_layers(marker: Marker | None) -> tuple[str, ...]:
    """The optional layers that a step of a view was done with."""
    if marker is None:
        return ()
    return tuple(name for name in marker.facts.get("layers", ()) if name in LAYER)


def _union(asked: tuple[str, ...], written: tuple[str, ...]) -> tuple[str, ...]:
    """All of both, in the order of what holds the other, else of the table of layers."""
    for layers in (written, asked):
        if set(layers) >= {*asked, *written}:
            return layers
    return tuple(x.name for x in LAYERS if x.name in {*asked, *written})


def _inputs(step: plan.Step, work: Work) -> dict[str, str]:
    """Step -> digest of its marker, of the steps that step reads; BadInput where it needs one."""
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


def extra_inputs(name: str, work: Work) -> object:
    """Inputs of a step beside recipe fields and other steps."""
    if name == "house":
        return passes.step_depends(required_source(work), work.recipe)
    if name == "truth":
        labels = work.layers_of("truth")
        plugin_layers = [layer for layer in labels if layer in plugins("layers")]
        marks = [*labels, *marks_in_digest("layers", plugin_layers)]
        return [*marks, *layers_in_digest(labels, max_albedo(work.recipe))]
    if name == "light":
        blurred = work.recipe.blur.shutter_s > 0
        changes = ["diffuse"] * bool(work.layers_of("light")) + ["moving objects blur"] * blurred
        # Metropolis too: its direct light and its guides follow surfaces.
        if work.recipe.shot(work.view_id or "").frame is not None:
            changes.append("samples stay on surfaces")
        return changes or None
    if name == "develop":
        extra, shot = _extra_of_develop(work), work.recipe.shot(work.view_id or "")
        # Stills of a rig share its drawn camera; once only a camera called right did.
        is_alike = shot.frame is not None or shot.eye in ("", "right")
        return extra if is_alike else ["camera of the rig", extra]
    if name == "cameras":
        chosen = _extra_of_cameras(work.recipe.cameras)
        # Stereo pairs tell of their rig.
        return ["rig", chosen] if work.recipe.cameras.stereo_m > 0 else chosen
    return None


def _extra_of_cameras(fields: CameraFields) -> str | None:
    marks = CAMERA_SOURCES.marks([fields.source_name])
    if source_of(fields).is_file:
        marks.append(keys.sha256(camera_file_text(fields).encode()))
    return " ".join(marks) or None


def _extra_of_develop(work: Work) -> object:
    pictures = work.recipe.tone.pictures
    marks = marks_in_digest("pictures", filter(None, pictures.split(":"))) if pictures else None
    layers = work.layers_of("develop")
    if not layers:
        return marks
    # It reads the label albedo.png, too.
    label = layers_in_digest(("albedo",), max_albedo(work.recipe))
    return [marks, *layers, *label, plan.STEPS["truth"].version]


def camera_file_text(fields: CameraFields) -> str:
    """The user's camera file; of a published one, with its names; BadInput if it cannot be read."""
    path = Path(fields.file)
    names = path.with_name("room_camera_name.txt")
    try:
        text = text_given(path)
        if path.name != "room_camera.txt" or not names.exists():
            return text
        from pbrs_farm.sample.room_camera_file import with_names

        return with_names(text, text_from_bytes(read_regular(names, MAX_TEXT_BYTES)), str(names))
    except OSError as error:
        raise BadInput(fields.file or "cameras.file", "", fault_of(error)) from None
    except UnicodeDecodeError:
        raise BadInput(fields.file, "", "is not UTF-8 text") from None


def required_source(work: Work) -> SourceRef:
    """The house's source; BadInput if the work has none."""
    if work.source is None:
        raise BadInput(work.house_id, "", "the house step needs the house's source")
    return work.source


def _file_key(work: Work, step: str, file: str) -> str:
    if plan.STEPS[step].per_view:
        return keys.view_key(work.house_id, work.view_id or "", file)
    return keys.house_key(work.house_id, file)


def _remove_stale(work: Work, old: Marker, files: Collection[StoredFile]) -> None:
    """Remove what a step wrote for other inputs and does not write now: no marker lists it."""
    for stale in {file.key for file in old.files} - {file.key for file in files}:
        place = keys.parse_house_key(stale)
        if place and not place.step and (place.house, place.view) == (work.house_id, old.view_id):
            work.store.delete(stale)
