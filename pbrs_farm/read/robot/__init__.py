"""Homes as URDF and SDF, the forms of ROS and Gazebo. No effects before `read`."""

from __future__ import annotations

import re

from pbrs_farm.read.common.format import Format, deferred

# fmt: off
_SUFFIXES = (".urdf", ".sdf", ".world")
FORMAT = Format(
    kind="robot", title="URDF and SDF", files=".urdf, .sdf or .world", order=77,
    brings="meshes, materials, joints, all closed", where="ROS, Gazebo, our own exports",
    licence="of each home", suffixes=_SUFFIXES, shared_suffixes=frozenset(_SUFFIXES),
    # a world, or a robot with a floor and a wall; other files are single models
    contains=re.compile(rb"<sdf\b[\s\S]*<world\b|<robot\b(?=[\s\S]*floor)(?=[\s\S]*wall)", re.IGNORECASE),
    beside=("*.classes.json", "*.rooms.json"),
    read=deferred("pbrs_farm.read.robot.home:read_robot"),
    companions=deferred("pbrs_farm.read.robot.home:companions_of_robot"),
)
# fmt: on
