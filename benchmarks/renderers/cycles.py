"""CPU to equal error against Blender's Cycles: `make bench NAME=cycles` -> out/bench/cycles.json.

Two stored cameras of six example homes, rendered by both: same triangles, textures, bulbs, dome, sun, cameras and path
length; box filter, no denoiser, no clamping, no adaptive sampling, all cores. Coats are removed for both, because
Blender's Principled coat lets more light through. `bpy` lives in out/cycles-venv (it needs numpy below 2): cycles_scene.py
runs there and shares only files with this module.

Cycles renders every view plain and with portals; the cheaper setting of a view counts. Its path guiding is not measured: in
six views it never paid for itself within 128 samples. relMSE is the variance between an engine's own pictures, over
ref^2 + 1e-3 mean(ref)^2, ref a long picture of that engine. Variance falls with 1 / samples, so relMSE x CPU is the cost of
a given error. CPU is of all threads: of Cycles the samples alone, without loading and BVH; of ours the whole picture with
pilot and guiding. relMSE depends on fireflies, so the squared error of the median pixel is measured too.
"""

from __future__ import annotations

import json
import math
import os
import subprocess
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from benchmarks.figures import FOLDER, write_report
from benchmarks.renderers.exchange import home_without_coats, write_scene
from pbrs_farm.core.camera import Camera, Intrinsics
from pbrs_farm.core.frames import LUMINANCE
from pbrs_farm.core.recipe import LightFields
from pbrs_farm.images import exr_from_layers, layers_from_exr, png_from_array
from pbrs_farm.transport.light_scene import LightScene

HOMES: Final = (
    "2BedroomApartment", "Studio", "3BedroomApartment", "2BedroomApartmentWithBowWindow",
    "3BedroomHouseWithAttic", "4BedroomHouse",
)  # fmt: skip
N_CAMERAS: Final = 2
WAYS: Final = {"plain": False, "portals": True}
"""Setting of Cycles -> whether openings have portals."""
PYTHON: Final = Path("out/cycles-venv/bin/python")
SCRIPT: Final = Path(__file__).with_name("cycles_scene.py")
FILES: Final = FOLDER / "cycles"
_METROPOLIS: Final = {"integrator": "metropolis", "mutations_per_pixel": 64, "direct_spp": 64}
_OUR_TIMES: Final = 4  # samples of our pictures over those of Cycles, because ours are guided
_N_SETUP: Final = 3  # pictures of one sample
FIELDS: Final = LightFields(filter="box", denoise=False)
VIEW_UNITS: Final = {
    "ours": "squared relative error x CPU-s of `path`",
    "theirs": "the same of Cycles, cheaper setting",
    "ratio": "CPU of Cycles over that of `path`, at equal relMSE",
    "ratio_median": "the same at equal error of the median pixel",
    "ratio_metropolis": "CPU of Cycles over that of Metropolis, at equal relMSE",
    "luminance": "mean luminance of Cycles' long picture over ours",
    "portals": "1: portals were the cheaper setting",
}


@dataclass(frozen=True, slots=True)
class Effort:
    """Picture size, samples per pixel, and number of pictures."""

    width: int = 64
    height: int = 48
    spp: int = 32
    reference_spp: int = 512
    n_pictures: int = 3


@dataclass(frozen=True, slots=True, eq=False)
class Run:
    """Pictures of one engine, (N, H, W) luminance of different seeds, and CPU seconds of a picture."""

    pictures: NDArray[np.float64]
    cpu_s: float

    def costs(self, reference: NDArray[np.float32], n_times: float) -> tuple[float, float]:
        """Error x CPU by relMSE and by the median pixel. n_times: samples of reference over those of a picture."""
        truth = reference.astype(np.float64) @ LUMINANCE
        scale = truth**2 + 1e-3 * truth.mean() ** 2
        relmse = float((self.pictures.var(0, ddof=1) / scale).mean())
        # The reference's own variance is part of the median's error.
        median = float(np.median((self.pictures - truth) ** 2 / scale)) / (1 + 1 / n_times)
        return relmse * self.cpu_s, median * self.cpu_s


