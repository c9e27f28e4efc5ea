"""The dots of an infrared projector."""

from __future__ import annotations

import numpy as np

from pbrs_farm.core.camera import Camera
from pbrs_farm.core.house import geometry_from_house
from pbrs_farm.raycast.caster import Caster
from pbrs_farm.transport.validation import known_rooms as rooms
from pbrs_farm.truth.projector import projector_label

BASELINE_M = 0.1


def dot_picture(camera: Camera, partner: Camera | None, depth: float = 2.0, slab: bool = False):
    wall = rooms.quad([(-9, -9, -depth), (9, -9, -depth), (9, 9, -depth), (-9, 9, -depth)], 0)
    parts = [wall]
    if slab:
        parts.append(
            rooms.quad([(-0.05, -9, -1), (0.05, -9, -1), (0.05, 9, -1), (-0.05, 9, -1)], 0)
        )
    house = rooms.house(parts, [rooms.matte("wall", 0.8)])
    caster = Caster(geometry_from_house(house))
    hit = caster.hit_record(camera)
    albedo = np.full((*hit.face.shape, 3), 230, np.uint8)
    return projector_label(hit, camera, partner, albedo, caster.first_hit), hit


def pair() -> tuple[Camera, Camera]:
    left_camera = rooms.camera((0, 0, 0), (0, 0, -1), 320, 240)
    world = left_camera.world_from_camera.copy()
    world[:3, 3] = [BASELINE_M, 0, 0]
    return left_camera, Camera(left_camera.intrinsics, world)


def test_both_pictures_of_a_pair_show_the_same_dots_on_the_same_points() -> None:
    left, right = pair()
    shift = round(left.intrinsics.fx * BASELINE_M / 2.0)
    # A whole number of pixels of disparity, so that the pictures can be overlaid.
    depth = left.intrinsics.fx * BASELINE_M / shift
    (first, _), (second, _) = dot_picture(left, right, depth), dot_picture(right, left, depth)
    assert 0.05 < (first > 20).mean() < 0.6
    from_second, from_first = second[:, : 320 - shift].astype(int), first[:, shift:].astype(int)
    assert np.abs(from_second - from_first).max() <= 2


def test_surfaces_the_projector_misses_are_dark_and_far_walls_are_darker() -> None:
    camera = rooms.camera((0, 0, 0), (0, 0, -1), 320, 240)
    lit, hit = dot_picture(camera, None, slab=True)
    free, _ = dot_picture(camera, None)
    # Beside the slab, on the side away from the projector, the wall is in its shadow.
    behind = hit.depth_z > 1.5
    shadow = behind & (free > 20) & (lit == 0)
    columns = np.nonzero(shadow.any(0))[0]
    assert len(columns)
    assert columns.max() < 160
    assert (lit[lit > 0] == free[lit > 0])[behind[lit > 0]].all(), "what is lit is as without it"
    far, _ = dot_picture(camera, None, depth=6.0)
    assert 0 < far.max() < free.max()


def test_pixels_without_a_hit_are_unlit() -> None:
    camera = rooms.camera((0, 0, 0), (0, 0, 1), 32, 24)
    picture, hit = dot_picture(camera, None)
    assert not picture[~hit.valid].any()
