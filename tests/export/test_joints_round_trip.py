"""A home with its doors and drawers half open, exported and read back: joints, limits, axes and poses."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pbrs_farm.core.classes import NYU40_NAMES
from pbrs_farm.core.house import House, Item
from pbrs_farm.core.joints import JointKind
from pbrs_farm.core.recipe import ReadFields
from pbrs_farm.export.export_homes import export_house
from pbrs_farm.geometry.opened import item_at
from pbrs_farm.prepare.read_source import read_house
from pbrs_farm.prepare.source import resolve
from pbrs_farm.read.builtin.builtin_home import builtin_home
from tests.inputs.cupboards import cupboard

FILES = {"usd": "*.usd*", "mjcf": "*.xml", "habitat": "*.scene_instance.json",
         "urdf": "*.urdf", "sdf": "*.sdf"}  # fmt: skip
WITHOUT_STATE = ("urdf", "sdf")


def half_open() -> House:
    """The built-in home with two cupboards, of a door and of a drawer, all at half of their range.

    Its furniture without joints is left out, which would take half of the time.
    """
    home = builtin_home()
    kept = [item for item in home.items if item.joints or not item.id.startswith("piece_")]
    items = []
    cupboards = (
        replace(cupboard(kind, x, kind.value), nyu40=NYU40_NAMES.index("cabinet"))
        for kind, x in ((JointKind.REVOLUTE, 1.0), (JointKind.PRISMATIC, 2.5))
    )
    for item in (*kept, *cupboards):
        opened = item
        for joint in item.joints:
            opened = item_at(opened, joint.part, joint.upper / 2)
        items.append(opened)
    return replace(home, items=tuple(items))


def shut(item: Item) -> Item:
    for joint in item.joints:
        item = item_at(item, joint.part, 0.0)
    return item


@pytest.mark.parametrize("form", FILES)
def test_joints_come_back_with_limits_axes_and_poses(tmp_path: Path, form: str) -> None:
    home = half_open()
    export_house(home, tmp_path / "home", form)
    path = next((tmp_path / "home").rglob(FILES[form]))
    back = read_house(resolve(str(path)), ReadFields())
    remarks = tmp_path / "home/remarks.txt"
    if form in WITHOUT_STATE:
        n_joints = sum(len(item.joints) for item in home.items)
        assert f"{n_joints} open doors and drawers are shut" in remarks.read_text()
        home = replace(home, items=tuple(map(shut, home.items)))
    expected = [(item, joint) for item in home.items for joint in item.joints]
    found = [(item, joint) for item in back.items for joint in item.joints]
    assert len(found) == len(expected)
    for item, joint in expected:
        near = [row for row in found if row[1].kind is joint.kind]
        other, got = min(near, key=lambda row: np.abs(row[0].bounds - item.bounds).max())
        np.testing.assert_allclose(other.bounds, item.bounds, atol=2e-3)
        np.testing.assert_allclose(got.axis, joint.axis, atol=1e-5)
        limits = (got.lower, got.upper, got.value)
        np.testing.assert_allclose(limits, (joint.lower, joint.upper, joint.value), atol=1e-4)
        # Its axis is the same line.
        between = np.cross(np.subtract(got.point, joint.point), joint.axis)
        if joint.kind == "revolute":
            assert np.linalg.norm(between) < 2e-3
        for name in (joint.part, got.part):
            assert name
        of_part = [np.vstack([s.positions for s in i.surfaces if s.part == p])
                   for i, p in ((item, joint.part), (other, got.part))]  # fmt: skip
        np.testing.assert_allclose(of_part[0].min(0), of_part[1].min(0), atol=2e-3)
        np.testing.assert_allclose(of_part[0].max(0), of_part[1].max(0), atol=2e-3)
