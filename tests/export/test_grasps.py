"""Pairs of contacts on the surface, outermost, within the friction cones; only for small loose items."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import trimesh

from pbrs_farm.export.export_homes import export_house
from pbrs_farm.export.grasps import FRICTION, antipodal_pairs
from tests.inputs.loose_items import loose, small_home

CYLINDER = trimesh.creation.cylinder(0.035, 0.2, sections=64)
MUG = trimesh.creation.annulus(0.035, 0.04, 0.1, sections=48)
CONE = trimesh.creation.cone(0.02, 0.1, sections=64)


@pytest.mark.parametrize("mesh", [CYLINDER, MUG, CONE, trimesh.creation.icosphere(3, 0.04)])
@pytest.mark.parametrize("sign", [1, -1])
def test_pairs_lie_on_the_mesh_and_hold_it(mesh: trimesh.Trimesh, sign: int) -> None:
    # For either winding of its faces.
    pairs = antipodal_pairs(np.array(mesh.triangles)[:, ::sign], 3)
    assert len(pairs.points) > 5
    for end in pairs.points.reshape(-1, 3):
        near = trimesh.triangles.closest_point(mesh.triangles, np.tile(end, (len(mesh.faces), 1)))
        assert np.linalg.norm(near - end, axis=1).min() < 1e-6
    for (a, b), (normal_a, normal_b) in zip(pairs.points, pairs.normals, strict=True):
        line = (b - a) / np.linalg.norm(b - a)
        # A finger pushing along the line does not slip at either contact.
        for inwards, normal in ((line, normal_a), (-line, normal_b)):
            push = -inwards @ normal
            assert push > 0
            assert np.linalg.norm(inwards + push * normal) <= FRICTION * push + 1e-9
            assert np.linalg.norm(normal) == pytest.approx(1)
        # No part of the item is beyond either contact.
        for end, way in ((a, -line), (b, line)):
            assert not mesh.ray.intersects_any([end + 1e-4 * way], [way])[0]


def test_a_box_is_held_by_faces_that_lie_across_and_not_along_its_length() -> None:
    box = trimesh.creation.box((0.05, 0.2, 0.08))
    pairs = antipodal_pairs(np.array(box.triangles), 1, most=200)
    across = (pairs.points[:, 0] - pairs.points[:, 1]) * pairs.normals[:, 0]
    assert set(across.sum(1).round(6)) == {0.05, 0.08}
    axes = np.abs(pairs.normals).argmax(2)
    assert (axes[:, 0] == axes[:, 1]).all()
    assert set(axes.ravel()) == {0, 2}
    assert (pairs.normals.sum(1) == 0).all()


@pytest.mark.parametrize(("form", "up"), [("urdf", 2), ("sdf", 2), ("habitat", 1)])
def test_a_home_has_grasps_of_its_small_loose_items(tmp_path: Path, form: str, up: int) -> None:
    house = small_home(
        loose("mug", (1, 0, 1), (1.08, 0.1, 1.08)), loose("crate", (0, 0, 0), (0.4, 0.3, 0.4)),
        loose("lamp", (1, 1.9, 1), (1.1, 2, 1.1)),
    )  # fmt: skip
    n_files = export_house(house, tmp_path, form)
    assert n_files == sum(p.is_file() for p in tmp_path.rglob("*"))
    grasps = json.loads((tmp_path / "grasps.json").read_text())
    assert list(grasps["things"]) == ["mug"]
    assert grasps["up"] == "xyz"[up]
    points = np.array([row["points"] for row in grasps["things"]["mug"]["grasps"]])
    level = [k for k in range(3) if k != up]
    # The frame's origin is the middle of its bottom.
    assert points[..., up].min() >= -1e-6
    assert points[..., up].max() == pytest.approx(0.1, abs=0.02)
    assert np.abs(points[..., level]).max() == pytest.approx(0.04, abs=1e-5)
