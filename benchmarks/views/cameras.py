"""Camera sampling: candidates a second, against a moderngl loop and Mitsuba's bare ray rate.

`python -m benchmarks.views.cameras --home NAME` samples one home in this process and prints JSON: the
bench runs it in a process of its own, with an empty kernel cache.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from benchmarks.figures import write_report
from benchmarks.memory import peak_mb
from benchmarks.views import view_content
from pbrs_farm.assets import homes_package
from pbrs_farm.assets.debian import cache_folder
from pbrs_farm.core.camera import Camera, Intrinsics
from pbrs_farm.core.house import Geometry, House, geometry_from_house
from pbrs_farm.core.recipe import CameraFields, Recipe
from pbrs_farm.prepare.read_source import read_house
from pbrs_farm.prepare.source import resolve
from pbrs_farm.raycast.caster import Caster
from pbrs_farm.repair import repair
from pbrs_farm.sample.camera_report import Verdict
from pbrs_farm.sample.eye_probes import count_items
from pbrs_farm.sample.house_sampler import sample_cameras
from pbrs_farm.sample.view_score import object_columns, paper_score

HOME = "2BedroomApartmentWithBowWindow"
SIZE = (160, 120)
N_CANDIDATES, N_GL, N_BARE = 3000, 300, 200


def main() -> None:
    """Measure, print the tables and write out/bench/cameras.json."""
    house = _repaired(HOME)
    geometry = geometry_from_house(house)
    caster = Caster(geometry)
    cameras = _eligible(house, caster)
    columns = object_columns(house)

    def score() -> None:
        for _part, rows in count_items(caster.item_counts, cameras, len(house.items)):
            paper_score(rows, columns, 0.01)

    seconds = _best(score)
    per_s = len(cameras) / seconds
    mrays = per_s * SIZE[0] * SIZE[1] / 1e6
    bare = _bare_mrays(geometry, cameras[:N_BARE])
    gl_per_s = _gl_per_s(geometry, cameras[:N_GL], len(house.items))
    print(f"{HOME}: {len(geometry.faces)} triangles, {len(cameras)} candidates scored")
    print(f"{'':<28}{'candidates/s':>14}{'Mrays/s':>10}")
    print(f"{'item counts and scores':<28}{per_s:>14.0f}{mrays:>10.1f}")
    print(f"{'Mitsuba, bare intersection':<28}{'':>14}{bare:>10.1f}")
    print(f"{'moderngl loop':<28}{gl_per_s:>14.1f}")

    rows = {home.name: _home_in_a_process(home.name) for home in homes_package.example_homes()}
    print(f"\n{'home':<32}{'s':>7}{'candidates':>12}{'views':>7}{'peak MB':>9}")
    for name, row in rows.items():
        line = f"{row['seconds']:>7.1f}{row['candidates']:>12}{row['views']:>7}{row['peak_mb']:>9}"
        print(f"{name:<32}{line}")
    content = _contents([home.name for home in homes_package.example_homes()])
    figures = {
        "cameras.candidates_per_s": round(per_s, 1),
        "cameras.vs_gl": round(per_s / gl_per_s, 1),
        "cameras.gl_per_s": round(gl_per_s, 1),
        "cameras.mrays_per_s": round(mrays, 2),
        "cameras.bare_mrays_per_s": round(bare, 2),
        "cameras.of_bare_rays": round(mrays / bare, 3),
        "cameras.home_s": round(rows[HOME]["seconds"], 1),
        "cameras.nine_homes_s": round(sum(row["seconds"] for row in rows.values()), 1),
        "cameras.peak_mb": max(row["peak_mb"] for row in rows.values()),
    }
    units = dict.fromkeys(figures, "1/s") | {
        "cameras.vs_gl": "times",
        "cameras.mrays_per_s": "Mrays/s",
        "cameras.bare_mrays_per_s": "Mrays/s",
        "cameras.of_bare_rays": "fraction",
        "cameras.home_s": "s",
        "cameras.nine_homes_s": "s",
        "cameras.peak_mb": "MB",
    }
    # The gates are on `photo`; the paper's own numbers stand beside them.
    for preset, numbers in content.items():
        prefix = "cameras." if preset == "photo" else f"cameras.{preset}_"
        figures |= {prefix + name: value for name, value in numbers.items()}
        units |= {prefix + name: view_content.UNITS[name] for name in numbers}
    write_report("cameras", figures, units)


def _contents(names: list[str]) -> dict[str, dict[str, float]]:
    """Preset -> what its views show over all homes."""
    found: dict[str, dict[str, float]] = {}
    for preset in view_content.PRESETS:
        rows = [_in_a_process("--content", preset, "--home", name) for name in names]
        found[preset] = view_content.content_figures(rows)
        print(f"{preset}: {found[preset]}")
    return found


def _repaired(name: str) -> House:
    recipe = Recipe()
    house = read_house(resolve(name), recipe.read)

    def occluder_from(some: House) -> Caster:
        return Caster.of_house(some)

    return repair(house, recipe.repair, occluder_from=occluder_from)[0]


def _eligible(house: House, caster: Caster) -> list[Camera]:
    """Candidates that the rules of place keep, at the coarse size, spread over the rooms."""
    sampling = sample_cameras(house, CameraFields(), 0, caster.item_counts)
    full = Intrinsics.from_hfov(640, 480).resized(*SIZE)
    cameras: list[Camera] = []
    for trace in sampling.traces:
        which = np.flatnonzero(trace.verdict >= Verdict.FILLED_BY_ONE)
        cameras += trace.candidates.cameras(which, full)
    step = max(1, len(cameras) // N_CANDIDATES)
    return cameras[::step][:N_CANDIDATES]


def _best(work: Callable[[], object], times: int = 3) -> float:
    seconds = []
    for _ in range(times):
        started = time.perf_counter()
        work()
        seconds.append(time.perf_counter() - started)
    return min(seconds)


def _bare_mrays(geometry: Geometry, cameras: list[Camera]) -> float:
    """Mitsuba's own rate: a default scene, coherent rays that lie ready in memory, t alone."""
    import drjit as dr

    from pbrs_farm.raycast.mitsuba_mesh import mitsuba_mesh
    from pbrs_farm.raycast.variant import choose_variant, mitsuba

    mi = mitsuba(choose_variant())
    mesh = mitsuba_mesh(mi, "house", geometry.positions, geometry.faces)
    scene = mi.load_dict({"type": "scene", "house": mesh})
    pairs = [camera.rays() for camera in cameras]
    directions = np.concatenate([d.reshape(-1, 3) for _o, d in pairs])
    origins = np.repeat([o for o, _d in pairs], SIZE[0] * SIZE[1], axis=0)
    ray = mi.Ray3f(
        mi.Point3f(np.ascontiguousarray(origins.T)), mi.Vector3f(np.ascontiguousarray(directions.T))
    )
    dr.eval(ray)

    def trace() -> None:
        t = scene.ray_intersect_preliminary(ray, True).t
        dr.eval(t)
        dr.sync_thread()

    trace()
    return len(directions) / _best(trace) / 1e6


