"""Light uses the same lens as labels, black where a pixel has no ray; blur moves only light."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from pbrs_farm.core.camera import Camera, CameraBlur
from pbrs_farm.core.house import geometry_from_house
from pbrs_farm.core.optics_fields import LensFields
from pbrs_farm.core.recipe import LightFields, recipe_from_name
from pbrs_farm.raycast.caster import Caster
from pbrs_farm.raycast.variant import choose_variant
from pbrs_farm.transport.light_result import LightResult
from pbrs_farm.transport.light_scene import LightScene
from pbrs_farm.transport.scene_tables.sky import dark_sky, uniform_sky
from pbrs_farm.transport.validation import known_rooms as rooms
from pbrs_farm.transport.validation.known_rooms import furnace

pytestmark = pytest.mark.skipif(
    choose_variant().startswith("scalar"), reason="the kernels need LLVM or CUDA"
)

RECIPE = recipe_from_name("fast")
FIELDS: LightFields = RECIPE.light.model_copy(update={"filter": "box", "pilot_spp": 0, "spp": 4})
HOUSE, PLAIN = furnace(0.5)
SIZES = {"kinect": (64, 48), "tum_vi": (48, 48), "equirect": (64, 32), "cubemap": (96, 16)}


def camera_of(name: str) -> Camera:
    fields = LensFields(**({"preset": name} if name in ("kinect", "tum_vi") else {"model": name}))  # type: ignore[arg-type]
    camera = Camera(fields.intrinsics(PLAIN.intrinsics), PLAIN.world_from_camera)
    return camera.with_size(*SIZES[name])


def rendered(camera: Camera, fields: LightFields = FIELDS) -> LightResult:
    return LightScene.load(HOUSE, {}, RECIPE, dark_sky()).render(camera, "0_0", fields, 1)


@pytest.mark.parametrize("name", SIZES)
def test_light_and_labels_see_the_same_surface_through_a_lens(name: str) -> None:
    camera = camera_of(name)
    result = rendered(camera)
    hit = Caster(geometry_from_house(HOUSE)).hit_record(camera)
    # Where the walls of a closed room meet, a pixel's mean normal is between theirs.
    agree = np.einsum("...i,...i->...", result.normal, hit.geo_normal_world) > 0.999
    assert agree[hit.valid].mean() > 0.85
    blind = camera.blind
    assert (blind is not None) == (name == "tum_vi")
    if blind is not None:
        assert not hit.valid[blind].any()
        assert not result.indoor[blind].any()
        assert not result.albedo[blind].any()
        assert result.indoor[~blind].any(-1).all()


@pytest.mark.long
def test_metropolis_goes_through_the_lens_too() -> None:
    camera = camera_of("equirect").with_size(32, 16)
    path = rendered(camera, FIELDS.model_copy(update={"spp": 64}))
    update = {"integrator": "metropolis", "direct_spp": 16, "mutations_per_pixel": 64}
    mlt = rendered(camera, FIELDS.model_copy(update=update))
    assert mlt.indoor.mean() == pytest.approx(path.indoor.mean(), rel=0.03)


def test_one_kernel_traces_every_lens() -> None:
    import drjit as dr

    scene = LightScene.load(HOUSE, {}, RECIPE, dark_sky())
    scene.render(camera_of("kinect"), "0_0", FIELDS, 1)  # the first render builds the emitters
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


def edge_spread(blur: CameraBlur | None) -> float:
    """Standard deviation in px of the edge between a black and a white wall 2 m from the camera."""
    wall = [
        rooms.quad([(x, -9, 0), (x + 9, -9, 0), (x + 9, 9, 0), (x, 9, 0)], k)
        for k, x in enumerate((-9, 0))
    ]
    house = rooms.house(wall, [rooms.matte("black", 0.0), rooms.matte("white", 0.8)])
    camera = replace(rooms.camera((0, 0, 2), (0, 0, 0), 96, 16, 0.6), blur=blur)
    scene = LightScene.load(house, {}, RECIPE, uniform_sky(1.0))
    fields = FIELDS.model_copy(update={"spp": 256})
    albedo = scene.render(camera, "0_0", fields, 1).albedo[..., 0].mean(0)
    # The slope of the profile has the shape of the spread.
    slope, place = np.abs(np.diff(albedo)), np.arange(95)
    slope[slope < 0.02 * slope.max()] = 0
    middle = (slope * place).sum() / slope.sum()
    return float(np.sqrt((slope * (place - middle) ** 2).sum() / slope.sum()))


FOCAL_PX = 48 / math.tan(0.3)


def test_unfocused_points_spread_by_the_circle_of_confusion() -> None:
    sharp = edge_spread(CameraBlur(aperture_radius_m=0.03, focus_m=2.0))
    assert sharp < 0.6
    blurred = edge_spread(CameraBlur(aperture_radius_m=0.03, focus_m=1.0))
    # The standard deviation of a disk's projection is a quarter of its diameter.
    diameter = FOCAL_PX * 0.06 * abs(1 / 2.0 - 1 / 1.0)
    assert blurred == pytest.approx(diameter / 4, rel=0.12)


def test_a_moving_camera_spreads_an_edge_by_the_way_it_goes() -> None:
    across = edge_spread(CameraBlur(velocity_m=(0.1, 0.0, 0.0)))
    assert across == pytest.approx(FOCAL_PX * 0.1 / 2 / math.sqrt(12), rel=0.12)
    turned = edge_spread(CameraBlur(turn_rad=(0.0, 0.06, 0.0)))
    assert turned == pytest.approx(FOCAL_PX * 0.06 / math.sqrt(12), rel=0.12)
    assert edge_spread(CameraBlur(velocity_m=(0.0, 0.1, 0.0))) < 0.6


def test_a_rolling_shutter_shears_an_upright_edge_and_keeps_it_sharp() -> None:
    wall = [
        rooms.quad([(x, -9, 0), (x + 9, -9, 0), (x + 9, 9, 0), (x, 9, 0)], k)
        for k, x in enumerate((-9, 0))
    ]
    house = rooms.house(wall, [rooms.matte("black", 0.0), rooms.matte("white", 0.8)])
    # The camera moves 0.1 m to the right between the exposures of the first and last rows.
    blur = CameraBlur(velocity_m=(0.1, 0.0, 0.0), open_share=0.0, rolling_share=1.0)
    camera = replace(rooms.camera((0, 0, 2), (0, 0, 0), 96, 64, 0.6), blur=blur)
    scene = LightScene.load(house, {}, RECIPE, uniform_sky(1.0))
    fields = FIELDS.model_copy(update={"spp": 64})
    albedo = scene.render(camera, "0_0", fields, 1).albedo[..., 0]
    # White is right of the edge: the edge's column is the number of black pixels in a row.
    edge = 96 - albedo.sum(1) / albedo.max()
    row = np.arange(64) + 0.5
    expected = 48 - FOCAL_PX * 0.1 / 2 * (row / 64 - 0.5)
    assert np.abs(edge - expected).max() < 0.15
    # Only the edge's pixel is between black and white.
    between = (albedo > 0.05 * albedo.max()) & (albedo < 0.95 * albedo.max())
    assert between.sum(1).max() <= 2
