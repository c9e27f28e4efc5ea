"""Render in memory with the steps of a run, serialised on a dedicated thread.

Effects: a thread, memory, and those of the steps. Mitsuba, Dr.Jit and OpenGL keep state per thread
and process: one thread does all the work, and a forked child is refused. A home's store is kept for
the next call, so that its second view costs the same as in a run.
"""

from __future__ import annotations

import os
import threading
from collections import OrderedDict
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace
from typing import TYPE_CHECKING, Final, TypeVar

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core import keys
from pbrs_farm.core.camera import Camera, View
from pbrs_farm.core.errors import MachineFailed
from pbrs_farm.core.recipe import Recipe
from pbrs_farm.crash_notes import waiting_lines
from pbrs_farm.formats.cameras_json import cameras_json, views_from_json
from pbrs_farm.formats.marker import copy_done
from pbrs_farm.formats.serialise import json_bytes
from pbrs_farm.operating_system import after_fork
from pbrs_farm.prepare.apply_edits import apply_edits
from pbrs_farm.prepare.dress_catalogue import fetch_catalogue
from pbrs_farm.prepare.passes import FinishedHouse, cache_key, uses_catalogue
from pbrs_farm.prepare.source_ref import SourceRef
from pbrs_farm.run import plan
from pbrs_farm.run.house_cache import CachedHouse, HouseCache
from pbrs_farm.run.request import Wanted
from pbrs_farm.run.step_cache import StepOutput, Work, run_unless_done
from pbrs_farm.run.steps import run_step
from pbrs_farm.scene.viewpoints import Viewpoint
from pbrs_farm.store.memory_store import MemoryStore
from pbrs_farm.store.object_store import Store
from pbrs_farm.views.stored_root import StoredRoot
from pbrs_farm.views.views import ViewRef, Views

if TYPE_CHECKING:
    pass

_N_HOMES: Final = 4  # maximum number of cached homes
_T = TypeVar("_T")


