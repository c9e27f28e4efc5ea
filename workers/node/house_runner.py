"""The farm's real runner: tasks as steps of run/steps.py, as in a local run, with a scratch file for a source."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

from pbrs_farm.core import keys
from pbrs_farm.core.checked_json import checked
from pbrs_farm.core.errors import BadHouse, MachineFailed, ObjectMissing
from pbrs_farm.formats.marker import read_marker
from pbrs_farm.prepare.dress_catalogue import fetch_catalogue
from pbrs_farm.prepare.passes import uses_catalogue
from pbrs_farm.prepare.source_ref import SourceRef
from pbrs_farm.run import plan
from pbrs_farm.run.house_cache import HouseCache
from pbrs_farm.run.output_root import finish_house
from pbrs_farm.run.plan import view_steps
from pbrs_farm.run.request import Wanted, wanted_of
from pbrs_farm.run.run_task import limit_threads
from pbrs_farm.run.step_cache import Work
from pbrs_farm.run.steps import run_step
from pbrs_farm.store import Store, store_from_url
from pbrs_farm.store.laid_out import LaidOutStore, one_task
from pbrs_farm.store.retrying import RetryingStore
from workers.config import FarmConfig
from workers.house_files import (
    FOLDER,
    fill_cache,
    has_own_furniture,
    is_left_in_place,
    local_catalogue,
)
from workers.ids import GEOMETRY, GL, JOB, LIGHT, REDUCE, SHARD, job_key
from workers.job import JobSpec
from workers.node.merging import merge_job, merge_shard
from workers.node.view_batches import batches_from_views
from workers.runner import OnText, Result, Survey, TaskRequest

_LIGHT_STEPS: Final = ("light", "develop")  # of the stage light


def runner(config: FarmConfig, on_waiting: OnText) -> HouseRunner:
    """The runner of a worker with its share of the cores; on_waiting: called while the store is away."""
    store = store_from_url(config.store_url, config.store)

    def with_patience(inner: Store) -> Store:
        return RetryingStore(inner, config.storage_patience_s, on_waiting)

    # Retries are below the layout, which may query the store twice for a key.
    if isinstance(store, LaidOutStore):
        patient: Store = store.around(with_patience)
    else:
        patient = with_patience(store)
    return HouseRunner(patient, n_threads=max(1, (os.cpu_count() or 1) // config.slots))


@dataclass(frozen=True, slots=True)
class _Task:
    """A task that runs."""

    store: Store
    request: TaskRequest
    spec: JobSpec
    on_step: OnText


class HouseRunner:
    """Implements workers.runner.StepRunner: the steps of run/steps.py over the farm's store.

    It keeps its last house loaded, so tasks of one house should be consecutive. Steps with markers are not
    repeated; a killed run resumes. store: wrapped by `runner` to wait while storage does not answer. n_threads:
    cores for one task.
    """

    def __init__(self, store: Store, *, n_threads: int) -> None:
        self._store = store
        self._n_threads = n_threads
        self._house_cache = HouseCache()
        self._lacks_opengl = ""  # why this machine makes no pictures of OpenGL, once it is known
        self._spec: Callable[[str], JobSpec] = lru_cache(maxsize=4)(self._read_spec)

    def run(self, request: TaskRequest, on_step: OnText) -> Result:
        """Run one task; raises the errors of its steps.

        on_step: called with each step's name when it begins, for the log and the watchdog. Finished steps are not
        repeated. The errors are those of the package's tree; `class_of` classifies them.
        """
        spec = self._spec(request.job_id)
        with one_task(self._store, reads_whole=request.stage in (GL, LIGHT)) as store:
            return self._run(_Task(store, request, spec, on_step))

    def _run(self, task: _Task) -> Result:
        request, spec, on_step = task.request, task.spec, task.on_step
        if request.stage == GEOMETRY:
            return self._geometry(task)
        if request.stage in (GL, LIGHT):
            # Light's inputs from the house: the first batch that needs them makes them.
            if request.stage == LIGHT:
                for step in plan.needed_of_house("light", request.house):
                    self._step(task, step)
            for view in request.views:
                for step in steps_of_stage(spec, request.stage):
                    self._view_step(task, step, view)
        elif request.stage == REDUCE:
            on_step("finish")
            finish_house(task.store, request.house)
            if spec.reference:
                self._pack_histograms(task)
        elif request.stage == SHARD:
            merge_shard(self._store, spec, int(request.unit.removeprefix("s")), on_step)
        elif request.stage == JOB:
            # Selection looks for its views in the root's manifest.
            merge_job(self._store, spec, on_step)
            if spec.reference:
                self._select(spec, on_step)
        left_out = self._lacks_opengl if request.stage == GL else ""
        return Result(n_views=len(request.views), left_out=left_out)

    def survey(self, spec: JobSpec, house: str, done: frozenset[str]) -> Survey:
        """Progress of a house by its markers' names (`done_steps`) and its cameras, if there are some."""
        # Without its cameras nobody knows the views of the house.
        if not done.issuperset(steps_before_views(spec, house)):
            return Survey()
        batches = self._batches(spec, house)
        units: dict[str, str] = {}
        for number, views in enumerate(batches):
            units[str(number)] = _first_stage_missing(spec, views, done)
        finished = all(stage == "" for stage in units.values())
        has_manifest = self._store.head(keys.house_key(house, keys.MANIFEST)) is not None
        return Survey(batches=batches, missing=units, reduced=finished and has_manifest)

    def _geometry(self, task: _Task) -> Result:
        spec, house = task.spec, task.request.house
        with TemporaryDirectory(prefix="pbrs-source-") as folder:
            source = self._source(task.request.source, Path(folder))
            is_dressed = uses_catalogue(source, spec.recipe)
            fill_cache(self._store, with_furniture=is_dressed or has_own_furniture(source))
            sized = task
            if is_dressed:
                # Look for the furniture before the house is read: another worker may have it.
                recipe = local_catalogue(self._store, spec.recipe)
                fetch_catalogue(recipe.dress)
                sized = replace(task, spec=spec.model_copy(update={"recipe": recipe}))
            for step in steps_before_views(spec, house):
                self._step(sized if step == "house" else task, step, source=source)
        return Result(batches=self._batches(spec, house))

    def _pack_histograms(self, task: _Task) -> None:
        """The house's histograms in one object, so that the job's selection reads one a house."""
        from pbrs_farm.core.lighting import Mode
        from pbrs_farm.curate.selection_run import house_pack

        task.on_step("histograms")
        mode = Mode(task.spec.recipe.selection.score_mode)
        house_pack(task.store, task.request.house, mode)

    def _select(self, spec: JobSpec, on_step: OnText) -> None:
        """Selection over the views there are; a run of the job's name, so that it adds up."""
        from pbrs_farm.curate.selection_run import select
        from pbrs_farm.selection.reference_set import reference_from_bytes

        reference = reference_from_bytes(self._store.get(spec.reference), spec.reference)
        select(
            self._store,
            reference,
            spec.recipe.selection,
            reference_name=spec.reference,
            run=spec.job_id,
            progress=lambda done, n: on_step(f"select {done} of {n}"),
        )

    def _batches(self, spec: JobSpec, house: str) -> tuple[tuple[str, ...], ...]:
        # The cameras step's marker lists the views: id, room, score.
        marker = read_marker(self._store, keys.marker_key(house, "cameras"))
        if marker is None:
            return ()
        rows = [(str(v), str(room), float(score)) for v, room, score in marker.facts["views"]]
        # Leave out dark rooms where the recipe says so, as a run on one machine does.
        if plan.leaves_out_dark_rooms(spec.recipe, want_of(spec), house):
            illuminance = read_marker(self._store, keys.marker_key(house, "illuminance"))
            lux = illuminance.facts.get("floor_lux", {}) if illuminance is not None else {}
            rows, _left_out = plan.lit_views(rows, lux, spec.recipe.selection.min_room_lx)
        rooms = {view: room for view, room, _score in rows}
        chosen = plan.chosen_views(rows, spec.n_views, spec.recipe)
        placed = [(v, rooms[v]) for v in chosen]
        return batches_from_views(placed, spec.seconds_per_view, spec.min_batches)

    def _view_step(self, task: _Task, step: str, view: str) -> None:
        """A step of a view; OpenGL's pictures, if others are wanted, are left out where it is missing."""
        may_lack = step in plan.OPENGL_STEPS and plan.has_light(want_of(task.spec))
        if may_lack and self._lacks_opengl:
            return
        try:
            self._step(task, step, view=view)
        except MachineFailed as error:
            if not may_lack:
                raise
            self._lacks_opengl = str(error)

    def _step(
        self, task: _Task, step: str, *, view: str | None = None, source: SourceRef | None = None
    ) -> None:
        task.on_step(step if view is None else f"{step} {view}")
        limit_threads(step, self._n_threads)
        work = Work(
            store=task.store,
            recipe=task.spec.recipe,
            house_id=task.request.house,
            house_cache=self._house_cache,
            source=source,
            view_id=view,
            layers=task.spec.layers,
            drops_radiance=task.spec.drop_radiance,
        )
        run_step(step, work, attempt=task.request.attempt)

    def _source(self, text: str, folder: Path) -> SourceRef:
        """The house's source; when it is kept in the store, on scratch under its own name."""
        source = SourceRef.model_validate_json(text)
        if not source.location.startswith(FOLDER):
            # Not uploaded: this worker sees it at the path it was submitted by, or cannot do it.
            if is_left_in_place(source) and not source.given.path.exists():
                raise MachineFailed(
                    f"this worker cannot read {source.location}",
                    hint="such sources are not uploaded: mount them at the same path on all workers",
                )
            return source
        name = source.location.rpartition("/")[2]
        # Uploaded: write it under its own name, which readers go by.
        data = self._store.get(source.location)
        if keys.sha256(data) != source.sha256:
            raise BadHouse(source.location, "", "changed since it was submitted")
        path = folder / name
        path.write_bytes(data)
        return source.model_copy(update={"location": str(path)})

    def _read_spec(self, job: str) -> JobSpec:
        try:
            return checked(JobSpec, self._store.get(job_key(job)), job_key(job))
        except ObjectMissing:
            hint = "does PBRS_STORE differ?"
            raise BadHouse(job_key(job), "", "no such job in this store", hint=hint) from None


