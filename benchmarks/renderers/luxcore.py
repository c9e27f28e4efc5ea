"""Against LuxCore: path tracing and bidirectional Metropolis at equal CPU time, scene by scene.

`make bench-luxcore` installs `pyluxcore` (Apache-2.0) into out/luxcore-venv and runs this. Scenes
are written to out/bench/luxcore as the tables that our own kernels gather from;
benchmarks/renderers/luxcore_scene.py, a process of its own, renders them: LuxCore's PATHCPU and BIDIRCPU, each
with its Sobol and with its Metropolis sampler. LUXCORE_SCENES="door home" names some scenes.

Scenes: the rooms of benchmarks/light/shots.py and the first stored camera of three example homes, their
coats taken off. Both engines: the sum of all light, 64x48 pixels, box filter, 12 segments, no denoiser, no
clamping, all cores. LuxCore's roulette is on where its pictures stay right with it: in PATHCPU where
no sky shines (docs/lab/light.md).

Method. Our Metropolis with its usual settings and MUTATIONS a pixel (HOME_MUTATIONS in homes, where one
costs more) says how much CPU time a picture has, bootstrap, pilot and direct light counted; `path` gets as many samples as fit into it, LuxCore's threads are stopped when they have had
it (loading, BVH, kernels before the clock). PICTURES of each, other seeds. All errors are relative, as
in benchmarks/light/equal_time.py, to one reference, the mean of N_REFERENCE more pictures of our Metropolis, here
the least noisy: squares of luminance are divided by ref^2 + 1e-3 mean(ref)^2. relMSE is the mean over
pixels of the variance between an engine's pictures: no noise of the reference counts, nor what the
engines' materials differ by. The median pixel's error is against the reference, whose noise is
small in the median. Ratios are ours over LuxCore's at equal CPU time, below 1 favours ours. That the
light is the same is shown beside: every engine's mean picture over that of our `path`, mean
luminance and the median of 48 blocks. light.vs_luxcore* are medians over the homes.
"""

from __future__ import annotations

import functools
import json
import math
import os
import subprocess
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.figures import FOLDER, write_report
from benchmarks.light.shots import Shot
from benchmarks.light.table_rows import (
    LUXCORE_ROOMS,
    RENDERED_HOMES,
    luxcore_costs_head,
    luxcore_costs_row,
    luxcore_lights_head,
    luxcore_lights_row,
)
from benchmarks.renderers.exchange import home_without_coats, without_coats, write_scene
from benchmarks.renderers.picture_noise import blocks
from pbrs_farm.core.camera import Camera, Intrinsics
from pbrs_farm.core.frames import LUMINANCE, linear_from_srgb
from pbrs_farm.core.house import House
from pbrs_farm.core.recipe import LightFields, Recipe
from pbrs_farm.raycast.variant import choose_variant
from pbrs_farm.transport.light_scene import LightScene
from pbrs_farm.transport.scene_tables.portals import portals_of_house
from pbrs_farm.transport.scene_tables.scene_tables import tables_from_house
from pbrs_farm.transport.scene_tables.sky import Sky, dark_sky, sunsky
from tests.transport import hard_rooms

SIZE = (64, 48)
MUTATIONS, HOME_MUTATIONS = 128, 16
CHAINS = 16384
PICTURES = 4
N_REFERENCE = 4
PLAIN = LightFields(filter="box", denoise=False)
METROPOLIS = PLAIN.model_copy(update={"integrator": "metropolis", "chains": CHAINS})
THEIRS = {
    "lux_path": ("PATHCPU", "SOBOL"),
    "lux_path_metropolis": ("PATHCPU", "METROPOLIS"),
    "lux_bidir": ("BIDIRCPU", "SOBOL"),
    "lux_bidir_metropolis": ("BIDIRCPU", "METROPOLIS"),
}
PAIRS = {"": ("metropolis", "lux_bidir_metropolis"), "path_": ("path", "lux_path")}
"""Whose errors are compared: figures' prefix -> (ours, LuxCore's)."""

PYTHON = Path(os.environ.get("LUXCORE_PYTHON", "out/luxcore-venv/bin/python"))
SCRIPT = Path(__file__).with_name("luxcore_scene.py")
FILES = FOLDER / "luxcore"


@dataclass(frozen=True, slots=True, eq=False)
class Run:
    """Pictures of one engine, (N, H, W, 3) radiance of other seeds; cpu_s: of one."""

    pictures: NDArray[np.float64]
    cpu_s: float


