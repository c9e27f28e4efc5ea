"""Points tracked through a film of a wall and a square that moves in front of it: closed forms."""

from __future__ import annotations

import numpy as np

from pbrs_farm.core.arrays import F64, I64
from pbrs_farm.truth.point_tracks import MOST_POINTS, PointTracks, TrackFrame, point_tracks
from tests.inputs.flow_squares import HEIGHT, WIDTH, F, camera_at, squares

SPEED = 0.5  # m/s to the right, for a square of 0.5 m at 2 m; the wall is at 4 m
TIMES = (0.0, 0.5, 1.0, 5.0)


def film() -> PointTracks:
    def scene(time_s: float):
        return squares((9, 0, 0, 4), (0.25, SPEED * time_s, 0, 2))

    def motions(from_s: float, to_s: float) -> tuple[I64, F64]:
        matrix = np.eye(4)
        matrix[0, 3] = SPEED * (to_s - from_s)
        return np.array([0, 0, 1, 1]), np.stack([np.eye(4), matrix])

    view = camera_at(0)
    frames = [
        TrackFrame(view, t, lambda t=t: scene(t).hit_record(view), lambda t=t: scene(t).first_hit)
        for t in TIMES
    ]
    return point_tracks(frames, np.array([False, False, True, True]), motions, 3)


def test_points_of_the_square_move_with_it_and_those_of_the_wall_stay() -> None:
    tracks = film()
    assert 0.9 * MOST_POINTS < len(tracks.points) <= MOST_POINTS
    square = tracks.instance == 2
    assert square.sum() > 200
    wall = tracks.points[~square]
    np.testing.assert_allclose(wall, wall[:, :1].repeat(len(TIMES), 1), atol=1e-3)
    begin = tracks.points[square, 0]
    for k, time_s in enumerate(TIMES):
        moved = begin + np.array([F * SPEED * time_s / 2, 0])
        np.testing.assert_allclose(tracks.points[square, k], moved, atol=1e-3)
        np.testing.assert_allclose(tracks.depth_m[:, k], np.where(square, 2, 4), rtol=1e-5)


def test_a_point_of_the_wall_is_hidden_while_the_square_is_before_it() -> None:
    tracks = film()
    square = tracks.instance == 2
    x, y = tracks.points[~square, 0].T
    for k, time_s in enumerate(TIMES):
        middle = WIDTH / 2 + F * SPEED * time_s / 2
        covered = (np.abs(x - middle) < 5) & (np.abs(y - HEIGHT / 2) < 5)
        np.testing.assert_array_equal(tracks.occluded[~square, k], covered)
    # At 5 s the square has left the picture.
    assert tracks.occluded[square, 3].all()
    assert not tracks.occluded[square, 0].any()


def test_each_point_is_seen_at_a_pixels_centre_of_the_frame_that_it_was_chosen_in() -> None:
    tracks = film()
    rows = np.arange(len(tracks.points))
    begin = tracks.points[rows, tracks.query_frame]
    np.testing.assert_allclose(begin % 1, 0.5, atol=1e-3)
    assert not tracks.occluded[rows, tracks.query_frame].any()
    again = film()
    np.testing.assert_array_equal(again.points, tracks.points)
