"""Made homes, measured in a process of its own; prints a JSON line a home.

`python -m benchmarks.homes.made_home PART SEED...`, parts: plans (plan + furnish on one core, and
what the plan is like), houses (read, repaired: leaks, contacts, bits), views and untouched (dressed:
what is seen).
"""

from __future__ import annotations

import hashlib
import json
import os
import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from benchmarks.homes.made_plan import measured
from pbrs_farm.core import keys
from pbrs_farm.core.errors import PbrsError
from pbrs_farm.core.house import ItemKind
from pbrs_farm.core.made_home import VERSION, MadeHome
from pbrs_farm.core.recipe import recipe_from_name

DRESS_SEED = 1
_NUDGE_M = 3e-4


def of_plan(seed: int) -> dict[str, Any]:
    """Plan and furniture of a seed: CPU seconds on one core, and what they are like."""
    from pbrs_farm.generate.drawn_home import drawn_home
    from pbrs_farm.prepare.dress_catalogue import catalogue_of_words

    catalogue = catalogue_of_words("")
    word = MadeHome(seed).word
    rng = np.random.default_rng(keys.seed("made", VERSION, word))
    started = time.process_time()
    drawn = drawn_home(rng, catalogue)
    plan, pieces = drawn.plan, drawn.pieces
    seconds = time.process_time() - started
    text = repr((plan, pieces)).encode()
    return {
        "seconds": round(seconds, 3),
        "bits": hashlib.sha256(text).hexdigest(), **measured(plan, pieces),
    }  # fmt: skip


def of_house(seed: int) -> dict[str, Any]:
    """The home as the ordinary reader and repair see it: leaks, contacts of meshes, bits of its file."""
    from benchmarks.dress.contacts import blocked_doors, penetrations, things_of
    from pbrs_farm.generate.generated_home import generate_home
    from pbrs_farm.prepare.dress_catalogue import catalogue_of_words
    from pbrs_farm.prepare.finished_house import repaired_house
    from pbrs_farm.prepare.read_source import read_house
    from pbrs_farm.prepare.source import resolve

    recipe = recipe_from_name("fast")
    source = resolve(MadeHome(seed).word)
    data = generate_home(MadeHome(seed), catalogue_of_words("")).data
    house = read_house(source, recipe.read)
    _repaired, report = repaired_house(source, recipe)
    # All furniture counts as new; walls, doors and windows came with the home.
    bare = house.with_items(tuple(i for i in house.items if _is_structure(i.kind)))
    ordered = house.with_items((*bare.items, *(i for i in house.items if i not in bare.items)))
    things = things_of(ordered, bare)
    name = {i.id: i.name for i in house.items}
    return {
        "leaks": report.leaks.n_sky if report.leaks else -1,
        "bits": hashlib.sha256(data).hexdigest(),
        "notes": [n.text for n in house.notes],
        "penetrations": [
            [name[a], name[b], d] for a, b, d in penetrations(things) if not _may(name[a], name[b])
        ],
        "floating": [[name[a], gap] for a, gap in _off_the_ground(things)],
        "doors_blocked": [[name[b]] for _a, b in blocked_doors(ordered, things)],
    }


def _off_the_ground(things: list[Any]) -> list[tuple[str, float]]:
    """Things that touch nothing within 2 mm, also when they are lifted or lowered by 0.3 mm.

    A face in the very plane of the floor hides the floor from a ray that goes through both.
    """
    from benchmarks.dress.contacts import floating

    left = dict(floating(things))
    for lift in (_NUDGE_M, -_NUDGE_M):
        moved = []
        for thing in things:
            if thing.item.id in left:
                mesh = thing.mesh.copy()
                mesh.apply_translation([0.0, lift, 0.0])
                bounds = thing.bounds + np.array([0.0, lift, 0.0])
                thing = replace(thing, mesh=mesh, bounds=bounds, _rays=None)
            moved.append(thing)
        if left:
            still = dict(floating(moved))
            left = {k: gap for k, gap in left.items() if k in still}
    return sorted(left.items())


def _is_structure(kind: ItemKind) -> bool:
    return kind.is_structure or kind in (ItemKind.DOOR, ItemKind.WINDOW)


def _may(a: str, b: str) -> bool:
    # Seats may stand under tables and desks.
    names = f"{a} | {b}".lower()
    has_seat = any(word in names for word in ("chair", "stool", "seat"))
    return has_seat and any(word in names for word in ("table", "desk"))


def of_views(seed: int) -> dict[str, Any]:
    """What fast cameras see of the home dressed by the first seed."""
    from benchmarks.dress.dressed_home import repaired_home

    return repaired_home(MadeHome(seed).word, DRESS_SEED, with_views=True)


PARTS = {"plans": of_plan, "houses": of_house, "views": of_views, "untouched": of_views}


def main(part: str, seeds: Sequence[int]) -> None:
    """A line for each seed."""
    for seed in seeds:
        try:
            row = PARTS[part](seed)
        except (PbrsError, ArithmeticError, LookupError, ValueError, AssertionError) as error:
            row = {"failed": f"{type(error).__name__}: {error}"}
        # One write a line: several processes add to one file.
        os.write(sys.stdout.fileno(), (json.dumps({"seed": seed, **row}) + "\n").encode())


if __name__ == "__main__":
    main(sys.argv[1], [int(word) for word in sys.argv[2:]])
