"""Cloths of 40 dressed homes: how far they are stretched, how deep they are in other things -> out/bench/cloths.json.

What is measured is the mesh that a home stores: its texture coordinates are metres of the cloth at rest.
"""

from __future__ import annotations

import os
import sys
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from typing import Any

import numpy as np

from benchmarks.dress.contacts import CLOTHS, Floats, Thing, depth_of_points, things_of
from benchmarks.figures import write_report
from pbrs_farm.core.house import Item, ItemKind

SEED = 1
MADE = tuple(f"made:{k}" for k in range(1, 31))
_TOLD = "found no way to fall"


def main(names: list[str] | None = None) -> None:
    """Measure the named homes, or all 40, print each cloth and write out/bench/cloths.json."""
    write_report("cloths", figures(names), UNITS)


def figures(names: list[str] | None = None) -> dict[str, Any]:
    """The figures of the cloths of some homes, each dressed by seed 1; of the 40 if none is named."""
    from pbrs_farm.assets import furniture_package, homes_package

    homes_package.fetch()
    furniture_package.fetch()
    names = names or [*(home.name for home in homes_package.example_homes()), *MADE]
    cloths, not_fallen = list[dict[str, Any]](), 0
    # A process that was forked from one with threads of its own may wait for them for ever.
    with ProcessPoolExecutor(len(os.sched_getaffinity(0)), get_context("spawn")) as pool:
        for name, (rows, n) in zip(names, pool.map(cloths_of_home, names), strict=True):
            for row in rows:
                print(name, *row.values(), flush=True)
            cloths += rows
            not_fallen += n
    return {
        "cloth.stretch_p99": max((row["stretch_p99"] for row in cloths), default=0.0),
        "cloth.deeper_than_thick": sum(row["deepest_m"] > row["thick_m"] for row in cloths),
        "cloth.deepest_mm": round(1000 * max((row["deepest_m"] for row in cloths), default=0.0), 1),
        "cloth.not_fallen": not_fallen,
        "cloth.n": len(cloths),
    }


UNITS = {
    "cloth.stretch_p99": "length over that at rest, 99th percentile of a cloth's edges, of the worst cloth",
    "cloth.deeper_than_thick": "cloths with a vertex deeper in another thing than they are thick",
    "cloth.deepest_mm": "mm, the deepest vertex of all in another thing",
    "cloth.not_fallen": "cloths that found no way to fall: they lie flat or are left out",
    "cloth.n": "cloths in these homes",
}


def cloths_of_home(name: str) -> tuple[list[dict[str, Any]], int]:
    """The measures of each cloth of a home dressed by seed 1, and how many found no way to fall."""
    from benchmarks.dress.dressed_home import house_as_a_run_has_it
    from pbrs_farm.core.recipe import recipe_from_name
    from pbrs_farm.dress.dressing import dress
    from pbrs_farm.prepare.dress_catalogue import catalogue_of

    recipe, source = recipe_from_name("fast"), house_as_a_run_has_it(name)
    house, report = dress(source, catalogue_of(recipe.dress), recipe.dress, SEED)
    not_fallen = sum(n for reason, n in report.refused.items() if _TOLD in reason)
    if not any(item.source_class.endswith(CLOTHS) for item in house.items):
        return [], not_fallen
    things = things_of(house, source)
    # Cloth lies on cloth, and what lies on it presses it.
    solid = [t for t in things if not t.item.source_class.endswith(CLOTHS)]
    solid = [t for t in solid if t.item.kind is not ItemKind.CEILING]
    cloths = [t for t in things if t.item.source_class.endswith(CLOTHS)]
    return [_measured(cloth, solid) for cloth in cloths], not_fallen


def _measured(cloth: Thing, solid: list[Thing]) -> dict[str, Any]:
    deepest = 0.0
    for other in solid:
        apart = np.minimum(cloth.bounds[1] - other.bounds[0], other.bounds[1] - cloth.bounds[0])
        if apart.min() > 0:
            deepest = max(deepest, depth_of_points(np.asarray(cloth.mesh.vertices), other))
    return {
        "cloth": cloth.item.source_class.rpartition("#")[2],
        "stretch_p99": round(float(np.percentile(stretches(cloth.item), 99)), 3),
        "deepest_m": round(deepest, 4),
        "thick_m": round(thickness_m(cloth.item), 4),
    }


def stretches(item: Item) -> Floats:
    """(E,) the length of each edge of a cloth's middle over that at rest.

    The middle lies between the two sides: of a bend the outer side is longer and the inner shorter.
    """
    surface, n = item.surfaces[0], _vertices_of_side(item)
    assert surface.uvs is not None
    points, rest = surface.positions.astype(np.float64), surface.uvs[:n].astype(np.float64)
    at = (points[:n] + points[n : 2 * n]) / 2
    faces = surface.faces[(surface.faces < n).all(1)]
    ends = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    ends = np.unique(np.sort(ends, axis=1), axis=0)
    length, at_rest = (np.linalg.norm(x[ends[:, 0]] - x[ends[:, 1]], axis=1) for x in (at, rest))
    return np.asarray(length / at_rest)


def thickness_m(item: Item) -> float:
    """How thick a cloth is, metres."""
    points = item.surfaces[0].positions.astype(np.float64)
    return float(np.linalg.norm(points[_vertices_of_side(item)] - points[0]))


def _vertices_of_side(item: Item) -> int:
    """How many vertices its upper side has; those of the lower follow in the same order."""
    uvs = item.surfaces[0].uvs
    assert uvs is not None
    return 1 + int(np.argmax((uvs[1:] == uvs[0]).all(1)))


if __name__ == "__main__":
    main(sys.argv[1:])
