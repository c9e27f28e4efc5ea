"""A home as a MuJoCo model loads, rests, and its drawers and doors move by their joints."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

from pbrs_farm.core.classes import NYU40_NAMES
from pbrs_farm.core.house import Box, House
from pbrs_farm.core.joints import Joint, JointKind
from pbrs_farm.export.export_homes import export_house
from pbrs_farm.export.forms.mjcf import FIXED
from pbrs_farm.geometry.opened import item_at
from tests.export.homes import repaired_home
from tests.inputs.cupboards import WIDE, cupboard
from tests.inputs.loose_items import loose, small_home


def model_of(house: House, folder: Path) -> Any:
    export_house(house, folder, "mjcf")
    return mujoco.MjModel.from_xml_path(str(folder / f"{house.id}.xml"))


def corners(model: Any, state: Any, body: str) -> np.ndarray:
    """Bounds in the world, y up, of a body's visual vertices."""
    vertices = []
    for k in range(model.ngeom):
        if model.body(model.geom_bodyid[k]).name == body and model.geom_group[k] == 2:
            mesh = model.geom_dataid[k]
            first, n = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
            points = model.mesh_vert[first : first + n] @ state.geom_xmat[k].reshape(3, 3).T
            vertices.append(points + state.geom_xpos[k])
    x, y, z = np.concatenate(vertices).T
    points = np.stack([x, z, -y], -1)
    return np.array([points.min(0), points.max(0)])


@pytest.mark.parametrize("kind", list(JointKind))
@pytest.mark.parametrize("stands_at", [0.0, 0.2])
def test_a_joint_moves_its_part_as_the_home_does(
    tmp_path: Path, kind: JointKind, stands_at: float
) -> None:
    shut = cupboard(kind)
    item = item_at(shut, "front", stands_at)
    model = model_of(small_home(item), tmp_path)
    state = mujoco.MjData(model)
    joint = model.joint("cupboard.front")
    assert joint.range == pytest.approx([0, shut.joints[0].upper])
    assert state.qpos[joint.qposadr[0]] == pytest.approx(stands_at)
    for value in (0.0, 0.3):
        state.qpos[joint.qposadr[0]] = value
        mujoco.mj_kinematics(model, state)
        expected = item_at(shut, "front", value).surfaces[1].positions
        got = corners(model, state, "cupboard.front")
        assert got == pytest.approx(np.array([expected.min(0), expected.max(0)]), abs=1e-5)


def push(model: Any, name: str, by: float, seconds: float = 3.0) -> float:
    state = mujoco.MjData(model)
    joint = model.joint(name)
    state.qfrc_applied[joint.dofadr[0]] = by
    for _ in range(int(seconds / model.opt.timestep)):
        mujoco.mj_step(model, state)
    return float(state.qpos[joint.qposadr[0]])


def test_a_drawer_runs_between_touching_fronts_and_hits_an_item_before_it(tmp_path: Path) -> None:
    # The neighbour's front is 3 mm away, less than the hulls' margin.
    drawers = cupboard(JointKind.PRISMATIC), cupboard(JointKind.PRISMATIC, WIDE, "neighbour")
    model = model_of(small_home(*drawers), tmp_path / "free")
    assert push(model, "cupboard.front", 20.0) == pytest.approx(0.4, abs=0.01)
    pillar = replace(loose("pillar", (0.1, 0, 0.22), (0.5, 1, 0.4)), nyu40=3)
    model = model_of(small_home(drawers[0], pillar), tmp_path / "met")
    assert push(model, "cupboard.front", 20.0) == pytest.approx(0.2, abs=0.01)


def test_loose_items_are_at_rest_and_hovering_ones_have_sunk(tmp_path: Path) -> None:
    house = small_home(
        loose("block", (0, 0.02, 0), (0.2, 0.22, 0.2)), loose("mug", (1, 0, 1), (1.08, 0.1, 1.08))
    )
    house = replace(house, items=tuple(replace(i, room_id="r") for i in house.items))
    model = model_of(house, tmp_path)
    state = mujoco.MjData(model)
    mujoco.mj_forward(model, state)
    before = state.xpos.copy()
    for _ in range(1000):
        mujoco.mj_step(model, state)
    assert np.abs(state.xpos - before).max() < 1e-3
    assert corners(model, state, "block")[0, 1] == pytest.approx(0, abs=1e-3)
    assert model.body("mug").dofnum[0] == 6


