"""CPU and error of light by samples, presets and size of the home: `make bench NAME=light` -> out/bench/light.json.

Three parts: raw and denoised pictures of VIEWS at SIZE after 8 to 64 samples, judged by FLIP against a long reference;
the four presets in one view; whole `fast` views of a room with 100,000 to 4 million triangles and 10 to 500 lamps.
CPU is of all threads. FLIP (Andersson et al. 2020) needs the extra `bench`.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, Final

import numpy as np

from benchmarks.figures import write_report
from benchmarks.light.large_room import waves_room
from pbrs_farm.core.camera import Camera, Intrinsics
from pbrs_farm.core.house import House
from pbrs_farm.core.recipe import Recipe, ToneFields, recipe_from_name
from pbrs_farm.prepare.finished_house import repaired_house
from pbrs_farm.prepare.source import resolve, variants
from pbrs_farm.run.house_cache import decoded_textures, panorama_for_house
from pbrs_farm.transport.develop.mode_pictures import LinearAovs, denoise_aovs, develop
from pbrs_farm.transport.light_result import LightResult
from pbrs_farm.transport.light_scene import LightScene
from pbrs_farm.transport.scene_tables.sky import sky_for_house, sunsky
from pbrs_farm.transport.validation import known_rooms

VIEWS: Final = (("Studio", 0, 0), ("2BedroomApartment", 0, 0), ("3BedroomApartment", 1, 1))
"""Home, number of its stored camera, dressing seed (0 = bare)."""
SIZE: Final = (240, 180)
COUNTS: Final = (8, 28, 64)  # samples per pixel; 28 are those of `fast`
REFERENCE_SPP: Final = 1024
PRESETS: Final = ("preview", "fast", "paper", "released")
REDUCED: Final = {"direct_spp": 64, "mutations_per_pixel": 24}
"""Metropolis samples of the measured presets: 512 and 1,024 in the recipes, minutes a view."""
TRIANGLES: Final = (100_000, 1_000_000, 4_000_000)
LAMPS: Final = (10, 100, 500)
TRIANGLES_OF_LAMPS: Final = 300_000
_ROOM_SIZE: Final = (640, 480)
UNITS: Final = {
    **{
        f"light.{way}_{n}_{end}": f"{unit}, {way} at {n} samples, mean of {len(VIEWS)} views of {SIZE[0]}x{SIZE[1]}"
        for way in ("raw", "fast")
        for n in COUNTS
        for end, unit in (("cpu_s", "s of CPU"), ("flip", "FLIP"))
    },
    **{f"light.{preset}_cpu_s": f"s of CPU, {VIEWS[0][0]} at {SIZE[0]}x{SIZE[1]}" for preset in PRESETS},
    **{f"light.{preset}_noise": "relative error before the denoiser" for preset in PRESETS},
    **{
        f"light.{kind}_{n}_{end}": unit
        for kind, values in (("triangles", TRIANGLES), ("lamps", LAMPS))
        for n in values
        for end, unit in (
            ("times", f"times the CPU of a view with {values[0]:,}"),
            ("load_s", "s of CPU to load the scene"),
        )
    },
}  # fmt: skip


def main() -> None:
    """Measure the three parts and write out/bench/light.json."""
    figures = error_figures() | preset_figures()
    figures |= growth_figures("triangles", TRIANGLES, lambda n: waves_room(n, 1))
    figures |= growth_figures("lamps", LAMPS, lambda n: waves_room(TRIANGLES_OF_LAMPS, n))
    write_report("light", figures, UNITS)


def error_figures() -> dict[str, float]:
    """CPU and FLIP of raw and denoised pictures, by samples."""
    recipe = recipe_from_name("fast")
    rows: dict[str, list[float]] = {}
    for home, camera_index, seed in VIEWS:
        scene, camera = _view(home, camera_index, seed, recipe)
        reference, _cpu = _rendered(scene, camera, recipe, REFERENCE_SPP, 998)
        reference = denoise_aovs(reference)
        for n in COUNTS:
            noisy, cpu_s = _rendered(scene, camera, recipe, n, 1)
            began = time.process_time()
            clean = denoise_aovs(noisy)
            denoised_s = cpu_s + time.process_time() - began
            for way, aovs, seconds in (("raw", noisy, cpu_s), ("fast", clean, denoised_s)):
                rows.setdefault(f"light.{way}_{n}_cpu_s", []).append(seconds)
                error = flip(aovs, reference, recipe.tone)
                rows.setdefault(f"light.{way}_{n}_flip", []).append(error)
                print(f"{home:<24}{way:<5}{n:>4}{seconds:>8.2f} s  FLIP {error:.4f}", flush=True)
    return {name: round(float(np.mean(values)), 4) for name, values in rows.items()}


def _view(home: str, index: int, seed: int, recipe: Recipe) -> tuple[LightScene, Camera]:
    source = resolve(home)
    house, _report = repaired_house(variants(source, [seed])[0] if seed else source, recipe)
    panorama = panorama_for_house(recipe, source.house_id)
    sky = sky_for_house(recipe, source.house_id, panorama=panorama)
    scene = LightScene.load(house, decoded_textures(house)[0], recipe, sky)
    stored = house.cameras[index]
    intrinsics = Intrinsics.from_hfov(*SIZE, stored.hfov_rad)
    camera = Camera.look(intrinsics, stored.eye, stored.towards)
    _compile(scene, camera, recipe)
    return scene, camera


def _compile(scene: LightScene, camera: Camera, recipe: Recipe) -> None:
    few = {"spp": 1, "direct_spp": 1, "mutations_per_pixel": 1}
    scene.render(camera, "-", recipe.light.model_copy(update=few), 1)


def _rendered(
    scene: LightScene, camera: Camera, recipe: Recipe, spp: int, seed: int
) -> tuple[LinearAovs, float]:
    """(images of both light groups, CPU seconds)."""
    began = time.process_time()
    result = scene.render(camera, "-", recipe.light.model_copy(update={"spp": spp}), seed)
    return _aovs(result), time.process_time() - began


def _aovs(result: LightResult) -> LinearAovs:
    return LinearAovs(result.outdoor, result.indoor, result.albedo, result.normal)


def flip(aovs: LinearAovs, reference: LinearAovs, fields: ToneFields) -> float:
    """Mean FLIP of the two light modes' developed pictures, neither denoised again."""
    import flip_evaluator

    errors = []
    ours, theirs = (develop(x, fields, denoise=False) for x in (aovs, reference))
    for mode, image in theirs.items():
        pair = [np.float32(x.rgb_srgb8) / np.float32(255) for x in (image, ours[mode])]
        _map, mean, _parameters = flip_evaluator.evaluate(*pair, "LDR", applyMagma=False)
        errors.append(float(mean))
    return float(np.mean(errors))


