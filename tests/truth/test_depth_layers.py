"""All surfaces along a ray, and the holes of depth sensors, against closed forms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pbrs_farm import truth
from pbrs_farm.truth.sensor_reading import Hole
from tests.inputs.label_inputs import label_inputs_of
from tests.inputs.layered_homes import (
    BLACK,
    GLASS,
    MIRROR,
    NAMES,
    PANE,
    WALL,
    home_of,
    layers_of,
    sheet,
    solid,
    wrong_pixels,
)
from tests.truth.hits import camera, square


@pytest.mark.parametrize(
    ("surfaces", "expected"),
    [
        # (depth in mm, instance, clear) of each surface along the axis.
        ([sheet(2, 1, PANE), sheet(3, 10, WALL)], [(2000, 1, 255), (3000, 2, 0)]),
        (
            [sheet(2, 1, PANE), sheet(2.5, 1, PANE), sheet(3, 10, WALL)],
            [(2000, 1, 255), (2500, 2, 255), (3000, 3, 0)],
        ),
        (
            [solid(1, 1.5, 0.5, GLASS), sheet(3, 10, WALL)],
            [(1000, 1, 255), (1500, 1, 255), (3000, 2, 0)],
        ),
        # A wall of 10 cm has a front and a back; surfaces behind an opaque one count.
        ([solid(2, 2.1, 5, WALL), sheet(3, 10, PANE)], [(2000, 1, 0), (2100, 1, 0), (3000, 2, 255)]),
        # Two solids that touch: the shared plane is one surface.
        ([solid(1, 2, 0.5, WALL), solid(2, 3, 0.5, WALL)], [(1000, 1, 0), (2000, None, 0), (3000, 2, 0)]),
        # Eight of ten.
        ([sheet(1 + k / 2, 9, WALL) for k in range(10)], [(1000 + 500 * k, k + 1, 0) for k in range(8)]),
        # 0.1 mm apart along the ray they are one, a millimetre apart two.
        ([sheet(2, 9, WALL), sheet(2.00009, 9, WALL), sheet(2.001, 9, WALL)], [(2000, 1, 0), (2001, 3, 0)]),
    ],
)  # fmt: skip
def test_the_surfaces_along_the_axis_are_those_of_the_closed_form(surfaces, expected) -> None:
    layers = layers_of(home_of(*surfaces))
    depth, semantic, instance, clear = (layers[name][3, 4] for name in NAMES)
    n = len(expected)
    assert depth[:n].tolist() == [row[0] for row in expected]
    assert clear[:n].tolist() == [row[2] for row in expected]
    assert all(row[1] in (None, i) for row, i in zip(expected, instance, strict=False))
    assert (semantic == instance).all()
    for values in (depth, instance, clear):
        assert not values[n:].any()


def test_every_pixel_of_panes_boxes_and_walls_is_exact() -> None:
    assert wrong_pixels(64, 48) == 0


def test_holes_of_clear_mirrored_and_dark_surfaces() -> None:
    for material, distance, expected in (
        (GLASS, 2.0, Hole.CLEAR),
        (PANE, 2.0, Hole.CLEAR),
        (MIRROR, 2.0, Hole.MIRROR),
        (WALL, 2.0, Hole.READING),
        (BLACK, 3.0, Hole.TOO_DARK),
        (BLACK, 0.6, Hole.READING),
        (WALL, 0.3, Hole.TOO_NEAR),
        (WALL, 30.0, Hole.TOO_FAR),
    ):
        home = home_of(sheet(distance, 100, material))
        for name in ("", "_tof", "_azure"):
            pair = layers_of(home, (f"depth_hole{name}", f"depth_sensor{name}"))
            hole, measured = pair.values()
            assert hole[3, 4] == expected, (name, material, distance)
            assert (hole[measured == 0] > 0).all()
    # A D435 searches 126 px: 447 px 5 cm / 126 px = 17.7 cm.
    near = layers_of(home_of(sheet(0.15, 10, WALL)), ["depth_hole_stereo"])
    assert (near["depth_hole_stereo"][:, -1] == Hole.TOO_NEAR).all()


def test_holes_of_edges_shadows_and_slants() -> None:
    home = home_of(sheet(1, 0.5, WALL), sheet(3, 10, WALL))
    inputs = label_inputs_of(home, camera(320, 40))
    azure, kinect = truth.optional_layers(["depth_hole_azure", "depth_hole"], inputs).values()
    # The near square is 160 px wide, from column 80; 8 px beside it are hidden from the projector.
    assert azure[20, 79:81].tolist() == [Hole.EDGE] * 2
    assert (kinect[12:28, 75:79] == Hole.SHADOW).mean() > 0.8
    assert not kinect[12:28, 90:230].any()
    floor = replace(square(0, 100), positions=square(0, 100).positions[:, [0, 2, 1]] - [0, 0.1, 0])
    slant = layers_of(
        home_of(replace(floor, positions=floor.positions.astype(np.float32), material=WALL)),
        ["depth_hole"],
    )
    assert Hole.TOO_FAR in slant["depth_hole"]
