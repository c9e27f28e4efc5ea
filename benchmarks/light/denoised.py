"""The error of what a user gets, the denoised picture, over CPU: ways to denoise it, 8 to 128 samples.

Eight views (measured_views.py) at SIZE. relMSE is of all light together, against a raw reference whose
own noise is taken off; FLIP is of the developed pictures against the reference developed as `fast` is.
References lie in out/bench/references and grow by SPP_A_RUN samples a run, up to MOST_SPP, so that one run
takes seven and a half minutes on two quiet cores. `light.fast_error`: mean FLIP of recipe `fast` over the views.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from benchmarks.figures import FOLDER, write_report
from benchmarks.light.measured_views import EIGHT, MeasuredView, loaded
from benchmarks.light.picture_error import flip, relmse
from benchmarks.light.table_rows import DENOISED_COUNTS as COUNTS
from pbrs_farm.core.camera import Camera
from pbrs_farm.core.recipe import Recipe, recipe_from_name
from pbrs_farm.transport.develop.denoiser import denoise_radiance
from pbrs_farm.transport.develop.mode_pictures import LinearAovs, denoise_aovs
from pbrs_farm.transport.light_result import LightResult, result_from_sums
from pbrs_farm.transport.light_scene import LightScene

F32 = NDArray[np.float32]

SIZE: Final = (240, 180)
VIEW: Final = (640, 480)  # px, of the view that the small one stands for
SPP_A_RUN: Final = 1024
MOST_SPP: Final = 8192
SEED, REFERENCE_SEED = 1, 998
_SPP_A_PASS: Final = 256  # of a reference


@dataclass(frozen=True, slots=True, eq=False)
class Sampled:
    """A view after some number of samples."""

    aovs: LinearAovs
    spp: int
    cpu_s: float  # of the samples


def main() -> None:
    """Measure and write out/bench/denoised.json; `python -m benchmarks lab_tables` makes its table."""
    recipe = recipe_from_name("fast")
    errors: dict[tuple[str, int], list[tuple[float, float, float]]] = {}
    samples = []
    for view, scene, camera in loaded(EIGHT, recipe, SIZE):
        reference, halves, spp = grown_reference(view, scene, camera, recipe)
        samples.append(spp)
        for row in measured(scene, camera, recipe, reference, halves):
            errors.setdefault((row[0], row[1]), []).append(row[2:])
            print(f"{view.key:<34}{row[0]:<22}{row[1]:>5}{row[2]:>8.2f} s", end="")
            print(f"  relMSE {row[3]:.4f}  FLIP {row[4]:.4f}", flush=True)
    figures, units = figures_of(errors, recipe.light.spp)
    figures["light.reference_spp"] = min(samples)
    units["light.reference_spp"] = "samples a pixel, of the shortest reference"
    write_report("denoised", figures, units)


def figures_of(
    errors: dict[tuple[str, int], list[tuple[float, float, float]]], fast_spp: int
) -> tuple[dict[str, Any], dict[str, str]]:
    """Means over the views: CPU, relMSE and FLIP of each way at each count."""
    figures: dict[str, Any] = {}
    units: dict[str, str] = {}
    for name in dict.fromkeys(name for name, _n in errors):
        for n in COUNTS:
            means = np.mean(errors[name, n], axis=0)
            key = f"light.{name.replace(' ', '_')}_{n}"
            for end, value in zip(("cpu_s", "relmse", "flip"), means, strict=True):
                figures[f"{key}_{end}"] = float(f"{value:.4g}")
                units[f"{key}_{end}"] = f"mean of {len(errors[name, n])} views"
    figures["light.fast_error"] = round(float(np.mean(errors["fast", fast_spp], axis=0)[2]), 4)
    units["light.fast_error"] = (
        f"FLIP at {fast_spp} samples, mean of eight views, {SIZE[0]}x{SIZE[1]}"
    )
    return figures, units


def measured(
    scene: LightScene,
    camera: Camera,
    recipe: Recipe,
    reference: LinearAovs,
    halves: tuple[F32, F32],
) -> list[tuple[str, int, float, float, float]]:
    """(way to denoise, samples, CPU seconds, relMSE, FLIP) of one view, all ways and counts."""
    rows = []
    truth = reference.outdoor + reference.indoor
    clean_reference = denoise_aovs(reference)
    for sampled in sampled_view(scene, camera, recipe):
        for name, way in WAYS.items():
            began = time.process_time()
            clean = way(sampled.aovs)
            cpu_s = sampled.cpu_s + time.process_time() - began
            relative = relmse(clean.outdoor + clean.indoor, truth, halves)
            perceived = flip(clean, clean_reference, recipe.tone)
            rows.append((name, sampled.spp, cpu_s, relative, perceived))
    return rows


def sampled_view(scene: LightScene, camera: Camera, recipe: Recipe) -> list[Sampled]:
    """The view after each of COUNTS samples, one after the other the same picture grown on."""
    from pbrs_farm.transport.path_tracer import Lanes, trace

    scene.render(camera, "-", recipe.light.model_copy(update={"spp": 1}), SEED)  # compiles
    # Pilot and trial as a view of VIEW has them: the trial is made of large views alone.
    emitters, _weights = scene.emitters(camera.with_size(*VIEW), recipe.light, SEED)
    began, spent, first, total = time.process_time(), 0.0, 0, None
    found = []
    for spp in COUNTS:
        lanes = Lanes(*SIZE, first, spp - first, SEED)
        sums = trace(scene.device_scene, emitters, camera, lanes, recipe.light)
        total = sums if total is None else total + sums
        spent, first = spent + time.process_time() - began, spp
        found.append(Sampled(aovs_of(result_from_sums(total, camera, spp, {})), spp, spent))
        began = time.process_time()
    return found


def grown_reference(
    view: MeasuredView, scene: LightScene, camera: Camera, recipe: Recipe
) -> tuple[LinearAovs, tuple[F32, F32], int]:
    """(reference, its two halves of all light, its samples), SPP_A_RUN samples longer than before."""
    from pbrs_farm.transport.path_tracer import Lanes, sums_from_arrays, trace

    path = Path(FOLDER / "references" / f"{view.key}_{SIZE[0]}x{SIZE[1]}.npz")
    total, spp = None, 0
    if path.exists():
        kept = dict(np.load(path))
        total, spp = sums_from_arrays(kept), int(kept["spp"])
    emitters, _weights = scene.emitters(camera, recipe.light, REFERENCE_SEED)
    for first in range(spp, min(spp + SPP_A_RUN, MOST_SPP), _SPP_A_PASS):
        lanes = Lanes(*SIZE, first, _SPP_A_PASS, REFERENCE_SEED)
        sums = trace(scene.device_scene, emitters, camera, lanes, recipe.light)
        total, spp = sums if total is None else total + sums, first + _SPP_A_PASS
        path.parent.mkdir(parents=True, exist_ok=True)
        np.savez(path, spp=np.int64(spp), **total.arrays())
    assert total is not None
    even = (total.outdoor_even + total.indoor_even) / np.float32(spp / 2)
    whole = (total.outdoor + total.indoor) / np.float32(spp)
    shape = (SIZE[1], SIZE[0], 3)
    halves = even.reshape(shape), (2 * whole - even).reshape(shape)
    return aovs_of(result_from_sums(total, camera, spp, {})), halves, spp


def aovs_of(result: LightResult) -> LinearAovs:
    """The images of a light result that are developed."""
    return LinearAovs(result.outdoor, result.indoor, result.albedo, result.normal)


def _raw(aovs: LinearAovs) -> LinearAovs:
    return aovs


def _together(aovs: LinearAovs) -> LinearAovs:
    """All light denoised at once; no mode with the lamps off is left, so this is a bound, no way."""
    clean = denoise_radiance(aovs.outdoor + aovs.indoor, aovs.albedo, aovs.normal)
    outdoor = denoise_radiance(aovs.outdoor, aovs.albedo, aovs.normal)
    return replace(aovs, outdoor=outdoor, indoor=clean - outdoor)


def _demodulated(aovs: LinearAovs) -> LinearAovs:
    """Each group divided by the albedo, denoised, and multiplied by it again."""
    albedo = np.maximum(aovs.albedo, np.float32(0.05))

    def clean(radiance: F32) -> F32:
        return denoise_radiance(radiance / albedo, aovs.albedo, aovs.normal) * albedo

    return replace(aovs, outdoor=clean(aovs.outdoor), indoor=clean(aovs.indoor))


def _prefiltered(aovs: LinearAovs) -> LinearAovs:
    """The guides denoised before they guide."""
    albedo, normal = (
        prefiltered(n, x) for n, x in (("albedo", aovs.albedo), ("normal", aovs.normal))
    )
    guided = replace(aovs, albedo=albedo, normal=normal)
    clean = denoise_aovs(guided)
    return replace(aovs, outdoor=clean.outdoor, indoor=clean.indoor)


def prefiltered(name: str, image: F32) -> F32:
    """A guide, denoised by itself."""
    import pyoidn

    out = np.empty_like(image)
    with pyoidn.Device() as device:
        device.commit()
        with pyoidn.Filter(device, pyoidn.OIDN_FILTER_TYPE_RT) as one:
            one.set_image(name, np.ascontiguousarray(image), pyoidn.OIDN_FORMAT_FLOAT3)
            one.set_image(pyoidn.OIDN_IMAGE_OUTPUT, out, pyoidn.OIDN_FORMAT_FLOAT3)
            one.commit()
            one.execute()
    return out


WAYS: Final[dict[str, Callable[[LinearAovs], LinearAovs]]] = {
    "raw": _raw,
    "fast": denoise_aovs,
    "together": _together,
    "demodulated": _demodulated,
    "prefiltered guides": _prefiltered,
}
"""Name -> a way to make a view of few samples clean; `fast` is what `develop` does."""


if __name__ == "__main__":
    main()
