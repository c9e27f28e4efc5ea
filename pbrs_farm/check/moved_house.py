"""A stored house at another time, moved by house.json's motions without the stages' code; no effects."""

from __future__ import annotations

from collections.abc import Mapping
from copy import deepcopy
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from pbrs_farm.check.axes import out_of_frame
from pbrs_farm.check.stored_house import StoredHouse
from pbrs_farm.check.stored_mesh import Triangles
from pbrs_farm.core.arrays import F32, F64, I64


@dataclass(frozen=True, slots=True, eq=False)
class MovedHouse:
    """A house and its triangles at a time."""

    house: StoredHouse
    triangles: Triangles
    instances: frozenset[int]  # that may move

    def carried(self, now: MovedHouse, points: F64, faces: I64) -> F64:
        """(N, 3) positions at this house's time of points on faces (N,) of the house now."""
        a, b = (
            h.triangles.vertices[h.triangles.faces[faces]].astype(np.float64) for h in (now, self)
        )
        # A face moves rigidly, so the steps along its edges and its normal stay the same.
        before, after = _frames(a), _frames(b)
        steps = np.einsum("nij,nj->ni", np.linalg.inv(before), points - a[:, 0])
        moved = b[:, 0] + np.einsum("nij,nj->ni", after, steps)
        # Static points keep their precision beyond that of float32 vertices.
        return np.where((a == b).all((1, 2))[:, None], points, moved)


def _frames(corners: F64) -> F64:
    """(N, 3, 3) columns: two edges of each triangle and its unit normal."""
    e1, e2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normal = np.cross(e1, e2)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    return np.stack([e1, e2, normal], axis=-1)


def house_at(house: StoredHouse, triangles: Triangles, time_s: float | None) -> MovedHouse:
    """The house at a time in seconds; at rest for None. KeyError or ValueError for damaged motions."""
    motions = house.house.get("motions", [])
    instances = {str(row["id"]): k for k, row in house.items.items()}
    if time_s is None or not motions:
        return MovedHouse(house, triangles, frozenset())
    document = deepcopy({k: v for k, v in house.house.items() if k != "items"})
    rows = {int(row["instance"]): dict(row) for row in house.house["items"]}
    vertices, normals = triangles.vertices.copy(), triangles.normals.copy()
    loose = dict(triangles.loose)
    # Joints first, then the item with all its parts.
    for motion in sorted(motions, key=lambda m: not m["part"]):
        instance = instances[str(motion["item"])]
        row, faces = rows[instance], triangles.instance == instance
        if motion["part"]:
            pose = _pose_of_part(motion, row, time_s)
            faces &= triangles.is_part(motion["part"])
        else:
            pose = body_pose(motion, time_s)
            _move_row(row, pose)
            loose[instance] = _moved(loose[instance], pose)
        used = np.unique(triangles.faces[faces])
        vertices[used] = _moved(vertices[used], pose)
        normals[used] = (normals[used].astype(np.float64) @ pose[:3, :3].T).astype(np.float32)
        if motion["part"]:
            loose[instance] = vertices[np.unique(triangles.faces[triangles.instance == instance])]
    document["items"] = list(rows.values())
    moved = replace(triangles, vertices=vertices, normals=normals, loose=loose)
    moving = frozenset(instances[str(m["item"])] for m in motions)
    return MovedHouse(StoredHouse(house.folder, document), moved, moving)


def _moved(points: F32, pose: F64) -> F32:
    return out_of_frame(pose, points.astype(np.float64)).astype(np.float32)


def _pose(rotation: F64, step: F64) -> F64:
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation, step
    return pose


def joint_value(motion: Mapping[str, Any], time_s: float) -> float:
    """A joint's value at a time, between its keyframes."""
    return float(np.interp(time_s, motion["times_s"], [v[0] for v in motion["values"]]))


def joint_pose(joint: Mapping[str, Any], by: float) -> F64:
    """(4, 4) movement of a joint's part, by radians or metres."""
    axis = np.array(joint["axis"], np.float64)
    if joint["kind"] == "prismatic":
        return _pose(np.eye(3), by * axis)
    rotation = Rotation.from_rotvec(by * axis).as_matrix()
    point = np.array(joint["point"], np.float64)
    return _pose(rotation, point - rotation @ point)


def _pose_of_part(motion: Mapping[str, Any], row: dict[str, Any], time_s: float) -> F64:
    """(4, 4) movement of a part from rest; writes its value into the item's row."""
    value = joint_value(motion, time_s)
    joints = [dict(joint) for joint in row["joints"]]
    joint = next(j for j in joints if j["part"] == motion["part"])
    by = value - joint["value"]
    joint["value"], row["joints"] = value, joints
    return joint_pose(joint, by)


def body_pose(motion: Mapping[str, Any], time_s: float) -> F64:
    """(4, 4) movement of a whole item from rest."""
    times, values = np.array(motion["times_s"], np.float64), np.array(motion["values"], np.float64)
    time_s = float(np.clip(time_s, times[0], times[-1]))
    position = np.array([np.interp(time_s, times, values[:, k]) for k in range(3)])
    rotations = Rotation.from_quat(values[:, [4, 5, 6, 3]])
    rotation = rotations[0] if len(times) == 1 else Slerp(times, rotations)(time_s)
    matrix = rotation.as_matrix()
    return _pose(matrix, position - matrix @ np.array(motion["pivot"], np.float64))


def _move_row(row: dict[str, Any], pose: F64) -> None:
    """Move the box, joints and pose in an item's row."""
    turn = pose[:3, :3]
    if row.get("box"):
        axes = turn @ np.array(row["box"]["axes"], np.float64)
        row["box"] = {**row["box"], "axes": axes.tolist()}
    if row.get("pose"):
        model = pose @ np.array(row["pose"]["world_from_model"], np.float64)
        row["pose"] = {**row["pose"], "world_from_model": model.tolist()}
    if row.get("joints"):
        row["joints"] = [
            {
                **joint,
                "axis": (turn @ np.array(joint["axis"])).tolist(),
                "point": (turn @ np.array(joint["point"]) + pose[:3, 3]).tolist(),
            }
            for joint in row["joints"]
        ]
