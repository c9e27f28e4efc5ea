"""Metropolis against closed forms and against path tracing."""

from __future__ import annotations

import numpy as np
import pytest

from pbrs_farm.core.errors import RenderFailed
from pbrs_farm.core.frames import LUMINANCE
from pbrs_farm.core.lighting import Group
from pbrs_farm.raycast.variant import choose_variant
from pbrs_farm.transport.light_scene import LightScene
from pbrs_farm.transport.scene_tables.sky import dark_sky, sunsky, uniform_sky
from pbrs_farm.transport.validation import known_rooms as rooms
from pbrs_farm.transport.validation.claims import blocks, z_scores
from pbrs_farm.transport.validation.known_rooms import furnace
from tests.inputs.rendered_rooms import FIELDS, METROPOLIS, RECIPE, rendered
from tests.transport import hard_rooms

pytestmark = pytest.mark.skipif(
    choose_variant().startswith("scalar"), reason="the kernels need LLVM or CUDA"
)


@pytest.mark.quick(1)
@pytest.mark.parametrize("albedo", [0.3, 0.8])
def test_a_furnace_room_has_the_radiance_of_the_geometric_series(albedo: float) -> None:
    house, camera = furnace(albedo)
    scene = LightScene.load(house, {}, RECIPE, dark_sky())
    means = [
        float((scene.render(camera, "0_0", METROPOLIS, seed).indoor @ LUMINANCE).mean())
        for seed in range(6)
    ]
    expected = sum(albedo**k for k in range(METROPOLIS.max_depth))
    error = max(float(np.std(means, ddof=1)) / np.sqrt(6), 1e-3 * expected)
    assert abs(np.mean(means) - expected) < 4 * error
    assert np.mean(means) == pytest.approx(expected, rel=0.01)


SCENES = {
    "window": lambda: (*rooms.window_room(0.7, lumen=800), sunsky(RECIPE, elevation_rad=0.6, azimuth_rad=0.35)),
    "door ajar": lambda: (*hard_rooms.door_ajar(), dark_sky()),
    "glass globe": lambda: (*hard_rooms.glass_globe(), dark_sky()),
    "open shade": lambda: (*hard_rooms.open_shade(), uniform_sky((1, 1, 1))),
}  # fmt: skip

SLOW = ("window", "glass globe", "open shade")


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=pytest.mark.slow) if n in SLOW else n for n in SCENES]
)
def test_metropolis_and_path_have_the_same_mean(name: str) -> None:
    # Significance: 16 blocks of each group, |z| < 5: missed by chance once in 50,000 runs.
    house, camera, sky = SCENES[name]()
    scene = LightScene.load(house, {}, RECIPE, sky)
    camera = camera.with_size(32, 24)
    plain = FIELDS.model_copy(update={"spp": 256, "pilot_spp": 4})
    paths = [scene.render(camera, "0_0", plain, 10 + k) for k in range(4)]
    chains = [scene.render(camera, "0_0", METROPOLIS, 50 + k) for k in range(4)]
    for group in Group:
        ours = [blocks(r.group(group)) for r in chains]
        theirs = [blocks(r.group(group)) for r in paths]
        if np.mean(theirs) == 0:
            assert np.mean(ours) == 0
            continue
        lit = np.mean(theirs, 0) > 0
        z = z_scores([x[lit] for x in ours], [x[lit] for x in theirs])
        assert np.abs(z).max() < 5
        assert np.mean(ours) == pytest.approx(np.mean(theirs), rel=0.1)


def test_a_scene_without_light_is_an_error_that_lists_its_emitters() -> None:
    house = rooms.house(rooms.shell((4, 2.5, 4), 0), [rooms.matte("wall", 0.9)])
    camera = rooms.camera((0.5, 1.5, 0.5), (3.9, 0.2, 3.9))
    with pytest.raises(RenderFailed, match="a sky and 0 lamps in the house"):
        rendered(house, camera, uniform_sky((1, 1, 1)), **METROPOLIS.model_dump())


def test_a_time_budget_ends_the_mutations() -> None:
    house, camera = rooms.window_room(lumen=800)
    fields = {**METROPOLIS.model_dump(), "time_budget_s": 0.2, "mutations_per_pixel": 100_000}
    result = rendered(house, camera, dark_sky(), **fields)
    budget = 100_000 * 32 * 24
    assert 0 < result.facts["indoor"]["mutations"] < budget
    assert result.indoor.mean() > 0


