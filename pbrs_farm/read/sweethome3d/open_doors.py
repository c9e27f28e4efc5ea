"""Open the doors between rooms about the hinges in their models; no effects.

A model's leaf is attached to a hinge ("sweethome3d_opening_on_hinge_1_door" on "sweethome3d_hinge_1_2"),
and swings to the side on which the hinge protrudes.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import shapely

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.frames import affine, rotation_y, transform_points
from pbrs_farm.core.house import Box, Item, ItemKind
from pbrs_farm.core.joints import Joint, JointKind
from pbrs_farm.read.mesh.obj import Mesh
from pbrs_farm.read.sweethome3d.door_cutouts import StandingWall
from pbrs_farm.read.sweethome3d.home_file.home_xml import PlanLevel, PlanPiece
from pbrs_farm.read.sweethome3d.home_rooms import ReadRoom
from pbrs_farm.read.sweethome3d.piece_items import piece_item
from pbrs_farm.read.sweethome3d.piece_materials import piece_material
from pbrs_farm.read.sweethome3d.piece_models import (
    HINGE,
    HomeMaterials,
    PieceModels,
    Transformations,
    hangs_on,
    joint_of,
)
from pbrs_farm.read.sweethome3d.placement import PieceFrame, local_from_model

ANGLES_DEG: Final = (85.0, 70.0, 55.0)  # the widest free angle is taken
_UPRIGHT: Final = 0.99  # of a hinge's direction
_SHUT: Final = 2.5  # times as wide as it reaches out of the wall, handles included
_SIDE_M: Final = 0.5  # from a door's middle, where its rooms have begun
_OFF_MIDDLE_M: Final = np.array([0.011, 0.017])
_IN_WALL: Final = 0.15  # share of a leaf's plan that may lie in walls: beside the hinge it does
_IN_THING: Final = 0.01  # share of a leaf's plan that may lie in a piece it touches
_SHEET_M2: Final = 1e-4  # a leaf whose plan is smaller is drawn as a sheet,
_SHEET_M: Final = 0.005  # which counts as so far on either side of it


@dataclass(frozen=True, slots=True, eq=False)
class Leaf:
    """A shut leaf in its piece's frame, metres."""

    joint: str  # "hinge_1"
    hinge: F64  # (2,) x, z of the axis, which is upright
    points: F64  # (N, 3)
    turn: float  # 1 or -1: the sense about y that opens it


def shut_leaves(
    meshes: Iterable[Mesh], matrix: F64, joints: Sequence[Joint] = ()
) -> tuple[Leaf, ...]:
    """The closed leaves of a door's model with an upright hinge.

    matrix: (4, 4) from the model's frame to the piece's. joints: from the file, in the model's
    frame; they take precedence over the hinges in the model.
    """
    if joints:
        return tuple(_told_leaves(tuple(meshes), matrix, joints))
    leaves: dict[str, list[F64]] = {}
    hinges: dict[str, list[F64]] = {}
    for mesh in meshes:
        for word in mesh.group.split():
            joint = joint_of(word)
            if joint.startswith("hinge_") and len(mesh.positions):
                points = transform_points(matrix, mesh.positions)
                kind = hinges if word.startswith(HINGE) else leaves
                kind.setdefault(joint, []).append(points)
                break
    leaves_found = [_find_leaf(j, leaves[j], hinges[j]) for j in sorted(leaves) if j in hinges]
    return tuple(leaf for leaf in leaves_found if leaf is not None)


def _told_leaves(meshes: Sequence[Mesh], matrix: F64, joints: Sequence[Joint]) -> Iterator[Leaf]:
    for number, joint in enumerate(joints, 1):
        hung = joint.placed(matrix)
        name = f"hinge_{number}"
        parts = [
            transform_points(matrix, m.positions) for m in meshes if hangs_on(m, frozenset([name]))
        ]
        if hung.kind is JointKind.REVOLUTE and abs(hung.axis[1]) > _UPRIGHT and parts:
            hinge = np.array(hung.point)[[0, 2]]
            yield Leaf(name, hinge, np.concatenate(parts), float(np.sign(hung.axis[1])))


