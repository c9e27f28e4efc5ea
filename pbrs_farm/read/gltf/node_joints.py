"""Joints that the nodes of a scene have; no effects.

Readers that put a scene together tell a joint in a node's extras; what the node holds is its part:

    {"pbrs_joint": {"part": "door 1", "kind": "revolute", "point": [0, 0, 0], "axis": [0, 1, 0],
                    "lower": 0.0, "upper": 1.57, "value": 0.5}}

Point and axis are in the node's own frame, in which the motion leaves them where they are.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np

from pbrs_farm.core.arrays import triple
from pbrs_farm.core.joints import Joint, JointKind
from pbrs_farm.formats.glb import Gltf, entry
from pbrs_farm.read.gltf.document import Placed, numbers, object_at

KEY: Final = "pbrs_joint"
_LEAST: Final = 1e-3  # radians or metres; what moves less is fixed


def joint_row(
    part: str, kind: JointKind, point: Any, axis: Any, limits: tuple[float, float], value: float
) -> dict[str, Any]:
    """Joint description for a node's extras, under KEY.

    limits: minimum and maximum value, radians or metres. A joint that opens to the negative side is
    inverted, so that it opens from 0 to its maximum.
    """
    lower, upper = limits
    axis = np.asarray(axis, np.float64)
    if abs(lower) > abs(upper):
        lower, upper, value, axis = -upper, -lower, -value, -axis
    return {
        "part": part,
        "kind": kind.value,
        "point": [float(x) for x in point],
        "axis": axis.tolist(),
        "lower": float(lower),
        "upper": float(upper),
        "value": float(value),
    }


def joints_of_parts(gltf: Gltf, parts: Sequence[Placed]) -> dict[tuple[int, ...], Joint]:
    """The joint of each node of an item, in the world frame, by the node's path.

    parts: of one item, parents first. Nodes below a moving part belong to that part: only motion
    relative to the body counts. Raises BadHouse for invalid numbers.
    """
    joints: dict[tuple[int, ...], Joint] = {}
    for part in parts:
        above = joints.get(part.path[:-1])
        row = object_at(object_at(entry(gltf, "nodes", part.index), "extras"), KEY)
        joint = above or (_joint(gltf, row, part) if row else None)
        if joint is not None:
            joints[part.path] = joint
    return joints


def _joint(gltf: Gltf, row: dict[str, Any], part: Placed) -> Joint | None:
    place = f"nodes[{part.index}].extras.{KEY}"
    point = numbers(gltf, row.get("point", [0, 0, 0]), 3, f"{place}.point")
    axis = numbers(gltf, row.get("axis"), 3, f"{place}.axis")
    keys = ("lower", "upper", "value")
    lower, upper, value = numbers(gltf, [row.get(key, 0.0) for key in keys], 3, place)
    length = float(np.linalg.norm(axis))
    kinds = {kind.value: kind for kind in JointKind}
    if row.get("kind") not in kinds or upper - lower < _LEAST or length < 1e-9:
        return None
    joint = Joint(
        str(row.get("part"))[:100],
        kinds[row["kind"]],
        triple(point),
        triple(axis / length),
        float(upper),
        float(lower),
        float(value),
    )
    return joint.placed(part.world_from_node)
