"""The check of depth_layers where triangles coincide, alone and with every pixel."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pbrs_farm.check import layered_checks, verify
from pbrs_farm.check.certificate import Count
from pbrs_farm.core.house import House
from tests.check.perforated_homes import MATERIALS, screen, screened, with_frame_in_wall
from tests.check.roots import make_root, views_of

pytestmark = pytest.mark.quick(2)


def judged(root: Path, home: House, monkeypatch: pytest.MonkeyPatch) -> Count:
    """The count of the check in the home's first view, no other check done."""
    name, camera = next(iter(views_of(home).items()))
    make_root(root, home, {name: camera}, with_optional=True)
    only = {"view": layered_checks.CHECKS}
    monkeypatch.setattr(
        sys.modules["pbrs_farm.check.verify"], "checks", lambda of: only.get(of, ())
    )
    return verify(root, all_pixels=True).counts["depth layers"]


def test_any_number_of_pixels_may_show_coincident_surfaces(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    count = judged(tmp_path, with_frame_in_wall(0.0), monkeypatch)
    assert count.ties > 3000
    assert count.failed == 0


def test_a_surface_may_be_missing_in_the_hole_of_another(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    home = screened(MATERIALS["leaf"])
    camera = next(iter(views_of(home).values()))
    leaf = home.items[-1].surfaces[0]
    # Other corners in the same plane: casters meet either leaf first, by rounding.
    middle = leaf.positions.mean(0)
    larger = middle + np.float32(1.3) * (leaf.positions - middle)
    moved = replace(leaf, positions=larger)
    opaque = screen(camera, 0.3, 0)
    item = replace(home.items[-1], surfaces=(opaque, leaf, moved))
    count = judged(tmp_path, home.with_items([*home.items[:-1], item]), monkeypatch)
    assert count.failed == 0