def preset_figures() -> dict[str, float]:
    """CPU of light and picture, and noise before the denoiser, of every preset in one view."""
    from pbrs_farm.assets import skies

    skies.fetch_skies()
    figures = {}
    for preset in PRESETS:
        recipe = recipe_from_name(preset)
        if recipe.light.integrator == "metropolis":
            recipe = recipe.model_copy(update={"light": recipe.light.model_copy(update=REDUCED)})
        scene, camera = _view(*VIEWS[0], recipe)
        began = time.process_time()
        result = scene.render(camera, "-", recipe.light, 1)
        develop(_aovs(result), recipe.tone, denoise=recipe.light.denoise)
        figures[f"light.{preset}_cpu_s"] = round(time.process_time() - began, 2)
        figures[f"light.{preset}_noise"] = round(result.noise["sum"], 3)
        print(f"{preset:<10}{figures[f'light.{preset}_cpu_s']:>8.2f} s", flush=True)
    return figures


def growth_figures(
    kind: str, values: tuple[int, ...], house_of: Callable[[int], House]
) -> dict[str, Any]:
    """CPU of a whole `fast` view of 640x480, pilot and trial included, over that of the first value."""
    recipe, figures, seconds = recipe_from_name("fast"), {}, []
    camera = known_rooms.camera((0.5, 2.0, 5.5), (3.0, 0.8, 3.0)).with_size(*_ROOM_SIZE)
    for value in values:
        began = time.process_time()
        sky = sunsky(recipe, elevation_rad=0.6, azimuth_rad=0.35)
        scene = LightScene.load(house_of(value), {}, recipe, sky)
        load_s = time.process_time() - began
        _compile(scene, camera.with_size(160, 120), recipe)
        began = time.process_time()
        scene.render(camera, "-", recipe.light, 0)
        seconds.append(time.process_time() - began)
        figures[f"light.{kind}_{value}_times"] = round(seconds[-1] / seconds[0], 3)
        figures[f"light.{kind}_{value}_load_s"] = round(load_s, 2)
        print(f"{value:>10,} {kind}: {seconds[-1]:.1f} s, loaded in {load_s:.1f} s", flush=True)
    return figures


if __name__ == "__main__":
    main()
