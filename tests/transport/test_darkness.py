"""Thresholds for a dark room and a black picture."""

from __future__ import annotations

import numpy as np

from pbrs_farm.transport.illuminance import darkness_of_room, photometric_warnings
from pbrs_farm.transport.light_result import LightResult, darkness_of_picture
from pbrs_farm.transport.validation import known_rooms as rooms

SHAPE = (24, 32, 3)


def result(outdoor: np.ndarray, normal: np.ndarray | None = None) -> LightResult:  # type: ignore[type-arg]
    none = np.zeros(SHAPE, np.float32)
    hit = np.ones(SHAPE, np.float32) if normal is None else normal
    return LightResult(outdoor, none, none, hit, {}, 16, 0, {})


def test_a_picture_without_light_is_black_and_a_candlelit_one_is_not() -> None:
    assert darkness_of_picture(result(np.zeros(SHAPE, np.float32))).startswith("black")
    assert darkness_of_picture(result(np.full(SHAPE, 0.001, np.float32))) == ""


def test_a_picture_with_one_bright_pixel_is_black() -> None:
    firefly = np.zeros(SHAPE, np.float32)
    firefly[3, 4] = 1e6
    assert darkness_of_picture(result(firefly)) != ""


def test_noise_that_leaves_most_pixels_without_light_does_not_make_a_picture_black() -> None:
    rng = np.random.default_rng(0)
    sparse = np.where(rng.random((24, 32, 1)) < 0.08, 0.1, 0.0) * np.ones(3)
    assert darkness_of_picture(result(sparse.astype(np.float32))) == ""


def test_a_small_object_on_an_empty_background_is_judged_by_its_pixels() -> None:
    image, normal = np.zeros(SHAPE, np.float32), np.zeros(SHAPE, np.float32)
    image[10:12, 10:12], normal[10:12, 10:12] = 1.0, 1.0
    assert darkness_of_picture(result(image, normal)) == ""


def test_a_room_below_1_lx_by_all_light_is_warned_of() -> None:
    room = rooms.house([], []).rooms[0]
    dark, dim = {"outdoor": 0.4, "indoor": 0.3}, {"outdoor": 0.9, "indoor": 0.3}
    assert darkness_of_room(room, dark) in photometric_warnings(room, dark)
    assert "0.7 lx on the floor by all light" in darkness_of_room(room, dark)
    assert darkness_of_room(room, dim) == ""
