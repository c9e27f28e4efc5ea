"""Light transport: path, Metropolis and the denoiser at equal CPU time, scene by scene.

Every engine runs in this process on the same scene; CPU time is that of all threads. For each
scene: Metropolis with its usual settings and MUTATIONS a pixel, then `path` with as many samples
as fit into the same CPU time; both SEEDS times. Errors are against a long path-traced reference of
other seeds. relMSE = mean over pixels of (y - ref)^2 / (ref^2 + 1e-3 mean(ref)^2) of luminance,
less what the reference's own noise adds to it, known from its two halves r and s: (r - s)^2 / 4;
`reference_relmse` says how much that was. Ratios are Metropolis over path, below 1 favours
Metropolis: `relmse_ratio` of relMSE, `median_ratio` of the median pixel's error, from which the
reference's noise is not taken off.
`fast_times_cheaper`: CPU time of Metropolis over that of recipe `fast` (path and denoiser) for the
error `fast` reaches.

`light.png`: path, Metropolis and reference of each room, one under the other. `techniques.png`: the
paper's comparison of rendering techniques on a home: path, Metropolis with 16 and with 512 direct
samples at equal CPU time, and a crop of each, enlarged.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.figures import FOLDER, write_report
from pbrs_farm.core.camera import Camera, Intrinsics
from pbrs_farm.core.frames import LUMINANCE
from pbrs_farm.core.house import House, geometry_from_house
from pbrs_farm.core.lighting import Group
from pbrs_farm.core.recipe import LightFields, Recipe
from pbrs_farm.transport.develop.denoiser import denoise
from pbrs_farm.transport.develop.tone_mapping import tone
from pbrs_farm.transport.light_result import LightResult
from pbrs_farm.transport.light_scene import LightScene
from pbrs_farm.transport.scene_tables.sky import Sky, dark_sky, sky_for_house, sunsky
from tests.transport import hard_rooms

SIZE = (64, 48)
ROOM_REFERENCE_SPP, HARD_REFERENCE_SPP, HOME_REFERENCE_SPP = 8192, 16384, 2048
# The median is compared as it is: the reference must be far below it.
GLOBE_REFERENCE_SPP = 32768
SEEDS = (1, 2)
MUTATIONS = 128
CHAINS = 16384
HOMES = ("2BedroomApartment", "Studio", "3BedroomApartment")
CAMERAS_PER_HOME = 2
PLAIN = LightFields(filter="box", denoise=False)
METROPOLIS = PLAIN.model_copy(
    update={"integrator": "metropolis", "mutations_per_pixel": MUTATIONS, "chains": CHAINS}
)


@dataclass(frozen=True, slots=True)
class Shot:
    """A scene and a camera. key: the part of the figures' names."""

    key: str
    scene: LightScene
    camera: Camera
    reference_spp: int


def main() -> None:
    """Measure, print and write out/bench/light.json, light.png and techniques.png."""
    figures: dict[str, Any] = {}
    rows = []
    for make in _room_makers():
        shot = make()
        found, row = _compared(shot)
        rows.append(row)
        figures |= {f"light.{shot.key}_{name}": value for name, value in found.items()}
    _write_rows(rows, "light.png", 3)
    ratios = []
    for number, shot in enumerate(_home_shots()):
        found, _row = _compared(shot)
        ratios.append(found["relmse_ratio"])
        figures |= {f"light.{shot.key}_{name}": value for name, value in found.items()}
        if number == 0:
            _write_rows(_techniques(shot), "techniques.png", 2)
    figures["light.homes_relmse_ratio_median"] = float(np.median(ratios))
    figures["light.mutation_cost"] = _mutation_cost()
    figures["light.compiled_by_another_camera"] = _compiled_by_another_camera()
    units = {name: "s CPU" if name.endswith("_s") else "-" for name in figures}
    units["light.mutation_cost"] = "path samples of the same depth"
    units["light.compiled_by_another_camera"] = "kernels"
    write_report("light", {k: round(v, 4) for k, v in figures.items()}, units)


def _room_makers() -> list[Callable[[], Shot]]:
    recipe = Recipe()
    sun = sunsky(recipe, elevation_rad=0.6, azimuth_rad=0.35)

    def shot(key: str, room: tuple[House, Camera], sky: Sky, spp: int) -> Shot:
        scene = LightScene.load(room[0], {}, recipe, sky)
        return Shot(key, scene, room[1].with_size(*SIZE), spp)

    return [
        lambda: shot("door", hard_rooms.door_ajar(), dark_sky(), HARD_REFERENCE_SPP),
        lambda: shot("globe", hard_rooms.glass_globe(), dark_sky(), GLOBE_REFERENCE_SPP),
        lambda: shot("sunlit", hard_rooms.sunlit(), sun, ROOM_REFERENCE_SPP),
        lambda: shot("shade", hard_rooms.open_shade(), dark_sky(), HARD_REFERENCE_SPP),
    ]


