"""Equal light, labels and pictures on a GPU and a CPU; `scripts/gpu_check.sh` runs those marked gpu."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

from pbrs_farm.core.house import geometry_from_house
from pbrs_farm.raycast.variant import choose_variant
from pbrs_farm.read.builtin.builtin_home import builtin_home
from pbrs_farm.transport.light_scene import LightScene
from pbrs_farm.transport.scene_tables.sky import dark_sky
from tests.transport import hard_rooms
from tests.transport.recorded_blocks import FIELDS, N_RUNS, RECIPE, ROOMS, largest_z, measured

needs_kernels = pytest.mark.skipif(
    choose_variant().startswith("scalar"), reason="the kernels need LLVM or CUDA"
)
OTHER_SEEDS = range(100, 100 + N_RUNS)
MAX_LAUNCHES = 200
DENOISER = find_spec("pyoidn") is not None


@pytest.mark.long
@needs_kernels
def test_one_scene_for_all_rays_gives_the_same_picture() -> None:
    # A requirement of GPUs (OptiX traces one scene per kernel), tested on the CPU.
    from pbrs_farm.transport.kernels.device_scene import DeviceScene

    house, camera = hard_rooms.covered_cup()
    pictures = []
    for one_scene in (False, True):
        scene = LightScene.load(house, {}, RECIPE, dark_sky())
        scene.device_scene = DeviceScene(scene.tables, one_scene=one_scene)
        fields = FIELDS.model_copy(update={"spp": 16})
        pictures.append(scene.render(camera.with_size(32, 24), "0_0", fields, 1).indoor)
    # A shadow ray through glass restarts slightly displaced: a few samples may differ.
    two, single = pictures
    assert float(two.mean()) > 0
    assert float(single.mean()) == pytest.approx(float(two.mean()), rel=1e-3)
    assert np.isclose(single, two, rtol=1e-4, atol=1e-7).all(-1).mean() > 0.97


@needs_kernels
def test_a_view_is_a_bounded_number_of_launches() -> None:
    import drjit as dr

    house, camera = hard_rooms.glass_globe()
    scene = LightScene.load(house, {}, RECIPE, dark_sky())
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        dr.kernel_history_clear()
        scene.render(camera.with_size(32, 24), "0_0", FIELDS.model_copy(update={"spp": 4}), 1)
        kernels = [k for k in dr.kernel_history() if k["type"] == dr.KernelType.JIT]
    assert 0 < len(kernels) <= MAX_LAUNCHES


@needs_kernels
def test_light_is_as_it_was_recorded() -> None:
    # 16 blocks of each group, |z| < 5.
    assert largest_z("cup", measured("cup", OTHER_SEEDS)) < 5


@pytest.mark.gpu
def test_the_gpu_is_used() -> None:
    assert choose_variant() == "cuda_ad_rgb"


@pytest.mark.gpu
@pytest.mark.parametrize("room", list(ROOMS))
def test_path_on_the_gpu_has_the_light_of_the_cpu(room: str) -> None:
    assert largest_z(room, measured(room, OTHER_SEEDS, variant="cuda_ad_rgb")) < 5


@pytest.mark.gpu
@pytest.mark.parametrize("room", ["window", "cup"])
def test_metropolis_on_the_gpu_has_the_light_of_the_cpu(room: str) -> None:
    changes = {"integrator": "metropolis", "direct_spp": 64, "mutations_per_pixel": 256}
    fields = FIELDS.model_copy(update=changes | {"chains": 4096})
    assert largest_z(room, measured(room, OTHER_SEEDS, fields, variant="cuda_ad_rgb")) < 5


@pytest.mark.gpu
def test_metropolis_on_the_gpu_makes_few_launches_and_compiles_nothing_for_another_size() -> None:
    import drjit as dr

    house, camera = hard_rooms.covered_cup()
    scene = LightScene.load(house, {}, RECIPE, dark_sky(), variant="cuda_ad_rgb")
    changes = {"integrator": "metropolis", "direct_spp": 64, "mutations_per_pixel": 256}
    fields = FIELDS.model_copy(update=changes)
    scene.render(camera.with_size(32, 24), "0_0", fields, 1)
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        dr.kernel_history_clear()
        scene.render(camera.with_size(160, 120), "0_0", fields, 1)
        kernels = [k for k in dr.kernel_history() if k["type"] == dr.KernelType.JIT]
    assert 0 < len(kernels) <= MAX_LAUNCHES
    assert all(k["cache_hit"] for k in kernels)


@pytest.mark.gpu
def test_opengl_through_egl_agrees_with_rays_on_the_gpu() -> None:
    from pbrs_farm.core.camera import Camera, Intrinsics
    from pbrs_farm.raster import Rasterizer
    from pbrs_farm.raycast.caster import Caster
    from tests.inputs.drawn_items import items_drawn

    house = builtin_home()
    stored = house.cameras[0]
    camera = Camera.look(Intrinsics.from_hfov(320, 240), stored.eye, stored.towards)
    with Rasterizer(house, {}) as raster:
        assert "NVIDIA" in raster.name
    hit_items = Caster(geometry_from_house(house), variant="scalar_rgb").hit_record(camera).item
    assert (items_drawn(house, camera) == hit_items)[hit_items > 0].mean() > 0.98


@pytest.mark.gpu
def test_labels_of_the_gpu_differ_from_those_of_the_cpu_only_at_edges() -> None:
    from pbrs_farm.core.camera import Camera, Intrinsics
    from pbrs_farm.raycast.caster import Caster

    house = builtin_home()
    stored = house.cameras[0]
    camera = Camera.look(
        Intrinsics.from_hfov(640, 480, stored.hfov_rad), stored.eye, stored.towards
    )
    geometry = geometry_from_house(house)
    ours, theirs = (
        Caster(geometry, variant=v).hit_record(camera) for v in ("cuda_ad_rgb", "scalar_rgb")
    )
    differs = ours.item != theirs.item
    assert differs.mean() < 1e-4, f"{differs.sum()} of {differs.size} pixels"
    same = ~differs & theirs.valid
    np.testing.assert_allclose(ours.depth_z[same], theirs.depth_z[same], rtol=1e-3)


@pytest.mark.gpu
def test_a_preview_of_a_home_is_whole(tmp_path: Path) -> None:
    from pbrs_farm.check import verify
    from pbrs_farm.core.recipe import recipe_from_name
    from pbrs_farm.run.local import run_local
    from pbrs_farm.run.local_run import Run
    from pbrs_farm.run.plan import wanted

    # Without the denoiser if scripts/gpu_check.sh has no archive of it.
    recipe = recipe_from_name("preview", {"light.denoise": str(DENOISER).lower()})
    summary = run_local(Run(["builtin"], str(tmp_path), recipe, wanted([], [], 2)))
    assert summary.failures == []
    certificate = verify(tmp_path, sample=500)
    assert certificate.is_clean, certificate.text()