def _gl_per_s(geometry: Geometry, cameras: list[Camera], n_items: int) -> float:
    """Candidates a second of a loop that draws each one and counts its pixels on the CPU."""
    from benchmarks.views.gl_items import GlItems

    gl = GlItems(geometry, *SIZE)

    def draw() -> None:
        for camera in cameras:
            np.bincount(gl.item_buffer(camera).ravel(), minlength=n_items + 1)

    seconds = _best(draw, times=2)
    gl.release()
    return len(cameras) / seconds


def _home_in_a_process(name: str) -> dict[str, float]:
    """Sample a home in a fresh process that has no compiled kernel yet."""
    with tempfile.TemporaryDirectory() as empty:
        environment = os.environ | {"HOME": empty, "PBRS_CACHE": str(cache_folder())}
        return _in_a_process("--home", name, env=environment)


def _in_a_process(*words: str, env: Mapping[str, str] | None = None) -> dict[str, Any]:
    done = subprocess.run(
        [sys.executable, "-m", "benchmarks.views.cameras", *words],
        env=env,
        stdout=subprocess.PIPE,
        text=True,
        check=True,
    )
    row: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return row


def _sample_home(name: str) -> None:
    house = _repaired(name)
    started = time.perf_counter()
    caster = Caster.of_house(house)
    report = sample_cameras(house, CameraFields(), 0, caster.item_counts).report
    seconds = time.perf_counter() - started
    row = {"seconds": seconds, "candidates": report.n_candidates, "views": report.n_views}
    print(json.dumps(row | {"peak_mb": round(peak_mb())}))


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--home", default="")
    parser.add_argument("--content", default="", help="preset whose views of the home are told")
    given = parser.parse_args()
    if given.content:
        print(json.dumps(view_content.measured_home(_repaired(given.home), given.content)))
    elif given.home:
        _sample_home(given.home)
    else:
        main()
