"""Cost of a sample as a home grows: triangles up to 4 million, lamps up to 500; CPU of all threads.

A room of 6x6x3 m with a table of ever finer waves, seen by one camera, 160x120, 16 samples. Then ever more bulbs below
its ceiling (`lamps`), and ten there with ever more in a hall next door (`lamps_of_a_home`), their light the same in
sum, bulbs and waves together always of TRIANGLES_OF_LAMPS, so that lamps alone grow. The pilot, whose lanes are one for
each lamp, is a view's own: it is measured apart, and the ratios are of a whole view of recipe `fast` (640x480, 32
samples), reckoned from both. 35 seconds on two quiet cores.
"""

from __future__ import annotations

import resource
import time
from dataclasses import replace
from typing import Any, Final

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
SIZE: Final = (160, 120)
SPP: Final = 16
_BULB_M: Final = 0.03
_HALL_M: Final = 30.0
_LUMEN: Final = 4000.0  # of all bulbs together
_FAST_SAMPLES: Final = 640 * 480 * recipe_from_name("fast").light.spp


def main() -> None:
    """Measure both and write out/bench/growth.json."""
    figures: dict[str, Any] = {}
    units: dict[str, str] = {}
    for name, values, make in (
        ("triangles", TRIANGLES, lambda n: waves_room(n, 1)),
        ("lamps", LAMPS, lambda n: waves_room(_without_bulbs(n), n)),
        ("lamps_of_a_home", LAMPS, lambda n: waves_room(_without_bulbs(n), n, LAMPS[0])),
    ):
        costs = []
        for value in values:
            sample_us, pilot_s, load_s = _cost(make(value))
            costs.append(sample_us * 1e-6 * _FAST_SAMPLES + pilot_s)
            key = f"light.{name}_{value}"
            figures |= {f"{key}_us": round(sample_us, 3), f"{key}_pilot_s": round(pilot_s, 3)}
            figures[f"{key}_load_s"] = round(load_s, 2)
            figures[f"{key}_times"] = round(costs[-1] / costs[0], 3)
            units |= {f"{key}_us": "microseconds of CPU a sample", f"{key}_pilot_s": "s CPU"}
            units[f"{key}_load_s"] = "s CPU"
            units[f"{key}_times"] = f"the CPU of a `fast` view with {values[0]:,}"
            print(
                f"{value:>9} {name:<16}{sample_us:>8.2f} us a sample, pilot {pilot_s:.2f} s,"
                f" {load_s:.1f} s to load",
                flush=True,
            )
        figures[f"light.by_{name}"] = figures[f"{key}_times"]
        units[f"light.by_{name}"] = f"times the CPU, {values[-1]:,} over {values[0]:,}"
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
        surfaces += [replace(s, positions=s.positions + np.float32([7, 0, 0])) for s in hall]
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


def _cost(house: House) -> tuple[float, float, float]:
    """(microseconds of CPU a sample, seconds of CPU of a view's pilot, seconds of CPU to load)."""
    recipe = recipe_from_name("fast")
    camera = rooms.camera((0.5, 2.0, 5.5), (3.0, 0.8, 3.0)).with_size(*SIZE)
    sky = sunsky(recipe, elevation_rad=0.6, azimuth_rad=0.35)
    began = time.process_time()
    scene = LightScene.load(house, {}, recipe, sky)
    load_s = time.process_time() - began
    fields = recipe.light.model_copy(update={"spp": SPP})
    scene.render(camera, "-", fields.model_copy(update={"spp": 1}), 1)
    pilots, views = [], []
    for seed in range(2):
        began = time.process_time()
        scene.emitters(camera, fields, seed)
        pilots.append(time.process_time() - began)
        began = time.process_time()
        scene.render(camera, "-", fields, seed)
        views.append(time.process_time() - began)
    pilot_s = min(pilots)
    return (min(views) - pilot_s) / (SIZE[0] * SIZE[1] * SPP) * 1e6, pilot_s, load_s


if __name__ == "__main__":
    main()
