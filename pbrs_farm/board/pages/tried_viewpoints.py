"""Every viewpoint that the sampler tried in a stored house, with its verdict. Effects: a process.

The root keeps how many candidates each rule refused, not where they were: they are sampled again
from the stored house, recipe and seed, which gives the same ones. In a process of its own, since
the ray caster keeps much memory: `python -m` this module, STORE HOUSE, writes JSON to stdout.
"""

from __future__ import annotations

import json
import subprocess
import sys
from typing import Any, Final

from pbrs_farm.core.errors import BadInput, PbrsError
from pbrs_farm.store.object_store import Store

MAX_CANDIDATES: Final = 40_000  # that a browser is given
_TIMEOUT_S: Final = 300.0


def candidates_in_process(store_url: str, house: str) -> bytes:
    """The JSON of `candidates`, made by a process of its own. Raises BadInput with what it said.

    Sampling loads ray casters and takes seconds; a process of its own keeps the server small.
    BadInput as well where it takes too long.
    """
    command = [sys.executable, "-m", "pbrs_farm.board.pages.tried_viewpoints", store_url, house]
    try:
        done = subprocess.run(command, capture_output=True, timeout=_TIMEOUT_S, check=False)
    except subprocess.TimeoutExpired:
        raise BadInput(house, "", f"took more than {_TIMEOUT_S:.0f} s") from None
    if done.returncode != 0:
        lines = done.stderr.decode("utf-8", "replace").strip().splitlines()
        raise BadInput(house, "", lines[-1] if lines else f"exit code {done.returncode}")
    return done.stdout


def candidates(store: Store, house_id: str) -> dict[str, Any]:
    """Verdicts by number, rooms, and a row per candidate: x, y, z, verdict, room's place.

    Raises PbrsError where the house, its recipe or what the sampler needs is missing.
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
    counters = cached.caster.item_counts, cached.caster.depth_pictures
    seed = camera_seed(house_id, recipe)
    sampling = sample_cameras(cached.house, recipe.judged_cameras, seed, *counters)
    rows = [
        [*(round(float(x), 3) for x in eye), int(verdict), k]
        for k, trace in enumerate(sampling.traces)
        for eye, verdict in zip(trace.candidates.eye, trace.verdict, strict=True)
    ]
    # Too many for a browser: every n-th of them.
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
        found = candidates(store_from_url(url, settings_from_environment().store), house)
    except PbrsError as error:
        sys.stderr.write(f"{error}\n")
        return 1
    sys.stdout.write(json.dumps(found, separators=(",", ":")))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