def test_direct_samples_and_mutations_never_pose_as_samples_of_path() -> None:
    house, camera = rooms.window_room(lumen=800)
    fields = {**METROPOLIS.model_dump(), "direct_spp": 3, "mutations_per_pixel": 8}
    result = rendered(house, camera, dark_sky(), **fields)
    assert result.spp == 0
    assert "spp" not in result.facts
    assert result.facts["direct_spp"] == 3
    assert result.facts["indoor"]["mutations"] > 0


@pytest.mark.parametrize(("tail_pixels", "min_segments"), [(0, 3), (256, 1)])
def test_chains_that_share_nothing_splat_every_step(tail_pixels: int, min_segments: int) -> None:
    from pbrs_farm.transport.metropolis.integrator import chain_run
    from pbrs_farm.transport.sample_passes import SampledView

    house, camera = rooms.window_room(0.7, lumen=800)
    camera = camera.with_size(32, 24)
    scene = LightScene.load(house, {}, RECIPE, dark_sky())
    fields = METROPOLIS.model_copy(update={"tail_pixels": tail_pixels})
    emitters, _weights = scene.emitters(camera, fields, 1)
    view = SampledView(scene.device_scene, emitters, camera, fields, 1)
    run = chain_run(view, Group.INDOOR, min_segments=min_segments)
    assert run is not None
    run.advance(4)
    # Each step deposits a total target function of 1, at its old and proposed positions.
    state = run.state()
    luminance = state["splats"].reshape(2, -1, 3).sum(0) @ LUMINANCE
    remaining = float((luminance * state["importance"]).sum())
    assert remaining == pytest.approx(4 * run.n_chains, rel=1e-3)


@pytest.mark.long
def test_another_size_of_picture_compiles_nothing() -> None:
    import drjit as dr

    house, camera = rooms.window_room(0.7, lumen=800)
    sky = sunsky(RECIPE, elevation_rad=0.6, azimuth_rad=0.35)
    scene = LightScene.load(house, {}, RECIPE, sky)
    fields = METROPOLIS.model_copy(update={"direct_spp": 1, "mutations_per_pixel": 8})
    scene.render(camera.with_size(32, 24), "0_0", fields, 1)
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        dr.kernel_history_clear()
        for size in ((24, 32), (47, 31), (160, 120)):
            scene.render(camera.with_size(*size), "0_0", fields, 2)
        kernels = [k for k in dr.kernel_history() if k["type"] == dr.KernelType.JIT]
    assert kernels
    assert [k["operation_count"] for k in kernels if not k["cache_hit"]] == []


@pytest.mark.long
def test_the_rounds_of_a_launch_change_no_picture(monkeypatch: pytest.MonkeyPatch) -> None:
    from pbrs_farm.transport.metropolis import metropolis_view

    house, camera = rooms.window_room(0.7, lumen=800)
    scene = LightScene.load(house, {}, RECIPE, dark_sky())
    # 102 steps of each chain are six full rounds and a partial one.
    fields = METROPOLIS.model_copy(update={"chains": 384, "mutations_per_pixel": 51})
    pictures = []
    for n in (1, 4 * 384, 1 << 20):
        monkeypatch.setattr(metropolis_view, "chain_rounds_per_launch", lambda n=n: n)
        pictures.append(scene.render(camera.with_size(32, 24), "0_0", fields, 3).indoor)
    mean = float(pictures[0].mean())
    assert mean > 0
    for picture in pictures[1:]:
        np.testing.assert_allclose(picture, pictures[0], rtol=1e-5, atol=1e-5 * mean)


@pytest.mark.parametrize("n_chains", [192, 1344, 32768])
@pytest.mark.parametrize("n_pixels", [768, 19200, 307200, 2073600])
def test_the_halves_of_the_film_share_no_prefix(n_chains: int, n_pixels: int) -> None:
    from pbrs_farm.transport.metropolis.film import ROUND_STEPS
    from pbrs_farm.transport.metropolis.prefixes import prefix_schedule

    n_sets, order = prefix_schedule(n_chains, n_pixels)
    assert n_sets > 0
    assert n_sets % 2 == 0
    mutations_per_prefix = order * n_chains * ROUND_STEPS / (n_pixels * n_sets)
    assert 2 < mutations_per_prefix < 8


def test_a_launch_has_every_set_of_prefixes_of_its_rounds() -> None:
    from pbrs_farm.transport.metropolis.prefixes import PrefixSchedule

    schedule = PrefixSchedule(n_sets=2, every=5)
    assert schedule.sets_of(range(5)) == range(2)
    assert schedule.sets_of(range(3, 11)) == range(6)
    assert schedule.sets_of(range(5, 6)) == range(2, 4)
