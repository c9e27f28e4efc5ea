"""A home at a point in time, its parts moved by motions, static geometry shared; no effects."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from pbrs_farm.core.arrays import F64, I64, Bools, Matrix4, triple
from pbrs_farm.core.edits import rows_of_matrix
from pbrs_farm.core.frames import transform_points
from pbrs_farm.core.house import (
    Box,
    Geometry,
    House,
    Item,
    LightPart,
    MaterialKind,
    geometry_from_house,
)
from pbrs_farm.core.motions import Motion
from pbrs_farm.geometry.opened import box_around, moved_surface


def moved_item(item: Item, matrix: Matrix4) -> Item:
    """The item with all parts but room and level moved rigidly by a matrix (4, 4)."""
    box, pose = item.oriented_box, item.pose
    if pose is not None:
        pose = replace(
            pose, world_from_model=rows_of_matrix(matrix @ np.array(pose.world_from_model))
        )
    return replace(
        item,
        surfaces=tuple(moved_surface(s, matrix) for s in item.surfaces),
        lights=tuple(_moved_light(light, matrix) for light in item.lights),
        box=Box(transform_points(matrix, box.centre[None])[0], box.half, matrix[:3, :3] @ box.axes),
        pose=pose,
        joints=tuple(joint.placed(matrix) for joint in item.joints),
    )


def _moved_light(light: LightPart, matrix: F64) -> LightPart:
    def point(p: tuple[float, float, float]) -> tuple[float, float, float]:
        return triple(transform_points(matrix, np.array([p]))[0])

    end = light.position_end
    return replace(
        light,
        position=point(light.position),
        position_end=None if end is None else point(end),
        direction=triple(matrix[:3, :3] @ np.array(light.direction)),
    )


def matrices_at(item: Item, motions: Mapping[str, Motion], time_s: float) -> dict[str, Matrix4]:
    """Rigid (4, 4) from rest to a time of the parts, "" the whole, that have motions."""
    whole = motions.get("")
    of_item = None if whole is None else whole.matrix_at(time_s)
    matrices: dict[str, Matrix4] = {} if of_item is None else {"": of_item}
    for joint in item.joints:
        motion = motions.get(joint.part)
        chain = [] if of_item is None else [of_item]
        chain += [] if motion is None else [joint.motion(motion.value_at(time_s))]
        if chain:
            matrices[joint.part] = functools.reduce(np.matmul, chain)
    return matrices


def item_at_time(item: Item, motions: Mapping[str, Motion], time_s: float) -> Item:
    """The item at a time (motions: as of `matrices_at`), its box around opened parts."""
    matrices = matrices_at(item, motions, time_s)
    joints = tuple(
        replace(j, value=motions[j.part].value_at(time_s)) if j.part in motions else j
        for j in item.joints
    )
    whole = matrices.get("")
    # Each surface moves once, so that it is rounded once.
    surfaces = tuple(
        moved_surface(s, matrices[s.part]) if s.part in matrices else s for s in item.surfaces
    )
    moved = replace(item, joints=joints)
    if whole is not None:
        moved = moved_item(replace(moved, surfaces=(), box=item.oriented_box), whole)
    moved = replace(moved, surfaces=surfaces)
    return box_around(moved) if motions.keys() - {""} else moved


def motions_by_item(house: House) -> dict[str, dict[str, Motion]]:
    """Item id -> part ("" = the whole item) -> its motion, of all that moves."""
    by_item: dict[str, dict[str, Motion]] = {}
    for motion in house.motions:
        by_item.setdefault(motion.item, {})[motion.part] = motion
    return by_item


def house_at(house: House, time_s: float) -> House:
    """The house at a time in seconds; the motions themselves are kept unchanged."""
    of_item = motions_by_item(house)
    return house.with_items(
        item_at_time(item, of_item[item.id], time_s) if item.id in of_item else item
        for item in house.items
    )


@dataclass(frozen=True)
class MovingHouse:
    """A house with motions and its triangles, static ones collected once, at successive times."""

    house: House
    geometry: Geometry  # of the house at rest
    with_panes: bool = True  # as geometry_from_house was asked

    @staticmethod
    def of(house: House, *, with_panes: bool = True) -> MovingHouse:
        """The house with its triangles; without panes as light meets them."""
        return MovingHouse(house, geometry_from_house(house, with_panes=with_panes), with_panes)

    @cached_property
    def _moving(self) -> tuple[tuple[int, int, str, slice], ...]:
        """(surface number, item's index, part, its rows of positions) of the surfaces that move."""
        of_item, moving, begin = motions_by_item(self.house), [], 0
        is_pane = [m.kind is MaterialKind.PANE for m in self.house.materials]
        for number, (instance, item, _j, surface) in enumerate(self.house.surfaces()):
            if not self.with_panes and is_pane[surface.material]:
                continue
            motions = of_item.get(item.id, {})
            if "" in motions or surface.part in motions:
                rows = slice(begin, begin + len(surface.positions))
                moving.append((number, instance - 1, surface.part, rows))
            begin += len(surface.positions)
        return tuple(moving)

    @cached_property
    def moving_faces(self) -> Bools:
        """(F,) whether a face is of something that moves."""
        numbers = [number for number, *_ in self._moving]
        return np.isin(self.geometry.face_surface, numbers)

    def at(self, time_s: float) -> tuple[House, Geometry]:
        """The house and its triangles at a time; faces keep their numbers."""
        house = house_at(self.house, time_s)
        positions, normals = self.geometry.positions.copy(), self.geometry.normals.copy()
        surfaces = [s for _instance, _item, _j, s in house.surfaces()]
        for number, _index, _part, rows in self._moving:
            surface = surfaces[number]
            positions[rows] = surface.positions
            if surface.normals is not None:
                normals[rows] = surface.normals
        return house, replace(self.geometry, positions=positions, normals=normals)

    def moves_between(self, from_s: float, to_s: float) -> bool:
        """Whether anything moves in that time."""
        keys = {t for motion in self.house.motions for t in motion.times_s if from_s < t < to_s}
        return any(
            bool((self.face_motions(from_s, t)[1] != np.eye(4)).any())
            for t in sorted({*keys, to_s})
        )

    def face_motions(self, from_s: float, to_s: float) -> tuple[I64, F64]:
        """(F,) indices of (M, 4, 4) matrices, 0 the identity, that move faces between times."""
        of_item = motions_by_item(self.house)
        of_surface = np.zeros(1 + max(self.geometry.face_surface, default=-1), np.int64)
        matrices, row_of = [np.eye(4)], dict[tuple[int, str], int]()
        for number, index, part, _rows in self._moving:
            if (index, part) not in row_of:
                item = self.house.items[index]
                begin, end = (matrices_at(item, of_item[item.id], t)[part] for t in (from_s, to_s))
                row_of[index, part] = len(matrices)
                matrices.append(end @ np.linalg.inv(begin))
            of_surface[number] = row_of[index, part]
        return of_surface[self.geometry.face_surface], np.stack(matrices)
