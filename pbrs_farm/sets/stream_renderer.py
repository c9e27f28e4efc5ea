"""The process that renders a stream's units ahead of its readers. Effects: renders; the stream's cache.

`python -m pbrs_farm.sets.stream_renderer N` reads the pickled plan from standard input. It ends when all readers
have ended.
"""

from __future__ import annotations

import math
import pickle
import sys
import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

from pbrs_farm.core import keys
from pbrs_farm.core.errors import BadInput, MachineFailed, PbrsError, StoreFailed
from pbrs_farm.core.lighting import Mode
from pbrs_farm.core.recipe import Recipe
from pbrs_farm.formats.marker import copy_done, read_marker
from pbrs_farm.formats.radiance_exr import FILE as RADIANCE_EXR
from pbrs_farm.formats.radiance_exr import radiance_from_exr
from pbrs_farm.operating_system import LOCKS_ARE_INHERITED, lock_file
from pbrs_farm.run import plan as run_plan
from pbrs_farm.run.relight import relight_layers
from pbrs_farm.run.request import Wanted, wanted_of
from pbrs_farm.scene.home import Home
from pbrs_farm.scene.viewpoints import Viewpoint
from pbrs_farm.sets.stream_cache import CachedView, StreamCache, bytes_of_unit, renderer_lock
from pbrs_farm.sets.stream_farm import Ended, fetched_views, planned_rows, submit_stream
from pbrs_farm.sets.stream_plan import Place, StreamHome, StreamPlan, Unit
from pbrs_farm.store import Store
from pbrs_farm.store.folder import FolderStore
from pbrs_farm.views.stored_root import StoredRoot
from pbrs_farm.views.views import ViewRef

FAULT: Final = "fault.txt"
"""Message of an error of this machine, which ends the stream."""
_PREPARED: Final = ("house", "cameras")
_LOOK_S: Final = 0.1
_END_S: Final = 10.0  # without any reader


def main() -> None:
    """Render until all readers have ended."""
    plan: StreamPlan = pickle.load(sys.stdin.buffer)
    # The reader that started this process gave it the lock as its log.
    if not LOCKS_ARE_INHERITED:
        lock = lock_file(renderer_lock(plan.folder, int(sys.argv[1])))
        if lock is None:
            return
    cache = StreamCache(plan.folder, plan.cache_bytes)
    cache.store.sweep(older_than_s=600)
    cache.store.delete(FAULT)
    try:
        StreamRenderer(plan, cache).serve()
    except (MachineFailed, StoreFailed, BadInput) as error:
        cache.store.put(FAULT, str(error).encode())
        raise


