"""Items with their doors and drawers at other values, and how far these go before they meet something; no effects."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from pbrs_farm.core.arrays import F64, Bools, Matrix4
from pbrs_farm.core.classes import FLOOR_MAT
from pbrs_farm.core.frames import transform_points
from pbrs_farm.core.house import Box, Item, Surface
from pbrs_farm.core.joints import Joint, JointKind
from pbrs_farm.core.mesh import triangle_bounds, triangle_corners
from pbrs_farm.geometry.scene_triangles import SceneTriangles
from pbrs_farm.geometry.surface_points import surface_points

_CELL_M: Final = 0.008  # cell size of the grid that compares a part with its obstacles, metres
_SPACING_M: Final = 0.005  # of points on both
_APART_M: Final = 0.004  # clearance between an opened part and an obstacle, metres
_NEAR_AXIS_M: Final = (
    0.1  # radius around a hinge within which the clearance is not enforced, metres
)
_PIN_M: Final = 0.03  # obstacles closer to a hinge's axis are ignored, metres
_STEPS: Final = 12  # of a way whose bounds are wanted


def moved_surface(surface: Surface, matrix: Matrix4) -> Surface:
    """The surface moved rigidly by a matrix (4, 4); its shading normals turn along."""
    normals = surface.normals
    if normals is not None:
        normals = (normals.astype(np.float64) @ matrix[:3, :3].T).astype(np.float32)
    positions = transform_points(matrix, surface.positions).astype(np.float32)
    return replace(surface, positions=positions, normals=normals)


def item_at(item: Item, part: str, value: float) -> Item:
    """The item with a part's joint at a value (radians, metres; unlimited), box around it; KeyError."""
    joint = joint_of(item, part)
    matrix = joint.motion(value)
    surfaces = tuple(moved_surface(s, matrix) if s.part == part else s for s in item.surfaces)
    joints = tuple(replace(j, value=value) if j.part == part else j for j in item.joints)
    return box_around(replace(item, surfaces=surfaces, joints=joints))


def joint_of(item: Item, part: str) -> Joint:
    """The joint that moves a part; KeyError for none."""
    for joint in item.joints:
        if joint.part == part:
            return joint
    raise KeyError(part)


def box_around(item: Item) -> Item:
    """The item whose box, where it has one, keeps its axes and holds what its surfaces are now."""
    if item.box is None:
        return item
    axes = item.box.axes
    points = np.concatenate([s.positions for s in item.surfaces if len(s.positions)])
    local = points.astype(np.float64) @ axes
    low, high = local.min(0), local.max(0)
    return replace(item, box=Box(axes @ ((low + high) / 2), (high - low) / 2, axes))


def part_triangles(item: Item, part: str) -> F64:
    """(F, 3, 3) corners of one part's faces in their current pose, metres."""
    corners = [triangle_corners(s.positions, s.faces) for s in item.surfaces if s.part == part]
    return np.concatenate([np.zeros((0, 3, 3)), *corners])


def free_value(scene: SceneTriangles, index: int, part: str, target: float) -> tuple[float, str]:
    """Furthest free value of a part of scene.items[index] towards wanted, and the id of its obstacle.

    The id is "" if there is no obstacle. A part stops 4 mm before other items and before other open
    parts of its own item; its own body, closed parts, rugs and mats are ignored. Contacts of its rim
    alone by less than about a centimetre are ignored too: neighbouring fronts, a rug below a door.
    Closing is never blocked.
    """
    start = joint_of(scene.items[index], part).value
    best, stopped_by = target, ""
    for k, value in stops(scene, index, part, target).items():
        if value < best:
            best, stopped_by = max(value, start), scene.items[k].id
    return best, stopped_by


def stops(
    scene: SceneTriangles,
    index: int,
    part: str,
    target: float,
    among: Collection[int] | None = None,
) -> dict[int, float]:
    """Joint value at which each item alone stops a part of scene.items[index], by the rules of free_value.

    among: indices of the items to measure, None = all. Items that the part does not meet on its way to
    target are left out, or have a value beyond it.
    """
    joint = joint_of(scene.items[index], part)
    if target <= joint.value:
        return {}
    corners = part_triangles(scene.items[index], part)
    if not len(corners):
        return {}
    low, high = _bounds_of_way(joint, corners, target)
    near = dict(_near(scene, index, part, low, high, among))
    if not near:
        return {}
    track, box = _Track.of(joint, surface_points(corners, _SPACING_M)), np.array([low, high])
    return {k: joint.value + track.way_to(faces, box) for k, faces in near.items()}


