"""Light transport: path, Metropolis and the denoiser at equal CPU time, scene by scene.

Every engine runs in this process on the same scene; errors are against a path-traced reference of
another seed. CPU time counts all threads. Ratios below 1 favour Metropolis. `light.png` shows path,
Metropolis and the reference of each scene, one under the other.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.report import FOLDER, write_report
from pbrs_farm.camera import Camera, Intrinsics
from pbrs_farm.frames import LUMINANCE
from pbrs_farm.house import House, geometry_from_house
from pbrs_farm.lighting import Group
from pbrs_farm.recipe import LightFields, Recipe
from pbrs_farm.transport.denoise import denoise
from pbrs_farm.transport.result import LightResult
from pbrs_farm.transport.scene import LightScene
from pbrs_farm.transport.sky import Sky, dark_sky, sky_for_house, sunsky
from pbrs_farm.transport.tone import tone
from tests.transport import hard_rooms

SIZE = (96, 72)
REFERENCE_SPP = 8192
PATH_SPP = 256
MUTATIONS = 512
HOMES = ("2BedroomApartment", "Studio")


@dataclass(frozen=True, slots=True)
class Shot:
    """A scene and a camera. key: the part of the figures' names."""

    key: str
    scene: LightScene
    camera: Camera


def main() -> None:
    """Measure, print and write out/bench/light.json and light.png."""
    figures: dict[str, Any] = {}
    units: dict[str, str] = {}
    rows = []
    for make in (*_room_makers(), *_home_makers()):
        shot = make()
        found, row = _compared(shot)
        rows.append(row)
        for name, value in found.items():
            figures[f"light.{shot.key}_{name}"] = round(value, 4)
            units[f"light.{shot.key}_{name}"] = "s CPU" if name.endswith("_s") else "-"
    figures["light.mutation_cost"] = round(_mutation_cost(), 3)
    units["light.mutation_cost"] = "path samples of the same depth"
    _write_picture(rows)
    write_report("light", figures, units)


def _room_makers() -> list[Callable[[], Shot]]:
    recipe = Recipe()
    sun = sunsky(recipe, elevation_rad=0.6, azimuth_rad=0.35)

    def shot(key: str, room: tuple[House, Camera], sky: Sky) -> Shot:
        return Shot(key, LightScene.load(room[0], {}, recipe, sky), room[1])

    return [
        lambda: shot("door", hard_rooms.door_ajar(), dark_sky()),
        lambda: shot("globe", hard_rooms.glass_globe(), dark_sky()),
        lambda: shot("sunlit", hard_rooms.sunlit(), sun),
        lambda: shot("shade", hard_rooms.open_shade(), dark_sky()),
    ]


def _home_makers() -> list[Callable[[], Shot]]:
    def shot(name: str) -> Shot:
        from pbrs_farm.farm.loaded import decoded_textures
        from pbrs_farm.farm.sources import read_house, resolve
        from pbrs_farm.repair import repair
        from pbrs_farm.transport.caster import Caster

        recipe = Recipe()
        house, _report = repair(
            read_house(resolve(name), recipe.read),
            recipe.repair,
            occluder_from=lambda h: Caster(geometry_from_house(h)),
        )
        scene = LightScene.load(
            house, decoded_textures(house), recipe, sky_for_house(recipe, house.id)
        )
        stored = house.cameras[0]
        camera = Camera.look(
            Intrinsics.from_hfov(*SIZE, stored.hfov_rad), stored.eye, stored.towards
        )
        return Shot(name.lower(), scene, camera)

    return [lambda name=name: shot(name) for name in HOMES]  # type: ignore[misc]


