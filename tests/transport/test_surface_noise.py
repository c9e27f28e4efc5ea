"""Streams of random numbers attached to surfaces: a camera moves along a wall."""

import itertools
from collections.abc import Sequence

import numpy as np

from pbrs_farm.core.camera import Camera, Intrinsics
from pbrs_farm.transport.surface_noise import FilmFrame, NoiseAnchors, StreamWalk, SurfaceStreams

WIDTH, HEIGHT = 40, 30
DISTANCE_M = 2.0


def camera(px: float, distance_m: float = DISTANCE_M) -> Camera:
    """A camera facing the wall z = -DISTANCE_M, moved so that the picture shifts by px to the left."""
    i = Intrinsics.from_hfov(WIDTH, HEIGHT)
    eye = np.array([px * DISTANCE_M / i.fx, 0.0, distance_m - DISTANCE_M])
    return Camera.look(i, eye, np.array([0.0, 0.0, -1.0]))


def wall(of: Camera, _time_s: float | None = None) -> np.ndarray:
    """(pixels, 3) points of the wall, slightly off the pixels' centres."""
    origin, directions = of.exact_rays()
    points = (origin + (DISTANCE_M + of.eye[2]) * directions).reshape(-1, 3)
    return (points + np.array([1e-4, -1e-4, 0.0])).astype(np.float32)


def anchors(
    places: list[float], later: int = 0, share: float = 0.0, numbers: Sequence[int] | None = None
) -> NoiseAnchors:
    """A film from the camera's places in px; numbers: of its frames, where they do not count from 0."""
    frames = zip(numbers or range(len(places)), map(camera, places), itertools.repeat(None))
    return NoiseAnchors(tuple(itertools.starmap(FilmFrame, frames)), 0, later, share)


def film(places: list[float], later: int = 0, share: float = 0.0) -> SurfaceStreams:
    """Streams of the last frame of a film, from the camera's places in px."""
    return StreamWalk().streams(anchors(places, later, share), wall)


def begun_at(anchor: int, frames: tuple[FilmFrame, ...]) -> NoiseAnchors:
    """The streams of an anchor alone."""
    return NoiseAnchors(frames, anchor, anchor, 0.0)


def names(of: SurfaceStreams) -> np.ndarray:
    return of.names.reshape(HEIGHT, WIDTH)


def test_a_point_keeps_its_stream_while_the_camera_moves() -> None:
    for share in (0.0, 0.3, 1.0):
        first, later = (film([0, 1, 3, 3 + n], 2, share) for n in (0, 5))
        np.testing.assert_array_equal(names(first)[:, 5:], names(later)[:, :-5])


def test_samples_keep_their_points_when_a_camera_moves_by_part_of_a_pixel() -> None:
    first, later = film([0]), film([0, 0.3])
    np.testing.assert_array_equal(first.names, later.names)
    np.testing.assert_allclose(first.shifts, 0)
    # The surface moves to the left by 0.3 px, and so does each sample in its pixel.
    np.testing.assert_allclose(later.shifts[:, 0], 0.3, atol=0.02)
    # After another 0.3 px the pixel to the right has the stream, 0.4 px to the left of its centre.
    names_after = names(film([0, 0.3, 0.6]))
    assert (names_after[:, :-1] == names(first)[:, :-1]).all()
    after = film([0, 0.6])
    np.testing.assert_array_equal(names(after)[:, :-1], names(first)[:, 1:])
    np.testing.assert_allclose(after.shifts.reshape(HEIGHT, WIDTH, 2)[:, :-1, 0], 0.6, atol=0.02)


def test_no_two_pixels_share_a_stream() -> None:
    # At half the distance a pixel's surface fills four.
    cameras = camera(0), camera(0, DISTANCE_M / 2)
    frames = tuple(FilmFrame(n, c, None) for n, c in enumerate(cameras))
    for share in (0.0, 0.5):
        streams = StreamWalk().streams(NoiseAnchors(frames, 0, 1, share), wall)
        assert len(np.unique(streams.names)) == WIDTH * HEIGHT


def test_points_change_to_the_later_anchor_one_by_one_and_do_not_return() -> None:
    early = names(film([0, 0], 1, 0.0))
    gone = [names(film([0, 0], 1, share)) != early for share in np.linspace(0, 1, 11)]
    assert [round(float(g.mean()), 1) for g in gone] == [round(k / 10, 1) for k in range(11)]
    for before, after in itertools.pairwise(gone):
        assert not (before & ~after).any()


def test_frames_on_both_sides_of_an_anchor_agree() -> None:
    # Streams of frame 2 are the later ones before frame 4, and the earlier ones from there on.
    places = [0, 1, 2, 3, 5]
    ends = film(places, 2, 1.0)
    begins = StreamWalk().streams(begun_at(2, anchors(places).frames[2:]), wall)
    np.testing.assert_array_equal(ends.names, begins.names)
    np.testing.assert_array_equal(ends.shifts, begins.shifts)


def test_a_film_with_gaps_keeps_its_streams_and_is_seen_once() -> None:
    numbers, places = [0, 1, 4, 5, 7], [0, 1, 3, 4, 6]  # without frames 2, 3 and 6
    asked = []

    def seen(of: Camera, time_s: float | None) -> np.ndarray:
        asked.append(of)
        return wall(of, time_s)

    walk = StreamWalk()
    films = [names(walk.streams(anchors(places[:n], 2, 0.4, numbers[:n]), seen)) for n in (3, 4, 5)]
    assert len(asked) == 5
    for before, after, px in zip(films, films[1:], (1, 2), strict=False):
        np.testing.assert_array_equal(before[:, px:], after[:, :-px])


def test_an_anchor_that_is_missing_is_replaced_by_the_frame_after_it() -> None:
    # Frame 2 is an anchor, and the film has frames 0, 1, 3 and 4.
    film_with_gap = anchors([0, 1, 3, 5], 2, 1.0, [0, 1, 3, 4])
    ends = StreamWalk().streams(film_with_gap, wall)
    begins = StreamWalk().streams(begun_at(2, film_with_gap.frames[2:]), wall)
    np.testing.assert_array_equal(ends.names, begins.names)
    np.testing.assert_array_equal(ends.shifts, begins.shifts)


def test_streams_do_not_depend_on_the_frames_asked_for_before() -> None:
    places = [0, 0.4, 1.1, 2.5, 2.7]
    walk = StreamWalk()
    for last in (2, 3, 3, 1, 5, 4):
        asked = anchors(places[:last], 2 if last > 2 else 0, 0.4)
        streams, fresh = walk.streams(asked, wall), StreamWalk().streams(asked, wall)
        np.testing.assert_array_equal(streams.names, fresh.names)
        np.testing.assert_array_equal(streams.shifts, fresh.shifts)
    # Another film begins anew.
    other = anchors([0, 3.0])
    np.testing.assert_array_equal(walk.streams(other, wall).names, film([0, 3.0]).names)


def test_pixels_that_show_nothing_have_streams_too() -> None:
    def points(of: Camera, time_s: float | None) -> np.ndarray:
        shown = wall(of, time_s)
        shown[:50] = np.inf
        return shown

    streams = StreamWalk().streams(anchors([0, 1, 2], 1, 0.4), points)
    assert len(np.unique(streams.names)) == WIDTH * HEIGHT
    assert np.isfinite(streams.shifts).all()
    # Without a surface, a pixel keeps its stream.
    before = StreamWalk().streams(anchors([0, 1], 1, 0.0), points)
    after = StreamWalk().streams(anchors([0, 1, 2], 1, 0.0), points)
    np.testing.assert_array_equal(before.names[:50], after.names[:50])
