"""Stored viewpoints -> cameras in the world; no effects."""

from __future__ import annotations

import math

import numpy as np

from pbrs_farm.core.house import StoredCamera
from pbrs_farm.read.sweethome3d.home_file.home_xml import Plan


def stored_cameras(plan: Plan) -> tuple[StoredCamera, ...]:
    """The author's viewpoints: direction (-sin yaw cos pitch, -sin pitch, cos yaw cos pitch)."""
    cameras = []
    for c in plan.cameras:
        x, y, z = c.at
        # Yaw turns from +y of the plan, which is +z of the world; pitch is positive downwards.
        level, down = math.cos(c.pitch), math.sin(c.pitch)
        towards = np.array([-math.sin(c.yaw) * level, -down, math.cos(c.yaw) * level])
        cameras.append(StoredCamera(c.name, np.array([x, z, y]), towards, c.hfov))
    return tuple(cameras)