class Renderer:
    """The cached homes of this process and its rendering thread."""

    def __init__(self) -> None:
        self._pid = os.getpid()
        after_fork(self._begin_in_child)
        self._lock = threading.Lock()
        self._thread: ThreadPoolExecutor | None = None
        self._ident = 0  # of the rendering thread
        self._stop = threading.Event()
        self._stores: OrderedDict[tuple[str, str], MemoryStore] = OrderedDict()
        self._finished: OrderedDict[str, FinishedHouse] = OrderedDict()
        self._houses = HouseCache()

    def house(self, source: SourceRef, recipe: Recipe) -> FinishedHouse:
        """The house of a source: read, dressed, repaired and edited; the last homes are cached.

        Returns the same object for the same source and recipe while it is cached; otherwise all steps of
        the house run again. Do not change it.
        """
        key = cache_key(source, recipe)
        with self._lock:
            finished = self._finished.get(key)
        if finished is None:
            with waiting_lines(source.house_id):
                finished = self.call(lambda: self._house(source, recipe))
        with self._lock:
            self._finished[key] = finished
            self._finished.move_to_end(key)
            while len(self._finished) > _N_HOMES:
                self._finished.popitem(last=False)
        return finished

    def sampled(self, source: SourceRef, recipe: Recipe) -> bytes:
        """cameras.json of the step `cameras`, as stored in a root.

        Reads and dresses the home first if necessary.
        """
        with waiting_lines(source.house_id):
            return self.call(lambda: self._cameras(source, recipe))

    def frames(
        self,
        source: SourceRef,
        recipe: Recipe,
        viewpoints: Sequence[Viewpoint],
        want: Wanted,
        observe: Callable[[str], None] = lambda _view: None,
    ) -> Views:
        """Render the viewpoints' frames: runs the steps of `want` for each, in a separate store.

        Blocks until all are done. Ctrl-C lets the current step end and starts no other.
        """
        return self.call(lambda: self._frames(source, recipe, viewpoints, want, observe))

    def sketches(
        self, source: SourceRef, recipe: Recipe, cameras: Sequence[Camera]
    ) -> list[NDArray[np.uint8]]:
        """An OpenGL-DL picture (H, W, 3) of each camera, at its own size; nothing is stored.

        uint8 sRGB; without OpenGL, diffuse colours, darker at grazing angles. Quick, for aiming cameras: no
        light is traced and no labels are made. The house is prepared first if necessary.
        """
        return self.call(lambda: self._sketches(source, recipe, cameras))

    def close(self) -> None:
        """Release all homes.

        The renderer remains usable: homes are then read anew.
        """
        if self._thread is not None:
            self.call(self._houses.clear)
        self._stores.clear()
        self._finished.clear()
        self._houses.before_edits.clear()

    def call(self, task: Callable[[], _T]) -> _T:
        """Run a task on the rendering thread, which owns the renderers' state, and return its result.

        Calls from several threads run one after another. A call from within a task runs immediately, so
        that callbacks cannot deadlock. Raises MachineFailed in a process forked from one that renders,
        since the renderers' state does not survive a fork.
        """
        if os.getpid() != self._pid:
            hint = 'multiprocessing.set_start_method("spawn"), or render only in child processes'
            raise MachineFailed("this process was forked from a rendering process", hint=hint)
        # Plugins that make homes, and callbacks, already run on the thread.
        if threading.get_ident() == self._ident:
            return task()
        with self._lock:
            if self._thread is None:
                self._thread = ThreadPoolExecutor(1, "pbrs-farm", self._begin)
        stop = threading.Event()
        future: Future[_T] = self._thread.submit(self._begin_task, task, stop)
        try:
            return future.result()
        except BaseException:
            # Ctrl-C: the current step ends, no other starts.
            stop.set()
            raise

    def _begin_in_child(self) -> None:
        # A child forked before the parent starts its thread may start one itself.
        if self._thread is None:
            self._pid = os.getpid()

    def _begin_task(self, task: Callable[[], _T], stop: threading.Event) -> _T:
        self._stop = stop
        return task()

    def _begin(self) -> None:
        self._ident = threading.get_ident()

    def store_of(self, source: SourceRef) -> MemoryStore:
        """The store with the finished steps of a home; that of the home used longest ago is dropped."""
        key = (source.house_id, source.fingerprint)
        store = self._stores.setdefault(key, MemoryStore())
        self._stores.move_to_end(key)
        while len(self._stores) > _N_HOMES:
            # Loaded houses may refer to that store.
            self._stores.popitem(last=False)
            self._houses.clear()
        return store

    def _with_house(self, source: SourceRef, recipe: Recipe) -> Work:
        """Prepare a home up to the step `house`."""
        if uses_catalogue(source, recipe):
            fetch_catalogue(recipe.dress)
        work = Work(self.store_of(source), recipe, source.house_id, self._houses, source)
        self._run("house", work)
        return work

    def _house(self, source: SourceRef, recipe: Recipe) -> FinishedHouse:
        if source.edits:
            # Edit the finished house directly; the step runs only when rendering.
            before = self.house(source.unedited, recipe)
            return before._replace(house=apply_edits(before.house, source, recipe.read))
        return self._unedited(source, recipe)

    def _unedited(self, source: SourceRef, recipe: Recipe) -> FinishedHouse:
        from pbrs_farm.dress.report import DressReport
        from pbrs_farm.repair import RepairReport

        work = self._with_house(source, recipe)
        get, key = work.store.get, keys.house_key
        report = RepairReport.model_validate_json(get(key(source.house_id, "repair.json")))
        house = self._cached(work).house
        # Keep the house as the base for edits.
        dress_key = key(source.house_id, keys.DRESS)
        is_dressed = work.store.head(dress_key) is not None
        dressing = DressReport.model_validate_json(get(dress_key)) if is_dressed else None
        finished = FinishedHouse(house, report, dressing)
        self._houses.before_edits.keep(source, recipe, finished)
        return finished

    def _cached(self, work: Work) -> CachedHouse:
        digest = run_step("house", work).marker.digest
        return self._houses.get(work.store, work.recipe, work.house_id, digest)

    def _cameras(self, source: SourceRef, recipe: Recipe) -> bytes:
        work = self._with_house(source, recipe)
        self._run("cameras", work)
        return work.store.get(keys.house_key(source.house_id, "cameras.json"))

    def _sketches(
        self, source: SourceRef, recipe: Recipe, cameras: Sequence[Camera]
    ) -> list[NDArray[np.uint8]]:
        cached = self._cached(self._with_house(source, recipe))
        try:
            rasterizer = cached.rasterizer
        except MachineFailed:
            return [_sketch_by_rays(cached, camera) for camera in cameras]
        return [rasterizer.render_dl(camera) for camera in cameras]

    def _frames(
        self,
        source: SourceRef,
        recipe: Recipe,
        viewpoints: Sequence[Viewpoint],
        want: Wanted,
        observe: Callable[[str], None],
    ) -> Views:
        work = replace(self._with_house(source, recipe), layers=want.layers)
        if recipe.cameras.source == "given":
            self._give_cameras(work, viewpoints)
        for step in plan.house_steps(want, source.house_id)[1:]:
            self._run(step, work)
        # Use a separate store: another call may request other files of the same view.
        taken = MemoryStore()
        taken.put(keys.RECIPE, json_bytes(recipe))
        inner = replace(work, store=taken)
        for key in work.store.list(keys.house_key(source.house_id)):
            place = keys.parse_house_key(key)
            if place is not None and place.view is None:
                taken.put(key, work.store.get(key))
        for viewpoint in viewpoints:
            steps = plan.view_steps(want)
            pictures = [step for step in steps if step not in ("truth", "view")]
            _copy_steps(work.store, taken, source.house_id, viewpoint.id, pictures)
            for step in steps:
                self._run(step, replace(inner, view_id=viewpoint.id))
            _copy_steps(taken, work.store, source.house_id, viewpoint.id, pictures)
            observe(viewpoint.id)
        refs = tuple(ViewRef(source.house_id, viewpoint.id) for viewpoint in viewpoints)
        return Views(StoredRoot(taken), refs, {})

    def _run(self, step: str, work: Work) -> None:
        if self._stop.is_set():
            raise KeyboardInterrupt
        run_step(step, work)

    def _give_cameras(self, work: Work, viewpoints: Iterable[Viewpoint]) -> None:
        """Write cameras.json for cameras from Python, including those of earlier calls."""
        key = keys.house_key(work.house_id, "cameras.json")
        views = {}
        new_views = {viewpoint.id: viewpoint.view for viewpoint in viewpoints}
        if work.store.head(key) is not None:
            stored = views_from_json(work.store.get(key), key)
            views = {name: view for name, view in stored.items() if view.origin == "given"}
            views = _without_other_film(work, views, new_views)
        views |= new_views
        all_views = [views[name] for name in sorted(views)]
        # The digest covers the source of the cameras, not the cameras; a view's id does that.
        work.store.delete(keys.marker_key(work.house_id, "cameras"))
        facts = {"views": [[v.id, v.room_id, v.score] for v in all_views]}
        data = cameras_json(all_views, {"source": "given", "n_views": len(all_views)})
        run_unless_done("cameras", work, lambda _work: StepOutput({"cameras.json": data}, facts))
        self._cached(work).forget_views()


