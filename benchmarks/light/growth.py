"""Cost of a view as a home grows: triangles up to 4 million, lamps up to 500; CPU of all threads.

A room of 6x6x3 m with a table of ever finer waves, seen by one camera. Then ever more bulbs below its ceiling
(`lamps`), and ten there with ever more in a hall next door (`lamps_of_a_home`), their light the same in sum, bulbs
and waves together always of TRIANGLES_OF_LAMPS, so that lamps alone grow.

`times` is of whole views of the recipe `fast`, as a user gets them. Until 850a6d3 it was reckoned from samples of a
small picture (160x120, 16 samples), which are not those of `fast`: below 4 million samples there is no trial
(transport/pilot.py), so that rays are guided where nothing is hidden and no shadow ray is left out that seldom arrives.
That number, the larger one, goes on as `small_times`. Two to three minutes on two quiet cores.
"""

from __future__ import annotations

import resource
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any, Final, NamedTuple

import numpy as np

from benchmarks.figures import write_report
from pbrs_farm.core.house import House, Item, Surface
from pbrs_farm.core.recipe import recipe_from_name
from pbrs_farm.repair.lamps.bulbs import icosphere
from pbrs_farm.transport.light_scene import LightScene
from pbrs_farm.transport.scene_tables.sky import sunsky
from pbrs_farm.transport.validation import known_rooms as rooms

TRIANGLES: Final = (100_000, 1_000_000, 4_000_000)
LAMPS: Final = (10, 100, 500)
TRIANGLES_OF_LAMPS: Final = 300_000  # of the room in which lamps grow, bulbs included
BULB_TRIANGLES: Final = 320  # of a bulb as repair makes it
SIZE: Final = (640, 480)
SMALL_SIZE: Final = (160, 120)
SMALL_SPP: Final = 16
_BULB_M: Final = 0.03
_HALL_M: Final = 30.0
_LUMEN: Final = 4000.0  # of all bulbs together


class Cost(NamedTuple):
    """CPU of one house."""

    view_s: float  # of a `fast` view
    sample_us: float  # of one of its samples, in microseconds
    pilot_s: float  # of its pilot and its trial
    small_view_s: float  # of a `fast` view, reckoned from a small one
    load_s: float


def main() -> None:
    """Measure both and write out/bench/growth.json."""
    figures: dict[str, Any] = {}
    units: dict[str, str] = {}
    for name, values, make in (
        ("triangles", TRIANGLES, lambda n: waves_room(n, 1)),
        ("lamps", LAMPS, lambda n: waves_room(_without_bulbs(n), n)),
        ("lamps_of_a_home", LAMPS, lambda n: waves_room(_without_bulbs(n), n, LAMPS[0])),
    ):
        costs = [_cost(make(value)) for value in values]
        for value, cost in zip(values, costs, strict=True):
            key, first = f"light.{name}_{value}", f"the CPU of a view with {values[0]:,}"
            figures[f"{key}_us"] = round(cost.sample_us, 3)
            figures[f"{key}_pilot_s"] = round(cost.pilot_s, 3)
            figures[f"{key}_load_s"] = round(cost.load_s, 2)
            units |= {f"{key}_us": "microseconds of CPU a sample", f"{key}_pilot_s": "s CPU"}
            units[f"{key}_load_s"] = "s CPU"
            for end, of_first in (
                ("times", cost.view_s / costs[0].view_s),
                ("small_times", cost.small_view_s / costs[0].small_view_s),
            ):
                figures[f"{key}_{end}"], units[f"{key}_{end}"] = round(of_first, 3), first
        text = f"times the CPU, {values[-1]:,} over {values[0]:,}"
        for kind, end in (("", "times"), ("_small", "small_times")):
            figures[f"light.by_{name}{kind}"] = figures[f"light.{name}_{values[-1]}_{end}"]
            units[f"light.by_{name}{kind}"] = text
    figures["light.growth_peak_mb"] = round(
        resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1000
    )
    units["light.growth_peak_mb"] = "MB resident"
    write_report("growth", figures, units)


def _without_bulbs(n_lamps: int) -> int:
    """Triangles of the waves where all triangles are TRIANGLES_OF_LAMPS."""
    return TRIANGLES_OF_LAMPS - BULB_TRIANGLES * n_lamps


