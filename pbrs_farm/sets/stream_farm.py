"""Views of a stream that a farm renders: one job for the set's homes, whose views are taken as they finish.

Effects: Redis and the farm's store.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Final

from pbrs_farm.core import keys
from pbrs_farm.core.recipe import Recipe
from pbrs_farm.formats.marker import Marker, read_marker
from pbrs_farm.run import plan as run_plan
from pbrs_farm.run.request import Wanted
from pbrs_farm.sets.stream_plan import StreamHome
from pbrs_farm.store import Store
from pbrs_farm.store.memory_store import MemoryStore
from pbrs_farm.store.object_store import get_or_none

_LOOK_S: Final = 2.0

Ended = Callable[[], bool]
"""True once the farm renders nothing more of the job."""


def submit_stream(homes: Sequence[StreamHome], want: Wanted, url: str) -> tuple[Store, Ended]:
    """Submit the homes of a stream, all views of each, as one job; an equal job is not repeated.

    Returns the job's store. Raises BadInput as `pbrs-farm submit` does.
    """
    from pbrs_farm.prepare.passes import uses_catalogue
    from workers.client.estimate import seconds_per_view
    from workers.client.farm_client import Farm, new_spec
    from workers.config import config_from_environment
    from workers.house_files import entry_of_source, upload, upload_catalogue
    from workers.node.house_runner import batch_stages

    farm = Farm(replace(config_from_environment(), store_url=url))
    farm.ledger.ping()
    farm.check_store()
    recipe: Recipe = homes[0].recipe
    sources = [home.source for home in homes]
    if any(uses_catalogue(source, recipe) for source in sources):
        recipe = upload_catalogue(farm.store, recipe)
    upload(farm.store, sources)
    spec = new_spec(
        recipe,
        batch_stages=batch_stages(want),
        seconds_per_view=seconds_per_view(recipe),
        **{name: getattr(want, name) for name in Wanted.model_fields},
    )
    job = farm.submit([entry_of_source(source) for source in sources], spec).job_id
    return farm.store, lambda: farm.view(job).state not in ("running", "paused")


def planned_rows(
    store: Store, home: StreamHome, want: Wanted, ended: Ended
) -> list[tuple[str, str, float]]:
    """(view id, room id, score) of the views that the farm renders of a home; [] if its home fails."""
    house = home.source.house_id
    cameras = _marker(store, house, "cameras", ended)
    rows = (
        [(str(v), str(room), float(score)) for v, room, score in cameras.facts["views"]]
        if cameras
        else []
    )
    if cameras and run_plan.leaves_out_dark_rooms(home.recipe, want, house):
        lit = _marker(store, house, "illuminance", ended)
        lux = lit.facts["floor_lux"] if lit else {}
        rows, _left_out = run_plan.lit_views(rows, lux, home.recipe.selection.min_room_lx)
    return rows


def fetched_views(store: Store, house: str, views: Sequence[str], ended: Ended) -> MemoryStore:
    """A copy of the files of some views, once they are finished; without those that the farm gave up."""
    memory = MemoryStore()
    for view in views:
        last = keys.view_key(house, view, "view.json")  # written last
        has_ended = False
        while store.head(last) is None and not has_ended:
            has_ended = ended()
            time.sleep(_LOOK_S)
        if store.head(last) is not None:
            for key in store.list(last.removesuffix("view.json")):
                memory.put(key, store.get(key))
    return memory


def _marker(store: Store, house: str, step: str, ended: Ended) -> Marker | None:
    """The marker of a step of a home once it is done; None if the job has ended without it."""
    key = keys.marker_key(house, step)
    while (marker := read_marker(store, key)) is None:
        if ended() and get_or_none(store, key) is None:
            return None
        time.sleep(_LOOK_S)
    return marker