def _without_other_film(
    work: Work, stored: Mapping[str, View], new: Mapping[str, View]
) -> dict[str, View]:
    """The stored views, without the frames of a different film.

    Film frames are named by number, so results of another film's frames are invalidated.
    """
    films = [
        {name: cameras_json([v], {}) for name, v in views.items() if v.frame is not None}
        for views in (stored, new)
    ]
    if not films[1] or films[0] == films[1]:
        return dict(stored)
    work.store.delete(keys.marker_key(work.house_id, "tracks"))
    for name in films[0]:
        for step in plan.STEPS.values():
            if step.per_view:
                work.store.delete(keys.marker_key(work.house_id, step.name, name))
    return {name: view for name, view in stored.items() if name not in films[0]}


def _sketch_by_rays(cached: CachedHouse, camera: Camera) -> NDArray[np.uint8]:
    """(H, W, 3) uint8 diffuse colours, lit from the camera; half as bright at grazing angles."""
    from pbrs_farm.transport.scene_tables.material_rows import max_albedo
    from pbrs_farm.truth.surface_layers import albedo_label

    hit = cached.caster.hit_record(camera)
    most = max_albedo(cached.recipe)
    albedo = albedo_label(hit, cached.house, cached.geometry, cached.textures, most)
    _origin, directions = camera.rays()
    rays = directions / np.linalg.norm(directions, axis=-1, keepdims=True)
    facing = np.abs((rays * hit.geo_normal_world).sum(-1, keepdims=True))
    return np.asarray(np.rint(albedo * (0.5 + 0.5 * np.nan_to_num(facing))), np.uint8)


def _copy_steps(of: Store, to: Store, house: str, view: str, steps: Iterable[str]) -> None:
    """Copy the results of a view's finished steps."""
    for step in steps:
        copy_done(of, to, keys.marker_key(house, step, view))
