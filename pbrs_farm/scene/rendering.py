"""Pictures in memory by the steps of a run, one after another in a thread of its own.

Effects: a thread, memory; the steps' own. Mitsuba, Dr.Jit and OpenGL keep state a thread and a
process: one thread does all of it, whoever calls, and a forked child is refused. A home's store
stays for the next call, so that its second view costs what it costs in a run.
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

_N_HOMES: Final = 4  # whose houses and steps are kept
_T = TypeVar("_T")


class Renderer:
    """What this process keeps of the homes it works on, and the thread that works."""

    def __init__(self) -> None:
        self._pid = os.getpid()
        after_fork(self._begin_in_child)
        self._lock = threading.Lock()
        self._thread: ThreadPoolExecutor | None = None
        self._ident = 0  # of that thread
        self._stop = threading.Event()
        self._stores: OrderedDict[tuple[str, str], MemoryStore] = OrderedDict()
        self._finished: OrderedDict[str, FinishedHouse] = OrderedDict()
        self._houses = HouseCache()

    def house(self, source: SourceRef, recipe: Recipe) -> FinishedHouse:
        """The house of a source, read, dressed, repaired and edited; those of the last homes are kept.

        The same source and recipe give the same object as long as it is among the last homes; else
        all steps of the house run again. Do not change it.
        """
        key = cache_key(source, recipe)
        with self._lock:
            finished = self._finished.get(key)
        if finished is None:
            finished = self.call(lambda: self._house(source, recipe))
        with self._lock:
            self._finished[key] = finished
            self._finished.move_to_end(key)
            while len(self._finished) > _N_HOMES:
                self._finished.popitem(last=False)
        return finished

    def sampled(self, source: SourceRef, recipe: Recipe) -> bytes:
        """cameras.json of the step `cameras`.

        The bytes as they would be stored in a root. Reads and dresses the home first, where that
        was not done.
        """
        return self.call(lambda: self._cameras(source, recipe))

    def frames(
        self,
        source: SourceRef,
        recipe: Recipe,
        viewpoints: Sequence[Viewpoint],
        want: Wanted,
        observe: Callable[[str], None] = lambda _view: None,
    ) -> Views:
        """The viewpoints' frames: the steps of `want` for each, in a store of their own.

        Blocks until all are done. Ctrl-C lets the step under way end and begins no other.
        """
        return self.call(lambda: self._frames(source, recipe, viewpoints, want, observe))

    def sketches(
        self, source: SourceRef, recipe: Recipe, cameras: Sequence[Camera]
    ) -> list[NDArray[np.uint8]]:
        """An OpenGL-DL picture (H, W, 3) of each camera, at its own size; nothing is stored.

        uint8 sRGB; without OpenGL the diffuse colours, darker where a surface turns away. Quick, for aiming cameras: no light is traced and no labels are made. The house
        is prepared first, where that was not done.
        """
        return self.call(lambda: self._sketches(source, recipe, cameras))

    def close(self) -> None:
        """Let go of every home.

        It may be used again afterwards: homes are then read anew.
        """
        if self._thread is not None:
            self.call(self._houses.clear)
        self._stores.clear()
        self._finished.clear()
        self._houses.before_edits.clear()

    def call(self, task: Callable[[], _T]) -> _T:
        """What a task gives, done in the thread that works: rays and pictures have their state there.

        Calls of several threads are done one after another. A task that itself calls runs at once,
        so that callbacks cannot wait for themselves. MachineFailed in a process that was forked
        from one that renders, since the state of rays and pictures does not survive a fork.
        """
        if os.getpid() != self._pid:
            hint = 'multiprocessing.set_start_method("spawn"), or render in the children alone'
            raise MachineFailed("this process was forked from one that renders", hint=hint)
        # A plugin that makes homes, or a callback, is in the thread already.
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
            # Ctrl-C: the step under way ends, no other begins.
            stop.set()
            raise

    def _begin_in_child(self) -> None:
        # A forked child has no thread of its parent's; before one is begun it may begin its own.
        if self._thread is None:
            self._pid = os.getpid()

    def _begin_task(self, task: Callable[[], _T], stop: threading.Event) -> _T:
        self._stop = stop
        return task()

    def _begin(self) -> None:
        self._ident = threading.get_ident()

    def _store(self, source: SourceRef) -> MemoryStore:
        key = (source.house_id, source.fingerprint)
        store = self._stores.setdefault(key, MemoryStore())
        self._stores.move_to_end(key)
        while len(self._stores) > _N_HOMES:
            # What is loaded may be of that store.
            self._stores.popitem(last=False)
            self._houses.clear()
        return store

    def _with_house(self, source: SourceRef, recipe: Recipe) -> Work:
        """The work on a home whose step `house` is done."""
        if uses_catalogue(source, recipe):
            fetch_catalogue(recipe.dress)
        work = Work(self._store(source), recipe, source.house_id, self._houses, source)
        self._run("house", work)
        return work

    def _house(self, source: SourceRef, recipe: Recipe) -> FinishedHouse:
        if source.edits:
            # On the house before them, without a step: that is done when it is rendered.
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
        # Edits of it begin here.
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
        # In a store of its own: another call may ask for other files of the same view.
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
        """Write cameras.json of cameras from Python, those of former calls among them."""
        key = keys.house_key(work.house_id, "cameras.json")
        views = {}
        new_views = {viewpoint.id: viewpoint.view for viewpoint in viewpoints}
        if work.store.head(key) is not None:
            stored = views_from_json(work.store.get(key), key)
            views = {name: view for name, view in stored.items() if view.origin == "given"}
            views = _without_other_film(work, views, new_views)
        views |= new_views
        all_views = [views[name] for name in sorted(views)]
        # Its digest says where they come from, not which they are: a view's own id does.
        work.store.delete(keys.marker_key(work.house_id, "cameras"))
        facts = {"views": [[v.id, v.room_id, v.score] for v in all_views]}
        data = cameras_json(all_views, {"source": "given", "n_views": len(all_views)})
        run_unless_done("cameras", work, lambda _work: StepOutput({"cameras.json": data}, facts))
        self._cached(work).forget_views()


def _without_other_film(
    work: Work, stored: Mapping[str, View], new: Mapping[str, View]
) -> dict[str, View]:
    """The views that are held, without the frames of another film than is given.

    Frames are named by their numbers: what was made of others of these names is taken away.
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
    """(H, W, 3) uint8: diffuse colours as a lamp at the camera shows them, half as bright edge-on."""
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
    """Copy what steps of a view have made, those that are done."""
    for step in steps:
        copy_done(of, to, keys.marker_key(house, step, view))
