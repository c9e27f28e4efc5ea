"""Joints of UsdPhysics -> joints in the extras of a scene's nodes; no effects."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
from pxr import Usd, UsdGeom, UsdPhysics
from scipy.spatial.transform import Rotation

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.joints import JointKind
from pbrs_farm.read.common.notes import Notes
from pbrs_farm.read.gltf.document import UNREAD
from pbrs_farm.read.gltf.scene_writer import KEY, joint_row

_AXES: Final = {"X": (1.0, 0.0, 0.0), "Y": (0.0, 1.0, 0.0), "Z": (0.0, 0.0, 1.0)}
_LEAST_DETERMINANT: Final = 0.1  # of a turn; of a mirrored, flattened or unknown frame it is less
_UNLIMITED: Final = 1e6  # degrees or stage units; UsdPhysics writes infinity


def add_joints(
    stage: Any, nodes: list[dict[str, Any]], nodes_of: Mapping[str, Sequence[int]], notes: Notes
) -> None:
    """Write the joints of a stage to the extras of the nodes that they move.

    nodes_of: the nodes of each prim's path. Joints without a range, joints that neither turn about an axis
    nor slide along one, and joints of one mirrored or flattened body are counted in a note.
    """
    time = Usd.TimeCode.EarliestTime()
    cache = UsdGeom.XformCache(time)
    n_unread = 0
    bodies: dict[str, str] = {}  # moved body -> the body that carries it
    for prim in Usd.PrimRange(stage.GetPseudoRoot(), Usd.TraverseInstanceProxies()):
        if not prim.IsA(UsdPhysics.Joint) or prim.IsA(UsdPhysics.FixedJoint):
            continue
        if UsdPhysics.Joint(prim).GetJointEnabledAttr().Get() is False:
            continue
        moved = _moved_part(stage, prim, cache, time)
        if moved is None:
            n_unread += 1
            continue
        path, carrier, row = moved
        for number in nodes_of.get(path, ()):
            nodes[number]["extras"][KEY] = row
        bodies[path] = carrier
    for path, carrier in bodies.items():
        if carrier in bodies and not path.startswith(f"{carrier}/"):
            _put_below(stage, path, carrier, nodes, nodes_of, cache)
    if n_unread:
        text = (
            f"{n_unread} have no range, neither turn about an axis nor slide, or join a mirrored body;"
            " they are not read"
        )
        notes.add(UNREAD, "joints", text)


def _moved_part(
    stage: Any, prim: Any, cache: Any, time: Any
) -> tuple[str, str, dict[str, Any]] | None:
    """(path of the moved body, path of its carrier, row for its node); None if it is not read."""
    is_slide = prim.IsA(UsdPhysics.PrismaticJoint)
    if not is_slide and not prim.IsA(UsdPhysics.RevoluteJoint):
        return None
    typed = (UsdPhysics.PrismaticJoint if is_slide else UsdPhysics.RevoluteJoint)(prim)
    low, high = typed.GetLowerLimitAttr().Get(time), typed.GetUpperLimitAttr().Get(time)
    axis = np.array(_AXES.get(str(typed.GetAxisAttr().Get(time)), _AXES["X"]))
    if low is None or high is None or not (abs(low) < _UNLIMITED and abs(high) < _UNLIMITED):
        return None
    ends = [_end(stage, typed, number, cache, time) for number in (0, 1)]
    sign = 1.0
    if ends[1][0] is None:  # the world: the other body moves, against the joint's sense
        ends, sign = ends[::-1], -1.0
    (carrier, world_from_0, _), (body, world_from_1, local) = ends
    if body is None:
        return None
    # Compare the joint's frame on both bodies.
    between = world_from_0[:3, :3].T @ world_from_1[:3, :3]
    if not np.linalg.det(between) > _LEAST_DETERMINANT:
        return None
    turned = Rotation.from_matrix(between)
    if is_slide:
        value = float((world_from_1[:3, 3] - world_from_0[:3, 3]) @ world_from_0[:3, :3] @ axis)
    else:
        x, y, z, w = turned.as_quat().tolist()
        value = float(np.degrees(2 * np.arctan2(np.dot((x, y, z), axis), w)))
        value = (value - (low + high) / 2 + 180) % 360 - 180 + (low + high) / 2
    limits = sorted((low, high))
    linear = np.array(cache.GetLocalToWorldTransform(body)).T[:3, :3]
    own_axis = local[:3, :3] @ axis
    # Degrees to radians; lengths to the units of the body's own frame.
    unit = 1 / max(float(np.linalg.norm(linear @ own_axis)), 1e-9) if is_slide else np.pi / 180
    row = joint_row(
        (body.GetDisplayName() or body.GetName())[:100],
        JointKind.PRISMATIC if is_slide else JointKind.REVOLUTE,
        local[:3, 3],
        sign * own_axis,
        (limits[0] * unit, limits[1] * unit),
        value * unit,
    )
    return str(body.GetPath()), str(carrier.GetPath()) if carrier else "", row


def _end(stage: Any, joint: Any, number: int, cache: Any, time: Any) -> tuple[Any, F64, F64]:
    """A joint's body, and its frame in the world and in the body's frame (4, 4); None for the world."""
    targets = getattr(joint, f"GetBody{number}Rel")().GetForwardedTargets()
    position = getattr(joint, f"GetLocalPos{number}Attr")().Get(time)
    turn = getattr(joint, f"GetLocalRot{number}Attr")().Get(time)
    local = np.eye(4)
    if position is not None:
        local[:3, 3] = list(position)
    if turn is not None and turn.GetLength() > 0:
        local[:3, :3] = Rotation.from_quat([*turn.GetImaginary(), turn.GetReal()]).as_matrix()
    body = stage.GetPrimAtPath(targets[0]) if targets else None
    if not body:
        return None, local, local
    world = np.array(cache.GetLocalToWorldTransform(body)).T
    frame = world @ local
    # The frame of a scaled body is not scaled.
    rotation = world[:3, :3] / np.maximum(np.linalg.norm(world[:3, :3], axis=0), 1e-12)
    frame[:3, :3] = rotation @ local[:3, :3]
    return body, frame, local


def _put_below(
    stage: Any,
    path: str,
    carrier: str,
    nodes: list[dict[str, Any]],
    nodes_of: Mapping[str, Sequence[int]],
    cache: Any,
) -> None:
    """Move the node of a body below that of the moving body which carries it, unless it holds that one."""
    if len(nodes_of.get(path, ())) != 1 or len(nodes_of.get(carrier, ())) != 1:
        return
    (number,), (above,) = nodes_of[path], nodes_of[carrier]
    if above in _with_descendants(nodes, number):
        return
    world, holder = (
        np.array(cache.GetLocalToWorldTransform(stage.GetPrimAtPath(p))).T for p in (path, carrier)
    )
    if abs(np.linalg.det(holder[:3, :3])) < 1e-12:
        return
    for node in nodes:
        if number in node["children"]:
            node["children"].remove(number)
    nodes[above]["children"].append(number)
    nodes[number]["matrix"] = (np.linalg.inv(holder) @ world).T.ravel().tolist()


def _with_descendants(nodes: Sequence[dict[str, Any]], number: int) -> set[int]:
    """Numbers of a node and of all nodes below it."""
    numbers, stack = {number}, [number]
    while stack:
        children = set(nodes[stack.pop()]["children"]) - numbers
        numbers |= children
        stack += children
    return numbers
