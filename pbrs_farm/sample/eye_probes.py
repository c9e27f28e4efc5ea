"""Test for eyes inside an object, or not above a floor, by the given item counter; no effects."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F64, Bools
from pbrs_farm.core.camera import Camera, Intrinsics
from pbrs_farm.core.house import House, ItemKind, corners_of_surfaces
from pbrs_farm.geometry.heights import highest_below, lowest_above
from pbrs_farm.sample.candidates import cameras_looking

ItemCounter = Callable[[Sequence[Camera]], NDArray[np.uint32]]
"""Pixels of each item in each camera: (n_cameras, n_items + 1), column 0 = nothing."""

# An object that covers more of all directions, and whose box holds the eye, encloses it.
MAX_OBJECT_SHARE: Final = 0.75
# An object whose box is larger is no furniture but a building's shell: being inside is right.
MAX_OBJECT_M3: Final = 12.0
# A wall, floor or ceiling that covers more of all directions encloses the eye.
MAX_STRUCTURE_SHARE: Final = 0.97

_ONE_PLANE_M: Final = 1e-3  # between faces that count as in one plane
_CUBE_PX: Final = 12  # width of a face of the cube around the eye
_COUNTS_PER_CALL: Final = 1 << 22  # numbers in a table of counts: bounds memory
_CAMERAS_PER_CALL: Final = 384  # a multiple of the six faces of a cube
_AXES: Final = ((1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1))


class EnclosureLimits(NamedTuple):
    """When items enclose an eye."""

    bounds: F64  # (I, 2, 3), NaN for what never does
    most: F64  # (I,) share of all directions that an item may cover without enclosing the eye


def count_items(
    counter: ItemCounter, cameras: Sequence[Camera], n_items: int, *, group: int = 1
) -> Iterator[tuple[slice, NDArray[np.uint32]]]:
    """(which cameras, rows (n, n_items + 1)) in bounded parts; group: cameras in a row that stay together."""
    most = max(1, min(_CAMERAS_PER_CALL, _COUNTS_PER_CALL // (n_items + 1)) // group) * group
    for start in range(0, len(cameras), most):
        part = slice(start, min(start + most, len(cameras)))
        rows = counter(cameras[part])
        # Add the columns of items that no camera saw.
        padded = np.zeros((len(rows), n_items + 1), np.uint32)
        padded[:, : rows.shape[1]] = rows
        yield part, padded


def not_above_floor(house: House, eyes: F64, counter: ItemCounter) -> Bools:
    """(N,) bool: the first surface straight below the eye (N, 3) is a wall or a ceiling."""
    # Look straight down with one pixel.
    pencil = Intrinsics.from_hfov(1, 1, 1e-4)
    down = np.array([0.0, -1.0, 0.0])
    cameras = cameras_looking(pencil, eyes, np.broadcast_to(down, eyes.shape), (0.0, 0.0, 1.0))
    bad = [i + 1 for i, x in enumerate(house.items) if x.kind in (ItemKind.WALL, ItemKind.CEILING)]
    above = np.zeros(len(eyes), np.bool_)
    for part, rows in count_items(counter, cameras, len(house.items)):
        above[part] = rows[:, bad].sum(1) > 0
    return above | _in_standing_wall(house, eyes)


def _in_standing_wall(house: House, eyes: F64) -> Bools:
    """(N,) bool: the eye (N, 3) is in a wall whose bottom is in the floor's plane or above."""
    plan, inside = eyes[:, [0, 2]], np.zeros(len(eyes), np.bool_)
    floors = [s for item in house.items if item.kind is ItemKind.FLOOR for s in item.surfaces]
    floor_y = highest_below(plan, corners_of_surfaces(floors), eyes[:, 1])
    for item in house.items:
        if item.kind is not ItemKind.WALL:
            continue
        low, high = item.bounds
        in_box = np.flatnonzero(((eyes > low) & (eyes < high)).all(1))
        if len(in_box):
            wall, y = corners_of_surfaces(item.surfaces), eyes[in_box, 1]
            is_below = highest_below(plan[in_box], wall, y) >= floor_y[in_box] - _ONE_PLANE_M
            inside[in_box] |= is_below & np.isfinite(lowest_above(plan[in_box], wall, y))
    return inside


def enclosed(
    house: House, eyes: F64, counter: ItemCounter, limits: EnclosureLimits | None = None
) -> Bools:
    """(N,) bool: one item all around the eye (N, 3), by a cube's six pictures; limits: of this house, if known."""
    bounds, most = limits or enclosure_limits(house)
    inside = np.zeros(len(eyes), np.bool_)
    in_box = np.flatnonzero(_held_by(bounds, eyes))
    cube = Intrinsics.from_hfov(_CUBE_PX, _CUBE_PX, math.pi / 2)
    cameras = [Camera(cube, pose) for pose in _cube_poses(eyes[in_box])]
    for part, rows in count_items(counter, cameras, len(house.items), group=6):
        # Add up the six faces, and compare with what encloses each item's kind.
        share = rows[:, 1:].reshape(-1, 6, len(house.items)).sum(1) / (6 * _CUBE_PX**2)
        which = in_box[part.start // 6 : part.stop // 6]
        eye = eyes[which, None, :]
        holds = ((eye >= bounds[:, 0]) & (eye <= bounds[:, 1])).all(2)
        inside[which] = (holds & (share > most)).any(1)
    return inside


def _held_by(bounds: F64, eyes: F64) -> Bools:
    """(N,) bool: the box of some item (I, 2, 3) holds the eye (N, 3)."""
    in_box = np.zeros(len(eyes), np.bool_)
    for low, high in bounds:
        in_box |= ((eyes >= low) & (eyes <= high)).all(1)
    return in_box


def _cube_poses(eyes: F64) -> F64:
    """(6 N, 4, 4) poses that look from each eye along the six axes, their pictures a cube."""
    # Turn six cameras at the origin, then move copies to every eye.
    pencil, zero = Intrinsics.from_hfov(1, 1), np.zeros(3)
    poses = np.zeros((len(eyes), 6, 4, 4))
    for k, axis in enumerate(_AXES):
        up = (0.0, 0.0, 1.0) if axis[1] else (0.0, 1.0, 0.0)
        poses[:, k] = Camera.look(pencil, zero, np.array(axis, np.float64), up).world_from_camera
    poses[:, :, :3, 3] = eyes[:, None]
    return poses.reshape(-1, 4, 4)


def enclosure_limits(house: House) -> EnclosureLimits:
    """When each item of a house encloses an eye; looks at all vertices, so keep it where rooms are many."""
    bounds = np.array([item.bounds for item in house.items], np.float64).reshape(-1, 2, 3)
    bounds[[item.is_outside for item in house.items]] = np.nan  # it encloses no eye
    structure = np.array([item.kind.is_structure for item in house.items], np.bool_)
    with np.errstate(invalid="ignore"):
        shell = np.prod(bounds[:, 1] - bounds[:, 0], axis=1) > MAX_OBJECT_M3
    most = np.where(structure | shell, MAX_STRUCTURE_SHARE, MAX_OBJECT_SHARE)
    return EnclosureLimits(bounds, most)
