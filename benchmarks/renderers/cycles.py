"""Against Blender's Cycles: the same home, cameras, light and depth; who is cleaner per CPU second?

`make bench-cycles` installs `bpy` into out/cycles-venv (it wants numpy below 2: no extra of ours
can hold it) and runs this. The scene is written to out/bench/cycles as the tables that our own
kernels gather from; benchmarks/renderers/cycles_scene.py, a process of its own, renders them with Cycles.

Coats are taken off for both (diffuse, textured; metals diffuse; mirrors, glass and shades as they
are): then the two agree on every block of the picture, while Blender's Principled coat lets more
light through to its base than Ashikhmin and Shirley's.

Method. Both engines render the sum of all light, box filter, no denoiser, no clamping, paths of at
most the recipe's segments, all cores. For each: one long picture as its own reference, and some
short ones of other seeds; relMSE = mean over pixels of (y - ref)^2 / (ref^2 + 1e-3 mean(ref)^2) of
luminance. Variance falls with 1 / samples, so that the reference's own adds spp / reference_spp to
each error, which is taken off; CPU to a noise is relMSE x CPU time, and the figure is Cycles'
product over ours. CPU time is that of all threads and of the samples alone: the time of
a picture of one sample (loading, BVH, compiling, pilot) is taken off both; it is reported beside.
Metropolis is measured beside, all of its CPU time (bootstrap, direct light) counted.
relMSE hangs on fireflies (one pixel in a hundred makes nine tenths of it), so the same ratio of the
median pixel's squared error stands beside it: how grainy the picture looks.
"""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.figures import FOLDER, write_report
from benchmarks.renderers.exchange import home_without_coats, write_scene
from benchmarks.renderers.picture_noise import blocks, relative_square
from pbrs_farm.core.camera import Camera, Intrinsics
from pbrs_farm.core.frames import LUMINANCE
from pbrs_farm.core.house import House
from pbrs_farm.core.recipe import LightFields, Recipe
from pbrs_farm.images import exr_from_layers, layers_from_exr, png_from_array
from pbrs_farm.transport.develop.tone_mapping import exposure_of, tone
from pbrs_farm.transport.light_scene import LightScene
from pbrs_farm.transport.scene_tables.scene_tables import SceneTables
from pbrs_farm.transport.scene_tables.sky import Sky

HOME = "2BedroomApartment"
N_CAMERAS = 2
CHAINS = {"integrator": "metropolis", "mutations_per_pixel": 64, "direct_spp": 64}
N_CHAINS_PICTURES = 4
N_ONES = 4  # pictures of one sample
PYTHON = Path("out/cycles-venv/bin/python")
SCRIPT = Path(__file__).with_name("cycles_scene.py")
FILES = FOLDER / "cycles"


@dataclass(frozen=True, slots=True)
class Effort:
    """Size of the pictures and samples per pixel."""

    width: int
    height: int
    spp: int
    reference_spp: int
    n_short: int


EFFORT = Effort(112, 84, 32, 1024, 8)


@dataclass(frozen=True, slots=True, eq=False)
class Run:
    """Pictures of one engine: (H, W, 3) radiance; cpu_s of the samples of a short one."""

    reference: NDArray[np.float32]
    short: list[NDArray[np.float32]]
    cpu_s: float
    setup_s: float


def main() -> None:
    """Measure, print, write out/bench/cycles.json and cycles.png."""
    e = effort_from_environment()
    house, scene, textures = home_without_coats(HOME)
    cameras = [
        Camera.look(Intrinsics.from_hfov(e.width, e.height, c.hfov_rad), c.eye, c.towards)
        for c in house.cameras[:N_CAMERAS]
    ]
    fields = LightFields(filter="box", denoise=False)
    export(scene.tables, scene.sky, house, textures)
    ours = [_our_run(scene, camera, fields, e) for camera in cameras]
    chains = [
        _our_chains(scene, camera, fields, run.reference)
        for camera, run in zip(cameras, ours, strict=True)
    ]
    figures: dict[str, Any] = {}
    units: dict[str, str] = {}
    theirs = _their_runs(cameras, fields, e)
    for k, (a, b) in enumerate(zip(ours, theirs, strict=True), 1):
        for name, value, unit in _compared(a, b, e):
            figures[f"light.cycles_{k}_{name}"] = value
            units[f"light.cycles_{k}_{name}"] = unit
        relmse, cpu_s = chains[k - 1]
        theirs_cost = figures[f"light.cycles_{k}_relmse_cycles"] * b.cpu_s
        figures |= {
            f"light.cycles_{k}_relmse_metropolis": relmse,
            f"light.cycles_{k}_cpu_s_metropolis": cpu_s,
            f"light.cycles_{k}_ratio_metropolis": theirs_cost / (relmse * cpu_s),
        }
        units |= {
            f"light.cycles_{k}_relmse_metropolis": "-",
            f"light.cycles_{k}_cpu_s_metropolis": "s CPU, bootstrap and direct light included",
            f"light.cycles_{k}_ratio_metropolis": "x less CPU time at equal relMSE",
        }
    ratios = [figures[f"light.cycles_{k + 1}_ratio"] for k in range(N_CAMERAS)]
    medians = [figures[f"light.cycles_{k + 1}_ratio_median"] for k in range(N_CAMERAS)]
    figures["light.vs_cycles"] = min(ratios)
    figures["light.vs_cycles_metropolis"] = min(
        figures[f"light.cycles_{k + 1}_ratio_metropolis"] for k in range(N_CAMERAS)
    )
    figures["light.vs_cycles_median"] = min(medians)
    units["light.vs_cycles"] = "x less CPU time than Cycles at equal relMSE, the worse camera"
    units["light.vs_cycles_metropolis"] = "Metropolis: x less CPU time than Cycles at equal relMSE"
    units["light.vs_cycles_median"] = "the same at equal squared error of the median pixel"
    _write_pictures(ours, theirs)
    write_report("cycles", figures, units)


