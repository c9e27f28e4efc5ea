"""A home as a URDF read by MuJoCo: links at the items' places, joints that move like the home's."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree as ET

import mujoco
import numpy as np
import pytest

from pbrs_farm.core.house import ItemKind
from pbrs_farm.core.joints import JointKind
from pbrs_farm.export.export_homes import export_house
from pbrs_farm.geometry.opened import item_at
from tests.inputs.cupboards import box_item, cupboard
from tests.inputs.loose_items import loose, small_home


@pytest.mark.parametrize("kind", list(JointKind))
@pytest.mark.parametrize("stands_at", [0.0, 0.2])
def test_mujoco_reads_a_part_that_moves_as_the_homes_does(
    tmp_path: Path, kind: JointKind, stands_at: float
) -> None:
    shut = cupboard(kind)
    house = small_home(item_at(shut, "front", stands_at), loose("mug", (1, 0, 1), (1.1, 0.1, 1.1)))
    export_house(house, tmp_path, "urdf")
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "small.urdf"))
    state = mujoco.MjData(model)
    joint = model.joint("cupboard.front")
    assert joint.range == pytest.approx([0, shut.joints[0].upper])
    for value in (0.0, 0.3):
        state.qpos[joint.qposadr[0]] = value
        mujoco.mj_kinematics(model, state)
        (k, *_) = [k for k in range(model.ngeom)
                   if model.body(model.geom_bodyid[k]).name == "cupboard.front"]  # fmt: skip
        mesh = model.geom_dataid[k]
        first, n = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
        points = model.mesh_vert[first : first + n] @ state.geom_xmat[k].reshape(3, 3).T
        x, y, z = (points + state.geom_xpos[k]).T
        got = np.stack([x, z, -y], -1)
        expected = item_at(shut, "front", value).surfaces[1].positions
        assert got.min(0) == pytest.approx(expected.min(0), abs=1e-5)
        assert got.max(0) == pytest.approx(expected.max(0), abs=1e-5)


def test_a_floor_of_no_thickness_and_a_wall_with_a_doorway_load_and_stay_open(
    tmp_path: Path,
) -> None:
    home = small_home(
        replace(box_item("left", (-1, 0, 0), (-0.5, 2, 0.1)), kind=ItemKind.WALL),
        loose("mug", (1, 0, 1), (1.1, 0.1, 1.1)),
    )
    right = box_item("right", (0.5, 0, 0), (1, 2, 0.1)).surfaces
    floor, wall, *rest = home.items
    (top,) = floor.surfaces
    level = top.positions[top.faces][..., 1].min(1) > -0.01
    floor = replace(floor, surfaces=(replace(top, faces=top.faces[level]),))
    wall = replace(wall, surfaces=wall.surfaces + right)
    export_house(replace(home, items=(floor, wall, *rest)), tmp_path, "urdf")
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "small.urdf"))
    state = mujoco.MjData(model)
    mujoco.mj_forward(model, state)
    # A ray through the doorway, z up, hits nothing; one beside it hits the wall.
    for x, is_open in ((0.0, True), (0.7, False)):
        far = mujoco.mj_ray(
            model, state, np.array([x, 1.0, 1.0]), np.array([0, -1.0, 0]), None, 1, -1,
            np.zeros(1, np.int32),
        )  # fmt: skip
        assert (far < 0) == is_open


def test_every_file_exists_and_loose_items_float(tmp_path: Path) -> None:
    house = small_home(cupboard(JointKind.PRISMATIC), loose("mug", (1, 0, 1), (1.1, 0.1, 1.1)))
    n_files = export_house(house, tmp_path, "urdf")
    assert n_files == sum(p.is_file() for p in tmp_path.rglob("*"))
    root = ET.parse(tmp_path / "small.urdf").getroot()
    assert all((tmp_path / (m.get("filename") or "")).is_file() for m in root.iter("mesh"))
    kinds = {j.get("name"): j.get("type") for j in root.findall("joint")}
    assert kinds["cupboard.at"] == "fixed"
    assert kinds["cupboard.front"] == "prismatic"
    children = [child.get("link") for child in root.iter("child")]
    # Each link except the world has one joint.
    links = [link.get("name") for link in root.findall("link")]
    assert sorted(children, key=str) == sorted(set(links) - {"world"}, key=str)
    assert kinds["mug.at"] == "floating"