def waves_room(n_triangles: int, n_lamps: int, n_in_room: int = 0) -> House:
    """A closed room with a window, a waved table of n_triangles and n_lamps bulbs.

    n_in_room: how many of them, the others in a hall next door; 0 = all.
    """
    surfaces = rooms.shell((6.0, 3.0, 6.0), 0, front=False)
    surfaces += rooms.panel((0, 0, -0.1), (6.0, 3.0, 0.0), (2.0, 1.0, 4.0, 2.0), 0)
    surfaces.append(_waves(n_triangles))
    # Behind the wall, out of sight, stands a closed hall with all but the first lamps of the room.
    n_here = min(n_lamps, n_in_room or n_lamps)
    lamps = _bulbs(n_here, (0.0, 6.0), _LUMEN / n_here)
    if n_lamps > n_here:
        hall = rooms.shell((_HALL_M, 3.0, _HALL_M), 0, front=True)
        surfaces += [
            replace(s, positions=s.positions + np.asarray([7, 0, 0], np.float32)) for s in hall
        ]
        lamps += _bulbs(n_lamps - n_here, (7.0, _HALL_M), _LUMEN / n_here)
    materials = [rooms.matte("wall", 0.7), rooms.matte("table", 0.4, 0.3, 0.2), rooms.BULB]
    return rooms.house(surfaces, materials, lamps=lamps)


def _bulbs(n: int, along: tuple[float, float], lumen: float) -> list[Item]:
    """n bulbs of repair's kind in a square grid below the ceiling. along: begin and length in m."""
    begin, length = along
    side = int(np.ceil(np.sqrt(n)))
    step = (length - 1) / side
    bulbs = []
    for k in range(n):
        x, z = begin + 0.5 + (k % side + 0.5) * step, 0.5 + (k // side + 0.5) * step
        surfaces = (icosphere("bulb", np.array([x, 2.7, z]), _BULB_M, 2),)
        lamp = rooms.bulb((x, 2.7, z), 2, lumen, radius=_BULB_M)
        bulbs.append(replace(lamp, surfaces=surfaces))
    return bulbs


def _waves(n_triangles: int) -> Surface:
    """A square of 4x4 m at 0.8 m, waved like cloth."""
    n = int(np.sqrt(n_triangles / 2))
    x, z = np.meshgrid(np.linspace(1, 5, n + 1), np.linspace(1, 5, n + 1))
    y = 0.8 + 0.05 * np.sin(9 * x) * np.cos(7 * z)
    points = np.stack([x, y, z], -1).reshape(-1, 3).astype(np.float32)
    corner = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    a, b, c, d = corner, corner + 1, corner + n + 1, corner + n + 2
    faces = np.concatenate([np.stack([a, c, b], -1), np.stack([b, c, d], -1)]).astype(np.int32)
    return Surface("waves", points, faces, 1)


def _cost(house: House) -> Cost:
    """What a house costs in one camera; prints a line."""
    recipe = recipe_from_name("fast")
    camera = rooms.camera((0.5, 2.0, 5.5), (3.0, 0.8, 3.0))
    sky = sunsky(recipe, elevation_rad=0.6, azimuth_rad=0.35)
    load_s, scene = _cpu_s(LightScene.load, house, {}, recipe, sky)
    small, fields = camera.with_size(*SMALL_SIZE), recipe.light
    few = fields.model_copy(update={"spp": SMALL_SPP})
    n_small, n_samples = (w * h * f.spp for (w, h), f in ((SMALL_SIZE, few), (SIZE, fields)))
    # Compile, then render small pictures, the second seed against a disturbance.
    scene.render(small, "-", fields.model_copy(update={"spp": 1}), 1)
    small_pilot_s = min(_cpu_s(scene.emitters, small, few, seed)[0] for seed in range(2))
    small_s = min(_cpu_s(scene.render, small, "-", few, seed)[0] for seed in range(2))
    # Render a whole view, its pilot apart as well.
    sized = camera.with_size(*SIZE)
    pilot_s, _weights = _cpu_s(scene.emitters, sized, fields, 0)
    view_s, _result = _cpu_s(scene.render, sized, "-", fields, 0)
    sample_us = (view_s - pilot_s) / n_samples * 1e6
    small_view_s = (small_s - small_pilot_s) / n_small * n_samples + small_pilot_s
    print(
        f"{sample_us:.2f} us a sample, pilot {pilot_s:.2f} s, a view {view_s:.1f} s, by small"
        f" pictures {small_view_s:.1f} s, {load_s:.1f} s to load",
        flush=True,
    )
    return Cost(view_s, sample_us, pilot_s, small_view_s, load_s)


def _cpu_s(work: Callable[..., Any], *arguments: Any) -> tuple[float, Any]:
    """(seconds of CPU that work takes, what it returns)."""
    began = time.process_time()
    result = work(*arguments)
    return time.process_time() - began, result


if __name__ == "__main__":
    main()