def _near(
    scene: SceneTriangles, index: int, part: str, low: F64, high: F64, among: Collection[int] | None
) -> Iterator[tuple[int, F64]]:
    """The items whose faces meet a box, with those faces; of the own item other open parts."""
    for k in scene.items_in(low, high):
        item = scene.items[k]
        if item.nyu40 == FLOOR_MAT or (among is not None and k not in among):
            continue
        if k == index:
            open_parts = [j.part for j in item.joints if j.part != part and j.value != 0]
            corners = np.concatenate(
                [np.zeros((0, 3, 3)), *(part_triangles(item, p) for p in open_parts)]
            )
        else:
            corners = scene.of_item(k)
        least, most = triangle_bounds(corners)
        meets = ((most >= low) & (least <= high)).all(1)
        if meets.any():
            yield k, corners[meets]


def _bounds_of_way(joint: Joint, corners: F64, target: float) -> tuple[F64, F64]:
    points = corners.reshape(-1, 3)
    values = np.linspace(joint.value, target, _STEPS)
    on_way = np.concatenate([transform_points(joint.motion(float(v)), points) for v in values])
    return on_way.min(0) - _CELL_M, on_way.max(0) + _CELL_M


@dataclass(frozen=True, slots=True, eq=False)
class _Track:
    """A part in its joint's coordinates: (radius, height), angle of a hinge; the plane across a slide."""

    joint: Joint
    axes: F64  # (3, 3) columns: two across, the joint's
    low: F64  # (2,) of the grid
    front: F64  # (rows, columns) the foremost way of the part in each cell
    inner: Bools  # cells that count: those at its rim do not
    zero: float  # angle from which ways are measured

    @classmethod
    def of(cls, joint: Joint, points: F64) -> _Track:
        """points: (N, 3) on the part."""
        axis = np.array(joint.axis)
        first = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
        first /= np.linalg.norm(first)
        axes = np.stack([first, np.cross(axis, first), axis], -1)
        local = (points - np.array(joint.point)) @ axes
        zero = 0.0
        if joint.kind is JointKind.REVOLUTE:
            # Measure angles from the part's centre, so that its range does not wrap around.
            # To the bit as numpy's mean, in half of its time.
            x, y = (np.add.accumulate(local[:, k])[-1] / len(local) for k in (0, 1))
            zero = float(np.arctan2(y, x))
        plane, way = _split(joint, local, zero)
        low = plane.min(0) - 2 * _CELL_M
        cell = np.floor((plane - low) / _CELL_M).astype(np.int64)
        front = np.full(tuple(cell.max(0) + 3), -np.inf)
        # One index: numpy's fast way.
        np.maximum.at(front.reshape(-1), cell[:, 0] * front.shape[1] + cell[:, 1], way)
        # Imported here: every process of a run imports this module, few call this function.
        from scipy import ndimage

        covered = ndimage.binary_closing(np.isfinite(front))
        inner = ndimage.binary_erosion(covered) & np.isfinite(front)
        return cls(joint, axes, low, front, inner, zero)

    def way_to(self, corners: F64, box: F64) -> float:
        """Free travel of the part before it hits faces (F, 3, 3) within a box (2, 3); inf if it hits none."""
        points = surface_points(corners, _SPACING_M, box)
        if not len(points):
            return np.inf
        local = (points - np.array(self.joint.point)) @ self.axes
        plane, way = _split(self.joint, local, self.zero)
        cell = np.floor((plane - self.low) / _CELL_M).astype(np.int64)
        inside = ((cell >= 0) & (cell < self.front.shape)).all(1)
        cell, way, plane = cell[inside], way[inside], plane[inside]
        counts = self.inner[cell[:, 0], cell[:, 1]]
        cell, way, plane = cell[counts], way[counts], plane[counts]
        ahead = way - self.front[cell[:, 0], cell[:, 1]]
        if self.joint.kind is JointKind.REVOLUTE:
            # Faces behind the part are reached only after a full turn.
            ahead = np.where(ahead < -np.pi, ahead + 2 * np.pi, ahead)
            ahead = ahead - _APART_M / np.maximum(plane[:, 0], _NEAR_AXIS_M)
            behind = (ahead * plane[:, 0] < -2 * _APART_M) | (plane[:, 0] < _PIN_M)
        else:
            ahead = ahead - _APART_M
            behind = ahead < -2 * _APART_M
        ahead = ahead[~behind]
        return float(max(ahead.min(), 0.0)) if len(ahead) else np.inf


def _split(joint: Joint, local: F64, zero: float) -> tuple[F64, F64]:
    """(N, 2) where points of the joint's axes lie in its grid, (N,) how far along its way."""
    if joint.kind is JointKind.PRISMATIC:
        return local[:, :2], local[:, 2]
    plane = np.stack([np.hypot(local[:, 0], local[:, 1]), local[:, 2]], -1)
    angle = np.arctan2(local[:, 1], local[:, 0]) - zero
    return plane, (angle + np.pi) % (2 * np.pi) - np.pi
