"""All viewpoints that the sampler tried in a stored house, with verdicts. Effects: a process.

The root has only the number of refused candidates, so they are sampled again from the stored house,
recipe and seed. `python -m` this module STORE HOUSE writes JSON to stdout.
"""

from __future__ import annotations

import json
import sys
from typing import Any, Final

from pbrs_farm.board.module_process import output_of_module
from pbrs_farm.core.errors import BadInput, PbrsError
from pbrs_farm.store.object_store import Store

MAX_CANDIDATES: Final = 40_000  # maximum number sent to a browser
_TIMEOUT_S: Final = 300.0


def candidates_in_process(store_url: str, house: str) -> bytes:
    """The JSON of `candidates` from another process. Raises BadInput if that fails."""
    module = "pbrs_farm.board.pages.tried_viewpoints"
    return output_of_module(module, [store_url, house], subject=house, timeout_s=_TIMEOUT_S)


def candidates(store: Store, house_id: str) -> dict[str, Any]:
    """Verdicts by number, rooms, and a row per candidate: x, y, z, verdict, index of its room.

    Raises PbrsError if the house, its recipe or an input of the sampler is missing.
    """
    from pbrs_farm.core import keys
    from pbrs_farm.core.recipe import recipe_from_json
    from pbrs_farm.run.house_cache import CachedHouse
    from pbrs_farm.run.steps import camera_seed
    from pbrs_farm.sample.camera_report import Verdict
    from pbrs_farm.sample.camera_source import source_of
    from pbrs_farm.sample.house_sampler import sample_cameras

    recipe = recipe_from_json(store.get(keys.RECIPE), keys.RECIPE)
    if keys.is_object(house_id) or not source_of(recipe.cameras).is_ranked:
        raise BadInput(house_id, "", "its cameras were given, not sampled")
    cached = CachedHouse(store, recipe, house_id, "")
    counters = cached.caster.item_counts, cached.caster.item_pictures
    seed = camera_seed(house_id, recipe)
    sampling = sample_cameras(cached.house, recipe.judged_cameras, seed, *counters)
    rows = [
        [*(round(float(x), 3) for x in eye), int(verdict), k]
        for k, trace in enumerate(sampling.traces)
        for eye, verdict in zip(trace.candidates.eye, trace.verdict, strict=True)
    ]
    # Send at most MAX_CANDIDATES, evenly spaced.
    step = -(-len(rows) // MAX_CANDIDATES) or 1
    return {
        "verdicts": [v.label for v in Verdict],
        "rooms": [trace.room_id for trace in sampling.traces],
        "n": len(rows),
        "rows": rows[::step],
    }


def main(words: list[str]) -> int:
    """Write the candidates of a house to stdout."""
    from pbrs_farm.settings import settings_from_environment
    from pbrs_farm.store import store_from_url

    url, house = words
    try:
        answer = candidates(store_from_url(url, settings_from_environment().store), house)
    except PbrsError as error:
        sys.stderr.write(f"{error}\n")
        return 1
    sys.stdout.write(json.dumps(answer, separators=(",", ":")))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
