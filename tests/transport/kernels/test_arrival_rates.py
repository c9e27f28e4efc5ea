"""Shadow-ray rates from arrival counts: counting, sharing between voxels, and unbiased pictures."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

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

if choose_variant().startswith("scalar"):
    pytest.skip("the kernels need LLVM or CUDA", allow_module_level=True)

RECIPE = recipe_from_name("fast")
FIELDS: LightFields = RECIPE.light.model_copy(update={"filter": "box", "spp": 64})
SKY = sunsky(RECIPE, elevation_rad=0.6, azimuth_rad=0.35)


def three_lamps() -> tuple[House, Camera]:
    """A room with an open side and two bulbs, and a third bulb hidden in a closed box."""
    surfaces = rooms.shell((4.0, 2.5, 4.0), 0, front=False)
    surfaces.append(rooms.box((2.9, 0.0, 2.9), (3.7, 0.8, 3.7), 0))
    lamps = [
        rooms.bulb((1.0, 2.0, 1.0), 1, 900.0),
        rooms.bulb((3.0, 2.0, 1.5), 1, 500.0),
        rooms.bulb((3.3, 0.4, 3.3), 1, 700.0),
    ]
    house = rooms.house(surfaces, [rooms.matte("wall", 0.7), rooms.BULB], lamps=lamps)
    return house, rooms.camera((2, 1.5, 0.3), (2, 0.5, 3)).with_size(32, 24)


@pytest.fixture
def trial_scene(monkeypatch: pytest.MonkeyPatch) -> tuple[LightScene, Camera]:
    """The room, with trials enabled for small views."""
    from pbrs_farm.transport import pilot

    monkeypatch.setattr(pilot, "MIN_SAMPLES", 0)
    house, camera = three_lamps()
    return LightScene.load(house, {}, RECIPE, SKY), camera


def traced(scene: LightScene, emitters: Any, camera: Camera, weights: Any, seed: int) -> Any:
    from pbrs_farm.transport.path_tracer import Lanes, trace

    emitters.set_weights(weights)
    lanes = Lanes(32, 24, 0, 64, seed, is_trial=True)
    return trace(scene.device_scene, emitters, camera, lanes, FIELDS)


def plain_half(lanes: Any) -> Any:
    """The unguided picture of the two that a trial sums."""
    return lanes[: 32 * 24].reshape(24, 32, 3)


def test_a_voxels_rate_comes_from_its_rays_else_its_neighbours_or_the_view() -> None:
    from pbrs_farm.transport.kernels.arrival_rates import N_KINDS, arrival_rates
    from pbrs_farm.transport.kernels.voxel_grid import VoxelGrid

    grid = VoxelGrid(np.array([[0.1, 0.1, 0.1], [2.4, 0.1, 0.1]], np.float32))
    assert grid.n_voxels == 5
    counts = np.zeros((2, 5, N_KINDS), np.uint32)
    counts[0, :2, 4] = 1000
    counts[1, 0, 4] = 900
    rates = arrival_rates(counts, grid)
    assert rates[0, 4] == pytest.approx(0.9, abs=0.01)
    assert 0 < rates[1, 4] < 0.05
    assert rates[2, 4] == pytest.approx(0.02, abs=0.01)
    assert rates[3:, 4] == pytest.approx(0.45, abs=0.01)
    assert ((rates > 0) & (rates <= 1)).all()


def test_a_voxel_counts_with_the_26_around_it() -> None:
    from pbrs_farm.transport.kernels.voxel_grid import VoxelGrid

    grid = VoxelGrid(np.array([[0, 0, 0], [1.9, 1.4, 2.4]], np.float32))
    ones = np.ones((grid.n_voxels, 1), np.uint32)
    counted = grid.with_neighbours(ones).reshape(4, 3, 5)
    assert counted[0, 0, 0] == counted[3, 2, 4] == 8
    assert counted[0, 1, 2] == 18
    assert counted[1, 1, 1] == 27
    counts = np.zeros((4, 3, 5, 1), np.uint32)
    counts[3, 1, 2] = 7
    near = grid.with_neighbours(counts.reshape(-1, 1)).reshape(4, 3, 5)
    assert (near[2:, :, 1:4] == 7).all()
    assert near.sum() == 7 * 18


@pytest.mark.long
def test_a_trial_finds_that_no_ray_to_a_hidden_lamp_arrives(
    trial_scene: tuple[LightScene, Camera],
) -> None:
    from pbrs_farm.transport.kernels.arrival_rates import FIRST_LAMP, FIRST_SUNLIT

    scene, camera = trial_scene
    emitters, weights = scene.emitters(camera, FIELDS, 1)
    counts = traced(scene, emitters, camera, replace(weights, arrival_rates=None), 2).arrivals
    cast, arrived = counts.sum(1)
    slot = np.argsort(-weights.lamps, kind="stable")
    hidden = FIRST_LAMP + int(np.flatnonzero(slot == 2)[0])
    hidden_lamp = FIRST_LAMP + int(np.flatnonzero(slot == 0)[0])
    assert cast[hidden] > 100
    assert arrived[hidden] < 0.02 * cast[hidden]
    assert (
        arrived[hidden_lamp] > 0.95 * cast[hidden_lamp]
    )  # no ray is cast to the far half of the lamp
    # Absent from the room: an outdoor technique or a lamp beyond the third.
    assert not cast[FIRST_LAMP + 3 : FIRST_SUNLIT].any()
    assert (arrived <= cast).all()


def test_rates_let_more_of_fewer_shadow_rays_arrive(trial_scene: tuple[LightScene, Camera]) -> None:
    scene, camera = trial_scene
    emitters, weights = scene.emitters(camera, FIELDS, 1)
    assert weights.arrival_rates is not None
    (cast, arrived), (cast_all, arrived_all) = (
        traced(scene, emitters, camera, w, 2).arrivals.sum((1, 2), dtype=np.int64)
        for w in (weights, replace(weights, arrival_rates=None))
    )
    assert cast < 0.9 * cast_all
    assert arrived / cast > 1.1 * arrived_all / cast_all


@pytest.mark.long
@pytest.mark.parametrize("are_random", [False, True])
def test_rates_keep_the_mean(trial_scene: tuple[LightScene, Camera], are_random: bool) -> None:
    # Significance: 16 blocks of two groups, |z| < 4.5 each is missed by chance once in 4500 runs.
    # Random rates are wrong everywhere: probabilities and pdfs must agree for any rates.
    scene, camera = trial_scene
    emitters, weights = scene.emitters(camera, FIELDS, 1)
    rates = weights.arrival_rates
    assert rates is not None
    if are_random:
        rates = np.random.default_rng(5).uniform(0.02, 1, rates.shape)
    measured: list[list[list[Any]]] = []
    for by_place, first_seed in ((rates, 10), (None, 20)):
        random_rates = replace(weights, arrival_rates=by_place)
        sums = [
            traced(scene, emitters, camera, random_rates, seed)
            for seed in range(first_seed, first_seed + 8)
        ]
        pairs = [[s.outdoor for s in sums], [s.indoor for s in sums]]
        measured.append([[blocks(plain_half(x)) for x in pictures] for pictures in pairs])
    for with_rates, without in zip(*measured, strict=True):
        assert np.abs(z_scores(with_rates, without)).max() < 4.5


def test_a_tried_view_has_the_same_bits_again(trial_scene: tuple[LightScene, Camera]) -> None:
    scene, camera = trial_scene
    fields = FIELDS.model_copy(update={"spp": 8})
    first, again = (
        LightScene.load(three_lamps()[0], {}, RECIPE, SKY).render(camera, "-", fields, 3)
        for _ in range(2)
    )
    for group in Group:
        np.testing.assert_array_equal(first.group(group), again.group(group))
    assert scene.emitters(camera, fields, 3)[1].arrival_rates is not None


def test_metropolis_has_no_rates(trial_scene: tuple[LightScene, Camera]) -> None:
    scene, camera = trial_scene
    chains = FIELDS.model_copy(update={"integrator": "metropolis"})
    assert scene.emitters(camera, chains, 1)[1].arrival_rates is None
