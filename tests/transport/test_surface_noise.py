"""Streams of random numbers attached to surfaces: a camera moves along a wall by whole pixels."""

import itertools

import numpy as np

from pbrs_farm.core.camera import Camera, Intrinsics
from pbrs_farm.transport.surface_noise import NoiseAnchors, surface_streams

WIDTH, HEIGHT = 40, 30
DISTANCE_M = 2.0


def camera(px: float) -> Camera:
    """A camera facing the wall z = -DISTANCE_M, moved so that the picture shifts by px to the left."""
    i = Intrinsics.from_hfov(WIDTH, HEIGHT)
    eye = np.array([px * DISTANCE_M / i.fx, 0.0, 0.0])
    return Camera.look(i, eye, np.array([0.0, 0.0, -1.0]))


def wall(of: Camera) -> np.ndarray:
    """(pixels, 3) points of the wall, slightly off the pixels' centres."""
    origin, directions = of.exact_rays()
    points = (origin + DISTANCE_M * directions).reshape(-1, 3)
    return points + np.array([1e-4, -1e-4, 0.0])


def streams(px: float, share: float) -> np.ndarray:
    anchors = NoiseAnchors((camera(0), camera(7)), (20, 40), share)
    return surface_streams(wall(camera(px)), anchors).reshape(HEIGHT, WIDTH)


def test_a_point_keeps_its_stream_while_the_camera_moves() -> None:
    for share in (0.0, 0.3, 1.0):
        np.testing.assert_array_equal(streams(0, share)[:, 5:], streams(5, share)[:, :-5])


def test_no_two_pixels_share_a_stream() -> None:
    # At twice the distance four pixels fall into one of the anchor's.
    near = camera(0)
    points = np.repeat(wall(near), 4, 0)
    many = surface_streams(points, NoiseAnchors((near, near), (0, 20), 0.5))
    assert len(np.unique(many)) == len(points)


def test_points_change_to_the_later_frame_one_by_one_and_do_not_return() -> None:
    early = streams(0, 0.0)
    gone = [streams(0, share) != early for share in np.linspace(0, 1, 11)]
    assert [round(float(g.mean()), 1) for g in gone] == [round(k / 10, 1) for k in range(11)]
    for before, after in itertools.pairwise(gone):
        assert not (before & ~after).any()


def test_frames_on_both_sides_of_an_anchor_agree() -> None:
    # Points that changed to frame 40 have its streams.
    ends = surface_streams(wall(camera(3)), NoiseAnchors((camera(0), camera(7)), (20, 40), 1.0))
    begins = surface_streams(wall(camera(3)), NoiseAnchors((camera(7), camera(9)), (40, 60), 0.0))
    np.testing.assert_array_equal(ends, begins)


def test_pixels_that_show_nothing_and_points_behind_an_anchor_have_streams_too() -> None:
    points = wall(camera(0))
    points[:50] = np.inf
    points[50:100, 2] = 3.0
    assert len(
        np.unique(surface_streams(points, NoiseAnchors((camera(0),) * 2, (0, 20), 0.4)))
    ) == (len(points))
