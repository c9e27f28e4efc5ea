"""What opens in made homes -> out/bench/joints.json.

`python -m benchmarks.homes.joints [N]`: N homes (10) of seeds kept apart, dressed, not rendered. Counted
are the things that people open: doors, what has a joint, and furniture and machines that a word of their
name says have doors, drawers or lids. One opens if a joint of it goes half of its way as the home stands.
"""

from __future__ import annotations

import re
import sys
from collections import Counter
from collections.abc import Iterator
from typing import Final

from benchmarks.figures import write_report
from pbrs_farm.core.house import House, Item, ItemKind
from pbrs_farm.core.joints import JointKind
from pbrs_farm.core.made_home import MadeHome
from pbrs_farm.core.recipe import recipe_from_name
from pbrs_farm.geometry.opened import free_value
from pbrs_farm.geometry.scene_triangles import SceneTriangles
from pbrs_farm.prepare.finished_house import finished_house
from pbrs_farm.prepare.source import resolve, variants

FIRST_SEED: Final = 62001
N_HOMES: Final = 10
DRESS_SEED: Final = 1
UNITS: Final = {
    "joints.homes": "homes",
    "joints.things": "things that people open",
    "joints.share": "of these, those that open at least half of their way",
    "joints.with_joints": "of these, those that have a joint at all",
    "joints.joints": "doors, drawers, flaps, lids and sashes that are joints",
    "joints.free": "of these, those that go at least half of their way",
    "joints.drawers": "drawers",
    "joints.drawers_free": "of these, those that go nine tenths of their way",
}

_WIDE: Final = 0.9
_OPENED: Final = re.compile(
    r"\b(wardrobe|cabinet|cupboard|sideboard|chest|drawers?|fridge|refrigerator|freezer|oven|cooker|"
    r"dishwasher|washing machine|washer|dryer)\b",
    re.IGNORECASE,
)
_NOTHING: Final = re.compile(r"\b(frame|open|blind)\b", re.IGNORECASE)  # a doorway, shelves


def main(words: list[str] | None = None) -> None:
    """Measure made homes and write out/bench/joints.json."""
    n = next((int(word) for word in words or () if word.isdigit()), N_HOMES)
    counts: Counter[str] = Counter()
    for house in _homes(n):
        lacking = _count(house, counts)
        print(f"{house.id}: stay shut: {', '.join(sorted(lacking)) or 'none'}", flush=True)
    figures = {
        "joints.homes": n,
        "joints.things": counts["things"],
        "joints.share": round(counts["open"] / counts["things"], 3),
        "joints.with_joints": round(counts["with joints"] / counts["things"], 3),
        "joints.joints": counts["joints"],
        "joints.free": round(counts["free"] / counts["joints"], 3),
        "joints.drawers": counts["drawers"],
        "joints.drawers_free": counts["drawers free"],
    }
    write_report("joints", figures, UNITS)


def _homes(n: int) -> Iterator[House]:
    recipe = recipe_from_name("preview")
    for seed in range(FIRST_SEED, FIRST_SEED + n):
        (source,) = variants(resolve(MadeHome(seed).word), [DRESS_SEED])
        yield finished_house(source, recipe).house


def _count(house: House, counts: Counter[str]) -> set[str]:
    """Count a home; the names of things that people open and that do not."""
    scene, lacking = SceneTriangles(house.items), set[str]()
    for index, item in enumerate(house.items):
        if item.is_outside or item.is_removed:
            continue
        free = 0
        for joint in item.joints:
            value, by = free_value(scene, index, joint.part, joint.upper)
            share = (value - joint.lower) / (joint.upper - joint.lower)
            free += share >= 0.5
            if joint.kind is JointKind.PRISMATIC and item.kind is ItemKind.OBJECT:
                counts["drawers"] += 1
                counts["drawers free"] += share >= _WIDE
                if share < _WIDE:
                    print(f"{house.id}: {item.name}/{joint.part} stops before {by}", flush=True)
        counts["joints"] += len(item.joints)
        counts["free"] += free
        if is_opened(item):
            counts["things"] += 1
            counts["with joints"] += bool(item.joints)
            counts["open"] += bool(free)
            if not free:
                lacking.add(item.name)
    return lacking


def is_opened(item: Item) -> bool:
    """Whether people open it: a door with a leaf, or what has doors, drawers or a lid; no window."""
    if item.kind is ItemKind.WINDOW or _NOTHING.search(item.name):
        return False
    if item.kind is ItemKind.DOOR or item.joints:
        return True
    return item.kind is ItemKind.OBJECT and bool(item.n_faces) and bool(_OPENED.search(item.name))


if __name__ == "__main__":
    main(sys.argv[1:])
