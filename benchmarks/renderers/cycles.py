"""Against Blender's Cycles: the same homes, cameras, light and depth; who is cleaner per CPU second?

`make bench-cycles` installs `bpy` into out/cycles-venv (it wants numpy below 2: no extra of ours
can hold it) and runs this. Scenes are written to out/bench/cycles as the tables that our own
kernels gather from; benchmarks/renderers/cycles_scene.py, a process of its own, renders them with Cycles.

Coats are taken off for both (diffuse, textured; metals diffuse; mirrors, glass and shades as they
are): then the two agree on every block of the picture, while Blender's Principled coat lets more
light through to its base than Ashikhmin and Shirley's.

Cycles renders every view in the ways of WAYS: as it comes, with portals in the openings that daylight
enters by, with its path guiding, with both; always with its light tree. The way that is cheapest to an
error counts, view by view and error by error. Guiding learns during a picture's first 128 samples, so
pictures with it have four times as many samples as the others, and fewer of them are made. Ours are
guided, too, and have as many.

Method. Both engines render the sum of all light, box filter, no denoiser, no clamping, no adaptive
sampling, paths of at most the recipe's segments, all cores. relMSE = mean over pixels of the variance
of luminance between an engine's pictures of other seeds, over ref^2 + 1e-3 mean(ref)^2; ref is a long
picture of that engine, of Cycles by its cheapest way. CPU to a noise is relMSE x CPU time, since
variance falls with 1 / samples, and the figure is Cycles' product over ours. CPU time is that of all
threads: of Cycles that of the samples alone, a picture of one sample (loading, BVH) taken off; of ours
that of the whole picture, pilot and guiding included. Metropolis is measured beside, all of its CPU
time (bootstrap, direct light) counted. relMSE hangs on fireflies (one pixel in a hundred makes nine
tenths of it), so the same ratio of the median pixel's squared error against ref stands beside it: how
grainy the picture looks. The figures without a home in their name are medians over all views.
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
from benchmarks.light.table_rows import RENDERED_HOMES
from benchmarks.renderers.exchange import home_without_coats, write_scene
from benchmarks.renderers.picture_noise import blocks
from pbrs_farm.core.camera import Camera, Intrinsics
from pbrs_farm.core.frames import LUMINANCE
from pbrs_farm.core.house import House
from pbrs_farm.core.recipe import LightFields, Recipe
from pbrs_farm.images import exr_from_layers, layers_from_exr, png_from_array
from pbrs_farm.transport.develop.tone_mapping import exposure_of, tone
from pbrs_farm.transport.light_scene import LightScene
from pbrs_farm.transport.scene_tables.scene_tables import SceneTables
from pbrs_farm.transport.scene_tables.sky import Sky

N_CAMERAS = 2  # the first stored ones of a home
CHAINS = {"integrator": "metropolis", "mutations_per_pixel": 64, "direct_spp": 64}
N_CHAINS_PICTURES = 4
GUIDED_TIMES = 4  # as many samples in pictures of guided rays
N_ONES = 3  # pictures of one sample
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


EFFORT = Effort(64, 48, 32, 512, 4)


@dataclass(frozen=True, slots=True)
class Way:
    """How Cycles samples; its pictures have `longer` times the samples of others, and three are made."""

    portals: bool
    guiding: bool
    longer: int = 1

    def effort(self, e: Effort) -> tuple[int, int]:
        """(samples of a picture, pictures)."""
        return e.spp * self.longer, e.n_short if self.longer == 1 else 3


WAYS = {
    "plain": Way(portals=False, guiding=False),
    "portals": Way(portals=True, guiding=False),
    "guided": Way(portals=False, guiding=True, longer=GUIDED_TIMES),
    "guided_portals": Way(portals=True, guiding=True, longer=GUIDED_TIMES),
}


@dataclass(frozen=True, slots=True, eq=False)
class Run:
    """Pictures of one engine, (N, H, W) luminance of other seeds; the CPU seconds that count for one of them."""

    short: NDArray[np.float64]
    spp: int
    cpu_s: float
    setup_s: float  # of a picture of one sample

    def errors(self, reference: NDArray[np.float64], reference_spp: int) -> tuple[float, float]:
        """(relMSE, the median pixel's squared relative error) of a picture."""
        scale = reference**2 + 1e-3 * reference.mean() ** 2
        relmse = float((self.short.var(0, ddof=1) / scale).mean())
        # The reference's own variance adds to the median's.
        median = float(np.median((self.short - reference) ** 2 / scale))
        return relmse, median / (1 + self.spp / reference_spp)


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """What was rendered of a stored camera: ours, Cycles' ways, long pictures (H, W, 3) of both."""

    key: str
    ours: Run
    chains: Run
    theirs: dict[str, Run]
    our_reference: NDArray[np.float32]
    their_reference: NDArray[np.float32]
    shown: tuple[NDArray[np.float32], NDArray[np.float32]]  # a short picture of either


def main() -> None:
    """Measure, print, write out/bench/cycles.json and cycles.png."""
    e = effort_from_environment()
    homes = os.environ.get("CYCLES_HOMES", "").split() or RENDERED_HOMES.values()
    views = [view for home in homes for view in _views_of(home, e)]
    figures = figures_of(views, e)
    _write_pictures(views)
    write_report(
        "cycles",
        {k: v for k, (v, _unit) in figures.items()},
        {k: u for k, (_v, u) in figures.items()},
    )


def figures_of(views: Sequence[View], e: Effort) -> dict[str, tuple[float, str]]:
    """Name -> (value, unit): every view's, and the medians over views."""
    of_views = {view.key: _compared(view, e) for view in views}
    found: dict[str, tuple[float, str]] = {
        f"light.cycles_{key}_{name}": value
        for key, one in of_views.items()
        for name, value in one.items()
    }
    for end in ("ratio", "ratio_metropolis", "ratio_median"):
        values = [one[end] for one in of_views.values()]
        name = f"light.vs_cycles{end.removeprefix('ratio')}"
        found[name] = (
            float(np.median([v for v, _unit in values])),
            f"{values[0][1]}, median over {len(views)} views of {len(RENDERED_HOMES)} homes",
        )
    return found


def effort_from_environment() -> Effort:
    """EFFORT, or what CYCLES_EFFORT="width height spp reference_spp n_short" says."""
    words = os.environ.get("CYCLES_EFFORT", "").split()
    return Effort(*(int(w) for w in words)) if words else EFFORT


def _views_of(home: str, e: Effort) -> list[View]:
    """The stored cameras of a home, rendered by both."""
    house, scene, textures = home_without_coats(home)
    cameras = [
        Camera.look(Intrinsics.from_hfov(e.width, e.height, c.hfov_rad), c.eye, c.towards)
        for c in house.cameras[:N_CAMERAS]
    ]
    fields = LightFields(filter="box", denoise=False)
    export(scene.tables, scene.sky, house, textures)
    views = []
    for k, (camera, theirs) in enumerate(
        zip(cameras, _their_runs(cameras, fields, e), strict=True)
    ):
        ours, our_reference = _our_run(scene, camera, fields, e)
        runs, their_reference, their_picture = theirs
        views.append(
            View(
                f"{home.lower()}_{k}",
                ours,
                _our_chains(scene, camera, fields),
                runs,
                our_reference,
                their_reference,
                (_rendered(scene, camera, fields, e.spp, 10)[0], their_picture),
            )
        )
        print(f"{views[-1].key}: rendered", flush=True)
    return views


def _rendered(
    scene: LightScene, camera: Camera, fields: LightFields, spp: int, seed: int
) -> tuple[NDArray[np.float32], float]:
    """(picture, CPU seconds of all that it takes)."""
    some = fields.model_copy(update={"spp": spp})
    began = time.process_time()
    result = scene.render(camera, "-", some, seed)
    return result.outdoor + result.indoor, time.process_time() - began


def _our_run(
    scene: LightScene, camera: Camera, fields: LightFields, e: Effort
) -> tuple[Run, NDArray[np.float32]]:
    """(our pictures, the long one)."""
    setup_s = _setup_s([_rendered(scene, camera, fields, 1, k)[1] for k in range(N_ONES)])
    spp = GUIDED_TIMES * e.spp
    short = [_rendered(scene, camera, fields, spp, 10 + k) for k in range(e.n_short)]
    reference, _s = _rendered(scene, camera, fields, e.reference_spp, 999)
    cpu_s = float(np.mean([s for _p, s in short]))
    return Run(_luminance([p for p, _s in short]), spp, cpu_s, setup_s), reference


def _our_chains(scene: LightScene, camera: Camera, fields: LightFields) -> Run:
    """Metropolis' pictures. That their mean is the same is what tests/transport and `verify --light` prove."""
    some = fields.model_copy(update=CHAINS)
    scene.render(camera, "-", some.model_copy(update={"mutations_per_pixel": 1}), 0)
    pictures = []
    began = time.process_time()
    for seed in range(N_CHAINS_PICTURES):
        result = scene.render(camera, "-", some, 40 + seed)
        pictures.append(result.outdoor + result.indoor)
    cpu_s = (time.process_time() - began) / N_CHAINS_PICTURES
    return Run(_luminance(pictures), fields.spp, cpu_s, 0.0)


def _their_runs(
    cameras: Sequence[Camera], fields: LightFields, e: Effort
) -> list[tuple[dict[str, Run], NDArray[np.float32], NDArray[np.float32]]]:
    """For each camera: (Cycles' pictures by way, a long one by the cheapest way, a short plain one)."""
    plans = {
        name: [
            *((1, k) for k in range(N_ONES)),
            *((way.effort(e)[0], 10 + k) for k in range(way.effort(e)[1])),
        ]
        for name, way in WAYS.items()
    }
    jobs = {
        (k, name): [_job(k, camera, name, spp, seed, fields, e) for spp, seed in plan]
        for k, camera in enumerate(cameras)
        for name, plan in plans.items()
    }
    spent = _spent_by_cycles([job for some in jobs.values() for job in some])
    runs: list[dict[str, Run]] = [{} for _camera in cameras]
    for (k, name), some in jobs.items():
        setup_s = _setup_s([spent[job["file"]] for job in some[:N_ONES]])
        spp = some[-1]["samples"]
        mean_s = float(np.mean([spent[job["file"]] for job in some[N_ONES:]]))
        cpu_s = (mean_s - setup_s) * spp / (spp - 1)
        pictures = _luminance([_exr(FILES / job["file"]) for job in some[N_ONES:]])
        runs[k][name] = Run(pictures, spp, cpu_s, setup_s)
    longs = [
        _job(k, camera, _cheapest(runs[k]), e.reference_spp, 999, fields, e)
        for k, camera in enumerate(cameras)
    ]
    _spent_by_cycles(longs)
    return [
        (runs[k], _exr(FILES / long["file"]), _exr(FILES / jobs[k, "plain"][-1]["file"]))
        for k, long in enumerate(longs)
    ]


def _cheapest(runs: dict[str, Run]) -> str:
    """The way whose variance falls fastest, judged by its own mean picture."""

    def cost(run: Run) -> float:
        return run.errors(run.short.mean(0), run.spp)[0] * run.cpu_s

    return min(runs, key=lambda name: cost(runs[name]))


def _job(
    number: int, camera: Camera, way: str, spp: int, seed: int, fields: LightFields, e: Effort
) -> dict[str, Any]:
    """A picture that Cycles is asked for."""
    return {
        "camera": {
            "hfov_rad": 2 * math.atan(0.5 * e.width / camera.intrinsics.fx),
            "world_from_camera": camera.world_from_camera.tolist(),
        },
        "size": [e.width, e.height],
        "samples": spp,
        "seed": seed,
        "max_depth": fields.max_depth,
        "light_tree": True,
        "guiding": WAYS[way].guiding,
        "portals": WAYS[way].portals,
        "file": f"cycles_{number}_{way}_{spp}_{seed}.exr",
    }


def _luminance(pictures: Sequence[NDArray[np.float32]]) -> NDArray[np.float64]:
    return np.stack(pictures).astype(np.float64) @ LUMINANCE


def _spent_by_cycles(jobs: Sequence[dict[str, Any]]) -> dict[str, float]:
    """Render jobs with Cycles; file -> CPU seconds of each."""
    (FILES / "jobs.json").write_text(json.dumps(jobs))
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


def _compared(view: View, e: Effort) -> dict[str, tuple[float, str]]:
    """Name -> (value, unit) of a view."""
    ours, theirs = view.our_reference @ LUMINANCE, view.their_reference @ LUMINANCE
    parts = [blocks(reference) for reference in (ours, theirs)]
    relmse, median = view.ours.errors(ours, e.reference_spp)
    chains = view.chains.errors(ours, e.reference_spp)[0]
    of_ways = {n: run.errors(theirs, e.reference_spp) for n, run in view.theirs.items()}
    cheapest = [
        min(errors[k] * view.theirs[name].cpu_s for name, errors in of_ways.items()) for k in (0, 1)
    ]
    found: dict[str, tuple[float, str]] = {
        "mean_luminance": (float(ours.mean()), "W m-2 sr-1"),
        "mean_luminance_cycles": (float(theirs.mean()), "W m-2 sr-1"),
        "block_ratio_median": (float(np.median(parts[1] / parts[0])), "Cycles / ours, 8x6 blocks"),
        "relmse": (relmse, "-"),
        "median": (median, "squared relative error of the median pixel"),
        "spp": (view.ours.spp, "samples"),
        "cpu_s": (view.ours.cpu_s, "s CPU of a picture, pilot included"),
        "setup_s": (view.ours.setup_s, "s CPU of a picture of one sample"),
        "relmse_metropolis": (chains, "-"),
        "cpu_s_metropolis": (view.chains.cpu_s, "s CPU, bootstrap and direct light included"),
        "ratio": (
            cheapest[0] / (relmse * view.ours.cpu_s),
            "x less CPU time than Cycles at equal relMSE",
        ),
        "ratio_median": (cheapest[1] / (median * view.ours.cpu_s), "the same by the median pixel"),
        "ratio_metropolis": (
            cheapest[0] / (chains * view.chains.cpu_s),
            "Metropolis: x less CPU time than Cycles at equal relMSE",
        ),
    }
    for name, run in view.theirs.items():
        found |= {
            f"relmse_{name}": (of_ways[name][0], "-"),
            f"median_{name}": (of_ways[name][1], "squared relative error of the median pixel"),
            f"spp_{name}": (run.spp, "samples"),
            f"cpu_s_{name}": (run.cpu_s, "s CPU of the samples"),
            f"setup_s_{name}": (run.setup_s, "s CPU of a picture of one sample"),
        }
    return found


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


def _write_pictures(views: Sequence[View]) -> None:
    """A row a view: ours and Cycles short, ours and Cycles long, one exposure."""
    fields = Recipe().tone
    rows = []
    for view in views:
        exposure = exposure_of(view.our_reference, fields)
        pictures = (*view.shown, view.our_reference, view.their_reference)
        rows.append(np.concatenate([tone(p, fields, exposure=exposure) for p in pictures], 1))
    sheet = np.concatenate(rows).repeat(2, 0).repeat(2, 1)
    (FOLDER / "cycles.png").write_bytes(png_from_array(sheet))


if __name__ == "__main__":
    sys.exit(main())