def _find_leaf(joint: str, parts: list[F64], hinge_parts: list[F64]) -> Leaf | None:
    points, hinge = np.concatenate(parts), np.concatenate(hinge_parts)
    axis = (hinge.min(0) + hinge.max(0))[[0, 2]] / 2
    low, high = points.min(0), points.max(0)
    # Skip open leaves, and flaps with a horizontal hinge.
    width, _height, out = high - low
    if width < _SHUT * out or np.ptp(hinge[:, 0]) > np.ptp(hinge[:, 1]):
        return None
    # The leaf's far end moves to the side on which the hinge protrudes.
    away = np.sign((low + high)[0] / 2 - axis[0]) or 1.0
    side = np.sign(axis[1] - np.median(points[:, 2])) or 1.0
    return Leaf(joint, axis, points, float(-away * side))


def _fills_its_hole(meshes: Iterable[Mesh], matrix: F64) -> bool:
    """True if a triangle covers the centre of a door; otherwise it is only a frame."""
    corners = [transform_points(matrix, m.positions[m.faces]) for m in meshes]
    a, b, c = np.moveaxis(np.concatenate(corners)[:, :, :2] - _OFF_MIDDLE_M, 1, 0)
    # A place beside the middle, where diagonals meet, is on the same side of all three edges.
    sides = [p[:, 0] * (q - p)[:, 1] - p[:, 1] * (q - p)[:, 0] for p, q in ((a, b), (b, c), (c, a))]
    signs = np.sign(sides)
    return bool(((signs > 0).all(0) | (signs < 0).all(0)).any())


def joins_rooms(frame: PieceFrame, level_id: str, rooms: Sequence[ReadRoom]) -> bool:
    """Whether rooms with ceilings lie on both sides of a door: one that leads outdoors stays shut."""
    reach = frame.half[2] + _SIDE_M
    sides = frame.world(np.array([[0.0, 0.0, -reach], [0.0, 0.0, reach]]))
    indoors = [r for r in rooms if r.level_id == level_id and r.plan.has_ceiling]
    return all(any(r.outline.contains(shapely.Point(p[[0, 2]])) for r in indoors) for p in sides)


def swung(leaf: Leaf, angle_deg: float) -> F64:
    """(4, 4) that turns a leaf about its hinge, in the piece's frame."""
    turn = rotation_y(np.radians(angle_deg) * leaf.turn)
    axis = np.array([leaf.hinge[0], 0.0, leaf.hinge[1]])
    return affine(turn, axis - turn @ axis)


def opening_angle(
    leaf: Leaf, frame: PieceFrame, items: Iterable[Item], walls: Iterable[StandingWall]
) -> float | None:
    """The widest of ANGLES_DEG at which the leaf meets no oriented box of its storey's items; or None."""
    low, high = frame.world(leaf.points)[:, 1].min(), frame.world(leaf.points)[:, 1].max()
    things = [i.oriented_box.corners for i in items if i.n_faces and not i.kind.is_structure]
    plans = [
        shapely.MultiPoint(c[:, [0, 2]]).convex_hull
        for c in things
        if c[:, 1].max() > low and c[:, 1].min() < high
    ]
    solid = shapely.union_all([w.polygon for w in walls if w.high > low and w.low < high])
    for angle in ANGLES_DEG:
        turn = swung(leaf, angle)
        points = frame.world(transform_points(turn, leaf.points))
        plan = shapely.MultiPoint(points[:, [0, 2]]).convex_hull
        if plan.area < _SHEET_M2:
            plan = plan.buffer(_SHEET_M)
        in_wall = plan.intersection(solid).area / plan.area
        if in_wall <= _IN_WALL and all(
            plan.intersection(p).area <= _IN_THING * plan.area for p in plans
        ):
            return angle
    return None