def want_of(spec: JobSpec) -> Wanted:
    """A job's request for each house; BadInput for a layer unknown to this worker."""
    return wanted_of(spec)


def steps_before_views(spec: JobSpec, house: str) -> tuple[str, ...]:
    """Steps of the stage geometry: of the house, but for those that the first batch of light makes.

    Where the recipe leaves dark rooms out, illuminance is among them, since it decides which views
    there are.
    """
    # Illuminance comes before the views where it decides which of them are made.
    want = want_of(spec)
    later = () if plan.leaves_out_dark_rooms(spec.recipe, want, house) else ("illuminance",)
    return tuple(step for step in plan.house_steps(want, house) if step not in later)


def batch_stages(want: Wanted) -> tuple[str, ...]:
    """The stages a batch of views goes through, in order: gl, with labels, and light if a mode needs it."""
    return (GL, LIGHT) if "light" in view_steps(want) else (GL,)


def steps_of_stage(spec: JobSpec, stage: str) -> tuple[str, ...]:
    """The steps of a view that a stage (gl or light) does; the last stage also writes view.json."""
    steps = view_steps(want_of(spec))
    last = stage == spec.batch_stages[-1]
    return tuple(
        s for s in steps if (last if s == "view" else (s in _LIGHT_STEPS) == (stage == LIGHT))
    )


def _first_stage_missing(spec: JobSpec, views: tuple[str, ...], done: frozenset[str]) -> str:
    for stage in spec.batch_stages:
        if any(
            keys.marker_name(s, v) not in done for v in views for s in steps_of_stage(spec, stage)
        ):
            return stage
    return ""
