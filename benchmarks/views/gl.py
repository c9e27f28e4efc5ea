"""OpenGL-DL and OpenGL-IL: views a second at 640x480, 4 samples a pixel, in a large home."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from benchmarks.figures import write_report
from pbrs_farm.core.arrays import Srgb8Image
from pbrs_farm.core.camera import Camera, Intrinsics
from pbrs_farm.core.frames import rotation_y
from pbrs_farm.core.house import House
from pbrs_farm.core.recipe import Recipe
from pbrs_farm.prepare.read_source import read_house
from pbrs_farm.prepare.source import resolve
from pbrs_farm.raster import Rasterizer
from pbrs_farm.run.house_cache import decoded_textures

HOME = "2BedroomApartmentWithBowWindow"
SIZE = (640, 480)
N_ROUNDS = 3


def main() -> None:
    """Measure, print and write out/bench/gl.json. The home as read: some 217,000 triangles."""
    house = read_house(resolve(HOME), Recipe().read)
    cameras = turned_cameras(house, n_turns=4)
    started = time.perf_counter()
    with Rasterizer(house, decoded_textures(house)[0], Recipe().raster) as raster:
        load_s = time.perf_counter() - started
        dl, il = (_rates(draw, cameras) for draw in (raster.render_dl, raster.render_il))
        name = raster.name
    print(f"{HOME}, {len(cameras)} views of {SIZE[0]}x{SIZE[1]}, {name}")
    figures = {
        "gl.picture_s": round(1 / dl[0], 4),
        "gl.dl_views_per_s": round(dl[0], 2),
        "gl.il_views_per_s": round(il[0], 2),
        "gl.dl_cpu_s_per_view": round(dl[1], 4),
        "gl.il_cpu_s_per_view": round(il[1], 4),
        "gl.load_s": round(load_s, 2),
        "gl.triangles": sum(item.n_faces for item in house.items),
    }
    units = dict.fromkeys(figures, "1/s") | {
        "gl.picture_s": "s of an OpenGL-DL picture",
        "gl.dl_cpu_s_per_view": "s of all cores",
        "gl.il_cpu_s_per_view": "s of all cores",
        "gl.load_s": "s",
        "gl.triangles": "triangles",
    }
    write_report("gl", figures, units)


def turned_cameras(house: House, n_turns: int) -> list[Camera]:
    """The home's stored viewpoints, each looking n_turns ways around."""
    intrinsics = Intrinsics.from_hfov(*SIZE)
    return [
        Camera.look(intrinsics, stored.eye, rotation_y(2 * np.pi * k / n_turns) @ stored.towards)
        for stored in house.cameras
        for k in range(n_turns)
    ]


def _rates(draw: Callable[[Camera], Srgb8Image], cameras: list[Camera]) -> tuple[float, float]:
    """(views a second, CPU seconds a view) of the best of N_ROUNDS rounds, shaders compiled before."""
    for camera in cameras:
        draw(camera)
    rounds = []
    for _ in range(N_ROUNDS):
        wall, cpu = time.perf_counter(), time.process_time()
        for camera in cameras:
            draw(camera)
        rounds.append((time.perf_counter() - wall, time.process_time() - cpu))
    best = min(rounds)
    return len(cameras) / best[0], min(cpu for _wall, cpu in rounds) / len(cameras)


if __name__ == "__main__":
    main()
