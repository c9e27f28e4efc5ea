"""Blur follows a walk's frames, else the recipe; focus is on the middle of the picture."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pbrs_farm.core.camera import Camera, CameraBlur, Intrinsics, View
from pbrs_farm.core.errors import BadRecipe
from pbrs_farm.core.frames import rotation_y
from pbrs_farm.core.recipe import BlurFields, recipe_from_name
from pbrs_farm.core.shot import Shot
from pbrs_farm.run.view_setup import ViewSetup


def frame(number: int | None, x: float, yaw: float = 0.0) -> View:
    pose = np.eye(4)
    pose[:3, :3], pose[0, 3] = rotation_y(yaw), x
    camera = Camera(Intrinsics.from_hfov(8, 6), pose)
    name = "0_0_1" if number is None else Shot.of_frame(number).id
    return View(name, "r", 0, camera, frame=number, time_s=(number or 0) * 0.1)


CASTER = SimpleNamespace(first_hit=lambda o, d: (np.array([3.5]), np.array([0])))


def blur_of(view: View, fields: BlurFields, *others: View) -> CameraBlur:
    recipe = recipe_from_name("fast").model_copy(update={"blur": fields})
    house: Any = SimpleNamespace(recipe=recipe, at=lambda _time: SimpleNamespace(caster=CASTER))
    blur = ViewSetup(house, view, {v.id: v for v in (view, *others)}).blur
    assert blur is not None
    return blur


def test_a_frame_moves_as_between_its_neighbours() -> None:
    before, view, after = frame(0, 0.0), frame(1, 0.1, 0.05), frame(2, 0.2, 0.1)
    blur = blur_of(view, BlurFields(shutter_s=0.02), before, after)
    # 1 m/s and half a radian a second, for a fiftieth of a second.
    assert np.allclose(blur.velocity_m, (0.02, 0, 0))
    assert np.allclose(blur.turn_rad, (0, 0.01, 0))


def test_a_single_view_moves_by_the_recipe_in_its_local_axes() -> None:
    view = frame(None, 0.0, np.pi / 2)
    fields = BlurFields(shutter_s=0.1, right_mps=1.0, pan_dps=90.0)
    blur = blur_of(view, fields)
    assert np.allclose(blur.velocity_m, (0, 0, -0.1))
    assert np.allclose(blur.turn_rad, (0, -np.pi / 20, 0))


def test_rows_lit_in_turn_share_the_time_with_the_shutter() -> None:
    view = frame(None, 0.0)
    fields = BlurFields(shutter_s=0.01, rolling_s=0.03, right_mps=1.0)
    blur = blur_of(view, fields)
    assert np.allclose(blur.velocity_m, (0.04, 0, 0))
    assert (blur.open_share, blur.rolling_share) == pytest.approx((0.25, 0.75))
    assert BlurFields(rolling_s=0.03).is_on


def test_a_recipe_without_a_rolling_shutter_keeps_its_digest() -> None:
    def digest(**fields: str) -> str:
        settings = {f"blur.{name}": value for name, value in fields.items()}
        return recipe_from_name("fast", settings).digest("blur")

    assert digest(shutter_s="0.01") == digest(shutter_s="0.01", rolling_s="0")
    assert digest(shutter_s="0.01") != digest(shutter_s="0.01", rolling_s="0.02")


def test_focus_is_on_the_middle_of_the_picture() -> None:
    view = frame(None, 0.0)
    blur = blur_of(view, BlurFields(aperture_mm=20))
    assert (blur.aperture_radius_m, blur.focus_m) == (0.01, 3.5)


@pytest.mark.parametrize(
    "settings",
    [
        {"blur.aperture_mm": "5", "light.integrator": "metropolis"},
        {"blur.aperture_mm": "5", "lens.preset": "tum_vi",
         "image.width_px": "512", "image.height_px": "512"},
    ],
)  # fmt: skip
def test_blur_that_cannot_be_is_refused(settings: dict[str, str]) -> None:
    with pytest.raises(BadRecipe, match="blur"):
        recipe_from_name("fast", settings)
