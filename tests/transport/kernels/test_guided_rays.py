"""Guided rays keep the mean, reduce the noise, and aim at surfaces lit by a lamp."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pbrs_farm.core.camera import Camera
from pbrs_farm.core.house import House, Material, MaterialKind
from pbrs_farm.core.recipe import LightFields, Recipe, recipe_from_name
from pbrs_farm.raycast.variant import choose_variant
from pbrs_farm.transport.kernels import guided_rays as guide
from pbrs_farm.transport.kernels.guiding_targets import BACK_SIDE, GuidingTargets
from pbrs_farm.transport.light_result import LightResult
from pbrs_farm.transport.light_scene import LightScene
from pbrs_farm.transport.scene_tables.sky import dark_sky
from pbrs_farm.transport.validation import known_rooms as rooms
from pbrs_farm.transport.validation.claims import blocks, z_scores
from tests.transport import hard_rooms

pytestmark = pytest.mark.skipif(
    choose_variant().startswith("scalar"), reason="the kernels need LLVM or CUDA"
)

RECIPE: Recipe = recipe_from_name("fast")
FIELDS: LightFields = RECIPE.light.model_copy(update={"filter": "box", "spp": 256})


def loaded(room: tuple[House, Camera]) -> tuple[LightScene, Camera]:
    return LightScene.load(room[0], {}, RECIPE, dark_sky()), room[1].with_size(32, 24)


def unguided(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(guide, "MAX_SHARE", 0.0)
    monkeypatch.setattr(guide, "MIN_SHARE", 0.0)
    monkeypatch.setattr(guide, "MAX_BOOST", 1.0)


@pytest.mark.long
@pytest.mark.parametrize(
    "room", [hard_rooms.open_shade, pytest.param(hard_rooms.covered_cup, marks=pytest.mark.slow)]
)
def test_guided_rays_keep_the_mean_and_reduce_the_noise(
    room: Callable[[], tuple[House, Camera]], monkeypatch: pytest.MonkeyPatch
) -> None:
    # 16 blocks, |z| < 4.5, and the whole picture, with an error of two hundredths, |z| < 3.5.
    scene, camera = loaded(room())

    def rendered() -> list[LightResult]:
        return [scene.render(camera, "0_0", FIELDS, 10 + k) for k in range(8)]

    aided = rendered()
    unguided(monkeypatch)
    plain = rendered()
    means = [[blocks(r.indoor) for r in results] for results in (aided, plain)]
    assert np.abs(z_scores(means[0], means[1])).max() < 4.5
    wholes = np.array([[x.mean() for x in results] for results in means])
    error = np.sqrt((wholes.var(1, ddof=1) / wholes.shape[1]).sum())
    assert error < 0.025 * wholes.mean()
    assert abs(wholes[0].mean() - wholes[1].mean()) < 3.5 * error
    variances = [np.var([r.indoor for r in results], 0).mean() for results in (aided, plain)]
    assert variances[0] < 0.25 * variances[1]


def test_an_unguided_view_equals_one_without_guiding(monkeypatch: pytest.MonkeyPatch) -> None:
    scene, camera = loaded(hard_rooms.open_shade())
    fields = FIELDS.model_copy(update={"spp": 16})
    plain = "pbrs_farm.transport.view_emitters.trial_weights"
    monkeypatch.setattr(plain, lambda *given: replace(given[3], is_guided=False))
    result = scene.render(camera, "0_0", fields, 1)
    assert result.facts["guided"] is False
    unguided(monkeypatch)
    np.testing.assert_allclose(
        result.indoor, scene.render(camera, "0_0", fields, 1).indoor, rtol=1e-4
    )


@pytest.mark.quick(1)
@pytest.mark.parametrize(
    ("room", "pays"), [(hard_rooms.open_shade, True), (lambda: rooms.window_room(lumen=800), False)]
)
def test_rays_are_guided_only_if_a_shade_hides_the_bulb(
    room: Callable[[], tuple[House, Camera]], pays: bool
) -> None:
    scene, camera = loaded(room())
    large = camera.with_size(640, 480)
    for seed in range(4):
        _emitters, weights = scene.emitters(large, FIELDS, seed)
        assert weights.is_guided is pays


def test_a_trial_is_the_plain_and_the_guided_view_in_one_launch() -> None:
    from pbrs_farm.transport.path_tracer import Lanes, trace

    scene, camera = loaded(hard_rooms.open_shade())
    emitters, weights = scene.emitters(camera, FIELDS, 1)

    def lit(*, is_guided: bool, is_trial: bool = False) -> Any:
        emitters.set_weights(replace(weights, is_guided=is_guided))
        lanes = Lanes(32, 24, 0, 16, 3, is_trial=is_trial)
        return trace(scene.device_scene, emitters, camera, lanes, FIELDS).indoor

    plain, guided = np.split(lit(is_guided=True, is_trial=True), 2)
    np.testing.assert_array_equal(plain, lit(is_guided=False))
    np.testing.assert_array_equal(guided, lit(is_guided=True))
    assert (plain != guided).any()


def test_a_small_view_is_guided_without_a_trial() -> None:
    scene, camera = loaded(rooms.window_room(lumen=800))
    _emitters, weights = scene.emitters(camera, FIELDS, 0)
    assert weights.is_guided


@pytest.mark.slow
def test_small_faces_far_from_the_origin_lose_no_light() -> None:
    # In coarse float32 a ray starts a millimetre off its surface: it must still hit the face it was
    # aimed at, or that light is lost (2 % once).
    means = []
    for far_m, n in ((0.0, 32), (40.0, 512)):
        scene, camera = loaded(hard_rooms.open_shade(n=n, east=far_m))
        pictures = [scene.render(camera, "0_0", FIELDS, 10 + k).indoor for k in range(8)]
        means.append([float(p.mean()) for p in pictures])
    wholes = np.array(means)
    error = np.sqrt((wholes.var(1, ddof=1) / 8).sum())
    assert error < 0.006 * wholes.mean()
    assert abs(wholes[0].mean() - wholes[1].mean()) < 3.5 * error


def test_a_direction_drawn_in_a_cone_has_the_pdf_of_the_cone() -> None:
    import drjit as dr
    import mitsuba as mi

    from pbrs_farm.transport.kernels.lamp_guiding import Cones, cone_pdf, sample_cones

    n = 1 << 18
    rng = mi.PCG32(size=n)
    for sin2 in (0.9, 0.01, 8e-5, 1e-5):
        height = mi.Float(sin2 / (1 + np.sqrt(1 - sin2)))
        way = dr.normalize(mi.Vector3f(0.3, -0.5, 0.7))
        cones = Cones([mi.Float(1)], mi.Float(1), [way], [height])
        uv = mi.Point2f(rng.next_float32(), rng.next_float32())
        d = sample_cones(cones, rng.next_float32(), uv)
        pdf = cone_pdf(cones, d).numpy()
        expected = 1 / (2 * np.pi * height.numpy()[0])
        assert pdf == pytest.approx(expected, rel=1e-4)


def targets_of(house: House) -> tuple[LightScene, GuidingTargets]:
    from pbrs_farm.transport.lampshade_exitance import guiding_targets

    scene, camera = loaded((house, rooms.camera((0.5, 1.5, 0.5), (2.0, 1.0, 2.0))))
    emitters, _weights = scene.emitters(camera, FIELDS, 0)
    return scene, guiding_targets(scene.device_scene, emitters, scene.tables, 0)


def test_the_inside_of_an_opaque_shade_is_aimed_at_and_its_outside_is_not() -> None:
    scene, targets = targets_of(hard_rooms.open_shade()[0])
    faces = (targets.sides & np.uint32(BACK_SIDE - 1)).astype(np.int64)
    corners = scene.tables.positions[scene.tables.faces[faces]].astype(np.float64)
    from_axis = corners.mean(1) - np.array([2.0, 0.0, 2.2])
    assert np.hypot(from_axis[:, 0], from_axis[:, 2]).max() < 0.121
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals[targets.sides >= BACK_SIDE] *= -1
    assert ((normals[:, [0, 2]] * from_axis[:, [0, 2]]).sum(1) < 0).all()
    assert targets.probabilities.sum() == pytest.approx(1)
    areas = 0.5 * np.linalg.norm(normals, axis=1)
    assert (targets.pdfs * areas).sum() == pytest.approx(1)
    assert 0 < targets.shares[0] <= 1
    assert 0.12 < targets.interiors[0, 3] < 0.4


def test_a_bare_bulb_in_a_room_has_nothing_to_aim_at() -> None:
    _scene, targets = targets_of(rooms.window_room(lumen=800)[0])
    assert not len(targets.sides)
    assert targets.shares.tolist() == [0]


def test_a_lamp_is_chosen_with_its_stated_probability() -> None:
    import drjit as dr
    import mitsuba as mi

    lamps = [rooms.bulb((1.0 + k, 2.0, 2.0), 1, 800.0) for k in range(3)]
    house, camera = rooms.window_room(lumen=0)
    scene, camera = loaded((house.with_items([*house.items, *lamps]), camera))
    emitters, _weights = scene.emitters(camera, FIELDS, 0)
    n = 1 << 16
    rng = mi.PCG32(size=n)
    p, up = mi.Point3f(1.3, 0.5, 2.0), mi.Vector3f(0, 1, 0)
    counted, on = mi.Int32(-1), mi.Bool(True)
    near = emitters.near_lamps(p, up, counted, on)
    assert near.reference.total.numpy()[0] > 0
    uv = mi.Point2f(rng.next_float32(), rng.next_float32())
    to = emitters.sample_lamp(scene.device_scene, near, rng.next_float32(), uv, counted, on)
    # If all pdfs are right, the mean of 1 / pdf is the solid angle of all lamps, each a disc as
    # wide as its bulb.
    inverse = dr.select(to.valid, dr.rcp(to.pdf), 0).numpy()
    area_over_d2 = sum(
        float(lamp.area_m2) / 4 / ((1 + k - 1.3) ** 2 + 1.5**2)
        for k, lamp in enumerate(scene.tables.lamps)
    )
    assert inverse.mean() == pytest.approx(area_over_d2, rel=0.03)


@pytest.mark.long
def test_each_vertex_and_each_glass_has_separate_random_numbers() -> None:
    import mitsuba as mi

    from pbrs_farm.transport.kernels.camera_rays import device_camera
    from pbrs_farm.transport.kernels.path_state import (
        EmitterFilter,
        PathContext,
        camera_path,
        device_fields,
    )
    from pbrs_farm.transport.kernels.path_step import advance

    glass = Material("glass", kind=MaterialKind.GLASS, opacity=0.1)
    sheets = [rooms.quad([(-9, y, -9), (-9, y, 9), (9, y, 9), (9, y, -9)], 1) for y in (1.0, 0.5)]
    floor = rooms.quad([(-9, 0, -9), (-9, 0, 9), (9, 0, 9), (9, 0, -9)], 0)
    view = rooms.camera((0.1, 2.0, 0), (0, 0, 0), 64, 64, 0.01)
    house = rooms.house([floor, *sheets], [rooms.matte("floor", 0.5), glass])
    scene, camera = loaded((house, view))
    emitters, _weights = scene.emitters(camera, FIELDS, 0)
    streams: list[set[int]] = []

    class Recorded:
        def get_1d(self, dim: Any) -> Any:
            streams[-1].add(int(mi.UInt32(dim).numpy()[0]))
            return mi.Float(0.99)

        def get_2d(self, dim: Any) -> Any:
            streams[-1].update({int(mi.UInt32(dim).numpy()[0]), int(mi.UInt32(dim).numpy()[0]) + 1})
            return mi.Point2f(0.3, 0.6)

    all_emitters = EmitterFilter(mi.Int32(-1), mi.Int32(-1))
    context = PathContext(scene.device_scene, emitters, device_fields(FIELDS), all_emitters)
    path = camera_path(device_camera(camera), mi.Point2f(16, 12), mi.Point2f(0))
    for _step in range(3):
        streams.append(set())
        path, result, _alive = advance(context, Recorded(), path, mi.Bool(True))
        assert result.si.valid.numpy()[0]
    assert not streams[0] & streams[1]
    assert not streams[1] & streams[2]
    assert not streams[0] & streams[2]
