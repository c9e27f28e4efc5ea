"""Homes as models of MuJoCo: RoboCasa, MolmoSpaces, SceneSmith, our own. No effects before `read`."""

from __future__ import annotations

import re

from pbrs_farm.read.common.format import Format, deferred

# fmt: off
FORMAT = Format(
    kind="mjcf", title="MuJoCo", files=".xml that begins with <mujoco>", order=75,
    brings="meshes, materials, joints as a keyframe has them", where="RoboCasa, MolmoSpaces, SceneSmith",
    licence="of each data set", needs="the extra physics", library="mujoco",
    suffixes=(".xml", ".mjcf"), shared_suffixes=frozenset({".xml"}), contains=re.compile(rb"<mujoco\b"),
    beside=("*.classes.json", "*.rooms.json"),
    read=deferred("pbrs_farm.read.mjcf.model_file:read_mjcf"),
    companions=deferred("pbrs_farm.read.mjcf.model_files:companions_of_mjcf"),
)
# fmt: on
