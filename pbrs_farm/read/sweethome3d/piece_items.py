"""Pieces of furniture -> items with joints, and openings; no effects.

Joints are those of the file, else of the model. The program names a model's groups by their joint:
"sweethome3d_opening_on_hinge_1_door" turns about "sweethome3d_hinge_1", "sweethome3d_opening_on_rail_2" slides
along "sweethome3d_rail_2". The longest side of a hinge or rail is its axis.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Final

import numpy as np
import shapely

from pbrs_farm.core.arrays import F64, triple
from pbrs_farm.core.classes import DOOR, LAMP, OTHERPROP, WINDOW
from pbrs_farm.core.frames import affine, transform_points
from pbrs_farm.core.house import Item, MaterialKind, Opening
from pbrs_farm.core.joints import Joint, JointKind
from pbrs_farm.core.mesh import face_areas
from pbrs_farm.read.common.furniture_classes import (
    CLASS_TAG,
    PieceClass,
    PieceSize,
    class_of_piece,
    kind_of,
)
from pbrs_farm.read.mesh.obj import Mesh
from pbrs_farm.read.sweethome3d.door_cutouts import StandingWall, opening_of
from pbrs_farm.read.sweethome3d.home_file.home_xml import PlanLevel, PlanPiece
from pbrs_farm.read.sweethome3d.home_rooms import ReadRoom
from pbrs_farm.read.sweethome3d.piece_materials import piece_material
from pbrs_farm.read.sweethome3d.piece_models import (
    PANE,
    HomeMaterials,
    PieceModel,
    PieceModels,
    fixed_joint_of,
    hanger_of,
    joint_of,
)
from pbrs_farm.read.sweethome3d.placement import (
    PieceFrame,
    frame_of,
    light_parts,
    local_from_model,
    placed_surface,
)

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


MAX_BESIDE_ROOM_M = 0.5  # A piece outside every room belongs to a room no farther than this


def piece_item(
    piece: PlanPiece,
    level: PlanLevel,
    models: PieceModels,
    materials: HomeMaterials,
    ids: tuple[str, str],
    rooms: list[ReadRoom],
) -> tuple[Item, PieceFrame] | None:
    """The placed item (ids: its own, its level's) and its frame; None, with a note, without a model."""
    model = models.get(piece.model, piece.place, piece.transformations)
    if model is None:
        return None
    # Fit the model into the piece's box, then place the box in the house.
    matrix = local_from_model(piece, model)
    points = [transform_points(matrix, m.positions) for m in model.meshes]
    frame = frame_of(piece, level, np.concatenate(points) if points else None)
    # Keep the meshes that the home shows, with their materials.
    paint = [piece_material(piece, mesh, model, materials) for mesh in model.meshes]
    joints = piece_joints(piece, models.meshes(piece.model), matrix, frame)
    shown = [
        (m, p, xyz, joints[on].part if on in joints else "")
        for m, p, xyz, on in zip(model.meshes, paint, points, model.hangers, strict=True)
        if p
    ]
    surfaces = [
        replace(placed_surface(m, p, frame, xyz, matrix), part=part) for m, p, xyz, part in shown
    ]
    emitting = [k for k, (_, p, _, _) in enumerate(shown) if p.emits]
    # Where the home hides a part, as the television of its bench, the rest is judged.
    height = piece.size[2]
    if shown and len(shown) < len(paint):
        height = float(np.ptp(np.concatenate([xyz[:, 1] for _, _, xyz, _ in shown])))
    by_rule = _piece_class(piece, height)
    nyu40, tags = _label_of_piece(piece, by_rule, model, materials)
    lights = light_parts(piece, frame, tuple(emitting))
    if not surfaces and not lights:
        materials.notes.add("empty-model", piece.place, "nothing to see in it: left out")
        return None
    item_id, level_id = ids
    is_opening, is_light = piece.frame is not None, piece.tag == "light"
    kind = kind_of(by_rule, nyu40, is_opening=is_opening, is_light=is_light)
    parts = {s.part for s in surfaces}
    item = Item(
        id=item_id,
        name=piece.name,
        kind=kind,
        level_id=level_id,
        surfaces=tuple(surfaces),
        nyu40=nyu40,
        source_class=piece.catalogue_id,
        room_id=_room_of(frame, level_id, rooms),
        lights=lights,
        box=frame.box,
        tags=tags,
        joints=tuple(joint for joint in joints.values() if joint.part in parts),
    )
    return item, frame


def _piece_class(piece: PlanPiece, height: float) -> PieceClass:
    # Openings and lights are what their element says; a tilted piece has no size to check.
    is_checked = piece.frame is None and piece.tag != "light" and not (piece.pitch or piece.roll)
    width, depth, _whole = piece.size
    place = PieceSize(width, height, depth, piece.elevation) if is_checked else None
    return class_of_piece(piece.catalogue_id, piece.name, piece.group, place)


def _label_of_piece(
    piece: PlanPiece, by_rule: PieceClass, model: PieceModel, materials: HomeMaterials
) -> tuple[int, tuple[str, ...]]:
    tags = ["mirrored"] if piece.is_mirrored else []
    label, rule = by_rule.nyu40, by_rule.tag
    # A door or window of unknown class: one with a pane above the floor is a window.
    if piece.frame is not None and label not in (DOOR, WINDOW):
        has_pane = any(m.group == PANE for m in model.meshes)
        label = WINDOW if has_pane and piece.elevation > 0.3 else DOOR
        rule = CLASS_TAG + "element"
    elif piece.tag == "light" and label in (None, 0, OTHERPROP):
        label, rule = LAMP, CLASS_TAG + "element"
    tags.append(rule)
    if label is None:
        label = OTHERPROP
        tags.append("unmapped")
        subject = piece.catalogue_id or repr(piece.name)
        why = " of its size" if by_rule.rule == "size" else ""
        materials.notes.add("unmapped-class", piece.place, f"no class{why} for {subject}")
    return label, tuple(tags)


def _room_of(frame: PieceFrame, level_id: str, rooms: list[ReadRoom]) -> str | None:
    point = shapely.Point(frame.origin[[0, 2]])
    best, nearest = None, MAX_BESIDE_ROOM_M
    for room in rooms:
        if room.level_id != level_id:
            continue
        # The nearest outline wins, zero inside; of equal ones the later room.
        gap = float(room.outline.distance(point))
        if gap <= nearest:
            best, nearest = room.id, gap
    return best


def piece_opening(
    piece: PlanPiece,
    item: Item,
    frame: PieceFrame,
    walls: list[StandingWall],
    materials: HomeMaterials,
    material: int,
) -> Opening | None:
    """Opening cut by a door or window out of its walls; None for a piece that cuts nothing.

    walls: those of its level, with their plans and heights. material: index for the invisible cutter. A
    piece outside of walls cuts nothing, with a note.
    """
    if piece.frame is None:
        return None
    kinds = {materials.library.materials[s.material].kind for s in item.surfaces}
    return opening_of(
        piece,
        frame,
        walls,
        materials,
        (f"opening_{item.id}", item.level_id, item.id),
        material,
        is_window=item.nyu40 == WINDOW or MaterialKind.PANE in kinds,
    )
