"""Light by lamp: one trace, layers that sum to indoor, everything else unchanged."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from pbrs_farm.core.camera import Camera
from pbrs_farm.core.errors import BadRecipe, MachineFailed, RenderFailed
from pbrs_farm.core.house import House
from pbrs_farm.core.recipe import RECIPE_NAMES, LightFields, recipe_from_name
from pbrs_farm.raycast.variant import choose_variant
from pbrs_farm.transport import light_scene as scene_module
from pbrs_farm.transport.lamp_layers import indoor_from_lamps, lamp_shares, lamp_table, relit_indoor
from pbrs_farm.transport.light_result import LightResult
from pbrs_farm.transport.light_scene import LightScene
from pbrs_farm.transport.scene_tables.sky import uniform_sky
from pbrs_farm.transport.validation import known_rooms as rooms
from pbrs_farm.transport.validation.claims import blocks, z_scores

needs_kernels = pytest.mark.skipif(
    choose_variant().startswith("scalar"), reason="the kernels need LLVM or CUDA"
)

RECIPE = recipe_from_name("fast")
TWO: LightFields = RECIPE.light.model_copy(update={"spp": 16})
LAMPS: LightFields = TWO.model_copy(update={"groups": "lamps"})


def three_lamps(lumen: tuple[float, float] = (800.0, 300.0)) -> tuple[House, Camera]:
    """The room with a window, a ceiling lamp, a table lamp, and a lamp behind the back wall."""
    house, camera = rooms.window_room()
    table = replace(rooms.bulb((2.0, 0.9, 2.5), 1, lumen[1]), id="table_lamp")
    lamps = [rooms.bulb((2.0, 2.2, 2.0), 1, lumen[0]), rooms.bulb((1.0, 1.0, 9.0), 1, 800.0), table]
    return house.with_items([*house.items, *lamps]), camera


def rendered(
    fields: LightFields, room: tuple[House, Camera] | None = None, *, seed: int = 1
) -> LightResult:
    house, camera = room or three_lamps()
    scene = LightScene.load(house, {}, RECIPE, uniform_sky((1, 1, 1)))
    return scene.render(camera, "0_0", fields, seed)


@needs_kernels
def test_the_lamps_sum_to_indoor_exactly_and_a_hidden_lamp_has_no_layer() -> None:
    result = rendered(LAMPS)
    assert sorted(result.lamps) == [1, 3]
    np.testing.assert_array_equal(result.indoor, result.lamps[1] + result.lamps[3])
    rows = result.facts["lamps"]
    assert [row["number"] for row in rows] == [1, 2, 3]
    assert [row["layer"] for row in rows] == ["lamp1", None, "lamp3"]
    assert [row["lm"] for row in rows] == pytest.approx([800, 800, 300])
    assert rows[2]["item"] == "table_lamp"
    assert rows[2]["instance"] == 4
    assert rows[1]["share"] == 0
    assert rows[0]["share"] + rows[2]["share"] == pytest.approx(1, abs=1e-5)
    assert rows[0]["share"] > rows[2]["share"] > 0


@needs_kernels
@pytest.mark.parametrize("noise", [0.0, 1e-6])
def test_layers_of_lamps_change_nothing_but_the_rounding_of_indoor(noise: float) -> None:
    # One pass of 16 samples, and four passes for a noise level that is never reached.
    goal = {"noise": noise, "max_spp": 64}
    two, lamps = (rendered(f.model_copy(update=goal)) for f in (TWO, LAMPS))
    assert two.lamps == {}
    assert "lamps" not in two.facts
    assert two.spp == lamps.spp == (64 if noise else 16)
    for name in ("outdoor", "albedo", "normal"):
        np.testing.assert_array_equal(getattr(two, name), getattr(lamps, name))
    np.testing.assert_allclose(two.indoor, lamps.indoor, rtol=1e-5, atol=1e-9)
    assert (two.noise, two.n_nonfinite) == (lamps.noise, 0)


@needs_kernels
def test_a_lamps_layer_is_the_room_with_the_other_lamps_out_to_the_bit() -> None:
    # Without the pilot the same random numbers choose the same lamps in both rooms.
    fields = LAMPS.model_copy(update={"pilot_spp": 0})
    all_lamps = rendered(fields)
    for number, lumen in ((1, (800.0, 0.0)), (3, (0.0, 300.0))):
        alone = rendered(fields, three_lamps(lumen))
        assert sorted(alone.lamps) == [number]
        np.testing.assert_array_equal(alone.indoor, all_lamps.lamps[number])
        plain = rendered(fields.model_copy(update={"groups": "two"}), three_lamps(lumen))
        np.testing.assert_allclose(plain.indoor, all_lamps.lamps[number], rtol=1e-5, atol=1e-9)


@pytest.mark.long
@needs_kernels
def test_the_pilot_moves_samples_between_lamps_and_no_light() -> None:
    # Significance: 16 blocks, |z| < 4.5 each is missed by chance once in 9000 runs.
    fields = LAMPS.model_copy(update={"spp": 64})
    for number, lumen in ((1, (800.0, 0.0)), (3, (0.0, 300.0))):
        layers = [rendered(fields, seed=k).lamps[number] for k in range(4)]
        alone = [rendered(fields, three_lamps(lumen), seed=50 + k).indoor for k in range(4)]
        assert np.abs(z_scores([blocks(b) for b in layers], [blocks(a) for a in alone])).max() < 4.5
        assert np.mean(layers) == pytest.approx(np.mean(alone), rel=0.05)


@needs_kernels
def test_nonfinite_light_is_counted_and_kept_out_of_layers() -> None:
    result = rendered(LAMPS, three_lamps((math.inf, 300.0)))
    assert result.n_nonfinite > 0
    assert sorted(result.lamps) == [3]
    assert np.isfinite(result.lamps[3]).all()
    np.testing.assert_array_equal(result.indoor, result.lamps[3])


@needs_kernels
def test_a_house_without_lamps_lists_none() -> None:
    result = rendered(LAMPS, rooms.window_room())
    assert (result.lamps, result.facts["lamps"]) == ({}, [])
    assert not result.indoor.any()


@needs_kernels
def test_the_same_seed_gives_the_same_layers_and_another_house_compiles_nothing() -> None:
    import drjit as dr

    first = rendered(LAMPS)
    more, camera = three_lamps()
    more = more.with_items([*more.items, rooms.bulb((3.0, 1.0, 3.0), 1, 100.0)])
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        dr.kernel_history_clear()
        again = rendered(LAMPS)
        second = rendered(LAMPS, (more, camera))
        kernels = [k for k in dr.kernel_history() if k["type"] == dr.KernelType.JIT]
    tracing = [k for k in kernels if k["operation_count"] > 1000]
    for number, layer in first.lamps.items():
        np.testing.assert_array_equal(layer, again.lamps[number])
    assert sorted(second.lamps) == [1, 3, 4]
    # Kernels for the insides of lamps, the pilot and the picture, twice; copies of arrays may
    # differ with the alignment of memory.
    assert len(tracing) == 6
    assert all(k["cache_hit"] for k in tracing)


@needs_kernels
def test_more_sums_than_the_kernel_can_count_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(scene_module, "MAX_SUMS", 32 * 24 * 3 * 3)
    with pytest.raises(RenderFailed, match=r"too many for 3 lamps each.*--groups two"):
        rendered(LAMPS)


def test_light_by_lamp_is_refused_for_a_scalar_variant_with_the_reason(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    house, camera = three_lamps()
    scene = LightScene.load(house, {}, RECIPE, uniform_sky((1, 1, 1)))
    monkeypatch.setattr(scene, "variant", "scalar_rgb")
    with pytest.raises(MachineFailed, match="needs LLVM or CUDA, this is scalar_rgb"):
        scene.render(camera, "0_0", LAMPS, 1)


def test_metropolis_has_no_light_by_lamp_and_says_so() -> None:
    with pytest.raises(BadRecipe, match="groups lamps needs `path`"):
        recipe_from_name("paper", {"light.groups": "lamps"})


@pytest.mark.parametrize("name", RECIPE_NAMES)
def test_groups_of_lamps_are_in_a_digest_of_files_and_in_no_seed(name: str) -> None:
    recipe = recipe_from_name(name)
    if recipe.light.integrator == "path":
        lamps = recipe_from_name(name, {"light.groups": "lamps"})
        assert lamps.digest("light") != recipe.digest("light")
        assert lamps.picture_digest("light") == recipe.picture_digest("light")
        assert lamps.digest("tone") == recipe.digest("tone")


def test_other_strengths_multiply_layers_by_number_and_colour() -> None:
    layers = {2: np.full((2, 3, 3), 0.5, np.float32), 5: np.ones((2, 3, 3), np.float32)}
    factors = {2: np.array([1, 2, 4], np.float32), 7: np.zeros(3, np.float32)}
    lit = indoor_from_lamps(layers, factors, (2, 3, 3))
    np.testing.assert_array_equal(lit, np.broadcast_to([1.5, 2.0, 3.0], (2, 3, 3)))
    assert not indoor_from_lamps({}, factors, (2, 3, 3)).any()
    assert lamp_table((), {}, np.zeros((2, 3, 3), np.float32)) == []


def test_shares_of_denoised_light_sum_to_it_and_scale_as_relit_light_does() -> None:
    rng = np.random.default_rng(5)
    layers = {n: rng.random((4, 6, 3), np.float32) for n in (1, 4, 9)}
    for layer in layers.values():
        layer[0, 0] = 0.0  # a pixel that no lamp lights: shared equally
    indoor = rng.random((4, 6, 3), np.float32)
    factors = {1: np.float32([0.5, 0, 2]), 9: np.float32([3, 3, 3])}
    shares = lamp_shares(indoor, layers)
    np.testing.assert_allclose(sum(shares.values()), indoor, rtol=1e-5)
    summed = indoor_from_lamps(shares, factors, indoor.shape)
    np.testing.assert_allclose(summed, relit_indoor(indoor, layers, factors), rtol=1e-5)
    np.testing.assert_array_equal(relit_indoor(indoor, layers, {}), indoor)