def effort_from_environment() -> Effort:
    """EFFORT, or what CYCLES_EFFORT="width height spp reference_spp n_short" says."""
    words = os.environ.get("CYCLES_EFFORT", "").split()
    return Effort(*(int(w) for w in words)) if words else EFFORT


def _our_run(scene: LightScene, camera: Camera, fields: LightFields, e: Effort) -> Run:
    def rendered(spp: int, seed: int) -> tuple[NDArray[np.float32], float]:
        some = fields.model_copy(update={"spp": spp})
        began = time.process_time()
        result = scene.render(camera, "-", some, seed)
        return result.outdoor + result.indoor, time.process_time() - began

    setup_s = _setup_s([rendered(1, k)[1] for k in range(N_ONES)])
    short = [rendered(e.spp, 10 + k) for k in range(e.n_short)]
    reference, _s = rendered(e.reference_spp, 999)
    return _run(reference, short, setup_s, e)


def _our_chains(
    scene: LightScene, camera: Camera, fields: LightFields, reference: NDArray[np.float32]
) -> tuple[float, float]:
    """(relMSE, CPU seconds) of a Metropolis picture.

    The squared error is the variance between pictures of other seeds: at this error the noise of
    a path-traced reference would be most of a difference to it. That the mean is the same is what
    tests/transport and `verify --light` prove; how far the pictures' mean lies off is printed.
    """
    some = fields.model_copy(update=CHAINS)
    scene.render(camera, "-", some.model_copy(update={"mutations_per_pixel": 1}), 0)
    pictures = []
    began = time.process_time()
    for seed in range(N_CHAINS_PICTURES):
        result = scene.render(camera, "-", some, 40 + seed)
        pictures.append((result.outdoor + result.indoor).astype(np.float64) @ LUMINANCE)
    cpu_s = (time.process_time() - began) / N_CHAINS_PICTURES
    truth = reference.astype(np.float64) @ LUMINANCE
    shift = float(np.mean(pictures) / truth.mean()) - 1
    print(f"Metropolis: mean {shift:+.2%} of the long path's", flush=True)
    error = np.var(pictures, 0, ddof=1) / (truth**2 + 1e-3 * truth.mean() ** 2)
    return float(error.mean()), cpu_s


def _their_runs(
    cameras: Sequence[Camera], fields: LightFields, e: Effort, *, guiding: bool = False
) -> list[Run]:
    ones = [(1, k) for k in range(N_ONES)]
    plans = [*ones, *((e.spp, 10 + k) for k in range(e.n_short)), (e.reference_spp, 999)]
    jobs = [
        {
            "camera": {
                "hfov_rad": 2 * math.atan(0.5 * e.width / camera.intrinsics.fx),
                "world_from_camera": camera.world_from_camera.tolist(),
            },
            "size": [e.width, e.height],
            "samples": spp,
            "seed": seed,
            "max_depth": fields.max_depth,
            "light_tree": True,
            "guiding": guiding,
            "file": f"cycles_{k}_{spp}_{seed}.exr",
        }
        for k, camera in enumerate(cameras)
        for spp, seed in plans
    ]
    (FILES / "jobs.json").write_text(json.dumps(jobs))
    spent = _spent_by_cycles()
    runs = []
    for k in range(len(cameras)):
        rows = [
            (_exr(FILES / j["file"]), spent[j["file"]])
            for j in jobs[k * len(plans) : (k + 1) * len(plans)]
        ]
        setup_s = _setup_s([s for _picture, s in rows[:N_ONES]])
        runs.append(_run(rows[-1][0], rows[N_ONES:-1], setup_s, e))
    return runs


