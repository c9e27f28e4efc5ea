"""Light goes through the same lens as labels, black where a pixel has no ray; blur moves light alone."""

from __future__ import annotations

import numpy as np
import pytest

from pbrs_farm.core.camera import Camera
from pbrs_farm.core.house import geometry_from_house
from pbrs_farm.core.picture_fields.lens_fields import LensFields
from pbrs_farm.core.recipe import LightFields, recipe_from_name
from pbrs_farm.raycast.caster import Caster
from pbrs_farm.raycast.variant import choose_variant
from pbrs_farm.transport.light_result import LightResult
from pbrs_farm.transport.light_scene import LightScene
from pbrs_farm.transport.scene_tables.sky import dark_sky
from pbrs_farm.transport.validation.known_rooms import furnace

pytestmark = pytest.mark.skipif(
    choose_variant().startswith("scalar"), reason="the kernels need LLVM or CUDA"
)

RECIPE = recipe_from_name("fast")
FIELDS: LightFields = RECIPE.light.model_copy(update={"filter": "box", "pilot_spp": 0, "spp": 4})
HOUSE, PLAIN = furnace(0.5)
SIZES = {"kinect1": (64, 48), "tum_vi": (48, 48), "equirect": (64, 32), "cubemap": (96, 16)}


def camera_of(name: str) -> Camera:
    fields = LensFields(**({"preset": name} if name in ("kinect1", "tum_vi") else {"model": name}))  # type: ignore[arg-type]
    camera = Camera(fields.intrinsics(PLAIN.intrinsics), PLAIN.world_from_camera)
    return camera.with_size(*SIZES[name])


def rendered(camera: Camera, fields: LightFields = FIELDS) -> LightResult:
    return LightScene.load(HOUSE, {}, RECIPE, dark_sky()).render(camera, "0_0", fields, 1)


@pytest.mark.parametrize("name", SIZES)
def test_light_and_labels_see_the_same_surface_through_a_lens(name: str) -> None:
    camera = camera_of(name)
    result = rendered(camera)
    hit = Caster(geometry_from_house(HOUSE)).hit_record(camera)
    # Where the walls of a closed room meet, a pixel's mean normal lies between theirs.
    agree = np.einsum("...i,...i->...", result.normal, hit.geo_normal_world) > 0.999
    assert agree[hit.valid].mean() > 0.85
    blind = camera.blind
    assert (blind is not None) == (name == "tum_vi")
    if blind is not None:
        assert not hit.valid[blind].any()
        assert not result.indoor[blind].any()
        assert not result.albedo[blind].any()
        assert result.indoor[~blind].any(-1).all()


def test_metropolis_goes_through_the_lens_too() -> None:
    camera = camera_of("equirect").with_size(32, 16)
    path = rendered(camera, FIELDS.model_copy(update={"spp": 64}))
    update = {"integrator": "metropolis", "direct_spp": 16, "mutations_per_pixel": 64}
    mlt = rendered(camera, FIELDS.model_copy(update=update))
    assert mlt.indoor.mean() == pytest.approx(path.indoor.mean(), rel=0.03)


def test_one_kernel_traces_every_lens() -> None:
    import drjit as dr

    scene = LightScene.load(HOUSE, {}, RECIPE, dark_sky())
    scene.render(camera_of("kinect1"), "0_0", FIELDS, 1)  # the first one builds the emitters
    traced = []
    for name in SIZES:
        dr.kernel_history_clear()
        with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
            scene.render(camera_of(name), "0_0", FIELDS, 1)
            kernels = dr.kernel_history([dr.KernelType.JIT])
        # The other kernels are copies of a few operations.
        traced.append({k["hash"] for k in kernels if k["operation_count"] > 1000})
    assert len(traced[0]) == 1
    assert all(kernels == traced[0] for kernels in traced)
