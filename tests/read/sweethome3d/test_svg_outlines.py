"""SVG paths as outlines."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely

from pbrs_farm.read.sweethome3d.door_cutouts import polygons_from_path


def area(path: str) -> float:
    return sum(shapely.Polygon(p).area for p in polygons_from_path(path))


@pytest.mark.parametrize(
    ("path", "expected"),
    [
        ("M0,0 v1 h1 v-1 z", 1.0),
        ("m0 0 0 1 1 0 0-1z", 1.0),
        ("M0 0 L1 0 1 1 0 1", 1.0),
        ("M0,0H1V1H0Z", 1.0),
        ("M.25.25h.5v.5h-.5z", 0.25),
        ("M0,0 h1 v1 h-1 z m2,0 h1 v1 h-1 z", 2.0),
        ("M0,0 q.5,1 1,0 z", 1 / 3),
        ("M0,0 c0,1 1,1 1,0 z", 0.6),
        ("M0 0 0 1 1 1 1 0z L0 -1 1 -1 1 0 z", 2.0),
        ("M0,0H1.V1.H0z", 1.0),
        # Flags of an arc need no separator, and a repeated arc needs no letter.
        ("M0 .5a.5.5 0 111 0 .5.5 0 11-1 0z", math.pi / 4),
        # S and T reflect the control point before them; after a curve of another kind they do not.
        ("M0,0 c0,.5 .5,.5 .5,0 s.5,-.5 .5,0 l0,1 -1,0 z", 1.0),
        ("M0,0 q.25,.5 .5,0 t.5,0 l0,1 -1,0 z", 1.0),
        ("M0,0 c0,1 .5,1 .5,0 t.5,0 l0,-1 -1,0 z", 1.3),
        ("M0,0 q.25,1 .5,0 s.5,.5 .5,0 l0,-1 -1,0 z", 1 + 1 / 6 + 0.075),
        # An arc without a radius is a line; one that ends at its start is nothing.
        ("M0,0 a0,0 0 0 1 1,0 a0,0 0 0 1 0,0 v1 h-1 z", 1.0),
    ],
)
def test_a_path_encloses_its_area(path: str, expected: float) -> None:
    assert area(path) == pytest.approx(expected, rel=0.01)


def test_arcs_are_round_and_end_at_their_end_points() -> None:
    (circle,) = polygons_from_path("M0,0.5 a0.5,0.5 0 1,0 1,0 a0.5,0.5 0 1,0 -1,0 z")
    assert np.linalg.norm(circle - 0.5, axis=1) == pytest.approx(0.5)
    assert shapely.Polygon(circle).area == pytest.approx(math.pi / 4, rel=4e-3)


def test_the_sweep_flag_chooses_the_side() -> None:
    (over,) = polygons_from_path("M0,1 A.5,.5 0 0 1 1,1 z")
    (under,) = polygons_from_path("M0,1 A.5,.5 0 0 0 1,1 z")
    assert over[:, 1].min() == pytest.approx(0.5)
    assert under[:, 1].max() == pytest.approx(1.5)


def test_an_arc_too_small_to_reach_is_grown() -> None:
    (half,) = polygons_from_path("M0,0 a.1,.1 0 0 1 1,0 z")
    assert shapely.Polygon(half).area == pytest.approx(math.pi / 8, rel=5e-3)
