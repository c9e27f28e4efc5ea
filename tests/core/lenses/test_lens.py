"""Every lens model maps from pixel to direction and back, and marks pixels without a ray."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pbrs_farm.check.lens_rays import StoredLens
from pbrs_farm.core.camera import Camera, Intrinsics, fold_of, pinholes_of
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.frames import rotation_y
from pbrs_farm.core.lenses import COEFFICIENTS, Lens, lens_from_table, lens_of_opencv
from pbrs_farm.core.optics_fields import LENS_PRESETS, LensFields
from tests.core.lenses.opencv_points import error_px

PINHOLE = Intrinsics.from_hfov(640, 480)
MODELS = {
    "pinhole": LensFields(fx=500, fy=510, cx=300, cy=260),
    "kinect": LensFields(preset="kinect"),
    "barrel": LensFields(model="radtan", k1=-0.2, k2=0.03, p1=1e-3, p2=-2e-3),
    "eight": LensFields(
        model="opencv",
        fx=606,
        k1=0.5285,
        k2=-2.7126,
        p1=6e-4,
        p2=-3e-4,
        k3=1.5561,
        k4=0.4056,
        k5=-2.533,
        k6=1.4813,
    ),
    "fourteen": LensFields(
        model="opencv",
        fx=500,
        k1=-0.28,
        k2=0.07,
        p1=1e-3,
        k4=0.02,
        s1=4e-3,
        s4=1e-3,
        tau_x=0.03,
        tau_y=-0.05,
    ),
    "tum_vi": LensFields(preset="tum_vi"),
    "fisheye180": LensFields(preset="fisheye180"),
    "equirect": LensFields(model="equirect"),
    "cubemap": LensFields(model="cubemap"),
}


def camera_of(name: str) -> Camera:
    pose = np.eye(4)
    pose[:3, :3] = rotation_y(0.7)
    pose[:3, 3] = 1, 2, 3
    return Camera(MODELS[name].intrinsics(PINHOLE), pose)


@pytest.mark.parametrize("name", MODELS)
def test_a_point_on_a_pixels_ray_projects_to_its_centre(name: str) -> None:
    camera = camera_of(name)
    origin, directions = camera.exact_rays()
    sees = directions.any(-1)
    points = origin + 2.5 * directions[sees]
    rows, columns = np.nonzero(sees)
    pixels = camera.pixels_of(points)
    error = np.abs(pixels - np.stack([columns, rows], 1) - 0.5)
    assert error.max() < 1e-6
    assert np.allclose(camera.depths_of(points), 2.5)


@pytest.mark.parametrize("name", MODELS)
def test_only_a_fisheye_has_pixels_without_a_ray(name: str) -> None:
    camera = camera_of(name)
    blind = camera.blind
    if name not in ("tum_vi", "fisheye180"):
        assert blind is None
        assert camera.exact_rays()[1].any(-1).all()
        return
    # The picture's corners are outside the image circle, its middle inside.
    assert blind is not None
    assert blind[0, 0]
    assert not blind[256, 256]
    assert not camera.rays()[1][blind].any()


def test_points_of_opencv_are_met_and_found_again_within_a_millionth_of_a_pixel() -> None:
    assert max(error_px()) < 1e-6


@pytest.mark.parametrize("name", ["barrel", "eight", "fourteen"])
def test_verify_has_the_same_lens_by_its_own_code(name: str) -> None:
    i = MODELS[name].intrinsics(PINHOLE)
    pixels = np.random.default_rng(0).uniform(0, 1, (200, 2)) * [i.width_px, i.height_px]
    own, directions = StoredLens.of(i.lens.table()), i.directions(pixels)
    plane = (pixels - [i.cx, i.cy]) / [i.fx, i.fy]
    np.testing.assert_allclose(own.rays(plane), directions, atol=1e-9)
    np.testing.assert_allclose(own.plane_and_depth(directions)[0], plane, atol=1e-9)


def test_a_camera_takes_opencvs_numbers_or_says_why_not() -> None:
    k = [[500, 0, 320], [0, 500, 240], [0, 0, 1]]
    look = {"eye": (0, 0, 0), "target": (0, 0, -1), "size": (640, 480), "K": k}
    models = {
        n: Camera.look_at(**look, distortion=[0.1] * 2 + [0] * (n - 3) + [0.01]).intrinsics.lens
        for n in (4, 5, 8, 12, 14)
    }
    assert [lens.model for lens in models.values()] == ["radtan"] * 2 + ["opencv"] * 3
    assert models[14].coefficients[-1] == models[12].coefficients[11] == 0.01
    assert lens_of_opencv([0.0] * 14).is_pinhole
    assert (
        Camera.look_at(**look, distortion=np.full((1, 5), 0.01)).intrinsics.lens.coefficients
        == (0.01,) * 5
    )
    with pytest.raises(BadInput, match="distortion"):
        Camera.look_at(**look, distortion=["much"] * 4)
    assert len(COEFFICIENTS["opencv"]) == 14
    with pytest.raises(BadInput, match=r"4, 5, 8, 12 or 14 finite numbers"):
        Camera.look_at(**look, distortion=[0.1] * 6)
    with pytest.raises(BadInput, match=r"folds the picture at .* degrees: no ray falls on"):
        Camera.from_opencv(
            np.diag([1, -1, -1, 1]), k, size=(640, 480), distortion=[0, 0, 0, 0, 0, 3, 0, 0]
        )


def test_other_recipes_keep_their_digest() -> None:
    assert "tau_x" not in LensFields(preset="kinect").model_dump()
    assert MODELS["fourteen"].model_dump()["tau_y"] == -0.05


def test_a_circle_of_180_degrees_covers_a_hemisphere() -> None:
    blind = camera_of("fisheye180").blind
    assert blind is not None
    assert 1 - blind.mean() == pytest.approx(math.pi / 4, abs=0.002)


def test_a_panorama_looks_forward_in_its_middle_and_up_in_its_first_row() -> None:
    i = MODELS["equirect"].intrinsics(PINHOLE)
    middle, top, right = i.directions(np.array([[512.0, 256], [512, 0], [768, 256]]))
    assert np.allclose(middle, [0, 0, 1])
    assert np.allclose(top, [0, -1, 0])
    assert np.allclose(right, [1, 0, 0])


def test_the_faces_of_a_cube_map_meet_at_their_edges() -> None:
    i = MODELS["cubemap"].intrinsics(PINHOLE)
    edge = np.linspace(1, 255, 9)
    tiny = 1e-7
    # Between faces along the strip, and around from left to front.
    for left, right in ((255, 257), (511, 513), (767, 769)):
        a = i.directions(np.stack([np.full(9, left + 1 - tiny), edge], 1))
        b = i.directions(np.stack([np.full(9, right - 1 + tiny), edge], 1))
        assert np.allclose(a, b, atol=1e-6)
    # The lower edge of `up` and the upper edge of `down` coincide with the front's.
    front_top = i.directions(np.stack([edge, np.full(9, tiny)], 1))
    up_bottom = i.directions(np.stack([4 * 256 + edge, np.full(9, 256 - tiny)], 1))
    front_bottom = i.directions(np.stack([edge, np.full(9, 256 - tiny)], 1))
    down_top = i.directions(np.stack([5 * 256 + edge, np.full(9, tiny)], 1))
    assert np.allclose(front_top, up_bottom, atol=1e-6)
    assert np.allclose(front_bottom, down_top, atol=1e-6)


def test_a_barrel_bends_lines_outwards_in_the_middle_and_a_pin_hole_does_not() -> None:
    # A straight horizontal edge above the axis: its ends are bent towards the middle.
    xs = np.linspace(-0.5, 0.5, 5)
    line = np.stack([xs, np.full(5, -0.3), np.ones(5)], 1)
    barrel = Lens("radtan", (-0.2, 0.0, 0.0, 0.0, 0.0)).plane_points(line)
    assert abs(barrel[0, 1]) < abs(barrel[2, 1])
    assert np.ptp(Lens().plane_points(line)[:, 1]) == 0


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"model": "radtan", "k1": -1.5}, "folds the picture at"),
        ({"model": "radtan", "k1": -0.4, "k2": -2.0}, "folds the picture at"),
        ({"model": "fisheye", "fx": 100, "k1": -0.3}, "folds the picture at"),
        ({"model": "opencv", "k4": 4.0}, "folds the picture at"),
        ({"model": "fisheye"}, "needs lens.fx"),
    ],
)
def test_a_distortion_that_folds_the_picture_is_refused(
    fields: dict[str, float], words: str
) -> None:
    with pytest.raises(ValueError, match=words):
        LensFields(**fields).intrinsics(PINHOLE)  # type: ignore[arg-type]


def test_an_image_circle_before_the_fold_is_no_fold() -> None:
    fields = LensFields(model="fisheye", fx=100, k1=-0.1, max_angle_deg=80)
    assert fold_of(fields.intrinsics(PINHOLE)) is None


@pytest.mark.parametrize("name", MODELS)
def test_a_lens_reads_back_from_its_table(name: str) -> None:
    lens = MODELS[name].lens
    assert lens_from_table(lens.table()) == lens


def test_a_preset_fills_unset_fields() -> None:
    assert LensFields(preset="kinect", k1=0).k1 == 0
    assert LensFields(preset="kinect").fy == LENS_PRESETS["kinect"]["fy"]
    assert LensFields().intrinsics(PINHOLE) is PINHOLE


@pytest.mark.parametrize("name", ["kinect", "tum_vi", "equirect"])
def test_a_picture_from_pinhole_faces_shows_each_ray_its_direction(name: str) -> None:
    # Paint each face with its directions; the resampled picture must show the directions of its
    # rays.
    camera = camera_of(name)
    faces, map_ = pinholes_of(camera)
    painted = []
    for face in faces:
        directions = face.exact_rays()[1]
        painted.append(directions / np.linalg.norm(directions, axis=-1, keepdims=True))
    resampled = map_.bilinear(painted)
    rays = camera.exact_rays()[1]
    sees = rays.any(-1)
    rays = rays[sees] / np.linalg.norm(rays[sees], axis=-1, keepdims=True)
    assert np.linalg.norm(resampled[sees] - rays, axis=-1).max() < 2e-4
    # A lens of 195 degrees looks into five faces of the cube.
    assert len(faces) == {"kinect": 1, "tum_vi": 5, "equirect": 6}[name]
