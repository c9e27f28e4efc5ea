"""Joints of a piece: from its file, else from the hinges and rails of its model; no effects.

The program names a model's groups by their joint: "sweethome3d_opening_on_hinge_1_door" turns about
"sweethome3d_hinge_1", "sweethome3d_opening_on_rail_2" slides along "sweethome3d_rail_2". The longest side of a
hinge or rail is its axis.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from pbrs_farm.core.arrays import F64, triple
from pbrs_farm.core.frames import affine, transform_points
from pbrs_farm.core.joints import Joint, JointKind
from pbrs_farm.core.mesh import face_areas
from pbrs_farm.read.mesh.obj import Mesh
from pbrs_farm.read.sweethome3d.home_file.home_xml import PlanPiece
from pbrs_farm.read.sweethome3d.piece_models import fixed_joint_of, hanger_of, joint_of
from pbrs_farm.read.sweethome3d.placement import PieceFrame

_WIDE_OPEN_RAD: Final = np.pi / 2
_SHUT: Final = (
    1.5  # minimum ratio of a closed leaf's width to its depth; otherwise the leaf is open
)
_LEAST_TRAVEL_M: Final = 0.02
_BESIDE_M: Final = 0.02  # least distance of a front from the middle of its body, metres
_TINY_M2: Final = 1e-12
_HANGERS: Final = {JointKind.REVOLUTE: "hinge", JointKind.PRISMATIC: "rail"}


def piece_joints(
    piece: PlanPiece, meshes: Sequence[Mesh], matrix: F64, frame: PieceFrame
) -> dict[str, Joint]:
    """The joints of a piece in the world, by what its meshes hang on: "hinge_1".

    meshes: of its model as the file has them, nothing moved. matrix: (4, 4) from the model's frame to
    the piece's. A joint's value is what the home's transformations moved it by.
    """
    to_world = affine(frame.axes, frame.origin)
    moves: Mapping[str, tuple[float, ...]] = {joint_of(n): m for n, m in piece.transformations}
    if piece.joints:
        read_joints = {
            f"{_HANGERS[joint.kind]}_{k}": joint.placed(matrix)
            for k, joint in enumerate(piece.joints, 1)
        }
        return {
            name: (_moved(joint, moves[name], matrix) if name in moves else joint).placed(to_world)
            for name, joint in read_joints.items()
            if moves.get(name) != ()
        }
    hung, fixed, still = _corners_by_joint(meshes, matrix)
    word = "leaf" if piece.frame is not None else "door"
    # Furniture opens away from its body; a frame is on both sides of a door's leaf.
    body = np.concatenate(still) if still and piece.frame is None else None
    joints: dict[str, Joint] = {}
    for name in sorted(hung.keys() & fixed.keys()):
        move = moves.get(name)
        if move == ():
            continue  # its leaf was left out
        part = f"{word} {len(joints) + 1}"
        joint = _joint(part, name, hung[name], fixed[name], body)
        if joint is not None:
            joints[name] = (_moved(joint, move, matrix) if move else joint).placed(to_world)
    return joints


def _corners_by_joint(
    meshes: Sequence[Mesh], matrix: F64
) -> tuple[dict[str, F64], dict[str, F64], list[F64]]:
    """Corners (F, 3, 3) of the parts moved by each joint, of the hinge or rail itself, and of all else."""
    hung: dict[str, list[F64]] = {}
    fixed: dict[str, list[F64]] = {}
    still: list[F64] = []
    for mesh in meshes:
        if len(mesh.faces):
            corners = transform_points(matrix, mesh.positions)[mesh.faces]
            if name := hanger_of(mesh.group):
                hung.setdefault(name, []).append(corners)
            elif name := fixed_joint_of(mesh.group):
                fixed.setdefault(name, []).append(corners)
            else:
                still.append(corners)
    return (
        {name: np.concatenate(some) for name, some in hung.items()},
        {name: np.concatenate(some) for name, some in fixed.items()},
        still,
    )


def _joint(part: str, name: str, hung: F64, fixed: F64, body: F64 | None) -> Joint | None:
    """The joint of shut faces (F, 3, 3) on a hinge or rail, +z in front. body: opens away from it, or None."""
    fixed, points = fixed.reshape(-1, 3), hung.reshape(-1, 3)
    low, high = fixed.min(0), fixed.max(0)
    along = int(np.argmax(high - low))
    axis, middle = np.eye(3)[along], (low + high) / 2
    least, most = points.min(0), points.max(0)
    if not name.startswith("hinge"):
        # It slides to the side on which its rail goes on.
        ahead, back = high[along] - most[along], least[along] - low[along]
        travel = float(max(ahead, back))
        if travel < _LEAST_TRAVEL_M:
            travel = float(most[along] - least[along])
        sign = 1.0 if ahead >= back else -1.0
        return Joint(part, JointKind.PRISMATIC, triple(middle), triple(sign * axis), travel)
    wide, thin = sorted((k for k in range(3) if k != along), key=lambda k: least[k] - most[k])
    if most[wide] - least[wide] < _SHUT * (most[thin] - least[thin]):
        return None
    away = np.sign((least + most)[wide] / 2 - middle[wide]) or 1.0
    # A leaf's middle is that of its area: handles have many faces, but small ones.
    leaf = float(np.average(hung.mean(1)[:, thin], weights=face_areas(hung) + _TINY_M2))
    beside = 0.0 if body is None else leaf - (body.min((0, 1)) + body.max((0, 1)))[thin] / 2
    # Else the far end moves to the side on which the hinge protrudes from the leaf.
    side = np.sign(beside if abs(beside) > _BESIDE_M else middle[thin] - leaf) or 1.0
    turn = np.cross(axis, np.eye(3)[wide])[thin] * away * side
    return Joint(part, JointKind.REVOLUTE, triple(middle), triple(turn * axis), _WIDE_OPEN_RAD)


def _moved(joint: Joint, move: tuple[float, ...], matrix: F64) -> Joint:
    """The joint at the value by which a transformation of the model's frame, 3 x 4, moved its part."""
    moved = np.eye(4)
    moved[:3] = np.array(move).reshape(3, 4)
    local, axis = matrix @ moved @ np.linalg.inv(matrix), np.array(joint.axis)
    if joint.kind is JointKind.PRISMATIC:
        value = float(local[:3, 3] @ axis)
    else:
        turn = local[:3, :3]
        sine = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
        value = float(np.arctan2(sine @ axis / 2, (np.trace(turn) - 1) / 2))
    # Who opened it the other way, or further, knows better.
    if value < 0:
        joint, value = replace(joint, axis=triple(-axis)), -value
    return replace(joint, upper=max(joint.upper, value), value=value)