def _home_shots() -> Iterator[Shot]:
    """The first stored cameras of the example homes."""
    from pbrs_farm.raycast.caster import Caster
    from pbrs_farm.read.source import read_house, resolve
    from pbrs_farm.repair import repair
    from pbrs_farm.run.house_cache import decoded_textures

    recipe = Recipe()
    for name in HOMES:
        house, _report = repair(
            read_house(resolve(name), recipe.read),
            recipe.repair,
            occluder_from=lambda h: Caster(geometry_from_house(h)),
        )
        textures, _problems = decoded_textures(house)
        scene = LightScene.load(house, textures, recipe, sky_for_house(recipe, house.id))
        for number, stored in enumerate(house.cameras[:CAMERAS_PER_HOME]):
            intrinsics = Intrinsics.from_hfov(*SIZE, stored.hfov_rad)
            camera = Camera.look(intrinsics, stored.eye, stored.towards)
            yield Shot(f"{name.lower()}_{number}", scene, camera, HOME_REFERENCE_SPP)


def _compared(shot: Shot) -> tuple[dict[str, float], list[NDArray[np.float64]]]:
    """Figures of one shot, and its pictures: path, Metropolis, reference."""
    half = PLAIN.model_copy(update={"spp": shot.reference_spp // 2})
    r, s = (_sum(_timed(shot, half, seed=k)[0]) for k in (998, 999))
    truth = 0.5 * (r + s)
    doubt = float(_relative_square(0.5 * (r - s) + truth, truth).mean())
    chains = [_timed(shot, METROPOLIS, seed=k) for k in SEEDS]
    chains_s = float(np.mean([s for _r, s in chains]))
    _trial, trial_s = _timed(shot, PLAIN.model_copy(update={"spp": 256}), seed=3)
    equal = PLAIN.model_copy(update={"spp": max(round(256 * chains_s / trial_s), 1)})
    paths = [_timed(shot, equal, seed=k) for k in SEEDS]
    path_s = float(np.mean([s for _r, s in paths]))
    fast, fast_s = _timed(shot, PLAIN.model_copy(update={"spp": 64}), seed=4)
    began = time.process_time()
    clean = denoise(fast)
    fast_s += time.process_time() - began

    errors = [
        np.array([_relative_square(_sum(r), truth) for r, _s in some]) for some in (chains, paths)
    ]
    times = chains_s / path_s
    ours, theirs = (float(e.mean()) - doubt for e in errors)
    fast_error = float(_relative_square(_sum(clean), truth).mean()) - doubt
    found = {
        "path_s": path_s,
        "metropolis_s": chains_s,
        "path_spp": float(equal.spp),
        "reference_relmse": doubt,
        "path_relmse": theirs,
        "metropolis_relmse": ours,
        "relmse_ratio": ours / theirs * times,
        "median_ratio": float(np.sqrt(np.median(errors[0]) / np.median(errors[1]) * times)),
        "fast_relmse": fast_error,
        "fast_s": fast_s,
        "fast_times_cheaper": ours * chains_s / (fast_error * fast_s),
    }
    print(shot.key, {k: round(v, 4) for k, v in found.items()}, flush=True)
    return found, [_sum(paths[0][0]), _sum(chains[0][0]), truth]


def _techniques(shot: Shot) -> list[list[NDArray[np.float64]]]:
    """Rows of pictures: path, Metropolis with 16 and 512 direct samples; below, a crop of each."""
    size = (2 * SIZE[0], 2 * SIZE[1])
    shot = Shot(shot.key, shot.scene, shot.camera.with_size(*size), 0)
    few = METROPOLIS.model_copy(update={"direct_spp": 16, "mutations_per_pixel": 64})
    many = few.model_copy(update={"direct_spp": 512})
    _r, few_s = _timed(shot, few, seed=1)
    result_many, many_s = _timed(shot, many, seed=1)
    more = max(round(64 * many_s / few_s), 1)
    result_few, _s = _timed(shot, few.model_copy(update={"mutations_per_pixel": more}), seed=1)
    _r, path_s = _timed(shot, PLAIN.model_copy(update={"spp": 64}), seed=1)
    equal = PLAIN.model_copy(update={"spp": max(round(64 * many_s / path_s), 1)})
    result_path, _s = _timed(shot, equal, seed=1)
    pictures = [_sum(r) for r in (result_path, result_few, result_many)]
    print(f"techniques: {many_s:.1f} s CPU each; path {equal.spp} samples, 16 direct with {more}"
          " mutations, 512 direct with 64", flush=True)  # fmt: skip
    h, w = size[1], size[0]
    crops = [p[h // 2 : h // 2 + h // 3, w // 3 : w // 3 + w // 3] for p in pictures]
    return [pictures, [c.repeat(3, 0).repeat(3, 1)[:h, :w] for c in crops]]


def _timed(shot: Shot, fields: LightFields, *, seed: int) -> tuple[LightResult, float]:
    """(result, CPU seconds of all threads); kernels are compiled before the clock starts."""
    few = {"spp": 1, "direct_spp": 1, "mutations_per_pixel": 1}
    shot.scene.render(shot.camera, "-", fields.model_copy(update=few), seed)
    began = time.process_time()
    result = shot.scene.render(shot.camera, "-", fields, seed)
    return result, time.process_time() - began


def _compiled_by_another_camera() -> float:
    """Kernels that a second camera of a loaded home compiles, both integrators."""
    import drjit as dr

    house, camera = hard_rooms.sunlit()
    scene = LightScene.load(
        house, {}, Recipe(), sunsky(Recipe(), elevation_rad=0.6, azimuth_rad=0.35)
    )
    few = METROPOLIS.model_copy(update={"mutations_per_pixel": 8, "direct_spp": 1})
    fields = (PLAIN.model_copy(update={"spp": 1}), few)
    for some in fields:
        scene.render(camera.with_size(*SIZE), "-", some, 1)
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        dr.kernel_history_clear()
        for some in fields:
            scene.render(camera.with_size(SIZE[1], SIZE[0]), "-", some, 2)
        kernels = [k for k in dr.kernel_history() if k["type"] == dr.KernelType.JIT]
    misses = sum(not k["cache_hit"] for k in kernels)
    print(f"another camera: {len(kernels)} kernels launched, {misses} compiled", flush=True)
    return float(misses)


def _mutation_cost() -> float:
    """CPU time of a mutation over that of a path sample, both of freshly drawn paths.

    With 99 % large steps a proposal is a path like any other, so that depths are the same.
    """
    from pbrs_farm.transport.metropolis.integrator import STEPS_PER_LAUNCH, chain_run
    from pbrs_farm.transport.sample_passes import SampledView

    house, camera = hard_rooms.sunlit()
    scene = LightScene.load(
        house, {}, Recipe(), sunsky(Recipe(), elevation_rad=0.6, azimuth_rad=0.35)
    )
    camera = camera.with_size(*SIZE)
    fields = METROPOLIS.model_copy(
        update={"spp": 512, "large_step": 0.99, "rr_depth": 3, "tail_pixels": 0}
    )
    shot = Shot("cost", scene, camera, 0)
    _result, path_s = _timed(
        shot, PLAIN.model_copy(update={"spp": 512, "rr_depth": fields.rr_depth}), seed=1
    )
    emitters, _weights = scene.emitters(camera, fields, 1)

    def mutate(n: int) -> int:
        some = fields.model_copy(update={"mutations_per_pixel": n})
        view = SampledView(scene.device_scene, emitters, camera, some, 1)
        run = chain_run(view, Group.OUTDOOR, min_segments=1)
        assert run is not None
        while run.n_steps < run.n_wanted:
            run.advance(min(STEPS_PER_LAUNCH, run.n_wanted - run.n_steps))
        return run.estimate().n_mutations

    # The bootstrap is the same for both counts and drops out of the difference.
    mutate(1)
    counts, spent = [], []
    for per_pixel in (256, 1024):
        began = time.process_time()
        counts.append(mutate(per_pixel))
        spent.append(time.process_time() - began)
    mutation_s = (spent[1] - spent[0]) / (counts[1] - counts[0])
    return mutation_s / (path_s / (512 * SIZE[0] * SIZE[1]))


def _sum(result: LightResult) -> NDArray[np.float64]:
    return np.asarray(result.outdoor + result.indoor, np.float64)


def _relative_square(
    picture: NDArray[np.float64], truth: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(H, W) squared error of luminance over the squared reference, dark pixels held up."""
    y, t = picture @ LUMINANCE, truth @ LUMINANCE
    return np.asarray((y - t) ** 2 / (t**2 + 1e-3 * t.mean() ** 2))


def _write_rows(rows: list[list[NDArray[np.float64]]], name: str, times: int) -> None:
    """A PNG of rows of pictures, each row exposed alike, enlarged."""
    from pbrs_farm.images import png_from_array
    from pbrs_farm.transport.develop.tone_mapping import exposure_of

    tones = Recipe().tone
    shown = []
    for row in rows:
        exact = [p.astype(np.float32) for p in row]
        exposure = exposure_of(exact[-1], tones)
        shown.append(np.concatenate([tone(p, tones, exposure=exposure) for p in exact], 1))
    width = min(r.shape[1] for r in shown)
    picture = np.concatenate([r[:, :width] for r in shown], 0)
    FOLDER.mkdir(parents=True, exist_ok=True)
    enlarged = picture.repeat(times, 0).repeat(times, 1)
    Path(FOLDER / name).write_bytes(png_from_array(enlarged))


if __name__ == "__main__":
    main()
