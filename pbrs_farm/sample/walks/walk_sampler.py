"""A person's walk through a home, by fields and seed, as views in the order of time; no effects."""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from scipy import ndimage

from pbrs_farm.core.arrays import F64, I64, FirstHit
from pbrs_farm.core.camera import Camera, Intrinsics, View
from pbrs_farm.core.house import Geometry, House
from pbrs_farm.core.recipe import CameraFields
from pbrs_farm.core.shot import Shot
from pbrs_farm.sample.camera_source import Sampling
from pbrs_farm.sample.stored_cameras import OUTSIDE, sector_of
from pbrs_farm.sample.walks.camera_shake import Shake, shake
from pbrs_farm.sample.walks.gaze import Walker, gaze, things_of
from pbrs_farm.sample.walks.walk_path import relax_path, spline_through, time_walk
from pbrs_farm.sample.walks.walk_space import WalkSpace, shut_doors, walk_spaces
from pbrs_farm.sample.walks.way_graph import way_through_rooms

ORIGIN: Final = "walk"
_EYE_M: Final = (1.5, 1.6)  # above the floor, as the paper's cameras
_STEP_SMOOTH_S: Final = 0.3  # time over which a step in the floor's height is smoothed
_SPEED_PART: Final = 0.95  # share of the speed limit for motion along the floor


def sample_walk(
    house: House, fields: CameraFields, seed: int, geometry: Geometry, first_hit: FirstHit
) -> Sampling:
    """fields.walk_frames views along one walk, in the region with the most free floor and items.

    Rooms are connected by open doors. Consecutive frames are within fields.walk_speed_mps and
    fields.walk_turn_dps. A home without a region 0.6 m wide has no view; the report names its closed doors.
    """
    spaces = walk_spaces(house)
    space = max(spaces, key=lambda s: s.interest, default=None)
    if space is None or not space.region.any():
        return Sampling.of_views(fields, (), (_why_none(spaces),))
    # Find the way, then the walker's positions and gaze.
    rng = np.random.default_rng(seed)
    times = np.arange(fields.walk_frames) / fields.walk_fps
    shaken = shake(times, fields.walk_shake, rng)
    speed = max(_SPEED_PART * (fields.walk_speed_mps - shaken.speed_mps), 0.05)
    way = way_through_rooms(space, speed * float(times[-1]) + 1.0, rng)
    motion = time_walk(spline_through(relax_path(way, space)), times, speed)
    eyes = _eyes(space, motion.places, fields, rng)
    turn_rps = math.radians(fields.walk_turn_dps) - shaken.turn_rps
    azimuth, tilt = gaze(
        Walker(eyes, motion.heading, times),
        things_of(house),
        geometry,
        first_hit,
        max(turn_rps, 0.02),
        rng,
    )
    views = _views_of_walk(house, space, fields, _poses(eyes, azimuth, tilt, shaken))
    notes = _notes(house, space, views, motion.length_m)
    return Sampling.of_views(fields, views, notes)


def _eyes(space: WalkSpace, places: F64, fields: CameraFields, rng: np.random.Generator) -> F64:
    """(N, 3) eyes above the floor of plan places (N, 2); steps between floors are spread."""
    cells = _cells_of_path(space, places)
    floor = space.floor_y[tuple(cells.T)]
    floor = ndimage.gaussian_filter1d(floor, _STEP_SMOOTH_S * fields.walk_fps, mode="nearest")
    height = rng.uniform(*_EYE_M)
    return np.stack([places[:, 0], floor + height, places[:, 1]], axis=1)


def _cells_of_path(space: WalkSpace, places: F64) -> I64:
    cells = space.grid.cells(places)
    return np.clip(cells, 0, np.array(space.grid.shape) - 1)


def _poses(eyes: F64, azimuth: F64, tilt: F64, shaken: Shake) -> F64:
    """(N, 4, 4) world from camera, OpenGL axes."""
    azimuth, tilt = azimuth + shaken.turned[:, 0], tilt + shaken.turned[:, 1]
    towards = np.stack(
        [np.cos(tilt) * np.cos(azimuth), -np.sin(tilt), np.cos(tilt) * np.sin(azimuth)], axis=1
    )
    # Roll turns the picture about the view's axis.
    right = np.stack([-np.sin(azimuth), np.zeros(len(azimuth)), np.cos(azimuth)], axis=1)
    up = np.cross(right, towards)
    c, s = np.cos(shaken.turned[:, 2:]), np.sin(shaken.turned[:, 2:])
    poses = np.zeros((len(eyes), 4, 4))
    poses[:, :3, 0], poses[:, :3, 1] = c * right + s * up, c * up - s * right
    poses[:, :3, 2], poses[:, :3, 3] = -towards, eyes + shaken.moved
    poses[:, 3, 3] = 1.0
    return poses


def _views_of_walk(
    house: House, space: WalkSpace, fields: CameraFields, poses: F64
) -> tuple[View, ...]:
    intrinsics = Intrinsics.from_hfov(
        fields.score_width_px, fields.score_height_px, fields.hfov_rad
    )
    room = space.room[tuple(_cells_of_path(space, poses[:, [0, 2], 3]).T)]
    views: list[View] = []
    for number, (pose, k) in enumerate(zip(poses, room.tolist(), strict=True)):
        # In a doorway the room is the previous one.
        before = views[-1].room_id if views else OUTSIDE
        camera = Camera(intrinsics, pose)
        views.append(
            View(
                Shot.of_frame(number).id,
                house.rooms[k].id if k >= 0 else before,
                sector_of(camera, fields.n_sectors),
                camera,
                ORIGIN,
                frame=number,
                time_s=number / fields.walk_fps,
            )
        )
    return tuple(views)


def _why_none(spaces: tuple[WalkSpace, ...]) -> str:
    shut = [name for space in spaces for name in shut_doors(space)]
    text = "nowhere to walk: no path 0.6 m wide between obstacles"
    return f"{text}; doors that are shut: {', '.join(shut)}" if shut else text


def _notes(
    house: House, space: WalkSpace, views: tuple[View, ...], length_m: float
) -> tuple[str, ...]:
    rooms = list(dict.fromkeys(view.room_id for view in views))
    names = ", ".join(house.room(r).name or r for r in rooms if r != OUTSIDE)
    notes = [f"a walk of {length_m:.1f} m through {names}"]
    if shut := shut_doors(space):
        notes.append(f"closed doors: {', '.join(shut)}")
    return tuple(notes)
