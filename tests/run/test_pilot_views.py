"""Frames of a walk share pilots and noise: fewer pilots, static noise, and independence of the rendering order."""

from dataclasses import replace

import numpy as np
import pytest

from pbrs_farm.core import keys
from pbrs_farm.core.camera import Camera, Intrinsics, View
from pbrs_farm.core.recipe import Recipe, RepairFields, recipe_from_name
from pbrs_farm.core.rig_fields import stereo_rig
from pbrs_farm.read.builtin.builtin_home import builtin_home
from pbrs_farm.repair import repair
from pbrs_farm.run.house_cache import CachedHouse, decoded_textures
from pbrs_farm.run.view_setup import ViewSetup
from pbrs_farm.sample.house_sampler import add_rig_views
from pbrs_farm.store import MemoryStore
from pbrs_farm.transport.light_scene import LightScene
from pbrs_farm.transport.view_emitters import ViewEmitters


def views(n: int = 12) -> dict[str, View]:
    def camera(k: int) -> Camera:
        eye = np.array([2.5 + 0.03 * k, 1.5, 3.0])
        return Camera.look(Intrinsics.from_hfov(24, 18), eye, np.array([-0.5, -0.2, -1.0]))

    frames = [View(f"frame_{k:05d}", "0_0", 0, camera(k), "walk", frame=k) for k in range(n)]
    return {view.id: view for view in add_rig_views(frames, stereo_rig(0.065))}


SMALL = {"light.spp": "4", "image.width_px": "24", "image.height_px": "18"}
FAST = recipe_from_name("fast")


def setup_of(view: View, every: dict[str, View], recipe: Recipe = FAST) -> ViewSetup:
    return ViewSetup(CachedHouse(MemoryStore(), recipe, "home", ""), view, every)


def test_ten_frames_share_one_pilot_per_eye() -> None:
    walk = views()
    pilots = [pilot for v in walk.values() if (pilot := setup_of(v, walk).pilot)]
    # Two cameras, each with all frames except the first of ten.
    assert len(pilots) == 2 * (9 + 1)
    places = {(round(float(pilot.camera.eye[0]), 4), pilot.seed) for pilot in pilots}
    firsts = [walk[f"frame_000{n}{side}"] for n in ("00", "10") for side in ("", "_right")]
    assert places == {
        (round(float(v.camera.eye[0]), 4), setup_of(v, walk).light_seed(v)) for v in firsts
    }


def test_a_view_that_is_no_frame_has_a_separate_pilot() -> None:
    alone = View("0_0_1", "0_0", 1, next(iter(views().values())).camera)
    assert setup_of(alone, {alone.id: alone}).pilot is None


def test_whichever_frame_is_rendered_first_changes_no_picture(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    recipe = recipe_from_name("preview", SMALL)
    house, _report = repair(builtin_home(), RepairFields())
    sky = CachedHouse(MemoryStore(), recipe, house.id, "").sky
    walk = views()
    frames = [walk[f"frame_{k:05d}"] for k in (1, 2)]
    n_pilots = []
    measure_before = ViewEmitters.measure
    monkeypatch.setattr(
        ViewEmitters, "measure", lambda *args: (n_pilots.append(1), measure_before(*args))[1]
    )

    def pictures(order: list[View]) -> dict[str, np.ndarray]:
        scene = LightScene.load(house, decoded_textures(house)[0], recipe, sky)
        return {
            v.id: scene.render(
                v.camera, "0_0", recipe.light, 7, pilot=setup_of(v, walk, recipe).pilot,
            ).indoor
            for v in order
        }  # fmt: skip

    in_order, back = pictures(frames), pictures(frames[::-1])
    for view in frames:
        np.testing.assert_array_equal(in_order[view.id], back[view.id])
    assert len(n_pilots) == 2  # one for each scene


def test_frames_of_an_eye_share_a_seed_and_other_views_do_not() -> None:
    walk = views()
    setup = setup_of(walk["frame_00000"], walk)
    assert len({setup.light_seed(view) for view in walk.values()}) == 2
    alone = View("0_0_1", "0_0", 1, walk["frame_00000"].camera)
    seed = keys.seed("home", "0_0_1", "light", setup.light_digest)
    assert setup.light_seed(alone) == seed


def test_a_static_camera_sees_the_same_noise() -> None:
    walk = views()
    still = walk["frame_00000"].camera
    walk["frame_00001"] = replace(walk["frame_00001"], camera=still)
    recipe = recipe_from_name("preview", SMALL)
    house, _report = repair(builtin_home(), RepairFields())
    sky = CachedHouse(MemoryStore(), recipe, house.id, "").sky
    scene = LightScene.load(house, decoded_textures(house)[0], recipe, sky)
    first, second = (
        scene.render(
            still, "0_0", recipe.light, setup.light_seed(setup.view),
            pilot=setup.pilot, anchors=setup.anchors,
        ).indoor
        for setup in (setup_of(walk[f"frame_0000{k}"], walk, recipe) for k in (0, 1))
    )  # fmt: skip
    np.testing.assert_array_equal(first, second)
    assert first.max() > 0


def test_noise_begins_at_every_twentieth_frame_and_lasts_forty() -> None:
    walk = views(45)
    for number, first, later, share in (
        (0, 0, 0, 0.0), (19, 0, 0, 0.0), (20, 0, 20, 0.0), (25, 0, 20, 0.25), (44, 20, 20, 0.2)
    ):  # fmt: skip
        anchors = setup_of(walk[f"frame_{number:05d}"], walk).anchors
        assert anchors is not None
        assert (anchors.first, anchors.later, anchors.share) == (first, later, share)
        eyes = [frame.camera.eye[0] for frame in anchors.frames]
        np.testing.assert_allclose(eyes, 2.5 + 0.03 * np.arange(first, number + 1))


def test_missing_frames_are_left_out_of_a_films_noise() -> None:
    walk = views()
    del walk["frame_00003"], walk["frame_00004"]
    anchors = setup_of(walk["frame_00006"], walk).anchors
    assert anchors is not None
    assert [frame.number for frame in anchors.frames] == [0, 1, 2, 5, 6]
    eyes = [frame.camera.eye[0] for frame in anchors.frames]
    np.testing.assert_allclose(eyes, 2.5 + 0.03 * np.array([0, 1, 2, 5, 6]))


def test_both_eyes_of_a_rig_see_each_frame_once(monkeypatch: pytest.MonkeyPatch) -> None:
    recipe = recipe_from_name("preview", SMALL | {"light.spp": "1"})
    house, _report = repair(builtin_home(), RepairFields())
    sky = CachedHouse(MemoryStore(), recipe, house.id, "").sky
    scene = LightScene.load(house, decoded_textures(house)[0], recipe, sky)
    from pbrs_farm.transport.kernels import camera_rays  # needs the variant that the scene chose

    walk = views(3)
    asked: list[Camera] = []
    first_points = camera_rays.first_points
    monkeypatch.setattr(
        camera_rays, "first_points", lambda s, c: (asked.append(c), first_points(s, c))[1]
    )
    for view in walk.values():
        setup = setup_of(view, walk, recipe)
        scene.render(
            setup.at_size(view), "0_0", recipe.light, 7, pilot=setup.pilot, anchors=setup.anchors
        )
    assert [tuple(c.eye) for c in asked] == [tuple(v.camera.eye) for v in walk.values()]


def test_a_view_that_is_no_frame_has_no_anchors() -> None:
    walk = views()
    alone = View("0_0_1", "0_0", 1, walk["frame_00000"].camera)
    assert setup_of(alone, walk | {alone.id: alone}).anchors is None