class StreamRenderer:
    """Renders the units that readers need first."""

    def __init__(self, plan: StreamPlan, cache: StreamCache) -> None:
        self._plan = plan
        self._cache = cache
        self._places: set[Place] = set()
        self._ranks: Mapping[Unit, int] = {}  # of these places
        self._largest = 0  # bytes of a unit so far
        self._job: tuple[Store, Ended] | None = None  # on the farm
        self._labels = tuple(name for name in plan.request.layers if name != "colour")
        self._has_colour = "colour" in plan.request.layers
        modes = (Mode.MLT_IL_OL,) if self._has_colour else ()
        self._want = wanted_of(Wanted(modes=modes, layers=plan.extra_layers))

    def serve(self) -> None:
        """Render ahead of the readers until none has lived for a while."""
        last_s = time.monotonic()
        while time.monotonic() - last_s < _END_S:
            places = set(self._cache.places())
            if places != self._places:
                self._places, self._ranks = places, self._plan.ranks(places)
            has_rendered = bool(places) and self.render_next()
            # A unit may take longer than _END_S.
            if places:
                last_s = time.monotonic()
            if not has_rendered:
                time.sleep(_LOOK_S)

    def render_next(self) -> bool:
        """Render the first missing unit, if the cache has room; True if one was rendered."""
        for unit, rank in self._ranks.items():
            if self._cache.path(unit).exists():
                continue
            if not self._cache.make_room(self._largest, self._distance, rank):
                return False
            claim = lock_file(self._plan.folder / "claims" / str(unit[0]))
            if claim is None:  # another renderer has this home
                continue
            with claim:
                data = self._bytes_of(unit)
                self._largest = max(self._largest, len(data))
                if not self._cache.put(unit, data, self._distance) and rank == 0:
                    text = f"is too small: the views of a home have {len(data) / 1e6:.0f} MB"
                    raise BadInput("stream", "cache_gb", text)
            return True
        return False

    def _distance(self, path: Path) -> float:
        """Number of units used before an entry of the cache; infinite for entries of the past."""
        if path.parents[1] != self._plan.folder:
            return math.inf
        home, _, generation = path.stem.partition("-")
        if generation:
            return self._ranks.get((int(home), int(generation)), math.inf)
        missing = (u for u in self._ranks if u[0] == int(home) and not self._cache.path(u).exists())
        unit = next(missing, None)
        return len(self._ranks) if unit is None else self._ranks[unit]

    def _bytes_of(self, unit: Unit) -> bytes:
        home = self._plan.homes[unit[0]]
        try:
            render = self._views_of_farm if self._plan.farm else self._views
            views = render(home, unit)
            return bytes_of_unit(views, "" if views else f"{home.word}: no view")
        except (MachineFailed, StoreFailed):
            raise
        except PbrsError as error:
            return bytes_of_unit((), str(error))

    def _views(self, stream_home: StreamHome, unit: Unit) -> list[CachedView]:
        """Render the views of a unit on this machine."""
        home = Home(stream_home.source, stream_home.recipe)
        memory, disk = home.renderer.store_of(home.source), FolderStore(self._cache.house(unit[0]))
        markers = [keys.marker_key(home.id, step) for step in _PREPARED]
        if memory.head(markers[0]) is None:
            copy_done(disk, memory, markers[0])
        # Later draws of viewpoints have replaced the first one in memory.
        copy_done(disk, memory, markers[1])
        views = home.cameras()
        if disk.head(markers[-1]) is None:
            self._keep_prepared(memory, disk, markers)
        # The best views first; once all have been used, others are sampled.
        slices = _slices(_rows(views), stream_home)
        if not slices:
            return []
        draw, number = divmod(unit[1], len(slices))
        recipe = stream_home.recipe_of(unit[1], draw, self._plan.seed)
        if draw:
            home = replace(home, base=recipe)
            views = home.cameras()
            slices = _slices(_rows(views), stream_home) or [[]]
        chosen = [v for v in views if v.id in slices[number % len(slices)]]
        if not chosen:
            return []
        frames = home.renderer.frames(home.source, recipe, chosen, self._want)
        assert isinstance(frames.source, StoredRoot)
        return [self._view(frames.source, ref, recipe) for ref in frames.refs]

    def _keep_prepared(self, memory: Any, disk: FolderStore, markers: list[str]) -> None:
        """Keep the prepared home for later generations, if there is room."""
        of_steps = [read_marker(memory, key) for key in markers]
        n_bytes = sum(file.n_bytes for marker in of_steps if marker for file in marker.files)
        with lock_file(self._cache.folder / "space.lock", wait=True) or memory:
            if self._cache.make_room(n_bytes + 2**16, self._distance, len(self._ranks)):
                for key in markers:
                    copy_done(memory, disk, key)

    def _view(self, root: StoredRoot, ref: ViewRef, recipe: Recipe) -> CachedView:
        request = replace(self._plan.request, layers=self._labels, size=None)
        light = None
        if self._has_colour:
            radiance = radiance_from_exr(root.file(ref, RADIANCE_EXR), ref.id)
            rows = root.table(ref)["modes"]["light"].get("lamps", ())
            light = relight_layers(radiance, rows, denoise=True)
        return CachedView(
            root.facts(ref),
            root.arrays(ref, request),
            {name: root.layer(ref, name) for name in self._plan.extra_layers},
            light,
            recipe.camera_of(ref.house, ref.view).tone,
        )

    def _views_of_farm(self, home: StreamHome, unit: Unit) -> list[CachedView]:
        """Fetch the views of a unit from the store of the stream's job, which renders all views of its homes."""
        if self._job is None:
            self._job = submit_stream(self._plan.homes, self._want, self._plan.farm)
        store, ended = self._job
        slices = _slices(planned_rows(store, home, self._want, ended), home)
        if not slices:
            return []
        house, chosen = home.source.house_id, slices[unit[1] % len(slices)]
        root = StoredRoot(fetched_views(store, house, chosen, ended))
        return [self._view(root, ref, home.recipe) for ref in root.refs]


def _slices(rows: Sequence[tuple[str, str, float]], home: StreamHome) -> list[list[str]]:
    """The ids of views in groups of home.n_views, the best first, each group spread over rooms.

    rows: view id, room id, score. The last group is left out if it is not full, unless there is no other.
    """
    groups: list[list[str]] = []
    taken: set[str] = set()
    while len(taken) < len(rows):
        chosen = run_plan.chosen_views(rows, len(taken) + home.n_views, home.recipe)
        groups.append([name for name in chosen if name not in taken])
        taken |= set(chosen)
    return [g for g in groups if len(g) == home.n_views] or groups[:1]


def _rows(views: Iterable[Viewpoint]) -> list[tuple[str, str, float]]:
    return [(v.id, v.room, v.view.score) for v in views]


if __name__ == "__main__":
    main()
