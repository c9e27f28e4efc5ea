"""Flow, disparity, occlusion and overlap of squares in closed form."""

import math

import numpy as np
import pytest

from pbrs_farm.core.camera import Camera, View
from pbrs_farm.core.rig_fields import stereo_rig
from pbrs_farm.raycast.caster import Caster
from pbrs_farm.sample.house_sampler import add_rig_views
from pbrs_farm.truth.common_surface import pair_rows
from pbrs_farm.truth.optical_flow import (
    HIDDEN,
    OUTSIDE,
    SEEN,
    OtherTime,
    correspondence,
    disparity_label,
    flow_kitti,
    partners_of,
    scene_flow_label,
)
from tests.inputs.flow_squares import HEIGHT, WIDTH, F, camera_at, squares

LEVEL = np.array([0.0, 0.0, -1.0])


def matched(caster: Caster, a: Camera, b: Camera):
    return correspondence(caster.hit_record(a), a, b, caster.first_hit)


def moved_square(by: tuple[float, float, float]) -> tuple[Caster, OtherTime]:
    """A wall at 4 m, and at 2 m a square of 0.5 m that has moved by the time of the other view."""
    now = squares((9, 0, 0, 4), (0.25, 0, 0, 2))
    then = squares((9, 0, 0, 4), (0.25, by[0], by[1], 2 - by[2]))
    matrix = np.eye(4)
    matrix[:3, 3] = by
    return now, OtherTime(then.first_hit, np.array([0, 0, 1, 1]), np.stack([np.eye(4), matrix]))


def test_a_moving_item_flows_and_hides_the_surfaces_it_passes() -> None:
    now, then = moved_square((0.5, 0.0, 0.0))
    view = camera_at(0)
    hit = now.hit_record(view)
    flow = correspondence(hit, view, view, now.first_hit, then)
    square = hit.item == 2
    assert square.sum() == 100  # 2 x 0.25 m at 20 pixels per metre, in both directions
    np.testing.assert_allclose(flow.flow[square], [[F * 0.5 / 2, 0]] * 100, atol=1e-4)
    np.testing.assert_allclose(flow.flow[~square], 0, atol=1e-4)
    # It covers ten columns to the right of its old place.
    hidden = flow.state == HIDDEN
    assert hidden.sum() == 100
    assert hidden[19:29, 37:47].all()
    label = scene_flow_label(hit, view, then)
    np.testing.assert_allclose(label[square], [[0.5, 0, 0]] * 100, atol=1e-6)
    assert not label[~square].any()
    assert not scene_flow_label(hit, view, None).any()


def test_a_surface_a_fifth_of_a_millimetre_in_front_hides_the_wall() -> None:
    now = squares((9, 0, 0, 4), (0.5, 0, 0, 9))  # behind the wall
    then = squares((9, 0, 0, 4), (0.5, 0, 0, 3.9998))
    nearer = np.eye(4)
    nearer[2, 3] = 5.0002
    nearer_time = OtherTime(then.first_hit, np.array([0, 0, 1, 1]), np.stack([np.eye(4), nearer]))
    flow = correspondence(
        now.hit_record(camera_at(0)), camera_at(0), camera_at(0), now.first_hit, nearer_time
    )
    row, column = HEIGHT // 2, WIDTH // 2
    assert flow.state[row, column] == HIDDEN
    assert flow.state[row, column + 8] == SEEN


def test_an_approaching_item_spreads_from_the_middle() -> None:
    now, then = moved_square((0.0, 0.0, 1.0))
    view = camera_at(0)
    hit = now.hit_record(view)
    flow = correspondence(hit, view, view, now.first_hit, then)
    rows, columns = np.nonzero(hit.item == 2)
    # At half the distance a point is twice as far from the axis.
    centre = np.stack([columns + 0.5 - WIDTH / 2, rows + 0.5 - HEIGHT / 2], -1)
    np.testing.assert_allclose(flow.flow[rows, columns], centre, atol=1e-4)


def test_a_wall_flows_by_focal_length_times_move_over_depth() -> None:
    flow = matched(squares((9, 0, 0, 2)), camera_at(0), camera_at(0.1, 0.05))
    np.testing.assert_allclose(flow.flow[..., 0], -F * 0.1 / 2, atol=1e-4)
    np.testing.assert_allclose(flow.flow[..., 1], F * 0.05 / 2, atol=1e-4)


def test_a_static_camera_sees_zero_flow() -> None:
    flow = matched(squares((0.4, 0, 0, 1), (9, 0, 0, 3)), camera_at(0), camera_at(0))
    assert (flow.state == SEEN).all()
    assert np.abs(flow.flow).max() < 1e-4