def _spent_by_cycles() -> dict[str, float]:
    """File -> CPU seconds of every job of jobs.json."""
    python = os.environ.get("CYCLES_PYTHON", str(PYTHON))
    # -P: this folder holds a cycles.py, and Blender's own module of that name must be found.
    command = [python, "-P", str(SCRIPT), str(FILES)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    lines = [json.loads(x) for x in done.stdout.splitlines() if x.startswith('{"cycles"')]
    if done.returncode != 0 or not lines:
        raise RuntimeError(
            f"{' '.join(command)} failed:\n{done.stdout[-2000:]}{done.stderr[-4000:]}"
        )
    print(f"Cycles of Blender {lines[0]['cycles']}")
    return {x["file"]: x["cpu_s"] for x in lines}


def _setup_s(ones: Sequence[float]) -> float:
    """CPU seconds of a picture of one sample; the first one, which warms the engine up, does not count."""
    return float(np.mean(ones[1:]))


def _run(
    reference: NDArray[np.float32],
    short: Sequence[tuple[NDArray[np.float32], float]],
    setup_s: float,
    e: Effort,
) -> Run:
    cpu_s = float(np.mean([s for _picture, s in short]))
    return Run(reference, [p for p, _s in short], (cpu_s - setup_s) * e.spp / (e.spp - 1), setup_s)


def _compared(ours: Run, theirs: Run, e: Effort) -> list[tuple[str, float, str]]:
    of_reference = 1 + e.spp / e.reference_spp
    a, b = (
        np.stack([relative_square(p, run.reference) for p in run.short]) / of_reference
        for run in (ours, theirs)
    )
    mean = float((ours.reference @ LUMINANCE).mean()), float((theirs.reference @ LUMINANCE).mean())
    parts = [blocks(run.reference @ LUMINANCE) for run in (ours, theirs)]
    cost = theirs.cpu_s / ours.cpu_s
    median = float(np.median(a)), float(np.median(b))
    return [
        ("mean_luminance", mean[0], "W m-2 sr-1"),
        ("mean_luminance_cycles", mean[1], "W m-2 sr-1"),
        ("block_ratio_median", float(np.median(parts[1] / parts[0])), "Cycles / ours, 8x6 blocks"),
        ("relmse", float(a.mean()), "-"),
        ("relmse_cycles", float(b.mean()), "-"),
        ("median", median[0], "squared relative error of the median pixel"),
        ("median_cycles", median[1], "squared relative error of the median pixel"),
        ("cpu_s", ours.cpu_s, "s CPU of the samples"),
        ("cpu_s_cycles", theirs.cpu_s, "s CPU of the samples"),
        ("setup_s", ours.setup_s, "s CPU of a picture of one sample"),
        ("setup_s_cycles", theirs.setup_s, "s CPU of a picture of one sample"),
        ("ratio", float(b.mean() / a.mean()) * cost, "x less CPU time at equal relMSE"),
        ("ratio_median", median[1] / median[0] * cost, "the same by the median pixel"),
    ]


def export(
    tables: SceneTables, sky: Sky, house: House, textures: dict[str, NDArray[np.uint8]]
) -> None:
    """Write the scene, dome.exr and the textures as PNG into FILES."""
    write_scene(FILES, tables, sky, house, textures)
    for name, picture in textures.items():
        (FILES / f"{name}.png").write_bytes(png_from_array(picture))
    # Blender's azimuth starts a quarter turn off ours.
    dome = np.roll(sky.dome, sky.dome.shape[1] // 4, axis=1)
    layers = {c: np.ascontiguousarray(dome[..., k]) for k, c in enumerate("RGB")}
    (FILES / "dome.exr").write_bytes(exr_from_layers(layers))


def _exr(path: Path) -> NDArray[np.float32]:
    layers = layers_from_exr(path.read_bytes(), str(path))
    return np.stack([layers[c] for c in "RGB"], -1)


def _write_pictures(ours: Sequence[Run], theirs: Sequence[Run]) -> None:
    """A row a camera: ours and Cycles short, ours and Cycles long, one exposure."""
    fields = Recipe().tone
    rows = []
    for a, b in zip(ours, theirs, strict=True):
        exposure = exposure_of(a.reference, fields)
        pictures = (a.short[0], b.short[0], a.reference, b.reference)
        rows.append(np.concatenate([tone(p, fields, exposure=exposure) for p in pictures], 1))
    sheet = np.concatenate(rows).repeat(2, 0).repeat(2, 1)
    (FOLDER / "cycles.png").write_bytes(png_from_array(sheet))


if __name__ == "__main__":
    sys.exit(main())
