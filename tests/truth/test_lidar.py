"""Laser scans in rooms with known answers: walls, a pane, mirrors."""

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
# World from scanner: in the middle of the room, forward is the world's -z, up its y.
POSE = np.array([[0, -1, 0, 0], [0, 0, 1, 1.5], [-1, 0, 0, 0], [0, 0, 0, 1.0]])
FORWARD, LEFT, BACK = 0, 90, 180  # beam indices of a ring


def rectangle(corner, a, b, material: int = 0) -> Surface:
    """A rectangle from a corner along two edges, with texture coordinates."""
    corner, a, b = (np.array(v, np.float32) for v in (corner, a, b))
    points = np.stack([corner, corner + a, corner + a + b, corner + b])
    faces = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    uvs = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32)
    return Surface("r", points, faces, material, uvs)


def room(*more: Surface, materials: tuple[Material, ...] = ()) -> House:
    """Walls at x = -2, 2 and z = -2, 2, 3 m high, one item each, without a floor, plus one item per `more`."""
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
    """Indices of the returns of one ring of 360 beams."""
    indices = np.flatnonzero(found.ring == number)
    assert len(indices) == 360
    return indices


def test_ranges_are_those_of_the_walls() -> None:
    measured = scan(room())
    beams = ring(measured)
    azimuth = np.radians(np.arange(360))
    ranges = 2 / np.maximum(np.abs(np.cos(azimuth)), np.abs(np.sin(azimuth)))
    np.testing.assert_allclose(measured.range_m[beams], ranges, atol=1e-6)
    np.testing.assert_allclose(measured.points[beams][FORWARD], [2, 0, 0], atol=1e-6)
    np.testing.assert_allclose(measured.points[beams][LEFT], [0, 2, 0], atol=1e-6)
    # A ring 10 degrees up is a cone.
    high = ring(measured, 2)
    np.testing.assert_allclose(measured.range_m[high], ranges / np.cos(np.radians(10)), atol=1e-6)
    up = measured.points[high][:, 2] / np.linalg.norm(measured.points[high], axis=1)
    np.testing.assert_allclose(up, np.sin(np.radians(10)), atol=1e-9)


def test_labels_normals_and_intensity_are_those_of_the_surface() -> None:
    measured = scan(room())
    beams = ring(measured)
    # Forward is -z, the first wall; left is -x, the second.
    assert measured.instance[beams][[FORWARD, LEFT, BACK, 270]].tolist() == [1, 2, 3, 4]
    assert (measured.label == measured.instance).all()
    np.testing.assert_allclose(measured.normals[beams][FORWARD], [-1, 0, 0], atol=1e-6)
    np.testing.assert_allclose(measured.normals[beams][LEFT], [0, -1, 0], atol=1e-6)
    reflectance = ((0.5 + 0.055) / 1.055) ** 2.4  # sRGB
    np.testing.assert_allclose(measured.intensity[beams][FORWARD], reflectance, rtol=1e-5)
    intensity = reflectance * np.cos(np.radians(30))
    np.testing.assert_allclose(measured.intensity[beams][30], intensity, rtol=1e-5)
    assert not measured.through.any()
    assert not measured.mirrored.any()
    assert not measured.via.any()


def test_intensity_follows_the_picture_on_a_surface() -> None:
    halves = np.zeros((1, 2, 3), np.uint8)
    halves[0, 1] = 255
    texture = Texture("t", "t", "image/png", b"")
    base = room()
    wall = Material("wall", texture_id="t")
    painted = replace(base, materials=(wall,), textures={"t": texture})
    measured = scan(painted, textures={"t": halves})
    beams = ring(measured)
    # On the wall ahead u runs to the right: black on the left, white on the right; beyond the
    # middle of the black texel it mixes with the repeated white one.
    u = (2 - 2 * np.tan(np.radians(30))) / 4
    intensity = (0.5 - 2 * u) * np.cos(np.radians(30))
    assert measured.intensity[beams][30] == pytest.approx(intensity, rel=1e-4)
    assert measured.intensity[beams][330] == pytest.approx(
        np.cos(np.radians(30)) - intensity, rel=1e-4
    )


def test_a_beam_goes_through_a_pane_and_sees_the_wall_behind() -> None:
    pane = rectangle((-0.5, 0, -1), (1, 0, 0), (0, 3, 0), material=1)
    measured = scan(room(pane, materials=(Material("pane", MaterialKind.PANE),)))
    beams = ring(measured)
    assert measured.range_m[beams][FORWARD] == pytest.approx(2, abs=1e-5)
    assert measured.instance[beams][FORWARD] == 1
    assert (measured.through[beams][FORWARD], measured.via[beams][FORWARD]) == (1, 5)
    plain = scan(room())
    transmitted = measured.intensity[beams][FORWARD] / plain.intensity[ring(plain)][FORWARD]
    assert transmitted == pytest.approx(GLASS_TRANSMISSION**2, rel=1e-5)
    # Other beams are unchanged.
    assert (measured.through[beams][BACK], measured.via[beams][BACK]) == (0, 0)


def test_mirrored_surfaces_are_measured_behind_the_mirror() -> None:
    mirror = rectangle((-0.5, 0, -1), (1, 0, 0), (0, 3, 0), material=1)
    measured = scan(room(mirror, materials=(Material("mirror", MaterialKind.MIRROR),)))
    beams = ring(measured)
    # One metre to the mirror, three back to the wall behind the scanner.
    assert measured.range_m[beams][FORWARD] == pytest.approx(4, abs=1e-4)
    np.testing.assert_allclose(measured.points[beams][FORWARD], [4, 0, 0], atol=1e-3)
    assert measured.instance[beams][FORWARD] == 3
    assert (measured.mirrored[beams][FORWARD], measured.via[beams][FORWARD]) == (1, 5)
    # The mirrored wall faces the scanner.
    np.testing.assert_allclose(measured.normals[beams][FORWARD], [-1, 0, 0], atol=1e-6)
    plain = scan(room())
    reflected = measured.intensity[beams][FORWARD] / plain.intensity[ring(plain)][BACK]
    assert reflected == pytest.approx(MIRROR_REFLECTANCE**2, rel=1e-5)
    # A slanting beam reaches the mirrored room's wall at z = -4, at the same range as without the
    # mirror.
    tilted = measured.points[beams][20]
    assert tilted[0] == pytest.approx(4, abs=1e-3)
    np.testing.assert_allclose(measured.normals[beams][20], [-1, 0, 0], atol=1e-6)


def test_between_two_mirrors_a_beam_ends_without_a_return() -> None:
    mirrors = (
        rectangle((-0.5, 0, -1), (1, 0, 0), (0, 3, 0), 1),
        rectangle((-0.5, 0, 1), (1, 0, 0), (0, 3, 0), 1),
    )
    measured = scan(room(*mirrors, materials=(Material("mirror", MaterialKind.MIRROR),)))
    assert (measured.ring == 1).sum() < 360
    assert measured.mirrored.max() > 1


def test_noise_follows_the_sensor_and_points_out_of_range_are_missing() -> None:
    noisy = replace(EXACT, noise_m=0.02, noise_share=0.01, elevations_deg=(0.0,), step_deg=0.1)
    measured = scan(room(), noisy, seed=3)
    errors = (measured.range_m - measured.true_range_m) / (0.02 + 0.01 * measured.true_range_m)
    assert np.abs(errors.mean()) < 0.06
    assert errors.std() == pytest.approx(1, abs=0.05)
    assert (scan(room(), noisy, seed=3).range_m == measured.range_m).all()
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