def model_moves(turns: Iterable[tuple[str, F64]], matrix: F64) -> Transformations:
    """Moves of the piece's frame (joint, (4, 4)) as those of its model, which matrix places."""
    back = np.linalg.inv(matrix)
    return tuple(
        (f"sweethome3d_{joint}", tuple((back @ turn @ matrix)[:3].ravel().tolist()))
        for joint, turn in turns
    )


def around_everything(item: Item, frame: PieceFrame) -> Item:
    """The item in a box of its frame that holds its open leaf, too."""
    points = np.concatenate([s.positions for s in item.surfaces]).astype(np.float64)
    local = (points - frame.origin) @ frame.axes
    low, high = local.min(0), local.max(0)
    middle = frame.world((low + high)[None] / 2)[0]
    return replace(item, box=Box(middle, (high - low) / 2, frame.axes))


@dataclass(frozen=True, slots=True, eq=False)
class StandingPiece:
    """A piece of the plan and the item it became."""

    piece: PlanPiece
    level: PlanLevel
    item: Item
    frame: PieceFrame


def opened_doors(
    placed: Sequence[StandingPiece],
    models: PieceModels,
    materials: HomeMaterials,
    rooms: list[ReadRoom],
    walls: Sequence[StandingWall],
) -> list[Item]:
    """The items of placed pieces, with the closed doors between rooms swung open.

    A leaf blocked by a wall or an item at each of ANGLES_DEG is left out, with a note; a door without
    a hinge in its model stays as drawn, with a note.
    """
    items = [p.item for p in placed]
    for k, door in enumerate(placed):
        piece, item = door.piece, door.item
        if item.kind is not ItemKind.DOOR or not joins_rooms(door.frame, item.level_id, rooms):
            continue
        # A tilted or turned model is no plain door.
        model = models.get(piece.model, piece.place)
        is_plain = not (piece.transformations or piece.rotation or piece.pitch or piece.roll)
        if model is None or not is_plain:
            continue
        matrix, meshes = local_from_model(piece, model), models.meshes(piece.model)
        leaves = shut_leaves(meshes, matrix, piece.joints)
        if not leaves:
            if _fills_its_hole(meshes, matrix) and not any(HINGE in m.group for m in meshes):
                text = "its model has no hinge: left as drawn"
                materials.notes.add("door-without-hinge", piece.place, text)
            continue
        # Ask of each leaf how far it can go, and move it, or leave it out.
        other_items = [i for n, i in enumerate(items) if n != k and i.level_id == item.level_id]
        angles = [(leaf, opening_angle(leaf, door.frame, other_items, walls)) for leaf in leaves]
        turns = [(leaf.joint, swung(leaf, angle)) for leaf, angle in angles if angle is not None]
        out = frozenset(leaf.joint for leaf, angle in angles if angle is None)
        if out:
            text = "an obstacle blocks its leaf: left out"
            materials.notes.add("door-leaf-left-out", piece.place, text)
        moves = models.add_opened(piece.model, model_moves(turns, matrix), out)
        opened = replace(door, piece=replace(piece, transformations=moves))
        items[k] = _opened(opened, models, materials, rooms)
    return items


def _opened(
    door: StandingPiece, models: PieceModels, materials: HomeMaterials, rooms: list[ReadRoom]
) -> Item:
    """The item of a door whose leaves are moved or left out; without surfaces where nothing is left."""
    piece, item = door.piece, door.item
    # The home may hide all but the leaf: then the doorway is an empty hole.
    model = models.get(piece.model, piece.place, piece.transformations)
    meshes = model.meshes if model is not None else ()
    if model is None or not any(piece_material(piece, m, model, materials) for m in meshes):
        return replace(item, surfaces=())
    ids = item.id, item.level_id
    again = piece_item(piece, door.level, models, materials, ids, rooms)
    assert again is not None, piece.place
    return around_everything(again[0], door.frame)