def main() -> None:
    """Measure, print tables in markdown, write out/bench/luxcore.json and luxcore.png."""
    figures: dict[str, float] = {}
    costs, lights, rows = luxcore_costs_head(), luxcore_lights_head(), []
    makers = _shot_makers()
    for key in os.environ.get("LUXCORE_SCENES", "").split() or makers:
        shot = makers[key]()
        reference, runs = _runs(shot)
        found = _figures(reference, runs)
        costs.append(luxcore_costs_row(shot.name, found))
        lights.append(luxcore_lights_row(shot.name, found))
        print("\n".join((costs[-1], lights[-1])), flush=True)
        names = ("path", "metropolis", "lux_path", "lux_bidir_metropolis")
        rows.append([*(runs[n].pictures[0] for n in names), reference])
        figures |= {f"light.luxcore_{shot.key}_{name}": v for name, v in found.items()}
    _write_rows(rows)
    figures |= _medians(figures)
    units = {name: _unit(name) for name in figures}
    write_report("luxcore", {k: float(f"{v:.4g}") for k, v in figures.items()}, units)
    print("\n" + "\n".join(costs), "\n" + "\n".join(lights), sep="\n")


def _unit(name: str) -> str:
    if name.startswith("light.vs_"):
        return "x less CPU time than LuxCore to its error, median over homes"
    return "s CPU of a picture" if name.endswith("_s") else "-"


def _medians(figures: dict[str, float]) -> dict[str, float]:
    """Over the homes that were measured: how many times less CPU ours takes to LuxCore's errors."""
    found = {}
    for prefix in PAIRS:
        for end in ("relmse", "median"):
            names = [f"light.luxcore_{key}_{prefix}{end}_ratio" for key in RENDERED_HOMES]
            # An error falls with the root of CPU time, a squared one with CPU time.
            power = 1 if end == "relmse" else 2
            values = [figures[name] ** -power for name in names if name in figures]
            if values:
                of_median = "_median" if end == "median" else ""
                found[f"light.vs_luxcore_{prefix or 'metropolis_'}".rstrip("_") + of_median] = (
                    float(np.median(values))
                )
    return found


# Scenes.


def _shot_makers() -> dict[str, Callable[[], Shot]]:
    sun = sunsky(Recipe(), elevation_rad=0.6, azimuth_rad=0.35)
    return {
        "door": lambda: _room("door", hard_rooms.door_ajar(), dark_sky()),
        "globe": lambda: _room("globe", hard_rooms.glass_globe(), dark_sky()),
        "sunlit": lambda: _room("sunlit", hard_rooms.sunlit(), sun),
        "shade": lambda: _room("shade", hard_rooms.open_shade(), dark_sky()),
        **{key: functools.partial(_home, key) for key in RENDERED_HOMES},
    }


def _room(key: str, room: tuple[House, Camera], sky: Sky) -> Shot:
    house, camera = room
    tables = without_coats(tables_from_house(house, {}, Recipe()))
    scene = LightScene(tables, sky, portals_of_house(house), choose_variant())
    _export(key, scene, house, {})
    return Shot(key, LUXCORE_ROOMS[key], scene, camera.with_size(*SIZE))


def _home(key: str) -> Shot:
    house, scene, textures = home_without_coats(RENDERED_HOMES[key])
    _export(key, scene, house, textures)
    stored = house.cameras[0]
    intrinsics = Intrinsics.from_hfov(*SIZE, stored.hfov_rad)
    camera = Camera.look(intrinsics, stored.eye, stored.towards)
    return Shot(key, RENDERED_HOMES[key], scene, camera)


def _export(
    key: str, scene: LightScene, house: House, textures: dict[str, NDArray[np.uint8]]
) -> None:
    """Write the scene, its dome and its textures (linear, float32) into FILES/key.

    Raises ValueError when a lamp's faces do not look outwards: LuxCore's shine from the front.
    """
    tables = scene.tables
    for k in range(len(tables.lamps)):
        corners = tables.positions[tables.faces[tables.face_tags >> 16 == k]].astype(np.float64)
        corners -= corners.mean((0, 1))
        if np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).min() <= 0:
            raise ValueError(f"{house.id}: {tables.lamps[k].name} is no bulb with faces outwards")
    write_scene(FILES / key, tables, scene.sky, house, textures)
    np.save(FILES / key / "dome.npy", scene.sky.dome)
    for name, picture in textures.items():
        rgb = picture[..., :3] if picture.ndim == 3 else np.repeat(picture[..., None], 3, 2)
        np.save(FILES / key / f"{name}.npy", linear_from_srgb(rgb / 255).astype(np.float32))


# Pictures.


def _runs(shot: Shot) -> tuple[NDArray[np.float64], dict[str, Run]]:
    """(reference, pictures of every engine by name)."""
    n_mutations = HOME_MUTATIONS if shot.key in RENDERED_HOMES else MUTATIONS
    fields = METROPOLIS.model_copy(update={"mutations_per_pixel": n_mutations})
    reference = np.mean([_timed(shot, fields, 990 + k)[0] for k in range(N_REFERENCE)], 0)
    chains = _our_run(shot, fields)
    _trial, trial_s = _timed(shot, PLAIN.model_copy(update={"spp": 256}), 3)
    equal = PLAIN.model_copy(update={"spp": max(round(256 * chains.cpu_s / trial_s), 1)})
    ours = {"path": _our_run(shot, equal), "metropolis": chains}
    return reference, ours | _their_runs(shot, chains.cpu_s)