def test_overlapping_items_are_separated_and_at_rest(tmp_path: Path) -> None:
    # By 30 mm, like a chair's legs among a table's: unseparated, they would be thrown apart.
    table, chair = (
        loose("table", (0, 0, 0), (1, 0.7, 1)), loose("chair", (0.97, 0, 0.2), (1.4, 0.9, 0.6))
    )  # fmt: skip
    model = model_of(small_home(table, chair), tmp_path)
    state = mujoco.MjData(model)
    mujoco.mj_forward(model, state)
    before = state.xpos.copy()
    assert corners(model, state, "table")[1, 0] == pytest.approx(1, abs=2e-3)
    assert 0.03 <= corners(model, state, "chair")[0, 0] - 0.97 < 0.06
    for _ in range(500):
        mujoco.mj_step(model, state)
    assert np.abs(state.xpos - before).max() < 1e-3
    assert model.nv == 12


def motion(model: Any, seconds: float = 1.0) -> float:
    """Largest way of a body, metres."""
    state = mujoco.MjData(model)
    mujoco.mj_forward(model, state)
    before = state.xpos.copy()
    for _ in range(int(seconds / model.opt.timestep)):
        mujoco.mj_step(model, state)
    return float(np.abs(state.xpos - before).max())


def test_a_table_in_a_rug_is_lifted_with_its_contents(tmp_path: Path) -> None:
    rug = replace(loose("rug", (-1, 0, -1), (1, 0.01, 1)), nyu40=NYU40_NAMES.index("floor mat"))
    table, mug = (
        loose("table", (0, 0, 0), (0.6, 0.5, 0.6)),
        loose("mug", (0.2, 0.5, 0.2), (0.3, 0.6, 0.3)),
    )
    model = model_of(small_home(rug, table, mug), tmp_path)
    assert model.nv == 12
    assert motion(model) < 1e-3


def test_a_bed_and_its_duvet_are_joined_and_at_rest(tmp_path: Path) -> None:
    bed, top = (
        loose("bed", (0, 0, 0), (1, 0.5, 2)),
        loose("duvet", (-0.02, 0.48, 0.2), (1.02, 0.52, 2.02)),
    )
    sides = [loose("", (x, 0.1, 0.2), (x + 0.04, 0.52, 2.02)) for x in (-0.03, 0.99)]
    surfaces = (*top.surfaces, *(s for side in sides for s in side.surfaces))
    box = Box(np.array([0.5, 0.31, 1.11]), np.array([0.53, 0.21, 0.91]), np.eye(3))
    model = model_of(small_home(bed, replace(top, surfaces=surfaces, box=box)), tmp_path)
    assert (model.nv, model.neq) == (12, 1)
    assert motion(model) < 1e-3


def test_an_item_without_rest_is_named_in_the_model(tmp_path: Path) -> None:
    case = replace(loose("case", (0, 0, 0), (1, 1, 1)), nyu40=NYU40_NAMES.index("cabinet"))
    mug = loose("mug", (0.45, 0, 0.45), (0.55, 0.1, 0.55))
    model = model_of(small_home(case, mug), tmp_path)
    assert model.nv == 0
    k = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_TEXT, FIXED)
    start, size = model.text_adr[k], model.text_size[k]
    assert bytes(model.text_data[start : start + size]).rstrip(b"\0") == b"mug"
    assert "1 item did not come to rest and is fixed: mug" in (tmp_path / "remarks.txt").read_text()


@pytest.mark.long
def test_the_built_in_home_loads_with_its_textures_and_free_bodies(tmp_path: Path) -> None:
    house = repaired_home()
    model = model_of(house, tmp_path)
    assert model.ntex > 0
    is_free = model.jnt_type == mujoco.mjtJoint.mjJNT_FREE
    assert is_free.any()
    assert (model.body_mass[model.jnt_bodyid] > 0).all()


def test_a_part_with_mass_states_it(tmp_path: Path) -> None:
    item = cupboard(JointKind.REVOLUTE)
    heavy = replace(item, joints=(Joint(**{**_fields(item.joints[0]), "mass_kg": 7.5}),))
    model = model_of(small_home(heavy), tmp_path)
    assert model.body("cupboard.front").mass == pytest.approx(7.5)


def _fields(joint: Joint) -> dict[str, Any]:
    return {name: getattr(joint, name) for name in Joint.__slots__}