def test_pixels_that_leave_the_picture_are_outside_and_no_others() -> None:
    flow = matched(squares((9, 0, 0, 2)), camera_at(0), camera_at(0.2))
    # It moves 4 px to the left.
    assert (flow.state[:, :4] == OUTSIDE).all()
    assert (flow.state[:, 4:] == SEEN).all()


def test_a_wall_behind_a_square_is_hidden_by_the_parallax_between_them() -> None:
    # The square spans 20 px; it moves 8 px, the wall 2 px, so 6 columns of wall are newly hidden.
    caster = squares((0.25, 0, 0, 1), (9, 0, 0, 4))
    flow = matched(caster, camera_at(0), camera_at(0.2))
    rows = flow.state[HEIGHT // 2]
    hit = caster.hit_record(camera_at(0)).item[HEIGHT // 2]
    assert (rows == HIDDEN).sum() == 6
    assert (hit[rows == HIDDEN] == 2).all()
    # Those columns are to the left of the square, in its direction of motion.
    assert np.flatnonzero(rows == HIDDEN).max() < np.flatnonzero(hit == 1).min()


def test_points_behind_the_other_camera_are_outside_without_flow() -> None:
    flow = matched(squares((0.5, 0, 0, 1)), camera_at(0), camera_at(0, z=-2))
    assert (flow.state == OUTSIDE).all()
    assert not flow.flow.any()


def test_kittis_flow_is_in_64ths_of_a_pixel_and_valid_at_visible_points() -> None:
    flow = matched(squares((9, 0, 0, 2)), camera_at(0), camera_at(0.1))
    png = flow_kitti(flow)
    visible = flow.state == SEEN
    assert (png[visible] == (2**15 - 128, 2**15, 1)).all()
    assert not png[~visible].any()


def test_disparity_is_256ths_of_focal_length_times_baseline_over_depth() -> None:
    flow = matched(squares((9, 0, 0, 2)), camera_at(0), camera_at(0.065))
    assert (disparity_label(flow) == round(256 * F * 0.065 / 2)).all()
    nothing = matched(squares((0.1, 0, 0, 2)), camera_at(0), camera_at(0.065))
    assert disparity_label(nothing)[0, 0] == 0


def views() -> dict[str, View]:
    frames = [
        View(f"frame_{k:05d}", "0_0", 0, camera_at(0.1 * k), "walk", frame=k, time_s=k / 10)
        for k in range(3)
    ]
    return {v.id: v for v in add_rig_views(frames, stereo_rig(0.065))}


def test_right_views_are_a_baseline_to_the_right_in_the_same_frame() -> None:
    pair = views()
    right = pair["frame_00001_right"]
    assert right.rig is not None
    assert (right.frame, right.shot.eye, right.rig.instant) == (1, "right", "frame_00001")
    np.testing.assert_allclose(right.camera.eye, [0.165, 0, 0], atol=1e-12)
    assert add_rig_views([right], None) == (right,)


def test_each_view_knows_its_neighbours_in_time_and_the_other_of_its_pair() -> None:
    all_views = views()
    middle = partners_of(all_views["frame_00001"], all_views)
    assert {r: v.id for r, v in middle.items()} == {
        "next": "frame_00002",
        "previous": "frame_00000",
        "stereo": "frame_00001_right",
    }
    right = partners_of(all_views["frame_00000_right"], all_views)
    assert {r: v.id for r, v in right.items()} == {
        "next": "frame_00001_right",
        "stereo": "frame_00000",
    }


def test_a_single_view_has_no_partner() -> None:
    alone = View("0_0_1", "0_0", 1, camera_at(0))
    assert partners_of(alone, {alone.id: alone}) == {}


def test_pairs_share_all_half_or_none_of_a_wall() -> None:
    # At 2 m the picture is 3.2 m wide: a move by 1.6 m leaves half of it in common.
    caster = squares((9, 0, 0, 2))
    cameras = {"a": camera_at(0), "b": camera_at(1.6), "c": camera_at(0, yaw=math.pi)}
    rows = pair_rows([View(k, "0_0", 0, c) for k, c in cameras.items()], caster.first_hit)
    share = {(r.view_a, r.view_b): r for r in rows}
    assert len(rows) == 3
    assert share["a", "b"].common == pytest.approx(0.5, abs=0.04)
    assert share["a", "b"].baseline_m == pytest.approx(1.6)
    assert share["a", "c"].common == 0
    assert share["a", "c"].angle_deg == pytest.approx(180)


def test_views_of_different_rooms_are_no_pair() -> None:
    two_rooms = [View("a", "0_0", 0, camera_at(0)), View("b", "0_1", 0, camera_at(0))]
    assert pair_rows(two_rooms, squares((9, 0, 0, 2)).first_hit) == []
