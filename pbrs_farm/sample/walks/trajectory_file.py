"""A user's trajectory, TUM rows `t x y z qx qy qz qw`, as cameras in time; text only, no effects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from decimal import Decimal
from typing import Final

import numpy as np
from scipy.spatial.transform import Rotation

from pbrs_farm.core.arrays import F64, Bools, FirstHit
from pbrs_farm.core.camera import Camera, Intrinsics, View
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.frames import OPENCV_FROM_OPENGL, affine
from pbrs_farm.core.house import Geometry, House, ItemKind
from pbrs_farm.core.mesh import triangle_corners, unit_normals
from pbrs_farm.core.recipe import CameraFields
from pbrs_farm.core.shot import Shot
from pbrs_farm.sample.stored_cameras import OUTSIDE, room_of, sector_of

MAX_ROWS: Final = 100_000
ORIGIN: Final = "trajectory"
_HEAD: Final = ["timestamp", "tx", "ty"]  # a first row that names its columns begins so
_UNITS: Final = (
    (1e17, 10**9),
    (1e14, 10**6),
    (1e11, 10**3),
)  # least stamp since 1970, units a second
_MOST_GAP_S: Final = (
    10_000.0  # between frames: more is a smaller unit that is not counted from 1970
)
_UNIT: Final = 0.01  # a quaternion's length may differ from 1 by so much
_AXES: Final = np.concatenate([np.eye(3), -np.eye(3)])
_BACKS: Final = 4  # of six rays along the axes: so many backs of walls mean an eye inside one


@dataclass(frozen=True, slots=True, eq=False)
class Pose:
    """One row: time, pose, and its line in the file."""

    line: int
    time_s: float
    world_from_camera: F64  # (4, 4), OpenGL axes


def poses_from_tum(text: str, file: str) -> list[Pose]:
    """The poses of the rows `t x y z qx qy qz qw`, metres and seconds; what follows a # is a comment.

    Stamps since 1970 in milli-, micro- or nanoseconds are known by their size and become seconds.

    The world is the home's, y up; the quaternion turns camera axes x right, y down, z forward
    (TUM's, OpenCV's) into it. Raises BadInput with the file, the row's line and the reason.
    """
    poses: list[Pose] = []
    stamps: list[str] = []  # as written
    for number, line in enumerate(text.splitlines(), start=1):
        words = line.partition("#")[0].replace(",", " ").split()
        if not words or (not poses and words[:3] == _HEAD):
            continue
        if len(poses) == MAX_ROWS:
            raise BadInput(file, f"line {number}", f"more than {MAX_ROWS} rows")
        poses.append(_pose_of_line(words, number, file))
        stamps.append(words[0])
        if len(poses) > 1 and poses[-1].time_s <= poses[-2].time_s:
            text = f"time {stamps[-1]} is not after {stamps[-2]} of the row before"
            hint = "write it with all its digits" if "e" in stamps[-1].lower() else ""
            raise BadInput(file, f"line {number}", text, hint=hint)
    if not poses:
        raise BadInput(file, "", "has no row", hint="rows are t x y z qx qy qz qw")
    return _in_seconds(poses, stamps, file)


def _in_seconds(poses: list[Pose], stamps: list[str], file: str) -> list[Pose]:
    """The poses with times in seconds: stamps since 1970 in a smaller unit are known by their size."""
    times = np.array([pose.time_s for pose in poses])
    largest = np.abs(times).max()
    per_second = next((per for least, per in _UNITS if largest >= least), 1)
    if per_second > 1:
        # Divide the written digits: a float of as many nanoseconds is only accurate to 256 of them.
        return [
            replace(pose, time_s=float(Decimal(stamp) / per_second))
            for pose, stamp in zip(poses, stamps, strict=True)
        ]
    gap = float(np.median(np.diff(times))) if len(times) > 1 else 0.0
    if gap > _MOST_GAP_S:
        text = f"rows are {gap:g} apart: times are seconds, or a smaller unit counted from 1970"
        raise BadInput(file, f"line {poses[1].line}", text, hint="convert times to seconds")
    return poses


def _pose_of_line(words: list[str], line: int, file: str) -> Pose:
    place = f"line {line}"
    if len(words) != 8:
        hint = "t x y z qx qy qz qw"
        if len(words) == 12:
            hint = f"rows of 12 numbers are KITTI's poses without times; expected {hint}"
        raise BadInput(file, place, f"expected 8 numbers, got {len(words)}", hint=hint)
    try:
        numbers = np.array([float(word) for word in words])
    except ValueError:
        raise BadInput(file, place, "expected numbers") from None
    if not np.isfinite(numbers).all():
        name = ["t", "x", "y", "z", "qx", "qy", "qz", "qw"][
            int(np.flatnonzero(~np.isfinite(numbers))[0])
        ]
        raise BadInput(file, place, f"{name} is not finite")
    # A quaternion of length 1 is a rotation; normalise rounded ones.
    quaternion = numbers[4:]
    length = float(np.linalg.norm(quaternion))
    if abs(length - 1) > _UNIT:
        raise BadInput(
            file, place, f"qx qy qz qw is not a unit quaternion: its length is {length:.4g}, not 1"
        )
    world_from_opencv = affine(Rotation.from_quat(quaternion).as_matrix(), numbers[1:4])
    return Pose(line, float(numbers[0]), world_from_opencv @ OPENCV_FROM_OPENGL)


def trajectory_views(
    house: House,
    poses: Sequence[Pose],
    file: str,
    fields: CameraFields,
    geometry: Geometry,
    first_hit: FirstHit,
) -> tuple[View, ...]:
    """A view for each pose, in time. Raises BadInput, naming the row, for an eye inside a wall.

    All views have the recipe's field of view at the scoring size. An eye outside all rooms belongs to
    "outside". file: for the message.
    """
    eyes = np.array([pose.world_from_camera[:3, 3] for pose in poses])
    inside = np.flatnonzero(inside_walls(house, eyes, geometry, first_hit))
    if len(inside):
        pose = poses[int(inside[0])]
        place = ", ".join(f"{v:.2f}" for v in pose.world_from_camera[:3, 3])
        raise BadInput(file, f"line {pose.line}", f"the camera at {place} is inside a wall")
    intrinsics = Intrinsics.from_hfov(
        fields.score_width_px, fields.score_height_px, fields.hfov_rad
    )
    views = []
    for number, pose in enumerate(poses):
        camera = Camera(intrinsics, pose.world_from_camera)
        room = room_of(house, camera)
        views.append(
            View(
                Shot.of_frame(number).id,
                OUTSIDE if room is None else room.id,
                sector_of(camera, fields.n_sectors),
                camera,
                ORIGIN,
                frame=number,
                time_s=pose.time_s,
            )
        )
    return tuple(views)


def inside_walls(house: House, eyes: F64, geometry: Geometry, first_hit: FirstHit) -> Bools:
    """(N,) true if an eye (N, 3) is inside a wall: most rays along the axes hit a wall's back.

    A ray that hits the back of a wall's face starts inside that wall; openings and odd models fool single
    rays, so several axes vote. Needs closed walls: call it after repair.
    """
    if not len(geometry.faces):
        return np.zeros(len(eyes), bool)
    is_wall = np.array([False, *(item.kind is ItemKind.WALL for item in house.items)])
    origins, axes = np.repeat(eyes, len(_AXES), axis=0), np.tile(_AXES, (len(eyes), 1))
    _t, face = first_hit(origins, axes)
    normals = unit_normals(triangle_corners(geometry.positions, geometry.faces[face]))
    back = (face >= 0) & is_wall[geometry.face_item[face]] & ((normals * axes).sum(1) > 0)
    return np.asarray(back.reshape(len(eyes), len(_AXES)).sum(1) >= _BACKS)
