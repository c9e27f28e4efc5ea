"""Kinds of surface, and the mean angle of each part of the pixels."""

from __future__ import annotations

import numpy as np
import pytest

from pbrs_farm.study.metrics.error_parts import PARTS, ErrorParts, surface_kinds


def _normal(elevation_deg: float, azimuth_deg: float) -> list[float]:
    """x right, y down, z forward: azimuth from the direction towards the camera."""
    e, a = np.radians([elevation_deg, azimuth_deg])
    return [np.cos(e) * np.sin(a), -np.sin(e), -np.cos(e) * np.cos(a)]


@pytest.mark.parametrize(
    ("elevation", "azimuth", "kind"),
    [
        (90, 0, "up"), (46, 70, "up"), (-80, 0, "down"), (0, 0, "frontal"), (20, -29, "frontal"),
        (-20, 31, "oblique"), (0, -89, "oblique"), (35, 0, "slanted"), (-40, 80, "slanted"),
    ],
)  # fmt: skip
def test_a_normal_is_of_one_kind(elevation: float, azimuth: float, kind: str) -> None:
    kinds = surface_kinds(np.array(_normal(elevation, azimuth)))
    assert [name for name, mask in kinds.items() if mask] == [kind]


def test_each_pixel_is_of_one_kind() -> None:
    normals = np.random.default_rng(0).normal(size=(500, 3))
    normals[0] = 0
    assert (np.sum(list(surface_kinds(normals).values()), axis=0) == 1).all()


def test_each_part_has_the_mean_of_its_pixels() -> None:
    # Four pixels: a correct floor, a wall wrong by 90 degrees, another without depth, an invalid
    # one.
    up, wall = _normal(90, 0), _normal(0, 0)
    truth = {
        "normal": np.array([[up, wall], [wall, wall]]),
        "valid": np.array([[True, True], [True, False]]),
        "depth": np.array([[1.0, 3.0], [0.0, 9.0]]),
    }
    predicted = np.array([[up, up], [wall, up]])
    colour = np.zeros((2, 2, 3), np.uint8)
    colour[0, 1] = 255
    parts = ErrorParts()
    parts.add(predicted, truth, colour)
    means, shares = parts.means_deg(), parts.shares()
    assert means == pytest.approx(
        {"up": 0, "frontal": 45, "nearer than 2 m": 0, "2 to 4 m": 90, "luma below 0.25": 0, "luma above 0.6": 90}
    )  # fmt: skip
    assert shares["up"] == pytest.approx(1 / 3)
    assert shares["farther than 4 m"] == 0
    assert set(shares) == set(PARTS)


def test_views_without_depth_have_no_part_of_it() -> None:
    truth = {"normal": np.array([[_normal(90, 0)]]), "valid": np.ones((1, 1), bool)}
    parts = ErrorParts()
    parts.add(np.array([[_normal(60, 0)]]), truth, np.full((4, 4, 3), 100, np.uint8))
    assert parts.means_deg() == pytest.approx({"up": 30, "luma 0.25 to 0.6": 30})