def _compared(shot: Shot) -> tuple[dict[str, float], list[NDArray[np.uint8]]]:
    """Figures of one shot, and its pictures: path, Metropolis, reference."""
    camera = shot.camera.with_size(*SIZE)
    plain = LightFields(filter="box", denoise=False)
    markov = plain.model_copy(
        update={
            "integrator": "metropolis",
            "direct_spp": 16,
            "mutations_per_pixel": MUTATIONS,
            "chains": 4096,
        }
    )
    reference, _s = _timed(shot, camera, plain.model_copy(update={"spp": REFERENCE_SPP}), seed=999)
    path, path_s = _timed(shot, camera, plain.model_copy(update={"spp": PATH_SPP}), seed=1)
    chains, chains_s = _timed(shot, camera, markov, seed=1)
    began = time.process_time()
    clean = denoise(path)
    clean_s = path_s + time.process_time() - began

    truth = _sum(reference)
    error = {k: _relative_square(_sum(r), truth) for k, r in (("path", path), ("mlt", chains))}
    cleaned = float(np.mean(_relative_square(_sum(clean), truth)))
    found = {
        "path_s": path_s,
        "metropolis_s": chains_s,
        "path_relmse": float(error["path"].mean()),
        "metropolis_relmse": float(error["mlt"].mean()),
        "relmse_ratio": float(error["mlt"].mean() * chains_s / (error["path"].mean() * path_s)),
        "median_ratio": math.sqrt(
            float(np.median(error["mlt"])) * chains_s / (float(np.median(error["path"])) * path_s)
        ),
        "denoised_relmse": cleaned,
        "denoised_times_cheaper": float(error["mlt"].mean()) * chains_s / (cleaned * clean_s),
    }
    print(f"{shot.key}: {found}", flush=True)
    tones = Recipe().tone
    return found, [tone(_sum(r), tones) for r in (path, chains, reference)]


def _timed(
    shot: Shot, camera: Camera, fields: LightFields, *, seed: int
) -> tuple[LightResult, float]:
    """(result, CPU seconds of all threads); kernels are compiled before the clock starts."""
    few = {"spp": 1, "direct_spp": 1, "mutations_per_pixel": 1}
    shot.scene.render(camera, "-", fields.model_copy(update=few), seed)
    began = time.process_time()
    result = shot.scene.render(camera, "-", fields, seed)
    return result, time.process_time() - began


def _mutation_cost() -> float:
    """CPU time of a mutation over that of a path sample, both of freshly drawn paths.

    With 99 % large steps a proposal is a path like any other, so that depths are the same.
    """
    from pbrs_farm.transport import metropolis as markov

    house, camera = hard_rooms.sunlit()
    scene = LightScene.load(
        house, {}, Recipe(), sunsky(Recipe(), elevation_rad=0.6, azimuth_rad=0.35)
    )
    camera = camera.with_size(*SIZE)
    fields = LightFields(
        filter="box", spp=256, large_step=0.99, mutations_per_pixel=256, rr_depth=4, direct_spp=0
    )
    shot = Shot("cost", scene, camera)
    _result, path_s = _timed(shot, camera, fields, seed=1)
    emitters, _weights = scene.emitters(camera, fields, 1)

    def mutate(n: int) -> int:
        some = fields.model_copy(update={"mutations_per_pixel": n})
        return markov.metropolis(
            scene.stage, emitters, camera, Group.OUTDOOR, some, 1, min_segments=1
        ).n_mutations

    mutate(1)
    began = time.process_time()
    n = mutate(256)
    return (time.process_time() - began) / n / (path_s / (256 * SIZE[0] * SIZE[1]))


def _sum(result: LightResult) -> NDArray[np.float64]:
    return np.asarray(result.outdoor + result.indoor, np.float64)


def _relative_square(
    picture: NDArray[np.float64], truth: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(H, W) squared error of luminance over the squared reference, dark pixels held up."""
    y, t = picture @ LUMINANCE, truth @ LUMINANCE
    return np.asarray((y - t) ** 2 / (t**2 + 1e-3 * t.mean() ** 2))


def _write_picture(rows: list[list[NDArray[np.uint8]]]) -> None:
    from pbrs_farm.images import png_from_array

    picture = np.concatenate([np.concatenate(row, 1) for row in rows], 0)
    picture = picture.repeat(2, 0).repeat(2, 1)
    FOLDER.mkdir(parents=True, exist_ok=True)
    Path(FOLDER / "light.png").write_bytes(png_from_array(picture))


if __name__ == "__main__":
    main()
