"""One example home dressed by one seed, measured in a process of its own; prints JSON.

`python -m benchmarks.dress.dressed_home NAME SEED [PART...]`, parts: dress (seconds, contacts,
signature of its surfaces), views (what fast cameras see of it), bits (digest of the bundle).
"""

from __future__ import annotations

import hashlib
import json
import os
import sys
import time
from typing import Any

import numpy as np

from pbrs_farm.core.house import House
from pbrs_farm.core.recipe import recipe_from_name
from pbrs_farm.dress.dressing import dress
from pbrs_farm.prepare.read_source import read_house
from pbrs_farm.prepare.source import resolve, variants

PARTS = ("dress", "views", "bits")
LEAST_SHARE = 0.0005  # of a picture's pixels, to be seen
SIZE = (320, 240)


def measured(name: str, seed: int, parts: tuple[str, ...]) -> dict[str, Any]:
    """The numbers of one home and seed."""
    row: dict[str, Any] = {"home": name, "seed": seed}
    if "dress" in parts:
        row |= _dressed(name, seed)
    if "views" in parts or "bits" in parts:
        row |= repaired_home(name, seed, with_views="views" in parts)
    return row


def _dressed(name: str, seed: int) -> dict[str, Any]:
    """Dress on one core, look at every contact, and say what each surface is made of."""
    os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
    from benchmarks.dress.changed import looks_of
    from benchmarks.dress.contacts import blocked_doors, floating, penetrations, things_of
    from pbrs_farm.prepare.dress_catalogue import catalogue_of

    recipe = recipe_from_name("fast")
    source = house_as_a_run_has_it(name)
    started = time.perf_counter()
    catalogue = catalogue_of(recipe.dress)
    catalogue_s = time.perf_counter() - started
    started, cpu = time.perf_counter(), time.process_time()
    house, report = dress(source, catalogue, recipe.dress, seed)
    seconds, cpu_s = time.perf_counter() - started, time.process_time() - cpu
    things = things_of(house, source)
    return {
        "seconds": round(cpu_s, 2),
        "wall_s": round(seconds, 2),
        "catalogue_s": round(catalogue_s, 2),
        "new": sum(t.is_new for t in things),
        "penetrations": penetrations(things),
        "floating": floating(things),
        "doors_blocked": blocked_doors(house, things),
        "gates": {g.name: [g.n_checked, g.n_taken_out, g.n_left] for g in report.gates},
        "added": report.added,
    } | looks_of(house, source)


def house_as_a_run_has_it(name: str) -> House:
    """The home as read, without what its recipe removes: nothing makes way for plants."""
    from pbrs_farm.repair.small_repairs import without_persons_and_plants

    recipe = recipe_from_name("fast")
    house = read_house(resolve(name), recipe.read)
    return without_persons_and_plants(house, recipe.repair)[0]


def repaired_home(name: str, seed: int, *, with_views: bool) -> dict[str, Any]:
    """As a run prepares it, all passes: leaks, size, digest, and what fast cameras see."""
    from pbrs_farm.formats.house_bundle import bundle_from_house
    from pbrs_farm.prepare.finished_house import finished_house

    recipe = recipe_from_name("fast")
    house, repairs, _report = finished_house(variants(resolve(name), [seed])[0], recipe)
    glb, description = bundle_from_house(house)
    row: dict[str, Any] = {
        "leaks": repairs.leaks.n_sky if repairs.leaks else -1,
        "mb": round(len(glb) / 1e6, 2),
        "bits": hashlib.sha256(glb + description).hexdigest(),
        "triangles": sum(item.n_faces for item in house.items),
    }
    return row | (_seen(house) if with_views else {})


def _seen(house: House) -> dict[str, Any]:
    """Objects, classes and NYU13 shares of each view that `fast` chooses on the dressed home."""
    from pbrs_farm.core.classes import NYU13_FROM_NYU40, NYU13_NAMES
    from pbrs_farm.raycast.caster import Caster
    from pbrs_farm.run.steps import camera_seed
    from pbrs_farm.sample.house_sampler import sample_cameras

    recipe = recipe_from_name("fast")
    caster = Caster.of_house(house)
    seed = camera_seed(house.id, recipe)
    views = sample_cameras(
        house, recipe.cameras, seed, caster.item_counts, caster.depth_pictures
    ).views
    counts = caster.item_counts([v.camera.with_size(*SIZE) for v in views]).astype(np.float64)
    counts = np.pad(counts, ((0, 0), (0, len(house.items) + 1 - counts.shape[1])))
    shares = counts / counts.sum(1, keepdims=True)
    classes = np.zeros((len(views), len(NYU13_NAMES)))
    nyu13 = NYU13_FROM_NYU40[[0, *(item.nyu40 for item in house.items)]]
    np.add.at(classes.T, nyu13, shares.T)
    is_object = np.array([False, *(not i.kind.is_structure for i in house.items)])
    return {
        "views": len(views),
        "rooms": [v.room_id for v in views],
        "objects": ((shares >= LEAST_SHARE) & is_object).sum(1).tolist(),
        "classes": (classes[:, 1:] > 0).sum(1).tolist(),
        "shares": np.round(classes, 5).tolist(),
    }


if __name__ == "__main__":
    given = tuple(sys.argv[3:]) or PARTS
    print(json.dumps(measured(sys.argv[1], int(sys.argv[2]), given)))
