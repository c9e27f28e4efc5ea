"""Russian roulette of shadow rays: survival probability, and unbiased pictures."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from pbrs_farm.core.camera import Camera
from pbrs_farm.core.house import House
from pbrs_farm.core.lighting import Group
from pbrs_farm.core.recipe import LightFields, recipe_from_name
from pbrs_farm.raycast.variant import choose_variant
from pbrs_farm.transport.light_scene import LightScene
from pbrs_farm.transport.scene_tables.sky import sunsky
from pbrs_farm.transport.validation import known_rooms as rooms
from pbrs_farm.transport.validation.claims import blocks, z_scores
from tests.transport import hard_rooms

if choose_variant().startswith("scalar"):
    pytest.skip("the kernels need LLVM or CUDA", allow_module_level=True)

RECIPE = recipe_from_name("fast")
FIELDS: LightFields = RECIPE.light.model_copy(update={"filter": "box", "spp": 64})
SKY = sunsky(RECIPE, elevation_rad=0.6, azimuth_rad=0.35)


def scene_and_camera(room: Callable[[], tuple[House, Camera]]) -> tuple[LightScene, Camera]:
    house, camera = room()
    return LightScene.load(house, {}, RECIPE, SKY), camera.with_size(32, 24)


def test_a_ray_survives_by_its_expected_contribution_and_at_least_one_in_ten() -> None:
    import drjit as dr
    import mitsuba as mi

    from pbrs_farm.transport.kernels.shadow_roulette import ShadowRoulette

    n = 100_000
    u = (dr.arange(mi.Float, n) + 0.5) / n
    throughput = mi.Color3f(0.5)
    for threshold, brings, rate, expected in (
        (0.0, 0.001, 1.0, 1.0),
        (2.0, 8.0, 1.0, 1.0),
        (2.0, 1.0, 1.0, 0.25),
        (2.0, 2.0, 0.5, 0.25),  # half of these rays arrive
        (2.0, 0.004, 1.0, 0.1),
        (2.0, float("nan"), 1.0, 1.0),  # counted, so that it is not hidden
    ):
        roulette = ShadowRoulette(throughput, mi.Float(threshold), u)
        is_cast, chance = roulette.cast_by_chance(mi.Color3f(brings), mi.Float(rate))
        assert np.allclose(chance.numpy(), expected)
        assert is_cast.numpy().mean() == pytest.approx(expected, abs=1e-3)


@pytest.mark.long
@pytest.mark.parametrize(
    "room", [lambda: rooms.window_room(0.7, lumen=800), hard_rooms.covered_cup], ids=["sun", "cup"]
)
def test_roulette_of_shadow_rays_keeps_the_mean(
    room: Callable[[], tuple[House, Camera]], monkeypatch: pytest.MonkeyPatch
) -> None:
    # Ten times the usual threshold: nearly every ray is subject to roulette. Significance: 16
    # blocks of each group, |z| < 4.5 each is missed by chance once in 4500 runs.
    from pbrs_farm.transport import pilot

    scene, camera = scene_and_camera(room)
    block_means: dict[float, list[list[np.ndarray]]] = {}
    for factor, first_seed in ((0.0, 10), (10.0, 20)):
        monkeypatch.setattr(pilot, "SHADOW_SHARE", factor * pilot.SHADOW_SHARE)
        seeds = range(first_seed, first_seed + 6)  # disjoint seeds for independent pictures
        results = [scene.render(camera, "-", FIELDS, seed) for seed in seeds]
        monkeypatch.undo()
        block_means[factor] = [[blocks(r.group(g)) for r in results] for g in Group]
    for without, by_chance in zip(block_means[0.0], block_means[10.0], strict=True):
        if np.any(without):
            assert not np.array_equal(without, by_chance)
            assert np.abs(z_scores(without, by_chance)).max() < 4.5


def test_thresholds_follow_each_groups_light_and_metropolis_has_none() -> None:
    scene, camera = scene_and_camera(lambda: rooms.window_room(0.7, lumen=800))
    _emitters, weights = scene.emitters(camera, FIELDS, 1)
    result = scene.render(camera, "-", FIELDS, 1)
    for threshold, group in zip(weights.shadow_thresholds, Group, strict=True):
        level = float((result.group(group) @ np.array([0.2126, 0.7152, 0.0722])).mean())
        assert 0.1 * level < threshold < 2 * level
    chains = FIELDS.model_copy(update={"integrator": "metropolis"})
    assert scene.emitters(camera, chains, 1)[1].shadow_thresholds == (0.0, 0.0)


def test_a_group_without_light_has_no_threshold() -> None:
    scene, camera = scene_and_camera(rooms.window_room)
    assert scene.emitters(camera, FIELDS, 1)[1].shadow_thresholds[1] == 0.0