def main() -> None:
    """Measure and write out/bench/cycles.json. CYCLES_HOMES, CYCLES_EFFORT="width height spp ..." measure less."""
    effort = Effort(*map(int, os.environ.get("CYCLES_EFFORT", "").split()))
    views: dict[str, dict[str, float]] = {}
    for home in os.environ.get("CYCLES_HOMES", "").split() or HOMES:
        for k, row in enumerate(views_of(home, effort)):
            views[f"{home.lower()}_{k}"] = row
            print(home, k, {name: float(f"{value:.3g}") for name, value in row.items()}, flush=True)
    figures = {f"light.cycles_{key}_{n}": v for key, row in views.items() for n, v in row.items()}
    units = {name: VIEW_UNITS[_end(name)] for name in figures}
    for end in ("ratio", "ratio_median", "ratio_metropolis"):
        values = [row[end] for row in views.values()]
        for quantile, suffix in ((0.5, ""), (0.25, "_q1"), (0.75, "_q3")):
            name = f"light.vs_cycles{end.removeprefix('ratio')}{suffix}"
            figures[name] = float(np.quantile(values, quantile))
            units[name] = f"{VIEW_UNITS[end]}, quantile {quantile} of {len(values)} views"
    luminance_apart = max(abs(row["luminance"] - 1) for row in views.values())
    figures["light.cycles_luminance_apart"] = luminance_apart
    units["light.cycles_luminance_apart"] = "largest relative difference of mean luminance"
    write_report("cycles", figures, units)


def _end(name: str) -> str:
    return next(end for end in sorted(VIEW_UNITS, key=len, reverse=True) if name.endswith(f"_{end}"))  # fmt: skip