def _our_run(shot: Shot, fields: LightFields) -> Run:
    found = [_timed(shot, fields, 10 + k) for k in range(PICTURES)]
    return Run(np.stack([p for p, _s in found]), float(np.mean([s for _p, s in found])))


def _timed(shot: Shot, fields: LightFields, seed: int) -> tuple[NDArray[np.float64], float]:
    """(picture, CPU seconds of all threads); kernels are compiled before the clock starts."""
    few = {"spp": 1, "direct_spp": 1, "mutations_per_pixel": 1}
    shot.scene.render(shot.camera, "-", fields.model_copy(update=few), seed)
    began = time.process_time()
    result = shot.scene.render(shot.camera, "-", fields, seed)
    spent = time.process_time() - began
    return np.asarray(result.outdoor + result.indoor, np.float64), spent


def _their_runs(shot: Shot, cpu_s: float) -> dict[str, Run]:
    """LuxCore's pictures. Raises CalledProcessError when its program fails."""
    i = shot.camera.intrinsics
    camera = {
        "hfov_rad": 2 * math.atan(0.5 * i.width_px / i.fx),
        "world_from_camera": shot.camera.world_from_camera.tolist(),
    }
    jobs = [
        {
            "scene": shot.key,
            "camera": camera,
            "size": [i.width_px, i.height_px],
            "engine": engine,
            "sampler": sampler,
            "roulette": engine == "PATHCPU" and float(shot.scene.sky.dome.max()) == 0,
            "max_depth": PLAIN.max_depth,
            "seed": 100 * (k + 1),
            "cpu_s": cpu_s,
            "file": f"{shot.key}_{name}_{k}.npy",
        }
        for name, (engine, sampler) in THEIRS.items()
        for k in range(PICTURES)
    ]
    (FILES / "jobs.json").write_text(json.dumps(jobs))
    done = subprocess.run(
        [str(PYTHON), str(SCRIPT), str(FILES)], stdout=subprocess.PIPE, text=True, check=True
    )
    lines = [json.loads(x) for x in done.stdout.splitlines() if x.startswith("{")]
    spent = {line["file"]: line["cpu_s"] for line in lines}
    runs = {}
    for number, name in enumerate(THEIRS):
        files = [j["file"] for j in jobs[number * PICTURES : (number + 1) * PICTURES]]
        pictures = np.stack([np.load(FILES / f).astype(np.float64) for f in files])
        runs[name] = Run(pictures, float(np.mean([spent[f] for f in files])))
    return runs


# Figures.


def _figures(reference: NDArray[np.float64], runs: dict[str, Run]) -> dict[str, float]:
    truth = reference @ LUMINANCE
    scale = truth**2 + 1e-3 * truth.mean() ** 2
    level = runs["path"].pictures.mean(0) @ LUMINANCE
    lit = blocks(level) > 0
    found = {"cpu_s": runs["metropolis"].cpu_s}
    for name, run in runs.items():
        pictures = run.pictures @ LUMINANCE
        mean = pictures.mean(0)
        found |= {
            f"{name}_relmse": float(np.mean(pictures.var(0, ddof=1) / scale)),
            f"{name}_median": math.sqrt(float(np.median((pictures - truth) ** 2 / scale))),
            f"{name}_cpu_s": run.cpu_s,
            f"{name}_mean_over_path": float(mean.mean() / level.mean()),
            f"{name}_blocks_over_path": float(np.median(blocks(mean)[lit] / blocks(level)[lit])),
        }
    for prefix, (a, b) in PAIRS.items():
        times = runs[a].cpu_s / runs[b].cpu_s
        relmse = found[f"{a}_relmse"] / found[f"{b}_relmse"]
        median = found[f"{a}_median"] / found[f"{b}_median"]
        found[f"{prefix}relmse_ratio"] = relmse * times
        found[f"{prefix}median_ratio"] = median * math.sqrt(times)
    return found


# What is drawn.


def _write_rows(rows: Sequence[Sequence[NDArray[np.float64]]]) -> None:
    """luxcore.png, a row a scene, one exposure: path and Metropolis, LuxCore's two, reference."""
    from pbrs_farm.images import png_from_array
    from pbrs_farm.transport.develop.tone_mapping import exposure_of, tone

    fields = Recipe().tone
    shown = []
    for row in rows:
        exposure = exposure_of(row[-1].astype(np.float32), fields)
        toned = [tone(p.astype(np.float32), fields, exposure=exposure) for p in row]
        shown.append(np.concatenate(toned, 1))
    sheet = np.concatenate(shown).repeat(3, 0).repeat(3, 1)
    (FOLDER / "luxcore.png").write_bytes(png_from_array(sheet))


if __name__ == "__main__":
    main()
