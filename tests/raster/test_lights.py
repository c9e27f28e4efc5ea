import numpy as np
import pytest

from pbrs_farm.core.house import ItemKind, LightPart, Material, Surface
from pbrs_farm.core.lighting import LightForm, PowerUnit
from pbrs_farm.raster.light_choice import (
    FLOOR_LEVEL,
    SOFTENING_M,
    best_lights,
    brightness_scale,
    illuminance,
    light_table,
)
from tests.raster.raster_scenes import house, item, square


def lamp(x: float, lumen: float = 800.0, **rest: object) -> LightPart:
    return LightPart((x, 2.0, 0.0), 0.03, lumen, PowerUnit.LUMEN, **rest)  # type: ignore[arg-type]


def table(*parts: LightPart) -> np.ndarray:
    return light_table(house((item(square(0, 0), lights=parts),), (Material("m"),)))


def test_the_strongest_lights_at_the_box_are_kept_not_the_weakest():
    lights = table(lamp(9.0), lamp(1.0), lamp(5.0, 80_000.0), lamp(30.0))
    low, high = np.array([[-1.0, 0.0, -1.0]]), np.array([[1.0, 2.0, 1.0]])
    # I / d^2 with the softened distance: 100 / 16, 1 / 0, 1 / 64, 1 / 841.
    assert best_lights(lights, low, high, 3).tolist() == [[1, 2, 0]]


def test_fewer_lights_than_requested_are_all_kept():
    assert best_lights(table(lamp(1.0)), np.zeros((2, 3)), np.ones((2, 3)), 8).shape == (2, 1)


def test_a_point_light_follows_the_inverse_square_of_the_softened_distance():
    lights = table(lamp(0.0, 4 * np.pi * 100))
    points, up = np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0]]), np.array([[0.0, 1.0, 0.0]] * 2)
    lx = illuminance(points, up, np.stack([lights, lights]))
    assert lx[0] == pytest.approx(100 / (4 + SOFTENING_M**2), rel=1e-6)
    assert lx[1] == pytest.approx(100 * np.cos(np.pi / 4) / (8 + SOFTENING_M**2), rel=1e-6)


def test_a_spot_lights_only_inside_its_cone():
    lights = table(lamp(0.0, form=LightForm.SPOT, cutoff_rad=0.5, dropoff=1.0))
    points, up = np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0]]), np.array([[0.0, 1.0, 0.0]] * 2)
    lx = illuminance(points, up, np.stack([lights, lights]))
    assert lx[0] > 0
    assert lx[1] == 0


def test_doubling_every_lamp_leaves_the_brightness_unchanged():
    floor = Surface(
        "floor",
        np.array([[-2, 0, -2], [2, 0, -2], [2, 0, 2], [-2, 0, 2]], np.float32),
        np.array([[0, 2, 1], [0, 3, 2]], np.int32),
        0,
    )
    scales = []
    for lumen in (800.0, 1600.0):
        scene = house(
            (item(floor, kind=ItemKind.FLOOR, lights=(lamp(0.0, lumen),)),), (Material("m"),)
        )
        scales.append(brightness_scale(scene, 8) * lumen)
    assert scales[0] == pytest.approx(scales[1])
    # The lamp is 2 m above the middle: the median is below the brightest point.
    assert brightness_scale(scene, 8) > FLOOR_LEVEL / (1600 / (4 * np.pi) / (4 + SOFTENING_M**2))