def views_of(home: str, effort: Effort) -> list[dict[str, float]]:
    """The figures of a home's stored cameras."""
    house, scene, textures = home_without_coats(home)
    cameras = [
        Camera.look(Intrinsics.from_hfov(effort.width, effort.height, c.hfov_rad), c.eye, c.towards)
        for c in house.cameras[:N_CAMERAS]
    ]
    write_scene(FILES, scene.tables, scene.sky, house, textures)
    for name, picture in textures.items():
        (FILES / f"{name}.png").write_bytes(png_from_array(picture))
    # Blender's azimuth is a quarter turn off ours.
    dome = np.roll(scene.sky.dome, scene.sky.dome.shape[1] // 4, axis=1)
    layers = {c: np.ascontiguousarray(dome[..., k]) for k, c in enumerate("RGB")}
    (FILES / "dome.exr").write_bytes(exr_from_layers(layers))
    theirs = cycles_runs(cameras, effort)
    return [compared(scene, camera, theirs[k], effort) for k, camera in enumerate(cameras)]


def compared(
    scene: LightScene,
    camera: Camera,
    theirs: tuple[dict[str, Run], NDArray[np.float32]],
    effort: Effort,
) -> dict[str, float]:
    """Our pictures of a view beside Cycles' runs and its long picture."""
    spp = _OUR_TIMES * effort.spp
    ours = _our_run(scene, camera, FIELDS.model_copy(update={"spp": spp}), effort.n_pictures)
    metropolis = _our_run(scene, camera, FIELDS.model_copy(update=_METROPOLIS), effort.n_pictures)
    long = FIELDS.model_copy(update={"spp": effort.reference_spp})
    our_reference = _rendered(scene, camera, long, 999)[0]
    runs, their_reference = theirs
    our_cost = ours.costs(our_reference, effort.reference_spp / spp)
    their_costs = {n: r.costs(their_reference, effort.reference_spp / effort.spp) for n, r in runs.items()}  # fmt: skip
    best = [min(costs[k] for costs in their_costs.values()) for k in (0, 1)]
    return {
        "ours": our_cost[0],
        "theirs": best[0],
        "ratio": best[0] / our_cost[0],
        "ratio_median": best[1] / our_cost[1],
        "ratio_metropolis": best[0] / metropolis.costs(our_reference, math.inf)[0],
        "luminance": float((their_reference @ LUMINANCE).mean() / (our_reference @ LUMINANCE).mean()),
        "portals": float(their_costs["portals"][0] == best[0]),
    }  # fmt: skip


def _rendered(
    scene: LightScene, camera: Camera, fields: LightFields, seed: int
) -> tuple[NDArray[np.float32], float]:
    """(picture of all light, CPU seconds)."""
    began = time.process_time()
    result = scene.render(camera, "-", fields, seed)
    return result.outdoor + result.indoor, time.process_time() - began


def _our_run(scene: LightScene, camera: Camera, fields: LightFields, n: int) -> Run:
    few = {"spp": 1, "direct_spp": 1, "mutations_per_pixel": 1}
    _rendered(scene, camera, fields.model_copy(update=few), 0)  # compiles
    rendered = [_rendered(scene, camera, fields, 10 + k) for k in range(n)]
    pictures = np.stack([picture @ LUMINANCE for picture, _cpu in rendered])
    return Run(pictures.astype(np.float64), float(np.mean([cpu for _picture, cpu in rendered])))


def cycles_runs(
    cameras: Sequence[Camera], effort: Effort
) -> list[tuple[dict[str, Run], NDArray[np.float32]]]:
    """For each camera: Cycles' pictures by setting, and a long one by the cheaper setting."""
    seeds = [(1, k) for k in range(_N_SETUP)]
    seeds += [(effort.spp, 10 + k) for k in range(effort.n_pictures)]
    jobs = {
        (k, way): [_job(k, camera, way, spp, seed, effort) for spp, seed in seeds]
        for k, camera in enumerate(cameras)
        for way in WAYS
    }
    cpu_s = _run_cycles([job for some in jobs.values() for job in some])
    runs: list[dict[str, Run]] = [{} for _camera in cameras]
    for (k, way), some in jobs.items():
        # The first picture warms the engine up.
        setup_s = float(np.mean([cpu_s[job["file"]] for job in some[1:_N_SETUP]]))
        mean_s = float(np.mean([cpu_s[job["file"]] for job in some[_N_SETUP:]]))
        pictures = np.stack([_exr(FILES / job["file"]) @ LUMINANCE for job in some[_N_SETUP:]])
        samples_s = (mean_s - setup_s) * effort.spp / (effort.spp - 1)
        if samples_s <= 0:
            raise SystemExit(f"cycles: view {k}, {way}: samples take less time than the set-up")
        runs[k][way] = Run(pictures.astype(np.float64), samples_s)
    longs = []
    for k, camera in enumerate(cameras):
        spread = {way: run.pictures.var(0, ddof=1).mean() * run.cpu_s for way, run in runs[k].items()}  # fmt: skip
        longs.append(_job(k, camera, min(spread, key=spread.__getitem__), effort.reference_spp, 999, effort))  # fmt: skip
    _run_cycles(longs)
    return [(runs[k], _exr(FILES / long["file"])) for k, long in enumerate(longs)]


def _job(
    number: int, camera: Camera, way: str, spp: int, seed: int, effort: Effort
) -> dict[str, Any]:
    """A picture for cycles_scene.py to render."""
    return {
        "camera": {
            "hfov_rad": 2 * math.atan(0.5 * effort.width / camera.intrinsics.fx),
            "world_from_camera": camera.world_from_camera.tolist(),
        },
        "size": [effort.width, effort.height],
        "samples": spp,
        "seed": seed,
        "max_depth": FIELDS.max_depth,
        "portals": WAYS[way],
        "file": f"cycles_{number}_{way}_{spp}_{seed}.exr",
    }


def _run_cycles(jobs: Sequence[dict[str, Any]]) -> dict[str, float]:
    """Render jobs with Cycles; CPU seconds of each file."""
    (FILES / "jobs.json").write_text(json.dumps(jobs))
    python = os.environ.get("CYCLES_PYTHON", str(PYTHON))
    # -P, because this folder holds a cycles.py that would hide Blender's own module.
    command = [python, "-P", str(SCRIPT), str(FILES)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    lines = [json.loads(x) for x in done.stdout.splitlines() if x.startswith('{"cycles"')]
    if done.returncode != 0 or not lines:
        said = f"{done.stdout[-2000:]}{done.stderr[-4000:]}"
        raise RuntimeError(f"{' '.join(command)} failed:\n{said}")
    return {line["file"]: line["cpu_s"] for line in lines}


def _exr(path: Path) -> NDArray[np.float32]:
    layers = layers_from_exr(path.read_bytes(), str(path))
    return np.stack([layers[c] for c in "RGB"], -1)


if __name__ == "__main__":
    main()
