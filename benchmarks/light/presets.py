"""The same views of example homes in every preset: pictures, cost, noise; out/bench/presets.jpg.

`paper` and `released` with 64 direct samples instead of 512 and 24 mutations instead of 1,024:
their own counts are minutes a view on two cores. All at 240x180.
"""

from __future__ import annotations

import time
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from benchmarks.figures import FOLDER, write_report
from pbrs_farm.core.camera import Camera, Intrinsics
from pbrs_farm.core.recipe import Recipe, recipe_from_name
from pbrs_farm.images import jpeg_from_array
from pbrs_farm.prepare.finished_house import repaired_house
from pbrs_farm.prepare.source import resolve
from pbrs_farm.run.house_cache import decoded_textures, panorama_for_house
from pbrs_farm.transport.develop.mode_pictures import LinearAovs, develop
from pbrs_farm.transport.light_scene import LightScene
from pbrs_farm.transport.scene_tables.sky import sky_for_house

SIZE: Final = (240, 180)
VIEWS: Final = (("Studio", 2), ("3BedroomApartment", 0), ("2BedroomApartmentWithBowWindow", 2))
"""Home and number of the stored camera."""

REDUCED: Final = {"light.direct_spp": "64", "light.mutations_per_pixel": "24"}
PRESETS: Final = {"preview": {}, "fast": {}, "paper": REDUCED, "released": REDUCED}


def main() -> None:
    """Render, print cost and noise of each, write the sheet: a row a home, a column a preset."""
    from pbrs_farm.assets import homes_package, skies

    homes_package.fetch()
    skies.fetch_skies()
    figures: dict[str, Any] = {}
    units: dict[str, str] = {}
    rows = []
    for name, number in VIEWS:
        row = []
        for preset, changes in PRESETS.items():
            picture, cpu_s, noise = _made(name, number, recipe_from_name(preset, changes))
            key = f"presets.{name.lower()}_{preset}"
            figures[f"{key}_cpu_s"], units[f"{key}_cpu_s"] = round(cpu_s, 1), "s CPU"
            figures[f"{key}_noise"] = round(noise, 3)
            units[f"{key}_noise"] = "relative error before the denoiser"
            print(f"{name:<34}{preset:<10}{cpu_s:>8.1f} s CPU   noise {noise:.3f}", flush=True)
            row.append(picture)
        rows.append(np.concatenate(row, 1))
    FOLDER.mkdir(parents=True, exist_ok=True)
    (FOLDER / "presets.jpg").write_bytes(jpeg_from_array(np.concatenate(rows), 88))
    write_report("presets", figures, units)


def _made(name: str, number: int, recipe: Recipe) -> tuple[NDArray[np.uint8], float, float]:
    """(picture of both groups, CPU seconds of light and development, noise of the sum)."""
    house, _report = repaired_house(resolve(name), recipe)
    textures, _unreadable = decoded_textures(house)
    sky = sky_for_house(recipe, house.id, panorama=panorama_for_house(recipe, house.id))
    scene = LightScene.load(house, textures, recipe, sky)
    stored = house.cameras[number]
    intrinsics = Intrinsics.from_hfov(*SIZE, stored.hfov_rad)
    camera = Camera.look(intrinsics, stored.eye, stored.towards)

    # Compile before the clock starts.
    few = {"spp": 1, "direct_spp": 1, "mutations_per_pixel": 1}
    scene.render(camera, name, recipe.light.model_copy(update=few), 1)
    began = time.process_time()
    result = scene.render(camera, name, recipe.light, 1)
    aovs = LinearAovs(result.outdoor, result.indoor, result.albedo, result.normal)
    images = develop(aovs, recipe.tone, denoise=recipe.light.denoise)
    cpu_s = time.process_time() - began
    return images["mlt_il_ol"].rgb_srgb8, cpu_s, result.noise["sum"]


if __name__ == "__main__":
    main()
