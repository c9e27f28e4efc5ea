"""Pieces of furniture -> items and openings; no effects."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import shapely

from pbrs_farm.core.classes import DOOR, LAMP, OTHERPROP, WINDOW
from pbrs_farm.core.frames import transform_points
from pbrs_farm.core.house import Item, MaterialKind, Opening
from pbrs_farm.read.common.furniture_classes import (
    CLASS_TAG,
    PieceClass,
    PieceSize,
    class_of_piece,
    kind_of,
)
from pbrs_farm.read.sweethome3d.door_cutouts import StandingWall, opening_of
from pbrs_farm.read.sweethome3d.home_file.home_xml import PlanLevel, PlanPiece
from pbrs_farm.read.sweethome3d.home_materials import HomeMaterials
from pbrs_farm.read.sweethome3d.home_rooms import ReadRoom
from pbrs_farm.read.sweethome3d.piece_joints import piece_joints
from pbrs_farm.read.sweethome3d.piece_materials import piece_material
from pbrs_farm.read.sweethome3d.piece_models import PANE, PieceModel, PieceModels
from pbrs_farm.read.sweethome3d.placement import (
    PieceFrame,
    frame_of,
    light_parts,
    local_from_model,
    placed_surface,
)

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
