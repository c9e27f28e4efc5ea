"""Light reflected by a coated surface, as `verify` expects it, against the model of docs/light_methods.md."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from pbrs_farm.check.lit_checks import LitPlaces
from pbrs_farm.check.radiance_checks import coated_materials


def _expected_radiance(albedo: float, to_light: float, to_camera: float) -> float:
    """Radiance relative to a matt surface of the same albedo, including a coat of F0 0.04."""
    kd, f0 = albedo - 0.04, 0.04

    def through(cosine: float) -> float:
        return 1 - (1 - cosine / 2) ** 5

    return 28 / 23 * kd * (1 - f0) * through(to_light) * through(to_camera) / albedo


@pytest.mark.parametrize("to_camera", [0.15, 0.5, 0.98])
@pytest.mark.parametrize("to_light", [0.3, 0.86])
@pytest.mark.parametrize("albedo", [0.1, 0.94])
def test_a_coated_ceiling_seen_at_a_slant_sends_less_back(
    albedo: float, to_light: float, to_camera: float
) -> None:
    ones, none = np.ones(1), np.zeros((1, 3))
    painted = ones * 0.96 * (1 - 0.04 / albedo)
    places = LitPlaces(
        np.zeros(1, int), np.zeros(1, int), none, none, none[None], painted, ones * to_camera
    )
    expected = min(_expected_radiance(albedo, to_light, to_camera), 1)
    assert places.returned(ones * to_light)[0] == pytest.approx(expected, rel=1e-3)


def test_roughness_makes_a_coat_and_a_colour_without_shine_does_not() -> None:
    dull = {
        "roughness": None, "roughness_texture_id": None, "shininess": 40.0,
        "specular": [0.0, 0.0, 0.0],
    }  # fmt: skip
    rough, shiny = dull | {"roughness": 0.9}, dull | {"specular": [0.2, 0.2, 0.2]}
    materials = [dull, rough, shiny, shiny | {"shininess": 0.0}]
    house = SimpleNamespace(house={"materials": materials}, recipe={})
    assert coated_materials(house).tolist() == [False, True, True, False]
    house.recipe = {"materials": {"preset": "released"}}
    assert not coated_materials(house).any()
