"""Laser scans in rooms whose answers are known: walls, a pane, mirrors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pbrs_farm.core.house import House, Item, ItemKind, Material, MaterialKind, Surface, Texture
from pbrs_farm.raycast.caster import Caster
from pbrs_farm.truth.lidar import (
    GLASS_TRANSMISSION,
    LIDARS,
    MIRROR_REFLECTANCE,
    LidarScan,
    LidarSensor,
    lidar_scan,
)
from tests.truth.hits import house

EXACT = LidarSensor("exact", (-10.0, 0.0, 10.0), 1.0, 0.1, 50.0, 0.0)
# World from scanner: at the middle of the room, forward is the world's -z, up its y.
POSE = np.array([[0, -1, 0, 0], [0, 0, 1, 1.5], [-1, 0, 0, 0], [0, 0, 0, 1.0]])
FORWARD, LEFT, BACK = 0, 90, 180  # of a ring's beams


def rectangle(corner, a, b, material: int = 0) -> Surface:
    """A rectangle from a corner along two edges, with texture coordinates."""
    corner, a, b = (np.array(v, np.float32) for v in (corner, a, b))
    points = np.stack([corner, corner + a, corner + a + b, corner + b])
    faces = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    uvs = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32)
    return Surface("r", points, faces, material, uvs)


def room(*more: Surface, materials: tuple[Material, ...] = ()) -> House:
    """Walls at x = -2, 2 and z = -2, 2, 3 m high, an item each, without floor; more items stand in it."""
    walls = (
        rectangle((-2, 0, -2), (4, 0, 0), (0, 3, 0)), rectangle((-2, 0, -2), (0, 0, 4), (0, 3, 0)),
        rectangle((-2, 0, 2), (4, 0, 0), (0, 3, 0)), rectangle((2, 0, -2), (0, 0, 4), (0, 3, 0)),
    )  # fmt: skip
    items = tuple(
        Item(f"i{k}", f"thing {k}", ItemKind.OBJECT, "0", (surface,), nyu40=k + 1)
        for k, surface in enumerate((*walls, *more))
    )
    base = house(1)
    return replace(base, items=items, materials=(Material("wall", diffuse=(0.5,) * 3), *materials))


def scan(
    of: House, sensor: LidarSensor = EXACT, pose=POSE, textures=None, seed: int = 0
) -> LidarScan:
    return lidar_scan(Caster.of_house(of), of, pose, sensor, textures or {}, seed=seed)


def ring(found: LidarScan, number: int = 1) -> np.ndarray:
    """Which returns are of a ring, of all 360 beams."""
    own = np.flatnonzero(found.ring == number)
    assert len(own) == 360
    return own


def test_ranges_are_those_of_the_walls() -> None:
    found = scan(room())
    own = ring(found)
    azimuth = np.radians(np.arange(360))
    wanted = 2 / np.maximum(np.abs(np.cos(azimuth)), np.abs(np.sin(azimuth)))
    np.testing.assert_allclose(found.range_m[own], wanted, atol=1e-6)
    np.testing.assert_allclose(found.points[own][FORWARD], [2, 0, 0], atol=1e-6)
    np.testing.assert_allclose(found.points[own][LEFT], [0, 2, 0], atol=1e-6)
    # A ring 10 degrees up lies on a cone.
    high = ring(found, 2)
    np.testing.assert_allclose(found.range_m[high], wanted / np.cos(np.radians(10)), atol=1e-6)
    up = found.points[high][:, 2] / np.linalg.norm(found.points[high], axis=1)
    np.testing.assert_allclose(up, np.sin(np.radians(10)), atol=1e-9)


def test_labels_normals_and_intensity_are_those_of_the_surface() -> None:
    found = scan(room())
    own = ring(found)
    # Forward is -z: the first wall; left of it is -x, the second.
    assert found.instance[own][[FORWARD, LEFT, BACK, 270]].tolist() == [1, 2, 3, 4]
    assert (found.label == found.instance).all()
    np.testing.assert_allclose(found.normals[own][FORWARD], [-1, 0, 0], atol=1e-6)
    np.testing.assert_allclose(found.normals[own][LEFT], [0, -1, 0], atol=1e-6)
    reflectance = ((0.5 + 0.055) / 1.055) ** 2.4  # sRGB
    np.testing.assert_allclose(found.intensity[own][FORWARD], reflectance, rtol=1e-5)
    wanted = reflectance * np.cos(np.radians(30))
    np.testing.assert_allclose(found.intensity[own][30], wanted, rtol=1e-5)
    assert not found.through.any()
    assert not found.mirrored.any()
    assert not found.via.any()


def test_intensity_follows_the_picture_on_a_surface() -> None:
    halves = np.zeros((1, 2, 3), np.uint8)
    halves[0, 1] = 255
    texture = Texture("t", "t", "image/png", b"")
    base = room()
    wall = Material("wall", texture_id="t")
    painted = replace(base, materials=(wall,), textures={"t": texture})
    found = scan(painted, textures={"t": halves})
    own = ring(found)
    # Of the wall ahead u runs to the right: black on the left, white on the right; beyond the middle
    # of the black texel a little of the white one, repeated.
    u = (2 - 2 * np.tan(np.radians(30))) / 4
    wanted = (0.5 - 2 * u) * np.cos(np.radians(30))
    assert found.intensity[own][30] == pytest.approx(wanted, rel=1e-4)
    assert found.intensity[own][330] == pytest.approx(np.cos(np.radians(30)) - wanted, rel=1e-4)


def test_a_beam_goes_through_a_pane_and_sees_the_wall_behind() -> None:
    pane = rectangle((-0.5, 0, -1), (1, 0, 0), (0, 3, 0), material=1)
    found = scan(room(pane, materials=(Material("pane", MaterialKind.PANE),)))
    own = ring(found)
    assert found.range_m[own][FORWARD] == pytest.approx(2, abs=1e-5)
    assert found.instance[own][FORWARD] == 1
    assert (found.through[own][FORWARD], found.via[own][FORWARD]) == (1, 5)
    plain = scan(room())
    left = found.intensity[own][FORWARD] / plain.intensity[ring(plain)][FORWARD]
    assert left == pytest.approx(GLASS_TRANSMISSION**2, rel=1e-5)
    # Beside it nothing changes.
    assert (found.through[own][BACK], found.via[own][BACK]) == (0, 0)


def test_what_a_mirror_shows_is_measured_behind_it() -> None:
    mirror = rectangle((-0.5, 0, -1), (1, 0, 0), (0, 3, 0), material=1)
    found = scan(room(mirror, materials=(Material("mirror", MaterialKind.MIRROR),)))
    own = ring(found)
    # One metre to the mirror, three back to the wall behind the scanner.
    assert found.range_m[own][FORWARD] == pytest.approx(4, abs=1e-4)
    np.testing.assert_allclose(found.points[own][FORWARD], [4, 0, 0], atol=1e-3)
    assert found.instance[own][FORWARD] == 3
    assert (found.mirrored[own][FORWARD], found.via[own][FORWARD]) == (1, 5)
    # The wall that seems to be there faces the scanner.
    np.testing.assert_allclose(found.normals[own][FORWARD], [-1, 0, 0], atol=1e-6)
    plain = scan(room())
    left = found.intensity[own][FORWARD] / plain.intensity[ring(plain)][BACK]
    assert left == pytest.approx(MIRROR_REFLECTANCE**2, rel=1e-5)
    # Slanting: the same as without the mirror to where the room behind it seems to be, at z = -4.
    tilted = found.points[own][20]
    assert tilted[0] == pytest.approx(4, abs=1e-3)
    np.testing.assert_allclose(found.normals[own][20], [-1, 0, 0], atol=1e-6)


def test_between_two_mirrors_a_beam_ends_without_a_return() -> None:
    mirrors = (
        rectangle((-0.5, 0, -1), (1, 0, 0), (0, 3, 0), 1),
        rectangle((-0.5, 0, 1), (1, 0, 0), (0, 3, 0), 1),
    )
    found = scan(room(*mirrors, materials=(Material("mirror", MaterialKind.MIRROR),)))
    assert (found.ring == 1).sum() < 360
    assert found.mirrored.max() > 1


def test_noise_is_the_sensors_and_what_is_out_of_reach_is_not_there() -> None:
    noisy = replace(EXACT, noise_m=0.02, noise_share=0.01, elevations_deg=(0.0,), step_deg=0.1)
    found = scan(room(), noisy, seed=3)
    errors = (found.range_m - found.true_range_m) / (0.02 + 0.01 * found.true_range_m)
    assert np.abs(errors.mean()) < 0.06
    assert errors.std() == pytest.approx(1, abs=0.05)
    assert (scan(room(), noisy, seed=3).range_m == found.range_m).all()
    near = scan(room(), replace(EXACT, farthest_m=2.2))
    assert near.range_m.max() <= 2.2
    assert not len(scan(room(), replace(EXACT, nearest_m=3.0)).ring)
    assert not len(scan(replace(house(), items=())).ring)


def test_scanners_have_the_rings_of_their_sheets() -> None:
    assert {name: len(s.elevations_deg) for name, s in LIDARS.items()} == {
        "rplidar_a1": 1, "rplidar_a3": 1, "vlp16": 16, "hdl32": 32, "hdl64": 64, "os1_64": 64,
    }  # fmt: skip
    np.testing.assert_allclose(np.diff(LIDARS["vlp16"].elevations_deg), 2)
    for sensor in LIDARS.values():
        directions = sensor.directions()
        assert len(directions) == sensor.n_beams
        np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1)
