"""The air of rooms: objects placed there are clear of everything, for any position and rotation."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.house import Item, ItemKind
from pbrs_farm.geometry.free_air import (
    CLEAR_M,
    FreeAir,
    mean_shadow_m2,
    random_turn,
    shadow_for_share,
)
from pbrs_farm.geometry.solids import quads_surface
from tests.dress.furniture import DEPTH, HEIGHT, WIDTH, quads_of, room, solid

HALF = np.array([0.2, 0.1, 0.05])
CUBOID = HALF * np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])


def structure(item_id: str, kind: ItemKind, low: list[float], high: list[float]) -> Item:
    return replace(solid(item_id, low, high), kind=kind)


FLOOR = structure("floor", ItemKind.FLOOR, [0, -0.1, 0], [WIDTH, 0, DEPTH])


def poses_in(air: FreeAir, n: int, seed: int = 1) -> list[F64]:
    rng = np.random.default_rng(seed)
    drawn_poses = (air.put(room(), CUBOID, rng) for _ in range(n))
    return [pose for pose in drawn_poses if pose is not None]


def grid_on(half: F64, n: int = 12) -> F64:
    """Points spread over the sides of a cuboid about the origin."""
    u = np.linspace(-1, 1, n)
    a, b = (g.ravel() for g in np.meshgrid(u, u))
    sides = []
    for axis in range(3):
        for sign in (-1.0, 1.0):
            side = np.empty((len(a), 3))
            side[:, axis], side[:, axis - 1], side[:, axis - 2] = sign, a, b
            sides.append(side)
    return np.concatenate(sides) * half


def distance_to_cuboid(points: F64, half: F64) -> float:
    return float(np.linalg.norm(np.maximum(np.abs(points) - half, 0), axis=1).min())


def test_floating_objects_keep_clear_of_the_room_and_of_each_other() -> None:
    table = solid("table", [1, 0, 1], [2.5, 0.75, 2])
    poses = poses_in(FreeAir([FLOOR, table]), 30)
    assert len(poses) > 20
    points = [grid_on(HALF) @ p[:3, :3].T + p[:3, 3] for p in poses]
    middle, half = np.array([1.75, 0.375, 1.5]), np.array([0.75, 0.375, 0.5])
    for k, own_points in enumerate(points):
        assert own_points.min(0) == pytest.approx(own_points.min(0).clip(CLEAR_M))
        assert (own_points.max(0) <= np.array([WIDTH, HEIGHT, DEPTH]) - CLEAR_M + 1e-9).all()
        assert distance_to_cuboid(own_points - middle, half) >= CLEAR_M - 1e-9
        for pose in poses[:k]:
            local = (own_points - pose[:3, 3]) @ pose[:3, :3]
            assert distance_to_cuboid(local, HALF) >= CLEAR_M - 1e-9


def test_nothing_floats_inside_a_hollow_item() -> None:
    # A cupboard as large as half the room: its inside has no faces, but is no air of the room.
    cupboard = solid("cupboard", [0.01, 0.01, 0.01], [2, 2.2, 2.5])
    poses = poses_in(FreeAir([FLOOR, cupboard]), 40)
    assert poses
    for pose in poses:
        assert not ((pose[:3, 3] > [0, 0, 0]) & (pose[:3, 3] < [2, 2.2, 2.5])).all()


def test_the_inside_of_a_one_mesh_home_is_air() -> None:
    shell = solid("scan", [-0.1, -0.1, -0.1], [WIDTH + 0.1, HEIGHT + 0.1, DEPTH + 0.1])
    assert poses_in(FreeAir([FLOOR, shell]), 5)


def test_nothing_floats_above_a_sloping_ceiling() -> None:
    # From 1 m at x = 0 to the room's height at the other side.
    slope = np.array([[[0, 1, 0], [0, 1, DEPTH], [WIDTH, HEIGHT, DEPTH], [WIDTH, HEIGHT, 0.0]]])
    ceiling = Item("c", "c", ItemKind.CEILING, "0", (quads_surface("c", slope, 0),), 22)
    poses = poses_in(FreeAir([FLOOR, ceiling]), 40)
    assert len(poses) > 10
    for pose in poses:
        points = CUBOID @ pose[:3, :3].T + pose[:3, 3]
        assert (points[:, 1] < 1 + (HEIGHT - 1) * points[:, 0] / WIDTH).all()


def test_an_object_too_large_finds_no_place() -> None:
    rng = np.random.default_rng(1)
    assert FreeAir([FLOOR]).put(room(), CUBOID * 30, rng) is None


def test_equal_draws_give_equal_places_and_others_others() -> None:
    first, same, other_seed = (np.array(poses_in(FreeAir([FLOOR]), 5, seed)) for seed in (1, 1, 2))
    assert (first == same).all()
    assert (first[:, :3, 3] != other_seed[:, :3, 3]).all()


def test_turns_are_rotations_that_favour_no_direction() -> None:
    rng = np.random.default_rng(0)
    turns = np.array([random_turn(rng) for _ in range(4000)])
    assert turns @ turns.transpose(0, 2, 1) == pytest.approx(
        np.broadcast_to(np.eye(3), (4000, 3, 3))
    )
    assert np.linalg.det(turns) == pytest.approx(np.ones(4000))
    # Each entry of a uniform rotation has mean 0 and mean square 1/3.
    assert np.abs(turns.mean(0)).max() < 0.04
    assert np.abs((turns**2).mean(0) - 1 / 3).max() < 0.03


def test_the_mean_outline_of_a_turned_box_is_a_quarter_of_its_surface() -> None:
    quads = quads_of([-0.5, -0.3, -0.1], [0.5, 0.3, 0.1])
    corners = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    assert mean_shadow_m2(corners) == pytest.approx((0.6 + 0.2 + 0.12) / 3, rel=0.05)
    rng = np.random.default_rng(0)
    areas = [mean_shadow_m2(corners @ random_turn(rng).T) for _ in range(60)]
    # Cauchy's formula for convex bodies.
    assert np.mean(areas) == pytest.approx(2 * (0.6 + 0.2 + 0.12) / 4, rel=0.04)


def test_outlines_for_a_share_follow_from_the_surface_of_the_room() -> None:
    surface = 2 * (WIDTH * DEPTH + WIDTH * HEIGHT + DEPTH * HEIGHT)
    area = shadow_for_share(room(), 0.3)
    assert 1 - np.exp(-4 * area / surface) == pytest.approx(0.3)
    assert shadow_for_share(room(), 0.0) == 0
