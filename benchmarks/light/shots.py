"""The scenes in which path and Metropolis are compared, and timed renders of them. Effects: reads example homes."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from benchmarks.light.measured_views import MeasuredView, loaded
from pbrs_farm.core.camera import Camera
from pbrs_farm.core.recipe import LightFields, Recipe
from pbrs_farm.transport.light_result import LightResult
from pbrs_farm.transport.light_scene import LightScene
from pbrs_farm.transport.scene_tables.sky import dark_sky, sunsky
from tests.transport import hard_rooms

PLAIN: Final = LightFields(filter="box", denoise=False)
METROPOLIS: Final = PLAIN.model_copy(
    update={"integrator": "metropolis", "mutations_per_pixel": 128}
)
SIX: Final = tuple(
    MeasuredView(home, camera)
    for home in ("2BedroomApartment", "Studio", "3BedroomApartment")
    for camera in (0, 1)
)
ROOMS: Final = {
    "door": ("door ajar by 6 cm", hard_rooms.door_ajar),
    "globe": ("bulb in a glass globe", hard_rooms.glass_globe),
    "sunlit": ("sunlit room", hard_rooms.sunlit),
    "shade": ("lamp in an open shade", hard_rooms.open_shade),
}


@dataclass(frozen=True, slots=True)
class Shot:
    """A scene and a camera. key: the part of the figures' names; name: for people."""

    key: str
    name: str
    scene: LightScene
    camera: Camera


def room_shot(key: str, size: tuple[int, int]) -> Shot:
    """One of ROOMS; the sunlit one has sun and sky, the others only their lamps."""
    name, make = ROOMS[key]
    house, camera = make()
    recipe = Recipe()
    sunny = key == "sunlit"
    sky = sunsky(recipe, elevation_rad=0.6, azimuth_rad=0.35) if sunny else dark_sky()
    return Shot(key, name, LightScene.load(house, {}, recipe, sky), camera.with_size(*size))


def home_shots(views: tuple[MeasuredView, ...], size: tuple[int, int]) -> Iterator[Shot]:
    """Stored cameras of example homes by daylight and lamps; one scene at a time is held."""
    for view, scene, camera in loaded(views, Recipe(), size):
        yield Shot(view.key, f"{view.home}, camera {view.camera + 1}", scene, camera)


def timed(shot: Shot, fields: LightFields, *, seed: int) -> tuple[LightResult, float]:
    """(result, CPU seconds of all threads); kernels are compiled before the clock starts."""
    few = {"spp": 1, "direct_spp": 1, "mutations_per_pixel": 1}
    shot.scene.render(shot.camera, "-", fields.model_copy(update=few), seed)
    began = time.process_time()
    result = shot.scene.render(shot.camera, "-", fields, seed)
    return result, time.process_time() - began


def all_light(result: LightResult) -> NDArray[np.float64]:
    """(H, W, 3) radiance of both groups together."""
    return np.asarray(result.outdoor + result.indoor, np.float64)
